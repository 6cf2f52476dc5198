"""Implicit steps: each is an equilibrium of a body with inertia, found by Newton's method."""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from truespring.arrays import Floats
from truespring.conditions import Loading
from truespring.linear.gradients import norm
from truespring.motion.advance import Advance
from truespring.motion.moving import Body
from truespring.motion.record import Account
from truespring.motion.stages import IMPLICIT, History, Moment, Stage
from truespring.motion.step import Step, step_of
from truespring.potential import Potential, Stressed
from truespring.solvers import mixed
from truespring.solvers.balance import Balance, Equilibrium
from truespring.solvers.fixed import iterated
from truespring.solvers.line_search import descend


class Implicit:
    """Steps of an implicit scheme."""

    def __init__(self, body: Body, balance: Balance, scheme: str, iterations: int) -> None:
        """Store the body, the balance whose solver is used, the scheme, and the number of iterations, 0 to solve."""
        self.body, self._balance, self._iterations = body, balance, iterations
        self._scheme = IMPLICIT[scheme]
        self._measures: dict[float, Sequence[Floats]] = {}

    def forget(self) -> None:
        """Forget the strains of the last states: the next step begins at another one."""
        self._measures = {}

    def ready(self, moment: Moment) -> None:
        """Do nothing: a step has the forces of its end, or of its middle."""

    def advance(self, history: History, h: float, account: Account) -> Advance | Equilibrium:
        """Return the step of length h [s] with the work in it; the state of least residual if it was not found."""
        body, last, account = self.body, history.last, copy(account)
        stage, time = self._scheme(h, history), last.time + h
        levels = last.time / body.duration, (last.time + stage.share * h) / body.duration, time / body.duration
        step, dashpots = self._step(history, stage)
        start = body.placed(step.target, levels[2])
        start = stage.held(start, history, body.held)
        loading = body.loading.since(last.positions, levels[0], body.creep * h)
        for _ in range(2 if any(one.dissipates for one in loading.interactions) else 1):
            self._balance.potential, self._balance.loading = step, loading
            state = self._solved(levels[1], start, np.where(body.held, start, last.positions))
            if not state.converged and not self._iterations:
                return state
            loading, start = loading.lagged(state.positions, levels[1]), state.positions
        moment = stage.end(state.positions, history, time)
        if stage.share < 1:  # going straight on, held nodes would never come to rest
            velocity = np.where(body.held, body.velocity(time, h), moment.velocity)
            moment = replace(moment, velocity=velocity)
        self._add(account, stage, history, state, moment, loading, dashpots, levels[1:])
        velocity = history.combined(stage.weights, lambda one: one.velocity)
        acceleration = (stage.velocity(state.positions, history) - velocity) / stage.b
        return Advance(moment, state, loading, acceleration, account, state.iterations)

    def _step(self, history: History, stage: Stage) -> tuple[Step, tuple[Potential, ...]]:
        """Return the potential of a step, and its dashpots."""
        body, b = self.body, stage.b
        place = history.combined(stage.weights, lambda one: one.positions)
        velocity = history.combined(stage.weights, lambda one: one.velocity)
        braked = 1 + body.damping.mass * b
        dashpots: tuple[Potential, ...] = ()
        if body.damper is not None:
            dashpots = body.damper.since(self._relaxed(history, stage), body.damping.stiffness / b)
        momentum = norm(body.mass[:, None] * velocity) / b
        target = place + b / braked * velocity
        return step_of(body.potential, braked / b**2 * body.mass, target, momentum, dashpots), dashpots

    def _relaxed(self, history: History, stage: Stage) -> list[Floats]:
        """Return the lengths or strains at which the dashpots of a step have no force."""
        damper = self.body.damper
        assert damper is not None
        states = [one for one in history if one is not None]
        known = {one.time: self._measures.get(one.time) or damper.measure(one.positions) for one in states}
        self._measures = known
        shares = zip(stage.weights, states, strict=False)
        weighted = [[share * one for one in known[state.time]] for share, state in shares]
        return [sum(several[1:], several[0]) for several in zip(*weighted, strict=True)]

    def _solved(self, level: float, start: Floats, other: Floats) -> Equilibrium:
        """Return the equilibrium of a step found from a start, else from another; or after a number of iterations."""
        balance, potential = self._balance, self._balance.potential
        start, other = (balance.loading.cleared(one, level) for one in (start, other))
        if not np.isfinite(balance.total_energy(start, level)[0]):
            start = other
        if self._iterations:
            return iterated(balance, level, start, self._iterations)
        spent, found = 0, None
        if isinstance(potential, Stressed):
            found = mixed.converge(balance, level, mixed.Start(start, potential.stress(start))).state
        for guess in (start, other):
            if found is None or not found.converged:
                spent += 0 if found is None else found.iterations
                found = descend(balance, level, guess).state
        assert found is not None
        return replace(found, iterations=found.iterations + spent)

    def _add(
        self,
        account: Account,
        stage: Stage,
        history: History,
        state: Equilibrium,
        moment: Moment,
        loading: Loading,
        dashpots: Sequence[Potential],
        levels: tuple[float, float],
    ) -> None:
        """Add the work of a step, and what it dissipated; `levels` are those of the stage and of the end."""
        body, last = self.body, history.last
        moved = moment.positions - last.positions
        account.step(loading, last.positions, moment.positions, levels[1])
        reaction = np.where(body.held, state.internal_force - state.external_force, 0.0)
        account.support(reaction, moved)
        if body.damping.mass:
            drag = body.damping.mass * body.mass[:, None] * stage.velocity(state.positions, history)
            account.damped += float((drag * moved).sum())
        for one in dashpots:
            account.damped += float((one.gradient(state.positions) * moved).sum())
        for contact in loading.interactions:
            rubbed = contact.energy(state.positions, levels[0]) - contact.stored(state.positions, levels[0])
            account.damped += rubbed / stage.share
