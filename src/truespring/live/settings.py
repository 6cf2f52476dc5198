"""How a session takes its steps, and what it begins with."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from truespring.models import Model
from truespring.problem import Problem

#: Time between frames by default [s].
FRAME = 1 / 60
# A step may exceed the planned one by this share, a rounding error.
_SAME = 1e-9


@dataclass(frozen=True)
class Settings:
    """How a session takes its steps.

    Attributes:
        frame: time between frames [s]; commands act from one frame to the next.
        scheme: "auto", or a scheme of `Dynamics`.
        step: longest time step [s]; "auto" for what the scheme allows.
        iterations: Newton iterations of an implicit step; 0 solves it.
    """

    frame: float = FRAME
    scheme: str = "auto"
    step: float | str = "auto"
    iterations: int = 0


class Begun(NamedTuple):
    """What a session begins with, at first or after a restart.

    Attributes:
        problem: the completed problem, with changed material and damping.
        model: the model.
        gravity: the share of gravity [-].
        scheme: the scheme, a word of `Dynamics`.
        longest: the longest time step [s].
        start: "rest", or "equilibrium" if that was found.
    """

    problem: Problem
    model: Model
    gravity: float
    scheme: str
    longest: float
    start: str


def steps_in(frame: float, longest: float) -> int:
    """Return the number of steps of a frame [s] of at most a length [s]."""
    return max(1, int(np.ceil(frame / longest - _SAME)))
