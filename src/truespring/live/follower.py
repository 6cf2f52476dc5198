"""A session that follows another one: the same commands at the same frames, at its own pace."""

import time
from collections import deque
from collections.abc import Callable, Iterable
from functools import cached_property

from truespring.errors import TruespringError, one_line
from truespring.live.commands import COMMANDS, Command
from truespring.live.session import Live
from truespring.live.state import State
from truespring.motion.stages import Moment


class Follower:
    """A session of the same body that carries out the commands of another one.

    Attributes:
        frame: number of frames of the other session that it has followed.
        waits: whether it waits for a state to go on from.
        since: time of the state that it went on from [s].
        spent: seconds of computing, to share a core among several.
        notes: what happened, in sentences.
    """

    def __init__(self, build: Callable[[], Live], waits: bool, says: str) -> None:
        """Store how the session is built, when it is used first; `says` names it in notes."""
        self._build, self.waits, self._says = build, waits, says
        self.frame, self.since, self.spent = 0, 0.0, 0.0
        self.notes: list[str] = []
        self._reason = ""
        self._first: list[Command] = []
        self._start: tuple[State, Moment | None] | None = None
        self._left: deque[Command] = deque()
        self._steps: deque[tuple[int, float]] = deque()

    @cached_property
    def live(self) -> Live:
        """The session."""
        return self._build()

    def tell(self, command: Command) -> None:
        """Keep a command of the other session for its frame."""
        self._left.append(command)

    def steps_of(self, step: float, frame: int) -> None:
        """Take steps of at most a length [s] from a frame on."""
        if not self._steps or self._steps[-1][1] != step:
            self._steps.append((frame, step))

    def restart(self, waits: bool) -> None:
        """Begin again; the body stays as it was changed. `waits`: it does not know that state."""
        self._first = [*self._changes, Command(0, "restart")]
        self._left.clear()
        self._start = None
        self._latest_step()
        self.frame, self.since, self.waits = 0, 0.0, waits

    def go_on(self, held: State, moment: Moment | None = None) -> None:
        """Go on from the state of the other session, or from `moment`, held so; after all commands before it."""
        self._first, self._start = self._changes, (held, moment)
        self._left.clear()
        self._latest_step()
        self.frame, self.since, self.waits = held.frame, (moment or held.moment).time, False

    def match_body(self) -> None:
        """Carry out all changes of the body now; if the motion is not yet there, it waits for a state to go on from."""
        ahead = any(not COMMANDS[one.kind].holds for one in self._left)
        for one in self._changes:
            self._carry_out(one)
        self.live.settle()
        self._first = [one for one in self._first if COMMANDS[one.kind].holds]
        self._left = deque(one for one in self._left if COMMANDS[one.kind].holds)
        self.waits |= ahead

    def step(self) -> bool:
        """Advance by a frame; return whether it was found. If not, it waits."""
        begun = time.perf_counter()
        try:
            self._advance(self.live)
        except Exception as error:  # of a model or of a numerical library
            self._lose(f"{type(error).__name__}: {one_line(str(error))}")
        self.spent += time.perf_counter() - begun
        return not self.waits

    def _advance(self, live: Live) -> None:
        for one in self._first:
            self._carry_out(one)
        self._first = []
        if self._start is not None:
            live.go_on(*self._start)
            self._start = None
        while self._left and self._left[0].frame <= self.frame:
            self._carry_out(self._left.popleft())
        while self._steps and self._steps[0][0] <= self.frame:
            step = self._steps.popleft()[1]
            if step != live.settings.step:
                live.choose(live.settings.scheme, step, live.settings.iterations)
        if self.waits:
            return
        log = live.log
        live.step()
        self.frame += 1
        if live.log is not log:  # the motion was lost, and has begun again
            self._lose(live.notes[-1])

    @property
    def has_body_of_session(self) -> bool:
        """Whether no change of the body is left to carry out."""
        return not self._changes

    @property
    def _changes(self) -> list[Command]:
        """The changes of the body that are left, without those that a later one replaces."""
        return [one for one in _condensed([*self._first, *self._left]) if not COMMANDS[one.kind].holds]

    def _latest_step(self) -> None:
        """Take the latest length of steps at once."""
        if self._steps:
            self._steps = deque([(0, self._steps[-1][1])])

    def _carry_out(self, command: Command) -> None:
        try:
            self.live.repeat(command)
        except TruespringError as error:
            self._lose(str(error))

    def _lose(self, reason: str) -> None:
        """Wait for a state to go on from, and say why unless it is the same reason as before."""
        self.waits = True
        if reason != self._reason:
            self._reason = reason
            self.notes.append(f"{self._says} stopped: {reason}")


def _condensed(commands: Iterable[Command]) -> list[Command]:
    """Return commands in their order without those that a later one replaces."""
    several = list(commands)
    last = {one.kind: number for number, one in enumerate(several)}
    kept = enumerate(several)
    return [one for number, one in kept if not COMMANDS[one.kind].lasts or last[one.kind] == number]
