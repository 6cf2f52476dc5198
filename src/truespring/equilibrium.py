"""solve(problem, model, solver) -> Solution: the equilibria of a body and where they should not be trusted."""

import math
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.errors import ModelError, ProblemError, TruespringError, one_line
from truespring.mesh import Grid, Shell, Surface, select
from truespring.mesh.selections import AXES
from truespring.models import (
    LAWS,
    Fem,
    MassTensor,
    Model,
    Moduli,
    SpringNetwork,
    Springs,
    model_warnings,
    moduli,
    refuse_mechanism,
)
from truespring.potential import Loading, Potential, Refined, Stretched, on_the_mesh
from truespring.problem import Problem
from truespring.reactions import SupportForce, leading_support, support_forces
from truespring.solvers import ArcLength, Cost, DisplacementControl, Equilibrium, Newton, Reporter

# A relative residual above this is worth a word; it can only come from loads that drown in rounding.
_LOOSE = 1e-6
# Above this a state is no equilibrium: what is unbalanced is no longer small beside the load.
_UNBALANCED = 1e-3

# Levels this near are one: other programs print six digits.
_SAME_LEVEL = 2e-6


class Status(StrEnum):
    """How a path ended; `advice` says what it means and what to try."""

    CONVERGED = "converged"
    UNSTABLE = "unstable"
    INVERTED = "inverted"
    NOT_CONVERGED = "not-converged"
    READ = "read"

    @property
    def advice(self) -> str:
        """What the status means, and the way out."""
        return _ADVICE[self]


_ADVICE = {
    Status.CONVERGED: "every load level ended at a stable equilibrium",
    Status.UNSTABLE: "a real body would leave such a state; load less, or add a small side force to choose a branch",
    Status.INVERTED: "an element is turned inside out; load less or take more load_steps: springs and "
    "St. Venant-Kirchhoff have nothing that resists it",
    Status.READ: "read from a file: what it converged to is known to the program that wrote it",
    Status.NOT_CONVERGED: "no equilibrium was found beyond the last level reached; load less, take more load_steps, "
    "or another law: each bears a largest load",
}


