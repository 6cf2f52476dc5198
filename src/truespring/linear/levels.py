"""Matrices of multigrid levels, in the form that smoothers and products use."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Bools, Floats, ShortInts, Singles
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import scalar_product

Real = Floats | Singles

# Smallest number of matrix entries that is worth another thread.
_SMALLEST_PIECE = 80_000
# Largest number of pieces of a level, unless each then had more than `_LARGE_PIECE` matrix entries: more pieces would
# take more time for the blocks between them, fewer would not be enough for all threads.
_PIECES, _LARGE_PIECE = 8, 2_000_000
# Eigenvalues of the coarsest matrix below this share of the largest are zero.
_KERNEL = 1e-7


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
        bounds: first row of each piece of the smoother, and the number of rows, shape (n_pieces + 1,).
        crossing: rows with crossing blocks, whose columns are in an earlier piece; shape (n_crossing,).
        crossing_ends: index of the block after the last crossing one of each of these rows, shape (n_crossing,).
    """

    starts: ShortInts
    columns: ShortInts
    lower: Real
    rest: Floats
    inverse: Real
    added: Real
    bounds: ShortInts
    crossing: ShortInts
    crossing_ends: ShortInts

    @property
    def shape(self) -> tuple[int, int]:
        """The number of nodes, and of unknowns per node."""
        return self.rest.shape[0], self.rest.shape[1]

    @property
    def n_bytes(self) -> int:
        """Memory of the arrays [bytes]."""
        return sum(array.nbytes for array in (self.columns, self.lower, self.rest, self.inverse))

    def run(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Call function(first, last, bounds, starts, columns, lower, *arguments, zero) on pieces first to last."""
        from truespring.kernels.threads import run

        known = (self.bounds, self.starts, self.columns, self.lower)
        run(function, len(self.bounds) - 1, *known, *arguments, (0.0,) * self.shape[1], smallest=1)

    def across(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Call function(rows, ends, starts, columns, lower, *arguments, zero), for the blocks between pieces."""
        rows = (self.crossing, self.crossing_ends, self.starts, self.columns)
        function(*rows, self.lower, *arguments, (0.0,) * self.shape[1])

    def product(self, x: Floats, result: Floats) -> float:
        """Write A x to `result` and return x . A x; `x` and `result` have shape (n, k)."""
        from truespring.kernels import blocks

        self.run(blocks.product, self.rest, x, result)
        self.across(blocks.product_across, x, result)
        return scalar_product(x, result)


def worth(n: int, size: int) -> int:
    """Return the smallest number of rows that is worth another thread, of n rows with `size` entries together."""
    return max(1, n * _SMALLEST_PIECE // max(size, 1))


def empty_level(starts: ShortInts, columns: ShortInts, size: int, precision: type[np.floating[Any]]) -> Level:
    """Return an uninitialised level for a matrix with the sparsity `starts`, `columns` and blocks of `size` rows.

    Raises SingularMatrixError if a diagonal block is missing.
    """
    from truespring.kernels import blocks
    from truespring.kernels.threads import run

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
    most = max(_PIECES, lower.size // _LARGE_PIECE)
    n_pieces = max(1, min(most, lower.size // _SMALLEST_PIECE))
    bounds = (n * np.arange(n_pieces + 1, dtype=np.int64) // n_pieces).astype(np.int32)
    crossing = _crossing(lower_starts, lower_columns, bounds)
    return Level(lower_starts, lower_columns, lower, rest, inverse, added, bounds, *crossing)


def _crossing(starts: ShortInts, columns: ShortInts, bounds: ShortInts) -> tuple[ShortInts, ShortInts]:
    """Return the rows with crossing blocks, and the index of the block after the last of them, see `Level`."""
    from truespring.kernels import blocks
    from truespring.kernels.threads import run

    counts = np.empty(len(starts) - 1, np.int32)
    run(blocks.count_crossing, len(bounds) - 1, bounds, starts, columns, counts, smallest=1)
    rows = np.flatnonzero(counts).astype(np.int32)
    return rows, starts[rows] + counts[rows]


def condense(level: Level, matrix: Matrix, scale: float) -> bool:
    """Fill a level with a matrix times `scale`; return whether all diagonal blocks are positive definite."""
    from truespring.kernels import blocks
    from truespring.kernels.threads import run

    room = (level.bounds, level.starts, level.lower, level.rest, level.inverse, level.added, (0.0,) * level.shape[1])
    return not any(run(blocks.condense, len(level.rest), *matrix, scale, *room))


def product_pattern(n_rows: int, n_columns: int, *factors: ShortInts) -> tuple[ShortInts, ShortInts]:
    """Return row starts and ascending columns of the product of two sparse matrices.

    `factors` are row starts and columns of the first one, then of the second one, which has `n_columns` columns.
    """
    from truespring.kernels import multigrid
    from truespring.kernels.threads import run

    counts = np.zeros(n_rows, np.int32)
    run(multigrid.count_product, n_rows, *factors, n_columns, counts)
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    columns = np.empty(starts[-1], np.int32)
    run(multigrid.fill_product, n_rows, *factors, n_columns, starts, columns)
    return starts, columns


def inverse_of(matrix: Matrix) -> Floats:
    """Return the inverse of a small matrix, zero on its kernel and in held directions, shape (n k, n k)."""
    from truespring.kernels.threads import one_blas_thread

    n, size = matrix.held.shape
    rows = np.repeat(np.arange(n), np.diff(matrix.starts))
    whole = np.zeros((n, n, size, size))
    whole[rows, matrix.columns] = matrix.data
    dense = whole.transpose(0, 2, 1, 3).reshape(n * size, n * size)
    held = matrix.held.ravel()
    dense[held] = dense[:, held] = 0.0
    with one_blas_thread():
        values, vectors = np.linalg.eigh((dense + dense.T) / 2)
        kept = values > _KERNEL * values[-1]
        return np.ascontiguousarray((vectors[:, kept] / values[kept]) @ vectors[:, kept].T)
