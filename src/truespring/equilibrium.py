"""solve(problem, model, solver) -> Solution: compute the equilibria of a body."""

import logging
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.coarsening import CoarseBody
from truespring.conditions import Loading, Refined, from_parents, loading_of, on_the_mesh
from truespring.deprecation import renamed_argument
from truespring.dynamics import Dynamics
from truespring.errors import ModelError, OneProcessError, ProblemError, TruespringError, one_line
from truespring.linear import processes_of
from truespring.mesh import interpolations, select
from truespring.models import Model, as_model, check_fibres, damper_of
from truespring.motion import follow_motion
from truespring.motion.moving import Body as MovingBody
from truespring.motion.moving import creep_speed
from truespring.piecewise import Piecewise, own_rows
from truespring.potential import Damper, Massive, Potential, Stretched
from truespring.problem import Problem
from truespring.program import Program
from truespring.ranks import Communicator, layout_of, ranks_of
from truespring.solution import FINE as FINE
from truespring.solution import Solution as Solution
from truespring.solution import State as State
from truespring.solution import Status as Status
from truespring.solvers import Coarse, Equilibrium, Geometry, Newton, Reporter, Solver, as_solver
from truespring.soundness import UNBALANCED, path_status, path_warnings

_LOGGER = logging.getLogger(__name__)

# Largest number of nodes of the coarsest mesh of multigrid.
_COARSEST = 60
# Smallest number of cells along each axis of a coarser mesh: with fewer its states differ too much.
_FEWEST_CELLS = 3


@renamed_argument("report", "progress")
def solve(
    problem: Problem,
    model: Model | Potential,
    solver: Solver | None = None,
    progress: Reporter | None = None,
    timeout: float | None = None,
) -> Solution:
    """Compute the equilibria of a problem from load factor 0 to 1.

    Args:
        problem: body, supports and loads.
        model: Springs, Fem, any object with a method `potential(problem)`, or a potential such as a SpringNetwork (the
            problem then needs no material).
        solver: Newton (the default) applies the load in steps and keeps to stable states; DisplacementControl and
            ArcLength continue past limit points, also through unstable states; or any object with a method
            `follow(potential, loading, report, geometry)`.
        progress: called after each iteration with load factor, iteration and relative residual.
        timeout: time limit [s]; none by default, an hour for another program.

    The logger "truespring.equilibrium" has a message of level INFO for each solution, and of DEBUG for each iteration.

    Solver failures are not exceptions: see Solution.status and Solution.best. An exception of a numerical library ends
    the solution at the last equilibrium. Raises ModelError if the model does not fit the problem, ProblemError if the
    solver does not.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> solution = ts.solve(problem, ts.Springs("gaussian"))
        >>> solution
        Solution(springs (gaussian), converged, 11 states up to load factor 1)
        >>> solution.states[-1].displacement.shape
        (10, 2)
    """
    model, solver = as_model(model), Newton() if solver is None else as_solver(solver)
    check_fibres(problem, model)
    ranks = processes_of(solver.linear)
    if isinstance(model, Program):
        if ranks.size > 1 and model.solves:
            raise ModelError(f"{model.label}: another program runs beside one process only: start one process")
        return _logged(model.run(problem, solver, progress, timeout))
    moduli = model.moduli(problem.homogeneous[0]) if problem.material is not None else None
    from truespring.kernels.threads import compiling

    with compiling() as compiled:
        started = time.perf_counter()
        try:
            report = _logging(model.label_on(problem), _timed(progress, timeout, ranks))
            path = _solve(problem, model, solver, report, ranks)
        except Exception as error:
            if not ranks.is_on_all(error):
                raise OneProcessError(error_words(error)) from error
            raise
        seconds = time.perf_counter() - started - compiled()
        warnings = (*model.warnings(problem), *path.warnings)
        return _logged(replace(path, seconds=seconds, moduli=moduli, warnings=warnings))


def _logged(path: Solution) -> Solution:
    """Return a solution after a message on status, levels and time, and one for each warning."""
    _LOGGER.info(
        "%s: %s, load factor %g, %d levels, %d Newton iterations, %d unknowns, %.2f s",
        *(path.label, path.status, path.load_factor, len(path.states), path.newton_iterations),
        *(path.n_unknowns, path.seconds),
    )
    for warning in path.warnings:
        _LOGGER.info("%s: warning: %s", path.label, warning)
    return path


