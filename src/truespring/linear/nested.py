"""Coarse levels by interpolation of nodes from those of coarser meshes (geometric multigrid), anew for each tangent.

The coarse matrices are P^T A P. The interpolation is the same in all directions and refers to undeformed positions: it
holds for a bent body, too, as the displacement of a small part of it is a linear function of undeformed positions.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, ShortInts, Singles
from truespring.linear.aggregates import Aggregates, build
from truespring.linear.levels import Level, Matrix, condense, empty_level, inverse_of, product_pattern, worth
from truespring.linear.multigrid import Coarsening, Hierarchy
from truespring.rigid_modes import rigid_body_modes

# Largest number of unknowns of the coarsest level, which is inverted; aggregates follow if it has more.
_COARSEST = 200
# Aggregates are tried if two digits of accuracy take more iterations than this.
_SLOW = 10
# Number of iterations for positions of coarse nodes.
_FITS = 8


@dataclass(eq=False)
class Interpolation:
    """Interpolation of nodes, the same in all directions, zero in held directions.

    Attributes:
        starts, columns, weights: by rows (nodes), shape (n + 1,), (n_entries,) twice.
        column_starts, nodes, column_weights: by columns (coarse nodes), shape (n_coarse + 1,), (n_entries,) twice.
        free: 1 for free directions, else 0, shape (n, k).
    """

    starts: ShortInts
    columns: ShortInts
    weights: Singles
    column_starts: ShortInts
    nodes: ShortInts
    column_weights: Singles
    free: Singles

    @classmethod
    def of(cls, weights: Any, held: Bools) -> Self:
        """Return the interpolation with `weights`, sparse, of nodes with held directions, shape (n, k)."""
        by_row, by_column = sparse.csr_array(weights), sparse.csc_array(weights)
        by_row.sort_indices()
        by_column.sort_indices()
        return cls(*_in_short(by_row), *_in_short(by_column), np.asarray(~held, np.float32))

    @property
    def shape(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Shapes of vectors on the finer and on the coarser level."""
        n, size = self.free.shape
        return (n, size), (len(self.column_starts) - 1, size)

    @property
    def n_bytes(self) -> int:
        """Memory of the arrays [bytes]."""
        return 2 * (self.columns.nbytes + self.weights.nbytes) + self.free.nbytes

    @property
    def by_row(self) -> tuple[ShortInts, ShortInts, Singles]:
        """Arguments of kernels: the rows."""
        return self.starts, self.columns, self.weights

    @property
    def by_column(self) -> tuple[ShortInts, ShortInts, Singles]:
        """Arguments of kernels: the columns."""
        return self.column_starts, self.nodes, self.column_weights

    def restrict(self, fine: Floats, coarse: Floats) -> None:
        """Write P^T fine to `coarse`; `fine` is zero in held directions."""
        from truespring.kernels import interpolation
        from truespring.kernels.threads import run

        zero = (0.0,) * fine.shape[1]
        share = worth(len(coarse), 4 * self.weights.size)
        run(interpolation.restrict, len(coarse), *self.by_column, fine, coarse, zero, smallest=share)

    def prolong(self, coarse: Floats, fine: Floats) -> None:
        """Add P coarse to `fine`."""
        from truespring.kernels import interpolation
        from truespring.kernels.threads import run

        zero = (0.0,) * fine.shape[1]
        share = worth(len(fine), 4 * self.weights.size)
        run(interpolation.prolong, len(fine), *self.by_row, self.free, coarse, fine, zero, smallest=share)

    def fitted(self, fine: Floats) -> Floats:
        """Return values at the coarse nodes that are interpolated to `fine`, nearly, shape (n_coarse, k)."""
        by_row = sparse.csr_array((self.weights, self.columns, self.starts))
        strength = np.bincount(self.columns, self.weights)[:, None]
        coarse = np.asarray(by_row.T @ fine) / strength
        for _ in range(_FITS):
            coarse += np.asarray(by_row.T @ (fine - by_row @ coarse)) / strength
        return coarse

    def pattern(self, starts: ShortInts, columns: ShortInts) -> tuple[ShortInts, ShortInts]:
        """Return row starts and columns of P^T A P for a matrix A with the given ones."""
        n, n_coarse = len(starts) - 1, len(self.column_starts) - 1
        half = product_pattern(n, n_coarse, starts, columns, self.starts, self.columns)
        return product_pattern(n_coarse, n_coarse, self.column_starts, self.nodes, *half)

    def galerkin(self, fine: Matrix, coarse: Matrix) -> None:
        """Write the blocks of P^T A P of a fine matrix A to those of a coarse one."""
        from truespring.kernels import interpolation
        from truespring.kernels.threads import run

        matrix = (fine.starts, fine.columns, fine.data, self.free)
        to = (coarse.starts, coarse.columns, coarse.data, (0.0,) * self.free.shape[1])
        share = worth(len(coarse.held), fine.data.size)
        run(interpolation.galerkin, len(coarse.held), *matrix, *self.by_row, *self.by_column, *to, smallest=share)


