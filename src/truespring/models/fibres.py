"""The energy of fibres, for finite elements at Gauss points and for Gaussian springs by the mean of an element."""

from dataclasses import replace

import numpy as np

from truespring.arrays import Floats
from truespring.fibres import Families
from truespring.models.law import Response
from truespring.models.symmetric import contracted, dyad, outer
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
    square = k2 * x**2
    with np.errstate(over="ignore", invalid="ignore"):
        growth = np.exp(square)
        energy = np.where(k2 > 0, k1 / np.where(k2 > 0, 2 * k2, 1.0) * np.expm1(square), k1 / 2 * x**2)
        second = np.where(I4 - 1 > _AT_REST, k1 * growth * (1 + 2 * square), 0.0)
    return energy, k1 * x * growth, second


def with_fibres(response: Response, C: Floats, fibres: Families) -> Response:
    """Return the response of a law with the energy of fibres added.

    With I4 = a . C a: S += 2 W' a (x) a, and its derivative by the Green strain 4 W'' a (x) a (x) a (x) a.

    Args:
        response: the response of the law at C.
        C: right Cauchy-Green tensor, axes (component, element, point).
        fibres: fibres of these elements.
    """
    energy, stress = response.energy, response.stress
    curvatures = []
    for along in fibres.directions:
        square = dyad(along.T, along.T)[..., None] / 2  # axes (component, element, 1)
        density, first, second = fibre_energy(contracted(C, square), fibres.k1[:, None], fibres.k2[:, None])
        energy = energy + density
        stress = stress + 2 * first * square
        curvatures.append((square, second))

    def elasticity() -> Floats:
        found = response.elasticity()
        for square, second in curvatures:
            found = found + 4 * second * outer(square, square)
        return np.asarray(found)

    return replace(response, energy=energy, stress=stress, elasticity=elasticity)
