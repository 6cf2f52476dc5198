"""Loops of geometric multigrid: levels joined by an interpolation of nodes, the same for all directions.

Rows of an interpolation P are nodes, columns are coarse nodes, entries are numbers: starts (n + 1,), columns (n_p,),
weights (n_p,); by columns: starts (n_coarse + 1,), nodes (n_p,), weights (n_p,). `zero` has length k, the number of
unknowns per node.
"""

from typing import Any

import numpy as np

from truespring.kernels.small import add_line, each, line, plus, put, row, scaled, unsigned
from truespring.kernels.threads import kernel


@kernel
def restrict(
    first: int, last: int, r_starts: Any, r_nodes: Any, r_weights: Any, fine: Any, coarse: Any, zero: Any
) -> None:
    """Write coarse = P^T fine. Shapes: by columns r_starts, r_nodes, r_weights; fine (n, k), coarse (n_coarse, k)."""
    for c in range(first, last):
        s = zero
        for q in range(r_starts[c], r_starts[c + 1]):
            s = plus(s, scaled(r_weights[unsigned(q)], row(fine, r_nodes[unsigned(q)], zero)))
        put(coarse, c, s)


@kernel
def prolong(
    first: int,
    last: int,
    p_starts: Any,
    p_columns: Any,
    p_weights: Any,
    free: Any,
    coarse: Any,
    fine: Any,
    zero: Any,
) -> None:
    """Add P coarse to the free directions of fine.

    Shapes: by rows p_starts, p_columns, p_weights; free, 1 for free directions, else 0, (n, k), coarse (n_coarse, k),
    fine (n, k).
    """
    for i in range(first, last):
        s = zero
        for q in range(p_starts[i], p_starts[i + 1]):
            s = plus(s, scaled(p_weights[unsigned(q)], row(coarse, p_columns[unsigned(q)], zero)))
        put(fine, i, plus(row(fine, i, zero), each(row(free, i, zero), s)))


@kernel
def galerkin(
    first: int,
    last: int,
    starts: Any,
    columns: Any,
    data: Any,
    free: Any,
    p_starts: Any,
    p_columns: Any,
    p_weights: Any,
    r_starts: Any,
    r_nodes: Any,
    r_weights: Any,
    c_starts: Any,
    c_columns: Any,
    c_data: Any,
    zero: Any,
) -> None:
    """Write rows of the coarse matrix P^T A P, with A restricted to free directions.

    Shapes: starts (n + 1,), columns (n_blocks,), data (n_blocks, k, k) of A; free (n, k), 1 or 0; P by rows and by
    columns; c_starts (n_coarse + 1,), c_columns (n_c,), c_data (n_c, k, k).
    """
    size = len(zero)  # known when compiled
    widest = 0
    for c in range(first, last):
        width = 0
        for q in range(r_starts[c], r_starts[c + 1]):
            width += starts[r_nodes[q] + 1] - starts[r_nodes[q]]
        widest = max(widest, width)
    place, slot = np.full(len(starts) - 1, -1, np.int32), np.empty(len(c_starts) - 1, np.int32)
    reached, total = np.empty(widest, np.int32), np.empty((widest, size, size))
    for c in range(first, last):
        count = 0
        for q in range(r_starts[c], r_starts[c + 1]):  # total = row c of P^T A
            i, weight = r_nodes[unsigned(q)], r_weights[unsigned(q)]
            for p in range(starts[i], starts[i + 1]):
                j = columns[unsigned(p)]
                s = place[unsigned(j)]
                if s < 0:
                    s = count
                    place[unsigned(j)] = s
                    reached[unsigned(s)] = j
                    total[unsigned(s)] = 0.0
                    count += 1
                for a in range(size):
                    add_line(total, s, a, weight * free[unsigned(i), unsigned(a)], line(data, p, a, zero))
        for q in range(c_starts[c], c_starts[c + 1]):
            slot[unsigned(c_columns[unsigned(q)])] = q
            c_data[unsigned(q)] = 0.0
        for s in range(count):
            j = reached[unsigned(s)]
            place[unsigned(j)] = -1
            able = row(free, j, zero)
            for t in range(p_starts[j], p_starts[j + 1]):
                q = slot[unsigned(p_columns[unsigned(t)])]
                for a in range(size):
                    add_line(c_data, q, a, p_weights[unsigned(t)], each(able, line(total, s, a, zero)))