def _in_short(weights: Any) -> tuple[ShortInts, ShortInts, Singles]:
    """Return the arrays of a sparse matrix, for kernels."""
    return weights.indptr.astype(np.int32), weights.indices.astype(np.int32), weights.data.astype(np.float32)


class Nested:
    """Coarse levels by interpolation, with coarse matrices of the current tangent."""

    name = "geometric multigrid"
    stale = True

    def __init__(self, nodes: Floats, held: Bools, interpolations: Sequence[Any]) -> None:
        """Begin with the undeformed positions [m], the held directions, and the weights from level to level.

        `nodes` and `held` have shape (n_nodes, dim); each of `interpolations` is sparse, shape (n, n_coarse).
        """
        self._nodes, self._held = nodes, held
        self._transfers: list[Interpolation] = []
        for weights in interpolations:
            self._transfers.append(Interpolation.of(weights, held))
            held = np.asarray(weights.T @ (~held).astype(float) == 0)  # nodes of held ones only
        self._coarsest_held = held
        self._columns: ShortInts = np.empty(0, np.int32)
        self._matrices: list[Matrix] = []
        self._hierarchy: Hierarchy | None = None
        self._tried = False

    def _coarsest_positions(self, positions: Floats) -> Floats:
        """Return positions of the coarsest nodes that those of all nodes are interpolated from, nearly [m]."""
        for transfer in self._transfers:
            positions = transfer.fitted(positions)
        return positions

    @property
    def n_bytes(self) -> int:
        """Memory of the levels [bytes]."""
        matrices = sum(matrix.columns.nbytes + matrix.data.nbytes for matrix in self._matrices)
        return matrices + (0 if self._hierarchy is None else self._hierarchy.n_bytes)

    def after(self, pace: float) -> Coarsening:
        """Return the coarse levels for the next tangent, after one took `pace` iterations for two digits.

        If these were slow, aggregates are tried once, as in a body with slits, which interpolation closes.
        """
        if pace <= _SLOW or self._tried:
            return self
        self._tried = True
        return Aggregates(self._nodes, self._held, (self, pace))

    def hierarchy(
        self, level: Level, tangent: Matrix, scale: float, positions: Floats, positive: bool
    ) -> Hierarchy | None:
        """Return the coarse levels of a tangent times `scale`, whose `level` is the finest; None if not positive.

        They are valid until the next call.
        """
        if not positive:
            return None
        if self._hierarchy is None or not np.array_equal(tangent.columns, self._columns):
            self._hierarchy = self._allocated(tangent)
            self._columns = tangent.columns
        finer = tangent
        for depth, (transfer, matrix) in enumerate(zip(self._transfers, self._matrices, strict=True)):
            transfer.galerkin(finer, matrix)
            if depth < len(self._hierarchy.levels) and not condense(self._hierarchy.levels[depth], matrix, scale):
                return None
            finer = matrix
        if finer.held.size <= _COARSEST:
            self._hierarchy.inverse = inverse_of(finer) / scale
            return self._hierarchy
        modes = rigid_body_modes(self._coarsest_positions(positions)).reshape(*finer.held.shape, -1)
        modes = np.where(finer.held[:, :, None], 0.0, modes)
        rest = build(self._hierarchy.levels[-1], finer, scale, modes)
        transfers, levels = [*self._hierarchy.transfers, *rest.transfers], [*self._hierarchy.levels, *rest.levels]
        return Hierarchy(transfers, levels, rest.inverse)

    def _allocated(self, tangent: Matrix) -> Hierarchy:
        """Return the levels for a sparsity, not filled."""
        size = tangent.held.shape[1]
        starts, columns = tangent.starts, tangent.columns
        held = [transfer.free == 0 for transfer in self._transfers[1:]]
        self._matrices = []
        for transfer, fixed in zip(self._transfers, [*held, self._coarsest_held], strict=True):
            starts, columns = transfer.pattern(starts, columns)
            self._matrices.append(Matrix(starts, columns, np.empty((len(columns), size, size)), fixed))
        smoothed = self._matrices[:-1] if self._coarsest_held.size <= _COARSEST else self._matrices
        levels = [empty_level(one.starts, one.columns, size, np.float32) for one in smoothed]
        return Hierarchy(self._transfers, levels, None)