@dataclass(frozen=True, repr=False)
class State:
    """An equilibrium of a body.

    Attributes:
        load_factor: share of the full load [-].
        positions, displacement: [m], shape (n_nodes, dim).
        all_positions: of every node of the potential, the mesh's first: quadratic elements have more [m].
        reaction: force of the supports [N], shape (n_nodes, dim), zero where nothing is held.
        applied_force: total of the loads [N], shape (dim,).
        energy: stored elastic energy [J].
        iterations: Newton iterations.
        residual: relative unbalanced force [-].
        negative_eigenvalues: of the tangent; 0 is stable, None is not proven.
        branched: true where an unstable equilibrium was left for a stable one nearby.
        snapped: true where the body moved much further than the step before lets expect.
        critical: "limit point" or "bifurcation" where stability changes there, else empty.
        mode: the way in which the body gives way at a critical point, largest component 1, shape (n_nodes, dim).
        level: how far the way is gone that the solver was asked for, 0 to 1: under load control the load factor,
            under displacement control the share of the displacement, not a number at a critical point.
        area_ratio: smallest corner Jacobian over its rest value; an element is inverted where not positive.
        stretch: smallest and largest length over rest length of the springs, None without springs.
        supports: force and torque of each moved support where they were told with the state (read from a file, or
            known on another mesh), None where the reactions tell them: see Solution.support_forces.
        reason: why no balance was looked for beyond it, in words, where it was not.
    """

    load_factor: float
    positions: Floats
    all_positions: Floats
    displacement: Floats
    reaction: Floats
    applied_force: Floats
    energy: float
    iterations: int
    residual: float
    negative_eigenvalues: int | None
    branched: bool
    area_ratio: float
    stretch: tuple[float, float] | None
    snapped: bool = False
    critical: str = ""
    mode: Floats | None = None
    level: float = math.nan
    supports: tuple[SupportForce, ...] | None = None
    reason: str = ""

    def __repr__(self) -> str:
        return (
            f"State(load_factor={self.load_factor:g}, energy={self.energy:.6g} J, iterations={self.iterations}, "
            f"negative_eigenvalues={self.negative_eigenvalues}, area_ratio={self.area_ratio:.3g})"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """The equilibria of one model of one problem, by load level.

    Attributes:
        label: how figures and tables call it.
        kind: "springs", "fem", or what the path was read from.
        states: equilibria in path order, the unloaded state first; read from a file, the one level it is for.
        best: where a level was not reached, the best state there (not an equilibrium).
        status, warnings: how it ended, and what should be known before it is trusted.
        seconds: wall time from the built mesh to the last equilibrium.
        surface, shell: what was read from a file that holds no more than a deformed surface, in the plane, in space.
        grid: the points and cells of a path that was read, the mesh's nodes first among the points: `all_positions` of
            its states are theirs. None where the mesh's own elements tell how a displacement goes on between nodes.
        potential: what was solved, None for a path from elsewhere.
        moduli: what the springs realise on the problem's own material, None for other models and networks.
        n_unknowns: the directions of nodes that were free, 0 where nothing was solved.
        cost: how it was solved and what that took, None where nothing was.
        held: the directions of nodes that supports held, of a path that was read with them, shape (n_nodes, dim).
    """

    problem: Problem
    label: str
    kind: str
    states: tuple[State, ...]
    status: Status
    warnings: tuple[str, ...] = ()
    seconds: float = 0.0
    best: State | None = None
    surface: Surface | None = None
    shell: Shell | None = None
    grid: Grid | None = None
    potential: Potential | None = None
    moduli: Moduli | None = None
    n_unknowns: int = 0
    cost: Cost | None = None
    held: Bools | None = None

    def __repr__(self) -> str:
        return (
            f"Solution({self.label}, {self.status}, {len(self.states)} states up to load factor {self.load_factor:g})"
        )

    @cached_property
    def load_factors(self) -> Floats:
        """Load factors of the states, shape (n_states,)."""
        return np.array([state.load_factor for state in self.states])

    @cached_property
    def whole(self) -> Grid:
        """All points, those of the mesh first, and the cells by which a displacement goes on between them."""
        mesh = self.problem.mesh
        if self.grid is not None:
            return self.grid
        if isinstance(self.potential, Refined):
            elements = self.potential.elements
            return Grid(self.potential.nodes, {f"{mesh.kind.vtk}{elements.shape[1]}": elements})
        return Grid(mesh.nodes, {} if mesh.element == "line" else mesh.cells)

    @property
    def is_cloud(self) -> bool:
        """Whether it was read as points alone, which lines of its mesh join for no more than order."""
        return self.grid is not None and not self.grid.cells

    @property
    def load_factor(self) -> float:
        """The last load level reached; of a surface that was read, its own."""
        if self.states:
            return self.states[-1].load_factor
        only = self.surface or self.shell
        return only.load_factor if only else 0.0

    @property
    def complete(self) -> bool:
        """Whether the full load was reached, or the whole displacement that was controlled."""
        return bool(self.states and self.states[-1].level == 1.0) or (not self.states and self.load_factor == 1.0)

    @property
    def solved(self) -> bool:
        """Whether it was solved, here or by another program: not where it was read from a file."""
        return self.potential is not None or self.n_unknowns > 0

    @property
    def newton_iterations(self) -> int:
        """All Newton iterations spent."""
        return sum(state.iterations for state in self.states) + (self.best.iterations if self.best else 0)

    def at(self, load_factor: float) -> State | None:
        """Return the state at a level of what the solver was asked for, None where the path has none there."""
        apart = np.abs(np.array([state.level for state in self.states]) - load_factor)
        if not apart.size or np.isnan(apart).all():
            return None
        nearest = int(np.nanargmin(apart))
        return self.states[nearest] if apart[nearest] <= _SAME_LEVEL else None

    @cached_property
    def dictated(self) -> Bools | None:
        """Nodes whose motion supports dictate in all directions, shape (n_nodes,); None where no supports are told."""
        if self.held is not None:
            return np.asarray(self.held.all(axis=1))
        return np.asarray(self.problem.loading.held.all(axis=1)) if self.problem.stated else None

    def support_forces(self, state: State) -> tuple[SupportForce, ...]:
        """Return force and torque of each moved support at a state; empty where none moves or they are not known."""
        if state.supports is not None:
            return state.supports
        if not self.problem.stated or not np.isfinite(state.reaction).all():
            return ()
        return support_forces(self.problem, state.positions, state.reaction, state.load_factor)

    @cached_property
    def _leading(self) -> int | None:
        return leading_support(self.problem)

    def applied_force(self, state: State) -> Floats:
        """Return the total applied force [N], shape (dim,); without loads, that of the support that moves most.

        Of supports that move equally far, the first stated. Not a number where it is not known.
        """
        if not self.problem.stated or not self.problem.loading.driven_by_motion:
            return state.applied_force
        of_leading = [one.force for one in self.support_forces(state) if one.support == self._leading]
        return of_leading[0] if of_leading else np.full(self.problem.mesh.dim, math.nan)


Solver = Newton | DisplacementControl | ArcLength


def solve(
    problem: Problem,
    model: Model | Potential,
    solver: Solver | None = None,
    report: Reporter | None = None,
) -> Solution:
    """Follow the equilibria of `problem` under `model` from no load to the full one.

    `solver` is Newton, which takes the load up in steps and keeps to stable states, or DisplacementControl or
    ArcLength, which go on past limit points, through unstable states too.
    `model` is Springs, Fem, or a potential such as a SpringNetwork, which is taken as it is (the
    problem then needs no material). A failure is not an exception: see Solution.status and Solution.best;
    what a library raises on the way ends the path, and so does a TimeoutError that `report` raises.
    Raises ModelError where the model does not fit the problem.
    """
    if not isinstance(model, Potential) and not hasattr(model, "potential"):
        raise ModelError(f"{model!r} is no model: give Springs(rule=...), Fem(law=...) or a SpringNetwork")
    realised = moduli(problem.homogeneous[0], model) if isinstance(model, Springs) else None
    from truespring.kernels.threads import compiling

    with compiling() as compiled:
        started = time.perf_counter()
        path = _solve(problem, model, solver or Newton(), report)
        return replace(path, seconds=time.perf_counter() - started - compiled(), moduli=realised)


def _solve(problem: Problem, model: Model | Potential, solver: Solver, report: Reporter | None) -> Solution:
    potential = model if isinstance(model, Potential) else model.potential(problem)
    if potential.nodes.shape != problem.mesh.nodes.shape and not isinstance(potential, Refined):
        raise ModelError(
            f"the potential has nodes of shape {potential.nodes.shape}, the problem {problem.mesh.nodes.shape}"
        )
    if isinstance(model, SpringNetwork):
        refuse_mechanism(model, problem.loading.held)
    if isinstance(solver, DisplacementControl):
        refuse_control(problem, solver)
    linear = isinstance(model, Fem | MassTensor) and not LAWS[model.law].finite
    loading = potential.loading if isinstance(potential, Refined) else problem.loading
    if linear:
        loading = loading.at_rest(potential.nodes)

    def upright(positions: Floats) -> bool:
        return linear or problem.mesh.smallest_area_ratio(positions) > 0

    match solver:
        case Newton():
            follow = solver.follow(potential, loading, report, upright)
        case DisplacementControl():
            follow = solver.follow(potential, loading, _weights(problem, potential, solver), report)
        case ArcLength():
            follow = solver.follow(potential, loading, report)
    found, broken = _followed(follow, potential, loading)
    found, drowned = _up_to_drowned(problem, found)
    states = tuple(_state(problem, potential, loading, one) for one in found if one.converged)
    best = None if found[-1].converged else _state(problem, potential, loading, found[-1])
    known = () if isinstance(model, Potential) else model_warnings(problem, model)
    label, kind = _named(model)
    return Solution(
        problem=problem,
        label=label,
        kind=kind,
        states=states,
        status=Status.NOT_CONVERGED if broken else _status(states, best, linear, isinstance(solver, Newton)),
        warnings=(*known, *broken, *_path_warnings(states, best, linear, isinstance(solver, Newton), drowned)),
        best=best,
        potential=potential,
        n_unknowns=int((~loading.held).sum()),
        cost=found[-1].cost,
    )


def _up_to_drowned(problem: Problem, follow: Iterable[Equilibrium]) -> tuple[list[Equilibrium], bool]:
    """Return the states of a path, and whether the load of the last one drowns in rounding.

    Such a state, whose unbalanced force is not small beside the load, ends the path and has not converged.
    """
    found: list[Equilibrium] = []
    for one in follow:
        unbalanced = one.converged and one.load_factor != 0 and one.residual > _UNBALANCED
        if unbalanced and not _moved_by_more_than_rounding(problem, one.load_factor):
            return [*found, replace(one, converged=False)], True
        found.append(one)
    return found, False


def _moved_by_more_than_rounding(problem: Problem, load_factor: float) -> bool:
    """Whether motion alone drives the body, by more than its coordinates are rounded.

    The unbalanced force is then rounding beside what the motion takes. Where that is nothing, as of a body moved as a
    whole, all forces are rounding, and their ratio tells nothing.
    """
    loading, nodes = problem.loading, problem.mesh.nodes
    rounding = float(np.finfo(float).eps * np.abs(nodes).max())
    moved = float(np.abs(loading.motion(load_factor)).max())
    return loading.driven_by_motion and _UNBALANCED * moved > rounding


def _followed(
    follow: Iterator[Equilibrium], potential: Potential, loading: Loading
) -> tuple[list[Equilibrium], tuple[str, ...]]:
    """The states up to where the path or an exception ends, at least that at rest; and what is to be said of it."""
    found: list[Equilibrium] = []
    try:
        for one in follow:
            found.append(one)
    except TruespringError:
        raise
    except (ArithmeticError, ValueError, RuntimeError, MemoryError, TimeoutError) as error:  # as numpy and SciPy raise
        at = found[-1].load_factor if found else 0.0
        broken = (f"stopped beyond load factor {at:.6g}: {error_words(error)}; {Status.NOT_CONVERGED.advice}",)
        return found or [_rest(potential.nodes)], broken
    return found, ()


def error_words(error: BaseException) -> str:
    """Return what an exception says, in one line: its kind too where it is not meant for the reader."""
    if isinstance(error, MemoryError):
        return "out of memory: take fewer elements"
    text = one_line(str(error))
    return text if isinstance(error, TruespringError | TimeoutError) else f"{type(error).__name__}: {text}"


def _rest(nodes: Floats) -> Equilibrium:
    """The body without load, of whose stability nothing is known."""
    still = np.zeros_like(nodes)
    return Equilibrium(0.0, nodes, still, still, 0.0, 0, 0.0, converged=True)


def _named(model: object) -> tuple[str, str]:
    """The label and the kind of a model."""
    if isinstance(model, SpringNetwork):
        return "springs", "springs"
    return getattr(model, "label", type(model).__name__), getattr(model, "kind", "potential")


def unsolved(problem: Problem, model: object, error: BaseException) -> Solution:
    """Return the path of a model that an exception ended before anything was known: the body at rest, and why."""
    label, kind = _named(model)
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
        label=label,
        kind=kind,
        states=(state,),
        status=Status.NOT_CONVERGED,
        warnings=(f"not solved: {error_words(error)}",),
        n_unknowns=int((~problem.loading.held).sum()),
    )


