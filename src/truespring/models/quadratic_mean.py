"""Elements of second order with mean dilatation, for nearly incompressible materials."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.models.elasticity_parts import Elasticity
from truespring.models.gauss_points import Points
from truespring.models.law import Response
from truespring.models.quadratic import QuadraticPotential
from truespring.models.symmetric import contracted, identity, trace
from truespring.potential import VolumeStiffness


class _Volume(NamedTuple):
    """The part of lam in the energy: a function of the mean v of the trace of the strain, or of the volume ratio.

    Attributes:
        mean: v, axes (1, element).
        energy: lam/2 v^2, or lam/2 (ln v)^2 of the volume ratio [J/m^3], axes (1, element).
        pressure, stiffness: first and second derivative of `energy` with respect to v [Pa], axes (1, element).
        slope: derivative of the trace or ratio at a point with respect to the strain, axes (component, point, element).
        second: returns the derivative of `slope`.
        across: derivative of the trace or ratio with respect to the strain of the third direction.
    """

    mean: Floats
    energy: Floats
    pressure: Floats
    stiffness: Floats
    slope: Floats
    second: Callable[[], Elasticity]
    across: Floats


class QuadraticMeanPotential(QuadraticPotential):
    """Elements of second order with the part of lam at the mean of each element, the rest at every Gauss point.

    An element has one incompressibility constraint instead of one at every Gauss point, so that it does not lock near
    Poisson's ratio 1/2: selective integration (Malkus and Hughes, CMAME 15, 1978). With the volumetric part of mu at
    the mean, too, as with bulk/2 (ln J)^2, the element would be too soft in bending.
    """

    interpolation = "quadratic-mean-dilatation"

    def _volume(self, at: Points) -> _Volume:
        strain, lam = at.strain, at.constants.lam
        eye, current = identity(strain), at.frame == "current"
        if self.law.trace != "logarithmic":
            own = (at.F**2).sum(axis=(0, 1)) / 2 - at.dim / 2 if self.law.finite else trace(strain)
            mean = at.mean(own)
            slope = strain if current else np.broadcast_to(eye, strain.shape)
            return _Volume(
                mean,
                lam / 2 * mean**2,
                lam * mean,
                lam + 0 * mean,
                slope,
                lambda: Elasticity(0.0, 0.0),
                np.ones_like(own),
            )
        J, mean = at.J, at.mean(at.J)
        upright = np.where((J > 0) & (mean > 0), strain, eye)
        inverse = at.inverse(upright)
        log = np.log(np.where(mean > 0, mean, np.nan))
        return _Volume(
            mean,
            lam / 2 * log**2,
            lam * log / mean,
            lam * (1 - log) / mean**2,
            J * (eye if inverse is None else inverse),
            lambda: at.of_metric(J, -J, upright),
            J,
        )

    def _law_response(self, at: Points) -> Response:
        shear = self.law.in_frame(at.strain, replace(at.constants, lam=0 * at.constants.lam))
        volume = self._volume(at)
        return Response(
            shear.energy + volume.energy,
            shear.stress + volume.pressure * volume.slope,
            lambda: shear.elasticity().plus(volume.second().scaled(volume.pressure)),
            shear.thickness_stretch,
            shear.across + volume.pressure * volume.across,
        )

    def _stress_change(self, at: Points, response: Response, change: Floats) -> Floats:
        volume = self._volume(at)
        grown = at.mean(contracted(volume.slope, change))
        return super()._stress_change(at, response, change) + volume.stiffness * grown * volume.slope

    def _elasticity(self, at: Points, response: Response, excess: Floats | None) -> Elasticity:
        elasticity = super()._elasticity(at, response, excess)
        # The pressure acts on v, too: see `_tangent`.
        return elasticity if excess is None else elasticity.plus(at.of_metric(-excess, 0.0, at.strain))

    def _tangent(self, at: Points, stress: Floats | None) -> Floats:
        """Return element matrices [N/m]: those of a law plus the coupling by the mean."""
        volume, response = self._volume(at), self._respond(at)
        along = at.forces(volume.slope)  # derivative of the mean times the volume
        stiffness, excess = volume.stiffness, self._excess(at, response, stress)
        if excess is not None:
            stiffness = stiffness + at.mean(excess) / volume.mean**2
        share = stiffness / at.volumes.sum(axis=0) / 2
        own = response.stress if stress is None else stress
        return at.matrices(own, self._elasticity(at, response, excess), along, share * along)

    def volume_stiffness(self, positions: Floats) -> tuple[VolumeStiffness, ...]:
        """Return the parts of lam and mu in the energy as stiffness of the mean v of each element, times its volume."""
        if self.constants.plane_stress:
            return ()
        elements, dim = self._pattern.elements, self.mesh.dim
        slope, stiffness, shear = np.empty((*elements.shape, dim)), np.empty(len(elements)), np.empty(len(elements))
        for first, last in self.slices():
            at = self._points(positions, first, last)
            volume, share = self._volume(at), 1 / at.volumes.sum(axis=0)
            if self.law.trace == "logarithmic":
                share = share / volume.mean[0] ** 2
            slope[first:last] = at.own(at.forces(volume.slope)).T.reshape(last - first, -1, dim)
            stiffness[first:last] = at.own(at.constants.lam * share)
            shear[first:last] = at.own(at.constants.mu * share)
        return (VolumeStiffness(elements, slope, stiffness, shear),)
