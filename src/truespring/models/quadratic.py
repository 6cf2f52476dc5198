"""Triangles and tetrahedra with nodes in the middle of their edges: they do not lock, and bend well."""

from functools import cached_property
from typing import Any

import numpy as np
import skfem

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import ModelError
from truespring.mesh import Mesh
from truespring.models.fem import FemPotential, Reference, reference_element
from truespring.potential import Loading, Turn

# scikit-fem's element of second order and its order of quadrature, 3 points in a triangle and 4 in a tetrahedron;
# its nodes are the corners, then the middles of these edges.
_QUADRATIC: dict[str, tuple[Any, int, tuple[tuple[int, int], ...]]] = {
    "triangle": (skfem.ElementTriP2, 2, ((0, 1), (1, 2), (0, 2))),
    "tetrahedron": (skfem.ElementTetP2, 2, ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))),
}

# What a uniform load on a cell of so many corners gives to each corner and to the middle of each edge.
_CONSISTENT = {1: (1.0, 0.0), 2: (1 / 6, 2 / 3), 3: (0.0, 1 / 3), 4: (-1 / 20, 1 / 5)}


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
        for nodes, directions, _, _ in self.problem.held:
            inside = np.zeros_like(given.held)
            inside[np.ix_(nodes, np.array(directions))] = True
            by_edge |= inside[ends].all(axis=1)
            alone |= inside & (len(nodes) == 1)
        by_edge |= alone[ends].all(axis=1)
        facets = self.mesh.boundary
        alike = (given.held[facets] == given.held[facets[:, :1]]).all(axis=(1, 2))
        motion = given.motion()
        alike &= (motion[facets] == motion[facets[:, :1]]).all(axis=(1, 2))
        local = np.array([(i, j) for j in range(facets.shape[1]) for i in range(j)])
        edges = _edge_numbers(self.mesh, facets[alike][:, local]).ravel()
        by_edge[edges] |= given.held[ends[edges, 0]]
        held = np.concatenate([given.held, by_edge])
        displacement = np.concatenate([given.displacement, given.displacement[ends].mean(axis=1)])
        turns = tuple(self._turn(turn, np.asarray(by_edge.all(axis=1))) for turn in given.turns)
        if given.following:
            raise ModelError(
                "pressure and moments act on elements of first order only: give the model an element of these, "
                "or a traction, which acts on both"
            )
        return Loading(self._force(), held, np.where(held, displacement, 0.0), turns)

    def _turn(self, turn: Turn, held: Bools) -> Turn:
        """A turn of the held edges between its nodes too."""
        arms = np.full(self.mesh.nodes.shape, np.nan)
        arms[turn.nodes] = turn.arms
        middles = arms[self.mesh.edges].mean(axis=1)
        inside = np.flatnonzero(held & ~np.isnan(middles).any(axis=1))
        nodes = np.concatenate([turn.nodes, self.mesh.n_nodes + inside])
        return turn._replace(nodes=nodes, arms=np.concatenate([turn.arms, middles[inside]]))

    def _force(self) -> Floats:
        """The dead loads on the nodes [N], shape (n_nodes + n_edges, dim)."""
        force = np.zeros(self.nodes.shape)
        for cells, measures, density in self.problem.spreads:
            whole = measures.sum(axis=1)[:, None, None] * density[:, None, :]
            at_corner, at_middle = _CONSISTENT[cells.shape[1]]
            np.add.at(force, cells, at_corner * whole)
            if cells.shape[1] > 1:
                local = np.array([(i, j) for j in range(cells.shape[1]) for i in range(j)])
                middles = self.mesh.n_nodes + _edge_numbers(self.mesh, cells[:, local])
                np.add.at(force, middles, at_middle * whole)
        return force


def _edge_numbers(mesh: Mesh, pairs: Ints) -> Ints:
    """The number in `mesh.edges` of pairs of nodes, shape (..., 2) to (...)."""
    ordered = np.sort(pairs, axis=-1)
    keys = mesh.edges[:, 0] * mesh.n_nodes + mesh.edges[:, 1]  # ascending, as the edges are
    return np.searchsorted(keys, ordered[..., 0] * mesh.n_nodes + ordered[..., 1])
