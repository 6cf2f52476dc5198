"""What a constitutive law takes and returns: its constants and the response to a strain."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.models.elasticity_parts import Elasticity
from truespring.units import SI_UNITS, Dimension


def _none() -> Mapping[str, Any]:
    return MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant of a law: an optional key of `[material]` and `[[region]]`.

    Attributes:
        dimension: a key of SI_UNITS; None for a dimensionless number.
        meaning: description of the key, in a few words.
        example: an allowed value [SI] for young = 3 Pa, used by the contract tests.
        default: value for materials without the constant [SI]; None if the law requires it.
        smallest, largest: allowed range [SI].
        exclusive: whether `smallest` itself is not allowed.
    """

    dimension: Dimension | None
    meaning: str
    example: float
    default: float | None = None
    smallest: float = -np.inf
    largest: float = np.inf
    exclusive: bool = False

    def allows(self, value: float) -> bool:
        """Return whether a value [SI] is in the allowed range."""
        return self.smallest <= value <= self.largest and not (self.exclusive and value == self.smallest)

    @property
    def range_words(self) -> str:
        """The allowed range in words: "a value from 0 to 1", or "a value above 0"."""
        if np.isinf(self.largest):
            return f"a value {'above' if self.exclusive else 'of at least'} {self.smallest:g}"
        return f"a value from {self.smallest:g} to {self.largest:g}{f', without {self.smallest:g}' * self.exclusive}"

    @property
    def unit(self) -> str:
        """The SI unit, "-" for a dimensionless number."""
        return "-" if self.dimension is None else SI_UNITS[self.dimension][0]

    @property
    def unit_after_value(self) -> str:
        """The SI unit after a space; empty for a dimensionless number."""
        return "" if self.dimension is None else f" {self.unit}"


@dataclass(frozen=True, slots=True)
class Constants:
    """Values of the constants of a law: numbers, or arrays of shape (n_elements, 1) for several materials.

    Attributes:
        lam, mu: Lamé constants of the material [Pa], from its young and poisson.
        plane_stress: whether the stress of the third direction is zero.
        values: the other constants of the law by name [SI]; `constants["c1"]` returns one.
    """

    lam: float | Floats
    mu: float | Floats
    plane_stress: bool
    values: Mapping[str, float | Floats] = field(default_factory=_none)

    def __getitem__(self, name: str) -> float | Floats:
        """Return a constant by name, not lam or mu [SI]."""
        return self.values[name]

    @property
    def lam_plane(self) -> float | Floats:
        """The first Lamé constant in the plane [Pa], shape as lam: 2 lam mu / (lam + 2 mu) in plane stress, else lam.

        A law that is quadratic in its strain accounts for the third direction by using it instead of lam.
        """
        return 2 * self.lam * self.mu / (self.lam + 2 * self.mu) if self.plane_stress else self.lam

    @property
    def raveled(self) -> "Constants":
        """The same constants, as arrays of shape (n_elements,) for several materials."""
        return self.of(slice(None))

    def of(self, numbers: Ints | slice) -> "Constants":
        """Return the constants of elements, as arrays of shape (n,) for several materials."""
        if np.ndim(self.lam) == 0:
            return self
        values = {name: np.ravel(value)[numbers] for name, value in self.values.items()}
        return Constants(np.ravel(self.lam)[numbers], np.ravel(self.mu)[numbers], self.plane_stress, values)

    @property
    def bulk(self) -> float | Floats:
        """The bulk modulus lam + 2/3 mu [Pa]."""
        return self.lam + 2 / 3 * self.mu

    def part(self, first: int, last: int) -> "Constants":
        """Return the constants of the elements `first` to `last` - 1."""
        if np.ndim(self.lam) == 0:
            return self
        values = {name: np.asarray(value)[first:last] for name, value in self.values.items()}
        return Constants(np.asarray(self.lam)[first:last], np.asarray(self.mu)[first:last], self.plane_stress, values)


@dataclass(frozen=True, slots=True)
class Response:
    """The response of a law to a strain.

    Attributes:
        energy: energy per undeformed volume [J/m^3], axes (...); infinite outside the domain of the law.
        stress: second Piola-Kirchhoff stress S, or F S F^T in current axes, the Kirchhoff stress [Pa], axes (component,
            ...); the stress, for the linear law.
        elasticity: returns the derivative D of S with respect to the Green strain, or in current axes D with each of
            its four directions multiplied by F [Pa]. It is a function because it is not needed for energy and forces.
        thickness_stretch: length of the third direction over its undeformed length, axes (...); 1 in plane strain
            and in 3D.
        across: Kirchhoff stress of the third direction [Pa], axes (...), zero in plane stress; the stress, for the
            linear law.
    """

    energy: Floats
    stress: Floats
    elasticity: Callable[[], Elasticity]
    thickness_stretch: Floats
    across: Floats
