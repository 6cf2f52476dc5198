"""Fit springs to displacements and forces, full fields or not, through their equilibria."""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.calibration.objective import Objective

#: Largest number of unknowns for the Gauss-Newton method, which computes the sensitivity to each.
GAUSS_NEWTON = 300

# Relative changes of unknowns and of the objective at which the search ends; the latter changes an error of 1 % by
# 1/2000 of it.
_SETTLED, _GAIN = 1e-3, 1e-3


class Fit(NamedTuple):
    """Fitted unknowns, shape (n,), the objective there, and the method."""

    values: Floats
    objective: float
    method: str


def fit_equilibria(objective: Objective, start: Floats, evaluations: int) -> Fit:
    """Minimise the objective over unknowns c >= 0 from `start`, shape (n,), with at most `evaluations` evaluations.

    Few unknowns are fitted by Gauss-Newton in a trust region (Branch, Coleman, Li 1999), many by L-BFGS-B (Byrd et al.
    1995) with the adjoint gradient. A step without an equilibrium is reduced.
    """
    from scipy.optimize import Bounds, least_squares, minimize

    if len(start) <= GAUSS_NEWTON:
        found = least_squares(
            objective.residuals,
            start,
            jac=objective.jacobian,
            bounds=(0.0, np.inf),
            xtol=_SETTLED,
            ftol=_GAIN,
            gtol=1e-12,
            max_nfev=evaluations,
        )
        values, method = np.asarray(found.x), "Gauss-Newton"
    else:
        largest = objective.value(start) * 1e3

        def value(values: Floats) -> float:
            return min(objective.value(values), largest)

        def gradient(values: Floats) -> Floats:
            return objective.gradient(values) if objective.paths(values) is not None else np.zeros(len(values))

        searched = minimize(
            value,
            start,
            jac=gradient,
            method="L-BFGS-B",
            bounds=Bounds(0.0, np.inf),
            options={"maxfun": evaluations, "ftol": 1e-9, "gtol": 1e-12},
        )
        values, method = np.asarray(searched.x), "L-BFGS-B, adjoint gradient"
    return Fit(values, objective.value(values), method)
