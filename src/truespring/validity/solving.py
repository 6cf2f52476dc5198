"""What is solved for a map: a path to the whole load, and one to a small share of it, where theory is linear."""

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

#: The share of the load at which a body answers as linear theory has it, to this share itself.
SMALL = 0.01

# Iterations for one level, and how often a step is halved where they are not enough: a map need not know to a hair
# where a path ends.
_ITERATIONS, _CUTBACKS = 20, 3


class _UpToTheEnd(Newton):
    """Newton's method that goes no further than a body goes by itself: not along a branch that it has to choose."""

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
    """A model of a problem, and in how many steps its path is taken: what travels to a worker."""

    problem: Problem
    model: Model
    steps: int


@dataclass(frozen=True, eq=False, slots=True)
class Solved:
    """The path of a task, and that to the share SMALL of its load; `seconds` are of both."""

    path: Solution
    small: Solution
    seconds: float

    @property
    def states(self) -> tuple[State, ...]:
        """The loaded states that may be trusted: the small one first, and no further than a body would go."""
        first = self.small.at(1.0)
        found = [] if first is None else [first]
        for state in self.path.states:
            if state.negative_eigenvalues or state.branched or not (state.area_ratio > 0 or self.path.finite is False):
                break
            found += [state] if state.loaded else []
        return tuple(found)

    @property
    def levels(self) -> Floats:
        """The load level of each of `states`, shape (n_states,)."""
        levels = np.array([state.level for state in self.states], dtype=np.float64)
        levels[:1] *= SMALL
        return levels

    @property
    def end(self) -> str:
        """Why the path ends before the whole load, empty where it does not."""
        states = self.states
        if states and states[-1].level == 1.0 and len(states) > 1:
            return ""
        if any(state.branched for state in self.path.states):
            return "buckling"  # to which side is arbitrary: there is nothing to compare
        status = str(self.path.status)
        return "not converged" if status == "converged" else status.replace("-", " ")


def run_task(task: Task) -> Solved:
    """Solve a task."""
    started = time.perf_counter()
    small = solve(task.problem.scaled(SMALL), task.model, Newton(load_steps=1))
    path = solve(task.problem, task.model, _UpToTheEnd(task.steps, max_iterations=_ITERATIONS, max_cutbacks=_CUTBACKS))
    return Solved(_alone(path), _alone(small), time.perf_counter() - started)


def _alone(path: Solution) -> Solution:
    """The path without what it was solved with, which is large."""
    grid = path.whole if isinstance(path.potential, Refined) else None
    return replace(path, potential=None, grid=grid, best=None)


def conjugate_force(path: Solution, states: tuple[State, ...], levels: Floats) -> Floats:
    """Return the force that supports do work with as the level rises, at each state [N m], shape (n_states,).

    The reactions times the derivative of the prescribed motion by the level: of a turn its moment times the angle.
    """
    motion: Callable[[float], Any] = path.problem.loading.motion
    found = []
    for state, level in zip(states, levels, strict=True):
        step = 1e-5
        slope = (motion(float(level) + step) - motion(float(level) - step)) / (2 * step)
        found.append(float((state.reaction * slope).sum()))
    return np.array(found)
