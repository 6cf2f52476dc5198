"""Springs as other programs take them: what a potential of springs hands to the targets of export."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from truespring.arrays import Floats, Ints
from truespring.potential import Potential

#: What springs may have beside springs: a modulus on each element's area or volume, or coupled lengths.
VOLUME_TERM, COUPLING = "volume term", "coupling"


class PlainSprings(Potential, Protocol):
    """Springs and nothing else, as a SpringNetwork is."""

    @property
    def springs(self) -> Ints:
        """The two nodes of each spring, shape (n_springs, 2)."""
        ...

    @property
    def stiffness(self) -> Floats:
        """Stiffness of each spring [N/m], shape (n_springs,)."""
        ...

    @property
    def rest_length(self) -> Floats:
        """Rest length of each spring [m], shape (n_springs,)."""
        ...

    def stretch(self, positions: Floats) -> Floats:
        """Return length over rest length of each spring, shape (n_springs,)."""
        ...

    def spring_data(self) -> "SpringData":
        """Return the springs as arrays."""
        ...


@dataclass(frozen=True, eq=False)
class SpringData:
    """The springs of a potential.

    Attributes:
        network: the springs alone, without what `beyond` names; None where they do not exist without it.
        arrays: all numbers by name, in SI units, with springs of shape (n_springs, 2); see docs/export/arrays.md.
        beyond: VOLUME_TERM or COUPLING; empty for plain springs.
    """

    network: PlainSprings | None
    arrays: Mapping[str, Any]
    beyond: str = ""


@runtime_checkable
class HasSprings(Protocol):
    """A potential that can be exported as springs."""

    def spring_data(self) -> SpringData:
        """Return its springs."""
        ...
