"""The body that loads act on, and the integration of dead loads over its cells."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh import Mesh, SecondOrder, Selection, covering, element_corner_measures, shares


class Body(NamedTuple):
    """The body that loads act on.

    Attributes:
        mesh: the mesh.
        thickness: thickness [m]; 1 in 3D.
        density: density of each element [kg/m^3], shape (n_elements,); None if not known.
        fibres: unit vectors along the fibres of each element, zero where it has none, shape (n_families, n_elements,
            dim); None if no element has fibres.
        second_order: mid-edge nodes of second-order elements; None for first-order elements.
        moving: whether the weight of the nodes is that of their lumped masses, as in a motion.
    """

    mesh: Mesh
    thickness: float
    density: Floats | None
    fibres: Floats | None = None
    second_order: SecondOrder | None = None
    moving: bool = False

    @property
    def nodes(self) -> Floats:
        """Undeformed positions of all nodes, mid-edge nodes included [m], shape (n_nodes, dim)."""
        return self.mesh.nodes if self.second_order is None else self.second_order.nodes

    def whole(self, cells: Ints) -> Ints:
        """Return all nodes of cells from their corners: shape (n, k) from shape (n, corners)."""
        return cells if self.second_order is None else self.second_order.of(cells)

    def carrying(self, cells: Ints, measures: Floats) -> tuple[Ints, Floats]:
        """Return all nodes of cells and the share of each node in the measure of its cell [m^k], both of shape (n, k).

        `cells` has the corners of each cell, `measures` the share of each corner, both of shape (n, corners).
        """
        if self.second_order is None:
            return cells, measures
        whole = self.second_order.of(cells)
        return whole, self.second_order.shares(whole)

    def shares(self, on: Selection) -> tuple[Ints, Floats]:
        """Return the loaded nodes, ascending, and the share of each in a uniform load [-], both of shape (n,)."""
        covered = covering(self.mesh, on)
        if self.second_order is None or covered is None:
            return shares(self.mesh, on)
        cells, measures = self.carrying(*covered)
        weight = np.zeros(len(self.nodes))
        np.add.at(weight, cells, measures)
        carrying = np.unique(cells)
        return carrying, weight[carrying] / weight[carrying].sum()


class Spread(NamedTuple):
    """A dead load that is uniform over each of several cells.

    Attributes:
        cells: node numbers of elements, facets, edges or single nodes, shape (n, k).
        measures: integral of the shape function of each node over its cell [m^k], shape (n, k); 1 for single nodes.
        density: force per length, area or volume of each cell [N/m^k], shape (n, dim).
    """

    cells: Ints
    measures: Floats
    density: Floats


def nodal_force(spreads: Iterable[Spread], shape: tuple[int, ...]) -> Floats:
    """Return the sum of the nodal forces of all spreads [N], of shape `shape`: (n_nodes, dim)."""
    force = np.zeros(shape)
    for cells, measures, density in spreads:
        np.add.at(force, cells, measures[:, :, None] * density[:, None, :])
    return force


def nodal_mass(body: Body, density: Floats) -> Floats:
    """Return the lumped mass of the nodes of a body [kg], shape (n_nodes,).

    Corners have the integrals of their shape functions. Nodes of second-order elements share the mass in proportion to
    the diagonal of the consistent mass matrix, which is positive (Hinton, Rock and Zienkiewicz 1976).

    Args:
        body: the body.
        density: density of each element [kg/m^3], shape (n_elements,).
    """
    cells, measures = lumped(body)
    mass = np.zeros(len(body.nodes))
    np.add.at(mass, cells, measures * density[:, None])
    return mass


def lumped(body: Body) -> tuple[Ints, Floats]:
    """Return the nodes of each element and their shares of its volume [m^3], both of shape (n_elements, k)."""
    mesh = body.mesh
    cells, shares = mesh.elements, body.thickness * element_corner_measures(mesh)
    if body.second_order is None:
        return cells, shares
    cells = body.whole(cells)
    return cells, shares.sum(axis=1)[:, None] * _diagonal_shares(mesh.elements.shape[1], cells.shape[1])


def _diagonal_shares(corners: int, nodes: int) -> Floats:
    """Return the share of each node of a quadratic simplex in its mass, shape (nodes,): corners first."""
    corner, middle = {3: (3 / 57, 16 / 57), 4: (1 / 36, 4 / 27)}[corners]
    return np.where(np.arange(nodes) < corners, corner, middle)