def refuse_control(problem: Problem, control: DisplacementControl) -> None:
    """Raise ProblemError where a support dictates what is to be controlled, or the body has no such direction."""
    axes = AXES[: problem.mesh.dim]
    if control.direction not in axes:
        raise ProblemError(f"direction = {control.direction!r}: allowed are {', '.join(axes)}")
    nodes = select(problem.mesh, control.on)  # type: ignore[arg-type]
    if problem.loading.held[nodes, axes.index(control.direction)].any():
        raise ProblemError("the displacement that is controlled is held by a support: choose another")


def _weights(problem: Problem, potential: Potential, control: DisplacementControl) -> Floats:
    """What makes the controlled displacement of those of all nodes, shape (n_nodes, dim): a mean."""
    axes = AXES[: problem.mesh.dim]
    weights = np.zeros(potential.nodes.shape)
    nodes = select(problem.mesh, control.on)  # type: ignore[arg-type]
    weights[nodes, axes.index(control.direction)] = 1.0 / len(nodes)
    return weights


def _state(problem: Problem, potential: Potential, loading: Loading, found: Equilibrium) -> State:
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
        area_ratio=problem.mesh.smallest_area_ratio(positions),
        stretch=None if stretch is None else (float(stretch.min()), float(stretch.max())),
    )


