"""The entries of LAWS: constants, response and declared properties of a constitutive law."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from truespring.arrays import Floats
from truespring.material import Lame
from truespring.units import SI_UNITS, Dimension

if TYPE_CHECKING:
    from truespring.models.invariants import InvariantLaw


def _none() -> Mapping[str, Any]:
    return MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant of a law: an optional key of `[material]` and `[[region]]`.

    Attributes:
        dimension: a key of SI_UNITS; None for a dimensionless number.
        meaning: description of the key, in a few words.
        example: an allowed value [SI], used by the contract tests.
        default: value for materials without the constant [SI]; None if the law requires it.
        smallest, largest: allowed range, both included [SI].
    """

    dimension: Dimension | None
    meaning: str
    example: float
    default: float | None = None
    smallest: float = -np.inf
    largest: float = np.inf

    @property
    def unit(self) -> str:
        """The SI unit, "-" for a dimensionless number."""
        return "-" if self.dimension is None else SI_UNITS[self.dimension][0]


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
        if np.ndim(self.lam) == 0:
            return self
        values = {name: np.ravel(value) for name, value in self.values.items()}
        return Constants(np.ravel(self.lam), np.ravel(self.mu), self.plane_stress, values)

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
        stress: second Piola-Kirchhoff stress [Pa], axes (component, ...); the stress, for the linear law.
        elasticity: returns the derivative of the stress with respect to the Green strain [Pa], axes (component,
            component, ...). It is a function because it is expensive and not needed for energy and forces. A shear
            component stands for both e_xy and e_yx.
        thickness_stretch: length of the third direction over its undeformed length, axes (...); 1 in plane strain
            and in 3D.
        across: Kirchhoff stress of the third direction [Pa], axes (...), zero in plane stress; the stress, for the
            linear law.
    """

    energy: Floats
    stress: Floats
    elasticity: Callable[[], Floats]
    thickness_stretch: Floats
    across: Floats


@dataclass(frozen=True, slots=True)
class Law:
    """An entry of LAWS. The contract tests (`tests/test_laws.py`) check all its attributes.

    Attributes:
        respond: returns the response to a strain in Voigt's order, axes (component, ...), and constants. The strain
            is the right Cauchy-Green tensor C = F^T F if the law is finite, else the small strain (F + F^T) / 2 - I.
        density: returns the energy density [J/m^3] of the three principal stretches, shape (3,), real or complex, and
            the constants. Take the formula from the source, not from `respond`: the tests compare the two.
        label: name in tables and legends.
        source: publication that defines the law.
        finite: whether the law is frame invariant.
        barrier: whether the energy of an inverted element is infinite; C alone does not show the inversion.
        quadratic: whether the energy is quadratic in the strain of `trace`, so that the elasticity is constant.
        trace: the strain e for which the part of lam in the energy is lam/2 (tr e)^2, in 3D and plane strain: "small",
            "green", or "logarithmic", whose trace is ln J; None if the energy has another form. Required by elements
            of second order with mean dilatation.
        volumetric: the modulus in that part: "lam", or "bulk" for a law with separate energies of shape and volume.
        invariants: the law as a function of I1 and ln J, which Gaussian springs require; None if it is no such
            function.
        constant_springs: whether `invariants` is linear in I1 with a factor that does not depend on ln J, so that the
            springs of `rule = "gaussian"` have a constant stiffness.
        domain: smallest and largest stretch of a bar between which its force increases with its length; beyond them a
            bar under a dead load snaps.
        constants: the constants by name, without lam and mu.
        lame: returns the Lamé constants [Pa] at small strain from the values of `constants` by name; None if they are
            those of the material for any values. A material with other young and poisson is an error.
    """

    respond: Callable[[Floats, Constants], Response]
    density: Callable[[Any, Constants], Any]
    label: str
    source: str
    finite: bool
    barrier: bool
    quadratic: bool
    trace: Literal["small", "green", "logarithmic"] | None
    volumetric: Literal["lam", "bulk"] = "lam"
    invariants: "InvariantLaw | None" = None
    constant_springs: bool = False
    domain: tuple[float, float] = (0.0, np.inf)
    constants: Mapping[str, Constant] = field(default_factory=_none)
    lame: Callable[[Mapping[str, float]], Lame] | None = None
