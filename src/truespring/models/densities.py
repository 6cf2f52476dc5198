"""Energy densities of laws in principal stretches, real or complex, as their sources write them.

The tests compare the laws with them; nothing else uses them.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from truespring.models.constants import Constants


def small_density(stretch: Any, constants: Constants) -> Any:
    """Return the density of Hooke's law of the small strain [J/m^3]."""
    return _quadratic(stretch - 1, constants)


def green_density(stretch: Any, constants: Constants) -> Any:
    """Return the density of Hooke's law of the Green strain [J/m^3]."""
    return _quadratic((stretch**2 - 1) / 2, constants)


def hencky_density(stretch: Any, constants: Constants) -> Any:
    """Return mu sum e_i^2 + lam/2 (sum e_i)^2 of the logarithmic stretches e_i [J/m^3]."""
    return _quadratic(np.log(stretch), constants)


def _quadratic(strain: Any, constants: Constants) -> Any:
    """Return mu e : e + lam/2 (tr e)^2 of the three principal strains [J/m^3]."""
    return constants.mu * (strain**2).sum() + constants.lam / 2 * strain.sum() ** 2


def neo_hookean_density(stretch: Any, constants: Constants) -> Any:
    """Return mu/2 (tr C - 3) - mu ln J + lam/2 (ln J)^2 [J/m^3]."""
    log_J = np.log(stretch).sum()
    return constants.mu * (((stretch**2).sum() - 3) / 2 - log_J) + constants.lam / 2 * log_J**2


def _shape(psi: Callable[[Any], Any], stretch: Any, constants: Constants) -> Any:
    """Return psi(I1b) + bulk/2 (ln J)^2 of the principal stretches [J/m^3], I1b of the stretches over J^(1/3)."""
    J = stretch.prod()
    return psi((stretch**2).sum() / J ** (2 / 3)) + constants.bulk / 2 * np.log(J) ** 2


def yeoh_density(stretch: Any, constants: Constants) -> Any:
    """Return the sum of three powers of I1b - 3, and bulk/2 (ln J)^2 [J/m^3]."""
    c10, c20, c30 = constants.mu / 2, constants["c20"], constants["c30"]
    return _shape(lambda trace: c10 * (trace - 3) + c20 * (trace - 3) ** 2 + c30 * (trace - 3) ** 3, stretch, constants)


def gent_density(stretch: Any, constants: Constants) -> Any:
    """Return -mu jm/2 ln((jm - I1b + 3) / jm) + bulk/2 (ln J)^2 [J/m^3]."""
    jm = constants["jm"]
    return _shape(lambda trace: -constants.mu * jm / 2 * np.log((jm - trace + 3) / jm), stretch, constants)


def arruda_boyce_density(stretch: Any, constants: Constants) -> Any:
    """Return the series of Arruda and Boyce in I1b, and bulk/2 (ln J)^2 [J/m^3]."""
    N = constants["locking_stretch"] ** 2
    m = constants.mu / (1 + 3 / (5 * N) + 99 / (175 * N**2) + 513 / (875 * N**3) + 42039 / (67375 * N**4))

    def psi(trace: Any) -> Any:
        return m * (
            (trace - 3) / 2
            + (trace**2 - 9) / (20 * N)
            + 11 * (trace**3 - 27) / (1050 * N**2)
            + 19 * (trace**4 - 81) / (7000 * N**3)
            + 519 * (trace**5 - 243) / (673750 * N**4)
        )

    return _shape(psi, stretch, constants)


def mooney_rivlin_density(stretch: Any, constants: Constants) -> Any:
    """Return C10 (I1b - 3) + C01 (I2b - 3) + bulk/2 (ln J)^2 [J/m^3]."""
    J, squares, c01 = stretch.prod(), stretch**2, constants["c01"]
    I1b = squares.sum() / J ** (2 / 3)
    I2b = (squares.sum() ** 2 - (squares**2).sum()) / 2 / J ** (4 / 3)
    return (constants.mu / 2 - c01) * (I1b - 3) + c01 * (I2b - 3) + constants.bulk / 2 * np.log(J) ** 2


def ogden_density(stretch: Any, constants: Constants) -> Any:
    """Return sum 2 mu_i / alpha_i^2 (sum of stretch^alpha_i - 3) without dilatation + bulk/2 (ln J)^2 [J/m^3]."""
    J = stretch.prod()
    shape, first = stretch / J ** (1 / 3), constants.mu - constants["mu2"] - constants["mu3"]
    parts = ((first, constants["alpha1"]), *((constants[f"mu{i}"], constants[f"alpha{i}"]) for i in (2, 3)))
    energy = sum(2 * mu / alpha**2 * ((shape**alpha).sum() - 3) for mu, alpha in parts)
    return energy + constants.bulk / 2 * np.log(J) ** 2
