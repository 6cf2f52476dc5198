"""Loops over elements whose links, one for each pair of nodes, have coupled squared lengths.

An element has n_links = k (k - 1) / 2 links; `number`, shape (k, k), is the link of each pair of its nodes.
"""

from typing import Any

import numpy as np

from truespring.kernels.rows import add_times, write
from truespring.kernels.small import dot, minus, row
from truespring.kernels.threads import kernel


@kernel
def squared_lengths(first: int, last: int, x: Any, elements: Any, number: Any, squared: Any, zero: Any) -> None:
    """Write the squared length of each link.

    Shapes: x (n_nodes, dim), elements (n_elements, k), number (k, k), squared (n_elements, n_links).
    """
    for e in range(first, last):
        for a in range(elements.shape[1]):
            for b in range(a):
                d = minus(row(x, elements[e, a], zero), row(x, elements[e, b], zero))
                squared[e, number[a, b]] = dot(d, d)


@kernel
def changes(first: int, last: int, x: Any, rest: Any, elements: Any, number: Any, change: Any, zero: Any) -> None:
    """Write the change of each link's squared length from `rest` to `x`.

    Shapes: x, rest (n_nodes, dim), elements (n_elements, k), number (k, k), change (n_elements, n_links).
    """
    for e in range(first, last):
        for a in range(elements.shape[1]):
            for b in range(a):
                i, j = elements[e, a], elements[e, b]
                d = minus(row(x, i, zero), row(x, j, zero))
                D = minus(row(rest, i, zero), row(rest, j, zero))
                change[e, number[a, b]] = dot(d, d) - dot(D, D)


@kernel
def growths(first: int, last: int, x: Any, step: Any, elements: Any, number: Any, growth: Any, zero: Any) -> None:
    """Write the change of each link's squared length that is linear in a step.

    Shapes: x, step (n_nodes, dim), elements (n_elements, k), number (k, k), growth (n_elements, n_links).
    """
    for e in range(first, last):
        for a in range(elements.shape[1]):
            for b in range(a):
                d = minus(row(x, elements[e, a], zero), row(x, elements[e, b], zero))
                moved = minus(row(step, elements[e, a], zero), row(step, elements[e, b], zero))
                growth[e, number[a, b]] = 2 * dot(d, moved)


@kernel
def couple(first: int, last: int, coupling: Any, change: Any, pull: Any) -> None:
    """Write 2 M q for each element, with one symmetric M for all or one for each.

    Shapes: coupling M (1 or n_elements, n_links, n_links), change q, pull (n_elements, n_links).
    """
    for e in range(first, last):
        M = coupling[e % len(coupling)]
        pull[e] = 0.0
        for t in range(len(M)):
            for s in range(len(M)):
                pull[e, s] += 2 * change[e, t] * M[t, s]


@kernel
def forces(first: int, last: int, x: Any, elements: Any, number: Any, pull: Any, force: Any, zero: Any) -> None:
    """Write the derivative of each element's energy by its nodes.

    Shapes: x (n_nodes, dim), elements (n_elements, k), number (k, k), pull (n_elements, n_links), force (n_elements,
    k * dim).
    """
    dim, k = len(zero), elements.shape[1]
    for e in range(first, last):
        force[e] = 0.0
        for a in range(k):
            for b in range(a):
                d = minus(row(x, elements[e, a], zero), row(x, elements[e, b], zero))
                for c in range(dim):
                    force[e, a * dim + c] += 2 * pull[e, number[a, b]] * d[c]
                    force[e, b * dim + c] -= 2 * pull[e, number[a, b]] * d[c]


@kernel
def stiffnesses(
    first: int,
    last: int,
    x: Any,
    elements: Any,
    number: Any,
    coupling: Any,
    pull: Any,
    blocks: Any,
    zero: Any,
) -> None:
    """Write the stiffness of each element: J^T 2M J, J the derivative of the squared lengths, plus the geometric part.

    J of a link has entries at its two nodes only; M J and J^T (M J) are therefore sums over the links at each node.

    Shapes: x (n_nodes, dim), elements (n_elements, k), number (k, k), coupling M (1 or n_elements, n_links, n_links),
    pull (n_elements, n_links), blocks (n_elements, k * dim, k * dim).
    """
    dim, k = len(zero), elements.shape[1]
    vectors, coupled = np.empty((k, k, dim)), np.empty((coupling.shape[1], k, dim))
    for e in range(first, last):
        M = coupling[e % len(coupling)]
        for a in range(k):
            for b in range(k):
                write(vectors, a, b, minus(row(x, elements[e, a], zero), row(x, elements[e, b], zero)))
        for s in range(len(M)):
            for b in range(k):
                total = zero
                for other in range(k):
                    if other != b:
                        total = add_times(total, 8 * M[s, number[b, other]], vectors, b, other)
                write(coupled, s, b, total)
        for a in range(k):
            for b in range(a, k):
                for i in range(dim):
                    total = zero
                    for other in range(k):
                        if other != a:
                            total = add_times(total, vectors[a, other, i], coupled, number[a, other], b)
                    for j in range(dim):
                        blocks[e, a * dim + i, b * dim + j] = total[j]
                        blocks[e, b * dim + j, a * dim + i] = total[j]
        for a in range(k):
            for b in range(k):
                if a != b:
                    for i in range(dim):
                        blocks[e, a * dim + i, a * dim + i] += 2 * pull[e, number[a, b]]
                        blocks[e, a * dim + i, b * dim + i] -= 2 * pull[e, number[a, b]]


@kernel
def strain(first: int, last: int, change: Any, strains: Any, result: Any) -> None:
    """Write the change of C that corresponds to the change of the squared lengths.

    Shapes: change (n_elements, n_links), strains (n_elements, n_links, n_strains), result (n_strains, n_elements, 1).
    """
    for e in range(first, last):
        for component in range(strains.shape[2]):
            total = 0.0
            for s in range(strains.shape[1]):
                total += change[e, s] * strains[e, s, component]
            result[component, e, 0] = total


@kernel
def work(first: int, last: int, stress: Any, works: Any, pull: Any) -> None:
    """Write the derivative of the energy by each squared length, from a stress.

    Shapes: stress (n_strains, n_elements, 1), works (n_elements, n_links, n_strains), pull (n_elements, n_links).
    """
    for e in range(first, last):
        for s in range(works.shape[1]):
            total = 0.0
            for component in range(works.shape[2]):
                total += works[e, s, component] * stress[component, e, 0]
            pull[e, s] = total


@kernel
def couplings(first: int, last: int, elasticity: Any, works: Any, share: Any, coupling: Any) -> None:
    """Write works_s D works_t times `share` for each pair of links s, t of an element.

    Shapes: elasticity D (n_strains, n_strains, n_elements, 1), works (n_elements, n_links, n_strains), share
    (n_elements,), coupling (n_elements, n_links, n_links).
    """
    n_strains = works.shape[2]
    row = np.empty(n_strains)
    for e in range(first, last):
        for s in range(works.shape[1]):
            for two in range(n_strains):
                row[two] = 0.0
                for one in range(n_strains):
                    row[two] += share[e] * works[e, s, one] * elasticity[one, two, e, 0]
            for t in range(works.shape[1]):
                total = 0.0
                for two in range(n_strains):
                    total += row[two] * works[e, t, two]
                coupling[e, s, t] = total
