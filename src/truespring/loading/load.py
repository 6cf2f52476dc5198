"""Base classes of loads: the methods by which loads are applied, scaled, rotated, drawn, described and exported."""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.loading.body import Body, Spread
from truespring.loading.history import History
from truespring.mesh import Mesh, Selection, loaded
from truespring.potential import Potential


class Mark(NamedTuple):
    """An arrow with a label that shows a load or a prescribed motion.

    Attributes:
        nodes: numbers of the loaded nodes; the arrow is drawn at their centre.
        vector: direction of the arrow, of any length, shape (dim,); zero draws nothing.
        symbol: symbol in the label, such as "F".
        size: value in the label, in `unit`.
        unit: an SI unit as `report.quantity` writes it ("N", "Pa", "m"), or "°".
        along: facets on which small arrows are drawn instead, each along its own force; None for one arrow.
    """

    nodes: Ints
    vector: Floats
    symbol: str
    size: float
    unit: str
    along: "Along | None" = None


class Along(NamedTuple):
    """The facets of a load that differs in direction along a side, shape (n, dim) each.

    Attributes:
        centres: of the facets [m].
        outward: their unit normals, out of the body.
        forces: directions of the load on them, of any length.
    """

    centres: Floats
    outward: Floats
    forces: Floats


class BodyForce(NamedTuple):
    """An `acceleration` [m/s^2] of all elements, shape (dim,), for finite element programs."""

    acceleration: Floats


class FacePressure(NamedTuple):
    """A pressure that follows facets of the boundary, for finite element programs.

    Attributes:
        facets: node numbers of each facet, anticlockwise seen from outside, shape (n, k).
        pressure: pressure on each facet, positive towards the body [Pa], shape (n,).
    """

    facets: Ints
    pressure: Floats


#: A load in the input of another finite element program.
Card = BodyForce | FacePressure


class Load(ABC):
    """A load on a body, a frozen dataclass.

    Subclass DeadLoad or FollowingLoad, and add an entry to LOADS to make it a key of `[[load]]`.

    Attributes:
        on: the loaded selection; None for the whole body.
        over: share of the load along the way or over time, see History; None for a load in proportion to the way at
            rest, and for a constant load in motion.
        on_elements: whether `on` selects elements, as for regions, instead of nodes or facets.
        follows: whether the forces depend on the positions of the nodes.
        instead: alternative for programs without loads that follow the body, for error messages.
    """

    on: Selection | None
    over: History | None = None
    on_elements: ClassVar[bool] = False
    follows: ClassVar[bool]
    instead: ClassVar[str] = ""

    def nodes(self, mesh: Mesh) -> Ints:
        """Return the numbers of the loaded nodes, ascending; raise MeshError if `on` selects nothing."""
        return np.arange(mesh.n_nodes) if self.on is None else loaded(mesh, self.on)

    def spread(self, body: Body) -> Spread | None:
        """Return a dead load over the cells of `body`; None for a load that follows the body."""
        return None

    def following(self, body: Body, held: Bools) -> Potential | None:
        """Return the potential, minus the work, of a load that follows the body; None for a dead load.

        `held` is true where a displacement of `body` is prescribed, shape (n_nodes, dim). A load whose work may depend
        on the path returns an Unsymmetric, or raises ProblemError.
        """
        return None

    def rim(self, mesh: Mesh) -> Ints:
        """Return the edges of the loaded surface that give a load in 3D a potential if held, as nodes, shape (n, 2)."""
        return np.zeros((0, 2), dtype=np.int64)

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """Return the load multiplied by a factor."""

    @abstractmethod
    def turned(self, rotation: Floats) -> Self:
        """Return the load on the same selection of a body rotated by a matrix of shape (dim, dim)."""

    @property
    def vector(self) -> Floats | None:
        """The vector that `turned` rotates, shape (dim,), in the unit of the load.

        None for a load that rotates with the body.
        """
        return None

    @property
    def acceleration_of_body(self) -> Floats | None:
        """The constant acceleration of the whole body that the load is [m/s^2], shape (dim,); None of other loads."""
        return None

    def moved_to(self, on: Selection) -> Self:
        """Return the load on another selection, such as a group of another mesh."""
        changed: Any = replace(self, on=on)  # type: ignore[type-var]  # subclasses are dataclasses
        return changed  # type: ignore[no-any-return]

    @abstractmethod
    def mark(self, body: Body, held: Bools) -> Mark:
        """Return the arrow that shows the load on the undeformed `body`.

        `held` is true where a displacement is prescribed, shape (n_nodes, dim).
        """

    @abstractmethod
    def words(self) -> str:
        """Return a description without a full stop: "force (0, -0.043) N in total on 'right'"."""

    def cards(self, mesh: Mesh) -> tuple[Card, ...]:
        """Return the load in the input of other finite element programs; empty if they take its nodal forces."""
        return ()


class DeadLoad(Load):
    """A load of constant size and direction."""

    follows = False

    @abstractmethod
    def spread(self, body: Body) -> Spread:
        """Return the load over the cells of `body`."""


class FollowingLoad(Load):
    """A load with a potential, whose forces change as the body deforms; subclasses define `instead`."""

    follows = True

    @abstractmethod
    def following(self, body: Body, held: Bools) -> Potential:
        """Return the potential on `body`; an Unsymmetric, or a ProblemError, if the work may depend on the path."""

    def turned(self, rotation: Floats) -> Self:
        """Return the load itself: it turns with the body."""
        return self
