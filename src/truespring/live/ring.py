"""The last frames of a session, to be compared with a motion that is known later."""

from collections import deque
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats

#: Simulated time that is kept [s].
SECONDS = 5.0
# Memory of the frames at most [bytes].
_BYTES = 128 * 2**20


@dataclass(frozen=True, eq=False, slots=True)
class Kept:
    """A frame.

    Attributes:
        frame: its number since the begin.
        time: [s].
        positions: of the nodes of the mesh [m], shape (n_nodes, dim).
    """

    frame: int
    time: float
    positions: Floats


class Ring:
    """The last frames, oldest first."""

    def __init__(self, frame: float, seconds: float = SECONDS) -> None:
        """Begin empty; `frame` is the time between frames [s]."""
        self._frame, self._most = frame, max(2, round(seconds / frame) + 1)
        self._kept: deque[Kept] = deque()

    def __len__(self) -> int:
        return len(self._kept)

    def add(self, kept: Kept) -> None:
        """Add a frame; the oldest leave. A frame of an earlier time than the last empties the ring first."""
        if self._kept and (kept.time < self._kept[-1].time or kept.positions.shape != self._kept[-1].positions.shape):
            self._kept.clear()
        self._kept.append(kept)
        most = min(self._most, max(2, _BYTES // max(kept.positions.nbytes, 1)))
        while len(self._kept) > most:
            self._kept.popleft()

    def at(self, time: float) -> Floats | None:
        """Return the positions [m] at a time [s], linear between frames; None if it is not kept."""
        if not self._kept or not self._kept[0].time <= time + self._same or time > self._kept[-1].time + self._same:
            return None
        times = np.array([one.time for one in self._kept])
        after = int(np.searchsorted(times, time - self._same))
        late = self._kept[after]
        if abs(late.time - time) <= self._same or after == 0:
            return late.positions
        early = self._kept[after - 1]
        share = (time - early.time) / (late.time - early.time)
        return np.asarray(early.positions + share * (late.positions - early.positions))

    @property
    def _same(self) -> float:
        """Times closer than this are equal [s]."""
        return 1e-6 * self._frame
