"""Sums of short rows that stay in registers, as tuples; a local array would go through memory."""

from numba.extending import overload


def add_times(total, factor, rows, i, j):
    """`total` + factor times the row i, j of an array of shape (n, m, len(total))."""


@overload(add_times)
def _add_times(total, factor, rows, i, j):
    return {
        2: lambda total, factor, rows, i, j: (
            total[0] + factor * rows[i, j, 0],
            total[1] + factor * rows[i, j, 1],
        ),
        3: lambda total, factor, rows, i, j: (
            total[0] + factor * rows[i, j, 0],
            total[1] + factor * rows[i, j, 1],
            total[2] + factor * rows[i, j, 2],
        ),
        4: lambda total, factor, rows, i, j: (
            total[0] + factor * rows[i, j, 0],
            total[1] + factor * rows[i, j, 1],
            total[2] + factor * rows[i, j, 2],
            total[3] + factor * rows[i, j, 3],
        ),
        9: lambda total, factor, rows, i, j: (
            total[0] + factor * rows[i, j, 0],
            total[1] + factor * rows[i, j, 1],
            total[2] + factor * rows[i, j, 2],
            total[3] + factor * rows[i, j, 3],
            total[4] + factor * rows[i, j, 4],
            total[5] + factor * rows[i, j, 5],
            total[6] + factor * rows[i, j, 6],
            total[7] + factor * rows[i, j, 7],
            total[8] + factor * rows[i, j, 8],
        ),
    }[len(total)]
