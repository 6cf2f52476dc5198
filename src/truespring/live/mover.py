"""The steps of a frame, with a guard: the step is halved where energy rises without work."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from truespring.live.actions import Ball, Grip
from truespring.live.choosing import Choice
from truespring.live.settings import steps_in
from truespring.live.steppers import Acting, Frame, Stepper
from truespring.motion.moving import Body
from truespring.motion.stages import Moment

# Energy that a frame may gain without work, over the largest energy so far: more is an instability.
_GAIN = 0.05
# An oscillation over the size of the body that is no instability but a rounding error.
_SMALL = 1e-7
# The step is halved up to so many times.
_HALVINGS = 6
Part = TypeVar("Part", Grip, Ball)


class Mover:
    """Takes the frames of a body.

    Attributes:
        stepper: takes the steps.
        longest: longest step, before it is halved [s].
        halvings: how often it was halved.
    """

    def __init__(self, body: Body, stable: float, choice: Choice, frame: float, notes: list[str]) -> None:
        """Take a body and how its steps are taken.

        Args:
            body: the body.
            stable: the largest stable step of leapfrog at rest, or the time between frames without one [s].
            choice: how steps are taken.
            frame: time between frames [s].
            notes: a sentence is added to these where the step is halved.
        """
        self._body, self._frame, self._notes = body, frame, notes
        self._stable = stable
        self.stepper: Stepper = choice.stepper
        self.longest, self.halvings = choice.longest, 0
        self._largest = 0.0
        self._known: tuple[Moment, float] | None = None

    def take(self, choice: Choice) -> None:
        """Take other steps from now on."""
        before = self.stepper.before
        self.stepper, self.longest = choice.stepper, choice.longest
        self.stepper.before = before

    @property
    def steps_a_frame(self) -> int:
        """The number of steps of a frame."""
        return steps_in(self._frame, self.longest / 2**self.halvings)

    @property
    def step_length(self) -> float:
        """The time step [s]."""
        return self._frame / self.steps_a_frame

    def frame(self, moment: Moment, acting: Acting) -> Frame:
        """Return the frame after a state; halve the step where energy rises without work."""
        taken = self.stepper.frame(moment, acting, self.steps_a_frame, self.step_length)
        while not self._sound(moment, taken, acting) and self.halvings < _HALVINGS:
            self.halvings += 1
            self.stepper.forget()
            self._notes.append(
                f"{moment.time:.4g} s: energy rose without work, the step is halved: {self.step_length:.3g} s"
            )
            taken = self.stepper.frame(moment, acting, self.steps_a_frame, self.step_length)
        return taken

    def _sound(self, moment: Moment, taken: Frame, acting: Acting) -> bool:
        """Return whether the energy after a frame is explained by the work in it."""
        if not taken.is_found:
            return False
        begins = replace(acting, grips=_begins(acting.grips), balls=_begins(acting.balls))
        before = self._energy(moment, begins)
        after = self._energy(taken.moment, acting)
        if not np.isfinite(after):  # an inverted element: its energy is not known
            after = kinetic(self._body, taken.moment)
        before = before if np.isfinite(before) else after
        self._largest = max(self._largest, abs(taken.done), before, self._rounding)
        return after - before - taken.done + taken.damped <= _GAIN * self._largest

    @property
    def _rounding(self) -> float:
        """An energy far above rounding errors [J]: of an oscillation by _SMALL of the size that limits the step."""
        return float(self._body.mass.sum()) * (_SMALL * self._body.size / self._stable) ** 2

    def _energy(self, moment: Moment, acting: Acting) -> float:
        """Return kinetic and stored energy [J]."""
        known = self._known
        if known is None or known[0] is not moment:  # that at the end of a frame is that at the begin of the next
            self._known = known = moment, kinetic(self._body, moment) + self.stepper.elastic(moment.positions)
        return known[1] + acting.stored(moment.positions)


def kinetic(body: Body, moment: Moment) -> float:
    """Return the kinetic energy of a body [J]."""
    return float(np.einsum("n,ni,ni->", body.mass, moment.velocity, moment.velocity)) / 2


def _begins(several: Sequence[Part]) -> tuple[Part, ...]:
    """Return grasps or spheres at the begin of the frame."""
    return tuple(replace(one, end=one.begin) for one in several)
