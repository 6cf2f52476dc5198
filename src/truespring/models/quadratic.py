"""Triangles and tetrahedra with nodes in the middle of their edges: they do not lock, and bend well."""

from functools import cached_property
from typing import Any

import numpy as np
import skfem

from truespring.arrays import Bools, Floats, Ints
from truespring.conditions import Loading, Turn
from truespring.loading import Body, nodal_force
from truespring.mesh import Grid, SecondOrder, edge_numbers
from truespring.models.fem_potential import FemPotential
from truespring.models.reference_element import Reference, reference_element

# scikit-fem's element of second order and its order of quadrature, 3 points in a triangle and 4 in a tetrahedron; its
# nodes are in VTK's order.
_QUADRATIC: dict[str, tuple[Any, int]] = {
    "triangle": (skfem.ElementTriP2, 2),
    "tetrahedron": (skfem.ElementTetP2, 2),
}


class QuadraticPotential(FemPotential):
    """Elements of second order on the problem's mesh: its nodes first, then the middles of its edges."""

    interpolation = "quadratic"

    @cached_property
    def _second_order(self) -> SecondOrder:
        return SecondOrder(self.mesh)

    @cached_property
    def nodes(self) -> Floats:
        """Reference positions [m], shape (n_nodes + n_edges, dim)."""
        return self._second_order.nodes

    @cached_property
    def elements(self) -> Ints:
        """Corners, then middles of the edges, shape (n_elements, 6 or 10)."""
        return self._second_order.of(self.mesh.elements)

    @property
    def grid(self) -> Grid:
        """All nodes and elements, by which a displacement goes on between them."""
        return Grid(self.nodes, {f"{self.mesh.kind.vtk}{self.elements.shape[1]}": self.elements})

    @property
    def parents(self) -> Ints:
        """The two nodes of the mesh between which each further node stands, shape (n_edges, 2)."""
        return self.mesh.edges

    @cached_property
    def _reference(self) -> Reference:
        element, order = _QUADRATIC[self.mesh.element]
        reference = reference_element(self.mesh.element, element(), order)
        curved = self.mesh.middles is not None  # then the shape functions place the element too
        return reference._replace(corner_slopes=reference.slopes) if curved else reference

    @cached_property
    def loading(self) -> Loading:
        """The problem's loading, consistent with quadratic elements.

        An edge is held where one support holds both its ends, where both ends have a support of their own, as
        nodes with a motion each do, and where all corners of a boundary facet, or both ends on the rim of a pressed
        surface, are held alike, as where several supports make up one. Edges that run from one support to another
        through the body are free.
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
        for cells in (self.mesh.boundary, self.problem.rims):
            edges = self._held_alike(cells)
            by_edge[edges] |= given.held[ends[edges, 0]]
        held = np.concatenate([given.held, by_edge])
        displacement = np.concatenate([given.displacement, given.displacement[ends].mean(axis=1)])
        turns = tuple(self._turn(turn, np.asarray(by_edge.all(axis=1))) for turn in given.turns)
        force = nodal_force(self.problem.spreads(self.body), self.nodes.shape)
        return Loading(force, held, np.where(held, displacement, 0.0), turns, self.problem.following(self.body, held))

    @property
    def body(self) -> Body:
        """What loads act on: the problem's body, whose cells have nodes on their edges too."""
        return self.problem.body._replace(second_order=self._second_order)

    def _held_alike(self, cells: Ints) -> Ints:
        """The edges of cells, given by their corners, all of whose corners are held and moved alike."""
        given = self.problem.loading
        motion = given.motion()
        alike = (given.held[cells] == given.held[cells[:, :1]]).all(axis=(1, 2))
        alike &= (motion[cells] == motion[cells[:, :1]]).all(axis=(1, 2))
        local = np.array([(i, j) for j in range(cells.shape[1]) for i in range(j)])
        return edge_numbers(self.mesh, cells[alike][:, local]).ravel()

    def _turn(self, turn: Turn, held: Bools) -> Turn:
        """A turn of the held edges between its nodes too."""
        mesh = self.mesh
        arms = np.full(mesh.nodes.shape, np.nan)
        arms[turn.nodes] = turn.arms
        aside = self._second_order.middles - mesh.nodes[mesh.edges].mean(axis=1)
        middles = arms[mesh.edges].mean(axis=1) + aside
        inside = np.flatnonzero(held & ~np.isnan(middles).any(axis=1))
        nodes = np.concatenate([turn.nodes, mesh.n_nodes + inside])
        return turn._replace(nodes=nodes, arms=np.concatenate([turn.arms, middles[inside]]))
