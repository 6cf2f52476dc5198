"""Coarse levels by aggregation of nodes, built for one state; they rotate with the body.

Smoothed aggregation (Vanek, Mandel, Brezina 1996) with the rigid-body modes of the nodes, built for the tangent of one
state. At another state the prolongation P becomes Q P with the rotations Q of the nodes since then; the finest level,
with the smoother, is always that of the current state.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, ShortInts, Singles
from truespring.linear.gradients import norm
from truespring.linear.levels import Level, Matrix, condense, empty_level, inverse_of, product_pattern, worth
from truespring.linear.multigrid import Coarsening, Hierarchy, Transfer
from truespring.rigid_modes import rigid_body_modes

# Largest number of unknowns of the coarsest level, which is inverted.
_COARSEST = 200
_MAX_LEVELS = 20
# Smallest size of an off-diagonal block, relative to the diagonal blocks, that joins two nodes in one aggregate.
_STRONG = 0.04
_POWER_ITERATIONS = 10
# Number of rows of a matrix product that are computed at a time, and the smallest number that is worth a thread.
_SLICE, _SMALLEST_SLAB = 16_384, 64
# Levels are built anew if two digits of accuracy take more iterations than this.
_STALE = 25
# Factor of the largest eigenvalue of D^-1 A, which power iteration underestimates.
_SAFETY = 1.1


class Aggregates:
    """Coarse levels by aggregation, built for the first tangent and if they are stale."""

    name = "multigrid"

    def __init__(self, nodes: Floats, held: Bools, rival: tuple[Coarsening, float] | None = None) -> None:
        """Begin with the undeformed positions [m] and the held directions, shape (n_nodes, dim) both.

        `rival` are other coarse levels and their pace, which these must exceed to be kept.
        """
        self._held, self._built_at = held, nodes
        self._rival = rival
        self._hierarchy: Hierarchy | None = None
        self._stale = True

    @property
    def stale(self) -> bool:
        """Whether the next tangent gets new levels."""
        return self._stale

    @property
    def n_bytes(self) -> int:
        """Memory of the levels [bytes]."""
        return 0 if self._hierarchy is None else self._hierarchy.n_bytes

    def after(self, pace: float) -> Coarsening:
        """Return the coarse levels for the next tangent, after one took `pace` iterations for two digits.

        These, built anew if they were slow; the rival if it was faster.
        """
        rival, self._rival = self._rival, None
        if rival is not None and rival[1] <= pace:
            return rival[0]
        self._stale = pace > _STALE
        return self

    def hierarchy(
        self, level: Level, tangent: Matrix, scale: float, positions: Floats, positive: bool
    ) -> Hierarchy | None:
        """Return the coarse levels of a tangent times `scale` at positions [m], whose `level` is the finest.

        None if that is not positive.
        """
        if not positive:
            return None
        if self._stale or self._hierarchy is None:
            modes = rigid_body_modes(positions).reshape(*positions.shape, -1)
            modes = np.where(self._held[:, :, None], 0.0, modes)
            self._hierarchy = build(level, tangent, scale, modes)
            self._built_at, self._stale = positions, False
        if not self._hierarchy.transfers:
            return self._hierarchy
        first, *others = self._hierarchy.transfers
        assert isinstance(first, Blocks)
        turned = Turned(first, self._turns(tangent, positions))
        return Hierarchy([turned, *others], self._hierarchy.levels, self._hierarchy.inverse)

    def _turns(self, tangent: Matrix, positions: Floats) -> Floats:
        """Return the rotation of each node since the levels were built, shape (n_nodes, dim, dim)."""
        from truespring.kernels import multigrid
        from truespring.kernels.threads import run, writable

        n, dim = positions.shape
        turns = np.empty((n, dim, dim))
        around = (tangent.starts, tangent.columns, writable(self._built_at), writable(positions), self._held)
        run(multigrid.rotations, n, *around, turns, (0.0,) * dim)
        return turns


@dataclass(eq=False)
class Blocks:
    """Prolongation by blocks, in compressed rows, and in compressed columns for the restriction.

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

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shapes of vectors on the finer and on the coarser level."""
        _, size, n_modes = self.data.shape
        return (len(self.starts) - 1, size), (len(self.column_starts) - 1, n_modes)

    def restrict(self, fine: Floats, coarse: Floats) -> None:
        """Write P^T fine to `coarse`."""
        from truespring.kernels import multigrid
        from truespring.kernels.threads import run

        by_column = (self.column_starts, self.node, self.column_data)
        zeros = (0.0,) * coarse.shape[1], (0.0,) * fine.shape[1]
        share = worth(len(coarse), self.data.size)
        run(multigrid.restrict, len(coarse), *by_column, fine, coarse, *zeros, smallest=share)

    def prolong(self, coarse: Floats, fine: Floats) -> None:
        """Add P coarse to `fine`."""
        from truespring.kernels import multigrid
        from truespring.kernels.threads import run

        by_row = (self.starts, self.columns, self.data)
        zeros = (0.0,) * coarse.shape[1], (0.0,) * fine.shape[1]
        run(multigrid.prolong, len(fine), *by_row, coarse, fine, *zeros, smallest=worth(len(fine), self.data.size))


@dataclass(eq=False)
class Turned:
    """A prolongation to nodes that rotated since it was built: Q P.

    Attributes:
        blocks: the prolongation P.
        turns: the rotations Q, zero in held directions, shape (n, k, k).
    """

    blocks: Blocks
    turns: Floats

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shapes of vectors on the finer and on the coarser level."""
        return self.blocks.shape

    @property
    def n_bytes(self) -> int:
        """Memory of the arrays [bytes]."""
        return self.blocks.n_bytes + self.turns.nbytes

    def restrict(self, fine: Floats, coarse: Floats) -> None:
        """Write P^T Q^T fine to `coarse`; `fine` is overwritten."""
        from truespring.kernels import multigrid
        from truespring.kernels.threads import run

        run(multigrid.turn_back, len(fine), self.turns, fine, (0.0,) * fine.shape[1])
        self.blocks.restrict(fine, coarse)

    def prolong(self, coarse: Floats, fine: Floats) -> None:
        """Add Q P coarse to `fine`."""
        from truespring.kernels import multigrid
        from truespring.kernels.threads import run

        by_row = (self.blocks.starts, self.blocks.columns, self.blocks.data, self.turns)
        zeros = (0.0,) * coarse.shape[1], (0.0,) * fine.shape[1]
        share = worth(len(fine), self.blocks.data.size)
        run(multigrid.prolong_turned, len(fine), *by_row, coarse, fine, *zeros, smallest=share)


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
    dense = Matrix(matrix.starts, matrix.columns, scale * matrix.data, matrix.held)
    return Hierarchy(transfers, levels[:-1], inverse_of(dense))


def _coarsen(level: Level, matrix: Matrix, scale: float, modes: Floats) -> tuple[Blocks, Floats, Matrix] | None:
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
    return transfer, coarse_modes, Matrix(starts, columns, data, np.ascontiguousarray(unknown))


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


def _smoothed(level: Level, matrix: Matrix, aggregate: ShortInts, basis: Floats, n_coarse: int, omega: float) -> Blocks:
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
    return Blocks(starts, columns, values, *multigrid.transpose(starts, columns, values, n_coarse))


def _galerkin(matrix: Matrix, transfer: Blocks, n_coarse: int) -> tuple[ShortInts, ShortInts, Floats]:
    """Return P^T A P: row starts, columns, blocks of shape (n_blocks, n_modes, n_modes)."""
    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    n, size = matrix.held.shape
    n_modes = transfer.data.shape[2]

    ap_starts, ap_columns = product_pattern(
        n, n_coarse, matrix.starts, matrix.columns, transfer.starts, transfer.columns
    )
    starts, columns = product_pattern(n_coarse, n_coarse, transfer.column_starts, transfer.node, ap_starts, ap_columns)
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
