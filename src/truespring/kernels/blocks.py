"""Loops over the rows of a symmetric matrix of node blocks, in the form that iterative solvers use.

Only blocks left of the diagonal are stored, in single precision: each acts on its row and, transposed, on the row of
its column. Instead of the diagonal, the sum `rest` of a row's blocks is stored in double precision: A x at node i is
rest_i x_i + sum A_ij (x_j - x_i). A rigid translation then has exact forces for any number of nodes; rounding a block
only changes the stiffness of a spring slightly.

The rows are divided into pieces, whose number does not depend on that of the threads; a thread has some of them.
`bounds` are the first row of each piece, then the number of rows, shape (n_pieces + 1,); `first` and `last` of loops
with `bounds` are pieces. A block whose row and column are in different pieces is crossing: loops over pieces skip it
where two threads could write to one row, and `product_across` and `subtract_across` add it.

Unless stated, `starts`, `columns` and `lower` are of the blocks left of the diagonal. `zero` has length k, the number
of unknowns per node.
"""

from typing import Any

import numpy as np

from truespring.kernels.small import each, minus, plus, put, row, times, times_transposed, unsigned
from truespring.kernels.threads import kernel


@kernel
def count_lower(first: int, last: int, starts: Any, columns: Any, counts: Any) -> None:
    """Count the blocks left of the diagonal of each row, -1 if the diagonal block is missing.

    Shapes: starts (n + 1,), columns (n_blocks,) of all blocks; counts (n,).
    """
    for i in range(first, last):
        p = starts[i]
        while p < starts[i + 1] and columns[p] < i:
            p += 1
        counts[i] = p - starts[i] if p < starts[i + 1] and columns[p] == i else -1


@kernel
def take_lower(first: int, last: int, starts: Any, columns: Any, lower_starts: Any, lower_columns: Any) -> None:
    """Write the columns of the blocks left of the diagonal.

    Shapes: starts (n + 1,), columns (n_blocks,) of all blocks; lower_starts (n + 1,), lower_columns (n_lower,).
    """
    for i in range(first, last):
        for q in range(lower_starts[i], lower_starts[i + 1]):
            lower_columns[q] = columns[starts[i] + q - lower_starts[i]]


@kernel
def count_crossing(first: int, last: int, bounds: Any, starts: Any, columns: Any, counts: Any) -> None:
    """Write the number of blocks of each row left of the diagonal whose columns are in an earlier piece.

    Shapes: bounds (n_pieces + 1,), starts (n + 1,), columns (n_lower,), counts (n,).
    """
    for piece in range(first, last):
        for i in range(bounds[piece], bounds[piece + 1]):
            counts[i] = 0
            for p in range(starts[i], starts[i + 1]):
                if columns[p] >= bounds[piece]:
                    break
                counts[i] += 1


