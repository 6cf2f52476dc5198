"""Carrying a stress along a step with its pressure as a variable of its own.

The stress is split into S = S' + p C^-1 with the Kirchhoff pressure p = S : C / d. Extrapolated as a whole, the stress
p C^-1 of a nearly incompressible material is wrong by p times the square of the step; extrapolated apart, p acts on the
deformation that the step leads to. Tangents then have p, too, where the elasticity depends on it: the derivative of
p C^-1 with respect to C^-1.
"""

import numpy as np

from truespring.arrays import Floats
from truespring.models.symmetric import contracted, dimensions, inverted, swapped


def advanced(stress: Floats, change: Floats, C: Floats, growth: Floats, reached: Floats) -> Floats:
    """Return a stress after a step [Pa]: S' extrapolated linearly, p extrapolated linearly on the deformation reached.

    Args:
        stress: second Piola-Kirchhoff stress before the step [Pa], axes (component, ...).
        change: its linear change [Pa].
        C: right Cauchy-Green tensor before the step [-].
        growth: the linear change of the Green strain [-].
        reached: C after the step [-].
    """
    inverse = inverted(C)
    pressure = pressure_of(stress, C)
    ahead = pressure + pressure_of(change, C) + 2 / dimensions(C) * contracted(stress, growth)
    turned = pressure * contracted(swapped(inverse), growth)
    return np.asarray(stress + change + turned + ahead * (inverted(reached) - inverse))


def pressure_of(stress: Floats, C: Floats) -> Floats:
    """Return the Kirchhoff pressure S : C / d [Pa], positive in tension, axes (...)."""
    return contracted(stress, C) / dimensions(C)
