"""The reference of a map: finite elements on finer and finer meshes, until they change by less than is asked."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from truespring.arrays import Floats
from truespring.comparison import compare
from truespring.converging.settling import Settling, settle
from truespring.errors import MeshError, StudyError
from truespring.richardson import observed_order, remaining_error
from truespring.validity.bodies import Body
from truespring.validity.loads import Course, LoadType
from truespring.validity.solving import Solved, Task, conjugate_force, run_task

#: What the reference may still be off, relative, in the plane and in space: a fifth, and half of the smallest line.
TOLERANCE = {2: 0.002, 3: 0.005}

# A mesh of more unknowns is not solved for a reference, in the plane and in space.
_MOST_UNKNOWNS = {2: 60_000, 3: 65_000}
# The order of convergence where none is shown: elements of second order have no higher one at clamps and corners.
_CAUTIOUS = 1.0
# Orders are shown where those of three meshes and of the three before differ by this share at most: there meshes are
# fine enough for the order to be that of all finer ones too. Higher ones than the second are not believed: what a
# corner makes may still be hidden, and comes to light last.
_ASYMPTOTIC, _HIGHEST = 0.25, 2.0
# The lowest order that is believed: a mesh that changes more than the one before may do anything.
_LOWEST = 0.3
# What Richardson's estimate is multiplied by: Roache's factor for three meshes.
_SAFETY = 1.25
# Loads are scaled until the reference reaches the size that is asked to this share of it; so often at most.
_NEAR, _MOST_TRIALS = 0.02, 8


@dataclass(frozen=True, eq=False, slots=True)
class Reference:
    """The converged path of the reference under one load type.

    Attributes:
        load, law, poisson: of what; None is the study's own Poisson's ratio.
        factor: the share of the load that reaches the size asked for.
        solved: the path on the finest mesh.
        sizes: the size of the load at each of its states, shape (n_states,).
        asked: the size asked for.
        error: what the finest mesh is off, relative, as estimated: the larger of the rms displacement and of what it
            does work with, by Richardson's extrapolation and Roache's factor, with the order that four meshes show or,
            where they show none, with a cautious one.
        order: the order of convergence of the displacement that four meshes show, None where they show none.
        changes: of the displacement from mesh to mesh, relative rms, the worst load level.
        n_nodes, elements: of each mesh; `elements` of the finest through the depth.
        settling: what the displacement along the load (of moved supports the force) does over the meshes.
        tolerance: the error that was asked for.
        solves: the paths that were solved for it; seconds: their wall time.
    """

    load: LoadType
    law: str
    poisson: float | None
    factor: float
    solved: Solved
    sizes: Floats
    asked: float
    error: float
    order: float | None
    changes: tuple[float, ...]
    n_nodes: tuple[int, ...]
    elements: int | None
    settling: Settling
    tolerance: float
    solves: int
    seconds: float

    @property
    def converged(self) -> bool:
        """Whether it is as near to the solution as was asked."""
        return self.error <= self.tolerance

    @property
    def reached(self) -> float:
        """The largest size that it reached."""
        return float(self.sizes[-1])

    @property
    def driven(self) -> bool:
        """Whether supports that move drive the body, not loads."""
        return self.solved.path.problem.loading.driven_by_motion

    @property
    def end(self) -> str:
        """Why it ends before the size that was asked for, empty where it does not."""
        return self.solved.end if self.reached < (1 - _NEAR) * self.asked else ""


def solve_reference(
    body: Body,
    load: LoadType,
    law: str,
    poisson: float | None = None,
    last: float | None = None,
    steps: int = 12,
) -> Reference:
    """Return the reference up to the size `last`, by default as far as the load goes, refined to TOLERANCE.

    Raises StudyError where it has no equilibrium even under a small load.
    """
    search, tolerance = _Search(body, load, law, poisson, steps), TOLERANCE[body.dim]
    asked = load.last if last is None else last
    factor, asked = search.factor(asked)
    meshes: list[Solved] = []
    values: list[float] = []
    changes: list[float] = []
    error, order = math.inf, None
    level = 0
    while True:
        try:
            solved = search.solve(factor, level)
        except MeshError:  # too large for this machine
            if not meshes:
                raise
            break
        if meshes:
            changes.append(_change(meshes[-1], solved, load))
        meshes.append(solved)
        values.append(_worked(solved, load))
        settling = _settling(law, load, meshes, values, tolerance)
        error, order = _estimate(changes, _steps(values))
        finer = 2**body.dim * solved.path.n_unknowns
        if (error <= tolerance and len(meshes) > 2) or (meshes[1:] and finer > _MOST_UNKNOWNS[body.dim]):
            break
        level += 1
    return Reference(
        load=load,
        law=law,
        poisson=poisson,
        factor=factor,
        solved=meshes[-1],
        sizes=search.sizes(meshes[-1]),
        asked=asked,
        error=error,
        order=order,
        changes=tuple(changes),
        n_nodes=tuple(one.path.problem.mesh.n_nodes for one in meshes),
        elements=None if body.shape is None else 2 ** (len(meshes) - 1) * (2 if body.dim == 2 else 1),
        settling=settling,
        tolerance=tolerance,
        solves=search.solves,
        seconds=search.seconds,
    )


class _Search:
    """Solves the reference on its meshes, and finds the load that reaches a size."""

    def __init__(self, body: Body, load: LoadType, law: str, poisson: float | None, steps: int) -> None:
        self.body, self.load, self.law, self.poisson, self.steps = body, load, law, poisson, steps
        self.solves, self.seconds = 0, 0.0

    def solve(self, factor: float, level: int) -> Solved:
        problem = self.body.reference_problem(self.load, factor, self.poisson, level)
        solved = run_task(Task(problem, self.body.reference_model(self.law), self.steps))
        self.solves, self.seconds = self.solves + 1, self.seconds + solved.seconds
        if not solved.states:
            what = "under the study's own load" if self.load.own else f"under {self.load.name}"
            raise StudyError(f"the reference {solved.path.label} has no equilibrium {what}, however small that is")
        return solved

    def sizes(self, solved: Solved) -> Floats:
        """The size at each state."""
        problem = solved.path.problem
        probe = self.body.probe_in(problem, self.load)
        if probe is None:
            moved = np.linalg.norm(solved.path.states[-1].displacement, axis=1)
            probe = int(moved.argmax())
        displacements = np.array([state.displacement for state in solved.states])
        return self.load.sizes(Course(problem, displacements, solved.levels, probe, self.body.extent))

    def factor(self, asked: float | None) -> tuple[float, float]:
        """The share of the load at which the reference reaches a size on a coarse mesh, and that size."""
        if asked is None:
            return 1.0, float(self.sizes(self.solve(1.0, 1))[-1])
        if self.load.moved:
            return asked, asked
        factor = 1.0 if self.load.own else asked
        for _ in range(_MOST_TRIALS):
            solved = self.solve(factor, 1)
            reached, levels = self.sizes(solved), solved.levels
            if reached[-1] >= asked * (1 - _NEAR / 4):
                level = float(np.interp(asked, [0.0, *reached], [0.0, *levels]))
                return factor * level, asked
            if solved.end:  # it goes no further
                return factor * float(levels[-1]), asked
            factor *= min(max(1.25, asked / float(reached[-1])), 3.0)
        return factor, asked


def _worked(solved: Solved, load: LoadType) -> float:
    """What the load does work with at the last state: the displacement along it, or the force of what is moved."""
    states, levels = solved.states, solved.levels
    loading = solved.path.problem.loading
    if loading.driven_by_motion:
        return float(conjugate_force(solved.path, states[-1:], levels[-1:])[0])
    force = loading.force(solved.path.problem.mesh.nodes)
    return float((force * states[-1].displacement).sum() / np.abs(force).sum())


def _settling(law: str, load: LoadType, meshes: list[Solved], values: list[float], tolerance: float) -> Settling:
    driven = meshes[-1].path.problem.loading.driven_by_motion
    quantity, unit = ("force of the motion", "N m") if driven else ("displacement along the load", "m")
    n_nodes = [one.path.problem.mesh.n_nodes for one in meshes]
    return settle(law, quantity, unit, n_nodes, values, tolerance)


def _change(coarse: Solved, fine: Solved, load: LoadType) -> float:
    """How far two meshes are apart: the largest relative rms distance of all load levels that both have."""
    met = [compare(one, other) for one, other in ((coarse.small, fine.small), (coarse.path, fine.path))]
    return max((float(error) for one in met for error in one.rms_errors), default=math.inf)


def _steps(values: list[float]) -> list[float]:
    """How far each value is from the one before, relative to the last."""
    size = abs(values[-1])
    return [abs(one - before) / size if size else 0.0 for before, one in pairwise(values)]


def _estimate(*several: list[float]) -> tuple[float, float | None]:
    """What the finest mesh is off by the changes of quantities from mesh to mesh, and the order of the first one."""
    found = [_by_richardson(changes) for changes in several]
    return max(error for error, _ in found), found[0][1]


def _by_richardson(changes: list[float]) -> tuple[float, float | None]:
    """The error left after changes from mesh to mesh, each of half the size, and the order if they show one.

    An order that meshes only seem to have before they are fine enough is too high: what is left is then more.
    """
    if not changes:
        return math.inf, None
    orders = [observed_order(before, one) or 0.0 for before, one in pairwise(changes)]
    low, high = (min(orders[-2:]), max(orders[-2:])) if orders else (0.0, 0.0)
    shown = len(orders) > 1 and low >= _LOWEST and high - low <= _ASYMPTOTIC * high
    order = min(low, _HIGHEST) if shown else _CAUTIOUS if not orders else min(max(orders[-1], _LOWEST), _CAUTIOUS)
    return remaining_error(_SAFETY * changes[-1], order), order if shown else None
