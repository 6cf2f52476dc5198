"""Newton's method with load steps of adaptive size, from no load to the full load."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from truespring.arrays import Floats
from truespring.conditions import Loading
from truespring.errors import ProblemError, nearest
from truespring.linear.choice import LinearSolver, check_linear, choose
from truespring.potential import Potential, Stressed, volumes_of
from truespring.ranks import layout_of
from truespring.solvers import mixed
from truespring.solvers.balance import Balance, Equilibrium, Found, Reporter
from truespring.solvers.branching import stabilised
from truespring.solvers.coarse import METHOD, Jump, jump_from_coarser
from truespring.solvers.doubts import doubt, snapped
from truespring.solvers.line_search import descend
from truespring.solvers.solver import Geometry, Solver

#: Allowed values of `method`.
METHODS = ("auto", "mixed", "line-search")
# Levels nearer than this are equal.
_SAME = 1e-9
# Slip in a load step at which regularised friction is full, as a share of the body's size.
_CREEP = 1e-5
# Friction has the normal forces of the last iterate: they are renewed until that changes the balance by less than the
# share, at most so often.
_LAG, _MAX_LAGS = 1e-4, 5


@dataclass(frozen=True, slots=True)
class Newton(Solver):
    """Newton's method with load steps, halved if they fail and doubled again if they succeed.

    Attributes:
        load_steps: number of load steps; the states at k / load_steps are all computed and recorded.
        tolerance: relative residual below which a state is in equilibrium [-].
        max_iterations: Newton iterations at one level before its step is halved.
        max_cutbacks: largest number of halvings of a load step.
        method: "auto" uses mixed integration points if the potential has a stress, and line search on the energy if
            these find no stable state nearby; "mixed" and "line-search" use one of them only.
        linear: "auto" chooses by size and dimension; "multigrid"; "petsc", which several processes may share;
            "direct" for the first installed library of factorisations, or one of them: "scipy", "rslab", "pardiso".
        coarse_start: whether large load steps on large lattices start from the solution on coarser meshes.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> solution = ts.solve(problem, ts.Springs("gaussian"), ts.Newton(load_steps=2))
        >>> solution.load_factors.tolist()
        [0.0, 0.5, 1.0]
    """

    load_steps: int = 10
    tolerance: float = 1e-10
    max_iterations: int = 50
    max_cutbacks: int = 6
    method: str = "auto"
    linear: str = "auto"
    coarse_start: bool = True

    def __post_init__(self) -> None:
        if self.load_steps < 1 or self.max_iterations < 1 or self.max_cutbacks < 0:
            raise ProblemError("load_steps and max_iterations must be at least 1, max_cutbacks at least 0")
        if not 0 < self.tolerance < 1:
            raise ProblemError(f"tolerance = {self.tolerance}: must be between 0 and 1")
        if self.method not in METHODS:
            raise ProblemError(
                f"method = '{self.method}' is unknown{nearest(self.method, METHODS)}; allowed: {', '.join(METHODS)}"
            )
        check_linear(self.linear)

    def follow(
        self,
        potential: Potential,
        loading: Loading,
        report: Reporter | None = None,
        geometry: Geometry | None = None,
    ) -> Iterator[Equilibrium]:
        """Yield the equilibria from load factor 0 to 1 in order.

        If a level cannot be reached, the last state is that of least residual there, not converged. Equilibria that
        `geometry` does not admit (an inverted element) are accepted only if the smallest load step leads to no other.
        If the body is unstable without load, that state is the only one.
        """
        geometry = geometry or Geometry()
        admissible = geometry.admissible
        linear = linear_of(self.linear, potential, loading, geometry)
        balance = Balance(potential, loading, self.tolerance, self.max_iterations, linear, report)
        last = descend(balance, 0.0, potential.nodes)
        yield self._with_cost(last.state, balance)
        if last.state.negative_eigenvalues:
            return
        jump = self._jump(balance, geometry, last.state)
        previous: Equilibrium | None = None
        step, spent = 1.0 / self.load_steps, 0
        smallest, strict, ever_refused = step / 2**self.max_cutbacks, admissible(potential.nodes), False
        while last.state.converged and last.state.load_factor < 1.0:
            level = self._next_level(last.state.load_factor, step, loading.corners)
            previous = _before(loading, previous, last.state, level)
            balance.loading = loading.since(last.state.positions, last.state.load_factor, _CREEP * balance.size)
            reached = _settled(balance, level, self._find(balance, level, last, previous, admissible, jump))
            spent += reached.state.iterations
            refused = reached.state.converged and strict and not admissible(reached.state.positions)
            ever_refused = ever_refused or refused
            if refused or not reached.state.converged:
                if step > smallest:
                    step = (reached.state.load_factor - last.state.load_factor) / 2
                    continue
                if ever_refused and strict:
                    strict, step = False, 1.0 / self.load_steps
                    continue
            moved_far = snapped(reached.state, last.state, previous, length=balance.norm)
            state = replace(reached.state, iterations=spent, snapped=moved_far)
            previous, last, spent = last.state, reached._replace(state=state), 0
            step = min(2 * step, 1.0 / self.load_steps)
            yield self._with_cost(state, balance, jump)

    def starting_at(self, start: Callable[[Potential], Floats], max_iterations: int) -> "Nearby":
        """Return Newton's method at full load only, from the positions that `start` returns for a potential."""
        return Nearby(1, self.tolerance, max_iterations, method=self.method, linear=self.linear, start=start)

    def _with_cost(self, state: Equilibrium, balance: Balance, jump: Jump | None = None) -> Equilibrium:
        """Return a state with methods and costs up to now."""
        newton = "line search" if self._searches(balance) else METHOD
        return replace(state, cost=balance.cost(newton, () if jump is None else jump.costs))

    def _searches(self, balance: Balance) -> bool:
        """Return whether line search is the first method."""
        return self.method == "line-search" or not isinstance(balance.potential, Stressed)

    def _jump(self, balance: Balance, geometry: Geometry, rest: Equilibrium) -> Jump | None:
        """Return starts from coarser meshes.

        None without any, if the body deforms without load, or if stability, which a start needs, is not determined.
        """
        loading = balance.loading
        if not self.coarse_start or self._searches(balance) or not loading.proportional or not loading.symmetric:
            return None
        if not np.array_equal(rest.positions, balance.potential.nodes):
            return None
        return jump_from_coarser(balance, geometry, self.linear, 1.0 / self.load_steps)

    def _find(
        self,
        balance: Balance,
        level: float,
        last: Found,
        previous: Equilibrium | None,
        admissible: Callable[[Floats], bool],
        jump: Jump | None,
    ) -> Found:
        """Return the equilibrium at `level`: from a coarser mesh, else from the last state on this one."""
        jumped, why = (None, "") if jump is None else jump.find(level, last.state, previous)
        if jumped is not None and not why:
            return jumped
        found = self._find_here(balance, level, last, previous, admissible)
        spent = found.state.iterations + (jumped.state.iterations if jumped else 0)
        return found._replace(state=replace(found.state, iterations=spent))

    def _find_here(
        self,
        balance: Balance,
        level: float,
        last: Found,
        previous: Equilibrium | None,
        admissible: Callable[[Floats], bool],
    ) -> Found:
        """Return the equilibrium at `level`: by mixed integration points, else by line search."""
        found = None
        if not self._searches(balance):
            found = self._find_mixed(balance, level, last.state, previous)
            why = doubt(found.state, last.state, previous, admissible, balance.norm)
            if self.method == "mixed" or not why:
                return found
            balance.note(f"line search at load factor {level:.6g}: mixed integration points {why}")
        searched = _find_by_search(balance, level, last, previous)
        spent = searched.state.iterations + (found.state.iterations if found else 0)
        return searched._replace(state=replace(searched.state, iterations=spent))

    def _find_mixed(self, balance: Balance, level: float, last: Equilibrium, previous: Equilibrium | None) -> Found:
        """Return the equilibrium at `level` by mixed integration points."""
        start = mixed.start_from(balance, level, last, previous)
        assert start is not None  # the potential has a stress
        return mixed.converge(balance, level, start)

    def _next_level(self, load_factor: float, step: float, corners: Sequence[float]) -> float:
        """Return the load factor plus a step, at most the next of k / load_steps and of the corners of histories."""
        requested = (np.floor(load_factor * self.load_steps + _SAME) + 1) / self.load_steps
        requested = min([requested, *(one for one in corners if one > load_factor + _SAME)])
        return float(requested if load_factor + step > requested - _SAME else load_factor + step)


