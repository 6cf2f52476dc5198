"""Steps of leapfrog in one compiled loop, for springs of constant stiffness under loads that do not change."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from truespring.arrays import Floats
from truespring.live.actions import stacked
from truespring.live.columns import Arrays, arrays
from truespring.live.steppers import Acting, Frame
from truespring.motion.moving import Body
from truespring.motion.stages import Moment
from truespring.potential import ConstantCells, Explicit, Potential

# The arrays of bodies that move: another gravity needs no others.
_ARRAYS: WeakKeyDictionary[Potential, Arrays] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class _State:
    """The last state in the form of the loops.

    Attributes:
        moment: the state.
        positions, velocity, force: [m], [m/s], [N], shape (dim, n_nodes).
    """

    moment: Moment
    positions: Floats
    velocity: Floats
    force: Floats


class Compiled:
    """Steps of leapfrog in one compiled loop."""

    name = "leapfrog, compiled"
    before: Moment | None = None

    def __init__(self, body: Body, springs: Sequence[ConstantCells]) -> None:
        """Store what the loop reads."""
        nodes = body.potential.nodes
        if body.potential not in _ARRAYS:
            _ARRAYS[body.potential] = arrays(springs, len(nodes))
        self.body, self._arrays = body, tuple(_ARRAYS[body.potential])
        self._zero = (0.0,) * nodes.shape[1]
        self._inverse = _by_direction(np.where(body.held, 0.0, 1 / body.mass[:, None]))
        self._last: _State | None = None
        self._known: tuple[Floats, float] | None = None  # positions and their energy
        self._rest = self._energy(nodes)

    def forget(self) -> None:
        """Forget the force and the energy at the end of the last frame."""
        self._last, self._known = None, None

    def elastic(self, positions: Floats) -> float:
        """Return the elastic energy [J]; with the pressure continued linearly below a tenth of the volume.

        That of the last positions is kept: a frame begins where the one before it ended.
        """
        if self._known is None or self._known[0] is not positions:
            self._known = positions, self._energy(positions) - self._rest
        return self._known[1]

    def _energy(self, positions: Floats) -> float:
        from truespring.kernels import leapfrog

        return float(leapfrog.energy(_by_direction(positions), self._arrays, self._zero))

    def frame(self, last: Moment, acting: Acting, n: int, h: float) -> Frame:
        """Return the frame after n steps of length h [s] from a state."""
        dim, dead = len(self._zero), self.body.loading.dead_force(last.time / self.body.duration)
        begin = self._last
        if begin is None or begin.moment is not last:
            begin = self._begun(last, acting, dead)
        x, v, force, account = begin.positions.copy(), begin.velocity.copy(), begin.force.copy(), np.zeros(2)
        held = np.zeros((len(acting.grips), dim)), np.zeros((len(acting.balls), dim))
        grips, balls = _grips(acting, dim), _balls(acting, dim)
        loads, done = _by_direction(dead + acting.weight.at(0.0)), 0.0
        parts = n if acting.weight.moves else 1  # the loop has constant loads
        for part in range(parts):
            ends, before, there = (part / parts, (part + 1) / parts), loads, x.copy()
            loads = _by_direction(dead + acting.weight.at(ends[1]))
            moving = _between(grips, *ends), _between(balls, *ends)
            self._loop(n // parts, h, (x, v, force), loads, (*moving, held, account))
            done += float(((before + loads) * (x - there)).sum()) / 2
        moment = Moment(last.time + n * h, np.ascontiguousarray(x.T), np.ascontiguousarray(v.T))
        self._last = _State(moment, x, v, force)
        return Frame(moment, done + float(account[0]), float(account[1]), np.concatenate(held))

    def _begun(self, last: Moment, acting: Acting, dead: Floats) -> _State:
        """Return a state with the forces on it, those of what acts at its time already."""
        x, v = _by_direction(last.positions), _by_direction(np.where(self.body.held, 0.0, last.velocity))
        older, dim, force = acting.older(last.time), len(self._zero), np.zeros_like(x)
        held = np.zeros((len(older.grips), dim)), np.zeros((len(older.balls), dim))
        acts = (_grips(older, dim), _balls(older, dim), held, np.zeros(2))
        self._loop(0, 0.0, (x, v, force), _by_direction(dead + acting.weight.at(0.0)), acts, known=False)
        return _State(last, x, v, force)

    def _loop(
        self, n: int, h: float, state: tuple[Floats, ...], loads: Floats, acts: tuple[Any, ...], known: bool = True
    ) -> None:
        """Take n steps; arguments as of `kernels.leapfrog.steps`."""
        from truespring.kernels import leapfrog

        alpha, body = self.body.damping.mass, self._arrays
        leapfrog.steps(n, h, alpha, *state, self._inverse, loads, body, *acts, self._zero, known)


def fitting(body: Body) -> tuple[ConstantCells, ...] | None:
    """Return the springs of a body if compiled steps take all that acts on it, else None."""
    loading = body.loading
    still = all(len(part.amplitude.places) == 1 for part in loading.parts)
    if body.damper is not None or loading.interactions or loading.follows or not still:
        return None
    return body.potential.constant_springs if isinstance(body.potential, Explicit) else None


def _by_direction(rows: Floats) -> Floats:
    """Return vectors of nodes, shape (n_nodes, dim), in the form (dim, n_nodes)."""
    return np.array(rows.T, dtype=np.float64, order="C")


def _grips(acting: Acting, dim: int) -> tuple[Any, ...]:
    """Return grasps as arrays, see `kernels.leapfrog.steps`."""
    grips, none = acting.grips, np.zeros(0, dtype=np.int64)
    return (
        np.concatenate([none, *(one.nodes for one in grips)]),
        np.concatenate([none, *(np.full(len(one.nodes), g) for g, one in enumerate(grips))]),
        np.concatenate([np.zeros(0), *(one.stiffness for one in grips)]),
        np.concatenate([np.zeros((0, dim)), *(one.rest for one in grips)]),
        stacked([one.begin for one in grips], dim),
        stacked([one.end for one in grips], dim),
    )


def _balls(acting: Acting, dim: int) -> tuple[Any, ...]:
    """Return spheres and the surface as arrays, see `kernels.leapfrog.steps`."""
    balls, (nodes, areas) = acting.balls, acting.surface
    sizes = np.array([one.radius for one in balls]), np.array([one.stiffness for one in balls])
    return (
        nodes,
        areas,
        *sizes,
        stacked([one.begin for one in balls], dim),
        stacked([one.end for one in balls], dim),
    )


def _between(arrays: tuple[Any, ...], begin: float, end: float) -> tuple[Any, ...]:
    """Return arrays whose last two are the places at the begin and the end of a frame for a part of it."""
    *others, first, last = arrays
    return (*others, first + begin * (last - first), first + end * (last - first))
