"""The stretch of the third direction in plane stress: one solve for all laws."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats

# Iterations of Newton's method, largest change of ln C_33 in one, halvings of a step that leaves the domain of the law,
# and the step after which the error, of the order of its square, is below rounding.
_MAX_ITERATIONS, _LARGEST_CHANGE, _MAX_HALVINGS, _LAST_STEP = 100, 2.0, 40, 3e-9


class Slope(NamedTuple):
    """Derivatives of the energy density by z = ln C_33 [J/m^3], of one shape; NaN outside the domain of the law.

    Attributes:
        first, second: first and second derivative.
    """

    first: Floats
    second: Floats


def free_thickness(
    slope: Callable[[Floats], Slope], start: Floats, inside: Callable[[], Floats], mu: float | Floats
) -> Floats:
    """Return z = ln C_33 at which the energy is smallest, so that the stress of the third direction is zero.

    Newton's method from `start`, or from `inside()` where `start` is outside the domain of the law. A step that leaves
    the domain is halved. `mu` is the shear modulus [Pa]. Returns NaN where there is no minimum.
    """
    z, at = start, slope(start)
    outside = ~np.isfinite(at.first)
    if outside.any():
        z = np.where(outside, inside(), z)
        at = slope(z)
    for _ in range(_MAX_ITERATIONS):
        stable = at.second > 0
        step = at.first / (at.second if stable.all() else np.where(stable, at.second, np.abs(at.first) + mu))
        step = np.clip(np.where(np.isfinite(step), step, 0.0), -_LARGEST_CHANGE, _LARGEST_CHANGE)
        solved = np.abs(step) <= _LAST_STEP * np.maximum(1.0, np.abs(z))
        if solved.all():
            break
        z, at = _within(slope, z, step)
    return np.where(solved & np.isfinite(at.first) & stable, z - step, np.nan)


def _within(slope: Callable[[Floats], Slope], z: Floats, step: Floats) -> tuple[Floats, Slope]:
    """Return z - step and the derivatives there, with steps halved until they stay in the domain of the law."""
    for _ in range(_MAX_HALVINGS):
        at = slope(z - step)
        outside = ~np.isfinite(at.first) & (step != 0)
        if not outside.any():
            break
        step = np.where(outside, step / 2, step)
    return z - step, at
