"""Dead loads: forces of constant direction, integrated with the shape functions of the loaded cells."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.errors import ProblemError
from truespring.loading.body import Body, Spread, lumped
from truespring.loading.history import History
from truespring.loading.load import BodyForce, DeadLoad, Mark
from truespring.loading.values import components, rotated, times
from truespring.loading.words import selection_words, vector_words
from truespring.mesh import (
    Mesh,
    Selection,
    corner_measures,
    covering,
    element_corner_measures,
    facets_within,
    loaded,
    select,
)


@dataclass(frozen=True)
class Force(DeadLoad):
    """A dead load of `total` force [N], one value per direction, distributed consistently over the selection `on`.

    `on` is a group of the mesh (its facets, if it has any), a side ("left", "right", "bottom", "top", "back",
    "front"), a point ("right-middle"), a Plane, a Box, a Near or node numbers.

    Example:
        >>> import truespring as ts
        >>> ts.Force("right", (0.0, -0.043)).words()
        "force (0, -0.043) N in total on 'right'"
    """

    on: Selection
    total: Sequence[float]
    over: History | None = field(default=None, kw_only=True)

    def spread(self, body: Body) -> Spread:
        """Return the load over the cells that cover the selected nodes, or over single nodes if none do."""
        total = components(self.total, body.mesh.dim, "force", "N")
        nodes = select(body.mesh, self.on)
        cells, measures = body.carrying(*(covering(body.mesh, self.on) or (nodes[:, None], np.ones((len(nodes), 1)))))
        return Spread(cells, measures, np.tile(total / measures.sum(), (len(cells), 1)))

    def scaled(self, factor: float) -> Self:
        """Return the load multiplied by a factor."""
        return replace(self, total=times(self.total, factor))

    def turned(self, rotation: Floats) -> Self:
        """Return the load with its vector rotated by a matrix of shape (dim, dim)."""
        return replace(self, total=rotated(self.total, rotation))

    @property
    def vector(self) -> Floats:
        """The total force [N], shape (dim,)."""
        return np.array(self.total, dtype=float)

    def mark(self, body: Body, held: Bools) -> Mark:
        """Return an arrow along the force."""
        return Mark(loaded(body.mesh, self.on), self.vector, "F", float(np.linalg.norm(self.total)), "N")

    def words(self) -> str:
        """Return the total and where it acts."""
        return f"force {vector_words(self.total)} N in total on {selection_words(self.on)}"


@dataclass(frozen=True)
class Traction(DeadLoad):
    """A dead load: force per undeformed area [Pa], one value per direction, on the facets `on`.

    `on` is a group of facets, which may lie inside the body; or a side, another group of the mesh, a Plane, a Box or
    node numbers, which select the boundary facets that have all their nodes in the selection.

    Example:
        >>> import truespring as ts
        >>> ts.Traction("right", (50.0, 0.0)).words()
        "traction (50, 0) Pa on 'right'"
    """

    on: Selection
    traction: Sequence[float]
    over: History | None = field(default=None, kw_only=True)

    def spread(self, body: Body) -> Spread:
        """Return the load over the facets."""
        traction = components(self.traction, body.mesh.dim, "traction", "Pa")
        facets = facets_within(body.mesh, self.on)
        density = np.tile(body.thickness * traction, (len(facets), 1))
        return Spread(*body.carrying(facets, corner_measures(body.mesh.nodes[facets])), density)

    def scaled(self, factor: float) -> Self:
        """Return the load multiplied by a factor."""
        return replace(self, traction=times(self.traction, factor))

    def turned(self, rotation: Floats) -> Self:
        """Return the load with its vector rotated by a matrix of shape (dim, dim)."""
        return replace(self, traction=rotated(self.traction, rotation))

    @property
    def vector(self) -> Floats:
        """The traction [Pa], shape (dim,)."""
        return np.array(self.traction, dtype=float)

    def mark(self, body: Body, held: Bools) -> Mark:
        """Return an arrow along the traction."""
        return Mark(loaded(body.mesh, self.on), self.vector, "t", float(np.linalg.norm(self.traction)), "Pa")

    def words(self) -> str:
        """Return the traction and where it acts."""
        return f"traction {vector_words(self.traction)} Pa on {selection_words(self.on)}"


@dataclass(frozen=True)
class Gravity(DeadLoad):
    """The weight of the whole body under an `acceleration` [m/s^2], one value per direction; needs a density.

    Example:
        >>> import truespring as ts
        >>> ts.Gravity((0.0, -9.81)).words()
        'gravity (0, -9.81) m/s^2'
    """

    acceleration: Sequence[float]
    on: None = field(default=None, init=False, repr=False)
    over: History | None = field(default=None, kw_only=True)

    def spread(self, body: Body) -> Spread:
        """Return the load over all elements."""
        acceleration = components(self.acceleration, body.mesh.dim, "gravity", "m/s^2")
        if body.density is None:
            raise ProblemError("gravity needs a density [kg/m^3] of the material and of each region")
        if body.moving:  # as the masses, so that a free fall is uniform
            return Spread(*lumped(body), body.density[:, None] * acceleration)
        elements, measures = body.carrying(body.mesh.elements, element_corner_measures(body.mesh))
        return Spread(elements, body.thickness * measures, body.density[:, None] * acceleration)

    def scaled(self, factor: float) -> Self:
        """Return the load multiplied by a factor."""
        return replace(self, acceleration=times(self.acceleration, factor))

    def turned(self, rotation: Floats) -> Self:
        """Return the load with its vector rotated by a matrix of shape (dim, dim)."""
        return replace(self, acceleration=rotated(self.acceleration, rotation))

    @property
    def vector(self) -> Floats:
        """The acceleration [m/s^2], shape (dim,)."""
        return np.array(self.acceleration, dtype=float)

    @property
    def acceleration_of_body(self) -> Floats | None:
        """The acceleration, unless it changes over time."""
        return self.vector if self.over is None else None

    def mark(self, body: Body, held: Bools) -> Mark:
        """Return an arrow along the acceleration, at the centre of the nodes."""
        size = float(np.linalg.norm(self.acceleration))
        return Mark(np.arange(body.mesh.n_nodes), self.vector, "g", size, "m/s^2")

    def words(self) -> str:
        """Return the acceleration."""
        return f"gravity {vector_words(self.acceleration)} m/s^2"

    def cards(self, mesh: Mesh) -> tuple[BodyForce]:
        """Return the acceleration as a body force of all elements."""
        return (BodyForce(self.vector),)
