"""The pace of a session against the clock, and how well it is kept."""

import time
from collections import deque
from typing import Protocol


class Clock(Protocol):
    """What the loop reads the time from."""

    def now(self) -> float:
        """Return the time [s] since an arbitrary begin."""
        ...

    def sleep(self, seconds: float) -> None:
        """Return after a time [s]."""
        ...


class WallClock:
    """The clock of the machine."""

    def now(self) -> float:
        """Return the time [s] since an arbitrary begin."""
        return time.perf_counter()

    def sleep(self, seconds: float) -> None:
        """Return after a time [s]."""
        time.sleep(seconds)


class Pace:
    """When the next frame is due.

    A frame that is late does not make later ones early: what is lost stays lost, and the real-time factor falls.
    """

    def __init__(self, frame: float, speed: float = 1.0) -> None:
        """Take the time between frames [s] and the simulated time per time of the clock."""
        self.frame, self.speed = frame, speed
        self._due: float | None = None

    def wait(self, now: float) -> float:
        """Return how long to wait for the next frame [s], and count it as begun then."""
        due = now if self._due is None or self._due < now - self._late else self._due
        self._due = due + self.frame / self.speed
        return max(0.0, due - now)

    @property
    def _late(self) -> float:
        """Lateness that is made up for [s]: a frame."""
        return self.frame / self.speed

    def begin_again(self) -> None:
        """Count the next frame as due at once."""
        self._due = None


class Meter:
    """Frames a second and real-time factor over the last second of the clock."""

    def __init__(self, span: float = 1.0) -> None:
        """Take the time over which is averaged [s]."""
        self._span = span
        self._seen: deque[tuple[float, float]] = deque()

    def add(self, now: float, simulated: float) -> None:
        """Count a frame at a time of the clock that advanced the session by `simulated` [s]."""
        self._seen.append((now, simulated))
        while self._seen and self._seen[0][0] < now - self._span:
            self._seen.popleft()

    def clear(self) -> None:
        """Forget all frames."""
        self._seen.clear()

    def rates(self) -> tuple[float, float] | None:
        """Return frames a second and simulated over real time; None until there are two frames."""
        if len(self._seen) < len("ab"):
            return None
        passed = self._seen[-1][0] - self._seen[0][0]
        if passed <= 0:
            return None
        counted = list(self._seen)[1:]
        return len(counted) / passed, sum(one for _, one in counted) / passed
