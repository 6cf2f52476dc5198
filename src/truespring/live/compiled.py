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

    def __init__(self, body: Body, springs: Sequence[ConstantCells]) -> None:
        """Store what the loop reads."""
        nodes = body.potential.nodes
        if body.potential not in _ARRAYS:
            _ARRAYS[body.potential] = arrays(springs, len(nodes))
        self.body, self._arrays = body, tuple(_ARRAYS[body.potential])
        self._zero = (0.0,) * nodes.shape[1]
        self._inverse = _by_direction(np.where(body.held, 0.0, 1 / body.mass[:, None]))
        self._last: _State | None = None
        self._rest = self._energy(nodes)

    def forget(self) -> None:
        """Forget the force at the end of the last frame."""
        self._last = None

    def elastic(self, positions: Floats) -> float:
        """Return the elastic energy [J]; with the pressure continued linearly below a tenth of the volume."""
        return self._energy(positions) - self._rest

    def _energy(self, positions: Floats) -> float:
        from truespring.kernels import leapfrog

        return float(leapfrog.energy(_by_direction(positions), self._arrays, self._zero))

    def frame(self, last: Moment, acting: Acting, n: int, h: float) -> Frame:
        """Return the frame after n steps of length h [s] from a state."""
        from truespring.kernels import leapfrog

        body, dim = self.body, len(self._zero)
        loads = np.ascontiguousarray(body.loading.dead_force(last.time / body.duration))
        external = _by_direction(loads)
        grips, balls = _grips(acting, dim), _balls(acting, dim)
        begin, known = self._last, self._last is not None and self._last.moment is last
        if begin is None or not known:
            velocity = np.where(body.held, 0.0, last.velocity)
            begin = _State(last, _by_direction(last.positions), _by_direction(velocity), np.zeros_like(external))
        x, v, force, account = begin.positions.copy(), begin.velocity.copy(), begin.force.copy(), np.zeros(2)
        held = np.zeros_like(grips[-1]), np.zeros_like(balls[-1])
        acts = (external, self._arrays, grips, balls, held, account)
        leapfrog.steps(n, h, body.damping.mass, x, v, force, self._inverse, *acts, self._zero, known)
        moment = Moment(last.time + n * h, np.ascontiguousarray(x.T), np.ascontiguousarray(v.T))
        self._last = _State(moment, x, v, force)
        done, damped = account
        done += float((loads * (moment.positions - last.positions)).sum())
        return Frame(moment, float(done), float(damped), np.concatenate(held))


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
