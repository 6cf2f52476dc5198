"""Meshes of triangles or tetrahedra on the same nodes: what any body of elements may be divided into."""

import numpy as np

from truespring.arrays import Ints
from truespring.errors import MeshError
from truespring.mesh.facets import find_facets
from truespring.mesh.kinds import ELEMENT_KINDS
from truespring.mesh.merged import kinds_in, repeats
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
    found = [(_cones(one, own), numbers) for one, numbers, own in kinds_in(mesh.elements, mesh.element)]
    elements = np.concatenate([cones for (cones, _), _ in found])
    parents = np.concatenate([numbers[of] for (_, of), numbers in found])
    groups = {name: np.flatnonzero(np.isin(parents, of)) for name, of in mesh.element_groups.items()}
    facets = {
        name: find_facets(elements, kind, _proper(np.concatenate(_fanned(mesh.facet_nodes(of)))))
        for name, of in mesh.facet_groups.items()
    }
    return Mesh(mesh.nodes, elements, kind, mesh.node_groups, groups, facets, mesh.notes), parents


def _cones(element: str, elements: Ints) -> tuple[Ints, Ints]:
    """The simplices of elements of one kind, and the element that each is a part of, in the order of these."""
    kind = ELEMENT_KINDS[element]
    tops = elements.argmin(axis=1)
    found, whose = [], []
    for top in range(kind.n_nodes):
        numbers = np.flatnonzero(tops == top)
        corners = elements[numbers]
        for facet in kind.facets:
            if top in facet:
                continue
            for base in _fanned(corners[:, list(dict.fromkeys(facet))]):
                # Seen from outside a facet turns anticlockwise, seen from the cone's top clockwise.
                parts = (base[:, ::-1], corners[:, [top]]) if kind.dim == 3 else (corners[:, [top]], base)
                found.append(np.concatenate(parts, axis=1))
                whose.append(numbers)
    parents = np.concatenate(whose)
    order = np.argsort(parents, kind="stable")
    return np.concatenate(found)[order], parents[order]


def _fanned(facets: Ints) -> list[Ints]:
    """The edges or triangles of facets, shape (n, k): fans from the node of the smallest number.

    Of a triangle that names its last corner twice, as beside quadrilaterals, one of both parts is none.
    """
    if facets.shape[1] < 4:
        return [facets]
    first = facets.argmin(axis=1)[:, None]
    turned = np.take_along_axis(facets, (first + np.arange(facets.shape[1])) % facets.shape[1], axis=1)
    return [turned[:, [0, k, k + 1]] for k in range(1, facets.shape[1] - 1)]


def _proper(facets: Ints) -> Ints:
    return facets[~repeats(facets)]
