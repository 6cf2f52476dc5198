"""The entries of LAWS: response, energy density, constants and declared properties of a constitutive law."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from truespring.arrays import Floats
from truespring.material import Lame
from truespring.models.constants import Constant as Constant
from truespring.models.constants import Constants as Constants
from truespring.models.constants import Response as Response
from truespring.models.invariants import InvariantLaw

#: Axes that a stress and a strain refer to. "small": the stress, and the small strain. "reference": the second
#: Piola-Kirchhoff stress, and C = F^T F. "current": the Kirchhoff stress, and b = F F^T.
Frame = Literal["small", "reference", "current"]
FRAMES: tuple[Frame, ...] = ("small", "reference", "current")


def _none() -> Mapping[str, Any]:
    return MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Law:
    """An entry of LAWS. The contract tests (`tests/test_laws.py`) check all its attributes.

    Attributes:
        respond: returns the response to a strain in Voigt's order, axes (component, ...), and constants. The strain
            is the right Cauchy-Green tensor C = F^T F if the law is finite, else the small strain (F + F^T) / 2 - I.
        current: returns the same response in current axes, from b = F F^T and constants, if the law has it: forces and
            matrices of elements are computed from it in less time.
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
        invariants: the law as a function of I1 and ln J, which Gaussian springs require; None if it is no such
            function.
        constant_springs: whether `invariants` is linear in I1 with a factor that does not depend on ln J, so that the
            springs of `rule = "gaussian"` have a constant stiffness.
        domain: smallest and largest stretch of a bar between which its force increases with its length; beyond them a
            bar under a dead load snaps. Those of a nearly incompressible material, with constants as in the
            examples: otherwise, a part bulk/2 (ln J)^2 softens at very large stretch.
        limit: a sentence on a deformation that the law does not reach, because its energy is infinite there, without
            a full stop; "" if there is none.
        constants: the constants by name, without lam and mu.
        lame: returns the Lamé constants [Pa] at small strain from the values of `constants` by name; None if they are
            those of the material for any values. A material with other young and poisson is an error.
        fault: returns what is impossible in the values of `constants` by name for a material of the given Lamé
            constants, or ""; None if the range of each constant says it all.
    """

    respond: Callable[[Floats, Constants], Response]
    density: Callable[[Any, Constants], Any]
    label: str
    source: str
    finite: bool
    barrier: bool
    quadratic: bool
    trace: Literal["small", "green", "logarithmic"] | None
    current: Callable[[Floats, Constants], Response] | None = None
    invariants: InvariantLaw | None = None
    constant_springs: bool = False
    domain: tuple[float, float] = (0.0, np.inf)
    limit: str = ""
    constants: Mapping[str, Constant] = field(default_factory=_none)
    lame: Callable[[Mapping[str, float]], Lame] | None = None
    fault: Callable[[Lame, Mapping[str, float]], str] | None = None

    @property
    def frame(self) -> Frame:
        """The axes in which elements evaluate the law."""
        if not self.finite:
            return "small"
        return "reference" if self.current is None else "current"

    def in_frame(self, strain: Floats, constants: Constants) -> Response:
        """Return the response to the strain of `frame`."""
        return (self.current or self.respond)(strain, constants)
