"""Protocol of springs by rule, for effective moduli and findings."""

from typing import NamedTuple, Protocol

from truespring.arrays import Floats
from truespring.potential import Potential
from truespring.problem import Problem


class SpringCounts(NamedTuple):
    """Number of springs of a mesh, and of springs with negative and with zero stiffness."""

    n_springs: int
    n_negative: int
    n_zero: int


class SpringsByRule(Protocol):
    """Springs whose stiffness is determined element by element from the material, such as `Springs`."""

    @property
    def rule(self) -> str | None:
        """The rule, a key of RULES; None for user-defined stiffness."""
        ...

    @property
    def sharing(self) -> str:
        """Stiffness of a spring that several elements share: "summed" or "single"."""
        ...

    @property
    def volume(self) -> bool:
        """Whether there is an area or volume term."""
        ...

    @property
    def coupled(self) -> bool:
        """Whether the force of a spring depends on other nodes of its element, so that the moduli are exact."""
        ...

    @property
    def locks_on(self) -> tuple[str, ...]:
        """Kinds of elements on which the springs lock near Poisson's ratio 1/2."""
        ...

    @property
    def remark(self) -> str:
        """A sentence on cost and law of coupled springs, without a full stop."""
        ...

    def counts(self, problem: Problem) -> SpringCounts:
        """Return the numbers of springs on the problem's mesh."""
        ...

    def element_stiffness(self, problem: Problem) -> Floats:
        """Return the stiffness of each element's links [N/m], shape (n_elements, links)."""
        ...

    def kappa(self, problem: Problem) -> Floats:
        """Return the modulus of the area or volume term of each element [Pa], shape (n_elements,)."""
        ...

    def allowing_negative(self) -> "SpringsByRule":
        """Return a copy that allows negative stiffness."""
        ...

    def potential(self, problem: Problem) -> Potential:
        """Return the potential on the problem's mesh."""
        ...
