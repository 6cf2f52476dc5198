"""Discretisation error of a solution, from a finer mesh of the same law or from elements of second order."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.comparison import Comparison, compare
from truespring.equilibrium import Solution, solve
from truespring.errors import MeshError, ModelError, TruespringError
from truespring.mesh import (
    Box,
    Mesh,
    Near,
    Plane,
    Selection,
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
from truespring.richardson import remaining_error
from truespring.solvers import Newton, Solver, as_solver

#: Assumed order of convergence: the lowest observed, at clamps and corners. Bodies without these have order 2 or more;
#: their error is overestimated, usually by half, at most twofold.
ORDER = 1.0
#: Upper bound for the error of second-order elements over that of first-order elements on the same nodes. Measured on
#: cantilevers, blocks and tubes: 0.004 to 0.08.
SECOND_ORDER = 1 / 11
#: Largest work of refinement over the work of all solutions of a study.
COST = 10.0

# Exponent of work as a power of the number of unknowns, measured in the plane and in space.
_GROWTH = 1.25
# Newton iterations from the coarse state: estimate (five are usual) and limit.
_ITERATIONS, _MOST_ITERATIONS = 6, 10
# Largest number of halvings of the mesh.
_LEVELS = 2


@dataclass(frozen=True, eq=False)
class OwnError:
    """Discretisation error of a solution: its distance to the limit of ever finer meshes, with the same law and loads.

    Attributes:
        value: relative error at full load, as Comparison.error: the larger of the rms distance of nodes and the error
            of a moved support's force or torque; None if not known.
        how: method: "second order", "refined" or "coarser"; or why it is not known.
        limit: solution on the finer mesh or with elements of second order, None without one.
        comparison: comparison of the solution with `limit`, None without one.
        work: work of the estimate, see `work_of`.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> error = ts.reference_error(problem, ts.Fem("neo-hookean"))
        >>> error.how, error.limit.problem.mesh.n_nodes
        ('second order', 10)
    """

    value: float | None
    how: str
    limit: Solution | None = None
    comparison: Comparison | None = None
    work: float = 0.0

    def __str__(self) -> str:
        """Return value and method."""
        return f"not known: {self.how}" if self.value is None else f"{self.value:.2%} ({self.how})"


@dataclass(frozen=True, slots=True)
class Standing:
    """Discretisation error of a reference, and the error of a model against the refined reference.

    Attributes:
        value, how: error of the reference, see OwnError.
        refined_error: error of the model at full load against the refined reference, as Comparison.error; None without
            a refined reference.
    """

    value: float | None
    how: str
    refined_error: float | None = None


def standing(model: Solution, found: OwnError) -> Standing:
    """Return the standing of a reference with the error `found`, for the solution `model`."""
    against = None if found.limit is None else compare(model, found.limit).error
    return Standing(found.value, found.how, against)


def work_of(path: Solution) -> float:
    """Return the work of a solution: Newton iterations times a power of the number of unknowns; independent of time."""
    return float(max(path.newton_iterations, 1) * path.n_unknowns**_GROWTH)


def reference_error(
    problem: Problem, model: Model, solver: Solver | None = None, most_work: float = math.inf
) -> OwnError:
    """Solve a problem and return the discretisation error of its solution, see `own_error`.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> print(ts.reference_error(problem, ts.Fem("neo-hookean")))
        0.87% (second order)
    """
    solver = Newton() if solver is None else as_solver(solver)
    return own_error(solve(problem, model, solver), model, solver, most_work)


def own_error(path: Solution, model: Any, solver: Solver, most_work: float, timeout: float | None = None) -> OwnError:
    """Return the discretisation error of a solution at full load.

    A model of first order whose law has elements of second order is compared with these, on simplices of the same
    nodes; their error is at most SECOND_ORDER of its own. Other models are solved on meshes of half and, if the work is
    small, a quarter of the element size; k halvings multiply the error by 2^(-p k), p = ORDER (Richardson
    extrapolation). If that exceeds `most_work` or the memory, the error follows from a mesh of twice the element size,
    as its distance over 2^p - 1; that needs equal elements along the axes, in even numbers. The error is not known if
    the solution did not reach full load, was read from a file, or has no equilibrium on other meshes.

    Args:
        path: the solution.
        model: its model.
        solver: its solver.
        most_work: largest work of the estimate, see `work_of`.
        timeout: time limit [s]; the last estimate before it is returned.
    """
    if not path.complete or not path.solved:
        return OwnError(None, "it was not solved to full load in this run")
    model = as_model(model)
    found, spent, clock = None, 0.0, _Clock(timeout)
    try:
        for finer in _finer(path, model):
            cost = min(_ITERATIONS, max(path.newton_iterations, 1)) * finer.n_unknowns**_GROWTH
            if spent + cost > (min(most_work, COST * work_of(path)) if found else most_work):
                break
            try:
                limit = _solve(finer, found.limit if found and found.limit else path, solver, most_work - spent, clock)
            except MeshError:  # a nonconvex element cannot be divided into simplices: halve the mesh instead
                continue
            spent += work_of(limit)
            against = compare(path, limit)
            value = None if against.error is None else _whole(against.error, finer.left)
            found = OwnError(value, finer.how, limit, against)
            if finer.how == _SECOND:
                break
    except (TruespringError, MemoryError):
        pass  # keep the last estimate; without one, use a coarser mesh
    if found is None:
        found = _from_coarser(path, model, solver, most_work - spent, clock)
    return replace(found, work=spent + found.work)


def _from_coarser(path: Solution, model: Model, solver: Solver, most_work: float, clock: "_Clock") -> OwnError:
    """Return the error of a solution from that on a mesh of twice the element size."""
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
    value = None if against.error is None else remaining_error(against.error, ORDER)
    return OwnError(value, "coarser", work=work_of(coarse))


def _whole(distance: float, left: float) -> float:
    """Return the error of a solution from its distance to a finer one, whose error is the share `left` of it.

    With the limit u, the solution (1 - e) u and the finer one (1 - left e) u, their relative distance is
    d = (1 - left) e / (1 - left e); hence e = d / (1 - left (1 - d)).
    """
    return distance / (1 - left * max(1 - distance, 0.0))


_SECOND = "second order"
_OWN_MESH = "{} can be solved on its own mesh only"


class _Finer(NamedTuple):
    """A finer discretisation of a problem: `problem` makes it, `left` is its error over that of the coarse one."""

    problem: Callable[[], Problem]
    model: Model
    how: str
    left: float
    n_unknowns: int


def _finer(path: Solution, model: Model) -> Iterator[_Finer]:
    """Yield finer and finer discretisations of the problem of a solution."""
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
    """Return a problem on a mesh that is halved `times` times."""
    for _ in range(times):
        problem = refined_problem(problem)
    return problem


def in_second_order(problem: Problem, model: Model) -> tuple[Problem, Model] | None:
    """Return a problem on simplices of the same nodes, and a model of second order for it.

    None if the model has no such elements, if its elements were chosen by name, if the mesh consists of simplices, or
    if it cannot be divided into them.
    """
    if not model.element_is_open or problem.mesh.element in SIMPLICES:
        return None
    try:
        return simplex_problem(problem), model
    except MeshError:
        return None


def refined_problem(problem: Problem) -> Problem:
    """Return a problem on a mesh of half the element size; raise MeshError if that does not fit in memory."""
    mesh = problem.mesh
    refuse_too_large(2**mesh.dim * mesh.n_nodes, mesh.dim)
    named = _by_groups(problem)
    return replace(named, mesh=refined(named.mesh))


def simplex_problem(problem: Problem) -> Problem:
    """Return a problem on triangles or tetrahedra of the same nodes; raise MeshError if these would be inverted."""
    named = _by_groups(problem)
    return replace(named, mesh=in_simplices(named.mesh)[0])


def coarser_problem(problem: Problem) -> Problem:
    """Return a problem on a mesh of twice the element size; raise MeshError if there is none.

    Needs equal rectangles or bricks along the axes, an even number in each direction; no groups of elements or facets,
    no node numbers, no regions.
    """
    mesh, counts = problem.mesh, cell_counts(problem.mesh)
    chosen = [one.on for one in problem.supports] + [one.on for one in problem.loads]
    chosen += [one.on for one in problem.tools]
    plain = all(on is None or isinstance(on, str | Plane | Box | Near) for on in chosen) and not problem.regions
    plain &= not (mesh.element_groups or mesh.facet_groups or mesh.element_vectors)
    plain &= not any(one.on_elements and one.on is not None for one in problem.loads)
    if counts is None or any(count % 2 for count in counts) or not plain:
        raise MeshError("there is no mesh of twice the size")
    half = tuple(count // 2 for count in counts)
    size = mesh.upper - mesh.lower
    made = (rectangle if mesh.dim == 2 else box)(tuple(size.tolist()), half)
    nodes = made.nodes + mesh.lower
    from scipy.spatial import KDTree

    at = np.asarray(KDTree(nodes).query(mesh.nodes, distance_upper_bound=1e-6 * mesh.diameter)[1])
    groups = {name: at[of][at[of] < len(nodes)] for name, of in mesh.node_groups.items()}
    return replace(problem, mesh=Mesh(nodes, made.elements, made.element, groups))


def _by_groups(problem: Problem) -> Problem:
    """Return a problem whose supports, loads, tools and regions select by group.

    Refinement divides groups with the mesh; node numbers, and numbers and centres of elements, change.
    """
    mesh = problem.mesh
    nodes, elements = dict(mesh.node_groups), dict(mesh.element_groups)

    def of_elements(on: Selection) -> str:
        name = f"elements {len(elements) + 1}"
        elements[name] = select_elements(mesh, on)
        return name

    def named(ones: Sequence[Any]) -> list[Any]:
        found = []
        for one in ones:
            if one.on is not None and not isinstance(one.on, str | Plane | Box | Near):
                name = f"nodes {len(nodes) + 1}"
                nodes[name] = np.unique(np.asarray(one.on))
                one = one.moved_to(name)
            found.append(one)
        return found

    loads = [
        one.moved_to(of_elements(one.on)) if one.on_elements and one.on is not None else one for one in problem.loads
    ]
    supports, loads, tools, regions = named(problem.supports), named(loads), named(problem.tools), []
    for region in problem.regions:
        regions.append(Region(of_elements(region.on), region.material))
    if len(nodes) == len(mesh.node_groups) and len(elements) == len(mesh.element_groups):
        return problem
    mesh = replace(mesh, node_groups=nodes, element_groups=elements)
    return replace(problem, mesh=mesh, supports=supports, loads=loads, regions=regions, tools=tools)


def _solve(finer: _Finer, coarse: Solution, solver: Solver, most_work: float, clock: "_Clock") -> Solution:
    """Solve a finer problem: from the coarse state, else or with friction from no load if the work allows."""
    problem = finer.problem()
    # Starting from the coarse state saves the load steps and stays on the same branch; errors over the way need all.
    whole = problem.loading.dissipates or problem.returns
    nearby = None if whole else solver.starting_at(_carrying(coarse), _MOST_ITERATIONS)
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
    """Solve problems until a time limit [s]; None is no limit."""

    def __init__(self, timeout: float | None) -> None:
        self._timeout, self._end = timeout, math.inf if timeout is None else time.monotonic() + timeout

    def check(self) -> None:
        """Raise ModelError after the time limit."""
        if time.monotonic() > self._end:
            raise ModelError(f"the time limit of {self._timeout:g} s was reached (--timeout)")

    def solve(self, problem: Problem, model: Model, solver: Solver) -> Solution:
        """Return the solution of a model; raise ModelError after the time limit."""
        self.check()
        left = self._end - time.monotonic()
        path = solve(problem, model, solver, timeout=None if math.isinf(left) else left)
        if not path.complete:
            self.check()
        return path


def _sound(path: Solution) -> bool:
    """Return whether a solution reached full load and is stable there."""
    return path.complete and not path.states[-1].negative_eigenvalues


def _carrying(coarse: Solution) -> Callable[[Potential], Floats]:
    """Return a function that interpolates the last coarse state at the nodes of a finer potential, as positions [m]."""

    def start(potential: Potential) -> Floats:
        whole = coarse.whole
        moved = coarse.states[-1].all_positions - whole.points
        return np.asarray(potential.nodes + whole.locate(potential.nodes).carry(moved))

    return start
