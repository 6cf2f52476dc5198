"""A constitutive law: mu/2 (I1 - 3) - mu ln J + lam/4 (J^2 - 1 - 2 ln J) (Ciarlet and Geymonat 1982, without I2)."""

from typing import Any

import numpy as np

from truespring.models.constants import Constants
from truespring.models.invariants import Derivatives, by_invariants
from truespring.models.law import Law


def ciarlet(I1: np.ndarray, y: np.ndarray, constants: Constants) -> Derivatives:
    """Return the derivatives by I1 and y = ln J."""
    lam, mu, square, zero = constants.lam, constants.mu, np.exp(2 * y), np.zeros(())
    energy = mu / 2 * (I1 - 3) - mu * y + lam / 4 * (square - 1 - 2 * y)
    return Derivatives(energy, np.asarray(mu / 2), lam / 2 * (square - 1) - mu, zero, zero, lam * square)


def density(stretch: Any, constants: Constants) -> Any:
    """Return the energy density of three principal stretches [J/m^3], for the tests."""
    J = stretch.prod()
    shape = constants.mu * (((stretch**2).sum() - 3) / 2 - np.log(J))
    return shape + constants.lam / 4 * (J**2 - 1 - 2 * np.log(J))


CIARLET = Law(
    by_invariants(ciarlet),
    density,
    "Ciarlet",
    "Ciarlet and Geymonat 1982",
    finite=True,
    barrier=True,
    quadratic=False,
    trace=None,
    current=by_invariants(ciarlet, current=True),
    invariants=ciarlet,
    constant_springs=True,
)
