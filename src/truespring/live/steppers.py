"""Ways to take the steps of a frame, and the one that takes steps of any scheme."""

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Loading
from truespring.live.actions import Ball, Grip, Weight, stacked
from truespring.motion.advance import Advance, Scheme
from truespring.motion.moving import Body
from truespring.motion.record import Account
from truespring.motion.stages import History, Moment


@dataclass(frozen=True, eq=False)
class Acting:
    """What acts on a body within a frame.

    Attributes:
        grips: grasps.
        balls: spheres.
        surface: nodes of the surface that spheres touch, and their areas [m^2], shape (n,) each.
        weight: gravity beyond that of the loads.
    """

    grips: tuple[Grip, ...]
    balls: tuple[Ball, ...]
    surface: tuple[Ints, Floats]
    weight: Weight

    def older(self, time: float) -> "Acting":
        """Return what acts at a time [s] already: what is added then acts after it."""
        grips = tuple(one for one in self.grips if one.since < time)
        return replace(self, grips=grips, balls=tuple(one for one in self.balls if one.since < time))

    def stored(self, positions: Floats) -> float:
        """Return the energy of grasps and contacts at the end of the frame [J]."""
        gripped = sum(one.stored(positions) for one in self.grips)
        return gripped + sum(one.stored(positions, self.surface) for one in self.balls)


@dataclass(frozen=True, eq=False)
class Frame:
    """A frame that was computed.

    Attributes:
        moment: the state at its end.
        done: work of loads, supports, grasps and tools in the frame [J].
        damped: energy dissipated by damping in the frame [J].
        forces: force of the body on each grasp, then on each sphere, at the end [N], shape (n, dim).
        solved: False if a step was not found.
    """

    moment: Moment
    done: float
    damped: float
    forces: Floats
    solved: bool = True

    @property
    def is_found(self) -> bool:
        """Whether all steps were found, and all positions are finite."""
        return self.solved and bool(np.isfinite(self.moment.positions).all())


class Stepper(Protocol):
    """Takes the steps of a frame.

    Attributes:
        before: the state before the last one, which schemes over two steps need; None without one.
    """

    before: Moment | None

    @property
    def name(self) -> str:
        """The scheme in words, for the page."""
        ...

    def frame(self, last: Moment, acting: Acting, n: int, h: float) -> Frame:
        """Return the frame after n steps of length h [s] from a state."""
        ...

    def forget(self) -> None:
        """Forget what is kept of the last state: the next frame begins at another one."""
        ...

    def elastic(self, positions: Floats) -> float:
        """Return the elastic energy [J] at positions [m], shape (n_nodes, dim); it may be infinite where inverted."""
        ...


class StepByStep:
    """Steps of any scheme of motions, for any body."""

    def __init__(self, scheme: Any, name: str) -> None:
        """Store the scheme, a Leapfrog or Implicit, and its name."""
        self._scheme: Scheme = scheme
        self._body: Body = scheme.body
        self.name = name
        self.before: Moment | None = None

    def forget(self) -> None:
        """Forget the state before the last one, and the force at it."""
        self.before = None
        self._scheme.forget()

    def elastic(self, positions: Floats) -> float:
        """Return the elastic energy [J], infinite where the law is not defined."""
        return self._body.potential.energy(positions)

    def frame(self, last: Moment, acting: Acting, n: int, h: float) -> Frame:
        """Return the frame after n steps of length h [s] from a state."""
        body, span = self._body, self._body.duration
        times = last.time, last.time + n * h
        self._scheme.body = replace(body, loading=self._loading(acting.older(last.time), times))
        self._scheme.ready(last)
        loading = self._loading(acting, times)
        self._scheme.body = replace(body, loading=loading)
        account = Account()
        account.open(loading, last.positions, last.time / span)
        history = History(last, self.before)
        for _ in range(n):
            taken = self._scheme.advance(history, h, account)
            if not isinstance(taken, Advance):
                return Frame(last, 0.0, 0.0, stacked([], last.positions.shape[1]), solved=False)
            account, history = taken.account, History(taken.moment, history.last)
        self.before = history.before
        level = history.last.time / span
        touches = loading.touches(history.last.positions, level)[len(body.loading.interactions) :]
        forces = stacked([one.force for one in touches], last.positions.shape[1])
        return Frame(history.last, account.done, account.damped, forces)

    def _loading(self, acting: Acting, times: tuple[float, float]) -> Loading:
        """Return the loads of the body with what acts in a frame from a time to another [s]."""
        body, span = self._body, self._body.duration
        nodes = body.potential.nodes
        own: list[Any] = [one.interaction(nodes, times, span) for one in acting.grips]
        own += [one.interaction(acting.surface, len(nodes), times, span) for one in acting.balls]
        loading = acting.weight.added_to(body.loading, times, span)
        return replace(loading, interactions=(*loading.interactions, *own))
