"""What a load is: the questions that every load answers, whoever asks them."""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.loading.body import Body, Spread
from truespring.mesh import Mesh, Selection
from truespring.potential import Potential


class Mark(NamedTuple):
    """A load or a prescribed motion as an arrow with a text shows it.

    Attributes:
        nodes: node numbers that it acts on; the arrow stands at their centre.
        vector: the direction in which it acts, of any length, shape (dim,); zero where nothing is to be drawn.
        symbol: what the text calls it, "F".
        size: what the text gives as its size, in `unit`.
        unit: an SI unit as `report.quantity` writes it ("N", "Pa", "m"), or "°".
    """

    nodes: Ints
    vector: Floats
    symbol: str
    size: float
    unit: str


class BodyForce(NamedTuple):
    """A uniform `acceleration` [m/s^2] of all elements, shape (dim,), which a finite element program integrates."""

    acceleration: Floats


class FacePressure(NamedTuple):
    """A pressure on facets of the boundary, which a finite element program integrates and lets follow them.

    Attributes:
        facets: node numbers, anticlockwise seen from outside, shape (n, k).
        pressure: of each facet, positive towards the body [Pa], shape (n,).
    """

    facets: Ints
    pressure: Floats


#: A load as other finite element programs know it.
Card = BodyForce | FacePressure


class Load(ABC):
    """What acts on a body: a frozen dataclass that says how it acts, scales, turns, is drawn and is worded.

    Subclass DeadLoad or FollowingLoad, and add a line to LOADS to make it a key of `[[load]]`.

    Attributes:
        on: the selection that it acts on, None where it acts on the whole body.
        follows: whether its forces change with the positions of the nodes.
        instead: what to use where a program has no load that follows the body, for error messages.
    """

    on: Selection | None
    follows: ClassVar[bool]
    instead: ClassVar[str] = ""

    def spread(self, body: Body) -> Spread | None:
        """Return a dead load over the cells of `body` that carry it, None for a load that follows the body."""
        return None

    def following(self, body: Body, held: Bools) -> Potential | None:
        """Return a load that follows the body as a potential, minus its work; None for a dead load.

        `held` is true where a displacement of `body` is prescribed, shape (n_nodes, dim). Raises ProblemError where the
        work of the load depends on the path.
        """
        return None

    def rim(self, mesh: Mesh) -> Ints:
        """Return the edges around the surface that a load in space needs held, by their ends, shape (n, 2)."""
        return np.zeros((0, 2), dtype=np.int64)

    @abstractmethod
    def scaled(self, factor: float) -> Self:
        """Return the load times a factor."""

    @abstractmethod
    def turned(self, rotation: Floats) -> Self:
        """Return the load as it acts on a body turned by a rotation matrix, shape (dim, dim), on the same selection."""

    @property
    def vector(self) -> Floats | None:
        """The vector that `turned` turns, shape (dim,); None for a load without one, which turns with the body."""
        return None

    def moved_to(self, on: Selection) -> Self:
        """Return the load on another selection, such as a group that another mesh has too."""
        changed: Any = replace(self, on=on)  # type: ignore[type-var]  # subclasses are dataclasses
        return changed  # type: ignore[no-any-return]

    @abstractmethod
    def mark(self, body: Body, held: Bools) -> Mark:
        """Return the arrow that shows the load on the undeformed `body`, held where `held` is true."""

    @abstractmethod
    def words(self) -> str:
        """Return the load in words without a full stop: "force (0, -0.043) N in total on 'right'"."""

    def cards(self, mesh: Mesh) -> tuple[Card, ...]:
        """Return the load as other finite element programs know it; none where it comes as forces on nodes."""
        return ()


class DeadLoad(Load):
    """A load that keeps its size and direction as the body deforms."""

    follows = False

    @abstractmethod
    def spread(self, body: Body) -> Spread:
        """Return the load over the cells of `body` that carry it."""


class FollowingLoad(Load):
    """A load whose forces change as the body deforms, and that has a potential; it defines `instead`."""

    follows = True

    @abstractmethod
    def following(self, body: Body, held: Bools) -> Potential:
        """Return the potential on `body`; raise ProblemError where the work of the load depends on the path."""

    def turned(self, rotation: Floats) -> Self:
        """Return the load itself: it turns with the body."""
        return self
