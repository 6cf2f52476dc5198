"""Triangles and tetrahedra with nodes in the middle of their edges: they do not lock, and bend well."""

from functools import cached_property
from typing import Any

import numpy as np
import skfem

from truespring.arrays import Floats, Ints
from truespring.mesh import Mesh, covering, select
from truespring.models.fem import FemPotential, Reference, reference_element
from truespring.potential import Loading

# scikit-fem's element of second order and its order of quadrature, 3 points in a triangle and 4 in a tetrahedron;
# its nodes are the corners, then the middles of these edges.
_QUADRATIC: dict[str, tuple[Any, int, tuple[tuple[int, int], ...]]] = {
    "triangle": (skfem.ElementTriP2, 2, ((0, 1), (1, 2), (0, 2))),
    "tetrahedron": (skfem.ElementTetP2, 2, ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))),
}

# What a uniform load on a cell of so many corners gives to each corner and to the middle of each edge.
_CONSISTENT = {2: (1 / 6, 2 / 3), 3: (0.0, 1 / 3), 4: (-1 / 20, 1 / 5)}


class QuadraticPotential(FemPotential):
    """Elements of second order on the problem's mesh: its nodes first, then the middles of its edges."""

    interpolation = "quadratic"

    @cached_property
    def nodes(self) -> Floats:
        """Reference positions [m], shape (n_nodes + n_edges, dim)."""
        mesh = self.mesh
        return np.concatenate([mesh.nodes, mesh.nodes[mesh.edges].mean(axis=1)])

    @cached_property
    def elements(self) -> Ints:
        """Corners, then middles of the edges, shape (n_elements, 6 or 10)."""
        mesh = self.mesh
        local = np.array(_QUADRATIC[mesh.element][2])
        middles = mesh.n_nodes + _edge_numbers(mesh, mesh.elements[:, local])
        return np.concatenate([mesh.elements, middles], axis=1)

    @property
    def parents(self) -> Ints:
        """The two nodes of the mesh between which each further node stands, shape (n_edges, 2)."""
        return self.mesh.edges

    @cached_property
    def _reference(self) -> Reference:
        element, order, _ = _QUADRATIC[self.mesh.element]
        return reference_element(self.mesh.element, element(), order)

    @cached_property
    def loading(self) -> Loading:
        """The problem's loading, consistent with quadratic elements.

        An edge is held where one support holds both its ends, where both ends have a support of their own, as
        nodes with a motion each do, and on a boundary facet whose corners all are held alike, as where several
        supports make up one. Edges that run from one support to another through the body are free.
        """
        given, ends = self.problem.loading, self.mesh.edges
        by_edge = np.zeros((len(ends), self.mesh.dim), dtype=bool)
        alone = np.zeros_like(given.held)
        for support in self.problem.supports:
            nodes, directions, _ = self.problem.held_by(support)
            inside = np.zeros_like(given.held)
            inside[np.ix_(nodes, np.array(directions))] = True
            by_edge |= inside[ends].all(axis=1)
            alone |= inside & (len(nodes) == 1)
        by_edge |= alone[ends].all(axis=1)
        facets = self.mesh.boundary
        alike = (given.held[facets] == given.held[facets[:, :1]]).all(axis=(1, 2))
        alike &= (given.displacement[facets] == given.displacement[facets[:, :1]]).all(axis=(1, 2))
        local = np.array([(i, j) for j in range(facets.shape[1]) for i in range(j)])
        edges = _edge_numbers(self.mesh, facets[alike][:, local]).ravel()
        by_edge[edges] |= given.held[ends[edges, 0]]
        held = np.concatenate([given.held, by_edge])
        displacement = np.concatenate([given.displacement, given.displacement[ends].mean(axis=1)])
        force = np.zeros(self.nodes.shape)
        for load in self.problem.loads:
            nodes = select(self.mesh, load.on)
            force += self._shares(nodes)[:, None] * np.asarray(load.total, dtype=float)
        return Loading(force, held, np.where(held, displacement, 0.0))

    def _shares(self, nodes: Ints) -> Floats:
        """The share of a uniform total that each node takes, shape (n_nodes + n_edges,), sum 1."""
        share = np.zeros(len(self.nodes))
        covered = covering(self.mesh, nodes)
        if covered is None:
            share[nodes] = 1 / len(nodes)
            return share
        cells, measures = covered
        at_corner, at_middle = _CONSISTENT[cells.shape[1]]
        local = np.array([(i, j) for j in range(cells.shape[1]) for i in range(j)])
        middles = self.mesh.n_nodes + _edge_numbers(self.mesh, cells[:, local])
        whole = measures.sum(axis=1, keepdims=True)
        np.add.at(share, cells, at_corner * whole)
        np.add.at(share, middles, at_middle * whole)
        return np.asarray(share / share.sum())


def _edge_numbers(mesh: Mesh, pairs: Ints) -> Ints:
    """The number in `mesh.edges` of pairs of nodes, shape (..., 2) to (...)."""
    ordered = np.sort(pairs, axis=-1)
    keys = mesh.edges[:, 0] * mesh.n_nodes + mesh.edges[:, 1]  # ascending, as the edges are
    return np.searchsorted(keys, ordered[..., 0] * mesh.n_nodes + ordered[..., 1])
