"""What runs beside a session: the reference at rest and in motion, and the same model with shorter steps.

It receives the commands of the session and its number of frames; `turn` does the next piece of work. `twin.Twin`
runs it in another process.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from truespring.arrays import Floats
from truespring.live.commands import Command
from truespring.live.follower import Follower
from truespring.live.ghost import Ghost
from truespring.live.hold import Hold
from truespring.live.rest import InterruptedSearchError
from truespring.live.session import Live
from truespring.live.settings import Settings
from truespring.live.solved import solved
from truespring.live.state import State
from truespring.models import Model
from truespring.motion.stages import ORDERS, Moment
from truespring.potential import Potential
from truespring.problem import Problem

# Time behind the session beyond which a follower waits for a state to go on from [s].
_FAR = 3.0
# Frames between two of shorter steps that are shown; fewer if these take longer [s].
_EVERY, _LONG = 6, 0.5
# Seconds of computing that a follower may be ahead of another one.
_FAIR = 1.0


@dataclass(frozen=True, eq=False)
class Job:
    """What is compared.

    Attributes:
        problem: the problem of the session, completed.
        reference: the model to compare with.
        model: the model of the session at its begin.
        models: the models to which the session may change, by name.
        settings: how the session takes its steps.
        scheme: the scheme that it takes, a word of `Dynamics`; empty for that of the settings.
    """

    problem: Problem
    reference: Model | Potential
    model: Model | Potential
    models: Mapping[str, Model]
    settings: Settings
    scheme: str = ""


class Beside:
    """The reference and shorter steps beside a session.

    Attributes:
        notes: what happened, in sentences; whoever reads them may remove them.
        held: the state of the session when it was held still; None while it moves.
    """

    def __init__(self, job: Job) -> None:
        """Begin at the begin of the session."""
        dynamics = job.problem.dynamics
        assert dynamics is not None  # the problem of a session is completed
        self._begins_at_rest = dynamics.start == "equilibrium"
        problem = replace(job.problem, dynamics=replace(dynamics, start="rest"))
        settings = job.settings

        def moving() -> Live:
            return Live(problem, job.reference, frame=settings.frame, scheme=settings.scheme, step=settings.step)

        def finer() -> Live:
            return Live(
                problem,
                job.model,
                models=job.models,
                frame=settings.frame,
                scheme=job.scheme or settings.scheme,
                iterations=settings.iterations,
            )

        self._moving = Follower(moving, self._begins_at_rest, "the reference's motion")
        self._finer = Follower(finer, True, "the motion with shorter steps")
        self._frame_time = settings.frame
        self.notes: list[str] = []
        self.held: State | None = None
        self._frame, self._run = 0, 0
        self._hold, self._work = Hold(), _nothing()
        self._rest: Floats | None = None
        self._unsolved: tuple[State, float] | None = None
        self._shown = 0.0
        self._hear: Callable[[], None] = lambda: None

    # --- what it receives ---------------------------------------------------------------------------------------

    def tell(self, command: Command) -> None:
        """Note a command of the session."""
        self._release()
        if command.kind == "restart":
            self._run, self._frame = self._run + 1, 0
            self._moving.restart(waits=self._begins_at_rest)
            self._finer.restart(waits=True)
            return
        self._finer.tell(command)
        if command.kind != "model":  # the reference stays
            self._moving.tell(command)

    def frames(self, frame: int, still: bool, step: float, held: State | None = None) -> None:
        """Note how far the session is.

        Args:
            frame: number of frames.
            still: whether the body is held still.
            step: time step [s].
            held: the present state, if it is needed: at the begin of a hold, and where `needs_state` asks for it.
        """
        if not still:
            self._release()
        self._frame = frame
        self._finer.steps_of(step / 2, frame)
        if held is not None and self.needs_state:
            self._finer.go_on(held)
        if still and self.held is None and held is not None:
            self.held, self._work = held, self._at_rest(held)

    def present(self, state: State, step: float) -> None:
        """Note a state whose next frame is to be solved to the end, and the time step there [s]."""
        self._unsolved = state, step

    def _release(self) -> None:
        """Note that the body is not held as before; the reference may move on from its equilibrium."""
        held, rest = self.held, self._rest
        self.held, self._rest, self._work = None, None, _nothing()
        if held is not None and rest is not None:
            now = held.moment.time + (self._frame - held.frame) * self._frame_time
            self._moving.go_on(replace(held, frame=self._frame), Moment(now, rest, np.zeros_like(rest)))

    @property
    def needs_state(self) -> bool:
        """Whether the present state of the session is needed, for shorter steps to go on from."""
        return self._finer.waits

    # --- what it does -------------------------------------------------------------------------------------------

    def turn(self, hear: Callable[[], None] = lambda: None) -> list[Ghost] | None:
        """Do a piece of work and return what was found; None if there is nothing to do.

        `hear` is called after each iteration of an equilibrium, and may call `tell` and `frames`: the search is given
        up if the body is not held as before.
        """
        self._hear = hear
        try:
            for ghost in self._work:
                return [ghost]
        except InterruptedSearchError:
            return []
        if self._unsolved is not None and self._finer.has_body_of_session:
            (state, step), self._unsolved = self._unsolved, None
            return [replace(solved(self._finer.live, state, step), run=self._run)]
        ready = [one for one in (self._moving, self._finer) if self._follows(one)]
        if not ready:
            return None
        most = max(self._moving.spent, self._finer.spent)
        for each in ready:
            each.spent = max(each.spent, most - _FAIR)
        one = min(ready, key=lambda each: each.spent)
        found = one.step()
        self._note(one)
        if not found:
            return []
        return list(self._moved() if one is self._moving else self._refined())

    def _follows(self, one: Follower) -> bool:
        """Return whether a follower has something to do; it waits if it is too far behind."""
        if not one.waits and self._behind(one) > _FAR:
            one.waits = True
        return not one.waits and one.frame < self._frame

    def _behind(self, one: Follower) -> float:
        """Return how far a follower is behind the session [s]."""
        return (self._frame - one.frame) * self._frame_time

    def _note(self, one: Follower) -> None:
        self.notes += one.notes
        one.notes = []

    def _moved(self) -> Iterator[Ghost]:
        one = self._moving
        says = f"by {one.live.scheme}, {one.live.step_length:.3g} s a step"
        yield Ghost(one.live.time, "moving", one.live.positions, since=one.since, says=says, run=self._run)

    def _refined(self) -> Iterator[Ghost]:
        one = self._finer
        if one.frame % _EVERY == 0 or one.spent - self._shown > _LONG:
            self._shown = one.spent
            order = next((order for name, order in ORDERS.items() if one.live.scheme.startswith(name)), 2)
            says = f"{one.live.step_length:.3g} s a step"
            moved = one.live.positions
            yield Ghost(one.live.time, "finer", moved, since=one.since, order=order, says=says, run=self._run)

    def _at_rest(self, held: State) -> Iterator[Ghost]:
        """Yield the reference's equilibrium while the body is held as in a state; the motion may go on from it."""

        def stop() -> bool:
            self._hear()
            return self.held is not held

        for one in (self._moving, self._finer):
            one.match_body()
            self._note(one)
        last = None
        for found in self._hold.follow(self._moving.live, self._finer.live, held, stop):
            n_nodes, last = len(self._moving.live.positions), found
            positions = found.reference[:n_nodes]
            yield Ghost(held.moment.time, "rest", positions, found.own, coarse=found.coarse, run=self._run)
        if last is None or last.coarse:
            self.notes.append(f"{held.moment.time:.4g} s: no equilibrium of the reference was found at rest")
        elif self._moving.waits or self._behind(self._moving) > _FAR:
            self._moving.waits, self._rest = True, last.reference


def _nothing() -> Iterator[Ghost]:
    """Yield nothing."""
    return iter(())
