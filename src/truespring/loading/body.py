"""The body that loads act on, and the integration of dead loads over its cells."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh import Mesh, SecondOrder, Selection, covering, shares


class Body(NamedTuple):
    """The body that loads act on.

    Attributes:
        mesh: the mesh.
        thickness: thickness [m]; 1 in 3D.
        density: density of each element [kg/m^3], shape (n_elements,); None if not known.
        fibres: unit vectors along the fibres of each element, zero where it has none, shape (n_families, n_elements,
            dim); None if no element has fibres.
        second_order: mid-edge nodes of second-order elements; None for first-order elements.
    """

    mesh: Mesh
    thickness: float
    density: Floats | None
    fibres: Floats | None = None
    second_order: SecondOrder | None = None

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
