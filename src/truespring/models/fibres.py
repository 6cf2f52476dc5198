"""The energy of fibres, for finite elements at Gauss points and for Gaussian springs by the mean of an element."""

from dataclasses import replace

import numpy as np

from truespring.arrays import Floats
from truespring.fibres import Families
from truespring.models.elasticity_parts import Elasticity
from truespring.models.gauss_points import Points
from truespring.models.law import Response
from truespring.models.symmetric import dyad, outer
from truespring.problem import Problem

# Fibres with I4 - 1 above this value are in tension for the tangent: those of the undeformed body are, whatever the
# rounding errors of I4.
_AT_REST = -1e-10


def stiff_fibres(problem: Problem) -> Families | None:
    """Return the fibres of the elements of a problem; None if none has a stiffness."""
    found = problem.fibres
    return found if found is not None and found.k1.any() else None


def fibre_energy(I4: Floats, k1: Floats, k2: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the energy density of fibres and its first and second derivative by I4 [Pa], each of the shape of I4.

    k1 / (2 k2) (exp(k2 <I4 - 1>^2) - 1), <x> the positive part of x, and k1 / 2 <I4 - 1>^2 where k2 is zero
    (Holzapfel, Gasser, Ogden, Journal of Elasticity 61, 2000).

    Args:
        I4: square of the stretch of the fibres [-].
        k1: stiffness [Pa], of a shape that broadcasts to that of I4.
        k2: increase of the stiffness [-], likewise.
    """
    x = np.maximum(I4 - 1, 0.0)
    k2 = np.where(k1 > 0, k2, 0.0)  # no stiffness times an exponential that overflows is no number
    square = k2 * x**2
    with np.errstate(over="ignore", invalid="ignore"):
        growth = np.exp(square)
        energy = np.where(k2 > 0, k1 / np.where(k2 > 0, 2 * k2, 1.0) * np.expm1(square), k1 / 2 * x**2)
        second = np.where(I4 - 1 > _AT_REST, k1 * growth * (1 + 2 * square), 0.0)
    return energy, k1 * x * growth, second


def with_fibres(response: Response, F: Floats, at: Points) -> Response:
    """Return the response of a law with the energy of the fibres at Gauss points added.

    With I4 = |F a|^2 and m = a, or m = F a in current axes: stress += 2 W' m (x) m, elasticity += 4 W'' m (x) m (x) m
    (x) m.

    Args:
        response: the response of the law.
        F: deformation gradient of the law, axes (i, j, point, element).
        at: the points, with fibres.
    """
    energy, stress, fibres = response.energy, response.stress, at.fibres
    assert fibres is not None
    curvatures = []
    for along in fibres.directions:
        deformed = (F * along.T[:, None]).sum(axis=1)
        vector = deformed if at.frame == "current" else along.T[:, None]
        square = dyad(vector, vector) / 2  # axes (component, point or 1, element)
        density, first, second = fibre_energy((deformed**2).sum(axis=0), fibres.k1, fibres.k2)
        energy = energy + density
        stress = stress + 2 * first * square
        curvatures.append((square, second))

    def elasticity() -> Elasticity:
        rest = sum(4 * second * outer(square, square) for square, second in curvatures)
        return response.elasticity().plus(Elasticity(0.0, 0.0, rest=np.asarray(rest)))

    return replace(response, energy=energy, stress=stress, elasticity=elasticity)
