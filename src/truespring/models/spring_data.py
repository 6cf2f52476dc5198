"""Springs as other programs take them: what a potential of springs hands to the targets of export."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    from truespring.models.network import SpringNetwork

#: What springs may have beside springs: a modulus on each element's area or volume, or coupled lengths.
VOLUME_TERM, COUPLING = "volume term", "coupling"


@dataclass(frozen=True, eq=False)
class SpringData:
    """The springs of a potential.

    Attributes:
        network: the springs alone, without what `beyond` names; None where they do not exist without it.
        arrays: all numbers by name, in SI units, with springs of shape (n_springs, 2); see docs/export/arrays.md.
        beyond: VOLUME_TERM or COUPLING; empty for plain springs.
    """

    network: "SpringNetwork | None"
    arrays: Mapping[str, Any]
    beyond: str = ""


@runtime_checkable
class HasSprings(Protocol):
    """A potential that can be exported as springs."""

    def spring_data(self) -> SpringData:
        """Return its springs."""
        ...
