"""Products of finite differences in the cells of a grid.

Each product is that of two differences, from one corner of a cell to two others (which may be equal): `ends`, shape
(n_products, 3), has these three corners, the common one first.
"""

from typing import Any

from truespring.kernels.small import dot, minus, plus, row
from truespring.kernels.threads import kernel


@kernel
def products(first: int, last: int, x: Any, cells: Any, ends: Any, found: Any, zero: Any) -> None:
    """Write each product.

    Shapes: x (n_nodes, dim), cells (n_cells, corners), ends (n_products, 3), found (n_cells, n_products).
    """
    for e in range(first, last):
        for s in range(len(ends)):
            o = row(x, cells[e, ends[s, 0]], zero)
            B, C = minus(row(x, cells[e, ends[s, 1]], zero), o), minus(row(x, cells[e, ends[s, 2]], zero), o)
            found[e, s] = dot(B, C)


@kernel
def growths(first: int, last: int, x: Any, step: Any, cells: Any, ends: Any, growth: Any, zero: Any) -> None:
    """Write the change of each product that is linear in a step.

    Shapes: x, step (n_nodes, dim), cells (n_cells, corners), ends (n_products, 3), growth (n_cells, n_products).
    """
    for e in range(first, last):
        for s in range(len(ends)):
            i, j, k = cells[e, ends[s, 0]], cells[e, ends[s, 1]], cells[e, ends[s, 2]]
            o, moved = row(x, i, zero), row(step, i, zero)
            B, C = minus(row(x, j, zero), o), minus(row(x, k, zero), o)
            dB, dC = minus(row(step, j, zero), moved), minus(row(step, k, zero), moved)
            growth[e, s] = dot(dB, C) + dot(B, dC)


@kernel
def forces(first: int, last: int, x: Any, cells: Any, ends: Any, pull: Any, force: Any, zero: Any) -> None:
    """Write the derivative of each cell's energy by its corners; `pull` is that by each product.

    Shapes: x (n_nodes, dim), cells (n_cells, corners), ends (n_products, 3), pull (n_cells, n_products), force
    (n_cells, corners * dim).
    """
    dim = len(zero)
    for e in range(first, last):
        force[e] = 0.0
        for s in range(len(ends)):
            a, b, c = ends[s, 0], ends[s, 1], ends[s, 2]
            o = row(x, cells[e, a], zero)
            B, C = minus(row(x, cells[e, b], zero), o), minus(row(x, cells[e, c], zero), o)
            for i in range(dim):
                force[e, a * dim + i] -= pull[e, s] * (B[i] + C[i])
                force[e, b * dim + i] += pull[e, s] * C[i]
                force[e, c * dim + i] += pull[e, s] * B[i]


@kernel
def stiffnesses(
    first: int, last: int, x: Any, cells: Any, ends: Any, weights: Any, pull: Any, blocks: Any, zero: Any
) -> None:
    """Write the stiffness of each cell: 2 w dq dq^T plus p times the second derivative of q, for each product q.

    Shapes: x (n_nodes, dim), cells (n_cells, corners), ends (n_products, 3), weights w, pull p (n_cells, n_products),
    blocks (n_cells, corners * dim, corners * dim).
    """
    dim = len(zero)
    for e in range(first, last):
        blocks[e] = 0.0
        for s in range(len(ends)):
            a, b, c = ends[s, 0], ends[s, 1], ends[s, 2]
            o = row(x, cells[e, a], zero)
            B, C = minus(row(x, cells[e, b], zero), o), minus(row(x, cells[e, c], zero), o)
            both = plus(B, C)
            double, p = 2 * weights[e, s], pull[e, s]
            for i in range(dim):
                for j in range(dim):
                    same = p if i == j else 0.0
                    blocks[e, a * dim + i, a * dim + j] += double * both[i] * both[j] + 2 * same
                    blocks[e, b * dim + i, b * dim + j] += double * C[i] * C[j]
                    blocks[e, c * dim + i, c * dim + j] += double * B[i] * B[j]
                    blocks[e, a * dim + i, b * dim + j] -= double * both[i] * C[j] + same
                    blocks[e, b * dim + i, a * dim + j] -= double * C[i] * both[j] + same
                    blocks[e, a * dim + i, c * dim + j] -= double * both[i] * B[j] + same
                    blocks[e, c * dim + i, a * dim + j] -= double * B[i] * both[j] + same
                    blocks[e, b * dim + i, c * dim + j] += double * C[i] * B[j] + same
                    blocks[e, c * dim + i, b * dim + j] += double * B[i] * C[j] + same
