"""Vectors of two, three or six numbers, and small matrices, as tuples: compiled code keeps them in registers.

The length is part of the type: a kernel with an argument `zero`, such as (0.0, 0.0), is compiled once for each
dimension. Loops over short arrays would be slower: they are stored in memory, with indices computed at run time.

`blocks` are arrays of shape (n, k, l); p is the number of a block. Symmetric matrices are tuples of their upper
triangle by rows.
"""

import numpy as np
from numba.extending import overload

#: Type of indices: of a signed index numba checks the sign, which takes half the time of a short loop.
unsigned = np.uint64


def row(x, i, zero):
    """Return row i of an array of shape (n, len(zero))."""


@overload(row)
def _row(x, i, zero):
    return {
        2: lambda x, i, zero: (x[unsigned(i), 0], x[unsigned(i), 1]),
        3: lambda x, i, zero: (x[unsigned(i), 0], x[unsigned(i), 1], x[unsigned(i), 2]),
        6: lambda x, i, zero: (
            x[unsigned(i), 0],
            x[unsigned(i), 1],
            x[unsigned(i), 2],
            x[unsigned(i), 3],
            x[unsigned(i), 4],
            x[unsigned(i), 5],
        ),
    }[len(zero)]


def plus(a, b):
    """Return a + b."""


@overload(plus)
def _plus(a, b):
    return {
        2: lambda a, b: (a[0] + b[0], a[1] + b[1]),
        3: lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2]),
        6: lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]),
    }[len(a)]


def minus(a, b):
    """Return a - b."""


@overload(minus)
def _minus(a, b):
    return {
        2: lambda a, b: (a[0] - b[0], a[1] - b[1]),
        3: lambda a, b: (a[0] - b[0], a[1] - b[1], a[2] - b[2]),
        6: lambda a, b: (a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3], a[4] - b[4], a[5] - b[5]),
    }[len(a)]


def dot(a, b):
    """Return the scalar product of a and b."""


@overload(dot)
def _dot(a, b):
    return {
        2: lambda a, b: a[0] * b[0] + a[1] * b[1],
        3: lambda a, b: a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
        6: lambda a, b: (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5]),
    }[len(a)]


def along(blocks, p, i, v):
    """Return the scalar product of row i of block p and v."""


@overload(along)
def _along(blocks, p, i, v):
    return {
        2: lambda blocks, p, i, v: (
            blocks[unsigned(p), unsigned(i), 0] * v[0] + blocks[unsigned(p), unsigned(i), 1] * v[1]
        ),
        3: lambda blocks, p, i, v: (
            blocks[unsigned(p), unsigned(i), 0] * v[0]
            + blocks[unsigned(p), unsigned(i), 1] * v[1]
            + blocks[unsigned(p), unsigned(i), 2] * v[2]
        ),
        6: lambda blocks, p, i, v: (
            (
                blocks[unsigned(p), unsigned(i), 0] * v[0]
                + blocks[unsigned(p), unsigned(i), 1] * v[1]
                + blocks[unsigned(p), unsigned(i), 2] * v[2]
            )
            + (
                blocks[unsigned(p), unsigned(i), 3] * v[3]
                + blocks[unsigned(p), unsigned(i), 4] * v[4]
                + blocks[unsigned(p), unsigned(i), 5] * v[5]
            )
        ),
    }[len(v)]


def across(blocks, p, j, v):
    """Return the scalar product of column j of block p and v."""


@overload(across)
def _across(blocks, p, j, v):
    return {
        2: lambda blocks, p, j, v: (
            blocks[unsigned(p), 0, unsigned(j)] * v[0] + blocks[unsigned(p), 1, unsigned(j)] * v[1]
        ),
        3: lambda blocks, p, j, v: (
            blocks[unsigned(p), 0, unsigned(j)] * v[0]
            + blocks[unsigned(p), 1, unsigned(j)] * v[1]
            + blocks[unsigned(p), 2, unsigned(j)] * v[2]
        ),
        6: lambda blocks, p, j, v: (
            (
                blocks[unsigned(p), 0, unsigned(j)] * v[0]
                + blocks[unsigned(p), 1, unsigned(j)] * v[1]
                + blocks[unsigned(p), 2, unsigned(j)] * v[2]
            )
            + (
                blocks[unsigned(p), 3, unsigned(j)] * v[3]
                + blocks[unsigned(p), 4, unsigned(j)] * v[4]
                + blocks[unsigned(p), 5, unsigned(j)] * v[5]
            )
        ),
    }[len(v)]


