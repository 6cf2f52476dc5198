"""Base class of tools: rigid bodies that move along a path and touch the surface of a body."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from truespring.arrays import Floats
from truespring.conditions import Interaction
from truespring.errors import ToolError, TruespringError, nearest
from truespring.loading import Body, vector_words
from truespring.mesh import Selection
from truespring.tools.contact import Contact
from truespring.tools.during import during_words, interval, limited
from truespring.tools.laws import CONTACTS, Law
from truespring.tools.path import Path, path_words, track_of
from truespring.tools.skins import Skin
from truespring.tools.surface import surface, within
from truespring.tools.values import positive

# Default stiffness of contact over Young's modulus per length, default width of a barrier over the length: that of the
# diagonal of the body's bounding box. A pressure of a tenth of Young's modulus enters by 1e-4 of that length.
_STIFFNESS, _WIDTH = 1000.0, 1e-3
# Depth over the size of the body that is a rounding error.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Touching:
    """How a tool touches a body.

    Attributes:
        contact: "penalty": nodes enter the tool by pressure / stiffness; "barrier": they stay outside, and it begins to
            push at the distance `width`.
        stiffness: pressure per depth [Pa/m]; None for 1000 E / L, E the largest Young's modulus of the body, L the
            diagonal of its bounding box.
        width: width of a barrier [m]; None for L / 1000.
        friction: coefficient of Coulomb friction [-].
        on: selection of the facets that the tool may touch; None for the whole boundary.
        during: begin and end of the part of the way in which the tool is there, shares at rest, times in motion [s];
            None for the whole way. It may begin inside of the body.
    """

    contact: str = field(default="penalty", kw_only=True)
    stiffness: float | None = field(default=None, kw_only=True)
    width: float | None = field(default=None, kw_only=True)
    friction: float = field(default=0.0, kw_only=True)
    on: Selection | None = field(default=None, kw_only=True)
    during: Sequence[float] | None = field(default=None, kw_only=True)


class Tool(Touching, ABC):
    """A rigid body that moves along a path without turning, a frozen dataclass.

    Subclasses define their dimensions, `gaps`, `bends`, `check` and `form`; add them to TOOLS to make them shapes of
    studies. Contact is that of the nodes of the body's surface: a tool far smaller than the facets passes between them.

    Attributes:
        name: name in tables.
        path: rows of place on the way and coordinates [m], see Path; or the coordinates of a tool that does not move.
    """

    name: str
    path: Path

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Smallest and largest coordinates relative to the place [m], see `Shape.bounds`; by default infinite."""
        return np.array(-np.inf), np.array(np.inf)

    @abstractmethod
    def gaps(self, places: Floats) -> tuple[Floats, Floats]:
        """Return gaps and normals at places relative to that of the tool, see `Shape.gaps`."""

    @abstractmethod
    def bends(self, places: Floats) -> Floats:
        """Return the second derivatives of the gaps, see `Shape.bends`."""

    def points(self, dim: int) -> Floats:
        """Return some points inside the tool, relative to the place [m], shape (n, dim): none may start in the body.

        By default none: nodes that start inside the tool are an error anyway.
        """
        return np.zeros((0, dim))

    @abstractmethod
    def check(self, dim: int) -> None:
        """Raise ToolError if the dimensions of the tool do not fit a body of `dim` directions."""

    @abstractmethod
    def form(self) -> str:
        """Return shape and dimensions: "sphere of radius 0.01 m"."""

    def skin(self, centre: Floats, size: float) -> Skin | None:
        """Return the surface for pictures, relative to the place of the tool; None if it is not drawn.

        Args:
            centre: centre of the picture relative to the place of the tool [m], shape (dim,).
            size: size of the picture [m], to which an unbounded tool is cut.
        """
        return None

    def words(self) -> str:
        """Return name, form and path, for tables."""
        rubbing = f", friction {self.friction:g}" if self.friction else ""
        return f"'{self.name}': {self.form()}{rubbing}, {path_words(self.path)}{during_words(self.during)}"

    def moved_to(self, on: Selection) -> Self:
        """Return the tool on another selection of facets, such as a group of another mesh."""
        changed: Any = replace(self, on=on)
        return changed  # type: ignore[no-any-return]

    def acting_on(self, body: Body, young: float | None, span: float) -> Interaction:
        """Return the contact of the tool with a body.

        Args:
            body: the body.
            young: largest Young's modulus of the body [Pa], for the default stiffness of the contact; None if unknown.
            span: place on the path at level 1: 1 at rest, the duration in motion [s].

        Raises ToolError if the tool does not fit the body, or starts inside it.
        """
        self.check(body.mesh.dim)
        during = interval(self.name, self.during, span)
        track = track_of(self.name, self.path, body.mesh.dim, span, during)
        size = float(np.linalg.norm(np.ptp(body.nodes, axis=0)))
        law = self._law(young, size)
        friction = positive(self.name, "friction", self.friction, "-", zero=True)
        try:
            nodes, areas = surface(body, self.on)
        except TruespringError as error:
            raise ToolError(self.name, str(error), "on" if self.on is not None else "") from None
        found = Contact(self.name, self, track, law, nodes, areas, len(body.nodes), friction)
        if during is not None:
            return limited(found, during, span)
        self._check_start(found, body.nodes, size)
        if within(body.mesh, track.at(0.0) + self.points(body.mesh.dim)).any():
            raise ToolError(self.name, "starts inside the body, between its nodes: begin the path outside", "path")
        return found

    def _law(self, young: float | None, size: float) -> Law:
        """Return the law of contact for a body of a size [m]."""
        if self.contact not in CONTACTS:
            allowed = ", ".join(CONTACTS)
            text = f"'{self.contact}' is unknown{nearest(str(self.contact), CONTACTS)}; allowed: {allowed}"
            raise ToolError(self.name, text, "contact")
        if self.stiffness is None and young is None:
            raise ToolError(self.name, "is required for a body without a material [Pa/m]", "stiffness")
        stiffness = _STIFFNESS * (young or 0.0) / size if self.stiffness is None else self.stiffness
        width = _WIDTH * size if self.width is None else self.width
        values = (("stiffness", stiffness, "Pa/m"), ("width", width, "m"))
        return CONTACTS[self.contact](*(positive(self.name, *one) for one in values))

    def _check_start(self, contact: Contact, nodes: Floats, size: float) -> None:
        """Raise ToolError if the tool starts inside a body of a size [m]; `nodes` [m], shape (n_nodes, dim)."""
        near, slack = contact.near(nodes, 0.0), _ROUNDING * size
        gap = float(near.gaps.min(initial=np.inf))
        if gap >= slack or (gap > -slack and not contact.law.clearance > 0):
            return
        deepest = int(near.gaps.argmin())
        node, out = int(contact.nodes[near.rows[deepest]]), -near.normals[deepest]
        if gap > -slack:
            says, further = "touches the body, and a barrier starts outside", contact.law.reach
        else:
            says, further = f"starts inside the body by {-gap:.4g} m", -gap
        way_out = vector_words(contact.track.at(0.0) + further * out, 4)
        raise ToolError(
            self.name,
            f"{says}, at node {node} at {vector_words(nodes[node])} m: begin the path further out, such as at "
            f"{way_out} m",
            "path",
        )
