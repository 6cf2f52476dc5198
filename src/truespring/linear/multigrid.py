"""Algebraic multigrid whose coarse levels are built once and rotate with the body.

Smoothed aggregation (Vanek, Mandel, Brezina 1996) with the rigid-body modes of the nodes, built for the tangent of one
state. At another state the prolongation P becomes Q P with the rotations Q of the nodes since then; the finest level,
with the smoother, is always that of the current state. The V-cycle is symmetric: a forward Gauss-Seidel sweep on the
way down, a backward sweep on the way up. Blocks of the finest level are in single precision, which halves the memory
traffic.
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

# Largest number of unknowns of the coarsest level, which is inverted.
_COARSEST = 200
_MAX_LEVELS = 20
# Smallest size of an off-diagonal block, relative to the diagonal blocks, that joins two nodes in one aggregate.
_STRONG = 0.04
_POWER_ITERATIONS = 10
# Number of rows of a matrix product that are computed at a time, and the smallest number that is worth a thread.
_SLICE, _SMALLEST_SLAB = 16_384, 64
# Smallest number of matrix entries that is worth another thread.
_SMALLEST_PIECE = 80_000
# Factor of the largest eigenvalue of D^-1 A, which power iteration underestimates.
_SAFETY = 1.1


class Matrix(NamedTuple):
    """A symmetric matrix of node blocks in compressed rows, and its held directions.

    Attributes:
        starts, columns: row starts and ascending columns, shape (n_nodes + 1,) and (n_blocks,).
        data: blocks, shape (n_blocks, k, k).
        held: true for directions that are excluded, shape (n_nodes, k).
    """

    starts: ShortInts
    columns: ShortInts
    data: Floats
    held: Bools


@dataclass(eq=False)
class Level:
    """A matrix in the form of `kernels.blocks`.

    Attributes:
        starts, columns: row starts and columns of the blocks left of the diagonal, shape (n + 1,) and (n_lower,).
        lower: these blocks, shape (n_lower, k, k).
        rest: sum of the blocks of each row, shape (n, k, k).
        inverse: inverse of each diagonal block with `added`, shape (n, k, k).
        added: added to the diagonal for the smoother, shape (n, k).
        pieces: range of rows of each thread.
    """

    starts: ShortInts
    columns: ShortInts
    lower: Real
    rest: Floats
    inverse: Real
    added: Real
    pieces: list[tuple[int, int]]

    @property
    def shape(self) -> tuple[int, int]:
        """The number of nodes, and of unknowns per node."""
        return self.rest.shape[0], self.rest.shape[1]

    @property
    def n_bytes(self) -> int:
        """Memory of the arrays [bytes]."""
        return sum(array.nbytes for array in (self.columns, self.lower, self.rest, self.inverse))

    @cached_property
    def bounds(self) -> ShortInts:
        """First row of each thread, and the number of rows, shape (n_threads + 1,)."""
        return np.array([0, *(last for _, last in self.pieces)], dtype=np.int32)

    def product(self, x: Floats, result: Floats) -> float:
        """Write A x to `result` and return x . A x; `x` and `result` have shape (n, k)."""
        from truespring.kernels import blocks
        from truespring.kernels.threads import run_on

        zero, matrix = (0.0,) * self.shape[1], (self.starts, self.columns, self.lower)
        run_on(self.pieces, blocks.product, *matrix, self.rest, x, result, zero)
        blocks.product_across(self.bounds, *matrix, x, result, zero)
        return scalar_product(x, result)


def _worth(n: int, size: int) -> int:
    """Return the smallest number of rows that is worth another thread, of n rows with `size` entries together."""
    return max(1, n * _SMALLEST_PIECE // max(size, 1))


def empty_level(starts: ShortInts, columns: ShortInts, size: int, precision: type[np.floating[Any]]) -> Level:
    """Return an uninitialised level for a matrix with the sparsity `starts`, `columns` and blocks of `size` rows.

    Raises SingularMatrixError if a diagonal block is missing.
    """
    from truespring.kernels import blocks
    from truespring.kernels.threads import pieces, run

    n = len(starts) - 1
    counts = np.empty(n, np.int32)
    run(blocks.count_lower, n, starts, columns, counts)
    if (counts < 0).any():
        raise SingularMatrixError(f"the matrix has no diagonal block for node {int(counts.argmin())}")
    lower_starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    lower_columns = np.empty(lower_starts[-1], np.int32)
    run(blocks.take_lower, n, starts, columns, lower_starts, lower_columns)
    lower = np.empty((len(lower_columns), size, size), precision)
    rest, inverse = np.empty((n, size, size)), np.empty((n, size, size), precision)
    added = np.empty((n, size), precision)
    return Level(lower_starts, lower_columns, lower, rest, inverse, added, pieces(n, _worth(n, lower.size)))


def condense(level: Level, matrix: Matrix, scale: float) -> bool:
    """Fill a level with a matrix times `scale`; return whether all diagonal blocks are positive definite."""
    from truespring.kernels import blocks
    from truespring.kernels.threads import run

    room = (level.bounds, level.starts, level.lower, level.rest, level.inverse, level.added, (0.0,) * level.shape[1])
    return not any(run(blocks.condense, len(level.rest), *matrix, scale, *room))


@dataclass(eq=False)
class Transfer:
    """Prolongation from a coarser level, in compressed rows, and in compressed columns for the restriction.

    Attributes:
        starts, columns: row starts and columns (aggregates), shape (n + 1,) and (n_blocks,).
        data: blocks, shape (n_blocks, k, n_modes).
        column_starts, node: column starts and rows (nodes), shape (n_coarse + 1,) and (n_blocks,).
        column_data: transposed blocks by column, shape (n_blocks, n_modes, k).
    """

    starts: ShortInts
    columns: ShortInts
    data: Singles
    column_starts: ShortInts
    node: ShortInts
    column_data: Singles

    @property
    def n_bytes(self) -> int:
        """Memory of the arrays [bytes]."""
        return sum(array.nbytes for array in (self.columns, self.data, self.node, self.column_data))


@dataclass(eq=False)
class Hierarchy:
    """The coarser levels, fixed after they are built.

    Attributes:
        transfers: prolongation to the finest level, then to each coarser one.
        levels: levels between the finest and the coarsest one.
        inverse: inverse of the coarsest matrix, shape (n, n); None if the coarsest level is only smoothed, as its nodes
            have no strong neighbours.
    """

    transfers: list[Transfer]
    levels: list[Level]
    inverse: Floats | None

    @cached_property
    def _room(self) -> list[tuple[Floats, Floats]]:
        """Two vectors for each level, shape (n, k) each, allocated once: allocation is slow."""
        shapes = [(len(transfer.starts) - 1, transfer.data.shape[1]) for transfer in self.transfers]
        return [(np.empty(shape), np.empty(shape)) for shape in shapes]

    @property
    def n_bytes(self) -> int:
        """Memory of all levels [bytes]."""
        transfers = sum(transfer.n_bytes for transfer in self.transfers)
        dense = 0 if self.inverse is None else self.inverse.nbytes
        return dense + transfers + sum(level.n_bytes for level in self.levels)

    def cycle(self, finest: Level, turns: Floats, residual: Floats) -> Floats:
        """Return an approximate solution z [m] of A z = residual by one V-cycle, shape (n_nodes, dim).

        The next cycle overwrites it.

        `turns` are the rotations of the nodes, shape (n_nodes, dim, dim).
        """
        return self._cycle(0, finest, residual, turns)

    def _cycle(self, depth: int, level: Level, r: Floats, turns: Floats | None) -> Floats:
        """Return an approximate solution on the level `depth`; only the finest has `turns`."""
        from truespring.kernels import blocks
        from truespring.kernels.threads import run_on

        coarsest = depth == len(self.transfers)
        if coarsest and self.inverse is not None:
            solution = np.empty(r.size)
            blocks.dense(0, r.size, self.inverse, r.ravel(), solution)
            return solution.reshape(r.shape)
        zero, bounds = (0.0,) * level.shape[1], level.bounds
        matrix = (level.starts, level.columns, level.lower)
        z, left = (np.empty(r.shape), np.empty(r.shape)) if coarsest else self._room[depth]
        run_on(level.pieces, blocks.sweep_forward, *matrix, level.inverse, level.added, r, z, left, zero)
        if not coarsest:
            blocks.subtract_across(bounds, *matrix, z, left, zero)
            self._correct(depth, level, z, left, turns)
        left[:] = r
        blocks.subtract_across(bounds, *matrix, z, left, zero)
        run_on(level.pieces, blocks.sweep_backward, *matrix, level.inverse, level.added, left, z, zero)
        return z

    def _correct(self, depth: int, level: Level, z: Floats, left: Floats, turns: Floats | None) -> None:
        """Add the correction of the coarser levels to z on the level `depth`; its residual `left` is overwritten."""
        from truespring.kernels import multigrid
        from truespring.kernels.threads import run

        n, size = level.shape
        zero = (0.0,) * size
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


def build(finest: Level, matrix: Matrix, scale: float, modes: Floats) -> Hierarchy:
    """Return the coarser levels of a matrix times `scale`.

    `finest` is the level of that matrix. `modes` span its near-kernel, shape (n, k, n_modes), zero in held directions.
    """
    transfers: list[Transfer] = []
    levels: list[Level] = []
    level = finest
    while level.shape[0] * level.shape[1] > _COARSEST:
        coarsened = _coarsen(level, matrix, scale, modes) if len(transfers) < _MAX_LEVELS else None
        if coarsened is None:
            return Hierarchy(transfers, levels, None)
        transfer, modes, matrix = coarsened
        level, scale = empty_level(matrix.starts, matrix.columns, modes.shape[2], np.float64), 1.0
        condense(level, matrix, scale)
        transfers.append(transfer)
        levels.append(level)
    return Hierarchy(transfers, levels[:-1], _inverse(level))


def _inverse(level: Level) -> Floats:
    """Return the inverse of a level's matrix, shape (n k, n k), zero on its kernel."""
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
    """Return the prolongation, the coarse modes and the coarse matrix; None if they are no smaller."""
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
    # Modes that an aggregate does not represent give rows of zeros: they are held.
    unknown = coarse_modes[:, np.arange(n_modes), np.arange(n_modes)] == 0
    starts, columns, data = _galerkin(matrix, transfer, n_coarse)
    data *= scale
    return transfer, coarse_modes, Matrix(starts, columns, data, unknown)


