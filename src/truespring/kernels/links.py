"""Loops over elements and their links, one for every pair of an element's nodes, whose squared lengths are coupled.

`number` tells the link of each pair of an element's nodes, shape (k, k).
"""

from typing import Any

import numpy as np

from truespring.kernels.rows import add_times, write
from truespring.kernels.small import dot, minus, row
from truespring.kernels.threads import kernel


@kernel
def squared_lengths(first: int, last: int, x: Any, elements: Any, number: Any, squared: Any, zero: Any) -> None:
    """The squared length of each link, shape (n_elements, links)."""
    for e in range(first, last):
        for a in range(elements.shape[1]):
            for b in range(a):
                d = minus(row(x, elements[e, a], zero), row(x, elements[e, b], zero))
                squared[e, number[a, b]] = dot(d, d)


@kernel
def changes(first: int, last: int, x: Any, rest: Any, elements: Any, number: Any, change: Any, zero: Any) -> None:
    """The change of each link's squared length from `rest` to `x`."""
    for e in range(first, last):
        for a in range(elements.shape[1]):
            for b in range(a):
                i, j = elements[e, a], elements[e, b]
                d = minus(row(x, i, zero), row(x, j, zero))
                D = minus(row(rest, i, zero), row(rest, j, zero))
                change[e, number[a, b]] = dot(d, d) - dot(D, D)


@kernel
def growths(first: int, last: int, x: Any, step: Any, elements: Any, number: Any, growth: Any, zero: Any) -> None:
    """The change of each link's squared length that is linear in a step."""
    for e in range(first, last):
        for a in range(elements.shape[1]):
            for b in range(a):
                d = minus(row(x, elements[e, a], zero), row(x, elements[e, b], zero))
                moved = minus(row(step, elements[e, a], zero), row(step, elements[e, b], zero))
                growth[e, number[a, b]] = 2 * dot(d, moved)


@kernel
def couple(first: int, last: int, coupling: Any, change: Any, pull: Any) -> None:
    """2 M q of each element; there is one symmetric M, or each has its own."""
    for e in range(first, last):
        M = coupling[e % len(coupling)]
        pull[e] = 0.0
        for t in range(len(M)):
            for s in range(len(M)):
                pull[e, s] += 2 * change[e, t] * M[t, s]


@kernel
def forces(first: int, last: int, x: Any, elements: Any, number: Any, pull: Any, force: Any, zero: Any) -> None:
    """The derivative of each element's energy by its nodes, shape (n_elements, k * dim)."""
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
    """Write J^T 2M J, J the derivative of the squared lengths, and the geometric part, shape (n, k * dim, k * dim).

    By each link J has but the vectors to both its nodes, so that M J is summed over the links at each node, and
    J^T (M J) likewise.
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
    """The change of C that goes with the change of the squared lengths, axes (component, element, 1)."""
    for e in range(first, last):
        for component in range(strains.shape[2]):
            total = 0.0
            for s in range(strains.shape[1]):
                total += change[e, s] * strains[e, s, component]
            result[component, e, 0] = total


@kernel
def work(first: int, last: int, stress: Any, works: Any, pull: Any) -> None:
    """What a stress, axes (component, element, 1), makes of each squared length: the sum over its components."""
    for e in range(first, last):
        for s in range(works.shape[1]):
            total = 0.0
            for component in range(works.shape[2]):
                total += works[e, s, component] * stress[component, e, 0]
            pull[e, s] = total


@kernel
def couplings(first: int, last: int, elasticity: Any, works: Any, share: Any, coupling: Any) -> None:
    """The sum of works_s D works_t times an element's share; D has axes (component, component, element, 1)."""
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
