"""Path following past limit points: displacement control and arc length, with the load factor as an unknown.

The constraint w . u = c is added to the balance of forces (Riks 1979; Batoz and Dhatt 1979). For displacement control w
selects the controlled displacement, for arc length it is the tangent of the path (Crisfield's cylinder, linearised).
If the number of negative eigenvalues changes between two states, the critical point between them is computed: a limit
point if the load has a component along the mode, else a bifurcation (Wriggers and Simo 1990).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.conditions import Loading
from truespring.errors import ProblemError
from truespring.linear import check_linear, choose
from truespring.linear.direct import FACTORISERS, Factorisation, SingularMatrixError
from truespring.linear.gradients import norm
from truespring.potential import Potential, SparseMatrix
from truespring.solvers.balance import Balance, Equilibrium, Found, Reporter, Watch
from truespring.solvers.cost import Cost
from truespring.solvers.line_search import descend
from truespring.solvers.solver import Geometry, Solver

_AXES = "xyz"
# Target number of iterations of a step: after fewer the next step is longer, after more it is shorter.
_TARGET_ITERATIONS = 4
# Smallest cosine of the angle between the tangents of the path before and after a step; else the step is cut.
_STRAIGHT = 0.5
# Shortest step as a share of the first one.
_SHORTEST = 2.0**-12
_NO_DIRECTION = (
    "the path has no initial direction: the load moves no node, or a part of the body has no stiffness against it"
)
# The load does not move the controlled displacement if the first step would move the body by this multiple of its size.
_FAR = 100.0
# If no equilibrium is found at a critical point, the nearest state stands for it if its eigenvalue is below this share
# of those at the ends of the step: where the tangent is nearly singular, rounding errors move the body along the mode.
_NEAR = 1e-2
# Number of bisections towards such a point.
_BISECTIONS = 6

# Accuracy of the position of a critical point, as a share of the step.
_PLACE = 1e-12
# A critical point is a bifurcation if the component of the load along the mode is below this share of the load.
_NO_PART = 1e-3


@dataclass(frozen=True, slots=True)
class DisplacementControl(Solver):
    """Prescribe the mean displacement of a selection of nodes along an axis, in equal steps.

    Attributes:
        on: selection, as of supports and loads.
        direction: "x", "y" or "z".
        to: displacement at the last step [m].
        steps: number of steps; the state after each is recorded.
        tolerance: relative residual below which a state is in equilibrium [-].
        max_iterations: Newton iterations for one state before its step is halved.
        linear: library of factorisations, "scipy", "rslab" or "pardiso", or "direct" for the first that is installed.

    Example:
        >>> import truespring as ts
        >>> import numpy as np
        >>> nodes = np.array([(0.0, 0.0), (1.0, 0.25), (2.0, 0.0)])
        >>> truss = ts.SpringNetwork(nodes, np.array([(0, 1), (1, 2)]), stiffness=np.array([1.0, 1.0]))
        >>> problem = ts.Problem(
        ...     truss.mesh, supports=[ts.Fixed([0, 2]), ts.Fixed([1], fix=["x"])], loads=[ts.Force([1], (0.0, -0.02))]
        ... )
        >>> path = ts.solve(problem, truss, ts.DisplacementControl(on=[1], direction="y", to=-0.5, steps=2))
        >>> [round(float(state.displacement[1, 1]), 3) for state in path.states]  # with the two limit points
        [0.0, -0.107, -0.25, -0.393]
    """

    on: object
    direction: str
    to: float
    steps: int = 20
    tolerance: float = 1e-10
    max_iterations: int = 20
    linear: str = "direct"

    follows_load = False
    keeps_to_stable_states = False

    def __post_init__(self) -> None:
        _check(self.steps, self.max_iterations, self.tolerance, self.linear)
        if not (np.isfinite(self.to) and self.to):
            raise ProblemError(f"to = {self.to!r} m: the displacement must be finite and not zero")

    @property
    def load_steps(self) -> int:  # type: ignore[override]
        """The number of steps."""
        return self.steps

    def check(self, loading: Loading, geometry: Geometry) -> None:
        """Raise ProblemError if a support holds the controlled displacement, or the body has no such direction."""
        _check_proportional(loading)
        axes = _AXES[: loading.held.shape[1]]
        if self.direction not in axes:
            raise ProblemError(f"direction = {self.direction!r}: allowed: {', '.join(axes)}")
        if loading.held[geometry.select(self.on), axes.index(self.direction)].any():
            raise ProblemError("a support holds the controlled displacement: choose another selection or direction")

    def follow(
        self, potential: Potential, loading: Loading, report: Reporter | None = None, geometry: Geometry | None = None
    ) -> Iterator[Equilibrium]:
        """Yield the equilibria in the order of the path.

        If a state cannot be reached, the last one yielded is that of least residual there, not converged.
        """
        geometry = geometry or Geometry()
        self.check(loading, geometry)
        nodes = geometry.select(self.on)
        weights = np.zeros(potential.nodes.shape)  # of the mean
        weights[nodes, _AXES.index(self.direction)] = 1.0 / len(nodes)
        balance = _balance(potential, loading, self, report)
        yield from _controlled(balance, weights, self.to, self.steps)


@dataclass(frozen=True, slots=True)
class ArcLength(Solver):
    """Follow the path from no load to the full load through all limit points, by arc length.

    Attributes:
        load_steps: the first step has the length of the initial response to 1 / load_steps of the load.
        max_steps: largest number of states; the path ends there even if the full load was not reached.
        longest: largest length of a step over the first one.
        tolerance: relative residual below which a state is in equilibrium [-].
        max_iterations: Newton iterations for one state before its step is halved.
        linear: library of factorisations, "scipy", "rslab" or "pardiso", or "direct" for the first that is installed.

    Example:
        >>> import truespring as ts
        >>> import numpy as np
        >>> nodes = np.array([(0.0, 0.0), (1.0, 0.25), (2.0, 0.0)])
        >>> truss = ts.SpringNetwork(nodes, np.array([(0, 1), (1, 2)]), stiffness=np.array([1.0, 1.0]))
        >>> problem = ts.Problem(
        ...     truss.mesh, supports=[ts.Fixed([0, 2]), ts.Fixed([1], fix=["x"])], loads=[ts.Force([1], (0.0, -0.02))]
        ... )
        >>> path = ts.solve(problem, truss, ts.ArcLength())  # snaps through: some states are unstable
        >>> path.load_factor, any(state.negative_eigenvalues for state in path.states)
        (1.0, True)
    """

    load_steps: int = 10
    max_steps: int = 200
    longest: float = 4.0
    tolerance: float = 1e-10
    max_iterations: int = 20
    linear: str = "direct"

    follows_load = False
    keeps_to_stable_states = False

    def check(self, loading: Loading, geometry: Geometry) -> None:
        """Raise ProblemError for loads that do not grow in proportion."""
        _check_proportional(loading)

    def __post_init__(self) -> None:
        _check(self.load_steps, self.max_iterations, self.tolerance, self.linear)
        if self.max_steps < 1 or not self.longest >= 1:
            raise ProblemError("max_steps and longest must be at least 1")

    def follow(
        self, potential: Potential, loading: Loading, report: Reporter | None = None, geometry: Geometry | None = None
    ) -> Iterator[Equilibrium]:
        """Yield the equilibria in the order of the path.

        If a state cannot be reached, the last one yielded is that of least residual there, not converged.
        """
        _check_proportional(loading)
        balance = _balance(potential, loading, self, report)
        yield from _along(balance, 1.0 / self.load_steps, self.max_steps, self.longest)


def _check_proportional(loading: Loading) -> None:
    """Raise ProblemError for loads that do not grow in proportion, and for tools and grasps."""
    if not loading.proportional:
        raise ProblemError(
            "a path with the load factor as an unknown needs loads in proportion, without histories (over), tools and "
            "grasps: use control by load"
        )


def _check(steps: int, max_iterations: int, tolerance: float, linear: str) -> None:
    """Raise ProblemError for settings that are not allowed."""
    if steps < 1 or max_iterations < 1:
        raise ProblemError("steps and max_iterations must be at least 1")
    if not 0 < tolerance < 1:
        raise ProblemError(f"tolerance = {tolerance}: must be between 0 and 1")
    check_linear(linear)
    if linear not in ("direct", *FACTORISERS):
        allowed = ", ".join(("direct", *FACTORISERS))
        raise ProblemError(f"linear = '{linear}': path following needs factorisations; allowed: {allowed}")


def _balance(
    potential: Potential, loading: Loading, control: DisplacementControl | ArcLength, report: Reporter | None
) -> Balance:
    """Return the balance of forces with the settings of a solver."""
    linear = choose(control.linear, potential.nodes, loading.held, symmetric=loading.symmetric)
    return Balance(potential, loading, control.tolerance, control.max_iterations, linear, report)


@dataclass(frozen=True, eq=False)
class _Constraint:
    """The constraint w . (x - X) + share lambda = target.

    Attributes:
        weights: w, shape (n_nodes, dim).
        share: factor of the load factor lambda.
        target: right side.
    """

    weights: Floats
    share: float
    target: float


def _controlled(balance: Balance, weights: Floats, to: float, steps: int) -> Iterator[Equilibrium]:
    """Yield the states after equal steps of a displacement; steps that fail are halved."""
    last = _at_rest(balance)
    yield last.state
    if reason := _idle(balance, last.state, weights, to / steps):
        yield _with_cost(balance, replace(last.state, converged=False, residual=np.inf, reason=reason))
        return
    reached, level, step = 0.0, 1, to / steps
    while last.state.converged and level <= steps:
        regular = to * (level / steps)
        goal = regular if abs(regular - reached) <= abs(step) * (1 + 1e-9) else reached + step
        there = _corrected(balance, last.state, _Constraint(weights, 0.0, goal))
        if not there.state.converged:
            if abs(step) > _SHORTEST * abs(to / steps):
                step /= 2
                continue
            yield _with_cost(balance, there.state)
            return
        yield from _critical(balance, last, there, weights)
        there = there._replace(state=replace(there.state, level=level / steps if goal == regular else goal / to))
        yield _with_cost(balance, there.state)
        last, reached = there, goal
        if goal == regular:
            level += 1
        step = np.sign(to) * min(2 * abs(step), abs(to / steps))


def _idle(balance: Balance, rest: Equilibrium, weights: Floats, step: float) -> str:
    """Return why the load cannot be controlled by this displacement, empty if it can; judged without load."""
    tangent = _tangent(balance, rest, None)
    if tangent is None:
        return ""
    controlled = abs(float((weights * tangent[0]).sum()))
    moved = float(np.abs(tangent[0]).max())
    if abs(step) * moved <= _FAR * balance.size * controlled:
        return ""
    return (
        f"the load does not move the controlled displacement: initially it is {controlled / moved:.1e} times that of "
        "the node that moves most; control a displacement along the load, or use arc length"
    )


def _along(balance: Balance, first: float, max_steps: int, longest: float) -> Iterator[Equilibrium]:
    """Yield the states along the path by arc length, the last one at load factor 1."""
    last = _at_rest(balance)
    yield last.state
    tangent = _tangent(balance, last.state, None)
    if tangent is None:
        yield _with_cost(balance, replace(last.state, converged=False, residual=np.inf, reason=_NO_DIRECTION))
        return
    direction, slope = tangent
    begin = step = first / slope if slope else first
    for _ in range(max_steps):
        while True:
            offset = float((direction * (last.state.positions - balance.potential.nodes)).sum())
            there = _corrected(balance, last.state, _Constraint(direction, 0.0, offset + step), direction * step)
            turned = _tangent(balance, there.state, direction) if there.state.converged else None
            if turned is not None and float((turned[0] * direction).sum()) > _STRAIGHT:
                break
            step /= 2
            if step < _SHORTEST * begin:
                yield _with_cost(balance, replace(there.state, converged=False))
                return
        if there.state.load_factor >= 1.0 - 1e-12:
            ends = _corrected(balance, last.state, _Constraint(np.zeros_like(direction), 1.0, 1.0))
            yield from _critical(balance, last, ends, direction)
            yield _with_cost(balance, ends.state)
            return
        yield from _critical(balance, last, there, direction)
        yield _with_cost(balance, there.state)
        step = min(step * np.clip(_TARGET_ITERATIONS / max(there.state.iterations, 1), 0.5, 2.0), longest * begin)
        last, (direction, slope) = there, turned


def _at_rest(balance: Balance) -> Found:
    """Return the equilibrium without load."""
    found = descend(balance, 0.0, balance.potential.nodes)
    return found._replace(state=_with_cost(balance, found.state))


def _push(balance: Balance, positions: Floats, factor: float) -> Floats:
    """Return minus the derivative of the unbalanced force by the load factor [N], shape (n_nodes, dim).

    The sum of the loads and of the forces that moved supports cause at fixed positions of the other nodes.
    """
    loading, step = balance.loading, 1e-6
    push = loading.force(positions)
    motion = (loading.motion(factor + step) - loading.motion(factor - step)) / (2 * step)
    if motion.any():
        push = push - (balance.hessian(positions, factor) @ motion.ravel()).reshape(push.shape)
    return np.where(balance.free, push, 0.0)


def _tangent(balance: Balance, state: Equilibrium, before: Floats | None) -> tuple[Floats, float] | None:
    """Return the tangent of the path: direction of the positions (norm 1), and change of the load factor [1/m].

    The direction has shape (n_nodes, dim). Its sign continues that of `before`; without one, the load increases. None
    if there is no direction.
    """
    push = _push(balance, state.positions, state.load_factor)
    weights, still = push if before is None else before, np.zeros_like(push)
    tangent = balance.hessian(state.positions, state.load_factor)
    moved, advance = _bordered(balance, tangent, push, _Constraint(weights, 0.0, 0.0), still, norm(weights))
    size = norm(moved)
    if not np.isfinite(size) or not size:
        return None
    sign = 1.0 if before is not None or advance > 0 else -1.0
    return sign * moved / size, sign * advance / size


def _bordered(
    balance: Balance, matrix: SparseMatrix, push: Floats, constraint: _Constraint, force: Floats, gap: float
) -> tuple[Floats, float]:
    """Return the Newton step of positions [m], shape (n_nodes, dim), and of the load factor, under a constraint.

    `force` is the unbalanced force, `gap` the residual of the constraint. The bordered matrix is regular at limit
    points, where the tangent is singular. NaN if the matrix is singular.
    """
    free = np.flatnonzero(balance.free.ravel())
    tangent = sparse.csr_array(matrix)[free][:, free]
    along, weights = push.ravel()[free], constraint.weights.ravel()[free]
    size = float(np.abs(tangent.data).max(initial=0.0))
    from scipy.sparse.linalg import splu

    if not along.any() or not np.isfinite(size):  # nothing changes with the load factor
        return np.full_like(push, np.nan), np.nan
    unit = size / max(norm(along), np.finfo(float).tiny)  # scale of the load factor, for a well-conditioned matrix
    row = np.append(weights, constraint.share * unit)
    large = size / max(norm(row), np.finfo(float).tiny)
    parts: Any = [[tangent, -unit * along[:, None]], [large * row[None, :-1], np.array([[large * row[-1]]])]]
    bordered = sparse.csc_array(sparse.block_array(parts))
    right = np.append(-force.ravel()[free], large * gap)
    try:
        solution = splu(bordered).solve(right)
    except RuntimeError:  # singular: a bifurcation, or a constraint that does not determine the load factor
        return np.full_like(push, np.nan), np.nan
    step = np.zeros(push.size)
    step[free] = solution[:-1]
    return step.reshape(push.shape), float(unit * solution[-1])


def _corrected(balance: Balance, start: Equilibrium, constraint: _Constraint, ahead: Floats | None = None) -> Found:
    """Return the equilibrium that satisfies a constraint, by Newton's method; else the state of least residual.

    The iteration begins at `start`, moved by the step `ahead` [m] if there is one.
    """
    nodes = balance.potential.nodes
    positions = start.positions if ahead is None else start.positions + ahead
    factor, iteration = start.load_factor, 0
    watch = Watch(balance, factor, positions)
    with np.errstate(over="ignore", invalid="ignore"):
        for iteration in range(balance.max_iterations + 1):
            gap = constraint.target - constraint.share * factor
            gap -= float((constraint.weights * (positions - nodes)).sum())
            met = abs(gap) <= 1e-12 * max(abs(constraint.target), norm(constraint.weights) * balance.size)
            watch.load_factor = factor
            if not watch.at(positions, iteration, met):
                break
            tangent = balance.hessian(positions, factor)
            if met and watch.balanced(tangent, positions):
                del tangent
                return watch.equilibrium()
            step, advance = _bordered(balance, tangent, _push(balance, positions, factor), constraint, watch.force, gap)
            if not np.isfinite(advance):
                break
            motion = balance.loading.motion(factor + advance) - balance.loading.motion(factor)
            positions, factor = positions + step + motion, factor + advance
        return watch.failure()


class _Crossing:
    """The eigenvalue nearest to zero over the share of a step at which stability changes."""

    def __init__(self, balance: Balance, last: Found, there: Found, weights: Floats) -> None:
        """Store the ends of the step, and the weights of the constraint between them, shape (n_nodes, dim)."""
        self._balance, self._ends, self._weights = balance, (last.state, there.state), weights
        self._targets = [float((weights * (one.positions - balance.potential.nodes)).sum()) for one in self._ends]
        self._found: dict[float, tuple[Equilibrium, float]] = {}
        self._limit = _NEAR * max(abs(self(0.0)), abs(self(1.0)))

    def __call__(self, share: float) -> float:
        """Return the eigenvalue at a share [N/m], positive before the critical point.

        Zero where the tangent is singular, or so nearly that no equilibrium is found. Raises ArithmeticError if none is
        found farther away.
        """
        state = self._ends[int(share)] if share in (0.0, 1.0) else self._between(share)
        if state.converged:
            singular = state.negative_eigenvalues is None
            size = 0.0 if singular else _nearest_to_zero(self._balance, state)[0]
            self._found[share] = state, size
            return size if state.negative_eigenvalues == self._ends[0].negative_eigenvalues else -size
        if self._found[self._nearest(share)][1] > self._limit:
            raise ArithmeticError("no equilibrium was found between two states of the path")
        return 0.0

    def state(self, share: float) -> Equilibrium:
        """Return the equilibrium at a share; if there is none, the nearest that is found by bisection towards it."""
        self(share)
        near, far = self._nearest(share), share
        for _ in range(0 if near == share else _BISECTIONS):
            middle = (near + far) / 2
            self(middle)
            near, far = (middle, far) if middle in self._found else (near, middle)
        return self._found[near][0]

    def _between(self, share: float) -> Equilibrium:
        """Return the equilibrium at a share by Newton's method, or the state of least residual."""
        (last, there), balance = self._ends, self._balance
        guess = (1 - share) * last.positions + share * there.positions
        factor = (1 - share) * last.load_factor + share * there.load_factor
        target = (1 - share) * self._targets[0] + share * self._targets[1]
        start = replace(last, positions=guess, load_factor=factor)
        return _corrected(balance, start, _Constraint(self._weights, 0.0, target)).state

    def _nearest(self, share: float) -> float:
        return min(self._found, key=lambda known: abs(known - share))


