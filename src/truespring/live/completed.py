"""What a study leaves open that a session needs: density, and how the body begins."""

from dataclasses import replace

import numpy as np

from truespring.dynamics import Damping, Dynamics
from truespring.loading import Fixed
from truespring.material import WATER
from truespring.problem import Problem

#: Damping by mass of a body without dynamics [1/s]: its slow motion ceases within a second or two.
DAMPING = 4.0


def completed(problem: Problem) -> tuple[Problem, tuple[str, ...]]:
    """Return a problem with density and dynamics, and what was assumed, in sentences."""
    notes = []
    if problem.material is not None and any(one.density is None for one in problem.materials):
        notes.append(f"no density is given: that of water, {WATER:g} kg/m^3, is taken")
        problem = problem.dense
    if problem.dynamics is None:
        notes.append(
            f"no dynamics are given: the body begins at its equilibrium, with damping by mass of {DAMPING:g} 1/s"
        )
        supports = [_moved_at_once(one) for one in problem.supports]
        dynamics = Dynamics(1.0, damping=Damping(mass=DAMPING), start="equilibrium")
        problem = replace(problem, supports=supports, dynamics=dynamics)
    return problem, tuple(notes)


def _moved_at_once(support: Fixed) -> Fixed:
    """Return a support that is at its full motion from the begin, where the body has its equilibrium."""
    if support.over is not None or not (support.rotation or np.any(support.displacement or 0.0)):
        return support
    return replace(support, over=((0.0, 1.0),))