@kernel
def condense(
    first: int,
    last: int,
    starts: Any,
    columns: Any,
    data: Any,
    held: Any,
    scale: float,
    bounds: Any,
    lower_starts: Any,
    lower: Any,
    rest: Any,
    inverse: Any,
    added: Any,
    zero: Any,
) -> int:
    """Convert rows to the form of this module, times `scale`, with ones on the diagonal for held directions.

    Half the sizes of the crossing blocks are `added` to the diagonal before it is inverted: the smoother is then
    positive for any pieces (l1 Gauss-Seidel; Baker, Falgout, Kolev, Yang, SIAM J. Sci. Comput. 33, 2011).

    Shapes: starts (n + 1,), columns (n_blocks,), data (n_blocks, k, k), held (n, k); bounds (n_pieces + 1,),
    lower_starts (n + 1,), lower (n_lower, k, k), rest, inverse (n, k, k), added (n, k).
    Returns the number of diagonal blocks that are not positive definite.
    """
    size = len(zero)  # known when compiled
    work, total = np.empty((size, 2 * size)), np.empty((size, size))
    bad, piece = 0, 0
    for i in range(first, last):
        while bounds[piece + 1] <= i:
            piece += 1
        shift = lower_starts[i] - starts[i]
        own = lower_starts[i + 1] - shift
        for c in range(size):
            for e in range(size):
                value = scale * data[own, c, e]
                if held[i, c] or held[i, e]:
                    value = 1.0 if c == e else 0.0
                total[c, e] = value
                work[c, e] = value
                work[c, size + e] = 1.0 if c == e else 0.0
            added[i, c] = 0.0
        for p in range(starts[i], starts[i + 1]):
            if p != own:
                j = columns[p]
                crossing = j < bounds[piece] or j >= bounds[piece + 1]
                for c in range(size):
                    for e in range(size):
                        value = 0.0 if held[i, c] or held[unsigned(j), e] else scale * data[unsigned(p), c, e]
                        total[c, e] += value  # in double precision: the sum of a row stays exact
                        if crossing:
                            work[c, c] += 0.5 * abs(value)
                            added[i, c] += 0.5 * abs(value)
                        if p < own:
                            lower[unsigned(p + shift), c, e] = value
        for c in range(size):  # Gauss-Jordan elimination; the pivots of a positive definite block are positive
            pivot = work[c, c]
            if not pivot > 0.0:
                bad += 1
                pivot = 1.0
                for e in range(2 * size):
                    work[c, e] = 0.0
            for e in range(2 * size):
                work[c, e] /= pivot
            for other in range(size):
                if other != c:
                    factor = work[other, c]
                    for e in range(2 * size):
                        work[other, e] -= factor * work[c, e]
        for c in range(size):
            for e in range(size):
                inverse[i, c, e] = work[c, size + e]
                rest[i, c, e] = total[c, e]
    return bad


@kernel
def product(
    first: int, last: int, bounds: Any, starts: Any, columns: Any, lower: Any, rest: Any, x: Any, y: Any, zero: Any
) -> None:
    """Write y = A x without the contributions of crossing blocks to rows of other pieces.

    Shapes: bounds (n_pieces + 1,), starts (n + 1,), columns (n_lower,), lower (n_lower, k, k), rest (n, k, k), x, y
    (n, k).
    """
    for piece in range(first, last):
        begin = bounds[piece]
        for i in range(begin, bounds[piece + 1]):
            here = row(x, i, zero)
            s = times(rest, i, here, zero)
            for p in range(starts[i], starts[i + 1]):
                j = columns[unsigned(p)]
                d = minus(row(x, j, zero), here)
                s = plus(s, times(lower, p, d, zero))
                if j >= begin:
                    put(y, j, minus(row(y, j, zero), times_transposed(lower, p, d, zero)))
            put(y, i, s)


@kernel
def product_across(rows: Any, ends: Any, starts: Any, columns: Any, lower: Any, x: Any, y: Any, zero: Any) -> None:
    """Add to y the contributions of crossing blocks to rows of other pieces, which `product` omits.

    Shapes: rows, ends (n_crossing,), see `Level`, starts (n + 1,), columns (n_lower,), lower (n_lower, k, k), x, y
    (n, k).
    """
    for at in range(len(rows)):
        i = rows[at]
        for p in range(starts[i], ends[at]):
            j = columns[unsigned(p)]
            d = minus(row(x, j, zero), row(x, i, zero))
            put(y, j, minus(row(y, j, zero), times_transposed(lower, p, d, zero)))


@kernel
def rounding(first: int, last: int, starts: Any, columns: Any, data: Any, size: Any, held: Any, zero: Any) -> float:
    """Return the sum of the squares of |A| |x| over the free directions.

    Shapes: starts (n + 1,), columns (n_blocks,), data (n_blocks, k, k) of all blocks; size = |x|, held (n, k).
    """
    total = 0.0
    for i in range(first, last):
        for c in range(data.shape[1]):
            if not held[i, c]:
                s = 0.0
                for p in range(starts[i], starts[i + 1]):
                    for e in range(data.shape[1]):
                        s += abs(data[p, c, e]) * size[columns[unsigned(p)], e]
                total += s * s
    return total


