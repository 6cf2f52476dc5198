"""Loops over the rows of a symmetric matrix of node blocks, in the form in which it is iterated with.

Only blocks left of the diagonal are kept, in single precision: each serves its own row, and transposed that
of its column, while it is at hand. The diagonal is kept as `rest`, the sum of a row's blocks, in double: A x at
node i is rest_i x_i + sum A_ij (x_j - x_i). A body moved as a whole has exactly the forces that it should,
however many nodes it has; rounding a spring's block is a spring a little different.

Rows are cut into one piece a thread. A block whose row and column are in different pieces is crossing: the
loops over pieces pass it over where two threads could write to one row, and those over `bounds`, where pieces
begin and the last one ends, see to it.
"""

from typing import Any

import numpy as np

from truespring.kernels.small import each, minus, plus, put, row, times, times_transposed, unsigned
from truespring.kernels.threads import kernel


@kernel
def count_lower(first: int, last: int, starts: Any, columns: Any, counts: Any) -> None:
    """Count the blocks left of the diagonal of each row, whose columns ascend; -1 where there is no diagonal one."""
    for i in range(first, last):
        p = starts[i]
        while p < starts[i + 1] and columns[p] < i:
            p += 1
        counts[i] = p - starts[i] if p < starts[i + 1] and columns[p] == i else -1


@kernel
def take_lower(first: int, last: int, starts: Any, columns: Any, lower_starts: Any, lower_columns: Any) -> None:
    """Write the columns of those blocks."""
    for i in range(first, last):
        for q in range(lower_starts[i], lower_starts[i + 1]):
            lower_columns[q] = columns[starts[i] + q - lower_starts[i]]


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
    """Bring rows to that form, times `scale`, held directions replaced by ones on the diagonal.

    Before it is inverted half the sizes of the crossing blocks are `added` to the diagonal: so the smoother is positive
    wherever pieces are cut (l1 Gauss-Seidel; Baker, Falgout, Kolev, Yang, SIAM J. Sci. Comput. 33, 2011).

    Returns how many diagonal blocks are not positive definite.
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
                        total[c, e] += value  # not as rounded: the sum of a row stays what it is
                        if crossing:
                            work[c, c] += 0.5 * abs(value)
                            added[i, c] += 0.5 * abs(value)
                        if p < own:
                            lower[unsigned(p + shift), c, e] = value
        for c in range(size):  # Gauss and Jordan; the pivots of a positive block are positive
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
def product(first: int, last: int, starts: Any, columns: Any, lower: Any, rest: Any, x: Any, y: Any, zero: Any) -> None:
    """y = A x, but for what crossing blocks give to the rows of other pieces."""
    for i in range(first, last):
        here = row(x, i, zero)
        s = times(rest, i, here, zero)
        for p in range(starts[i], starts[i + 1]):
            j = columns[unsigned(p)]
            d = minus(row(x, j, zero), here)
            s = plus(s, times(lower, p, d, zero))
            if j >= first:
                put(y, j, minus(row(y, j, zero), times_transposed(lower, p, d, zero)))
        put(y, i, s)


@kernel
def product_across(bounds: Any, starts: Any, columns: Any, lower: Any, x: Any, y: Any, zero: Any) -> None:
    """Add that."""
    for piece in range(1, len(bounds) - 1):
        for i in range(bounds[piece], bounds[piece + 1]):
            for p in range(starts[i], starts[i + 1]):
                j = columns[unsigned(p)]
                if j >= bounds[piece]:
                    break
                d = minus(row(x, j, zero), row(x, i, zero))
                put(y, j, minus(row(y, j, zero), times_transposed(lower, p, d, zero)))


@kernel
def rounding(first: int, last: int, starts: Any, columns: Any, data: Any, size: Any, held: Any, zero: Any) -> float:
    """The sum of the squares of |A| |x| over the free directions."""
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
    """Write matrix x, the matrix small and symmetric; numpy would wake all threads for it."""
    for i in range(first, last):
        result[i] = 0.0
    for j in range(len(x)):
        for i in range(first, last):
            result[i] += matrix[j, i] * x[j]


# Gauss and Seidel within the rows of one thread, Jacobi between threads: symmetric, and the same every time.


@kernel
def sweep_forward(
    first: int,
    last: int,
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
    """z = (D + L)^-1 r, D with what is added, and the residual that this leaves, but for crossing blocks."""
    for i in range(first, last):
        s = row(r, i, zero)
        for p in range(starts[i], starts[i + 1]):
            j = columns[unsigned(p)]
            if j >= first:
                s = minus(s, times(lower, p, row(z, j, zero), zero))
        s = times(inverse, i, s, zero)
        put(z, i, s)
        put(left, i, each(row(added, i, zero), s))
        for p in range(starts[i], starts[i + 1]):
            j = columns[unsigned(p)]
            if j >= first:
                put(left, j, minus(row(left, j, zero), times_transposed(lower, p, s, zero)))


@kernel
def sweep_backward(
    first: int, last: int, starts: Any, columns: Any, lower: Any, inverse: Any, added: Any, r: Any, z: Any, zero: Any
) -> None:
    """z becomes z + (D + U)^-1 (r - A z), D with what is added, r less the crossing blocks; r is used up."""
    for i in range(last - 1, first - 1, -1):
        s = plus(row(r, i, zero), each(row(added, i, zero), row(z, i, zero)))
        # Backwards through memory all the way: so it is fetched ahead.
        for p in range(starts[i + 1] - 1, starts[i] - 1, -1):
            j = columns[unsigned(p)]
            if j >= first:
                s = minus(s, times(lower, p, row(z, j, zero), zero))
        s = times(inverse, i, s, zero)
        put(z, i, s)
        for p in range(starts[i + 1] - 1, starts[i] - 1, -1):
            j = columns[unsigned(p)]
            if j >= first:
                put(r, j, minus(row(r, j, zero), times_transposed(lower, p, s, zero)))


@kernel
def subtract_across(bounds: Any, starts: Any, columns: Any, lower: Any, z: Any, r: Any, zero: Any) -> None:
    """Subtract from r what the crossing blocks make of z."""
    for piece in range(1, len(bounds) - 1):
        for i in range(bounds[piece], bounds[piece + 1]):
            for p in range(starts[i], starts[i + 1]):
                j = columns[unsigned(p)]
                if j >= bounds[piece]:
                    break
                put(r, i, minus(row(r, i, zero), times(lower, p, row(z, j, zero), zero)))
                put(r, j, minus(row(r, j, zero), times_transposed(lower, p, row(z, i, zero), zero)))
