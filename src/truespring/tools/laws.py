"""Laws of contact: energy per area over the gap between a node and a tool."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol

import numpy as np

from truespring.arrays import Floats

# Below this share of its width a barrier is evaluated there: it is infinite at zero, and solvers need finite forces.
_SMALLEST = 1e-6
# Share of its width to which a barrier moves nodes that are nearer.
_CLEAR = 0.5


class Law(Protocol):
    """Energy per area of a surface [J/m^2] at a gap [m], negative inside the tool; arrays have shape (n,)."""

    @property
    def reach(self) -> float:
        """The gap below which the law acts [m]."""
        ...

    @property
    def clearance(self) -> float:
        """The gap to which nodes are moved before a solver starts [m]; minus infinity if any gap is allowed."""
        ...

    @property
    def largest(self) -> float:
        """The largest second derivative [N/m^3]; infinite without a bound."""
        ...

    def energy(self, gap: Floats) -> Floats:
        """Return the energy [J/m^2]; infinite where the gap is not allowed."""
        ...

    def slope(self, gap: Floats) -> Floats:
        """Return the first derivative [N/m^2], minus the pressure; finite."""
        ...

    def bend(self, gap: Floats) -> Floats:
        """Return the second derivative [N/m^3], not negative; finite."""
        ...


@dataclass(frozen=True)
class Penalty:
    """k/2 min(g, 0)^2: nodes enter the tool by pressure / k.

    Attributes:
        stiffness: k [N/m^3].
    """

    stiffness: float
    reach = 0.0
    clearance = -np.inf

    @property
    def largest(self) -> float:
        """The stiffness."""
        return self.stiffness

    def energy(self, gap: Floats) -> Floats:
        """Return the energy [J/m^2]."""
        return np.asarray(self.stiffness / 2 * np.minimum(gap, 0.0) ** 2)

    def slope(self, gap: Floats) -> Floats:
        """Return the first derivative [N/m^2]."""
        return self.stiffness * np.minimum(gap, 0.0)

    def bend(self, gap: Floats) -> Floats:
        """Return the second derivative [N/m^3]."""
        return np.asarray(self.stiffness * (gap < 0))


@dataclass(frozen=True)
class Barrier:
    """-k (g - w)^2 ln(g / w) below the width w, infinite for g <= 0 (Li et al., Incremental Potential Contact, 2020).

    At half of the width its pressure is 1.19 k w, about that of a penalty k at a depth w.

    Attributes:
        stiffness: k [N/m^3].
        width: w [m].
    """

    stiffness: float
    width: float
    largest = np.inf

    @property
    def reach(self) -> float:
        """The width."""
        return self.width

    @property
    def clearance(self) -> float:
        """A share of the width."""
        return _CLEAR * self.width

    def energy(self, gap: Floats) -> Floats:
        """Return the energy [J/m^2]."""
        s = self._share(gap)
        inside = self.stiffness * self.width**2 * -((s - 1) ** 2) * np.log(s)
        return np.where(gap > 0, inside, np.inf)

    def slope(self, gap: Floats) -> Floats:
        """Return the first derivative [N/m^2]."""
        s = self._share(gap)
        return np.asarray(-self.stiffness * self.width * (2 * (s - 1) * np.log(s) + (s - 1) ** 2 / s))

    def bend(self, gap: Floats) -> Floats:
        """Return the second derivative [N/m^3]."""
        s = self._share(gap)
        return np.asarray(-self.stiffness * (2 * np.log(s) + 4 * (s - 1) / s - ((s - 1) / s) ** 2))

    def _share(self, gap: Floats) -> Floats:
        """Return the gap over the width [-], above zero and at most 1, where all derivatives vanish."""
        return np.clip(gap / self.width, _SMALLEST, 1.0)


#: The laws by the value of `contact`, each made from a stiffness [N/m^3] and a width [m].
CONTACTS: Mapping[str, Callable[[float, float], Law]] = MappingProxyType(
    {"penalty": lambda stiffness, width: Penalty(stiffness), "barrier": Barrier}
)
