"""Elements of mean dilatation, which do not lock for nearly incompressible materials."""

from functools import cached_property

import numpy as np

from truespring.arrays import Floats
from truespring.models.elasticity_parts import Elasticity
from truespring.models.element_volumes import ElementVolumes
from truespring.models.fem_potential import FemPotential
from truespring.models.gauss_points import Exchange, Points
from truespring.models.symmetric import contracted, identity, outer
from truespring.potential import VolumeStiffness


class MeanDilatationPotential(FemPotential):
    """Quadrilaterals and hexahedra with the mean volume ratio of the element at every Gauss point.

    The law is evaluated at (Jm / J)^(1/d) F, Jm the mean of J over the undeformed element, d the dimension: the mean
    dilatation method of Nagtegaal, Parks and Rice (CMAME 4, 1974), at finite strain of Simo, Taylor and Pister (CMAME
    51, 1985) with the pressure eliminated. For the linear law the trace of the strain is averaged (B-bar method of
    Hughes). `stress` is that of the law at this deformation gradient.
    """

    interpolation = "mean-dilatation"

    def _strain(self, at: Points) -> Floats:
        """Return the strain with the mean volume ratio, undeformed in an inverted element."""
        exchange = at.exchange
        if not self.law.finite:
            return at.strain + exchange.theta / at.dim * exchange.metric
        valid = np.isfinite(exchange.scale)
        return np.where(valid, np.where(valid, exchange.scale, 1.0) * at.strain, identity(at.strain))

    def _inverted(self, at: Points) -> bool:
        """Return whether an element is inverted, so that ln J is undefined."""
        return self.law.finite and bool((at.J <= 0).any())

    def _law_gradient(self, at: Points) -> Floats:
        """Return the deformation gradient with the mean volume ratio, axes (i, j, point, element)."""
        return np.sqrt(at.exchange.scale) * at.F

    def _strain_change(self, at: Points, step: Floats) -> Floats:
        """Return the linear change of the strain of the law for a step, axes (component, point, element)."""
        own, exchange = at.strain_change(step), at.exchange
        grown = contracted(exchange.inverse, own)  # of ln J
        theta = at.mean(exchange.J * grown) / at.mean(exchange.J) - grown
        return exchange.reference * (own + theta / at.dim * exchange.metric)

    def _working_stress(self, at: Points) -> Floats:
        """Return S' + (g - p) C^-1 [Pa], axes (component, point, element).

        S' is the stress at constant theta, p the derivative of the energy with respect to theta, g its part that acts
        on ln J through ln Jm.
        """
        exchange = at.exchange
        stress = exchange.reference * self._respond(at).stress
        pressure = at.pressure_of(stress, exchange.metric)
        return stress + (_share(pressure, exchange, at) - pressure) * exchange.inverse

    @cached_property
    def _measures(self) -> ElementVolumes:
        return ElementVolumes(self.problem, self._pattern.elements, 1)

    @cached_property
    def _volumes(self) -> Floats:
        """Undeformed volume of each element [m^3], shape (n_elements,)."""
        return self._measures.at(self.nodes)[1]

    def volume_stiffness(self, positions: Floats) -> tuple[VolumeStiffness, ...]:
        """Return the parts of lam and mu in the energy as stiffness of the volume of each element.

        They are lam/2 (ln Jm)^2, or for the linear law lam/2 times the squared change of the undeformed volume. Other
        laws have no such part.
        """
        if self.constants.plane_stress or not (self._carries_pressure or self.law.trace == "small"):
            return ()
        slope, volume = self._measures.at(positions if self.law.finite else self.nodes)
        constants, share = self.constants.raveled, self._volumes / volume**2
        return (VolumeStiffness(self._pattern.elements, slope, constants.lam * share, constants.mu * share),)

    def _tangent(self, at: Points, stress: Floats | None) -> Floats:
        """Return element matrices [N/m] with the geometric part of `stress`, by default that of the law.

        S', p and g are those of `_working_stress`, m is the derivative of ln Jm with respect to the nodes, c half the
        derivative of S' : C / d with respect to the strain at constant theta. Terms of the strain at one point have
        the form of the tangent of a law; the mean adds y m^T + m y^T + b m m^T.
        """
        exchange, response, dim = at.exchange, self._respond(at), at.dim
        metric, inverse, reference = exchange.metric, exchange.inverse, exchange.reference
        own = reference * (response.stress if stress is None else stress)
        elasticity = self._elasticity(at, response, self._excess(at, response, stress)).scaled(reference**2)
        pressure = at.pressure_of(own, metric)
        mixed = elasticity.times(np.broadcast_to(metric, own.shape)) / dim
        second = at.pressure_of(mixed, metric)
        if self.law.finite:
            mixed += 2 / dim * own
            second += 2 / dim * pressure
        share = _share(pressure, exchange, at)
        alike, shear, bending = second, 0 * second, 0 * second
        if self.law.finite:
            alike, shear, bending = second + share, pressure - share, pressure
        elasticity = elasticity.plus(at.of_metric(alike, shear, metric)).plus(_coupled(-mixed, exchange, at))
        weight = (exchange.J * at.volumes).sum(axis=0)
        m = at.forces(exchange.J * inverse) / weight
        b = ((second - bending) * at.volumes).sum(axis=0)
        y = at.forces(mixed - second * inverse) + b / 2 * m
        return at.matrices(own + (share - pressure) * inverse, elasticity, y, m)


def _coupled(tensor: Floats, exchange: Exchange, at: Points) -> Elasticity:
    """Return T (x) M + M (x) T of a symmetric tensor T, M = `exchange.inverse`."""
    if at.frame != "reference":
        return Elasticity(0.0, 0.0, tensor)
    product = outer(tensor, exchange.inverse)
    return Elasticity(0.0, 0.0, rest=product + product.swapaxes(0, 1))


def _share(pressure: Floats, exchange: Exchange, at: Points) -> Floats:
    """Return the share of each point in the pressure on the mean ratio [Pa], axes (point, element)."""
    return at.mean(pressure) / at.mean(exchange.J) * exchange.J
