"""The reference of a map: finite elements on finer meshes until their estimated error is within the tolerance."""

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

#: Largest relative error of the reference in 2D and 3D: a fifth, and half, of the smallest line.
TOLERANCE = {2: 0.002, 3: 0.005}

# Largest number of unknowns of a reference in 2D and 3D.
_MOST_UNKNOWNS = {2: 60_000, 3: 65_000}
# Assumed order of convergence if the meshes show none, as at clamps and corners.
_CAUTIOUS = 1.0
# The meshes show an order if those of two consecutive triples of meshes differ by at most this share. Orders above the
# second are limited: the error of a corner may still be hidden by others.
_ASYMPTOTIC, _HIGHEST = 0.25, 2.0
# The lowest plausible order.
_LOWEST = 0.3
# Factor of Richardson's estimate: Roache's safety factor for three meshes.
_SAFETY = 1.25
# Loads are scaled until the reference reaches the target size with this relative accuracy; largest number of trials.
_NEAR, _MOST_TRIALS = 0.02, 8


@dataclass(frozen=True, eq=False, slots=True)
class Reference:
    """The converged path of the reference under one load type.

    Attributes:
        load, law, poisson: load type, law, Poisson's ratio; None is that of the study.
        factor: factor of the load that reaches the target size.
        solved: the path on the finest mesh.
        sizes: size of the load at each of its states, shape (n_states,).
        target: the target size.
        error: estimated relative error of the finest mesh: the larger one of the rms displacement and of the work
            conjugate of the load, by Richardson's extrapolation with Roache's factor and the order that four meshes
            show, or an assumed order.
        order: order of convergence of the displacement that four meshes show; None if they show none.
        changes: relative rms change of the displacement from mesh to mesh, at the worst load level.
        n_nodes: number of nodes of each mesh.
        elements: number of elements through the depth of the finest mesh; None for a mesh from a file.
        settling: displacement along the load, or force of moved supports, on the meshes.
        tolerance: largest error of a converged reference.
        solves: number of solved paths.
        seconds: their wall time.
    """

    load: LoadType
    law: str
    poisson: float | None
    factor: float
    solved: Solved
    sizes: Floats
    target: float
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
        """Whether the error is within the tolerance."""
        return self.error <= self.tolerance

    @property
    def reached(self) -> float:
        """The largest size that it reached."""
        return float(self.sizes[-1])

    @property
    def driven(self) -> bool:
        """Whether moved supports drive the body, without loads."""
        return self.solved.path.problem.loading.driven_by_motion

    @property
    def end(self) -> str:
        """Why it ends before the target size; empty if it does not."""
        return self.solved.end if self.reached < (1 - _NEAR) * self.target else ""


def solve_reference(
    body: Body,
    load: LoadType,
    law: str,
    poisson: float | None = None,
    last: float | None = None,
    steps: int = 12,
) -> Reference:
    """Return the reference up to the size `last`, by default the last one of the load type, refined to TOLERANCE.

    Raises StudyError if it has no equilibrium even under a small load.
    """
    search, tolerance = _Search(body, load, law, poisson, steps), TOLERANCE[body.dim]
    factor, target = search.factor(load.last if last is None else last)
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
        target=target,
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
    """Solve the reference on its meshes, and find the load that reaches a size."""

    def __init__(self, body: Body, load: LoadType, law: str, poisson: float | None, steps: int) -> None:
        self.body, self.load, self.law, self.poisson, self.steps = body, load, law, poisson, steps
        self.solves, self.seconds = 0, 0.0

    def solve(self, factor: float, level: int) -> Solved:
        problem = self.body.reference_problem(self.load, factor, self.poisson, level)
        solved = run_task(Task(problem, self.body.reference_model(self.law), self.steps))
        self.solves, self.seconds = self.solves + 1, self.seconds + solved.seconds
        if not solved.states:
            what = "under the study's own load" if self.load.own else f"under {self.load.name}"
            raise StudyError(f"the reference {solved.path.label} has no equilibrium {what}, however small the load")
        return solved

    def sizes(self, solved: Solved) -> Floats:
        """Return the size of the load at each state, shape (n_states,)."""
        problem = solved.path.problem
        probe = self.body.probe_in(problem, self.load)
        if probe is None:
            moved = np.linalg.norm(solved.path.states[-1].displacement, axis=1)
            probe = int(moved.argmax())
        displacements = np.array([state.displacement for state in solved.states])
        return self.load.sizes(Course(problem, displacements, solved.levels, probe, self.body.extent))

    def factor(self, target: float | None) -> tuple[float, float]:
        """Return the factor of the load at which the reference reaches a size on a coarse mesh, and that size."""
        if target is None:
            return 1.0, float(self.sizes(self.solve(1.0, 1))[-1])
        if self.load.moved:
            return target, target
        factor = 1.0 if self.load.own else target
        for _ in range(_MOST_TRIALS):
            solved = self.solve(factor, 1)
            reached, levels = self.sizes(solved), solved.levels
            if reached[-1] >= target * (1 - _NEAR / 4):
                level = float(np.interp(target, [0.0, *reached], [0.0, *levels]))
                return factor * level, target
            if solved.end:  # it cannot be loaded further
                return factor * float(levels[-1]), target
            factor *= min(max(1.25, target / float(reached[-1])), 3.0)
        return factor, target


def _worked(solved: Solved, load: LoadType) -> float:
    """Return the work conjugate of the load at the last state: displacement along it, or force of moved supports."""
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
    """Return the largest relative rms distance of two meshes over their common load levels."""
    pairs = [compare(one, other) for one, other in ((coarse.small, fine.small), (coarse.path, fine.path))]
    return max((float(error) for one in pairs for error in one.rms_errors), default=math.inf)


def _steps(values: list[float]) -> list[float]:
    """Return the change of each value from the one before, relative to the last value."""
    size = abs(values[-1])
    return [abs(one - before) / size if size else 0.0 for before, one in pairwise(values)]


def _estimate(*several: list[float]) -> tuple[float, float | None]:
    """Return the error of the finest mesh from changes of several quantities, and the order of the first one."""
    found = [_by_richardson(changes) for changes in several]
    return max(error for error, _ in found), found[0][1]


def _by_richardson(changes: list[float]) -> tuple[float, float | None]:
    """Return the error after changes from mesh to mesh, each with half the element size, and the order, if any.

    Before the asymptotic range orders are too high and would give too small an error, so the order is limited.
    """
    if not changes:
        return math.inf, None
    orders = [observed_order(before, one) or 0.0 for before, one in pairwise(changes)]
    low, high = (min(orders[-2:]), max(orders[-2:])) if orders else (0.0, 0.0)
    shown = len(orders) > 1 and low >= _LOWEST and high - low <= _ASYMPTOTIC * high
    order = min(low, _HIGHEST) if shown else _CAUTIOUS if not orders else min(max(orders[-1], _LOWEST), _CAUTIOUS)
    return remaining_error(_SAFETY * changes[-1], order), order if shown else None