@kernel
def dense(first: int, last: int, matrix: Any, x: Any, result: Any) -> None:
    """Write the product of a small symmetric matrix and x; NumPy would start all threads for it.

    Shapes: matrix (n, n), x, result (n,).
    """
    for i in range(first, last):
        result[i] = 0.0
    for j in range(len(x)):
        for i in range(first, last):
            result[i] += matrix[j, i] * x[j]


# Gauss-Seidel within pieces, Jacobi between them: symmetric, and independent of the number of threads.


@kernel
def sweep_forward(
    first: int,
    last: int,
    bounds: Any,
    starts: Any,
    columns: Any,
    lower: Any,
    inverse: Any,
    added: Any,
    r: Any,
    z: Any,
    left: Any,
    zero: Any,
) -> None:
    """Write z = (D + L)^-1 r, with `added` in D, and the residual `left` of z, without crossing blocks.

    Shapes: bounds (n_pieces + 1,), starts (n + 1,), columns (n_lower,), lower (n_lower, k, k), inverse (n, k, k),
    added, r, z, left (n, k).
    """
    for piece in range(first, last):
        begin = bounds[piece]
        for i in range(begin, bounds[piece + 1]):
            s = row(r, i, zero)
            for p in range(starts[i], starts[i + 1]):
                j = columns[unsigned(p)]
                if j >= begin:
                    s = minus(s, times(lower, p, row(z, j, zero), zero))
            s = times(inverse, i, s, zero)
            put(z, i, s)
            put(left, i, each(row(added, i, zero), s))
            for p in range(starts[i], starts[i + 1]):
                j = columns[unsigned(p)]
                if j >= begin:
                    put(left, j, minus(row(left, j, zero), times_transposed(lower, p, s, zero)))


@kernel
def sweep_backward(
    first: int,
    last: int,
    bounds: Any,
    starts: Any,
    columns: Any,
    lower: Any,
    inverse: Any,
    added: Any,
    r: Any,
    z: Any,
    zero: Any,
) -> None:
    """Add (D + U)^-1 (r - A z) to z, with `added` in D; r excludes the crossing blocks and is overwritten.

    Shapes: bounds (n_pieces + 1,), starts (n + 1,), columns (n_lower,), lower (n_lower, k, k), inverse (n, k, k),
    added, r, z (n, k).
    """
    for piece in range(last - 1, first - 1, -1):
        begin = bounds[piece]
        for i in range(bounds[piece + 1] - 1, begin - 1, -1):
            s = plus(row(r, i, zero), each(row(added, i, zero), row(z, i, zero)))
            # Backwards through memory without exception, so that the processor prefetches.
            for p in range(starts[i + 1] - 1, starts[i] - 1, -1):
                j = columns[unsigned(p)]
                if j >= begin:
                    s = minus(s, times(lower, p, row(z, j, zero), zero))
            s = times(inverse, i, s, zero)
            put(z, i, s)
            for p in range(starts[i + 1] - 1, starts[i] - 1, -1):
                j = columns[unsigned(p)]
                if j >= begin:
                    put(r, j, minus(row(r, j, zero), times_transposed(lower, p, s, zero)))


@kernel
def subtract_across(rows: Any, ends: Any, starts: Any, columns: Any, lower: Any, z: Any, r: Any, zero: Any) -> None:
    """Subtract from r the product of the crossing blocks and z.

    Shapes: rows, ends (n_crossing,), see `Level`, starts (n + 1,), columns (n_lower,), lower (n_lower, k, k), z, r
    (n, k).
    """
    for at in range(len(rows)):
        i = rows[at]
        for p in range(starts[i], ends[at]):
            j = columns[unsigned(p)]
            put(r, i, minus(row(r, i, zero), times(lower, p, row(z, j, zero), zero)))
            put(r, j, minus(row(r, j, zero), times_transposed(lower, p, row(z, i, zero), zero)))
