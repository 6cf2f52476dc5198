"""A motion in which nothing happens, to time its steps."""

from dataclasses import replace
from typing import Any

from truespring.dynamics import Dynamics
from truespring.problem import Problem


def resting(problem: Problem) -> Problem:
    """Return a problem as a motion from rest: loads and supports are the same, but their shares are zero."""
    dynamics = replace(problem.dynamics or Dynamics(1.0), start="rest", velocity=None)
    loads, supports = map(_at_rest, problem.loads), map(_at_rest, problem.supports)
    return replace(problem, loads=list(loads), supports=list(supports), dynamics=dynamics)


def _at_rest(part: Any) -> Any:
    """Return a load or support without effect."""
    places = [0.0] if part.over is None else [place for place, _ in part.over]
    return replace(part, over=[[place, 0.0] for place in places])