def _logging(label: str, report: Reporter | None) -> Reporter | None:
    """Return a reporter that also writes a message for each iteration, if the logger is enabled for DEBUG."""
    if not _LOGGER.isEnabledFor(logging.DEBUG):
        return report

    def logging_each(load_factor: float, iteration: int, residual: float) -> None:
        _LOGGER.debug("%s: load factor %g, iteration %d, residual %.3e", label, load_factor, iteration, residual)
        if report:
            report(load_factor, iteration, residual)

    return logging_each


def _timed(report: Reporter | None, timeout: float | None, ranks: Communicator) -> Reporter | None:
    """Return a reporter that raises TimeoutError on all processes after the time limit [s]."""
    if timeout is None:
        return report
    end = time.monotonic() + timeout

    def check() -> None:
        if time.monotonic() > end:
            raise TimeoutError(f"the time limit of {timeout:g} s was reached (--timeout)")

    def timed(load_factor: float, iteration: int, residual: float) -> None:
        ranks.together(check)
        if report:
            report(load_factor, iteration, residual)

    return timed


def geometry_of(problem: Problem, finite: bool = True) -> Geometry:
    """Return the geometry of a body for a solver; with finite strains, inverted elements are not admissible."""

    def upright(positions: Floats) -> bool:
        return not finite or problem.mesh.smallest_area_ratio(positions) > 0

    return Geometry(upright, partial(select, problem.mesh))


def coarse_weights(problem: Problem, potential: Potential) -> "Sequence[sparse.csr_array[Any]]":
    """Return weights of the nodes of a potential from those of coarser meshes, empty unless the mesh is a lattice."""
    weights = interpolations(problem.mesh, _COARSEST)
    if not weights or not isinstance(potential, Refined):
        return weights
    return from_parents(potential.parents, problem.mesh.n_nodes), *weights


def check_solver(problem: Problem, solver: Solver) -> None:
    """Raise ProblemError if a solver does not fit the problem, as one that controls a held displacement."""
    solver.check(problem.loading, geometry_of(problem))


def _solve(problem: Problem, model: Model, solver: Solver, report: Reporter | None, ranks: Communicator) -> Solution:
    """Return the solution of a model that has a potential, without its time, moduli and findings about the model."""
    alone = ranks.size == 1
    potential = model.potential(problem) if alone else Piecewise(model, problem, ranks)
    if potential.nodes.shape != problem.mesh.nodes.shape and not isinstance(potential, Refined):
        raise ModelError(
            f"the potential has nodes of shape {potential.nodes.shape}, the problem {problem.mesh.nodes.shape}"
        )
    loading = loading_of(potential, problem.loading)
    upright = geometry_of(problem, model.finite)
    geometry = replace(
        upright,
        admissible=lambda positions: bool(ranks.first(float(upright.admissible(positions)))),
        interpolations=partial(coarse_weights, problem, potential),
    )
    if model.finite and model.any_mesh and alone:
        geometry = replace(geometry, coarse_body=partial(_coarse_body, model, CoarseBody.finest(problem, loading)))
    if problem.dynamics is None:
        ranks.together(lambda: solver.check(problem.loading, geometry))
    if not model.finite:
        loading = loading.at_rest(potential.nodes)
    layout = layout_of(potential)
    if layout is not None:
        loading = own_rows(loading, layout)
    if problem.dynamics is None:
        path = solver.follow(potential, loading, report, geometry)
    else:
        path = _motion(problem, problem.dynamics, model, (potential, loading), solver, report, geometry)
    found, broken = _followed(problem, path, potential)
    found, below_rounding = _above_rounding(problem, found)
    states = tuple(_state(problem, potential, loading, one) for one in found if one.converged)
    best = None if found[-1].converged else _state(problem, potential, loading, found[-1])
    stable = solver.keeps_to_stable_states
    return Solution(
        problem=problem,
        label=model.label_on(problem),
        kind=model.kind,
        states=states,
        status=Status.NOT_CONVERGED if broken else path_status(problem, states, best, model.finite, stable),
        warnings=(
            *broken,
            *path_warnings(problem, states, best, model.finite, stable, below_rounding, loading.symmetric),
            *([model.limit] if best is not None and model.limit else ()),
        ),
        best=best,
        potential=potential,
        finite=model.finite,
        has_springs=model.has_springs,
        element=model.chosen_element(problem),
        lines=model.lines,
        n_unknowns=int((~loading.held).sum()),
        cost=found[-1].cost,
    )