@dataclass(frozen=True, slots=True, eq=False)
class Nearby(Newton):
    """Newton's method at full load only, from given positions.

    The path has one state, on the branch of the start.

    Attributes:
        start: returns the positions of the nodes of a potential [m], shape (n_nodes, dim); prescribed directions are
            overwritten. None starts from the undeformed body.
    """

    start: Callable[[Potential], Floats] | None = None

    def follow(
        self,
        potential: Potential,
        loading: Loading,
        report: Reporter | None = None,
        geometry: Geometry | None = None,
    ) -> Iterator[Equilibrium]:
        """Yield the state at full load; not converged if no equilibrium was found from the start."""
        geometry = geometry or Geometry()
        admissible = geometry.admissible
        balance = Balance(
            potential,
            loading,
            self.tolerance,
            self.max_iterations,
            linear_of(self.linear, potential, loading, geometry),
            report,
        )
        positions = potential.nodes.copy() if self.start is None else self.start(potential)
        positions[loading.held] = (potential.nodes + loading.motion())[loading.held]
        positions = loading.cleared(positions, 1.0)
        found = None
        if isinstance(potential, Stressed):
            found = mixed.converge(balance, 1.0, mixed.Start(positions, potential.stress(positions)))
        if found is None or not found.state.converged or not admissible(found.state.positions):
            found = descend(balance, 1.0, positions)
        yield self._with_cost(found.state, balance)


