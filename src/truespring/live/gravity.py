"""Gravity of a session: the problem's own, or one against the last direction, times a share."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from truespring.arrays import Floats
from truespring.live.actions import Weight
from truespring.motion.moving import Body
from truespring.problem import Problem

#: Gravity of a body without such a load [m/s^2], against the last direction.
GRAVITY = 9.81


@dataclass(frozen=True, eq=False)
class FullGravity:
    """Gravity at share 1.

    Attributes:
        acceleration: [m/s^2], shape (dim,).
        usual: the share that the loads of the problem have: 1, or 0 without a load of gravity [-].
    """

    acceleration: Floats
    usual: float

    @classmethod
    def of(cls, problem: Problem) -> Self:
        """Return the gravity of a problem's loads on the whole body, or GRAVITY without such a load."""
        own = [one for load in problem.loads if (one := load.acceleration_of_body) is not None]
        if own:
            return cls(np.asarray(np.sum(own, axis=0)), 1.0)
        down = np.zeros(problem.mesh.dim)
        down[-1] = -GRAVITY
        return cls(down, 0.0)

    def weight(self, mass: Floats, share: float) -> Weight:
        """Return the weight beyond the loads of the problem at a share; `mass` of the nodes [kg], shape (n,)."""
        more = share - self.usual
        return Weight(mass[:, None] * self.acceleration, more, more)


def weighted(body: Body, weight: Weight) -> Body:
    """Return a body with a weight, at the share at the end of the frame, among its loads."""
    loading = weight.settled.added_to(body.loading, (0.0, body.duration), body.duration)
    return replace(body, loading=loading)
