"""Facets of elements, each given by an element and its local facet: a row of `facets` in ELEMENT_KINDS.

Elements are given as `Mesh` holds them: a table and their kind. In a table with quadrilaterals, a triangle repeats its
last corner.
"""

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np

from truespring.arrays import Bools, Ints
from truespring.mesh.kinds import ELEMENT_KINDS, MIRRORED, Groups
from truespring.mesh.merged import kinds_in
from truespring.mesh.rows import ascending, distinct_rows

_QUADRILATERAL = 4  # number of corners


class _OfKind(NamedTuple):
    """Elements of one kind: numbers, nodes, and the local nodes of their facets, padded to the longest facet."""

    numbers: Ints
    nodes: Ints
    local: Ints


def _tables(elements: Ints, kind: str) -> Iterator[_OfKind]:
    kinds = kinds_in(elements, kind)
    longest = max((len(ELEMENT_KINDS[name].facets[0]) for name, _, _ in kinds), default=0)
    for name, numbers, nodes in kinds:
        facets = ELEMENT_KINDS[name].facets
        yield _OfKind(numbers, nodes, np.array([facet + facet[-1:] * (longest - len(facet)) for facet in facets]))


def facet_columns(elements: Ints, kind: str) -> Ints:
    """Return all facets of elements as columns, shape (k, n): kind by kind, facet by facet, element by element."""
    found = [own.nodes.T[own.local.T].reshape(own.local.shape[1], -1) for own in _tables(elements, kind)]
    if not found:  # no elements, of a mixed mesh: two corners per facet in 2D, four in 3D
        return np.zeros((2 if elements.shape[1] == _QUADRILATERAL else _QUADRILATERAL, 0), dtype=np.int64)
    return found[0] if len(found) == 1 else np.concatenate(found, axis=1)


def facet_keys(facets: Ints) -> list[Ints]:
    """Return the sorted nodes of facets, given and returned as columns of shape (n,).

    If a corner is repeated, repeat the largest.
    """
    ordered = ascending(facets)
    if len(ordered) < _QUADRILATERAL:
        return ordered
    first, second, third, last = ordered
    early = first == second
    late = early | (second == third)
    return [first, np.where(early, third, second), np.where(late, last, third), last] if late.any() else ordered


def n_facets(elements: Ints, kind: str) -> Ints:
    """Return the number of facets of each element, shape (n_elements,)."""
    found = np.zeros(len(elements), dtype=np.int64)
    for own in _tables(elements, kind):
        found[own.numbers] = len(own.local)
    return found


def facet_nodes(elements: Ints, kind: str, facets: Ints) -> Ints:
    """Return the nodes of facets, anticlockwise seen from outside, shape (n, k); `facets` has shape (n, 2)."""
    tables = list(_tables(elements, kind))
    if len(tables) == 1:
        return np.asarray(elements[facets[:, :1], tables[0].local[facets[:, 1]]])
    place = np.empty(len(elements), dtype=np.int64)
    found = np.empty((len(facets), tables[0].local.shape[1]), dtype=np.int64)
    for own in tables:
        place[:] = -1
        place[own.numbers] = np.arange(len(own.numbers))
        here = np.flatnonzero(place[facets[:, 0]] >= 0)
        found[here] = own.nodes[place[facets[here, :1]], own.local[facets[here, 1]]]
    return found


def find_facets(elements: Ints, kind: str, cells: Ints) -> Ints:
    """Find the facets with the nodes of `cells`, shape (n, k), in any order; cells with a node -1 match no facet.

    Returns element and local facet of the first element that has the facet, -1 if none has it, shape (n, 2).
    """
    tables = list(_tables(elements, kind))
    longest = tables[0].local.shape[1]
    found = np.full((len(cells), 2), -1, dtype=np.int64)
    if cells.shape[1] > longest or (cells.shape[1] < longest < _QUADRILATERAL):
        return found
    cells = np.concatenate([cells, np.repeat(cells[:, -1:], longest - cells.shape[1], axis=1)], axis=1)
    inside = np.zeros(max(int(elements.max()), int(cells.max(initial=0))) + 1, dtype=bool)
    inside[cells[cells >= 0]] = True
    which, there = [], []
    for own in tables:
        row, local = np.nonzero(inside[own.nodes[:, own.local]].all(axis=2))  # element by element
        which.append(np.stack([own.numbers[row], local], axis=1))
        there.append(own.nodes[row[:, None], own.local[local]])
    known_facets, n_there = np.concatenate(which), sum(map(len, there))
    distinct = distinct_rows(facet_keys(np.concatenate([*there, cells]).T))
    # The sort is stable: the first of equal rows is that of an element, if there is one.
    first = distinct.first[distinct.of[n_there:]]
    known = first < n_there
    found[known] = known_facets[first[known]]
    return found


