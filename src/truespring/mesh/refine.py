"""Uniform refinement: divide each element at the middles of its edges, faces and body."""

import itertools
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.cells import CELL_SHAPES
from truespring.mesh.facets import children_of_facet, facet_nodes, halved
from truespring.mesh.kinds import ELEMENT_KINDS, MIXED
from truespring.mesh.mesh import Mesh
from truespring.mesh.middles import SecondOrder, edge_numbers, fitting_middles
from truespring.mesh.rows import ascending, distinct_rows

# Nodes of a tetrahedron: corners, then middles of its edges in the order of the kind. Four corners are cut off, and the
# octahedron between them is halved twice through the middles of two opposite edges.
_TETRAHEDRON = (
    *((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3)),
    *((4, 5, 6, 8), (4, 6, 7, 8), (6, 8, 9, 7), (5, 6, 8, 9)),
)

# Nodes of a wedge: corners, middles of edges, middles of quadrilateral faces. Four wedges below, four above.
_WEDGE = (
    *((0, 6, 8, 12, 15, 17), (6, 1, 7, 15, 13, 16), (8, 7, 2, 17, 16, 14), (6, 7, 8, 15, 16, 17)),
    *((12, 15, 17, 3, 9, 11), (15, 13, 16, 9, 4, 10), (17, 16, 14, 11, 10, 5), (15, 16, 17, 9, 10, 11)),
)
# Nodes of a pyramid: corners, middles of edges, middle of the base. Pyramids at the corners, an inverted one in
# the middle, and a tetrahedron at each edge of the base.
_PYRAMID = (
    *((0, 5, 13, 8, 9), (5, 1, 6, 13, 10), (13, 6, 2, 7, 11), (8, 13, 7, 3, 12)),
    *((9, 10, 11, 12, 4), (9, 12, 11, 10, 13)),
)
_BETWEEN = ((5, 9, 10, 13), (6, 10, 11, 13), (7, 11, 12, 13), (8, 12, 9, 13))


class _Division(NamedTuple):
    """Division of an element: for each new node the corners whose mean it is; kind and nodes of each child."""

    parents: tuple[tuple[int, ...], ...]
    children: tuple[tuple[str, tuple[int, ...]], ...]


def refined(mesh: Mesh) -> Mesh:
    """Return the mesh with each edge halved: four elements for each plane one, eight for each solid one.

    A pyramid becomes six pyramids and four tetrahedra. Groups are kept: groups of elements or facets have the parts of
    their members, and the nodes of these; a group of nodes alone gains the new nodes whose parents are all in it.
    Curved edges are divided at their middle node, and their halves are curved; if an element would be folded, all edges
    become straight, with a note.

    Raises MeshError for lines, and if a quadrilateral face lies on two triangles.
    """
    if mesh.element == MIXED and mesh.dim == 3:
        facets, alone = mesh.facets_of(mesh.elements)
        if halved(facets[alone]).any():
            raise MeshError(
                "this mesh cannot be refined: quadrilateral faces lie on two triangles of other elements, which new "
                "nodes would separate; put pyramids between them, or refine it in the program that made it"
            )
    try:
        return _refined(mesh)
    except MeshError:
        if mesh.middles is None:
            raise
        note = "divided along straight edges: with curved edges, some parts would be folded"
        return _refined(replace(mesh, middles=None, notes=(*mesh.notes, note)))


def _refined(mesh: Mesh) -> Mesh:
    divisions = [_division(part.element) for _, part in mesh.blocks]
    numbers = [[part.elements] for _, part in mesh.blocks]
    places, groups = (
        [mesh.nodes],
        {name: [np.isin(np.arange(mesh.n_nodes), of)] for name, of in mesh.node_groups.items()},
    )
    n_nodes = mesh.n_nodes
    for size in sorted({len(corners) for parents, _ in divisions for corners in parents}):
        local = [[corners for corners in parents if len(corners) == size] for parents, _ in divisions]
        rows = [
            part.elements[:, np.array(own)].reshape(-1, size) if own else np.zeros((0, size), dtype=np.int64)
            for (_, part), own in zip(mesh.blocks, local, strict=True)
        ]
        corners = rows[0] if len(rows) == 1 else np.concatenate(rows)
        found = distinct_rows(ascending(np.ascontiguousarray(corners.T)))
        new = corners[found.first]
        ends = np.cumsum([len(own) for own in rows])[:-1]
        for known, of, own in zip(numbers, np.split(n_nodes + found.of, ends), local, strict=True):
            known.append(of.reshape(len(known[0]), len(own)))
        places.append(_halfway(mesh, new))
        for inside in groups.values():
            inside.append(np.asarray(inside[0][new].all(axis=1)))
        n_nodes += len(new)
    kind, elements, first = _children(mesh, divisions, [np.concatenate(known, axis=1) for known in numbers])
    n_children = _of_elements(mesh, [len(children) for _, children in divisions])
    element_groups = {name: _children_of(first[of], n_children[of]) for name, of in mesh.element_groups.items()}
    facet_groups = {name: _parts_of(mesh, of, first) for name, of in mesh.facet_groups.items()}
    node_groups = {name: np.flatnonzero(np.concatenate(inside)) for name, inside in groups.items()}
    for name in node_groups.keys() & (element_groups.keys() | facet_groups.keys()):
        members = [mesh.node_groups[name]]
        if name in element_groups:
            members.append(elements[element_groups[name]].ravel())
        if name in facet_groups:
            members.append(facet_nodes(elements, kind, facet_groups[name]).ravel())
        node_groups[name] = np.concatenate(members)
    parents = np.argsort(_children_of(first, n_children), kind="stable")
    vectors = mesh.vectors_of(np.repeat(np.arange(len(mesh.elements)), n_children)[parents])
    finer = Mesh(
        np.concatenate(places),
        elements,
        kind,
        node_groups,
        element_groups,
        facet_groups,
        mesh.notes,
        element_vectors=vectors,
    )
    return finer if mesh.middles is None else _curved(finer, mesh)