def _motion(
    problem: Problem,
    dynamics: Dynamics,
    model: Model,
    body: tuple[Potential, Loading],
    solver: Solver,
    report: Reporter | None,
    geometry: Geometry,
) -> Iterator[Equilibrium]:
    """Return the states of a motion of a potential under a loading.

    Raises ProblemError if the solver cannot take its steps, or the body has no mass.
    """
    potential, loading = body
    if not isinstance(solver, Newton):
        raise ProblemError(f"the steps of a motion are solved by Newton's method, not by {type(solver).__name__}")
    if processes_of(solver.linear).size > 1:
        raise ProblemError("a motion is computed by one process: start one, or leave dynamics out")
    mass, damper = _inertia(problem, dynamics, model, potential)
    crossing = problem.crossing_time
    return follow_motion(potential, loading, dynamics, mass, damper, solver, report, geometry, crossing)


def _inertia(problem: Problem, dynamics: Dynamics, model: Model, potential: Potential) -> tuple[Floats, Damper | None]:
    """Return the mass of the nodes [kg], shape (n_nodes,), and dashpots; raise ProblemError if there is no mass."""
    if isinstance(potential, Refined):
        mass = potential.lumped_mass()
    else:
        own = potential.mass if isinstance(potential, Massive) else np.zeros(0)
        if not len(own) and problem.material is None:
            raise ProblemError(
                f"a motion needs the mass of the nodes [kg], which {model.label} lacks: SpringNetwork(..., mass=...), "
                "or a column mass in the file of the nodes"
            )
        mass = own if len(own) else problem.mass
    return mass, damper_of(problem, potential, model.finite) if dynamics.damping.stiffness else None


def moving_body(problem: Problem, model: Model | Potential) -> tuple[MovingBody, Geometry]:
    """Return what moves, and the geometry for its solver, for steps that are taken one by one.

    Raises ModelError if the model does not fit the problem, ProblemError if the body has no mass or no `dynamics`.
    """
    model, dynamics = as_model(model), problem.dynamics
    if dynamics is None:
        raise ProblemError("a motion needs dynamics: Problem(..., dynamics=Dynamics(duration=...))")
    check_fibres(problem, model)
    potential = model.potential(problem)
    loading = loading_of(potential, problem.loading)
    loading = loading if model.finite else loading.at_rest(potential.nodes)
    mass, damper = _inertia(problem, dynamics, model, potential)
    creep = creep_speed(dynamics, potential.nodes)
    body = MovingBody(potential, loading, mass, dynamics.damping, damper, dynamics.duration, creep)
    weights = partial(coarse_weights, problem, potential)
    return body, replace(geometry_of(problem, model.finite), interpolations=weights)


def _coarse_body(model: Model, body: CoarseBody) -> Coarse | None:
    """Return a body by a model on a mesh of cells twice as large, None if there is none; see `Geometry.coarse_body`."""
    coarse = body.coarser() if body.loading.held.shape == body.mesh.nodes.shape else None
    if coarse is None or min(coarse.counts) < _FEWEST_CELLS:
        return None
    potential = model.potential(coarse.problem)
    if potential.nodes.shape != coarse.mesh.nodes.shape:
        return None
    geometry = replace(
        geometry_of(coarse.problem),
        interpolations=partial(coarse_weights, coarse.problem, potential),
        coarse_body=partial(_coarse_body, model, coarse),
    )
    return Coarse(potential, coarse.loading, geometry, coarse.weights)


def _above_rounding(problem: Problem, follow: Iterable[Equilibrium]) -> tuple[list[Equilibrium], bool]:
    """Return the states up to the first whose load is below rounding errors, and whether there is one.

    The unbalanced force of that state is not small against the load: it is returned last, as not converged.
    """
    found: list[Equilibrium] = []
    if problem.dynamics is not None:  # its residuals are those of steps, see `soundness`
        return list(follow), False
    for one in follow:
        unbalanced = one.converged and one.residual > UNBALANCED and not problem.loading.vanishes(one.load_factor)
        if unbalanced and not _moved_by_more_than_rounding(problem, one.load_factor):
            return [*found, replace(one, converged=False)], True
        found.append(one)
    return found, False


