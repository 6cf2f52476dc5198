"""Facets of elements, each said as an element and the number of its facet in the table of kinds."""

from functools import cache

import numpy as np

from truespring.arrays import Bools, Ints
from truespring.mesh.kinds import ELEMENT_KINDS, MIRRORED
from truespring.mesh.rows import ascending, distinct_rows


def facet_nodes(elements: Ints, kind: str, facets: Ints) -> Ints:
    """Return the nodes of facets, from outside anticlockwise; `facets` (n, 2) are element and local facet."""
    local = np.array(ELEMENT_KINDS[kind].facets)
    return np.asarray(elements[facets[:, :1], local[facets[:, 1]]])


def find_facets(elements: Ints, kind: str, cells: Ints) -> Ints:
    """Find the facets that have the nodes of `cells`, in whatever order, shape (n, k); of a node -1 no element has any.

    Returns element and local facet of the first element that has it, -1 where none has, shape (n, 2).
    """
    facets = np.array(ELEMENT_KINDS[kind].facets)
    found = np.full((len(cells), 2), -1, dtype=np.int64)
    if cells.shape[1] != facets.shape[1]:
        return found
    inside = np.zeros(max(int(elements.max()), int(cells.max(initial=0))) + 1, dtype=bool)
    inside[cells[cells >= 0]] = True
    owner, local = np.nonzero(inside[elements[:, facets]].all(axis=2))  # element by element
    there = elements[owner[:, None], facets[local]]
    distinct = distinct_rows(ascending(np.concatenate([there, cells]).T))
    # Of equal rows the first comes first, and those of elements stand before all cells.
    first = distinct.first[distinct.of[len(there) :]]
    known = first < len(there)
    found[known] = np.stack([owner, local], axis=1)[first[known]]
    return found


def folded(elements: Ints, kind: str) -> Bools:
    """Tell which elements lie on the same side of a facet as a neighbour of theirs, shape (n_elements,).

    Two elements that share a facet go round it in opposite ways, unless one of them is folded over the other.
    """
    facets = np.array(ELEMENT_KINDS[kind].facets)
    nodes = elements[:, facets].reshape(-1, facets.shape[1])
    turned = np.take_along_axis(nodes, (nodes.argmin(axis=1)[:, None] + np.arange(nodes.shape[1])) % nodes.shape[1], 1)
    way = turned[:, 1] < turned[:, -1] if nodes.shape[1] > 2 else nodes[:, 0] < nodes[:, 1]
    distinct = distinct_rows(ascending(nodes.T))
    n_ways = np.bincount(distinct.of, way.astype(float), len(distinct.starts))
    alike = (distinct.count == 2) & (n_ways != 1)
    return np.asarray(alike[distinct.of].reshape(len(elements), -1).any(axis=1))


def mirrored_facets(kind: str) -> Ints:
    """Return what each local facet is called once its element is mirrored, shape (facets,)."""
    facets = ELEMENT_KINDS[kind].facets
    after = [{MIRRORED[kind][node] for node in facet} for facet in facets]
    return np.array([after.index(set(facet)) for facet in facets])


@cache
def children_of_facet(
    facets: tuple[tuple[int, ...], ...], parents: tuple[tuple[int, ...], ...], children: tuple[tuple[int, ...], ...]
) -> tuple[tuple[tuple[int, int], ...], ...]:
    """Return, for each facet of an element that is divided, its parts: child and the child's local facet.

    Args:
        facets: of the element and of its children.
        parents: of each local node, the corners of the element that it is the middle of.
        children: local nodes of each child.
    """
    return tuple(
        tuple(
            (child, local)
            for child, nodes in enumerate(children)
            for local, part in enumerate(facets)
            if all(set(parents[nodes[node]]) <= set(facet) for node in part)
        )
        for facet in facets
    )
