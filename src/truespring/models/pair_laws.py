"""The table of force laws of springs."""

from types import MappingProxyType
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.models.pair_law import PairLaw

STRAIGHT = "straight"


def _straight_loops() -> Any:
    from truespring.kernels import springs

    return springs


def _power(base: Floats, exponent: int) -> Floats:
    """Return a power with a small positive exponent by multiplication, faster than the operator."""
    power = base
    for _ in range(exponent - 1):
        power = power * base
    return power


def _neo_hookean_tension(k: Floats, rest: Floats, length: Floats, d: int) -> Floats:
    """Return k L (s - s^-(d+1)) / (d + 2), s = l / L [N].

    The mean of (n . C n)^(-d/2) over all directions n is 1/J, that of n . C n is tr C / d: springs of all directions
    have the energy density mu/2 (tr C - d) + mu (1/J - 1), with C = F^T F and J = det F.
    """
    return k / (d + 2) * (length - rest * _power(rest / length, d + 1))


def _neo_hookean_stiffness(k: Floats, rest: Floats, length: Floats, d: int) -> Floats:
    """Return k (1 + (d + 1) s^-(d+2)) / (d + 2), s = l / L [N/m]."""
    return k / (d + 2) * (1 + (d + 1) * _power(rest / length, d + 2))


def _neo_hookean_energy(k: Floats, rest: Floats, length: Floats, d: int) -> Floats:
    """Return k L^2 / (d + 2) (s^2 / 2 + s^-d / d - 1/2 - 1/d), s = l / L [J].

    It is evaluated as k/2 (l - L)^2 / (d + 2) (1 + 2/d sum_j j s^-(d+1-j)), j = 1 to d, which has no cancellation.
    """
    inverse = rest / length
    series = np.ones_like(inverse)
    for j in range(2, d + 1):  # Horner's rule in 1 / s
        series = j + inverse * series
    return k / 2 * (length - rest) ** 2 / (d + 2) * (1 + 2 / d * inverse * series)


#: Force laws of springs by name.
PAIR_LAWS: MappingProxyType[str, PairLaw] = MappingProxyType(
    {
        STRAIGHT: PairLaw(
            lambda k, rest, length, d: k * (length - rest),
            lambda k, rest, length, d: k,
            lambda k, rest, length, d: k * (length - rest) * (length - rest) / 2,
            "k (l - L)",
            linear=True,
            # The member of the family whose element matrix is nearest to that of the hexahedron.
            k_body=1 / 12,
            compiled=_straight_loops,
        ),
        "neo-hookean": PairLaw(
            _neo_hookean_tension,
            _neo_hookean_stiffness,
            _neo_hookean_energy,
            "k L (s - s^-(d+1)) / (d + 2)",
            linear=False,
            # Lebedev's rule of 26 points: directions isotropic up to the sixth order.
            k_body=9 / 70,
        ),
    }
)
