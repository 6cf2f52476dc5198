"""The neo-Hookean law of CalculiX and Abaqus, and the equilibrium of springs if they had it.

Source: Abaqus Theory Manual, "Hyperelastic material behavior"; CalculiX CrunchiX User's Manual, *HYPERELASTIC.
"""

from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.equilibrium import Solution, State, solve
from truespring.errors import TruespringError
from truespring.models.gaussian_rule import with_law, with_law_at_points
from truespring.models.invariants import Derivatives, by_invariants, isochoric
from truespring.models.law import Constants, Law
from truespring.models.rubber import neo_hookean
from truespring.remembering import remembered
from truespring.solvers import Newton

# Number of halvings of an interval of stretches.
_HALVINGS = 60


def split_neo_hookean(I1: Floats, y: Floats, constants: Constants) -> Derivatives:
    """Return the derivatives of W = C10 (I1 J^(-2/3) - 3) + (J - 1)^2 / D1 with C10 = mu/2 and D1 = 2 / bulk.

    At small strain it is the neo-Hookean law of the springs, mu/2 (I1 - 3) - mu ln J + lam/2 (ln J)^2.
    """
    mu, bulk, J = constants.mu, constants.bulk, np.exp(y)

    def psi(I1b: Floats) -> tuple[Floats, Floats, Floats]:
        return np.asarray(mu / 2 * (I1b - 3)), np.asarray(mu / 2 + 0 * I1b), np.zeros_like(I1b)

    shape = isochoric(I1, y, psi, 0.0)
    return Derivatives(
        shape.energy + bulk / 2 * (J - 1) ** 2,
        shape.by_trace,
        shape.by_y + bulk * J * (J - 1),
        shape.by_trace_trace,
        shape.by_trace_y,
        shape.by_y_y + bulk * J * (2 * J - 1),
    )


def split_density(stretch: Any, constants: Constants) -> Any:
    """Return the energy density of the law in principal stretches [J/m^3]."""
    J = stretch.prod()
    shape = (stretch**2).sum() / J ** (2 / 3) - 3
    return constants.mu / 2 * shape + constants.bulk / 2 * (J - 1) ** 2


#: The neo-Hookean law of CalculiX and Abaqus.
SPLIT = Law(
    by_invariants(split_neo_hookean),
    split_density,
    "neo-Hookean, volume split off",
    "Abaqus Theory Manual, Hyperelastic material behavior",
    finite=True,
    barrier=True,
    quadratic=False,
    trace=None,
    current=by_invariants(split_neo_hookean, current=True),
    invariants=split_neo_hookean,
)


def stress_difference(lam: float, mu: float, stretch: float) -> float:
    """Return the relative difference of the stress of a stretched bar by SPLIT from that by the neo-Hookean law."""
    constants = Constants(lam, mu, plane_stress=False)
    ours, theirs = (_pulled(law, constants, stretch) for law in (neo_hookean, split_neo_hookean))
    return theirs / ours - 1


def _pulled(law: Any, constants: Constants, stretch: float) -> float:
    """Return the force of a bar over its undeformed section [Pa]; its sides are free."""
    low, high = 0.1, 10.0  # stretch across
    for _ in range(_HALVINGS):
        across = float(np.sqrt(low * high))
        found = law(np.array(stretch**2 + 2 * across**2), np.array(np.log(stretch * across**2)), constants)
        if 2 * found.by_trace * across**2 + found.by_y > 0:
            high = across
        else:
            low = across
    return float((2 * found.by_trace * stretch**2 + found.by_y) / stretch)


@remembered
def split_state(path: Solution, load_steps: int, at_points: bool) -> State | None:
    """Return the equilibrium at full load of the Gaussian springs of a solution with the law SPLIT, None if not found.

    With `at_points`, and if they are of second order, finite elements with the law at every Gauss point.
    """
    try:
        potential = with_law_at_points(path.potential, SPLIT) if at_points else with_law(path.potential, SPLIT)
        found = solve(path.problem, potential, Newton(load_steps=load_steps))
    except TruespringError:
        return None
    state = found.at(1.0)
    return state if state is not None and state.load_factor == 1.0 else None
