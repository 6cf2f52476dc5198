"""The body that loads act on, and dead loads as they are integrated over its cells."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh import Mesh, SecondOrder, Selection, covering, shares


class Body(NamedTuple):
    """What loads act on: `thickness` [m] is 1 in space, `density` [kg/m^3] of each element None where not known.

    `second_order` is None where elements have no nodes but those of the mesh.
    """

    mesh: Mesh
    thickness: float
    density: Floats | None
    second_order: SecondOrder | None = None

    @property
    def nodes(self) -> Floats:
        """Positions of all nodes at rest [m], shape (n_nodes, dim)."""
        return self.mesh.nodes if self.second_order is None else self.second_order.nodes

    def whole(self, cells: Ints) -> Ints:
        """Return all nodes of cells that are given by their corners."""
        return cells if self.second_order is None else self.second_order.of(cells)

    def carrying(self, cells: Ints, measures: Floats) -> tuple[Ints, Floats]:
        """Return cells and each corner's part of their measures [m^k], both as all nodes of the cells have them."""
        if self.second_order is None:
            return cells, measures
        whole = self.second_order.of(cells)
        return whole, self.second_order.shares(whole)

    def shares(self, on: Selection) -> tuple[Ints, Floats]:
        """Return the nodes that a load acts on, ascending, and the share of a uniform total that each takes."""
        covered = covering(self.mesh, on)
        if self.second_order is None or covered is None:
            return shares(self.mesh, on)
        cells, measures = self.carrying(*covered)
        weight = np.zeros(len(self.nodes))
        np.add.at(weight, cells, measures)
        carrying = np.unique(cells)
        return carrying, weight[carrying] / weight[carrying].sum()


class Spread(NamedTuple):
    """A dead load over cells of the mesh.

    Attributes:
        cells: elements, facets, edges or nodes, by all their nodes, shape (n, k).
        measures: what each node's shape function integrates to [m^k], shape (n, k); 1 for nodes alone.
        density: force per measure of each cell [N/m^k], shape (n, dim).
    """

    cells: Ints
    measures: Floats
    density: Floats


def nodal_force(spreads: Iterable[Spread], shape: tuple[int, ...]) -> Floats:
    """Return the sum of loads on the nodes [N], of shape (n_nodes, dim)."""
    force = np.zeros(shape)
    for cells, measures, density in spreads:
        np.add.at(force, cells, measures[:, :, None] * density[:, None, :])
    return force
