"""Meshes of half the size: each element divided at the middles of its edges, faces and body."""

import itertools
from functools import cache
from typing import NamedTuple

import numpy as np

from truespring.arrays import Ints
from truespring.errors import MeshError
from truespring.mesh.facets import children_of_facet, facet_nodes
from truespring.mesh.kinds import ELEMENT_KINDS
from truespring.mesh.mesh import Mesh
from truespring.mesh.rows import ascending, distinct_rows

# A tetrahedron's corners and middles of its edges, in the order of the kind's own: four corners are cut off, and the
# octahedron between them is halved twice through the middles of two opposite edges.
_TETRAHEDRON = (
    *((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3)),
    *((4, 5, 6, 8), (4, 6, 7, 8), (6, 8, 9, 7), (5, 6, 8, 9)),
)


class _Division(NamedTuple):
    """How an element is divided: the corners whose middle each new node is, and the nodes of the children."""

    parents: tuple[tuple[int, ...], ...]
    children: tuple[tuple[int, ...], ...]


def refined(mesh: Mesh) -> Mesh:
    """Return the mesh with each edge halved: two elements a line, four a face, eight a body; groups are carried over.

    A group of elements or of facets has their parts, and its group of nodes those of the parts. To a group of nodes
    alone a new node belongs where all nodes that it is the middle of do.
    """
    parents, children = _division(mesh.element)
    n_corners = mesh.elements.shape[1]
    numbers = [mesh.elements]
    places, groups = (
        [mesh.nodes],
        {name: [np.isin(np.arange(mesh.n_nodes), of)] for name, of in mesh.node_groups.items()},
    )
    n_nodes = mesh.n_nodes
    for size in sorted({len(corners) for corners in parents}):
        local = np.array([corners for corners in parents if len(corners) == size])
        corners = mesh.elements[:, local].reshape(-1, size)
        found = distinct_rows(ascending(np.ascontiguousarray(corners.T)))
        new = corners[found.first]
        numbers.append(n_nodes + found.of.reshape(-1, len(local)))
        places.append(mesh.nodes[new].mean(axis=1))
        for inside in groups.values():
            inside.append(np.asarray(inside[0][new].all(axis=1)))
        n_nodes += len(new)
    local_numbers = np.concatenate(numbers, axis=1)
    order = [*range(n_corners), *(n_corners + one for one in _by_size(parents))]
    elements = local_numbers[:, np.argsort(order)][:, np.array(children)].reshape(-1, n_corners)
    element_groups = {name: _children_of(of, len(children)) for name, of in mesh.element_groups.items()}
    facet_groups = {name: _parts_of(of, mesh.element) for name, of in mesh.facet_groups.items()}
    node_groups = {name: np.flatnonzero(np.concatenate(inside)) for name, inside in groups.items()}
    for name in node_groups.keys() & (element_groups.keys() | facet_groups.keys()):
        members = [mesh.node_groups[name]]
        if name in element_groups:
            members.append(elements[element_groups[name]].ravel())
        if name in facet_groups:
            members.append(facet_nodes(elements, mesh.element, facet_groups[name]).ravel())
        node_groups[name] = np.concatenate(members)
    return Mesh(np.concatenate(places), elements, mesh.element, node_groups, element_groups, facet_groups, mesh.notes)


def _children_of(elements: Ints, count: int) -> Ints:
    return np.asarray((count * elements[:, None] + np.arange(count)).ravel())


def _parts_of(facets: Ints, element: str) -> Ints:
    """The facets of the children that make up facets of their parents, each as element and local facet."""
    kind, (parents, children) = ELEMENT_KINDS[element], _division(element)
    corners = tuple((corner,) for corner in range(kind.n_nodes))
    parts = np.array(children_of_facet(kind.facets, corners + parents, children))[facets[:, 1]]  # (n, parts, 2)
    first = np.stack([len(children) * facets[:, 0], np.zeros(len(facets), dtype=np.int64)], axis=1)
    return np.asarray((first[:, None] + parts).reshape(-1, 2))


def _by_size(parents: tuple[tuple[int, ...], ...]) -> list[int]:
    """The places of new nodes in the order in which those of few parents come first."""
    return sorted(range(len(parents)), key=lambda place: (len(parents[place]), place))


@cache
def _division(element: str) -> _Division:
    kind = ELEMENT_KINDS[element]
    match element:
        case "triangle":
            return _Division(kind.edges, ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)))
        case "tetrahedron":
            return _Division(kind.edges, _TETRAHEDRON)
        case "quadrilateral" | "hexahedron":
            return _of_cube(kind.dim)
    raise MeshError(f"a mesh of {element} elements cannot be refined: a network is as fine as its springs are")


def _of_cube(dim: int) -> _Division:
    """A square or cube: the lattice of three nodes along each axis."""
    ring = ((0, 0), (1, 0), (1, 1), (0, 1))
    corners = ring if dim == 2 else tuple((*corner, level) for level in (0, 1) for corner in ring)
    lattice = list(itertools.product((0, 1, 2), repeat=dim))
    parents: list[tuple[int, ...]] = []
    number = {tuple(2 * c for c in corner): place for place, corner in enumerate(corners)}
    for place in lattice:
        if 1 in place:
            number[place] = len(corners) + len(parents)
            near = [
                at
                for at, corner in enumerate(corners)
                if all(p in (1, 2 * c) for p, c in zip(place, corner, strict=True))
            ]
            parents.append(tuple(near))
    children = tuple(
        tuple(number[tuple(o + c for o, c in zip(origin, corner, strict=True))] for corner in corners)
        for origin in itertools.product((0, 1), repeat=dim)
    )
    return _Division(tuple(parents), children)
