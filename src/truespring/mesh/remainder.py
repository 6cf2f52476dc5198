"""What is left of a mesh after elements were removed."""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Ints
from truespring.errors import MeshError
from truespring.mesh.facets import find_facets
from truespring.mesh.kinds import MIXED
from truespring.mesh.merged import unmerged
from truespring.mesh.mesh import Mesh
from truespring.mesh.middles import edge_numbers

_NONE: Mapping[str, Ints] = MappingProxyType({})


class Remainder(NamedTuple):
    """The elements of a mesh that were not removed.

    Attributes:
        whole: the mesh before.
        mesh: the mesh of the remaining elements, with the groups and middle nodes that remain.
        nodes: numbers of its nodes in the mesh before, ascending, shape (n,).
        elements: numbers of its elements in the mesh before, ascending, shape (m,).
    """

    whole: Mesh
    mesh: Mesh
    nodes: Ints
    elements: Ints

    @property
    def numbers(self) -> Ints:
        """New number of each node of the mesh before, -1 where it does not remain, shape (n_nodes before,)."""
        return _places(self.nodes, self.whole.n_nodes)

    @property
    def element_numbers(self) -> Ints:
        """New number of each element of the mesh before, -1 where it does not remain."""
        return _places(self.elements, len(self.whole.elements))

    def left_of(self, nodes: Ints) -> Ints:
        """Return the new numbers of those of some nodes that remain, shape (n,)."""
        found = self.numbers[nodes]
        return np.asarray(found[found >= 0])

    def holds(self, cells: Ints) -> Bools:
        """Return whether a remaining element has all nodes of a cell, such as a facet, edge or element, shape (n,).

        `cells` are node numbers of the mesh before, shape (n, k).
        """
        return _holds(self.whole, self.elements, cells)


def remainder(mesh: Mesh, elements: Ints, facets: Mapping[str, Ints] = _NONE) -> Remainder:
    """Return what is left of a mesh of which only some elements remain.

    Args:
        mesh: the mesh before.
        elements: numbers of the elements that remain, ascending, shape (m,).
        facets: further groups of facets by name, given by their nodes, shape (n, k): those that remain form a group.

    Raises MeshError if no element remains.
    """
    if not len(elements):
        raise MeshError("no element remains")
    nodes = np.unique(mesh.elements[elements])
    place = _places(nodes, mesh.n_nodes)
    rows = place[mesh.elements[elements]]
    table, kind = rows, mesh.element
    if kind == MIXED and len(several := unmerged(rows)) == 1:
        ((kind, (_, table)),) = several.items()
    of_element = _places(elements, len(mesh.elements))
    groups = {name: _known(place[group]) for name, group in mesh.node_groups.items()}
    by_element = {name: _known(of_element[group]) for name, group in mesh.element_groups.items()}
    by_facet = {name: _rows(of_element, group) for name, group in mesh.facet_groups.items()}
    for name, cells in facets.items():
        there = find_facets(rows, mesh.element, place[cells])
        by_facet[name] = there[there[:, 0] >= 0]
    found = Mesh(
        mesh.nodes[nodes],
        table,
        kind,
        _filled(groups),
        _filled(by_element),
        _filled(by_facet),
        mesh.notes,
        element_vectors=mesh.vectors_of(elements),
    )
    if mesh.middles is not None:
        found = replace(found, middles=mesh.middles[edge_numbers(mesh, nodes[found.edges])])
    found.__dict__["is_stepped"] = mesh.is_stepped  # the stiffness of an element does not depend on what is removed
    return Remainder(mesh, found, nodes, elements)


def _places(numbers: Ints, n: int) -> Ints:
    """Return the place in `numbers` of each of 0..n, -1 where it is not in them, shape (n,)."""
    found = np.full(n, -1, dtype=np.int64)
    found[numbers] = np.arange(len(numbers))
    return found


def _known(numbers: Ints) -> Ints:
    """Return the numbers that are not -1."""
    return np.asarray(numbers[numbers >= 0])


def _rows(of_element: Ints, facets: Ints) -> Ints:
    """Return facets, rows of element and local facet, with new numbers of those elements that remain."""
    found = np.column_stack([of_element[facets[:, 0]], facets[:, 1]])
    return found[found[:, 0] >= 0]


def _filled(groups: Mapping[str, Ints]) -> dict[str, Ints]:
    """Return the groups that have a member."""
    return {name: group for name, group in groups.items() if len(group)}


def _holds(mesh: Mesh, elements: Ints, cells: Ints) -> Bools:
    """Return whether one of some elements has all nodes of each cell, shape (n,); see `Remainder.holds`."""
    by_cell = _incidence(cells, mesh.n_nodes)
    shared = by_cell @ _incidence(mesh.elements[elements], mesh.n_nodes).T
    return np.asarray(shared.max(axis=1).toarray().ravel() == np.diff(by_cell.indptr))


def _incidence(cells: Ints, n_nodes: int) -> "sparse.csr_array[Any]":
    """Return 1 where a cell has a node, shape (n_cells, n_nodes)."""
    rows = np.repeat(np.arange(len(cells)), cells.shape[1])
    found = sparse.csr_array((np.ones(cells.size), (rows, cells.ravel())), shape=(len(cells), n_nodes))
    found.sum_duplicates()
    found.data[:] = 1.0
    return found
