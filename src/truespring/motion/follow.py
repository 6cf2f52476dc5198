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
from truespring.motion.stages import History, Moment
from truespring.motion.steps import FIRST, ROUNDING, Steps
from truespring.motion.still import Still
from truespring.potential import Damper, Potential
from truespring.solvers.balance import Balance, Equilibrium, Reporter
from truespring.solvers.cost import Cost
from truespring.solvers.newton import Newton, linear_of
from truespring.solvers.solver import Geometry

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
    begin = begin_of(body, dynamics, newton, report, geometry)
    if not begin.converged:
        yield begin
        return
    yield from _states(body, dynamics, plan, balance_of(body, newton, report, geometry), begin)


def begin_of(
    body: Body, dynamics: Dynamics, newton: Newton, report: Reporter | None, geometry: Geometry
) -> Equilibrium:
    """Return the state at time 0, not converged if its equilibrium was not found."""
    nodes = body.potential.nodes
    still = np.zeros_like(nodes)
    rest = Equilibrium(0.0, body.placed(nodes, 0.0), still, still, 0.0, 0, 0.0, converged=True)
    if dynamics.start == "rest":
        return rest
    still_tools = tuple(Still(one) for one in body.loading.interactions if one.acts(0.0))
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


def balance_of(body: Body, newton: Newton, report: Reporter | None, geometry: Geometry) -> Balance:
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
    history, steps = History(first), Steps(body, plan, dynamics, scheme, acceleration)
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
    soon = FIRST * dynamics.duration if plan.step is None else plan.step
    return np.where(body.held, body.velocity(0.0, soon), velocity)


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
    if np.isfinite(moment.velocity).all() and moved < _LOST * body.size:
        return ""
    return f"the motion became unstable before time {moment.time:.6g} s: use a shorter step, or an implicit scheme"


def _unstable(body: Body, state: Equilibrium) -> str:
    """Return that a motion became unstable: its energy exceeds by far what it was given; else empty.

    The energies of a body that moved by no more than rounding errors are rounding errors.
    """
    assert state.moving is not None
    if np.abs(state.positions - body.potential.nodes).max() <= ROUNDING * body.size:
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
