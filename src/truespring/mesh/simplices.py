"""Division of the elements of a mesh into triangles or tetrahedra on the same nodes."""

import numpy as np

from truespring.arrays import Ints
from truespring.errors import MeshError
from truespring.mesh.facets import fanned, find_facets, halved
from truespring.mesh.kinds import ELEMENT_KINDS, MIXED
from truespring.mesh.mesh import Mesh


def in_simplices(mesh: Mesh) -> tuple[Mesh, Ints]:
    """Divide elements into triangles or tetrahedra; return the mesh and the original element of each, shape (n,).

    An element is divided into cones over its facets from its node with the smallest number, and a facet into a fan
    from its node with the smallest number, so that neighbours divide a shared facet alike: two triangles per
    quadrilateral, six tetrahedra per hexahedron. Groups are kept. Source: Dompierre, Labbe, Vallet, Camarero, How to
    subdivide pyramids, prisms and hexahedra into tetrahedra, 8th International Meshing Roundtable (1999). Raises
    MeshError for lines, and if an element is so far from convex that a part of it would be inverted.
    """
    if mesh.element == "line":
        raise MeshError("a mesh of line elements cannot be divided into triangles or tetrahedra")
    kind = "triangle" if mesh.dim == 2 else "tetrahedron"
    if mesh.element == kind:
        return mesh, np.arange(len(mesh.elements))
    if mesh.dim == 3 and mesh.element == MIXED and halved(mesh.facets).any():
        raise MeshError(
            "a quadrilateral face of one element is covered by two triangles of others: the mesh cannot be divided "
            "consistently"
        )
    cones = [(numbers, *_cones(part.element, part.elements)) for numbers, part in mesh.blocks]
    parents = np.concatenate([numbers[of] for numbers, _, of in cones])
    order = np.argsort(parents, kind="stable")
    elements, parents = np.concatenate([found for _, found, _ in cones])[order], parents[order]
    groups = {name: np.flatnonzero(np.isin(parents, of)) for name, of in mesh.element_groups.items()}
    facets = {
        name: find_facets(elements, kind, np.concatenate(fanned(mesh.facet_nodes(of))))
        for name, of in mesh.facet_groups.items()
    }
    known = (mesh.node_groups, groups, facets, mesh.notes)
    return Mesh(mesh.nodes, elements, kind, *known, element_vectors=mesh.vectors_of(parents)), parents


def _cones(element: str, elements: Ints) -> tuple[Ints, Ints]:
    """Return the simplices of elements of one kind, and the row of the element that each is a part of."""
    kind = ELEMENT_KINDS[element]
    tops = elements.argmin(axis=1)
    found, whose = [], []
    for top in range(kind.n_nodes):
        numbers = np.flatnonzero(tops == top)
        corners = elements[numbers]
        for facet in kind.facets:
            if top in facet:
                continue
            for base in fanned(corners[:, facet]):
                # A facet is anticlockwise seen from outside, clockwise seen from the top of the cone.
                parts = (base[:, ::-1], corners[:, [top]]) if kind.dim == 3 else (corners[:, [top]], base)
                found.append(np.concatenate(parts, axis=1))
                whose.append(numbers)
    return np.concatenate(found), np.concatenate(whose)
