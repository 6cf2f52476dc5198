"""A grasp: a patch of the surface that is held by springs to a place that moves."""

from abc import ABC, abstractmethod

from truespring.conditions import Interaction
from truespring.loading import Body


class Grasp(ABC):
    """A patch of a body that is held by springs to a place that moves.

    Attributes:
        name: name in tables.
    """

    name: str

    @abstractmethod
    def acting_on(self, body: Body, young: float | None, span: float) -> Interaction:
        """Return the springs of the grasp on a body; arguments as `Tool.acting_on`."""
