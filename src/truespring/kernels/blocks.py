"""Loops over the rows of a symmetric matrix of node blocks, in the form in which it is iterated with.

The blocks beside the diagonal are in single precision; that of the diagonal is kept as `rest`, the sum
of a row's blocks, in double: A x at node i is rest_i x_i + sum A_ij (x_j - x_i). A body moved as a whole
has exactly the forces that it should, however many nodes it has; rounding a spring's block is a spring
a little different.
"""

from typing import Any

import numpy as np

from truespring.kernels.small import dot, minus, plus, put, row, times, unsigned
from truespring.kernels.threads import kernel


@kernel
def find_diagonal(first: int, last: int, starts: Any, columns: Any, diagonal: Any) -> None:
    """The place of the diagonal block of each row."""
    for i in range(first, last):
        for p in range(starts[i], starts[i + 1]):
            if columns[p] == i:
                diagonal[i] = p


@kernel
def condense(
    first: int,
    last: int,
    starts: Any,
    columns: Any,
    diagonal: Any,
    data: Any,
    held: Any,
    scale: float,
    off: Any,
    rest: Any,
    inverse: Any,
) -> int:
    """Bring rows to that form, times `scale`, held directions replaced by ones on the diagonal.

    Returns how many diagonal blocks are not positive definite.
    """
    size = data.shape[1]
    work = np.empty((size, 2 * size))
    bad = 0
    for i in range(first, last):
        own = diagonal[i]
        for c in range(size):
            for e in range(size):
                value = scale * data[own, c, e]
                if held[i, c] or held[i, e]:
                    value = 1.0 if c == e else 0.0
                rest[i, c, e] = value
                work[c, e] = value
                work[c, size + e] = 1.0 if c == e else 0.0
                off[own, c, e] = 0.0
        for p in range(starts[i], starts[i + 1]):
            if p != own:
                j = columns[p]
                for c in range(size):
                    for e in range(size):
                        value = 0.0 if held[i, c] or held[j, e] else scale * data[p, c, e]
                        off[p, c, e] = value
                        rest[i, c, e] += value  # not as rounded: the sum of a row stays what it is
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
    return bad


@kernel
def product(
    first: int, last: int, starts: Any, columns: Any, off: Any, rest: Any, x: Any, result: Any, zero: Any
) -> float:
    """A x, and the sum x . A x over the rows."""
    total = 0.0
    for i in range(first, last):
        here = row(x, i, zero)
        s = times(rest, i, here, zero)
        for p in range(starts[i], starts[i + 1]):
            s = plus(s, times(off, p, minus(row(x, columns[unsigned(p)], zero), here), zero))
        put(result, i, s)
        total += dot(here, s)
    return total


@kernel
def rounding(first: int, last: int, starts: Any, columns: Any, data: Any, size: Any, held: Any) -> float:
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
    first: int, last: int, starts: Any, columns: Any, diagonal: Any, off: Any, inverse: Any, r: Any, z: Any, zero: Any
) -> None:
    """z = (D + L)^-1 r."""
    for i in range(first, last):
        s = row(r, i, zero)
        for p in range(starts[i], diagonal[i]):
            j = columns[unsigned(p)]
            if j >= first:
                s = minus(s, times(off, p, row(z, j, zero), zero))
        s = times(inverse, i, s, zero)
        put(z, i, s)


@kernel
def left_over(
    first: int, last: int, starts: Any, columns: Any, diagonal: Any, off: Any, z: Any, left: Any, zero: Any
) -> None:
    """The residual that a forward sweep from zero leaves: only blocks that it did not use make it."""
    for i in range(first, last):
        s = zero
        for p in range(starts[i], diagonal[i]):
            if columns[unsigned(p)] >= first:
                break
            s = minus(s, times(off, p, row(z, columns[unsigned(p)], zero), zero))
        for p in range(diagonal[i] + 1, starts[i + 1]):
            s = minus(s, times(off, p, row(z, columns[unsigned(p)], zero), zero))
        put(left, i, s)


@kernel
def sweep_backward(
    first: int,
    last: int,
    starts: Any,
    columns: Any,
    diagonal: Any,
    off: Any,
    inverse: Any,
    r: Any,
    old: Any,
    z: Any,
    zero: Any,
) -> None:
    """z + (D + U)^-1 (r - A z), `old` being z before the sweep."""
    for i in range(last - 1, first - 1, -1):
        s = row(r, i, zero)
        # Backwards through memory all the way: so it is fetched ahead.
        for p in range(starts[i + 1] - 1, diagonal[i], -1):
            j = columns[unsigned(p)]
            if j < last:
                s = minus(s, times(off, p, row(z, j, zero), zero))
            else:
                s = minus(s, times(off, p, row(old, j, zero), zero))
        for p in range(diagonal[i] - 1, starts[i] - 1, -1):
            s = minus(s, times(off, p, row(old, columns[unsigned(p)], zero), zero))
        put(z, i, times(inverse, i, s, zero))
