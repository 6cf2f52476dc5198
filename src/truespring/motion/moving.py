"""What moves: a potential with mass, damping and loads; and the state at the begin of the motion."""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.conditions import Loading
from truespring.dynamics import Damping, Dynamics
from truespring.potential import Damper, Potential

# Speed at which regularised friction is full, over sqrt(g L).
_CREEP, _GRAVITY = 1e-3, 9.81


@dataclass(frozen=True, eq=False)
class Body:
    """A body that moves.

    Attributes:
        potential: its elastic energy.
        loading: loads, supports, tools and grasps.
        mass: mass of the nodes [kg], shape (n_nodes,).
        damping: damping by the material and the surroundings.
        damper: dashpots of the material, None without damping by it.
        duration: of the motion [s].
        creep: speed at which regularised friction is full [m/s].
    """

    potential: Potential
    loading: Loading
    mass: Floats
    damping: Damping
    damper: Damper | None
    duration: float
    creep: float

    @property
    def held(self) -> Bools:
        """True for held directions, shape (n_nodes, dim)."""
        return self.loading.held

    @property
    def size(self) -> float:
        """The diagonal of the undeformed body's bounding box [m]."""
        return float(np.linalg.norm(np.ptp(self.potential.nodes, axis=0)))

    def velocity(self, time: float, h: float) -> Floats:
        """Return the velocity of held directions from their places a time h [s] before and after [m/s]."""
        before, after = max(time - h, 0.0), min(time + h, self.duration)
        moved = self.loading.motion(after / self.duration) - self.loading.motion(before / self.duration)
        return np.asarray(moved / (after - before))

    def placed(self, positions: Floats, level: float) -> Floats:
        """Return positions [m], shape (n_nodes, dim), with held directions where the supports are at a level."""
        return np.where(self.held, self.potential.nodes + self.loading.motion(level), positions)


def creep_speed(dynamics: Dynamics, nodes: Floats) -> float:
    """Return the speed at which regularised friction is full [m/s]: as asked, else 0.001 sqrt(g L), L the size."""
    if dynamics.creep is not None:
        return dynamics.creep
    return _CREEP * float(np.sqrt(_GRAVITY * np.linalg.norm(np.ptp(nodes, axis=0))))
