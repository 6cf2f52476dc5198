"""Ways to take the steps of a frame: compiled loops where a potential has the form for them, else step by step."""

from collections.abc import Sequence
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
from truespring.potential import ConstantSprings, Explicit


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


class Compiled:
    """Steps of leapfrog in one compiled loop, for springs of constant stiffness under loads that do not change."""

    name = "leapfrog, compiled"
    before: Moment | None = None

    def __init__(self, body: Body, springs: ConstantSprings) -> None:
        """Store what the loop reads."""
        dim = body.potential.nodes.shape[1]
        k, n_elements = springs.cells[0].shape[1], len(springs.cells[0])
        self.body, self._springs = body, springs
        self._zero = (0.0,) * dim
        self._work = np.empty((n_elements, k, dim)), np.empty(n_elements), np.empty((1, n_elements))
        self._free = (~body.held).astype(float)
        self._force: Floats | None = None

    def forget(self) -> None:
        """Forget the force at the end of the last frame."""
        self._force = None

    def frame(self, last: Moment, acting: Acting, n: int, h: float) -> Frame:
        """Return the frame after n steps of length h [s] from a state."""
        from truespring.kernels import leapfrog

        body, springs = self.body, self._springs
        dead = body.loading.dead_force(last.time / body.duration)
        external = np.ascontiguousarray(dead + acting.weight.at(0.0))
        x, v, dim = last.positions.copy(), last.velocity.copy(), len(self._zero)
        grips, balls = self._arrays(acting, dim)
        held = np.zeros((len(acting.grips), dim)), np.zeros((len(acting.balls), dim))
        loop = (springs.springs, springs.cells, springs.form, self._work)
        if self._force is None:
            self._force = np.empty_like(x)
            leapfrog.forces(x, *loop, external, self._force, self._zero)
            older = acting.older(last.time)
            pulling, pushing = self._arrays(older, dim)
            leapfrog.pull(x, pulling, 0.0, self._force, np.zeros((len(older.grips), dim)))
            leapfrog.push(x, pushing, 0.0, self._force, np.zeros((len(older.balls), dim)))
        account, force = np.zeros(2), self._force.copy()
        parts, done = n if acting.weight.moves else 1, 0.0  # the loop has constant loads
        for part in range(parts):
            ends = part / parts, (part + 1) / parts
            before, begin = external, x.copy()
            external = np.ascontiguousarray(dead + acting.weight.at(ends[1]))
            moving = (grips, balls) if parts == 1 else (_between(grips, *ends), _between(balls, *ends))
            known = (body.mass, self._free, external, *loop, *moving, held, account, self._zero)
            leapfrog.steps(n // parts, h, body.damping.mass, x, v, force, *known)
            done += float(((before + external) * (x - begin)).sum()) / 2
        self._force = force
        done, damped = done + account[0], account[1]
        return Frame(Moment(last.time + n * h, x, v), float(done), float(damped), np.concatenate(held))

    @staticmethod
    def _arrays(acting: Acting, dim: int) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
        """Return grasps and spheres as arrays, see `kernels.leapfrog.steps`."""
        grips, balls = acting.grips, acting.balls
        none, nothing = np.zeros(0, dtype=np.int64), np.zeros(0)
        ends = [[one.begin for one in grips], [one.end for one in grips]]
        held = (
            np.concatenate([none, *(one.nodes for one in grips)]),
            np.concatenate([none, *(np.full(len(one.nodes), g) for g, one in enumerate(grips))]),
            np.concatenate([nothing, *(one.stiffness for one in grips)]),
            np.concatenate([np.zeros((0, dim)), *(one.rest for one in grips)]),
            *(stacked(end, dim) for end in ends),
        )
        centres = [[one.begin for one in balls], [one.end for one in balls]]
        sizes = [np.array([one.radius for one in balls]), np.array([one.stiffness for one in balls])]
        nodes, areas = acting.surface
        return held, (nodes, areas, *sizes, *(stacked(one, dim) for one in centres))


def _between(arrays: tuple[Any, ...], begin: float, end: float) -> tuple[Any, ...]:
    """Return arrays whose last two are the places at the begin and the end of a frame for a part of it."""
    *others, first, last = arrays
    return (*others, first + begin * (last - first), first + end * (last - first))


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


def fitting(body: Body) -> ConstantSprings | None:
    """Return the springs of a body if compiled steps take all that acts on it, else None."""
    loading = body.loading
    still = all(len(part.amplitude.places) == 1 for part in loading.parts)
    if body.damper is not None or loading.interactions or loading.follows or not still:
        return None
    return body.potential.constant_springs if isinstance(body.potential, Explicit) else None


def names(one: Sequence[Grip | Ball]) -> tuple[str, ...]:
    """Return the names of grasps or spheres."""
    return tuple(each.name for each in one)
