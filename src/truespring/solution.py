"""The result of solve: a Solution, its States, and the Status in which it ended."""

import math
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.conditions import Refined
from truespring.mesh import Grid, Shell, Surface
from truespring.models import Moduli
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.reactions import SupportForce, leading_support, support_forces
from truespring.solvers import Cost

#: Levels this near are one: other programs print six digits.
SAME_LEVEL = 2e-6


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
        critical: "limit point" or "bifurcation" where stability changes there, else None.
        mode: the way in which the body gives way at a critical point, largest component 1, shape (n_nodes, dim).
        level: the share of what the solver controls, 0 to 1: under load control the load factor, under displacement
            control the share of the displacement; None at a critical point, which lies between levels.
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
    critical: str | None = None
    mode: Floats | None = None
    level: float | None = None
    supports: tuple[SupportForce, ...] | None = None
    reason: str = ""

    @property
    def loaded(self) -> bool:
        """Whether the state is at a level above zero."""
        return self.level is not None and self.level > 0

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
        moduli: effective moduli on the problem's own material, None for other models and networks.
        finite: whether strains are finite, false for a linear theory; None where not known, as of a file.
        has_springs: whether its potential is springs, see Model.
        element: the interpolation of finite elements, one of ELEMENTS; None of other models.
        lines: the name of the lines that it is drawn by, see Model.
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
    finite: bool | None = None
    has_springs: bool = False
    element: str | None = None
    lines: str = "springs"
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

    def at(self, level: float | None) -> State | None:
        """Return the state at a level, see State.level; None where the path has none there, and for None."""
        if level is None:
            return None
        apart = {abs(state.level - level): state for state in reversed(self.states) if state.level is not None}
        return apart[min(apart)] if apart and min(apart) <= SAME_LEVEL else None

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
