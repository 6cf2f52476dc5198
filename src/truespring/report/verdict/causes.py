"""The cause of the distance to nonlinear FEM: stiffness, or the response to large strain."""

import numpy as np

from truespring.equilibrium import Solution
from truespring.report.quantity import percent
from truespring.report.result import Result
from truespring.report.verdict.naming import display_name

# Below this rms error no cause is given.
_NO_CAUSE = 0.005
# Relative difference of moduli, and difference of Poisson's ratios, that count as rounding.
_EXACT = 1e-6


def cause_sentence(result: Result) -> str | None:
    """Return whether the distance to the nearest nonlinear FEM grows with the load or exists from the first level.

    A distance at the first level is one of stiffness: moduli, bending, elements. A distance that grows is one of the
    response of springs and law to large strain. None without nonlinear FEM, without springs, where the two agree, with
    tools, and where the load does not only grow.
    """
    nonlinear = {
        name: one
        for name, one in result.comparisons.items()
        if one.reference.element is not None
        and one.reference.finite
        and one.load_factors.size > 1
        and not one.over_the_way
        and one.rms_errors[-1] > _NO_CAUSE
    }
    if not nonlinear or result.model is None or not result.solutions[result.model].has_springs:
        return None
    if result.problem.touching:  # the area of contact grows, too
        return None
    name = min(nonlinear, key=lambda one: float(nonlinear[one].rms_errors[-1]))
    levels, errors = nonlinear[name].load_factors, nonlinear[name].rms_errors
    first, last = percent(float(errors[0])), percent(float(errors[-1]))
    what = (
        f"The distance to {display_name(result, name)} is {first} at load factor {levels[0]:.4g} and {last} at the last"
    )
    if errors[-1] > 2 * errors[0]:
        return f"{what}: most of it arises at large strain, to which springs and law respond differently."
    if errors[0] > 2 * errors[-1]:
        return f"{what}: the springs' stiffness is off from the start, and large strain hides it."
    where = "bending stiffness" if _exact(result.solutions[result.model]) else "moduli and bending stiffness"
    return f"{what}: most of it is there from the start, in the springs' {where} on this mesh."


def _exact(path: Solution) -> bool:
    """Return whether the effective moduli of springs are those of the material."""
    moduli = path.moduli
    if moduli is None:
        return False
    young, poisson = moduli.material_young, moduli.material_poisson
    return np.allclose(moduli.young_range, young, rtol=_EXACT) and np.allclose(
        moduli.poisson_range, poisson, atol=_EXACT
    )
