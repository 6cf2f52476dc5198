"""Meshes of triangles or tetrahedra on the same nodes: what any body of elements may be divided into."""

import numpy as np

from truespring.arrays import Ints
from truespring.errors import MeshError
from truespring.mesh.facets import find_facets
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
    if mesh.kind.n_nodes == mesh.dim + 1:
        return mesh, np.arange(len(mesh.elements))
    tops = mesh.elements.argmin(axis=1)
    found, whose = [], []
    for top in range(mesh.kind.n_nodes):
        numbers = np.flatnonzero(tops == top)
        corners = mesh.elements[numbers]
        for facet in mesh.kind.facets:
            if top in facet:
                continue
            for base in _fanned(corners[:, facet]):
                # Seen from outside a facet turns anticlockwise: from its own cone's top, clockwise.
                turned = base[:, ::-1] if mesh.dim == 3 else base
                cone = (turned, corners[:, [top]]) if mesh.dim == 3 else (corners[:, [top]], turned)
                found.append(np.concatenate(cone, axis=1))
                whose.append(numbers)
    parents = np.concatenate(whose)
    order = np.argsort(parents, kind="stable")
    elements, parents = np.concatenate(found)[order], parents[order]
    kind = "triangle" if mesh.dim == 2 else "tetrahedron"
    groups = {name: np.flatnonzero(np.isin(parents, of)) for name, of in mesh.element_groups.items()}
    facets = {
        name: find_facets(elements, kind, np.concatenate(_fanned(mesh.facet_nodes(of))))
        for name, of in mesh.facet_groups.items()
    }
    return Mesh(mesh.nodes, elements, kind, mesh.node_groups, groups, facets, mesh.notes), parents


def _fanned(facets: Ints) -> list[Ints]:
    """The edges or triangles of facets, shape (n, k): fans from the node of the smallest number."""
    if facets.shape[1] < 4:
        return [facets]
    first = facets.argmin(axis=1)[:, None]
    turned = np.take_along_axis(facets, (first + np.arange(facets.shape[1])) % facets.shape[1], axis=1)
    return [turned[:, [0, k, k + 1]] for k in range(1, facets.shape[1] - 1)]
