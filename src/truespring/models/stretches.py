"""Laws as functions W(e_1, e_2, e_3) of the logarithms of the principal stretches, for finite elements.

The function is symmetric: exchanging two stretches exchanges the derivatives.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.models.constants import Constants, Response
from truespring.models.elasticity_parts import Elasticity
from truespring.models.strain import voigt_pairs
from truespring.models.symmetric import dimensions, dyad, outer
from truespring.models.thickness import Slope, free_thickness

# Difference of two logarithmic stretches below which a difference quotient is replaced by a mean of derivatives.
_NEAR = 0.02


@dataclass(frozen=True, slots=True)
class StretchDerivatives:
    """An energy density and its derivatives by the logarithmic principal stretches.

    Attributes:
        energy: energy density [J/m^3], axes (...); NaN outside the domain of the law.
        first: derivatives, the principal Kirchhoff stresses [Pa], axes (3, ...).
        second: second derivatives [Pa], axes (3, 3, ...).
    """

    energy: Floats
    first: Floats
    second: Floats


#: A law: returns the derivatives at three logarithmic principal stretches [-], axes (3, ...), and the constants.
StretchLaw = Callable[[Floats, Constants], StretchDerivatives]


def condensed(law: StretchLaw, plane: Floats, constants: Constants) -> tuple[Floats, StretchDerivatives]:
    """Return ln of the stretch of the third direction [-], and the law as a function of the other stretches.

    `plane` has the logarithmic stretches in the space of the mesh, axes (2 or 3, ...), as `first` of the result has. In
    plane strain the third is 0. In plane stress it minimises the energy, and the second derivatives are those of the
    minimum.
    """
    if len(plane) == 3:
        return plane[2], law(plane, constants)
    e_3 = _free(law, plane, constants) if constants.plane_stress else np.zeros(plane.shape[1:])
    found = law(np.stack([*plane, e_3]), constants)
    second = found.second[:2, :2]
    if constants.plane_stress:
        coupling = found.second[:2, 2]
        second = second - coupling[:, None] * coupling[None] / found.second[2, 2]
    return e_3, StretchDerivatives(found.energy, found.first, second)


def _free(law: StretchLaw, plane: Floats, constants: Constants) -> Floats:
    """Return ln of the stretch of the third direction that has no stress; NaN where there is none."""

    def slope(z: Floats) -> Slope:
        found = law(np.stack([*plane, z / 2]), constants)
        return Slope(found.first[2] / 2, found.second[2, 2] / 4)

    def smallest_change() -> Floats:
        return np.asarray(np.log(np.exp(2 * plane).mean(axis=0)))

    lam, mu, growth = constants.lam, constants.mu, plane.sum(axis=0)
    return free_thickness(slope, -2 * lam / (lam + 2 * mu) * growth, smallest_change, mu) / 2


def by_stretches(law: StretchLaw, current: bool = False) -> Callable[[Floats, Constants], Response]:
    """Return the response of a law as a function of C, axes (component, ...), and constants, for LAWS.

    With C = sum c_i N_i (x) N_i and the derivatives t_i of W by e_i = ln(c_i) / 2, the stress is sum t_i / c_i N_i (x)
    N_i. The shear components of its derivative are the divided differences of t_i / c_i by c_i. With `current`, the
    response is in current axes, a function of b: the same with the axes of b, times c_i for each N_i (x) N_i.
    """

    def respond(C: Floats, constants: Constants) -> Response:
        dim = dimensions(C)
        c, N = _principal(C)
        valid = c[0] > 0
        c = np.where(valid, c, 1.0)
        e = np.log(c) / 2
        e_3, at = condensed(law, e, constants)
        valid &= np.isfinite(at.energy)
        scale = np.ones_like(c) if current else 1 / c
        own = [scale[i] * dyad(N[:, i], N[:, i]) / 2 for i in range(dim)]
        stress = sum(at.first[i] * own[i] for i in range(dim))

        def elasticity() -> Elasticity:
            result = np.zeros((len(C), *C.shape))
            for i in range(dim):
                for j in range(dim):
                    normal = at.second[i, j] - 2 * (i == j) * at.first[i]
                    result += normal * outer(own[i], own[j])
                for j in range(i):
                    quotient = _quotient(law, e, at, (i, j), constants)
                    shear = (quotient * _log_difference(c[i], c[j]) / 2 - at.first[j]) * scale[i] * scale[j]
                    mixed = dyad(N[:, i], N[:, j])
                    result += shear * outer(mixed, mixed)
            return Elasticity(0.0, 0.0, rest=result)

        flat = dim == 2
        across = at.first[2] if flat and not constants.plane_stress else np.zeros_like(at.energy)
        thickness = np.exp(e_3) if flat else np.ones_like(at.energy)
        return Response(np.where(valid, at.energy, np.inf), np.asarray(stress), elasticity, thickness, across)

    return respond


def _quotient(
    law: StretchLaw, e: Floats, at: StretchDerivatives, pair: tuple[int, int], constants: Constants
) -> Floats:
    """Return the divided difference (t_i - t_j) / (e_i - e_j) of the first derivatives [Pa].

    From s = -1, the stretches exchanged, to s = 1, t_i - t_j grows from its negative value at the rate (e_i - e_j) / 2
    (W_ii - 2 W_ij + W_jj). Where the stretches are near, the rule of Gauss and Lobatto with four points, two of which
    follow from the symmetry, integrates this rate; it is exact where they are equal.
    """
    i, j = pair
    difference = e[i] - e[j]
    near = np.abs(difference) < _NEAR
    plain = (at.first[i] - at.first[j]) / np.where(near, 1.0, difference)
    if not near.any():
        return np.asarray(plain)
    between = e.copy()
    shift = (1 - np.sqrt(1 / 5)) * difference / 2
    between[i] -= shift
    between[j] += shift
    inner = condensed(law, between, constants)[1]
    return np.where(near, (_rate(at.second, i, j) + 5 * _rate(inner.second, i, j)) / 12, plain)


def _rate(second: Floats, i: int, j: int) -> Floats:
    return np.asarray(second[i, i] - 2 * second[i, j] + second[j, j])


def _principal(C: Floats) -> tuple[Floats, Floats]:
    """Return the eigenvalues, ascending, axes (number, ...), and unit eigenvectors, axes (direction, number, ...)."""
    dim = dimensions(C)
    full = np.empty((*C.shape[1:], dim, dim))
    for component, (i, j) in zip(C, voigt_pairs(dim), strict=True):
        full[..., i, j] = full[..., j, i] = component
    values, vectors = np.linalg.eigh(full)
    first = np.moveaxis(values, -1, 0), np.moveaxis(vectors, (-2, -1), (0, 1))
    return np.ascontiguousarray(first[0]), np.ascontiguousarray(first[1])


def _log_difference(a: Floats, b: Floats) -> Floats:
    """Return b (ln a - ln b) / (a - b), 1 where a = b."""
    x = (a - b) / b
    near = np.abs(x) < 0.5
    logarithm = np.where(near, np.log1p(np.where(near, x, 0.0)), np.log(a) - np.log(b))
    return np.divide(logarithm, x, out=np.ones_like(x), where=x != 0)


#: The energy of a change of shape, a sum of psi over the three principal stretches without dilatation: returns psi
#: [J/m^3] and its first and second derivative at their logarithms.
StretchEnergy = Callable[[Floats], tuple[Floats, Floats, Floats]]


def isochoric(e: Floats, psi: StretchEnergy, bulk: float | Floats) -> StretchDerivatives:
    """Return the derivatives of sum psi(e_i - y / 3) + bulk/2 y^2, y = ln J the sum of e_i."""
    y = e.sum(axis=0)
    energy, first, second = psi(e - y / 3)
    mean = second.mean(axis=0) / 3
    curvature = bulk + mean - (second[:, None] + second[None]) / 3
    for i in range(3):
        curvature[i, i] += second[i]
    return StretchDerivatives(energy.sum(axis=0) + bulk / 2 * y**2, first - first.mean(axis=0) + bulk * y, curvature)
