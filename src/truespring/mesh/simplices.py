"""Meshes of triangles or tetrahedra on the same nodes: what any body of elements may be divided into."""

import numpy as np

from truespring.arrays import Ints
from truespring.errors import MeshError
from truespring.mesh.facets import find_facets, halved
from truespring.mesh.kinds import ELEMENT_KINDS, MIXED
from truespring.mesh.mesh import Mesh


def in_simplices(mesh: Mesh) -> tuple[Mesh, Ints]:
    """Return a mesh of triangles or tetrahedra on the same nodes, and the element each one comes from, shape (n,).

    An element is a cone over its facets from its node of the smallest number, and a facet a fan from its own: so
    neighbours divide what they share alike, two triangles a quadrilateral, six tetrahedra a hexahedron. Groups are
    carried over. Source: Dompierre, Labbe, Vallet, Camarero, How to subdivide pyramids, prisms and hexahedra into
    tetrahedra, 8th International Meshing Roundtable (1999). Raises MeshError where an element is so far from convex
    that a part of it would be inverted, and for lines.
    """
    if mesh.element == "line":
        raise MeshError("a network of lines has no inside to be divided")
    kind = "triangle" if mesh.dim == 2 else "tetrahedron"
    if mesh.element == kind:
        return mesh, np.arange(len(mesh.elements))
    if mesh.dim == 3 and mesh.element == MIXED and halved(mesh.facets).any():
        raise MeshError("a face of four corners lies on two triangles, which may divide it otherwise")
    cones = [(numbers, *_cones(part.element, part.elements)) for numbers, part in mesh.blocks]
    parents = np.concatenate([numbers[of] for numbers, _, of in cones])
    order = np.argsort(parents, kind="stable")
    elements, parents = np.concatenate([found for _, found, _ in cones])[order], parents[order]
    groups = {name: np.flatnonzero(np.isin(parents, of)) for name, of in mesh.element_groups.items()}
    facets = {
        name: find_facets(elements, kind, np.concatenate(_fanned(mesh.facet_nodes(of))))
        for name, of in mesh.facet_groups.items()
    }
    return Mesh(mesh.nodes, elements, kind, mesh.node_groups, groups, facets, mesh.notes), parents


def _cones(element: str, elements: Ints) -> tuple[Ints, Ints]:
    """The simplices of elements of one kind, and the element that each is a part of."""
    kind = ELEMENT_KINDS[element]
    tops = elements.argmin(axis=1)
    found, whose = [], []
    for top in range(kind.n_nodes):
        numbers = np.flatnonzero(tops == top)
        corners = elements[numbers]
        for facet in kind.facets:
            if top in facet:
                continue
            for base in _fanned(corners[:, facet]):
                # Seen from outside a facet turns anticlockwise, seen from the cone's top clockwise.
                parts = (base[:, ::-1], corners[:, [top]]) if kind.dim == 3 else (corners[:, [top]], base)
                found.append(np.concatenate(parts, axis=1))
                whose.append(numbers)
    return np.concatenate(found), np.concatenate(whose)


def _fanned(facets: Ints) -> list[Ints]:
    """The edges or triangles of facets, shape (n, k): fans from the node of the smallest number.

    A corner that is named twice makes a triangle of a quadrilateral.
    """
    if facets.shape[1] < 4:
        return [facets]
    if (twice := facets[:, 2] == facets[:, 3]).any():
        return [facets[twice][:, :3], *(_fanned(facets[~twice]) if not twice.all() else [])]
    first = facets.argmin(axis=1)[:, None]
    turned = np.take_along_axis(facets, (first + np.arange(facets.shape[1])) % facets.shape[1], axis=1)
    return [turned[:, [0, k, k + 1]] for k in range(1, facets.shape[1] - 1)]