def times(blocks, p, v, zero):
    """Return block p times v, of the length of `zero`."""


@overload(times)
def _times(blocks, p, v, zero):
    return {
        2: lambda blocks, p, v, zero: (along(blocks, p, 0, v), along(blocks, p, 1, v)),
        3: lambda blocks, p, v, zero: (along(blocks, p, 0, v), along(blocks, p, 1, v), along(blocks, p, 2, v)),
        6: lambda blocks, p, v, zero: (
            along(blocks, p, 0, v),
            along(blocks, p, 1, v),
            along(blocks, p, 2, v),
            along(blocks, p, 3, v),
            along(blocks, p, 4, v),
            along(blocks, p, 5, v),
        ),
    }[len(zero)]


def times_transposed(blocks, p, v, zero):
    """Return the transpose of block p times v, of the length of `zero`."""


@overload(times_transposed)
def _times_transposed(blocks, p, v, zero):
    return {
        2: lambda blocks, p, v, zero: (across(blocks, p, 0, v), across(blocks, p, 1, v)),
        3: lambda blocks, p, v, zero: (across(blocks, p, 0, v), across(blocks, p, 1, v), across(blocks, p, 2, v)),
        6: lambda blocks, p, v, zero: (
            across(blocks, p, 0, v),
            across(blocks, p, 1, v),
            across(blocks, p, 2, v),
            across(blocks, p, 3, v),
            across(blocks, p, 4, v),
            across(blocks, p, 5, v),
        ),
    }[len(zero)]


def put(x, i, v):
    """Write v to row i of an array of shape (n, len(v))."""


@overload(put)
def _put(x, i, v):
    def two(x, i, v):
        x[unsigned(i), 0], x[unsigned(i), 1] = v[0], v[1]

    def three(x, i, v):
        x[unsigned(i), 0], x[unsigned(i), 1], x[unsigned(i), 2] = v[0], v[1], v[2]

    def six(x, i, v):
        (
            x[unsigned(i), 0],
            x[unsigned(i), 1],
            x[unsigned(i), 2],
            x[unsigned(i), 3],
            x[unsigned(i), 4],
            x[unsigned(i), 5],
        ) = v[0], v[1], v[2], v[3], v[4], v[5]

    return {2: two, 3: three, 6: six}[len(v)]


def scaled(a, v):
    """Return the number a times v."""


@overload(scaled)
def _scaled(a, v):
    return {
        2: lambda a, v: (a * v[0], a * v[1]),
        3: lambda a, v: (a * v[0], a * v[1], a * v[2]),
        6: lambda a, v: (a * v[0], a * v[1], a * v[2], a * v[3], a * v[4], a * v[5]),
    }[len(v)]


def each(a, b):
    """Return the componentwise product of a and b."""


@overload(each)
def _each(a, b):
    return {
        2: lambda a, b: (a[0] * b[0], a[1] * b[1]),
        3: lambda a, b: (a[0] * b[0], a[1] * b[1], a[2] * b[2]),
        6: lambda a, b: (a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3], a[4] * b[4], a[5] * b[5]),
    }[len(a)]


def line(blocks, p, i, zero):
    """Return row i of block p, of the length of `zero`."""


@overload(line)
def _line(blocks, p, i, zero):
    return {
        2: lambda blocks, p, i, zero: (blocks[unsigned(p), unsigned(i), 0], blocks[unsigned(p), unsigned(i), 1]),
        3: lambda blocks, p, i, zero: (
            blocks[unsigned(p), unsigned(i), 0],
            blocks[unsigned(p), unsigned(i), 1],
            blocks[unsigned(p), unsigned(i), 2],
        ),
        6: lambda blocks, p, i, zero: (
            blocks[unsigned(p), unsigned(i), 0],
            blocks[unsigned(p), unsigned(i), 1],
            blocks[unsigned(p), unsigned(i), 2],
            blocks[unsigned(p), unsigned(i), 3],
            blocks[unsigned(p), unsigned(i), 4],
            blocks[unsigned(p), unsigned(i), 5],
        ),
    }[len(zero)]


