"""Dead loads: forces that keep their direction, shared consistently with the elements over what they act on."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ProblemError
from truespring.loading.values import components
from truespring.mesh import (
    Mesh,
    SecondOrder,
    Selection,
    corner_measures,
    covering,
    element_corner_measures,
    facets_within,
    select,
    shares,
)


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


@runtime_checkable
class DeadLoad(Protocol):
    """A load that keeps its direction."""

    def spread(self, body: Body) -> Spread:
        """Return the load over the cells of `body` that carry it."""
        ...


@dataclass(frozen=True)
class Force:
    """A dead load: the `total` force [N], one value a direction, shared consistently over what is `on`.

    `on` is a group of the mesh (its facets where it has some), a side ("left", "right", "bottom", "top", "back",
    "front"), a point ("right-middle"), a Plane, a Box, a Near or node numbers.
    """

    on: Selection
    total: Sequence[float]

    def spread(self, body: Body) -> Spread:
        """Return the load over the cells that carry it: those that cover the nodes, else the nodes alone."""
        total = components(self.total, body.mesh.dim, "force", "N")
        nodes = select(body.mesh, self.on)
        cells, measures = body.carrying(*(covering(body.mesh, self.on) or (nodes[:, None], np.ones((len(nodes), 1)))))
        return Spread(cells, measures, np.tile(total / measures.sum(), (len(cells), 1)))


@dataclass(frozen=True)
class Traction:
    """A dead load: force per area at rest [Pa], one value a direction, on the facets `on`.

    `on` is a group of facets, which may lie inside the body, or a side, another group of the mesh, a Plane, a Box or
    node numbers: all facets of the boundary whose nodes are among them.
    """

    on: Selection
    traction: Sequence[float]

    def spread(self, body: Body) -> Spread:
        """Return the load over the facets."""
        traction = components(self.traction, body.mesh.dim, "traction", "Pa")
        facets = facets_within(body.mesh, self.on)
        density = np.tile(body.thickness * traction, (len(facets), 1))
        return Spread(*body.carrying(facets, corner_measures(body.mesh.nodes[facets])), density)


@dataclass(frozen=True)
class Gravity:
    """The weight of the whole body under an `acceleration` [m/s^2], one value a direction; needs a density."""

    acceleration: Sequence[float]

    def spread(self, body: Body) -> Spread:
        """Return the load over all elements."""
        acceleration = components(self.acceleration, body.mesh.dim, "gravity", "m/s^2")
        if body.density is None:
            raise ProblemError("gravity needs the material's density [kg/m^3], and that of each region")
        elements, measures = body.carrying(body.mesh.elements, element_corner_measures(body.mesh))
        return Spread(elements, body.thickness * measures, body.density[:, None] * acceleration)