def _halfway(mesh: Mesh, groups: Ints) -> Floats:
    """Return the mean position of each group of nodes [m], shape (n, dim); of curved edges the middle node."""
    if mesh.middles is None:
        return np.asarray(mesh.nodes[groups].mean(axis=1))
    return np.asarray(mesh.middles[edge_numbers(mesh, groups)])


def _curved(finer: Mesh, mesh: Mesh) -> Mesh:
    """Return the refined mesh with the middle nodes of its edges on the second-order elements of `mesh`."""
    whole, (_, children) = SecondOrder(mesh), _division(mesh.element)
    corners = np.array([nodes for _, nodes in children])
    local_edges = corners[:, np.array(mesh.kind.edges)].reshape(-1, 2)
    shape = CELL_SHAPES["triangle6" if mesh.element == "triangle" else "tetra10"]
    shares = shape.shapes(shape.places[local_edges].mean(axis=1))
    places = np.einsum("ek,nki->nei", shares, whole.nodes[whole.of(mesh.elements)])
    pairs = finer.elements[:, np.array(mesh.kind.edges)]
    return replace(finer, middles=fitting_middles(finer, pairs.reshape(-1, 2), places.reshape(-1, mesh.dim))[0])


def _children(mesh: Mesh, divisions: Sequence[_Division], numbers: Sequence[Ints]) -> tuple[str, Ints, Ints]:
    """Return kind and table of all children, element after element, and the number of each element's first child.

    `numbers` are the nodes of the elements of each kind: corners, then new nodes by ascending number of parents.
    """
    kinds = {kind for _, children in divisions for kind, _ in children}
    kind = kinds.pop() if len(kinds) == 1 else MIXED
    tables, first, n_children = [], np.zeros(len(mesh.elements), dtype=np.int64), 0
    for (of, part), (parents, children), known in zip(mesh.blocks, divisions, numbers, strict=True):
        n_corners = part.kind.n_nodes
        order = [*range(n_corners), *(n_corners + one for one in _by_size(parents))]
        local = [nodes if kind != MIXED else _merged(own, nodes) for own, nodes in children]
        tables.append(known[:, np.argsort(order)][:, np.array(local)].reshape(-1, len(local[0])))
        first[of] = n_children + len(children) * np.arange(len(of))
        n_children += len(children) * len(of)
    return kind, tables[0] if len(tables) == 1 else np.concatenate(tables), first


def _merged(kind: str, nodes: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(nodes[place] for place in ELEMENT_KINDS[kind].merged)


def _of_elements(mesh: Mesh, by_kind: Sequence[int]) -> Ints:
    """Return the value of its kind for each element, shape (n_elements,)."""
    found = np.empty(len(mesh.elements), dtype=np.int64)
    for (numbers, _), value in zip(mesh.blocks, by_kind, strict=True):
        found[numbers] = value
    return found


def _children_of(first: Ints, count: Ints) -> Ints:
    return np.repeat(first - np.cumsum(count) + count, count) + np.arange(int(count.sum()))


def _parts_of(mesh: Mesh, facets: Ints, first: Ints) -> Ints:
    """Return the facets of children that cover facets of their parents, as element and local facet, shape (n, 2)."""
    found = []
    for numbers, part in mesh.blocks:
        own = facets[np.isin(facets[:, 0], numbers)]
        kind, (parents, children) = part.kind, _division(part.element)
        corners = tuple((corner,) for corner in range(kind.n_nodes))
        of_children = tuple((nodes, ELEMENT_KINDS[child].facets) for child, nodes in children)
        parts = np.array(children_of_facet(kind.facets, corners + parents, of_children))[own[:, 1]]  # (n, parts, 2)
        start = np.stack([first[own[:, 0]], np.zeros(len(own), dtype=np.int64)], axis=1)
        found.append((start[:, None] + parts).reshape(-1, 2))
    return np.concatenate(found)


def _by_size(parents: tuple[tuple[int, ...], ...]) -> list[int]:
    """Return the indices of new nodes by ascending number of parents."""
    return sorted(range(len(parents)), key=lambda place: (len(parents[place]), place))


@cache
def _division(element: str) -> _Division:
    kind = ELEMENT_KINDS[element]
    match element:
        case "triangle":
            return _Division(kind.edges, _of_one("triangle", ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))))
        case "tetrahedron":
            return _Division(kind.edges, _of_one("tetrahedron", _TETRAHEDRON))
        case "wedge":
            return _Division(kind.edges + kind.facets[2:], _of_one("wedge", _WEDGE))
        case "pyramid":
            children = (*_of_one("pyramid", _PYRAMID), *_of_one("tetrahedron", _BETWEEN))
            return _Division(kind.edges + kind.facets[:1], children)
        case "quadrilateral" | "hexahedron":
            return _of_cube(element)
    raise MeshError(f"a mesh of {element} elements cannot be refined: the springs of a network cannot be divided")


def _of_one(kind: str, children: tuple[tuple[int, ...], ...]) -> tuple[tuple[str, tuple[int, ...]], ...]:
    return tuple((kind, nodes) for nodes in children)


def _of_cube(element: str) -> _Division:
    """Return the division of a square or cube by the lattice of three nodes along each axis."""
    dim = ELEMENT_KINDS[element].dim
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
    return _Division(tuple(parents), _of_one(element, children))