def _level(found: Equilibrium) -> float:
    if found.critical:
        return math.nan
    return found.load_factor if found.level is None else found.level


def _status(states: tuple[State, ...], best: State | None, linear: bool, keeps_to_stable: bool) -> Status:
    if best is not None:
        return Status.NOT_CONVERGED
    if any(state.area_ratio <= 0 for state in states) and not linear:
        return Status.INVERTED
    if keeps_to_stable and any(state.negative_eigenvalues for state in states):
        return Status.UNSTABLE
    return Status.CONVERGED


def _path_warnings(
    states: tuple[State, ...], best: State | None, linear: bool, keeps_to_stable: bool, drowned: bool
) -> tuple[str, ...]:
    warnings = []
    if best is not None:
        bad = [
            state.load_factor
            for state in states
            if state.negative_eigenvalues or (state.area_ratio <= 0 and not linear)
        ]
        good = [state.load_factor for state in states if not bad or state.load_factor < bad[0]]
        last = f"{good[-1]:.6g}" if good else "none"
        why = _DROWNED if drowned else Status.NOT_CONVERGED.advice
        warnings.append(
            best.reason
            or f"load factor {best.load_factor:.6g} was not reached (relative residual {best.residual:.1e}); "
            f"last good load factor: {last}; {why}"
        )
    inverted = [state for state in states if state.area_ratio <= 0]
    what = "area" if states and states[0].positions.shape[1] == 2 else "volume"
    if inverted:
        advice = "a linear model does not notice" if linear else Status.INVERTED.advice
        warnings.append(
            f"inverted from load factor {inverted[0].load_factor:.6g} on "
            f"(smallest {what} ratio {min(state.area_ratio for state in inverted):.3g}): {advice}"
        )
    for state in states:
        if state.critical:
            warnings.append(_critical_warning(state))
    unstable = [state for state in states if state.negative_eigenvalues]
    if unstable and keeps_to_stable:
        count = unstable[0].negative_eigenvalues
        warnings.append(
            f"unstable at load factor {unstable[0].load_factor:.6g} ({count} negative "
            f"eigenvalue{'s' if count != 1 else ''} of the tangent): {Status.UNSTABLE.advice}"
        )
    branched = [state for state in states if state.branched]
    if branched:
        warnings.append(
            f"stability was lost before load factor {branched[0].load_factor:.6g}: the path goes on along a stable "
            "branch nearby (buckling); the side it took is arbitrary"
        )
    snapped = [state for state in states if state.snapped]
    if snapped:
        warnings.append(
            f"just before load factor {snapped[0].load_factor:.6g} the body moved much further than the step before "
            "lets expect: it may have snapped past unstable states, which are not on the path; more load_steps tell"
        )
    loose = max((state.residual for state in states if state.load_factor > 0), default=0.0)
    if loose > _LOOSE:
        warnings.append(f"balanced only to a relative residual of {loose:.1e}: the load drowns in rounding")
    if any(state.negative_eigenvalues is None for state in states):
        warnings.append("stability not proven: the inertia of a tangent could not be found")
    return tuple(warnings)


_DROWNED = (
    "the load is lost in rounding: it is too small for the stiffness and the coordinates of the body; apply a larger "
    "load, or place the body near the origin"
)


def _critical_warning(state: State) -> str:
    assert state.mode is not None  # a critical point has one
    node, axis = np.unravel_index(int(np.abs(state.mode).argmax()), state.mode.shape)
    place = f"node {node} moves most, along {AXES[axis]}"
    if state.critical == "limit point":
        return f"limit point at load factor {state.load_factor:.6g}: under this load the body snaps through; {place}"
    return (
        f"bifurcation at load factor {state.load_factor:.6g}: the body buckles to the side; {place}. "
        "The path goes on straight ahead, which a real body would leave"
    )