def _moved_by_more_than_rounding(problem: Problem, load_factor: float) -> bool:
    """Return whether only tools, grasps or motion drive the body, motion by more than the coordinates' rounding errors.

    Such a state is an equilibrium whatever its residual: of a body moved as a whole, and of one that no tool touches,
    all forces are rounding errors, and so is their ratio.
    """
    loading, nodes = problem.loading, problem.mesh.nodes
    rounding = float(np.finfo(float).eps * np.abs(nodes).max())
    moved = float(np.abs(loading.motion(load_factor)).max())
    return loading.driven_by_motion and (bool(loading.interactions) or UNBALANCED * moved > rounding)


def _followed(
    problem: Problem, follow: Iterator[Equilibrium], potential: Potential
) -> tuple[list[Equilibrium], tuple[str, ...]]:
    """Return the states up to the end or an exception, at least the unloaded one; and a warning of the exception."""
    found: list[Equilibrium] = []
    try:
        for one in follow:
            found.append(one)
    except TruespringError:
        raise
    except (ArithmeticError, ValueError, RuntimeError, MemoryError, TimeoutError) as error:  # as numpy and SciPy raise
        if not ranks_of(potential).is_on_all(error):
            raise OneProcessError(error_words(error)) from error
        at = found[-1].load_factor if found else 0.0
        advice = f"; {Status.NOT_CONVERGED.advice}" if problem.dynamics is None else ""
        broken = f"stopped beyond {problem.where(at)}: {error_words(error)}{advice}"
        return found or [_rest(potential.nodes)], (broken,)
    return found, ()


def error_words(error: BaseException) -> str:
    """Return the message of an exception in one line, preceded by its class if a library raised it."""
    if isinstance(error, MemoryError):
        return "out of memory: use fewer elements"
    text = one_line(str(error))
    return text if isinstance(error, TruespringError | TimeoutError) else f"{type(error).__name__}: {text}"


def _rest(nodes: Floats) -> Equilibrium:
    """Return the undeformed state without load, of unknown stability."""
    still = np.zeros_like(nodes)
    return Equilibrium(0.0, nodes, still, still, 0.0, 0, 0.0, converged=True)


def unsolved(problem: Problem, model: Model | Potential, error: BaseException) -> Solution:
    """Return the solution of a model that an exception ended at once: the undeformed state, and a warning."""
    model = as_model(model)
    nodes = problem.mesh.nodes
    rest = _rest(nodes)
    still = rest.internal_force
    state = State(
        load_factor=0.0,
        positions=nodes,
        all_positions=nodes,
        displacement=still,
        reaction=still,
        applied_force=np.zeros(problem.mesh.dim),
        energy=0.0,
        iterations=0,
        residual=0.0,
        negative_eigenvalues=None,
        branched=False,
        area_ratio=1.0,
        stretch=None,
        level=0.0,
    )
    return Solution(
        problem=problem,
        label=model.label,
        kind=model.kind,
        finite=model.finite,
        has_springs=model.has_springs,
        lines=model.lines,
        states=(state,),
        status=Status.NOT_CONVERGED,
        warnings=(f"not solved: {error_words(error)}",),
        n_unknowns=int((~problem.loading.held).sum()),
    )


def _state(problem: Problem, potential: Potential, loading: Loading, found: Equilibrium) -> State:
    """Return the state on the mesh of a problem from an equilibrium of its potential."""
    reaction = np.where(loading.held, found.internal_force - found.external_force, 0.0)
    stretch = potential.stretch(found.positions) if isinstance(potential, Stretched) else None
    n_nodes = problem.mesh.n_nodes
    positions = found.positions[:n_nodes]
    if isinstance(potential, Refined):
        reaction = on_the_mesh(reaction, potential.parents)
    return State(
        load_factor=found.load_factor,
        positions=positions,
        all_positions=found.positions,
        displacement=positions - problem.mesh.nodes,
        reaction=reaction,
        applied_force=found.external_force.sum(axis=0),
        energy=found.energy,
        iterations=found.iterations,
        residual=found.residual,
        negative_eigenvalues=found.negative_eigenvalues,
        branched=found.branched,
        snapped=found.snapped,
        critical=found.critical,
        mode=None if found.mode is None else found.mode[:n_nodes],
        level=_level(found),
        reason=found.reason,
        touches=found.touches,
        moving=found.moving,
        area_ratio=problem.mesh.smallest_area_ratio(positions),
        stretch=None if stretch is None else (float(stretch.min()), float(stretch.max())),
    )


def _level(found: Equilibrium) -> float | None:
    """Return the level of an equilibrium; None at a critical point, which lies between levels."""
    if found.critical:
        return None
    return found.load_factor if found.level is None else found.level
