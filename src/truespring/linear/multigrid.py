"""Algebraic multigrid whose coarse levels are built once and turn with the body.

Smoothed aggregation (Vanek, Mandel, Brezina 1996) with the rigid-body modes of the nodes, built for the
tangent of one state. At another state the coarse levels are asked through the rotations Q of the nodes
since then, P -> Q P, while the finest level, where the body is smoothed, is that of the state itself.
One V-cycle is symmetric: a forward sweep of Gauss and Seidel down, a backward one up. The blocks of the finest
level are in single precision, half the memory to move.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, ShortInts, Singles
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import norm, scalar_product

Real = Floats | Singles

# A level of no more unknowns than this is solved with by its inverse.
_COARSEST = 200
_MAX_LEVELS = 20
# Nodes are joined to one aggregate over blocks of at least this size beside those of the diagonal.
_STRONG = 0.04
_POWER_ITERATIONS = 10
# Rows of a product of matrices are made so many at a time; threads share them from so many on.
_SLICE, _SMALLEST_SLAB = 16_384, 64
# So many numbers of a matrix are worth another thread.
_SMALLEST_PIECE = 80_000
# The largest eigenvalue of D^-1 A is estimated from below.
_SAFETY = 1.1


class Matrix(NamedTuple):
    """A symmetric matrix of node blocks as it was assembled, and the directions that are kept out of it.

    Attributes:
        starts, columns: of its rows, columns ascending.
        data: the blocks, shape (n_blocks, k, k).
        held: shape (n_nodes, k).
    """

    starts: ShortInts
    columns: ShortInts
    data: Floats
    held: Bools


@dataclass(eq=False)
class Level:
    """A matrix in the form in which it is iterated with: see `kernels.blocks`."""

    starts: ShortInts
    columns: ShortInts
    lower: Real
    rest: Floats
    inverse: Real
    added: Real
    pieces: list[tuple[int, int]]

    @property
    def shape(self) -> tuple[int, int]:
        """The number of nodes, and of unknowns of each."""
        return self.rest.shape[0], self.rest.shape[1]

    @property
    def n_bytes(self) -> int:
        """Memory taken [bytes]."""
        return sum(array.nbytes for array in (self.columns, self.lower, self.rest, self.inverse))

    @cached_property
    def bounds(self) -> ShortInts:
        """Where the rows of each thread begin, and their number."""
        return np.array([0, *(last for _, last in self.pieces)], dtype=np.int32)

    def product(self, x: Floats, result: Floats) -> float:
        """Write A x to `result`, shape (n, k) both, and return x . A x."""
        from truespring.kernels import blocks
        from truespring.kernels.threads import run_on

        zero, matrix = (0.0,) * self.shape[1], (self.starts, self.columns, self.lower)
        run_on(self.pieces, blocks.product, *matrix, self.rest, x, result, zero)
        blocks.product_across(self.bounds, *matrix, x, result, zero)
        return scalar_product(x, result)


def _worth(n: int, size: int) -> int:
    """How many of n rows have the fewest numbers of a matrix of this size that are worth another thread."""
    return max(1, n * _SMALLEST_PIECE // max(size, 1))


def empty_level(starts: ShortInts, columns: ShortInts, size: int, precision: type[np.floating[Any]]) -> Level:
    """Return room for a matrix of this sparsity, with blocks of `size` rows."""
    from truespring.kernels import blocks
    from truespring.kernels.threads import pieces, run

    n = len(starts) - 1
    counts = np.empty(n, np.int32)
    run(blocks.count_lower, n, starts, columns, counts)
    if (counts < 0).any():
        raise SingularMatrixError(f"the matrix has nothing on the diagonal of node {int(counts.argmin())}")
    lower_starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    lower_columns = np.empty(lower_starts[-1], np.int32)
    run(blocks.take_lower, n, starts, columns, lower_starts, lower_columns)
    lower = np.empty((len(lower_columns), size, size), precision)
    rest, inverse = np.empty((n, size, size)), np.empty((n, size, size), precision)
    added = np.empty((n, size), precision)
    return Level(lower_starts, lower_columns, lower, rest, inverse, added, pieces(n, _worth(n, lower.size)))


def condense(level: Level, matrix: Matrix, scale: float) -> bool:
    """Fill a level with a matrix times `scale`; tell whether every block of the diagonal is positive."""
    from truespring.kernels import blocks
    from truespring.kernels.threads import run

    room = (level.bounds, level.starts, level.lower, level.rest, level.inverse, level.added, (0.0,) * level.shape[1])
    return not any(run(blocks.condense, len(level.rest), *matrix, scale, *room))


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

    @cached_property
    def _room(self) -> list[tuple[Floats, Floats]]:
        """For two vectors of each level: to get it anew for every cycle takes longer than many a loop."""
        shapes = [(len(transfer.starts) - 1, transfer.data.shape[1]) for transfer in self.transfers]
        return [(np.empty(shape), np.empty(shape)) for shape in shapes]

    @property
    def n_bytes(self) -> int:
        """Memory taken [bytes]."""
        transfers = sum(transfer.n_bytes for transfer in self.transfers)
        return self.inverse.nbytes + transfers + sum(level.n_bytes for level in self.levels)

    def cycle(self, finest: Level, turns: Floats, residual: Floats) -> Floats:
        """Return an approximate solution of A z = residual by one V-cycle, shape (n_nodes, dim).

        It is good until the next cycle.
        """
        return self._cycle(0, finest, residual, turns)

    def _cycle(self, depth: int, level: Level, r: Floats, turns: Floats | None) -> Floats:
        from truespring.kernels import blocks, multigrid
        from truespring.kernels.threads import run, run_on

        if depth == len(self.transfers):
            solution = np.empty(r.size)
            blocks.dense(0, r.size, self.inverse, r.ravel(), solution)
            return solution.reshape(r.shape)
        n, size = level.shape
        zero, bounds = (0.0,) * size, level.bounds
        matrix = (level.starts, level.columns, level.lower)
        z, left = self._room[depth]
        run_on(level.pieces, blocks.sweep_forward, *matrix, level.inverse, level.added, r, z, left, zero)
        blocks.subtract_across(bounds, *matrix, z, left, zero)
        if turns is not None:
            run(multigrid.turn_back, n, turns, left, zero)
        transfer = self.transfers[depth]
        n_coarse, n_modes = len(transfer.column_starts) - 1, transfer.data.shape[2]
        modes = (0.0,) * n_modes
        coarse = np.empty((n_coarse, n_modes))
        by_column = (transfer.column_starts, transfer.node, transfer.column_data)
        share = _worth(n_coarse, transfer.data.size)
        run(multigrid.restrict, n_coarse, *by_column, left, coarse, modes, zero, smallest=share)
        coarser = self.levels[depth] if depth < len(self.levels) else level
        correction = self._cycle(depth + 1, coarser, coarse, None)
        by_row = (transfer.starts, transfer.columns, transfer.data)
        share = _worth(n, transfer.data.size)
        if turns is None:
            run(multigrid.prolong, n, *by_row, correction, z, modes, zero, smallest=share)
        else:
            run(multigrid.prolong_turned, n, *by_row, turns, correction, z, modes, zero, smallest=share)
        left[:] = r
        blocks.subtract_across(bounds, *matrix, z, left, zero)
        run_on(level.pieces, blocks.sweep_backward, *matrix, level.inverse, level.added, left, z, zero)
        return z


def build(finest: Level, matrix: Matrix, scale: float, modes: Floats) -> Hierarchy:
    """Return the coarser levels of a matrix times `scale` with near-kernel `modes` of shape (n, k, n_modes).

    `finest` is that matrix, condensed; modes are zero in directions that are held.
    """
    transfers: list[Transfer] = []
    levels: list[Level] = []
    level = finest
    while level.shape[0] * level.shape[1] > _COARSEST and len(transfers) < _MAX_LEVELS:
        coarsened = _coarsen(level, matrix, scale, modes)
        if coarsened is None:
            break
        transfer, modes, matrix = coarsened
        level, scale = empty_level(matrix.starts, matrix.columns, modes.shape[2], np.float64), 1.0
        condense(level, matrix, scale)
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


def _coarsen(level: Level, matrix: Matrix, scale: float, modes: Floats) -> tuple[Transfer, Floats, Matrix] | None:
    """Return the prolongation, the coarse modes and the coarse matrix; None where nothing is gained."""
    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    n = level.shape[0]
    n_modes = modes.shape[2]
    aggregate, n_coarse = _aggregates(matrix)
    if not 0 < n_coarse < n:
        return None
    members = np.argsort(aggregate, kind="stable").astype(np.int32)
    member_starts = np.searchsorted(aggregate[members], np.arange(n_coarse + 1)).astype(np.int32)
    basis, coarse_modes = np.zeros(modes.shape), np.zeros((n_coarse, n_modes, n_modes))
    run(multigrid.tentative, n_coarse, member_starts, members, modes, basis, coarse_modes)

    omega = scale * 4 / 3 / _largest_eigenvalue(level)
    transfer = _smoothed(level, matrix, aggregate, basis, n_coarse, omega)
    # Modes that an aggregate does not know leave rows of zeros: they are held.
    unknown = coarse_modes[:, np.arange(n_modes), np.arange(n_modes)] == 0
    starts, columns, data = _galerkin(matrix, transfer, n_coarse)
    data *= scale
    return transfer, coarse_modes, Matrix(starts, columns, data, unknown)


def _aggregates(matrix: Matrix) -> tuple[ShortInts, int]:
    """The aggregate of each node, -1 where it stands alone, and their number."""
    from pyamg.aggregation import standard_aggregation

    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    n = len(matrix.held)
    keep, sizes = np.zeros(len(matrix.columns), bool), np.empty(n)
    run(multigrid.diagonal_sizes, n, *matrix, sizes)
    run(multigrid.strong, n, *matrix, sizes, _STRONG, keep)
    counts = np.add.reduceat(keep, matrix.starts[:-1], dtype=np.int32)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    graph = sparse.csr_array((np.ones(starts[-1], np.int8), matrix.columns[keep], starts), shape=(n, n))
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
        run(multigrid.smoothed, n, level.inverse, image, smoothed := np.empty_like(x), (0.0,) * size)
        grown = norm(smoothed)
        value, x = grown / norm(x), smoothed / grown
    return _SAFETY * value


def _smoothed(
    level: Level, matrix: Matrix, aggregate: ShortInts, basis: Floats, n_coarse: int, omega: float
) -> Transfer:
    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    n, size = level.shape
    counts = np.zeros(n, np.int32)
    run(multigrid.count_smoothed, n, matrix.starts, matrix.columns, aggregate, n_coarse, counts)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    columns = np.empty(starts[-1], np.int32)
    values = np.empty((starts[-1], size, basis.shape[2]), np.float32)
    known = (*matrix, level.inverse, aggregate, basis, n_coarse, omega)
    run(multigrid.smooth, n, *known, starts, columns, values, (0.0,) * basis.shape[2])
    return Transfer(starts, columns, values, *multigrid.transpose(starts, columns, values, n_coarse))


def _galerkin(matrix: Matrix, transfer: Transfer, n_coarse: int) -> tuple[ShortInts, ShortInts, Floats]:
    """P^T A P: starts, columns, values of shape (n_blocks, modes, modes)."""
    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    n, size = matrix.held.shape
    n_modes = transfer.data.shape[2]

    def pattern(n_rows: int, *factors: ShortInts) -> tuple[ShortInts, ShortInts]:
        counts = np.zeros(n_rows, np.int32)
        run(multigrid.count_product, n_rows, *factors, n_coarse, counts)
        starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        columns = np.empty(starts[-1], np.int32)
        run(multigrid.fill_product, n_rows, *factors, n_coarse, starts, columns)
        return starts, columns

    ap_starts, ap_columns = pattern(n, matrix.starts, matrix.columns, transfer.starts, transfer.columns)
    starts, columns = pattern(n_coarse, transfer.column_starts, transfer.node, ap_starts, ap_columns)
    data = np.zeros((len(columns), n_modes, n_modes))
    a, p = (matrix.starts, matrix.columns, matrix.data), (transfer.starts, transfer.columns, transfer.data)
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
    return starts, columns, data
