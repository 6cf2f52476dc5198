"""What is asked of springs by rule before they are solved: their stiffness by element, for moduli and warnings."""

from typing import Protocol

from truespring.arrays import Floats
from truespring.potential import Potential
from truespring.problem import Problem


class SpringsByRule(Protocol):
    """Springs whose stiffness follows from the material, element by element: `Springs`, and what is like them."""

    @property
    def rule(self) -> str | None:
        """The rule, a key of RULES; None for a stiffness of the user's own."""
        ...

    @property
    def sharing(self) -> str:
        """Return "summed" or "single": whether elements that share a pair of nodes add their springs."""
        ...

    @property
    def volume(self) -> bool:
        """Whether there is an area or volume term."""
        ...

    @property
    def coupled(self) -> bool:
        """Whether the springs of an element are coupled, as those of the rule biquadratic."""
        ...

    def element_stiffness(self, problem: Problem) -> Floats:
        """Return the stiffness of each element's springs [N/m], shape (n_elements, links)."""
        ...

    def kappa(self, problem: Problem) -> Floats:
        """Return the modulus of the area or volume term of each element [Pa], shape (n_elements,)."""
        ...

    def allowing_negative(self) -> "SpringsByRule":
        """Return the same springs, those of negative stiffness allowed."""
        ...

    def potential(self, problem: Problem) -> Potential:
        """Return the potential on the problem's mesh."""
        ...
