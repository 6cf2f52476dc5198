"""Refining: how far a path is from its own limit, by the same law on a finer mesh or by elements of second order."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from truespring.arrays import Floats
from truespring.comparison import Comparison, compare
from truespring.equilibrium import Solution, solve
from truespring.errors import MeshError, ModelError, TruespringError
from truespring.mesh import (
    Box,
    Mesh,
    Near,
    Plane,
    box,
    in_simplices,
    rectangle,
    refined,
    refuse_too_large,
    select_elements,
)
from truespring.models import Model, as_model
from truespring.models.bending import cell_counts
from truespring.models.interpolation import SIMPLICES
from truespring.potential import Potential
from truespring.problem import Problem, Region
from truespring.solvers import Newton, Solver, as_solver

#: The order of convergence that refinement is taken to have: the lowest that is met, at clamps and corners. Bodies
#: without these have twice that or more, and their error is overestimated: by half, and twofold at most.
ORDER = 1.0
#: The share of an error of first order that elements of second order on the same nodes still have, at most: measured on
#: cantilevers, blocks and tubes, 0.004 to 0.08.
SECOND_ORDER = 1 / 11
#: Refinement may cost so many times what the paths of a study did.
COST = 10.0

# How work grows with the number of unknowns, measured in the plane and in space.
_GROWTH = 1.25
# Newton iterations from the coarse state, of which five are usual.
_ITERATIONS, _MOST_ITERATIONS = 6, 10
# Meshes are halved twice at most.
_LEVELS = 2


@dataclass(frozen=True, eq=False)
class OwnError:
    """How far a path is from its own limit: that of finer and finer meshes, under its law, loads and supports.

    Attributes:
        value: at full load, relative as Comparison.error is: the larger of the rms distance of nodes and the error of a
            moved support's force or torque; None where it is not known.
        how: by what it was found: "second order", "refined" or "coarser"; or why it is not known.
        limit: the path on the finer mesh or of the better elements, None without one.
        comparison: of the path with `limit`, None without one.
        work: what it took, as `work_of` counts it.
    """

    value: float | None
    how: str
    limit: Solution | None = None
    comparison: Comparison | None = None
    work: float = 0.0

    def __str__(self) -> str:
        """Return it in words."""
        return f"not known: {self.how}" if self.value is None else f"{self.value:.2%} ({self.how})"


@dataclass(frozen=True, slots=True)
class Standing:
    """How a reference stands to its own limit, and a model compared with it to that limit.

    Attributes:
        value, how: of the reference, see OwnError.
        refined_error: the model's error at full load against the finer path of the reference, as Comparison.error is;
            None where there is none.
    """

    value: float | None
    how: str
    refined_error: float | None = None


def standing(model: Solution, found: OwnError) -> Standing:
    """Return how a reference stands whose own error was found, and `model` to its limit."""
    against = None if found.limit is None else compare(model, found.limit).error
    return Standing(found.value, found.how, against)


def work_of(path: Solution) -> float:
    """Return what solving a path took: Newton iterations times unknowns to the power of their growth, no times."""
    return float(max(path.newton_iterations, 1) * path.n_unknowns**_GROWTH)


def reference_error(
    problem: Problem, model: Model, solver: Solver | None = None, most_work: float = math.inf
) -> OwnError:
    """Solve a problem and return how far the solution is from its own limit, whatever that costs; see `own_error`."""
    solver = Newton() if solver is None else as_solver(solver)
    return own_error(solve(problem, model, solver), model, solver, most_work)


def own_error(path: Solution, model: Any, solver: Solver, most_work: float, timeout: float | None = None) -> OwnError:
    """Return how far the path of a model is from its own limit at full load.

    A model of first order whose law has elements of second order is held against these, on simplices of the same
    nodes; they have the share SECOND_ORDER of its error at most. Others are solved on meshes of half and, if that costs
    little, of a quarter of the size, which have the share 2^(-p k) of it after k halvings, p = ORDER (Richardson).
    Where that takes more than `most_work` or does not fit in memory, a mesh of twice the size tells instead, if
    elements are alike and along the axes and their numbers even: its distance over 2^p - 1. It is not known of a path
    that did not reach full load, was read from a file, or finds no equilibrium on other meshes. All of it ends after
    `timeout` [s]; what was found until then counts.
    """
    if not path.complete or not path.solved:
        return OwnError(None, "it was not solved to full load here")
    model = as_model(model)
    found, spent, clock = None, 0.0, _Clock(timeout)
    try:
        for finer in _finer(path, model):
            cost = min(_ITERATIONS, max(path.newton_iterations, 1)) * finer.n_unknowns**_GROWTH
            if spent + cost > (min(most_work, COST * work_of(path)) if found else most_work):
                break
            try:
                limit = _solve(finer, found.limit if found and found.limit else path, solver, most_work - spent, clock)
            except MeshError:  # an element is too far from convex to be divided into simplices: halved it is as good
                continue
            spent += work_of(limit)
            against = compare(path, limit)
            value = None if against.error is None else _whole(against.error, finer.left)
            found = OwnError(value, finer.how, limit, against)
            if finer.how == _SECOND:
                break
    except (TruespringError, MemoryError):
        pass  # what was found before stands, else a coarser mesh tells
    if found is None:
        found = _from_coarser(path, model, solver, most_work - spent, clock)
    return replace(found, work=spent + found.work)


def _from_coarser(path: Solution, model: Model, solver: Solver, most_work: float, clock: "_Clock") -> OwnError:
    """How far a path is from its limit by the distance of a mesh of twice the size."""
    if not model.any_mesh:
        return OwnError(None, _OWN_MESH.format(model.label))
    try:
        clock.check()
        problem = coarser_problem(path.problem)
        if path.newton_iterations * int((~problem.loading.held).sum()) ** _GROWTH > most_work:
            return OwnError(None, "other meshes cost too much")
        coarse = clock.solve(problem, model, solver)
        against = compare(coarse, path)
    except TruespringError as error:
        return OwnError(None, str(error))
    return OwnError(None if against.error is None else against.error / (2**ORDER - 1), "coarser", work=work_of(coarse))


def _whole(distance: float, left: float) -> float:
    """Return the error of a path by its distance to one that has the share `left` of it.

    With the limit u, the path (1 - e) u and the other (1 - left e) u, their distance relative to that one is
    d = (1 - left) e / (1 - left e): small ones are multiplied by 1 / (1 - left), none becomes more than the whole.
    """
    return distance / (1 - left * max(1 - distance, 0.0))


_SECOND = "second order"
_OWN_MESH = "{} can be solved on its own mesh only"


class _Finer(NamedTuple):
    """A finer way to solve a problem, made when it is wanted, and the share of the error that it still has."""

    problem: Callable[[], Problem]
    model: Model
    how: str
    left: float
    n_unknowns: int


def _finer(path: Solution, model: Model) -> Iterator[_Finer]:
    """Yield finer and finer ways to solve the problem of a path."""
    problem, n_unknowns = path.problem, path.n_unknowns
    growth = 2**problem.mesh.dim
    better = model.second_order(problem)
    if better is not None:
        yield _Finer(partial(simplex_problem, problem), better, _SECOND, SECOND_ORDER, growth * n_unknowns)
    if not model.any_mesh:
        raise ModelError(_OWN_MESH.format(model.label))
    for halvings in range(1, _LEVELS + 1):
        left = 2 ** (-ORDER * halvings)
        make = partial(_halved, problem, halvings)
        yield _Finer(make, model, "refined", left, growth**halvings * n_unknowns)


def _halved(problem: Problem, times: int) -> Problem:
    for _ in range(times):
        problem = refined_problem(problem)
    return problem


def in_second_order(problem: Problem, model: Model) -> tuple[Problem, Model] | None:
    """Return a problem on simplices of the same nodes, and the model of second order for it.

    None where the model has no such elements, is of them already, where its elements were chosen by name, or where the
    mesh cannot be divided into simplices.
    """
    if not model.element_is_open or problem.mesh.element in SIMPLICES:
        return None
    try:
        return simplex_problem(problem), model
    except MeshError:
        return None


def refined_problem(problem: Problem) -> Problem:
    """Return a problem on a mesh of elements of half the size; raise MeshError where that does not fit in memory."""
    mesh = problem.mesh
    refuse_too_large(2**mesh.dim * mesh.n_nodes, mesh.dim)
    named = _by_groups(problem)
    return replace(named, mesh=refined(named.mesh))


def simplex_problem(problem: Problem) -> Problem:
    """Return a problem on triangles or tetrahedra of the same nodes; raise MeshError where these would be inverted."""
    named = _by_groups(problem)
    return replace(named, mesh=in_simplices(named.mesh)[0])


def coarser_problem(problem: Problem) -> Problem:
    """Return a problem on a mesh of elements of twice the size; raise MeshError where there is none.

    For rectangles and bricks that are alike and along the axes, an even number in each direction, without groups of
    elements or facets, node numbers or regions.
    """
    mesh, counts = problem.mesh, cell_counts(problem.mesh)
    chosen = [one.on for one in problem.supports] + [one.on for one in problem.loads]
    plain = all(on is None or isinstance(on, str | Plane | Box | Near) for on in chosen) and not problem.regions
    if counts is None or any(count % 2 for count in counts) or not plain or mesh.element_groups or mesh.facet_groups:
        raise MeshError("there is no mesh of twice the size")
    half = tuple(count // 2 for count in counts)
    size = mesh.upper - mesh.lower
    made = (rectangle if mesh.dim == 2 else box)(tuple(size.tolist()), half)
    nodes = made.nodes + mesh.lower
    at = np.asarray(KDTree(nodes).query(mesh.nodes, distance_upper_bound=1e-6 * mesh.diameter)[1])
    groups = {name: at[of][at[of] < len(nodes)] for name, of in mesh.node_groups.items()}
    return replace(problem, mesh=Mesh(nodes, made.elements, made.element, groups))


def _by_groups(problem: Problem) -> Problem:
    """The problem with a group in place of each selection by numbers, and of elements by a box: these go with the mesh.

    A group of nodes, or of elements, is divided as the mesh is; numbers would be others, and centres lie elsewhere.
    """
    mesh = problem.mesh
    nodes, elements = dict(mesh.node_groups), dict(mesh.element_groups)

    def named(ones: Sequence[Any]) -> list[Any]:
        found = []
        for one in ones:
            if one.on is not None and not isinstance(one.on, str | Plane | Box | Near):
                name = f"nodes {len(nodes) + 1}"
                nodes[name] = np.unique(np.asarray(one.on))
                one = one.moved_to(name)
            found.append(one)
        return found

    supports, loads, regions = named(problem.supports), named(problem.loads), []
    for region in problem.regions:
        name = f"elements {len(elements) + 1}"
        elements[name] = select_elements(mesh, region.on)
        regions.append(Region(name, region.material))
    if len(nodes) == len(mesh.node_groups) and not regions:
        return problem
    mesh = replace(mesh, node_groups=nodes, element_groups=elements)
    return replace(problem, mesh=mesh, supports=supports, loads=loads, regions=regions)


def _solve(finer: _Finer, coarse: Solution, solver: Solver, most_work: float, clock: "_Clock") -> Solution:
    """The path of a finer way: from the coarse state, else all the way if that costs little enough."""
    problem = finer.problem()
    # From a state that is near, so that the path is not taken again, and on the same branch.
    nearby = solver.starting_at(_carrying(coarse), _MOST_ITERATIONS)
    if nearby is not None:
        path = clock.solve(problem, finer.model, nearby)
        if _sound(path):
            return path
    if coarse.newton_iterations * finer.n_unknowns**_GROWTH > most_work:
        raise ModelError("other meshes cost too much")
    path = clock.solve(problem, finer.model, solver)
    if not _sound(path):
        raise ModelError("a finer mesh finds no stable equilibrium")
    return path


class _Clock:
    """Solves until a time limit [s]; None is no limit."""

    def __init__(self, timeout: float | None) -> None:
        self._timeout, self._end = timeout, math.inf if timeout is None else time.monotonic() + timeout

    def check(self) -> None:
        """Raise ModelError where the time is up."""
        if time.monotonic() > self._end:
            raise ModelError(f"the time limit of {self._timeout:g} s was reached (--timeout)")

    def solve(self, problem: Problem, model: Model, solver: Solver) -> Solution:
        """Return the path of a model; raise ModelError where the time is up."""
        self.check()
        left = self._end - time.monotonic()
        path = solve(problem, model, solver, timeout=None if math.isinf(left) else left)
        if not path.complete:
            self.check()
        return path


def _sound(path: Solution) -> bool:
    """Whether a path reached full load and is stable there."""
    return path.complete and not path.states[-1].negative_eigenvalues


def _carrying(coarse: Solution) -> Callable[[Potential], Floats]:
    """What gives the nodes of a finer potential the displacement of a coarse state, by its elements' interpolation."""

    def start(potential: Potential) -> Floats:
        whole = coarse.whole
        moved = coarse.states[-1].all_positions - whole.points
        return np.asarray(potential.nodes + whole.locate(potential.nodes).carry(moved))

    return start
