"""Finite elements of second order: triangles and tetrahedra with nodes at the midpoints of edges."""

from functools import cached_property

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.conditions import Loading, Turn
from truespring.loading import Body
from truespring.mesh import Grid, SecondOrder, edge_numbers
from truespring.models.fem_potential import FemPotential
from truespring.models.reference_element import Reference, reference_element

# Element of second order of scikit-fem, with nodes in the order of VTK, and order of quadrature: 3 points in triangles,
# 4 in tetrahedra.
_QUADRATIC: dict[str, tuple[str, int]] = {
    "triangle": ("ElementTriP2", 2),
    "tetrahedron": ("ElementTetP2", 2),
}


class QuadraticPotential(FemPotential):
    """Elements of second order; nodes are those of the mesh, then the midpoints of its edges."""

    interpolation = "quadratic"

    @cached_property
    def _second_order(self) -> SecondOrder:
        return SecondOrder(self.mesh)

    @cached_property
    def nodes(self) -> Floats:
        """Undeformed positions [m], shape (n_nodes + n_edges, dim)."""
        return self._second_order.nodes

    @cached_property
    def elements(self) -> Ints:
        """Node numbers of each element, corners, then midpoints of edges, shape (n_elements, 6 or 10)."""
        return self._second_order.of(self.mesh.elements)

    @property
    def grid(self) -> Grid:
        """All nodes and elements, for the interpolation of displacements."""
        return Grid(self.nodes, {f"{self.mesh.kind.vtk}{self.elements.shape[1]}": self.elements})

    @property
    def parents(self) -> Ints:
        """Nodes of the mesh at the ends of each edge, shape (n_edges, 2)."""
        return self.mesh.edges

    @cached_property
    def _reference(self) -> Reference:
        element, order = _QUADRATIC[self.mesh.element]
        reference = reference_element(self.mesh.element, element, order)
        curved = self.mesh.middles is not None  # isoparametric
        return reference._replace(corner_slopes=reference.slopes) if curved else reference

    @cached_property
    def loading(self) -> Loading:
        """The loading of the problem, consistent with quadratic elements.

        The midpoint of an edge is supported if one support contains both ends, if each end has a support of a single
        node, or if the edge is on a boundary facet, or on the rim of a pressed surface, whose corners have the same
        prescribed motion. Edges between two supports in the interior are free.
        """
        linear, ends = self.problem.loading, self.mesh.edges
        by_edge = np.zeros((len(ends), self.mesh.dim), dtype=bool)
        alone = np.zeros_like(linear.held)
        for nodes, directions, _, _ in self.problem.held:
            inside = np.zeros_like(linear.held)
            inside[np.ix_(nodes, np.array(directions))] = True
            by_edge |= inside[ends].all(axis=1)
            alone |= inside & (len(nodes) == 1)
        by_edge |= alone[ends].all(axis=1)
        for cells in (self.mesh.boundary, self.problem.rims):
            edges = self._held_alike(cells)
            by_edge[edges] |= linear.held[ends[edges, 0]]
        held = np.concatenate([linear.held, by_edge])
        whole = np.asarray(by_edge.all(axis=1))
        displacements = [
            np.where(held, np.concatenate([part.displacement, part.displacement[ends].mean(axis=1)]), 0.0)
            for part in linear.parts
        ]
        turns = [tuple(self._turn(turn, whole) for turn in part.turns) for part in linear.parts]
        return self.problem.loading_on(self.body, held, np.array(displacements), turns)

    def lumped_mass(self) -> Floats:
        """Return the lumped mass of all nodes [kg], shape (n_nodes + n_edges,), see `nodal_mass`."""
        return self.problem.mass_on(self.body)

    @property
    def body(self) -> Body:
        """The body that loads act on, with nodes on the edges of its cells."""
        return self.problem.body._replace(second_order=self._second_order)

    def _held_alike(self, cells: Ints) -> Ints:
        """Return the edges of cells whose corners have the same supports and prescribed motion, shape (n,).

        `cells` are the corners of each cell, shape (n_cells, corners).
        """
        loading = self.problem.loading.full
        motion = loading.motion()
        alike = (loading.held[cells] == loading.held[cells[:, :1]]).all(axis=(1, 2))
        alike &= (motion[cells] == motion[cells[:, :1]]).all(axis=(1, 2))
        local = np.array([(i, j) for j in range(cells.shape[1]) for i in range(j)])
        return edge_numbers(self.mesh, cells[alike][:, local]).ravel()

    def _turn(self, turn: Turn, held: Bools) -> Turn:
        """Return a turn that contains the supported midpoints of edges between its nodes, too."""
        mesh = self.mesh
        arms = np.full(mesh.nodes.shape, np.nan)
        arms[turn.nodes] = turn.arms
        aside = self._second_order.middles - mesh.nodes[mesh.edges].mean(axis=1)
        middles = arms[mesh.edges].mean(axis=1) + aside
        inside = np.flatnonzero(held & ~np.isnan(middles).any(axis=1))
        nodes = np.concatenate([turn.nodes, mesh.n_nodes + inside])
        return turn._replace(nodes=nodes, arms=np.concatenate([turn.arms, middles[inside]]))