def _critical(balance: Balance, last: Found, there: Found, weights: Floats) -> Iterator[Equilibrium]:
    """Yield the critical point between two states if the number of negative eigenvalues changes."""
    from scipy.optimize import brentq  # imported here: it takes a quarter of a second

    before, after = last.state.negative_eigenvalues, there.state.negative_eigenvalues
    if before is None or after is None or before == after or not there.state.converged:
        return
    try:
        crossing = _Crossing(balance, last, there, weights)
        state = crossing.state(brentq(crossing, 0.0, 1.0, xtol=_PLACE, rtol=1e-12))
    except (ArithmeticError, SingularMatrixError, ValueError):
        return  # not found: the solution has a warning, as its stability changes
    mode = _nearest_to_zero(balance, state)[1]
    push = _push(balance, state.positions, state.load_factor)
    part = abs(float((mode * push).sum())) / max(norm(mode) * norm(push), np.finfo(float).tiny)
    kind = "bifurcation" if part < _NO_PART else "limit point"
    fewest = min(before, after)
    yield _with_cost(balance, replace(state, critical=kind, mode=mode, negative_eigenvalues=fewest, iterations=0))


def _nearest_to_zero(balance: Balance, state: Equilibrium) -> tuple[float, Floats]:
    """Return the size of the tangent's eigenvalue nearest to zero [N/m], and its mode, largest component 1."""
    matrix = balance.hessian(state.positions, state.load_factor)
    try:
        ready = balance.linear.ready(matrix, state.positions)
    except SingularMatrixError:  # the eigenvalue is zero: shift the matrix
        data = matrix.data
        shifted: Any = matrix + 1e-14 * float(np.abs(data).max()) * sparse.eye_array(matrix.shape[0])
        ready = balance.linear.ready(balance.in_blocks(shifted), state.positions)
    assert isinstance(ready, Factorisation)  # `_check` allows no other linear solver
    mode = ready.nearest_mode()
    image = (matrix @ mode.ravel()).reshape(mode.shape)
    return abs(float((mode * np.where(balance.free, image, 0.0)).sum())) / float((mode * mode).sum()), mode


def _with_cost(balance: Balance, state: Equilibrium) -> Equilibrium:
    """Return a state with methods and costs up to now."""
    cost = Cost(
        newton="continuation",
        linear=balance.linear.name,
        newton_iterations=balance.spent,
        factorisations=balance.linear.factorisations,
        memory=balance.linear.memory,
        notes=tuple(balance.notes),
    )
    return replace(state, cost=cost)
