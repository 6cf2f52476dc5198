"""The law of the volume of elements with springs of constant stiffness: its derivative and its integral.

In space and plane strain the derivative of the energy density by ln J is offset + slope ln J. In plane stress the third
direction has the square of a stretch C, and `across` C + offset + slope (ln J + ln C / 2) = 0; J is that of the plane.
`across` is twice the derivative of the energy density by the trace of C in plane stress, else 0.
"""

import math
from typing import Any

from truespring.kernels.threads import kernel

# Volume ratio below which the pressure is continued linearly: that of the law is infinite for collapsed elements.
_SMALLEST = 0.1
# Newton's method for the third direction: iterations, largest change of ln C, and the change that ends it.
_ITERATIONS, _CHANGE, _SOLVED = 60, 2.0, 1e-15


@kernel
def _third(y: float, across: float, offset: float, slope: float) -> float:
    """Return ln C of the third direction at ln J = y."""
    z = -2 * slope / (slope + 2 * across) * y
    for _ in range(_ITERATIONS):
        pull = across * math.exp(z)
        change = (pull + offset + slope * (y + z / 2)) / (pull + slope / 2)
        z -= min(max(change, -_CHANGE), _CHANGE)
        if abs(change) <= _SOLVED * max(1.0, abs(z)):
            break
    return z


@kernel
def _at(y: float, across: float, offset: float, slope: float) -> Any:
    """Return the energy density and its first and second derivative by ln J at ln J = y."""
    if across == 0.0:
        return (offset + slope / 2 * y) * y, offset + slope * y, slope
    z = _third(y, across, offset, slope)
    pull, whole = across * math.exp(z), y + z / 2
    energy = (pull - across) / 2 + (offset + slope / 2 * whole) * whole
    return energy, offset + slope * whole, slope * pull / (pull + slope / 2)


@kernel
def pressure(ratio: float, across: float, offset: float, slope: float) -> Any:
    """Return the derivative of the energy density by J [Pa], continued linearly below J = 0.1."""
    J = max(ratio, _SMALLEST) if ratio == ratio else ratio
    _, first, second = _at(math.log(J), across, offset, slope)
    return (first + (second - first) / J * (ratio - J)) / J


@kernel
def density(ratio: float, across: float, offset: float, slope: float) -> Any:
    """Return the integral of `pressure` over J from 1 [J/m^3]."""
    J = max(ratio, _SMALLEST) if ratio == ratio else ratio
    energy, first, second = _at(math.log(J), across, offset, slope)
    below = ratio - J
    return energy + (first + (second - first) / J * below / 2) / J * below
