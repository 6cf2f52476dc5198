"""Elements of second order whose volume counts as a whole: for materials that are nearly incompressible."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.models.fem import Points, determinant
from truespring.models.law import Response
from truespring.models.quadratic import QuadraticPotential
from truespring.models.symmetric import contracted, identity, inverted, outer, swapped, trace


class _Volume(NamedTuple):
    """The part of lambda: a function of the mean v of the volume ratio or, of some laws, of the strain's trace.

    Attributes:
        energy, pressure, stiffness: lambda/2 v^2, or lambda/2 (ln v)^2, and its derivatives by v, axes (element, 1).
        slope: the derivative of the point's own ratio or trace by the strain, axes (component, element, point).
        second: makes that of `slope`, axes (component, component, element, point).
        across: what the third direction has of it.
    """

    energy: Floats
    pressure: Floats
    stiffness: Floats
    slope: Floats
    second: Callable[[], Floats]
    across: Floats


class QuadraticMeanPotential(QuadraticPotential):
    """Elements of second order that take lambda's part of the law at the mean of each element, mu's at every point.

    An element has one volume ratio to keep instead of one at every Gauss point, so it does not lock as the Poisson's
    ratio nears 1/2: selective integration (Malkus and Hughes, CMAME 15, 1978). What mu gives to a change of volume
    stays at the points; at the mean too, the element would be too soft in bending.
    """

    interpolation = "quadratic-mean-dilatation"

    def _volume(self, at: Points) -> _Volume:
        strain, lam = self._strain(at), at.constants.lam
        eye = np.broadcast_to(identity(strain), strain.shape)
        if self.law.trace != "logarithmic":
            own = trace(strain - eye) / 2 if self.law.finite else trace(strain)
            mean = _mean(own, at)
            flat = partial(np.zeros, (len(strain), *strain.shape))
            return _Volume(lam / 2 * mean**2, lam * mean, lam + 0 * mean, eye, flat, np.ones_like(own))
        J = determinant(at.F)
        mean = _mean(J, at)
        valid = (J > 0) & (mean > 0)
        inverse = inverted(np.where(valid, strain, eye))
        log = np.log(np.where(mean > 0, mean, np.nan))
        return _Volume(
            lam / 2 * log**2,
            lam * log / mean,
            lam * (1 - log) / mean**2,
            J * inverse,
            lambda: J * (outer(inverse, inverse) - swapped(inverse)),
            J,
        )

    def _respond(self, at: Points) -> Response:
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

    def _tangent(self, at: Points, stress: Floats | None) -> Floats:
        """Element matrices [N/m]: those of a law, and what the mean couples."""
        volume = self._volume(at)
        along = self._forces(at, np.ascontiguousarray(volume.slope))  # the derivative of the mean, times the volume
        stiffness = (volume.stiffness / at.volumes.sum(axis=1, keepdims=True))[:, :, None]
        return np.asarray(super()._tangent(at, stress) + stiffness * along[:, :, None] * along[:, None])


def _mean(values: Floats, at: Points) -> Floats:
    """The mean over each element at rest, axes (element, 1)."""
    return np.asarray((values * at.volumes).sum(axis=1, keepdims=True) / at.volumes.sum(axis=1, keepdims=True))
