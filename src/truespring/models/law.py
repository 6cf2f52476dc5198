"""What an entry of LAWS is made of: its constants, its response, and the facts that it declares."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from truespring.arrays import Floats
from truespring.material import Lame
from truespring.units import SI_UNITS, Dimension


def _none() -> Mapping[str, Any]:
    return MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant of one law, which becomes an optional key of `[material]` and `[[region]]`.

    Attributes:
        dimension: a key of SI_UNITS, which gives the unit; None for a pure number.
        meaning: what it is, in a few words: the description of the key.
        example: an admissible value [SI], with which the contract tests run.
        default: the value where a material has none [SI]; None makes it required by the law.
        smallest, largest: the admissible values, both included [SI].
    """

    dimension: Dimension | None
    meaning: str
    example: float
    default: float | None = None
    smallest: float = -np.inf
    largest: float = np.inf

    @property
    def unit(self) -> str:
        """The SI unit, "-" for a pure number."""
        return "-" if self.dimension is None else SI_UNITS[self.dimension][0]


@dataclass(frozen=True, slots=True)
class Constants:
    """Values of the constants with which a law responds.

    The constants are numbers, or arrays of shape (n_elements, 1) where materials differ.

    Attributes:
        lam, mu: Lamé constants of the material [Pa], from its young and poisson.
        plane_stress: whether the third direction is free of stress.
        values: the law's other constants by name [SI]; `constants["c1"]` reads one.
    """

    lam: float | Floats
    mu: float | Floats
    plane_stress: bool
    values: Mapping[str, float | Floats] = field(default_factory=_none)

    def __getitem__(self, name: str) -> float | Floats:
        """Return a constant other than lam and mu by its name [SI]."""
        return self.values[name]

    @property
    def lam_plane(self) -> float | Floats:
        """The first Lamé constant within the plane [Pa]: 2 lam mu / (lam + 2 mu) in plane stress, lam otherwise.

        With it a law that is quadratic in its strain accounts for the third direction.
        """
        return 2 * self.lam * self.mu / (self.lam + 2 * self.mu) if self.plane_stress else self.lam

    def part(self, first: int, last: int) -> "Constants":
        """Return the constants of the elements from `first` to before `last`."""
        if np.ndim(self.lam) == 0:
            return self
        values = {name: np.asarray(value)[first:last] for name, value in self.values.items()}
        return Constants(np.asarray(self.lam)[first:last], np.asarray(self.mu)[first:last], self.plane_stress, values)


@dataclass(frozen=True, slots=True)
class Response:
    """The response of a law to a strain.

    Attributes:
        energy: per undeformed volume [J/m^3], axes (...); infinite outside the law's domain.
        stress: second Piola-Kirchhoff stress [Pa], axes (component, ...); of the linear law, the stress.
        elasticity: returns the derivative of the stress by the Green strain [Pa], axes (component, component, ...). It
            is a function because it costs most and is not needed for energy and forces. A component of the strain
            stands for both of its mirror images, so that a change of e.g. e_xy counts twice.
        thickness_stretch: length of the third direction over its undeformed length, axes (...); 1 where it is held
            and in 3D.
        across: Kirchhoff stress of the third direction [Pa], axes (...), zero in plane stress; of the linear law, the
            stress.
    """

    energy: Floats
    stress: Floats
    elasticity: Callable[[], Floats]
    thickness_stretch: Floats
    across: Floats


@dataclass(frozen=True, slots=True)
class Law:
    """An entry of LAWS. All its statements are checked by the contract tests (`tests/test_laws.py`).

    Attributes:
        respond: takes a strain in Voigt's order, axes (component, ...), and the constants: of a finite law the right
            Cauchy-Green tensor C = F^T F, of others the small strain (F + F^T) / 2 - I.
        density: the energy density [J/m^3] as a formula of the three principal stretches, shape (3,), real or complex,
            and of the constants, taken from the source and not from `respond`, which the tests hold against it.
        label: the name in tables and legends.
        source: where the law is defined.
        finite: whether it is frame invariant.
        barrier: whether the energy is infinite where an element is inverted, which C alone does not show.
        quadratic: whether the energy is quadratic in the strain of `trace`, so that the elasticity is constant.
        trace: the strain e of whose trace lambda's part of the energy is lam/2 (tr e)^2, in 3D and plane strain:
            "small", "green", or "logarithmic", whose trace is ln J; None where lambda's part is another.
            Elements of mean dilatation of second order are for laws that have one.
        domain: the stretches of a bar within which its force rises with its length, from and to: beyond them a bar
            under a dead load snaps.
        constants: the constants that it takes besides lam and mu, by name.
        lame: Lamé constants [Pa] at small strain by those constants, by name; None where they are those of the
            material whatever the constants. Where the material's young and poisson disagree with them, the law is
            an error for that material.
    """

    respond: Callable[[Floats, Constants], Response]
    density: Callable[[Any, Constants], Any]
    label: str
    source: str
    finite: bool
    barrier: bool
    quadratic: bool
    trace: Literal["small", "green", "logarithmic"] | None
    domain: tuple[float, float] = (0.0, np.inf)
    constants: Mapping[str, Constant] = field(default_factory=_none)
    lame: Callable[[Mapping[str, float]], Lame] | None = None
