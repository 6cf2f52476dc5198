"""The scheme, the time steps and the recorded times of a motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.dynamics import Dynamics
from truespring.errors import ProblemError
from truespring.motion.explicit import SAFE, stable_step
from truespring.motion.moving import Body

# Number of recorded states by default.
_RECORDS = 100
#: Times closer than this share of the duration are equal.
SAME = 1e-9
# "auto" takes leapfrog if that needs at most so many times the steps of an implicit scheme, and so many steps of an
# implicit scheme are expected if the step is not given.
_CHEAPER, _EXPECTED = 20.0, 200


@dataclass(frozen=True)
class Plan:
    """The scheme and the times of a motion.

    Attributes:
        scheme: name of the scheme.
        step: time step [s]; None if chosen step by step.
        goals: times that steps end at, ascending [s].
        recorded: numbers of those that are recorded.
        note: why the scheme was chosen, else empty.
    """

    scheme: str
    step: float | None
    goals: Sequence[float]
    recorded: frozenset[int]
    note: str = ""


def planned(body: Body, dynamics: Dynamics, crossing: float | None = None) -> Plan:
    """Return the scheme and the times of a motion.

    `crossing` [s] is the time in which a wave crosses an element, by which "auto" chooses the same scheme for all
    models of a problem; None to choose by the stable step.

    Raises ProblemError for leapfrog with a step that is not stable, and for a fixed number of iterations with it.
    """
    scheme, note, step = dynamics.scheme, "", dynamics.step
    if scheme in ("auto", "leapfrog"):
        stable = stable_step(body)
        safe = SAFE * stable
        if scheme == "auto":
            scheme, note = _chosen(dynamics, stable, _typical(body, stable if crossing is None else crossing))
        if scheme == "leapfrog":
            if dynamics.iterations:
                raise ProblemError("leapfrog has no iterations: leave iterations out, or choose an implicit scheme")
            if not stable:
                raise ProblemError(
                    'leapfrog has no stable step with a barrier: use euler, bdf2 or midpoint, or contact = "penalty"'
                )
            if isinstance(step, int | float) and step > stable and dynamics.scheme == "leapfrog":
                raise ProblemError(
                    f"step = {step:g} s is not stable with leapfrog: the largest stable step at rest is {stable:.3g} "
                    "s; take at most half of it, or an implicit scheme (bdf2)"
                )
            step = min(step, safe) if isinstance(step, int | float) and dynamics.scheme == "auto" else step
            step = safe if step == "auto" else step
    fixed = float(step) if isinstance(step, int | float) else None
    return Plan(scheme, fixed, *_times(body, dynamics, fixed), note)


def _typical(body: Body, crossing: float) -> float:
    """Return the stable step of a problem [s] from the time in which a wave crosses an element, for all its models.

    It is shortened by dashpots as in `stable_step`, and by the stiffness of contacts on the masses of their nodes.
    """
    xi = body.damping.stiffness / crossing if crossing else 0.0
    typical = crossing * (np.sqrt(1 + xi**2) - xi)
    stiffest = float((body.loading.largest_stiffness() / body.mass).max())
    return float(min(typical, 2 / np.sqrt(stiffest))) if stiffest else float(typical)


def _chosen(dynamics: Dynamics, stable: float, crossing: float) -> tuple[str, str]:
    """Return the scheme that costs less, by a time that the stable step is about as long as [s]; and why."""
    implicit = dynamics.step if isinstance(dynamics.step, int | float) else dynamics.duration / _EXPECTED
    ratio = implicit / (SAFE * crossing) if stable else np.inf
    if dynamics.iterations or ratio > _CHEAPER:
        why = f"about {ratio:.2g} explicit steps each"
        if dynamics.iterations or not stable:
            why = "a fixed number of iterations is asked" if dynamics.iterations else "a barrier has no stable step"
        return "bdf2", f"scheme bdf2: {why} (the largest stable step of leapfrog is {stable:.3g} s)"
    return "leapfrog", f"scheme leapfrog: its largest stable step is {stable:.3g} s, half of it is taken"


def _times(body: Body, dynamics: Dynamics, step: float | None) -> tuple[Sequence[float], frozenset[int]]:
    """Return the times that steps end at [s], and the numbers of those that are recorded.

    Steps are shortened so that a whole number of them ends at each recorded time: models are compared at these.
    """
    interval, n_recorded = _recorded(dynamics)
    each = 1 if step is None else max(1, int(np.ceil(interval / step - SAME))) * dynamics.substeps
    n = n_recorded * each
    regular = [dynamics.duration * (k + 1) / n for k in range(n)]
    recorded = set(regular[each - 1 :: each])
    corners = [dynamics.duration * one for one in _corners(body, dynamics)]
    near = np.array([0.0, *regular, np.inf])
    others = [one for one in corners if _distance(near, one) > SAME * dynamics.duration]
    goals = sorted([*regular, *others])
    return goals, frozenset(number for number, goal in enumerate(goals) if goal in recorded)


def _distance(times: Floats, time: float) -> float:
    """Return the distance of a time from the nearest of others [s], ascending, shape (n,), from 0 to infinity."""
    after = int(np.searchsorted(times, time))
    return float(min(times[after] - time, time - times[max(after - 1, 0)]))


def _corners(body: Body, dynamics: Dynamics) -> tuple[float, ...]:
    """Return the levels at which steps end, too: a load that is shorter than a step must not be missed.

    A path, which may be drawn by hand in many rows, shortens automatic steps only, and nothing shortens those of a
    fixed number of iterations.
    """
    if dynamics.step == "auto":
        return body.loading.corners
    return () if dynamics.iterations else body.loading.history_corners


def _recorded(dynamics: Dynamics) -> tuple[float, int]:
    """Return the interval between recorded times [s], and their number.

    By default about _RECORDS, a whole number of steps each if the step is given.
    """
    duration, interval = dynamics.duration, dynamics.record
    if interval is None:
        interval = duration / _RECORDS
        if isinstance(dynamics.step, int | float):
            each = duration / int(np.ceil(duration / dynamics.step - SAME))
            interval = each * max(1, round(interval / each))
    n = max(1, int(np.ceil(duration / interval - SAME)))
    return duration / n, n