def _aggregates(matrix: Matrix) -> tuple[ShortInts, int]:
    """Return the aggregate of each node, shape (n_nodes,), and the number of aggregates.

    It is -1 for nodes without strong neighbours, for which the smoother suffices.
    """
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
    return aggregate, int(aggregate.max()) + 1


def _largest_eigenvalue(level: Level) -> float:
    """Return an estimate of the largest eigenvalue of D^-1 A, by power iteration."""
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
    """Return the smoothed prolongation (I - omega D^-1 A) T of the tentative one T, given by `basis`."""
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
    """Return P^T A P: row starts, columns, blocks of shape (n_blocks, n_modes, n_modes)."""
    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    n, size = matrix.held.shape
    n_modes = transfer.data.shape[2]

    def pattern(n_rows: int, *factors: ShortInts) -> tuple[ShortInts, ShortInts]:
        """Return row starts and columns of the product of two sparse matrices."""
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
    for begin in range(0, n, _SLICE):  # A P is larger than A: compute it in slices
        end = min(begin + _SLICE, n)
        ap = (ap_starts, ap_columns, np.empty((ap_starts[end] - ap_starts[begin], size, n_modes)))
        run(multigrid.multiply, end - begin, begin, *a, *p, n_coarse, *ap, modes, smallest=_SMALLEST_SLAB)
        reached = transfer.columns[transfer.starts[begin] : transfer.starts[end]]
        if reached.size:
            low, n_reached = int(reached.min()), int(np.ptp(reached)) + 1
            to = (*p, *ap, starts, columns, data, modes)
            run(multigrid.add_transposed, n_reached, low, begin, end, *to, smallest=_SMALLEST_SLAB)
    return starts, columns, data