def add_line(blocks, p, i, a, v):
    """Add the number a times v to row i of block p."""


@overload(add_line)
def _add_line(blocks, p, i, a, v):
    def two(blocks, p, i, a, v):
        blocks[unsigned(p), unsigned(i), 0] += a * v[0]
        blocks[unsigned(p), unsigned(i), 1] += a * v[1]

    def three(blocks, p, i, a, v):
        blocks[unsigned(p), unsigned(i), 0] += a * v[0]
        blocks[unsigned(p), unsigned(i), 1] += a * v[1]
        blocks[unsigned(p), unsigned(i), 2] += a * v[2]

    def six(blocks, p, i, a, v):
        blocks[unsigned(p), unsigned(i), 0] += a * v[0]
        blocks[unsigned(p), unsigned(i), 1] += a * v[1]
        blocks[unsigned(p), unsigned(i), 2] += a * v[2]
        blocks[unsigned(p), unsigned(i), 3] += a * v[3]
        blocks[unsigned(p), unsigned(i), 4] += a * v[4]
        blocks[unsigned(p), unsigned(i), 5] += a * v[5]

    return {2: two, 3: three, 6: six}[len(v)]


def along_and_across(u, v, d):
    """Return the upper triangle of u d d^T + v I."""


@overload(along_and_across)
def _along_and_across(u, v, d):
    def two(u, v, d):
        return (u * d[0] * d[0] + v, u * d[0] * d[1], u * d[1] * d[1] + v)

    def three(u, v, d):
        a, b = u * d[0], u * d[1]
        return (a * d[0] + v, a * d[1], a * d[2], b * d[1] + v, b * d[2], u * d[2] * d[2] + v)

    return {2: two, 3: three}[len(d)]


def nothing(zero):
    """Return the upper triangle of a zero matrix with len(zero) rows."""


@overload(nothing)
def _nothing(zero):
    return {2: lambda zero: (0.0, 0.0, 0.0), 3: lambda zero: (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)}[len(zero)]


def take_symmetric(blocks, p, m, zero):
    """Subtract the symmetric matrix with upper triangle m from block p."""


@overload(take_symmetric)
def _take_symmetric(blocks, p, m, zero):
    def two(blocks, p, m, zero):
        blocks[unsigned(p), 0, 0] -= m[0]
        blocks[unsigned(p), 0, 1] -= m[1]
        blocks[unsigned(p), 1, 0] -= m[1]
        blocks[unsigned(p), 1, 1] -= m[2]

    def three(blocks, p, m, zero):
        blocks[unsigned(p), 0, 0] -= m[0]
        blocks[unsigned(p), 0, 1] -= m[1]
        blocks[unsigned(p), 0, 2] -= m[2]
        blocks[unsigned(p), 1, 0] -= m[1]
        blocks[unsigned(p), 1, 1] -= m[3]
        blocks[unsigned(p), 1, 2] -= m[4]
        blocks[unsigned(p), 2, 0] -= m[2]
        blocks[unsigned(p), 2, 1] -= m[4]
        blocks[unsigned(p), 2, 2] -= m[5]

    return {2: two, 3: three}[len(zero)]


def write_symmetric(blocks, p, m, zero):
    """Write the negative of the symmetric matrix with upper triangle m to block p."""


@overload(write_symmetric)
def _write_symmetric(blocks, p, m, zero):
    def two(blocks, p, m, zero):
        blocks[unsigned(p), 0, 0] = -m[0]
        blocks[unsigned(p), 0, 1] = -m[1]
        blocks[unsigned(p), 1, 0] = -m[1]
        blocks[unsigned(p), 1, 1] = -m[2]

    def three(blocks, p, m, zero):
        blocks[unsigned(p), 0, 0] = -m[0]
        blocks[unsigned(p), 0, 1] = -m[1]
        blocks[unsigned(p), 0, 2] = -m[2]
        blocks[unsigned(p), 1, 0] = -m[1]
        blocks[unsigned(p), 1, 1] = -m[3]
        blocks[unsigned(p), 1, 2] = -m[4]
        blocks[unsigned(p), 2, 0] = -m[2]
        blocks[unsigned(p), 2, 1] = -m[4]
        blocks[unsigned(p), 2, 2] = -m[5]

    return {2: two, 3: three}[len(zero)]
