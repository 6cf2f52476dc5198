"""Elements whose volume changes as a whole: they do not lock where the material is nearly incompressible."""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.models.fem_potential import FemPotential, Points, determinant
from truespring.models.symmetric import contracted, identity, inverted, outer, swapped


class _Exchange(NamedTuple):
    """The exchange of the volume ratio at the Gauss points.

    Attributes:
        J: the true ratio, axes (element, point); 1 for a linear law.
        theta: ln(Jm / J), Jm the mean of J over the element at rest; for a linear law the change of the trace.
        scale: exp(2 theta / d), by which C is changed; 1 for a linear law, not a number in an inverted element.
        metric: C, axes (component, element, point); the identity for a linear law.
        inverse: its inverse, which is the derivative of ln J by the strain.
    """

    J: Floats
    theta: Floats
    scale: Floats
    metric: Floats
    inverse: Floats


class MeanDilatationPotential(FemPotential):
    """Quadrilaterals and hexahedra whose volume ratio J is replaced at every point by the element's own.

    The law is asked at (Jm / J)^(1/d) F with the mean Jm of J over the element at rest and d the
    dimensions: the mean dilatation method of Nagtegaal, Parks and Rice (CMAME 4, 1974), at finite
    strain that of Simo, Taylor and Pister (CMAME 51, 1985) with the pressure eliminated. For the
    linear law it is the trace of the strain that is averaged (Hughes' B-bar). `stress` is what the
    law answers there.
    """

    interpolation = "mean-dilatation"

    def _exchange(self, at: Points) -> _Exchange:
        strain, dim = super()._strain(at), self.mesh.dim
        if not self.law.finite:
            trace = strain[:dim].sum(axis=0)
            ones, eye = np.ones_like(trace), np.broadcast_to(identity(strain), strain.shape)
            return _Exchange(ones, _mean(trace, at) - trace, ones, eye, eye)
        J = determinant(at.F)
        valid = (J > 0).all(axis=1, keepdims=True)
        J = np.where(valid, J, 1.0)
        theta = np.log(_mean(J, at) / J)
        metric = np.where(valid, strain, identity(strain))
        return _Exchange(J, theta, np.where(valid, np.exp(2 * theta / dim), np.nan), metric, inverted(metric))

    def _strain(self, at: Points) -> Floats:
        """What the law asks for, with the element's volume ratio; that at rest where an element is inverted."""
        exchange = self._exchange(at)
        if not self.law.finite:
            return super()._strain(at) + exchange.theta / self.mesh.dim * exchange.metric
        return np.where(np.isnan(exchange.scale), 1.0, exchange.scale) * exchange.metric

    def _refused(self, at: Points) -> bool:
        """Whether an element is inverted: its volume ratio has no logarithm."""
        return self.law.finite and bool((determinant(at.F) <= 0).any())

    def _law_gradient(self, at: Points) -> Floats:
        """The deformation gradient with the element's volume ratio."""
        return np.sqrt(self._exchange(at).scale) * at.F

    def _strain_change(self, at: Points, change: Floats) -> Floats:
        """The change of the law's strain that is linear in one of F, axes (component, element, point)."""
        own, exchange = super()._strain_change(at, change), self._exchange(at)
        grown = contracted(exchange.inverse, own)  # of ln J
        theta = _mean(exchange.J * grown, at) / _mean(exchange.J, at) - grown
        return exchange.scale * (own + theta / self.mesh.dim * exchange.metric)

    def _working_stress(self, at: Points) -> Floats:
        """S' + (g - p) C^-1: S' works at a constant theta, p on theta, and g is what ln Jm takes of ln J."""
        exchange = self._exchange(at)
        stress = exchange.scale * self._respond(at).stress
        pressure = contracted(stress, exchange.metric) / self.mesh.dim
        return stress + (_share(pressure, exchange, at) - pressure) * exchange.inverse

    def _tangent(self, at: Points, stress: Floats | None) -> Floats:
        """Element matrices [N/m], the geometric part of `stress` or the law's own.

        With S', p and g as above, m the derivative of ln Jm by the nodes and c half that of S' : C / d by the
        true strain, theta being constant: what depends on a point's strain alone is the tangent of a law, and
        what the mean couples adds y m^T + m y^T + b m m^T.
        """
        exchange, response, dim = self._exchange(at), self._respond(at), self.mesh.dim
        metric, inverse = exchange.metric, exchange.inverse
        own = exchange.scale * (response.stress if stress is None else stress)
        elasticity = exchange.scale**2 * response.elasticity()
        pressure = contracted(own, metric) / dim
        mixed = contracted(elasticity, metric) / dim
        second = contracted(mixed, metric) / dim
        if self.law.finite:
            mixed += 2 / dim * own
            second += 2 / dim * pressure
        share = _share(pressure, exchange, at)
        coupled = outer(mixed, inverse)
        elasticity += second * outer(inverse, inverse) - coupled - coupled.swapaxes(0, 1)
        bending = 0 * second
        if self.law.finite:
            elasticity += (pressure - share) * swapped(inverse) + share * outer(inverse, inverse)
            bending = pressure
        blocks = self._matrices(at, own + (share - pressure) * inverse, elasticity)
        weight = (exchange.J * at.volumes).sum(axis=1)
        m = self._forces(at, exchange.J * inverse) / weight[:, None]
        b = ((second - bending) * at.volumes).sum(axis=1)
        y = self._forces(at, mixed - second * inverse) + b[:, None] / 2 * m
        crossed = y[:, :, None] * m[:, None]
        return np.asarray(blocks + crossed + crossed.swapaxes(1, 2))


def _mean(values: Floats, at: Points) -> Floats:
    """The mean over each element at rest, axes (element, 1)."""
    return np.asarray((values * at.volumes).sum(axis=1, keepdims=True) / at.volumes.sum(axis=1, keepdims=True))


def _share(pressure: Floats, exchange: _Exchange, at: Points) -> Floats:
    """What ln J at each point takes of the pressure's work on the mean ratio [Pa], axes (element, point)."""
    return _mean(pressure, at) / _mean(exchange.J, at) * exchange.J
