"""Elements of second order with mean dilatation, for nearly incompressible materials."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.models.fem_potential import Points, determinant
from truespring.models.law import Response
from truespring.models.quadratic import QuadraticPotential
from truespring.models.symmetric import contracted, identity, inverted, outer, swapped, trace


class _Volume(NamedTuple):
    """The part of lam in the energy: a function of the mean v of the trace of the strain, or of the volume ratio.

    Attributes:
        mean: v, axes (element, 1).
        energy: lam/2 v^2, or lam/2 (ln v)^2 of the volume ratio [J/m^3], axes (element, 1).
        pressure, stiffness: first and second derivative of `energy` with respect to v [Pa], axes (element, 1).
        slope: derivative of the trace or ratio at a point with respect to the strain, axes (component, element, point).
        second: returns the derivative of `slope`, axes (component, component, element, point).
        across: derivative of the trace or ratio with respect to the strain of the third direction.
    """

    mean: Floats
    energy: Floats
    pressure: Floats
    stiffness: Floats
    slope: Floats
    second: Callable[[], Floats]
    across: Floats


class QuadraticMeanPotential(QuadraticPotential):
    """Elements of second order with the part of lam at the mean of each element, the rest at every Gauss point.

    An element has one incompressibility constraint instead of one at every Gauss point, so that it does not lock near
    Poisson's ratio 1/2: selective integration (Malkus and Hughes, CMAME 15, 1978). With the volumetric part of mu at
    the mean, too, as with bulk/2 (ln J)^2, the element would be too soft in bending.
    """

    interpolation = "quadratic-mean-dilatation"

    def _volume(self, at: Points) -> _Volume:
        strain, lam = self._strain(at), at.constants.lam
        eye = np.broadcast_to(identity(strain), strain.shape)
        if self.law.trace != "logarithmic":
            own = trace(strain - eye) / 2 if self.law.finite else trace(strain)
            mean = _mean(own, at)
            flat = partial(np.zeros, (len(strain), *strain.shape))
            return _Volume(mean, lam / 2 * mean**2, lam * mean, lam + 0 * mean, eye, flat, np.ones_like(own))
        J = determinant(at.F)
        mean = _mean(J, at)
        valid = (J > 0) & (mean > 0)
        inverse = inverted(np.where(valid, strain, eye))
        log = np.log(np.where(mean > 0, mean, np.nan))
        return _Volume(
            mean,
            lam / 2 * log**2,
            lam * log / mean,
            lam * (1 - log) / mean**2,
            J * inverse,
            lambda: J * (outer(inverse, inverse) - swapped(inverse)),
            J,
        )

    def _law_response(self, at: Points) -> Response:
        shear = self.law.respond(self._strain(at), replace(at.constants, lam=0 * at.constants.lam))
        volume = self._volume(at)
        return Response(
            shear.energy + volume.energy,
            shear.stress + volume.pressure * volume.slope,
            lambda: shear.elasticity() + volume.pressure * volume.second(),
            shear.thickness_stretch,
            shear.across + volume.pressure * volume.across,
        )

    def _stress_change(self, at: Points, response: Response, change: Floats) -> Floats:
        volume = self._volume(at)
        grown = _mean(contracted(volume.slope, change), at)
        return super()._stress_change(at, response, change) + volume.stiffness * grown * volume.slope

    def _elasticity(self, at: Points, response: Response, stress: Floats | None) -> Floats:
        elasticity, excess = super()._elasticity(at, response, stress), self._excess(at, response, stress)
        if excess is None:
            return elasticity
        inverse = inverted(self._strain(at))  # the pressure acts on v, too: see `_tangent`
        return elasticity - excess * outer(inverse, inverse)

    def _tangent(self, at: Points, stress: Floats | None) -> Floats:
        """Return element matrices [N/m]: those of a law plus the coupling by the mean."""
        volume = self._volume(at)
        along = self._forces(at, np.ascontiguousarray(volume.slope))  # derivative of the mean times the volume
        stiffness, excess = volume.stiffness, self._excess(at, self._respond(at), stress)
        if excess is not None:
            stiffness = stiffness + _mean(excess, at) / volume.mean**2
        coupling = (stiffness / at.volumes.sum(axis=1, keepdims=True))[:, :, None]
        return np.asarray(super()._tangent(at, stress) + coupling * along[:, :, None] * along[:, None])


def _mean(values: Floats, at: Points) -> Floats:
    """Return the mean over each undeformed element, axes (element, 1)."""
    return np.asarray((values * at.volumes).sum(axis=1, keepdims=True) / at.volumes.sum(axis=1, keepdims=True))
