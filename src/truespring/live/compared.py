"""A session and its reference, compared at equal times."""

from collections.abc import Mapping, MutableSequence

import numpy as np

from truespring.live.commands import Command, Log
from truespring.live.companion import Companion, Gauge
from truespring.live.ring import Ring
from truespring.live.snapshot import Overlay

# Kinds of ghosts that are shown.
_SHOWN = ("rest", "moving")


class Compared:
    """The reference of a session: it is given what is asked of the session, and compared with it.

    Attributes:
        overlay: the last state of the reference that is shown; None without one.
    """

    def __init__(self, twin: Companion | None, gauge: Gauge | None, log: Log) -> None:
        """Take the reference and what measures the errors, None for none; `log` is that of the session."""
        self.overlay: Overlay | None = None
        self._twin, self._gauge, self._log = twin, gauge, log
        self._told, self._number = 0, 0

    @property
    def errors(self) -> Mapping[str, str]:
        """The errors that are known, as text."""
        return {} if self._gauge is None else self._gauge.words()

    def tell(self, log: Log, still: bool) -> None:
        """Give the reference the commands and the frames since the last time; `still`: the body is held still."""
        if log is not self._log:  # it began again
            self._log, self._told, self.overlay = log, 0, None
            if self._twin is not None:
                self._twin.tell(Command(0, "restart"))
        if self._twin is None:
            return
        for command in log.commands[self._told :]:
            self._twin.tell(command)
        self._told = len(log.commands)
        self._twin.frames(log.frames, still)

    def news(self, ring: Ring, messages: MutableSequence[str]) -> None:
        """Compare the news of the reference with the frames of the session; add what happened to the messages."""
        if self._twin is None:
            return
        messages.extend(self._twin.notes)
        self._twin.notes.clear()
        for ghost in self._twin.news():
            if self._gauge is not None:
                self._gauge.take(ghost, ring)
            own = ring.at(ghost.time)
            own = ghost.own if own is None else own  # at rest the equilibrium of the session's model is known, too
            if ghost.kind not in _SHOWN or own is None or own.shape != ghost.positions.shape:
                continue
            apart = np.linalg.norm(ghost.positions - own, axis=1)
            self._number += 1
            self.overlay = Overlay(self._number, ghost.kind, ghost.time, ghost.positions, apart)

    def close(self) -> None:
        """End the reference."""
        if self._twin is not None:
            self._twin.close()