def folded(elements: Ints, kind: str) -> Bools:
    """Return whether elements lie on the same side of a facet as a neighbour, shape (n_elements,).

    Two elements that share a facet traverse it in opposite directions, unless one is folded over the other.
    """
    tables = list(_tables(elements, kind))
    nodes = np.concatenate([own.nodes[:, own.local].reshape(-1, own.local.shape[1]) for own in tables])
    owner = np.concatenate([np.repeat(own.numbers, len(own.local)) for own in tables])
    distinct = distinct_rows(facet_keys(nodes.T))
    n_ways = np.bincount(distinct.of, _way(nodes).astype(float), len(distinct.starts))
    alike = (distinct.count == 2) & (n_ways != 1)
    return np.bincount(owner, alike[distinct.of], len(elements)) > 0


def _way(nodes: Ints) -> Bools:
    """Return the sense in which facets are traversed, comparable between facets with the same corners, shape (n,)."""
    if nodes.shape[1] == len("ab"):
        return np.asarray(nodes[:, 0] < nodes[:, 1])
    if nodes.shape[1] == _QUADRILATERAL:
        is_triangle = nodes[:, 2] == nodes[:, 3]
        if is_triangle.any():
            found = np.empty(len(nodes), dtype=bool)
            found[is_triangle], found[~is_triangle] = _way(nodes[is_triangle, :3]), _way(nodes[~is_triangle])
            return found
    around = (nodes.argmin(axis=1)[:, None] + np.arange(nodes.shape[1])) % nodes.shape[1]
    turned = np.take_along_axis(nodes, around, 1)
    return np.asarray(turned[:, 1] < turned[:, -1])


def halved(facets: Ints) -> Bools:
    """Return whether a facet is a quadrilateral covered by two other triangles, or one of these triangles.

    Facets of a 3D mesh have shape (n, 3 or 4), the result has shape (n,).
    """
    inside = np.zeros(len(facets), dtype=bool)
    if facets.shape[1] < _QUADRILATERAL or not len(facets):
        return inside
    is_triangle = facets[:, 2] == facets[:, 3]
    triangles, whole = np.flatnonzero(is_triangle), np.flatnonzero(~is_triangle)
    for halves in (((0, 1, 2), (0, 2, 3)), ((0, 1, 3), (1, 2, 3))):
        rows = np.concatenate([facets[triangles, :3], *(facets[whole][:, half] for half in halves)])
        found = distinct_rows(ascending(rows.T))
        place = np.full(len(found.starts), -1)
        place[found.of[: len(triangles)]] = triangles
        one, other = place[found.of[len(triangles) :]].reshape(2, -1)
        both = (one >= 0) & (other >= 0)
        for part in (whole, one, other):
            inside[part[both]] = True
    return inside


def mirrored_facets(kind: str) -> Ints:
    """Return the number of each local facet after its element is mirrored, shape (n_facets,)."""
    facets = ELEMENT_KINDS[kind].facets
    after = [{MIRRORED[kind][node] for node in facet} for facet in facets]
    return np.array([after.index(set(facet)) for facet in facets])


@cache
def children_of_facet(
    facets: Groups, parents: Groups, children: tuple[tuple[tuple[int, ...], Groups], ...]
) -> tuple[tuple[tuple[int, int], ...], ...]:
    """Return, for each facet of a divided element, its parts, each as a child and a local facet of the child.

    Args:
        facets: facets of the element.
        parents: for each local node, the corners whose midpoint it is.
        children: for each child, its local nodes and its facets.
    """
    return tuple(
        tuple(
            (child, local)
            for child, (nodes, own) in enumerate(children)
            for local, part in enumerate(own)
            if all(set(parents[nodes[node]]) <= set(facet) for node in part)
        )
        for facet in facets
    )


def fanned(facets: Ints) -> list[Ints]:
    """Divide facets, shape (n, k), into edges or triangles: fans from the node with the smallest number.

    Neighbouring elements thus divide a shared facet alike. A facet with its last corner repeated is a triangle.
    """
    if facets.shape[1] == _QUADRILATERAL and (twice := facets[:, 2] == facets[:, 3]).any():
        return [facets[twice][:, :3], *(divided(facets[~twice]) if not twice.all() else [])]
    return divided(facets)


def divided(facets: Ints) -> list[Ints]:
    """Divide facets as `fanned`, but each facet alike, shape (n, 3) or (n, 2) each: triangles may be degenerate."""
    if facets.shape[1] < _QUADRILATERAL:
        return [facets]
    around = (facets.argmin(axis=1)[:, None] + np.arange(_QUADRILATERAL)) % _QUADRILATERAL
    turned = np.take_along_axis(facets, around, axis=1)
    return [turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]]


def triangles_of(facets: Ints) -> Ints:
    """Divide quadrilaterals into two triangles, all first halves first; return triangles, shape (m, 3).

    A quadrilateral with its last corner repeated is one triangle.
    """
    if facets.shape[1] < 4:
        return facets
    second = facets[:, [0, 2, 3]]
    return np.concatenate([facets[:, [0, 1, 2]], second[second[:, 1] != second[:, 2]]])