def linear_of(name: str, potential: Potential, loading: Loading, geometry: Geometry) -> LinearSolver:
    """Return the linear solver `name` for a potential, see `choose`."""
    volumes, layout = volumes_of(potential), layout_of(potential)
    return choose(
        name, potential.nodes, loading.held, geometry.interpolations, volumes, layout, symmetric=loading.symmetric
    )


def _find_by_search(balance: Balance, level: float, last: Found, previous: Equilibrium | None) -> Found:
    """Return the equilibrium at `level` by line search, from the prediction of least unbalanced force."""
    starts = (balance.loading.cleared(guess, level) for guess in _predictions(balance, level, last, previous))
    guesses = [start for start in starts if np.isfinite(balance.total_energy(start, level)[0])]
    if not guesses:
        state = last.state
        return Found(replace(state, load_factor=level, iterations=0, residual=np.inf, converged=False))
    start = min(guesses, key=lambda guess: balance.norm(balance.force(guess, level)))
    return stabilised(balance, descend(balance, level, start))


def _before(loading: Loading, previous: Equilibrium | None, last: Equilibrium, level: float) -> Equilibrium | None:
    """Return the state before the last one, None if their difference says nothing about the step to `level`.

    It does not beyond a corner of a history, and while or before a tool touches the body for the first time.
    """
    if previous is None or any(previous.load_factor < corner < level - _SAME for corner in loading.corners):
        return None
    idle = loading.interactions and any(loading.vanishes(one.load_factor, one.positions) for one in (previous, last))
    return None if idle else previous


def _settled(balance: Balance, level: float, found: Found) -> Found:
    """Return the equilibrium whose friction has its own normal forces, if renewing them converges."""
    if not balance.loading.interactions:
        return found
    for _ in range(_MAX_LAGS):
        state, before = found.state, balance.loading
        lagged = before.lagged(state.positions, level)
        force, scale = balance.unbalanced(state.internal_force, lagged.force(state.positions, level))
        if not state.converged or balance.norm(force) <= _LAG * scale:
            break
        balance.loading = lagged
        again = descend(balance, level, state.positions)
        found = again if again.state.converged else found
        found = found._replace(state=replace(found.state, iterations=state.iterations + again.state.iterations))
        if not again.state.converged:
            balance.loading = before
            break
    return found


def _predictions(balance: Balance, level: float, last: Found, previous: Equilibrium | None) -> Iterator[Floats]:
    """Yield start positions for a level [m]: those of the last state, along the tangent, and by extrapolation."""
    state, loading = last.state, balance.loading
    advance = level - state.load_factor
    motion = loading.motion(level) - loading.motion(state.load_factor)
    yield state.positions + motion
    if last.tangent is not None:
        push = loading.force(state.positions, level) - loading.force(state.positions, state.load_factor)
        if motion.any():
            push = push - balance.product(balance.hessian(state.positions, state.load_factor), motion)
        push = np.where(balance.free, push, 0.0)
        yield state.positions + motion + last.tangent.solve(push)
    if previous is not None and not state.branched:
        ratio = advance / (state.load_factor - previous.load_factor)
        extrapolated = state.positions + ratio * (state.positions - previous.positions)
        yield np.where(loading.held, state.positions + motion, extrapolated)
