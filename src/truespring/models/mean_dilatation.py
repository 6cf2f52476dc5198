"""Elements of mean dilatation, which do not lock for nearly incompressible materials."""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.models.fem_potential import FemPotential, Points, determinant
from truespring.models.symmetric import contracted, identity, inverted, outer, swapped


class _Exchange(NamedTuple):
    """The replacement of the volume ratio at the Gauss points.

    Attributes:
        J: volume ratio, axes (element, point); 1 for a linear law.
        theta: ln(Jm / J), Jm the mean of J over the undeformed element; for a linear law the change of the trace.
        scale: factor exp(2 theta / d) of C; 1 for a linear law, NaN in an inverted element.
        metric: C, axes (component, element, point); the identity for a linear law.
        inverse: inverse of `metric`, the derivative of ln J with respect to the strain.
    """

    J: Floats
    theta: Floats
    scale: Floats
    metric: Floats
    inverse: Floats


class MeanDilatationPotential(FemPotential):
    """Quadrilaterals and hexahedra with the mean volume ratio of the element at every Gauss point.

    The law is evaluated at (Jm / J)^(1/d) F, Jm the mean of J over the undeformed element, d the dimension: the mean
    dilatation method of Nagtegaal, Parks and Rice (CMAME 4, 1974), at finite strain of Simo, Taylor and Pister (CMAME
    51, 1985) with the pressure eliminated. For the linear law the trace of the strain is averaged (B-bar method of
    Hughes). `stress` is that of the law at this deformation gradient.
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
        """Return C or the small strain with the mean volume ratio, undeformed in an inverted element."""
        exchange = self._exchange(at)
        if not self.law.finite:
            return super()._strain(at) + exchange.theta / self.mesh.dim * exchange.metric
        return np.where(np.isnan(exchange.scale), 1.0, exchange.scale) * exchange.metric

    def _inverted(self, at: Points) -> bool:
        """Return whether an element is inverted, so that ln J is undefined."""
        return self.law.finite and bool((determinant(at.F) <= 0).any())

    def _law_gradient(self, at: Points) -> Floats:
        """Return the deformation gradient with the mean volume ratio, axes (i, j, element, point)."""
        return np.sqrt(self._exchange(at).scale) * at.F

    def _strain_change(self, at: Points, change: Floats) -> Floats:
        """Return the linear change of the strain of the law for a change of F, axes (component, element, point)."""
        own, exchange = super()._strain_change(at, change), self._exchange(at)
        grown = contracted(exchange.inverse, own)  # of ln J
        theta = _mean(exchange.J * grown, at) / _mean(exchange.J, at) - grown
        return exchange.scale * (own + theta / self.mesh.dim * exchange.metric)

    def _working_stress(self, at: Points) -> Floats:
        """Return S' + (g - p) C^-1 [Pa], axes (component, element, point).

        S' is the stress at constant theta, p the derivative of the energy with respect to theta, g its part that acts
        on ln J through ln Jm.
        """
        exchange = self._exchange(at)
        stress = exchange.scale * self._respond(at).stress
        pressure = contracted(stress, exchange.metric) / self.mesh.dim
        return stress + (_share(pressure, exchange, at) - pressure) * exchange.inverse

    def _tangent(self, at: Points, stress: Floats | None) -> Floats:
        """Return element matrices [N/m] with the geometric part of `stress`, by default that of the law.

        S', p and g are those of `_working_stress`, m is the derivative of ln Jm with respect to the nodes, c half the
        derivative of S' : C / d with respect to the strain at constant theta. Terms of the strain at one point have
        the form of the tangent of a law; the mean adds y m^T + m y^T + b m m^T.
        """
        exchange, response, dim = self._exchange(at), self._respond(at), self.mesh.dim
        metric, inverse = exchange.metric, exchange.inverse
        own = exchange.scale * (response.stress if stress is None else stress)
        elasticity = exchange.scale**2 * self._elasticity(at, response, stress)
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
    """Return the mean over each undeformed element, axes (element, 1)."""
    return np.asarray((values * at.volumes).sum(axis=1, keepdims=True) / at.volumes.sum(axis=1, keepdims=True))


def _share(pressure: Floats, exchange: _Exchange, at: Points) -> Floats:
    """Return the share of each point in the pressure on the mean ratio [Pa], axes (element, point)."""
    return _mean(pressure, at) / _mean(exchange.J, at) * exchange.J
