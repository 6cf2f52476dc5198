"""Protocol of springs by rule, for effective moduli and findings."""

from typing import Protocol

from truespring.arrays import Floats
from truespring.potential import Potential
from truespring.problem import Problem


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
        """Whether the springs of an element are coupled, as by the rule biquadratic."""
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
