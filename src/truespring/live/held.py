"""The grasps and spheres of a session, on their way to where they were asked to go."""

from collections.abc import Mapping

import numpy as np

from truespring.arrays import Floats
from truespring.errors import LiveError
from truespring.live.actions import Ball, Grip
from truespring.live.state import State
from truespring.loading import Body

# Largest motion in a frame: of a sphere over its radius, of a grasp over the size of the body.
_FASTEST_BALL, _FASTEST_GRIP = 0.5, 0.25


class Held:
    """Grasps, pins and spheres by name.

    Attributes:
        grips: grasps and pins.
        balls: spheres.
        targets: where each was asked to go: motion of a grasp, centre of a sphere [m], shape (dim,).
        forces: force of the body on each at the end of the last frame [N], shape (dim,).
    """

    def __init__(self) -> None:
        self.grips: dict[str, Grip] = {}
        self.balls: dict[str, Ball] = {}
        self.targets: dict[str, Floats] = {}
        self.forces: dict[str, Floats] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Names of grasps, then of spheres."""
        return (*self.grips, *self.balls)

    def place(self, name: str) -> Floats:
        """Return the place of a grasp or sphere at the end of the frame [m], shape (dim,)."""
        return (self.grips.get(name) or self.balls[name]).place

    @property
    def moving(self) -> list[str]:
        """Names of those whose place changes within the frame."""
        several: tuple[Mapping[str, Grip | Ball], ...] = (self.grips, self.balls)
        return [name for some in several for name, one in some.items() if one.moves]

    # --- what is asked ------------------------------------------------------------------------------------------

    def require_free(self, name: str) -> None:
        """Raise LiveError if a grasp or sphere has a name."""
        if name in self.targets:
            raise LiveError(f"'{name}' is there already: release it first, or take another name")

    def hold(self, grip: Grip) -> None:
        """Add a grasp, where it begins."""
        self.grips[grip.name], self.targets[grip.name] = grip, grip.begin

    def add(self, ball: Ball) -> None:
        """Add a sphere, where it begins."""
        self.balls[ball.name], self.targets[ball.name] = ball, ball.begin

    def move(self, name: str, place: Floats) -> None:
        """Let a grasp or sphere go to a place [m], shape (dim,); raise LiveError if there is none of the name."""
        if name in self.grips:
            place = place - self.grips[name].at
        elif name not in self.balls:
            raise self._unknown(name)
        self.targets[name] = place

    def release(self, name: str) -> None:
        """Remove a grasp or sphere; raise LiveError if there is none of the name."""
        if name not in self.targets:
            raise self._unknown(name)
        for several in (self.grips, self.balls, self.targets):
            several.pop(name, None)

    def keep(self, grips: dict[str, Grip]) -> None:
        """Take the grasps that a cut leaves; the others are gone."""
        self.grips = grips
        self.targets = {name: one for name, one in self.targets.items() if name in grips or name in self.balls}

    def go_on(self, state: State, body: Body) -> None:
        """Take the grasps and spheres of another session, on the nodes of a body."""
        self.grips = {name: one.on(body) for name, one in state.grips.items()}
        self.balls, self.targets = dict(state.balls), dict(state.targets)

    def _unknown(self, name: str) -> LiveError:
        return LiveError(f"'{name}' is no grasp, pin or sphere; there are: {', '.join(self.targets) or 'none'}")

    # --- how they move ------------------------------------------------------------------------------------------

    def aim(self, size: float) -> None:
        """Let each move towards where it was asked to go, at most as fast as is allowed; `size` of the body [m]."""
        for name, grip in self.grips.items():
            self.grips[name] = grip.to(_towards(grip.begin, self.targets[name], _FASTEST_GRIP * size))
        for name, ball in self.balls.items():
            self.balls[name] = ball.to(_towards(ball.begin, self.targets[name], _FASTEST_BALL * ball.radius))

    def feel(self, forces: Floats) -> None:
        """Take the force of the body on each of `names` [N], shape (n, dim)."""
        self.forces = dict(zip(self.names, forces, strict=True))

    def settle(self) -> None:
        """Go on to the frame after this one."""
        self.grips = {name: one.settled for name, one in self.grips.items()}
        self.balls = {name: one.settled for name, one in self.balls.items()}


def _towards(begin: Floats, target: Floats, fastest: float) -> Floats:
    """Return the target [m], shape (dim,), or the place on the way to it at the largest distance from the begin."""
    away = target - begin
    far = float(np.linalg.norm(away))
    return target if far <= fastest else np.asarray(begin + fastest / far * away)
