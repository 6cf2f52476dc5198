"""The springs of a potential as arrays, for export to other programs."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from truespring.arrays import Floats, Ints
from truespring.models.pair_law import PairLaw
from truespring.potential import Potential

#: Features beyond plain springs: a modulus for the area or volume of each element, a coupling of lengths, or a pressure
#: in each element that keeps springs of zero rest length apart.
VOLUME_TERM, COUPLING, PRESSURE = "volume term", "coupling", "pressure in each element"


class PlainSprings(Potential, Protocol):
    """A potential of plain springs, such as SpringNetwork."""

    @property
    def springs(self) -> Ints:
        """Node numbers of each spring, shape (n_springs, 2)."""
        ...

    @property
    def stiffness(self) -> Floats:
        """Stiffness of each spring [N/m], shape (n_springs,)."""
        ...

    @property
    def rest_length(self) -> Floats:
        """Rest length of each spring [m], shape (n_springs,)."""
        ...

    @property
    def law(self) -> str:
        """Name of the force law, a key of PAIR_LAWS."""
        ...

    @property
    def pair_law(self) -> PairLaw:
        """The force law of the springs."""
        ...

    def stretch(self, positions: Floats) -> Floats:
        """Return length over rest length of each spring [-], shape (n_springs,)."""
        ...

    def spring_data(self) -> "SpringData":
        """Return the springs as arrays."""
        ...


@dataclass(frozen=True, eq=False)
class SpringData:
    """The springs of a potential.

    Attributes:
        network: the plain springs, without the feature `beyond`; None if they are not defined without it.
        arrays: all arrays by name [SI], with springs of shape (n_springs, 2); see docs/export/arrays.md.
        beyond: VOLUME_TERM, COUPLING or PRESSURE; empty for plain springs.
    """

    network: PlainSprings | None
    arrays: Mapping[str, Any]
    beyond: str = ""


@runtime_checkable
class HasSprings(Protocol):
    """A potential that can be exported as springs."""

    def spring_data(self) -> SpringData:
        """Return the springs as arrays."""
        ...
