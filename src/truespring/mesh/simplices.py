"""Meshes of triangles or tetrahedra on the same nodes: what any body of elements may be divided into."""

import numpy as np

from truespring.arrays import Ints
from truespring.errors import MeshError
from truespring.mesh.facets import find_facets
from truespring.mesh.kinds import ELEMENT_KINDS
from truespring.mesh.merged import repeats
from truespring.mesh.mesh import Mesh
from truespring.mesh.refine import refuse_halved


def in_simplices(mesh: Mesh) -> tuple[Mesh, Ints]:
    """Return a mesh of triangles or tetrahedra on the same nodes, and the element each one comes from, shape (n,).

    An element is a cone over its facets from its node of the smallest number, and a facet a fan from its own: so
    neighbours divide what they share alike, two triangles a quadrilateral, six tetrahedra a hexahedron, three a
    wedge, two a pyramid. Groups are carried over. Source: Dompierre, Labbe, Vallet, Camarero, How to subdivide
    pyramids, prisms and hexahedra into tetrahedra, 8th International Meshing Roundtable (1999). Raises MeshError
    where an element is so far from convex that a part of it would be inverted, where a face of four corners lies on
    two triangles, and for lines.
    """
    if mesh.element == "line":
        raise MeshError("a network of lines has no inside to be divided")
    kind = "triangle" if mesh.dim == 2 else "tetrahedron"
    if mesh.element == kind:
        return mesh, np.arange(len(mesh.elements))
    refuse_halved(mesh)
    found = [(numbers, *_cones(part.element, part.elements)) for numbers, part in mesh.blocks]
    elements = np.concatenate([cones for _, cones, _ in found])
    parents = np.concatenate([numbers[whose] for numbers, _, whose in found])
    order = np.argsort(parents, kind="stable")
    elements, parents = elements[order], parents[order]
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
        for facet in (list(dict.fromkeys(facet)) for facet in kind.facets):  # a triangle may name a corner twice
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

    Triangles that name their last corner twice are one.
    """
    if facets.shape[1] < 4:
        return [facets]
    first = facets.argmin(axis=1)[:, None]
    turned = np.take_along_axis(facets, (first + np.arange(facets.shape[1])) % facets.shape[1], axis=1)
    fans = [turned[:, [0, k, k + 1]] for k in range(1, facets.shape[1] - 1)]
    return [fan[~repeats(fan)] for fan in fans]
