"""Carrying a stress along a step with its pressure as a variable of its own.

The stress is split into S = S' + p C^-1 with the Kirchhoff pressure p = S : C / d. Extrapolated as a whole, the stress
p C^-1 of a nearly incompressible material is wrong by p times the square of the step; extrapolated apart, p acts on the
deformation that the step leads to. Tangents then have p, too, where the elasticity depends on it: the derivative of
p C^-1 with respect to C^-1.
"""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.models.gauss_points import Points
from truespring.models.symmetric import contracted, identity


class Deformed(NamedTuple):
    """Gauss points with the deformation of the law, which may differ from that of the points.

    Attributes:
        at: the points.
        F: deformation gradient [-], axes (i, j, point, element).
        strain: strain of the frame of the points [-], axes (component, point, element).
    """

    at: Points
    F: Floats
    strain: Floats

    def pressure_of(self, stress: Floats) -> Floats:
        """Return the Kirchhoff pressure S : C / d [Pa] of a stress in the frame, positive in tension."""
        return self.at.pressure_of(stress, self.strain)

    def reference(self, stress: Floats) -> Floats:
        """Return a stress in the frame as second Piola-Kirchhoff stress [Pa], axes (component, point, element)."""
        return self.at.to_reference(stress, self.F)

    def of_pressure(self, pressure: Floats) -> Floats:
        """Return the second Piola-Kirchhoff stress p C^-1 [Pa], axes (component, point, element)."""
        inverse = self.at.inverse(self.strain)
        return self.reference(pressure * (identity(self.strain) if inverse is None else inverse))


def advanced(before: Deformed, after: Deformed, stress: Floats, change: Floats, growth: Floats) -> Floats:
    """Return a second Piola-Kirchhoff stress after a step [Pa], axes (component, point, element).

    S' is extrapolated linearly; p is extrapolated linearly and acts on the deformation reached.

    Args:
        before, after: the points before and after the step.
        stress: the stress before the step, in the frame of the points [Pa].
        change: its linear change [Pa].
        growth: the linear change of the strain [-].
    """
    pressure = before.pressure_of(stress)
    ahead = pressure + before.pressure_of(change) + 2 / before.at.dim * contracted(stress, growth)
    turned = before.at.of_metric(0.0, pressure, before.strain).times(growth)
    own = before.reference(stress + change + turned) - before.of_pressure(ahead)
    return np.asarray(own + after.of_pressure(ahead))
