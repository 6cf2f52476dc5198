"""Algebraic multigrid whose coarse levels are built once and turn with the body.

Smoothed aggregation (Vanek, Mandel, Brezina 1996) with the rigid-body modes of the nodes, built for the
tangent of one state. At another state the coarse levels are asked through the rotations Q of the nodes
since then, P -> Q P, while the finest level, where the body is smoothed, is that of the state itself.
One V-cycle is symmetric: a forward sweep of Gauss and Seidel down, a backward one up. The blocks of the finest
level are in single precision, half the memory to move.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, ShortInts, Singles
from truespring.solvers.direct import SingularMatrixError
from truespring.solvers.gradients import norm

Real = Floats | Singles

# A level of no more unknowns than this is solved with by its inverse.
_COARSEST = 200
_MAX_LEVELS = 20
# Nodes are joined to one aggregate over blocks of at least this size beside those of the diagonal.
_STRONG = 0.04
_POWER_ITERATIONS = 10
# Rows of a product of matrices are made so many at a time; threads share them from so many on.
_SLICE, _SMALLEST_SLAB = 16_384, 64
# The largest eigenvalue of D^-1 A is estimated from below.
_SAFETY = 1.1


@dataclass(eq=False)
class Level:
    """A matrix in the form in which it is iterated with: see `kernels.blocks`."""

    starts: ShortInts
    columns: ShortInts
    diagonal: ShortInts
    off: Real
    rest: Floats
    inverse: Real

    @property
    def shape(self) -> tuple[int, int]:
        """The number of nodes, and of unknowns of each."""
        return self.rest.shape[0], self.rest.shape[1]

    @property
    def n_bytes(self) -> int:
        """Memory taken [bytes]."""
        return sum(array.nbytes for array in (self.columns, self.off, self.rest, self.inverse))

    def product(self, x: Floats, result: Floats) -> float:
        """Write A x to `result`, shape (n, k) both, and return x . A x."""
        from truespring.kernels import blocks
        from truespring.kernels.threads import run

        n, size = self.shape
        return float(
            sum(run(blocks.product, n, self.starts, self.columns, self.off, self.rest, x, result, (0.0,) * size))
        )


def empty_level(starts: ShortInts, columns: ShortInts, size: int, precision: type[np.floating[Any]]) -> Level:
    """Return room for a matrix of this sparsity, with blocks of `size` rows."""
    from truespring.kernels import blocks
    from truespring.kernels.threads import run

    n = len(starts) - 1
    diagonal = np.full(n, -1, np.int32)
    run(blocks.find_diagonal, n, starts, columns, diagonal)
    if (diagonal < 0).any():
        raise SingularMatrixError(f"the matrix has nothing on the diagonal of node {int(diagonal.argmin())}")
    off = np.empty((len(columns), size, size), precision)
    return Level(starts, columns, diagonal, off, np.empty((n, size, size)), np.empty((n, size, size), precision))


def condense(level: Level, data: Floats, held: Bools, scale: float) -> bool:
    """Fill a level with values of shape (n_blocks, k, k); tell whether every block of the diagonal is positive."""
    from truespring.kernels import blocks
    from truespring.kernels.threads import run

    given = (level.starts, level.columns, level.diagonal, data, held, scale, level.off, level.rest, level.inverse)
    return not any(run(blocks.condense, len(level.rest), *given))


@dataclass(eq=False)
class Transfer:
    """The prolongation from a coarser level, by rows and, for the restriction, by columns."""

    starts: ShortInts
    columns: ShortInts
    data: Singles
    column_starts: ShortInts
    node: ShortInts
    column_data: Singles

    @property
    def n_bytes(self) -> int:
        """Memory taken [bytes]."""
        return sum(array.nbytes for array in (self.columns, self.data, self.node, self.column_data))


@dataclass(eq=False)
class Hierarchy:
    """The coarser levels, frozen.

    Attributes:
        transfers: to the finest level, then between the coarser ones.
        levels: the coarser levels, the finest not among them; the last is given by `inverse` alone.
        inverse: of the coarsest matrix.
    """

    transfers: list[Transfer]
    levels: list[Level]
    inverse: Floats

    @property
    def n_bytes(self) -> int:
        """Memory taken [bytes]."""
        transfers = sum(transfer.n_bytes for transfer in self.transfers)
        return self.inverse.nbytes + transfers + sum(level.n_bytes for level in self.levels)

    def cycle(self, finest: Level, turns: Floats, residual: Floats) -> Floats:
        """Return an approximate solution of A z = residual by one V-cycle, shape (n_nodes, dim)."""
        return self._cycle(0, finest, residual, turns)

    def _cycle(self, depth: int, level: Level, r: Floats, turns: Floats | None) -> Floats:
        from truespring.kernels import blocks, multigrid
        from truespring.kernels.threads import run

        if depth == len(self.transfers):
            solution = np.empty(r.size)
            blocks.dense(0, r.size, self.inverse, r.ravel(), solution)
            return solution.reshape(r.shape)
        n, size = level.shape
        zero = (0.0,) * size
        matrix = (level.starts, level.columns, level.diagonal, level.off)
        z, left = np.empty_like(r), np.empty_like(r)
        run(blocks.sweep_forward, n, *matrix, level.inverse, r, z, zero)
        run(blocks.left_over, n, *matrix, z, left, zero)
        if turns is not None:
            run(multigrid.turn_back, n, turns, left, zero)
        transfer = self.transfers[depth]
        n_coarse, n_modes = len(transfer.column_starts) - 1, transfer.data.shape[2]
        modes = (0.0,) * n_modes
        coarse = np.empty((n_coarse, n_modes))
        by_column = (transfer.column_starts, transfer.node, transfer.column_data)
        run(multigrid.restrict, n_coarse, *by_column, left, coarse, modes, zero)
        coarser = self.levels[depth] if depth < len(self.levels) else level
        correction = self._cycle(depth + 1, coarser, coarse, None)
        by_row = (transfer.starts, transfer.columns, transfer.data)
        if turns is None:
            run(multigrid.prolong, n, *by_row, correction, z, modes, zero)
        else:
            left[:] = 0
            run(multigrid.prolong, n, *by_row, correction, left, modes, zero)
            run(multigrid.add_turned, n, turns, left, z, zero)
        run(blocks.sweep_backward, n, *matrix, level.inverse, r, z.copy(), z, zero)
        return z


def build(finest: Level, modes: Floats) -> Hierarchy:
    """Return the coarser levels of a matrix with near-kernel `modes` of shape (n, k, n_modes)."""
    transfers: list[Transfer] = []
    levels: list[Level] = []
    level = finest
    while level.shape[0] * level.shape[1] > _COARSEST and len(transfers) < _MAX_LEVELS:
        coarsened = _coarsen(level, modes)
        if coarsened is None:
            break
        transfer, modes, level = coarsened
        transfers.append(transfer)
        levels.append(level)
    return Hierarchy(transfers, levels[:-1], _inverse(level))


def _inverse(level: Level) -> Floats:
    """The inverse of the coarsest matrix; of directions that it does not know, zero."""
    n, size = level.shape
    matrix = np.empty((n * size, n * size))
    unit = np.zeros((n, size))
    for column in range(n * size):
        unit.flat[column] = 1.0
        level.product(unit, image := np.empty((n, size)))
        matrix[:, column] = image.ravel()
        unit.flat[column] = 0.0
    values, vectors = np.linalg.eigh((matrix + matrix.T) / 2)
    kept = values > 1e-7 * values[-1]
    return np.ascontiguousarray((vectors[:, kept] / values[kept]) @ vectors[:, kept].T)


def _coarsen(level: Level, modes: Floats) -> tuple[Transfer, Floats, Level] | None:
    """Return the prolongation, the coarse modes and the coarse matrix; None where nothing is gained."""
    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    n = level.shape[0]
    n_modes = modes.shape[2]
    aggregate, n_coarse = _aggregates(level)
    if not 0 < n_coarse < n:
        return None
    members = np.argsort(aggregate, kind="stable").astype(np.int32)
    member_starts = np.searchsorted(aggregate[members], np.arange(n_coarse + 1)).astype(np.int32)
    basis, coarse_modes = np.zeros(modes.shape), np.zeros((n_coarse, n_modes, n_modes))
    run(multigrid.tentative, n_coarse, member_starts, members, modes, basis, coarse_modes)

    omega = 4 / 3 / _largest_eigenvalue(level)
    transfer = _smoothed(level, aggregate, basis, n_coarse, omega)
    coarse_data, starts, columns = _galerkin(level, transfer, n_coarse)
    coarse = empty_level(starts, columns, n_modes, np.float64)
    # Modes that an aggregate does not know leave rows of zeros: ones on the diagonal keep them out.
    unknown = coarse_modes[:, np.arange(n_modes), np.arange(n_modes)] == 0
    condense(coarse, coarse_data, unknown, 1.0)
    return transfer, coarse_modes, coarse


def _aggregates(level: Level) -> tuple[ShortInts, int]:
    """The aggregate of each node, -1 where it stands alone, and their number."""
    from pyamg.aggregation import standard_aggregation

    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    n = level.shape[0]
    keep, sizes = np.zeros(len(level.columns), bool), np.empty(n)
    run(multigrid.diagonal_sizes, n, level.starts, level.off, level.rest, sizes)
    run(multigrid.strong, n, level.starts, level.columns, level.off, sizes, _STRONG, keep)
    counts = np.add.reduceat(keep, level.starts[:-1], dtype=np.int32)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    graph = sparse.csr_array((np.ones(starts[-1], np.int8), level.columns[keep], starts), shape=(n, n))
    joined = sparse.csr_array(standard_aggregation(graph)[0])
    aggregate = np.full(n, -1, np.int32)
    aggregate[np.diff(joined.indptr) > 0] = joined.indices
    return aggregate, joined.shape[1]


def _largest_eigenvalue(level: Level) -> float:
    """Estimate that of D^-1 A by power iteration."""
    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    n, size = level.shape
    x = np.random.default_rng(3).normal(size=(n, size))
    value = 1.0
    for _ in range(_POWER_ITERATIONS):
        level.product(x, image := np.empty_like(x))
        smoothed = np.zeros_like(x)
        run(multigrid.add_turned, n, level.inverse, image, smoothed, (0.0,) * size)
        grown = norm(smoothed)
        value, x = grown / norm(x), smoothed / grown
    return _SAFETY * value


def _smoothed(level: Level, aggregate: ShortInts, basis: Floats, n_coarse: int, omega: float) -> Transfer:
    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    n, size = level.shape
    counts = np.zeros(n, np.int32)
    run(multigrid.count_smoothed, n, level.starts, level.columns, aggregate, n_coarse, counts)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    columns = np.empty(starts[-1], np.int32)
    values = np.empty((starts[-1], size, basis.shape[2]), np.float32)
    matrix = (level.starts, level.columns, level.off, level.rest, level.inverse)
    run(
        multigrid.smooth,
        n,
        *matrix,
        aggregate,
        basis,
        n_coarse,
        omega,
        starts,
        columns,
        values,
        (0.0,) * basis.shape[2],
    )
    return Transfer(starts, columns, values, *multigrid.transpose(starts, columns, values, n_coarse))


def _galerkin(level: Level, transfer: Transfer, n_coarse: int) -> tuple[Floats, ShortInts, ShortInts]:
    """P^T A P: values of shape (n_blocks, modes, modes), starts, columns."""
    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    n, size = level.shape
    n_modes = transfer.data.shape[2]

    def pattern(n_rows: int, *factors: ShortInts) -> tuple[ShortInts, ShortInts]:
        counts = np.zeros(n_rows, np.int32)
        run(multigrid.count_product, n_rows, *factors, n_coarse, counts)
        starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        columns = np.empty(starts[-1], np.int32)
        run(multigrid.fill_product, n_rows, *factors, n_coarse, starts, columns)
        return starts, columns

    ap_starts, ap_columns = pattern(n, level.starts, level.columns, transfer.starts, transfer.columns)
    starts, columns = pattern(n_coarse, transfer.column_starts, transfer.node, ap_starts, ap_columns)
    data = np.zeros((len(columns), n_modes, n_modes))
    a, p = (level.starts, level.columns, level.off, level.rest), (transfer.starts, transfer.columns, transfer.data)
    modes = (0.0,) * n_modes
    for begin in range(0, n, _SLICE):  # A P is larger than A itself: a slice of it at a time
        end = min(begin + _SLICE, n)
        ap = (ap_starts, ap_columns, np.empty((ap_starts[end] - ap_starts[begin], size, n_modes)))
        run(multigrid.multiply, end - begin, begin, *a, *p, n_coarse, *ap, modes, smallest=_SMALLEST_SLAB)
        reached = transfer.columns[transfer.starts[begin] : transfer.starts[end]]
        if reached.size:
            low, n_reached = int(reached.min()), int(np.ptp(reached)) + 1
            to = (*p, *ap, starts, columns, data, modes)
            run(multigrid.add_transposed, n_reached, low, begin, end, *to, smallest=_SMALLEST_SLAB)
    return data, starts, columns
