"""The implicit schemes: each step is one equilibrium with inertia, at the end or in the middle of the step.

All have the form x = x0 + b v, v = v0 + b a, with the balance M a + C v + F(x) = f at x. With `b = h`, x0 and v0 those
of the begin, it is Euler's implicit scheme; with b = h/2 the midpoint rule; BDF2 combines two old states (Hairer and
Wanner, Solving Ordinary Differential Equations II, V.1; steps of different length as there in III.5 of volume I).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from truespring.arrays import Bools, Floats


@dataclass(frozen=True, eq=False)
class Moment:
    """A body at one time.

    Attributes:
        time: [s].
        positions: [m], shape (n_nodes, dim).
        velocity: [m/s], shape (n_nodes, dim).
    """

    time: float
    positions: Floats
    velocity: Floats


class History(NamedTuple):
    """The state at the begin of a step, and the one before; None at the first step."""

    last: Moment
    before: Moment | None = None

    def combined(self, weights: tuple[float, float], value: Callable[[Moment], Floats]) -> Floats:
        """Return the sum of weights times values of the last state and of the one before, shape as `value`."""
        total = weights[0] * value(self.last)
        return total if self.before is None or not weights[1] else total + weights[1] * value(self.before)


class Stage(NamedTuple):
    """A step as an equilibrium: x = x0 + b v, v = v0 + b a.

    Attributes:
        b: [s].
        weights: x0 and v0 are the sums of these times the last state and the one before [-].
        share: share of the step after which the balance is that of the scheme [-].
    """

    b: float
    weights: tuple[float, float]
    share: float = 1.0

    def velocity(self, positions: Floats, history: History) -> Floats:
        """Return the velocity of the stage [m/s], shape (n_nodes, dim)."""
        return (positions - history.combined(self.weights, lambda one: one.positions)) / self.b

    def held(self, end: Floats, history: History, held: Bools) -> Floats:
        """Return the positions of held directions at the stage from those at the end of the step, others as `end`."""
        between = history.last.positions + self.share * (end - history.last.positions)
        return np.where(held, between, end)

    def end(self, positions: Floats, history: History, time: float) -> Moment:
        """Return the state at the end of the step, at `time` [s], from the positions at the stage."""
        last, velocity = history.last, self.velocity(positions, history)
        ahead = 1 / self.share
        return Moment(
            time,
            last.positions + ahead * (positions - last.positions),
            last.velocity + ahead * (velocity - last.velocity),
        )


def euler(h: float, history: History) -> Stage:
    """Return Euler's implicit step of length h [s]."""
    return Stage(h, (1.0, 0.0))


def midpoint(h: float, history: History) -> Stage:
    """Return a step of the midpoint rule of length h [s]: Euler's step to the middle, then straight on."""
    return Stage(h / 2, (1.0, 0.0), 0.5)


def bdf2(h: float, history: History) -> Stage:
    """Return a step of BDF2 of length h [s]; the first step is one of the midpoint rule."""
    if history.before is None:
        return midpoint(h, history)
    ratio = h / (history.last.time - history.before.time)
    b = h * (1 + ratio) / (1 + 2 * ratio)
    return Stage(b, ((1 + ratio) ** 2 / (1 + 2 * ratio), -(ratio**2) / (1 + 2 * ratio)))


#: The implicit schemes by name: each returns the stage of a step.
IMPLICIT: Mapping[str, Callable[[float, History], Stage]] = MappingProxyType(
    {"euler": euler, "bdf2": bdf2, "midpoint": midpoint}
)
#: The order of the error of each scheme in the step.
ORDERS: Mapping[str, int] = MappingProxyType({"euler": 1, "bdf2": 2, "midpoint": 2, "leapfrog": 2})
