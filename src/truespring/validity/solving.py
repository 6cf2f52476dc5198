"""The solutions of a map: a path to full load, and one under a small load in the linear range."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.conditions import Loading, Refined
from truespring.equilibrium import Solution, State, solve
from truespring.models import Model
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.solvers import Equilibrium, Geometry, Newton, Reporter

#: Share of the load in the linear range; the deviation from linear theory is about this share.
SMALL = 0.01

# Largest number of iterations of a level, and of halvings of a step; the end of a path need not be accurate.
_ITERATIONS, _CUTBACKS = 20, 3


class _UpToTheEnd(Newton):
    """Newton's method that ends at the first bifurcation or instability."""

    __slots__ = ()

    def follow(
        self,
        potential: Potential,
        loading: Loading,
        report: Reporter | None = None,
        geometry: Geometry | None = None,
    ) -> Iterator[Equilibrium]:
        """Yield the equilibria in order, the last one where the body buckles or is unstable."""
        for found in Newton.follow(self, potential, loading, report, geometry):
            yield found
            if found.branched or found.negative_eigenvalues:
                return


@dataclass(frozen=True, eq=False, slots=True)
class Task:
    """A model of a problem, with the number of load steps; it is pickled to a worker."""

    problem: Problem
    model: Model
    steps: int


@dataclass(frozen=True, eq=False, slots=True)
class Solved:
    """The path of a task, and that under SMALL times its load; `seconds` is the time of both."""

    path: Solution
    small: Solution
    seconds: float

    @property
    def states(self) -> tuple[State, ...]:
        """The loaded states that are stable and not inverted; the small one first."""
        first = self.small.at(1.0)
        found = [] if first is None else [first]
        for state in self.path.states:
            if state.negative_eigenvalues or state.branched or not (state.area_ratio > 0 or self.path.finite is False):
                break
            found += [state] if state.loaded else []
        return tuple(found)

    @property
    def levels(self) -> Floats:
        """The load level of each of `states` [-], shape (n_states,)."""
        levels = np.array([state.level for state in self.states], dtype=np.float64)
        levels[:1] *= SMALL
        return levels

    @property
    def end(self) -> str:
        """Why the path ends before full load; empty if it does not."""
        states = self.states
        if states and states[-1].level == 1.0 and len(states) > 1:
            return ""
        if any(state.branched for state in self.path.states):
            return "buckling"  # the side of the branch is arbitrary and cannot be compared
        status = str(self.path.status)
        return "not converged" if status == "converged" else status.replace("-", " ")


def run_task(task: Task) -> Solved:
    """Return the solution of a task."""
    started = time.perf_counter()
    small = solve(task.problem.scaled(SMALL), task.model, Newton(load_steps=1))
    path = solve(task.problem, task.model, _UpToTheEnd(task.steps, max_iterations=_ITERATIONS, max_cutbacks=_CUTBACKS))
    return Solved(_alone(path), _alone(small), time.perf_counter() - started)


def _alone(path: Solution) -> Solution:
    """Return the path without its potential, which is large."""
    grid = path.whole if isinstance(path.potential, Refined) else None
    return replace(path, potential=None, grid=grid, best=None)


def conjugate_force(path: Solution, states: tuple[State, ...], levels: Floats) -> Floats:
    """Return the force that is work conjugate to the load level, at each state [N m], shape (n_states,).

    It is the reactions times the derivative of the prescribed motion by the level; for a rotation, moment times angle.
    """
    motion: Callable[[float], Any] = path.problem.loading.motion
    found = []
    for state, level in zip(states, levels, strict=True):
        step = 1e-5
        slope = (motion(float(level) + step) - motion(float(level) - step)) / (2 * step)
        found.append(float((state.reaction * slope).sum()))
    return np.array(found)
