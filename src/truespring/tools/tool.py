"""Base class of tools: rigid bodies that move along a path and touch the surface of a body."""

from abc import ABC, abstractmethod

from truespring.conditions import Interaction
from truespring.loading import Body


class Tool(ABC):
    """A rigid body that moves along a path, a frozen dataclass; add subclasses to TOOLS to make them shapes.

    Attributes:
        name: name in tables.
    """

    name: str

    @abstractmethod
    def acting_on(self, body: Body, young: float | None, span: float) -> Interaction:
        """Return the contact of the tool with a body.

        Args:
            body: the body.
            young: largest Young's modulus of the body [Pa], for the default stiffness of the contact; None if unknown.
            span: place on the path at level 1: 1 at rest, the duration in motion [s].
        """
