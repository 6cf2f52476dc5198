"""The state of a session at the end of a frame: from it another session of the same body can go on."""

from collections.abc import Mapping
from dataclasses import dataclass

from truespring.arrays import Floats
from truespring.live.actions import Ball, Grip
from truespring.motion.stages import Moment


@dataclass(frozen=True, eq=False)
class State:
    """A session between two frames.

    Attributes:
        frame: number of frames before it.
        moment: positions and velocities.
        grips: grasps and pins by name.
        balls: spheres by name.
        targets: where grasps and spheres were asked to go: motion, or centre [m], shape (dim,), by name.
        gravity: weight beyond that of the loads, over that of full gravity, at begin and end of the next frame [-].
        before: positions and velocities a step before, for schemes over two steps; None without.
    """

    frame: int
    moment: Moment
    grips: Mapping[str, Grip]
    balls: Mapping[str, Ball]
    targets: Mapping[str, Floats]
    gravity: tuple[float, float]
    before: Moment | None = None
