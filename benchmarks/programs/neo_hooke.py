"""Plane stress of the neo-Hookean law W = mu/2 (tr C - 3) - mu ln J + lam/2 (ln J)^2, for peers that have none."""

import numpy as np
from scipy.special import wrightomega


def settled(J, lam: float, mu: float):
    """Return ln J in three dimensions and the lam of the tangent [Pa], from the J of the plane.

    Free of stress across, mu (C_33 - 1) + lam ln J = 0: with h = lam / (2 mu) and w = C_33 / h, this reads
    w + ln w = 1 / h - 2 ln J_plane - ln h. Eliminated, C_33 turns lam into lam 2 mu C_33 / (2 mu C_33 + lam).
    """
    half = lam / (2 * mu)
    C_33 = half * wrightomega(1 / half - 2 * np.log(J) - np.log(half))
    return np.log(J) + np.log(C_33) / 2, lam * 2 * mu * C_33 / (2 * mu * C_33 + lam)
