"""The lengths of the steps of a motion."""

from dataclasses import replace

import numpy as np

from truespring.arrays import Floats
from truespring.dynamics import Dynamics
from truespring.motion.advance import Advance, Scheme
from truespring.motion.moving import Body
from truespring.motion.plan import SAME, Plan
from truespring.motion.record import Account
from truespring.motion.stages import ORDERS, History, Moment
from truespring.solvers.balance import Equilibrium

# A step that fails is halved up to so many times.
_MAX_HALVINGS = 8
#: With an automatic step, the first one over the duration.
FIRST = 1e-4
# The safety factor, bounds of a change, and the smallest step over the duration.
_SAFETY, _SHRINK, _GROW, _SMALLEST = 0.8, 0.2, 2.0, 1e-9
#: Displacements below this share of the body's size are rounding errors.
ROUNDING = 1e-10
# Velocity and acceleration count as the displacement to which they lead in this share of the duration.
_SOON = 1e-3
# Share of the distance from a prediction by Taylor's series in the error of a step.
_SHARE = 0.3


class Steps:
    """The lengths of steps: as planned, halved where a step fails, or by an estimate of the error."""

    def __init__(self, body: Body, plan: Plan, dynamics: Dynamics, scheme: Scheme, acceleration: Floats) -> None:
        """Begin with the acceleration at time 0 [m/s^2], shape (n_nodes, dim)."""
        self._body, self._plan, self._scheme = body, plan, scheme
        self._accuracy = dynamics.accuracy / dynamics.substeps**3
        duration = dynamics.duration
        self._h = plan.step or FIRST * duration
        self._smallest = _SMALLEST * duration if plan.step is None else plan.step / 2**_MAX_HALVINGS
        self._order = ORDERS[plan.scheme]
        self._acceleration = acceleration
        self._soon = _SOON * duration
        self._largest = ROUNDING * body.size

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
