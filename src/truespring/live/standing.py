"""Problems with loads and supports that stand still: at the end of their way as the begin of a motion, or at none."""

from dataclasses import replace
from typing import Any

from truespring.dynamics import Dynamics
from truespring.problem import Problem


def standing(problem: Problem) -> Problem:
    """Return a problem of an equilibrium as one of a motion that begins there, under the full loads and motions."""
    loads = [_at_end(one) if one.over is not None else one for one in problem.loads]
    supports = [_at_end(one) for one in problem.supports]
    return replace(problem, loads=loads, supports=supports, dynamics=Dynamics(1.0, start="equilibrium"))


def resting(problem: Problem) -> Problem:
    """Return a problem as a motion from rest: loads and supports are the same, but their shares are zero."""
    dynamics = replace(problem.dynamics or Dynamics(1.0), start="rest", velocity=None)
    loads, supports = map(_at_rest, problem.loads), map(_at_rest, problem.supports)
    return replace(problem, loads=list(loads), supports=list(supports), dynamics=dynamics)


def _at_end(part: Any) -> Any:
    """Return a load or support with its share at the end of the way as its only one."""
    share = 1.0 if part.over is None else part.over[-1][1]
    return replace(part, over=[[0.0, share]])


def _at_rest(part: Any) -> Any:
    """Return a load or support without effect."""
    places = [0.0] if part.over is None else [place for place, _ in part.over]
    return replace(part, over=[[place, 0.0] for place in places])
