"""Dashpots of a material: Kelvin-Voigt damping in the strain of the elements, the same for all models.

The viscous stress is S = tau D : dE/dt with the elasticity D of the undeformed material and the Green strain E, so that
rigid motions are not damped, and momentum and angular momentum are kept. Over a step it is the St. Venant-Kirchhoff law
with stiffness tau / b about the strain at the begin of the step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from truespring.arrays import Floats
from truespring.models.constants import Constants
from truespring.models.fem_potential import FemPotential, filled_up, require_continuum
from truespring.models.gauss_points import Points
from truespring.models.laws import LAWS, law_constants
from truespring.models.quadratic import QuadraticPotential
from truespring.models.symmetric import identity
from truespring.potential import Damper, Potential
from truespring.problem import Problem

# Largest lam of the dashpots over mu: stiffer ones would lock elements of a nearly incompressible material.
_LARGEST_LAM = 2.0


@dataclass(frozen=True, eq=False)
class _Relaxed(FemPotential):
    """Elements that are free of stress at given strains.

    Attributes:
        strain: the right Cauchy-Green tensor without stress [-], axes (component, point, element).
    """

    strain: Floats | None = None

    def _points(self, positions: Floats, first: int, last: int) -> Points:
        """Return the Gauss points of a slice of the elements, with the change of strain in place of the strain."""
        at = super()._points(positions, first, last)
        if self.strain is None:
            return at
        change = at.strain - self.strain[..., filled_up(first, last)]
        return replace(at, strain=change + identity(change) if self.law.finite else change)


class _RelaxedQuadratic(_Relaxed, QuadraticPotential):
    """Elements of second order that are free of stress at given strains."""


class Dashpots:
    """The dashpots of the elements of a body.

    Attributes:
        parts: the elements by kind, with the elasticity of the undeformed material.
    """

    def __init__(self, problem: Problem, quadratic: bool = False, law: str = "saint-venant-kirchhoff") -> None:
        """Build the elements, with mid-edge nodes if `quadratic`; raise ModelError without material or elements."""
        require_continuum(problem)
        kind = _RelaxedQuadratic if quadratic else _Relaxed
        self._parts: tuple[_Relaxed, ...] = tuple(
            kind(part, LAWS[law], _limited(law_constants(part, law))) for _, part in problem.blocks
        )

    def measure(self, positions: Floats) -> Sequence[Floats]:
        """Return the strains at positions [m], shape (n_nodes, dim), for each kind of elements."""
        return [part._everywhere(positions, lambda at, _: at.strain) for part in self._parts]

    def since(self, strains: Sequence[Floats], time: float) -> "tuple[Potential, ...]":
        """Return the dashpots as potentials: springs of stiffness `time` [-] relaxed at `strains`."""
        return tuple(_relaxed(part, strain, time) for part, strain in zip(self._parts, strains, strict=True))


def _relaxed(part: _Relaxed, strain: Floats, time: float) -> _Relaxed:
    """Return elements with the elasticity of others times `time` [-], relaxed at a strain; they share the sparsity."""
    _ = part._pattern
    found = replace(part, strain=strain, constants=_times(part.constants, time))
    for name, value in vars(part).items():
        vars(found).setdefault(name, value)
    return found


def _limited(constants: Constants) -> Constants:
    lam = np.minimum(constants.lam, _LARGEST_LAM * np.asarray(constants.mu))
    return replace(constants, lam=lam if np.ndim(constants.lam) else float(lam))


def _times(constants: Constants, factor: float) -> Constants:
    return replace(constants, lam=factor * constants.lam, mu=factor * constants.mu)


def damper_of(problem: Problem, potential: Potential, finite: bool) -> Damper:
    """Return the dashpots of a body: of a network beside its springs, else of the material in the elements.

    Raises ModelError if a body has neither.
    """
    if isinstance(potential, Damper):
        return potential
    law = "saint-venant-kirchhoff" if finite else "linear"
    return Dashpots(problem, isinstance(potential, QuadraticPotential), law)
