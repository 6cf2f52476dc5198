"""Laws of rubber and soft tissue as functions of the trace of C and of the volume ratio.

The shear modulus at small strain is that of the material, mu; the volume function is bulk/2 (ln J)^2.
"""

import numpy as np

from truespring.arrays import Floats
from truespring.models.constants import Constants
from truespring.models.invariants import Derivatives, isochoric

# Coefficients of the series of Arruda and Boyce, of (I1b^i - 3^i) / locking_stretch^(2 i - 2).
_SERIES = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)


def neo_hookean(I1: Floats, y: Floats, constants: Constants) -> Derivatives:
    """Return the derivatives of W = mu/2 (I1 - 3) - mu ln J + lam/2 (ln J)^2 (Simo and Pister 1984)."""
    lam, mu, zero = constants.lam, constants.mu, np.zeros(())
    energy = mu / 2 * (I1 - 3) - mu * y + lam / 2 * y**2
    return Derivatives(energy, np.asarray(mu / 2), lam * y - mu, zero, zero, np.asarray(lam))


def yeoh(I1: Floats, y: Floats, constants: Constants) -> Derivatives:
    """Return the derivatives of psi = mu/2 x + c20 x^2 + c30 x^3 with x = I1b - 3 (Yeoh 1993)."""
    mu, c20, c30 = constants.mu, constants["c20"], constants["c30"]

    def psi(I1b: Floats) -> tuple[Floats, Floats, Floats]:
        x = I1b - 3
        return (
            np.asarray(mu / 2 * x + c20 * x**2 + c30 * x**3),
            np.asarray(mu / 2 + 2 * c20 * x + 3 * c30 * x**2),
            np.asarray(2 * c20 + 6 * c30 * x),
        )

    return isochoric(I1, y, psi, constants.bulk)


def gent(I1: Floats, y: Floats, constants: Constants) -> Derivatives:
    """Return the derivatives of psi = -mu jm/2 ln(1 - (I1b - 3) / jm) (Gent 1996); NaN where I1b - 3 >= jm."""
    mu, jm = constants.mu, constants["jm"]

    def psi(I1b: Floats) -> tuple[Floats, Floats, Floats]:
        left = 1 - (I1b - 3) / jm
        left = np.where(left > 0, left, np.nan)
        return np.asarray(-mu * jm / 2 * np.log(left)), np.asarray(mu / 2 / left), np.asarray(mu / 2 / jm / left**2)

    return isochoric(I1, y, psi, constants.bulk)


def arruda_boyce(I1: Floats, y: Floats, constants: Constants) -> Derivatives:
    """Return the derivatives of the eight-chain law, its inverse Langevin function as a series of five terms.

    psi = m sum c_i (I1b^i - 3^i) / locking_stretch^(2 i - 2) (Arruda and Boyce 1993), m such that the shear modulus at
    small strain is mu.
    """
    stretch = np.asarray(constants["locking_stretch"])
    terms = [(i, c / stretch ** (2 * i - 2)) for i, c in enumerate(_SERIES, start=1)]
    m = constants.mu / sum(2 * i * c * 3 ** (i - 1) for i, c in terms)

    def psi(I1b: Floats) -> tuple[Floats, Floats, Floats]:
        return (
            np.asarray(sum(m * c * (I1b**i - 3**i) for i, c in terms)),
            np.asarray(sum(m * c * i * I1b ** (i - 1) for i, c in terms)),
            np.asarray(sum(m * c * i * (i - 1) * I1b ** (i - 2) for i, c in terms if i > 1)),
        )

    return isochoric(I1, y, psi, constants.bulk)
