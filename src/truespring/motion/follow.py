"""Follow the motion of a body: time steps, recorded states, and why a motion ends early."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from truespring.arrays import Floats
from truespring.conditions import Amplitude, Loading
from truespring.dynamics import Dynamics, Moving
from truespring.motion.advance import Advance, Scheme
from truespring.motion.explicit import Leapfrog
from truespring.motion.implicit import Implicit
from truespring.motion.moving import Body, creep_speed
from truespring.motion.plan import SAME, Plan, planned
from truespring.motion.record import Account
from truespring.motion.stages import ORDERS, History, Moment
from truespring.motion.still import Still
from truespring.potential import Damper, Potential
from truespring.solvers.balance import Balance, Equilibrium, Reporter
from truespring.solvers.cost import Cost
from truespring.solvers.newton import Newton, linear_of
from truespring.solvers.solver import Geometry

# A step that fails is halved up to so many times.
_MAX_HALVINGS = 8
# With an automatic step: the first one over the duration, the safety factor, bounds of a change, and the smallest step
# over the duration.
_FIRST, _SAFETY, _SHRINK, _GROW, _SMALLEST = 1e-4, 0.8, 0.2, 2.0, 1e-9
# Displacements below this share of the body's size are rounding errors.
_ROUNDING = 1e-10
# Velocity and acceleration count as the displacement to which they lead in this share of the duration.
_SOON = 1e-3
# Share of the distance from a prediction by Taylor's series in the error of a step.
_SHARE = 0.3
# A motion has become unstable if its energy exceeds this multiple of the energy that it was given, or if a node moved
# further than this multiple of the body's size.
_UNSTABLE, _LOST = 100.0, 1e6


def follow_motion(
    potential: Potential,
    loading: Loading,
    dynamics: Dynamics,
    mass: Floats,
    damper: Damper | None,
    newton: Newton,
    report: Reporter | None = None,
    geometry: Geometry | None = None,
    crossing: float | None = None,
) -> Iterator[Equilibrium]:
    """Yield the recorded states of a motion in the order of time, that at time 0 first.

    The load factor of a state is its share of the duration. If a step fails, the last state yielded is not converged
    and has the reason.

    Args:
        potential: elastic energy.
        loading: loads, supports, tools and grasps over time.
        dynamics: what is asked.
        mass: mass of the nodes [kg], shape (n_nodes,).
        damper: dashpots of the material; None without any.
        newton: solver of each implicit step, and of the equilibrium at the begin.
        report: called after each iteration with load factor, iteration and relative residual.
        geometry: functions of the mesh.
        crossing: time in which a wave crosses the smallest element [s], see `planned`.

    Raises ProblemError if the scheme cannot be used, as with a step that is not stable.
    """
    geometry = geometry or Geometry()
    creep = creep_speed(dynamics, potential.nodes)
    acting = damper if dynamics.damping.stiffness else None
    body = Body(potential, loading, mass, dynamics.damping, acting, dynamics.duration, creep)
    plan = planned(body, dynamics, crossing)
    begin = _begin(body, dynamics, newton, report, geometry)
    if not begin.converged:
        yield begin
        return
    yield from _states(body, dynamics, plan, _balance(body, newton, report, geometry), begin)


def _begin(body: Body, dynamics: Dynamics, newton: Newton, report: Reporter | None, geometry: Geometry) -> Equilibrium:
    """Return the state at time 0, not converged if its equilibrium was not found."""
    nodes = body.potential.nodes
    still = np.zeros_like(nodes)
    rest = Equilibrium(0.0, body.placed(nodes, 0.0), still, still, 0.0, 0, 0.0, converged=True)
    if dynamics.start == "rest":
        return rest
    still_tools = tuple(Still(one) for one in body.loading.interactions)
    steady = replace(body.loading.mapped(_at_begin), interactions=still_tools)
    if steady.vanishes(1.0):
        return rest
    last = rest
    for one in newton.follow(body.potential, steady, report, geometry):
        last = one
    way_out = 'add supports, reduce the loads of time 0, or begin with start = "rest"'
    if last.converged and last.load_factor == 1.0:
        return last
    return replace(last, load_factor=0.0, converged=False, reason=f"the equilibrium at time 0 was not found: {way_out}")


def _at_begin(part: Loading) -> Loading:
    """Return a part of a loading that grows to its share at time 0."""
    return replace(part, amplitude=Amplitude((0.0, 1.0), (0.0, part.amplitude.at(0.0))))


def _balance(body: Body, newton: Newton, report: Reporter | None, geometry: Geometry) -> Balance:
    """Return the balance of forces, whose potential and loading are those of each step in turn."""
    linear = linear_of(newton.linear, body.potential, body.loading, geometry)
    known = (body.potential, body.loading, newton.tolerance, newton.max_iterations, linear, report)
    return Balance(*known, judges=False)


def _states(body: Body, dynamics: Dynamics, plan: Plan, balance: Balance, begin: Equilibrium) -> Iterator[Equilibrium]:
    """Yield the recorded states, that at time 0 first."""
    scheme: Scheme = Leapfrog(body, balance.report)
    if plan.scheme != "leapfrog":
        scheme = Implicit(body, balance, plan.scheme, dynamics.iterations)
    if plan.note:
        balance.note(plan.note)
    first = Moment(0.0, begin.positions, _velocity(body, dynamics, plan))
    account = Account()
    account.open(body.loading, first.positions, 0.0)
    recorder = _Recorder(body, balance, plan.scheme)
    yield recorder.state(first, Advance.none(first, body.loading, account))
    force = body.loading.force(first.positions, 0.0) - body.potential.gradient(first.positions)
    acceleration = np.where(body.held, 0.0, force / body.mass[:, None])
    history, steps = History(first), _Steps(body, plan, dynamics, scheme, acceleration)
    for number, goal in enumerate(plan.goals):
        taken = steps.to(goal, history, account)
        while isinstance(taken, Advance) and taken.moment.time < goal * (1 - SAME):
            recorder.add(taken)
            history, account = History(taken.moment, history.last), taken.account
            taken = steps.to(goal, history, account)
        if isinstance(taken, Equilibrium):
            yield recorder.failed(taken)
            return
        recorder.add(taken)
        history, account = History(taken.moment, history.last), taken.account
        why = _lost(body, taken)
        if number in plan.recorded or why:
            state = recorder.state(taken.moment, taken)
            why = why or _unstable(body, state)
            yield replace(state, converged=False, reason=why) if why else state
        if why:
            return


def _velocity(body: Body, dynamics: Dynamics, plan: Plan) -> Floats:
    """Return the velocity at time 0 [m/s], shape (n_nodes, dim); of supports that of their motion."""
    nodes = body.potential.nodes
    velocity = np.zeros(nodes.shape) if dynamics.velocity is None else np.tile(dynamics.velocity, (len(nodes), 1))
    soon = _FIRST * dynamics.duration if plan.step is None else plan.step
    return np.where(body.held, body.velocity(0.0, soon), velocity)


class _Steps:
    """The lengths of steps: as planned, halved where a step fails, or by an estimate of the error."""

    def __init__(self, body: Body, plan: Plan, dynamics: Dynamics, scheme: Scheme, acceleration: Floats) -> None:
        self._body, self._plan, self._scheme = body, plan, scheme
        self._accuracy = dynamics.accuracy / dynamics.substeps**3
        duration = dynamics.duration
        self._h = plan.step or _FIRST * duration
        self._smallest = _SMALLEST * duration if plan.step is None else plan.step / 2**_MAX_HALVINGS
        self._order = ORDERS[plan.scheme]
        self._acceleration = acceleration
        self._soon = _SOON * duration
        self._largest = _ROUNDING * _size(body)

    def to(self, goal: float, history: History, account: Account) -> Advance | Equilibrium:
        """Return a step that ends at a time [s] or before; the state of least residual if none was found."""
        spent = 0
        while True:
            left = goal - history.last.time
            h = left if self._h >= left * (1 - SAME) else self._h
            taken = self._scheme.advance(history, h, account)
            spent += taken.iterations
            error = self._error(history.last, taken, h) if isinstance(taken, Advance) else np.inf
            if isinstance(taken, Advance) and error <= 1:
                self._accept(taken, h, error)
                return replace(taken, iterations=spent)
            self._h = h * (max(_SHRINK, self._factor(error)) if np.isfinite(error) else 0.5)
            if self._h < self._smallest:
                return self._given_up(taken, history.last.time, spent)

    def _given_up(self, taken: Advance | Equilibrium, time: float, spent: int) -> Equilibrium:
        """Return the state of a step from a time [s] that was refused, with the reason."""
        if isinstance(taken, Advance):
            reason = (
                f"the error of the step from time {time:.6g} s is above accuracy = {self._accuracy:g} for any length: "
                "increase accuracy, give a step, or smooth the loads"
            )
            return replace(taken.state, converged=False, reason=reason, iterations=spent)
        reason = (
            f"the step from time {time:.6g} s was not found (relative residual {taken.residual:.1e}): use a shorter "
            "step, more max_iterations, or less load"
        )
        return replace(taken, converged=False, reason=reason, iterations=spent)

    def _accept(self, taken: Advance, h: float, error: float) -> None:
        """Choose the length of the step after one of length h [s]."""
        self._acceleration = taken.acceleration
        self._largest = self._scale(taken)
        if self._plan.step is not None:
            self._h = min(2 * h, self._plan.step) if h < self._plan.step * (1 - SAME) else self._plan.step
        elif h < self._h * (1 - SAME):  # cut by a goal
            self._h = max(h, self._h * min(1.0, self._factor(error)))
        else:
            self._h = h * self._factor(error)

    def _factor(self, error: float) -> float:
        """Return the length of the next step over that of one with a relative error."""
        best = _SAFETY * error ** (-1 / (self._order + 1)) if error else _GROW
        return float(min(max(best, _SHRINK), _GROW))

    def _error(self, last: Moment, taken: Advance, h: float) -> float:
        """Return the estimated error of a step over the allowed one; 0 with a fixed step.

        A share of the distance from a prediction: of Taylor's series with the acceleration of the step before, or for
        Euler's scheme with the velocity; relative to the largest displacement.
        """
        if self._plan.step is not None:
            return 0.0
        ahead = last.positions + h * last.velocity
        if self._order > 1:
            ahead = ahead + h**2 / 2 * self._acceleration
        away = np.abs(np.where(self._body.held, 0.0, taken.moment.positions - ahead)).max()
        return _SHARE * float(away) / (self._accuracy * self._scale(taken))

    def _scale(self, taken: Advance) -> float:
        """Return the largest displacement so far, or that to which velocity and acceleration soon lead [m]."""
        moved, soon = taken.moment.positions - self._body.potential.nodes, self._soon
        ways = (moved, soon * taken.moment.velocity, soon**2 / 2 * taken.acceleration)
        return max(self._largest, *(float(np.abs(way).max()) for way in ways))


class _Recorder:
    """Make states of a motion, with the iterations and the worst residual since the state before."""

    def __init__(self, body: Body, balance: Balance, scheme: str) -> None:
        self._body, self._balance, self._scheme = body, balance, scheme
        self._iterations, self._residual, self._steps = 0, 0.0, 0

    def add(self, taken: Advance) -> None:
        """Count a step."""
        self._iterations += taken.iterations
        self._residual = max(self._residual, taken.state.residual)
        self._steps += 1

    def state(self, moment: Moment, taken: Advance) -> Equilibrium:
        """Return the state at the end of a step."""
        body, positions, level = self._body, moment.positions, min(moment.time / self._body.duration, 1.0)
        elastic = body.potential.energy(positions)
        energies = taken.account.energies(body.mass, moment.velocity, elastic, taken.loading, positions, level)
        external = taken.loading.force(positions, level)
        found = replace(
            taken.state,
            load_factor=level,
            positions=positions,
            internal_force=external + np.where(body.held, taken.state.internal_force - taken.state.external_force, 0.0),
            external_force=external,
            energy=elastic,
            iterations=self._iterations,
            residual=self._residual,
            converged=True,
            touches=taken.loading.touches(positions, level),
            moving=Moving(moment.time, moment.velocity, energies),
            cost=self._cost(),
        )
        self._iterations, self._residual = 0, 0.0
        return found

    def failed(self, state: Equilibrium) -> Equilibrium:
        """Return the state of a step that failed, with the cost up to there."""
        return replace(state, cost=self._cost())

    def _cost(self) -> Cost:
        return self._balance.cost(f"{self._scheme}, {self._steps} steps")


def _lost(body: Body, taken: Advance) -> str:
    """Return why a step cannot be continued: positions are not finite, or far away; else empty."""
    moment = taken.moment
    moved = np.abs(moment.positions - body.potential.nodes).max()
    if np.isfinite(moment.velocity).all() and moved < _LOST * _size(body):
        return ""
    return f"the motion became unstable before time {moment.time:.6g} s: use a shorter step, or an implicit scheme"


def _size(body: Body) -> float:
    """Return the diagonal of the undeformed body's bounding box [m]."""
    return float(np.linalg.norm(np.ptp(body.potential.nodes, axis=0)))


def _unstable(body: Body, state: Equilibrium) -> str:
    """Return that a motion became unstable: its energy exceeds by far what it was given; else empty.

    The energies of a body that moved by no more than rounding errors are rounding errors.
    """
    assert state.moving is not None
    if np.abs(state.positions - body.potential.nodes).max() <= _ROUNDING * _size(body):
        return ""
    energies = state.moving.energies
    now = energies.kinetic + energies.elastic
    given = abs(energies.loads) + energies.damped + abs(energies.total + energies.damped + energies.numerical)
    if np.isfinite(now) and now <= _UNSTABLE * given:
        return ""
    return (
        f"the motion became unstable before time {state.moving.time:.6g} s, its energy is "
        f"{now / given if given else np.inf:.2g} times that it was given: use a shorter step, or an implicit scheme"
    )
