"""Rows of three-dimensional arrays as tuples, which stay in registers while they are summed.

Local arrays would be stored in memory, and indices that are not constants would be computed.
"""

from numba.extending import overload

from truespring.kernels.small import unsigned


def add_times(total, factor, rows, i, j):
    """Return `total` + factor times row i, j of an array of shape (m, n, len(total))."""


@overload(add_times)
def _add_times(total, factor, rows, i, j):
    return {
        2: lambda total, factor, rows, i, j: (
            total[0] + factor * rows[unsigned(i), unsigned(j), 0],
            total[1] + factor * rows[unsigned(i), unsigned(j), 1],
        ),
        3: lambda total, factor, rows, i, j: (
            total[0] + factor * rows[unsigned(i), unsigned(j), 0],
            total[1] + factor * rows[unsigned(i), unsigned(j), 1],
            total[2] + factor * rows[unsigned(i), unsigned(j), 2],
        ),
        4: lambda total, factor, rows, i, j: (
            total[0] + factor * rows[unsigned(i), unsigned(j), 0],
            total[1] + factor * rows[unsigned(i), unsigned(j), 1],
            total[2] + factor * rows[unsigned(i), unsigned(j), 2],
            total[3] + factor * rows[unsigned(i), unsigned(j), 3],
        ),
        9: lambda total, factor, rows, i, j: (
            total[0] + factor * rows[unsigned(i), unsigned(j), 0],
            total[1] + factor * rows[unsigned(i), unsigned(j), 1],
            total[2] + factor * rows[unsigned(i), unsigned(j), 2],
            total[3] + factor * rows[unsigned(i), unsigned(j), 3],
            total[4] + factor * rows[unsigned(i), unsigned(j), 4],
            total[5] + factor * rows[unsigned(i), unsigned(j), 5],
            total[6] + factor * rows[unsigned(i), unsigned(j), 6],
            total[7] + factor * rows[unsigned(i), unsigned(j), 7],
            total[8] + factor * rows[unsigned(i), unsigned(j), 8],
        ),
    }[len(total)]


def write(rows, i, j, v):
    """Write v to row i, j of an array of shape (m, n, len(v))."""


@overload(write)
def _write(rows, i, j, v):
    def two(rows, i, j, v):
        rows[unsigned(i), unsigned(j), 0], rows[unsigned(i), unsigned(j), 1] = v[0], v[1]

    def three(rows, i, j, v):
        rows[unsigned(i), unsigned(j), 0], rows[unsigned(i), unsigned(j), 1], rows[unsigned(i), unsigned(j), 2] = (
            v[0],
            v[1],
            v[2],
        )

    def four(rows, i, j, v):
        (
            rows[unsigned(i), unsigned(j), 0],
            rows[unsigned(i), unsigned(j), 1],
            rows[unsigned(i), unsigned(j), 2],
            rows[unsigned(i), unsigned(j), 3],
        ) = v[0], v[1], v[2], v[3]

    def nine(rows, i, j, v):
        rows[unsigned(i), unsigned(j), 0], rows[unsigned(i), unsigned(j), 1], rows[unsigned(i), unsigned(j), 2] = (
            v[0],
            v[1],
            v[2],
        )
        rows[unsigned(i), unsigned(j), 3], rows[unsigned(i), unsigned(j), 4], rows[unsigned(i), unsigned(j), 5] = (
            v[3],
            v[4],
            v[5],
        )
        rows[unsigned(i), unsigned(j), 6], rows[unsigned(i), unsigned(j), 7], rows[unsigned(i), unsigned(j), 8] = (
            v[6],
            v[7],
            v[8],
        )

    return {2: two, 3: three, 4: four, 9: nine}[len(v)]
