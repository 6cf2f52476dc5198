"""Laws as functions of the logarithmic principal stretches: Hencky, Ogden and Mooney-Rivlin."""

from collections.abc import Mapping, Sequence

import numpy as np

from truespring.arrays import Floats
from truespring.material import Lame
from truespring.models.constants import Constants
from truespring.models.stretches import StretchDerivatives, isochoric

_Number = float | Floats


def hencky(e: Floats, constants: Constants) -> StretchDerivatives:
    """Return the derivatives of W = mu sum e_i^2 + lam/2 (ln J)^2 (Hencky 1928)."""
    lam, mu = constants.lam, constants.mu
    y = e.sum(axis=0)
    second = np.empty((3, *e.shape))
    second[:] = lam
    for i in range(3):
        second[i, i] += 2 * mu
    return StretchDerivatives(np.asarray(mu * (e**2).sum(axis=0) + lam / 2 * y**2), 2 * mu * e + lam * y, second)


def ogden(e: Floats, constants: Constants) -> StretchDerivatives:
    """Return the derivatives of sum 2 mu_i / alpha_i^2 (sum of stretch^alpha_i - 3) (Ogden 1972).

    The stretches are those without dilatation; mu_1 = mu - mu2 - mu3. An exponent 0 is a term that is left out.
    """
    mu2, mu3 = constants["mu2"], constants["mu3"]
    terms = [(constants.mu - mu2 - mu3, "alpha1"), (mu2, "alpha2"), (mu3, "alpha3")]
    return _of_terms(e, [(mu, constants[alpha]) for mu, alpha in terms], constants)


def mooney_rivlin(e: Floats, constants: Constants) -> StretchDerivatives:
    """Return the derivatives of (mu/2 - c01) (I1b - 3) + c01 (I2b - 3) (Mooney 1940; Rivlin 1948).

    I1b and I2b, the invariants of C without dilatation, are the sums of the stretches to the powers 2 and -2.
    """
    c01 = constants["c01"]
    return _of_terms(e, [(constants.mu - 2 * c01, 2.0), (2 * c01, -2.0)], constants)


def _of_terms(e: Floats, terms: Sequence[tuple[_Number, _Number]], constants: Constants) -> StretchDerivatives:
    """Return the derivatives of terms of Ogden's law, (mu_i, alpha_i) each; those with alpha_i = 0 are left out."""

    def psi(x: Floats) -> tuple[Floats, Floats, Floats]:
        energy, first, second = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
        for mu, exponent in terms:
            if not np.any(exponent):
                continue
            alpha = np.where(exponent == 0, 1.0, exponent)
            part = np.where(exponent == 0, 0.0, 2 * mu / alpha**2)
            grown = np.expm1(alpha * x)
            energy += part * grown
            first += part * alpha * grown
            second += part * alpha**2 * (grown + 1)
        return energy, first, second

    return isochoric(e, psi, constants.bulk)


def ogden_fault(lame: Lame, values: Mapping[str, float]) -> str:
    """Return what is impossible in the constants of Ogden's law [SI], or ""."""
    if values["alpha1"] == 0:
        return "alpha1 = 0: an exponent of Ogden's law must not be zero"
    for mu, alpha in (("mu2", "alpha2"), ("mu3", "alpha3")):
        if values[mu] and values[alpha] == 0:
            return f"{mu} = {values[mu]:g} Pa requires {alpha}, an exponent that is not zero"
        if values[alpha] and not values[mu]:
            return f"{alpha} = {values[alpha]:g} requires {mu} [Pa], the part of this term in the shear modulus"
    left = lame.mu - values["mu2"] - values["mu3"]
    if left <= 0:
        return (
            f"mu2 + mu3 = {values['mu2'] + values['mu3']:g} Pa leave {left:g} Pa of the shear modulus {lame.mu:g} Pa "
            "to the first term: they must be smaller than the shear modulus"
        )
    return ""


def mooney_rivlin_fault(lame: Lame, values: Mapping[str, float]) -> str:
    """Return what is impossible in the constant of the Mooney-Rivlin law [SI], or ""."""
    if values["c01"] <= lame.mu / 2:
        return ""
    return f"c01 = {values['c01']:g} Pa: it must be at most half of the shear modulus, {lame.mu / 2:g} Pa"
