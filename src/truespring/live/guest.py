"""A page at the server: what it holds, what it has received, and what its messages ask of the loop."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from truespring.errors import LiveError
from truespring.live.drawn import Drawn
from truespring.live.loop import Loop
from truespring.live.orders import Order
from truespring.live.protocol import (
    ChooseModel,
    Cut,
    LetGo,
    Message,
    Move,
    Pin,
    Plain,
    Pull,
    Push,
    Release,
    Seen,
    Value,
    frame,
    ghost,
    text,
)
from truespring.live.snapshot import Snapshot

#: Frames that a page may have been sent without having answered.
IN_FLIGHT = 3


class Names:
    """Names of grasps, spheres and pins that no other has: pull 1, pull 2, ..."""

    def __init__(self) -> None:
        """Begin to count."""
        self._counts: dict[str, int] = {}

    def new(self, what: str) -> str:
        """Return a new name."""
        self._counts[what] = self._counts.get(what, 0) + 1
        return f"{what} {self._counts[what]}"


class Guest:
    """A page.

    Attributes:
        owner: whether it may ask for something; others watch.
    """

    def __init__(self, loop: Loop, names: Names, owner: bool) -> None:
        """Take the loop and the names that are shared by all pages."""
        self.owner = owner
        self._loop, self._names = loop, names
        self._hands: dict[int, str] = {}
        self._sent = self._seen = 0
        self._body, self._snapshot, self._overlay = -1, 0, 0
        self._readout: Mapping[str, Any] | None = None
        self._owned: bool | None = None

    # --- to the page --------------------------------------------------------------------------------------------

    def due(self) -> list[str | bytes]:
        """Return what is to be sent now, oldest first: nothing old, and no frame beyond those in flight."""
        snapshot = self._loop.latest
        found: list[str | bytes] = []
        if snapshot.drawn.number != self._body:
            self._body, self._overlay = snapshot.drawn.number, 0
            found.append(text(snapshot.drawn.values))
        if snapshot.readout is not self._readout or self._owned is not self.owner:
            self._readout, self._owned = snapshot.readout, self.owner
            found.append(text({**snapshot.readout, "owner": self.owner}))
        if snapshot.number != self._snapshot and self._sent - self._seen < IN_FLIGHT:
            found += self._frames(snapshot)
        return found

    def _frames(self, snapshot: Snapshot) -> list[bytes]:
        self._snapshot = snapshot.number
        self._sent += 1
        overlay, found = snapshot.overlay, [frame(snapshot)]
        if overlay is not None and overlay.number != self._overlay:
            self._overlay = overlay.number
            found.append(ghost(snapshot, overlay))
        return found

    # --- from the page ------------------------------------------------------------------------------------------

    def take(self, message: Message) -> None:
        """Ask the loop for what a message says; raise LiveError if that is not possible."""
        if isinstance(message, Seen):
            self._seen = min(self._sent, self._seen + 1)
            return
        if not self.owner:
            raise LiveError("another page has this session: this one only watches")
        if not self._loop.ask(self._order(message)):
            raise LiveError("too many messages wait for the session: this one was left out")
        if isinstance(message, LetGo):
            del self._hands[message.hand]

    def _order(self, message: Message) -> Order:
        """Return the order of a message."""
        makers: Mapping[type[Message], Callable[[Any, Drawn], Order]] = {
            Pull: self._pull,
            Push: self._push,
            Move: lambda one, drawn: Order("move", self._held(one.hand), drawn.in_metres(one.place)),
            LetGo: lambda one, _: Order("let-go", self._held(one.hand)),
            Pin: lambda one, _: Order("pin", self._names.new("pin"), node=one.node),
            Cut: self._cut,
            Release: lambda one, _: Order("release", one.name),
            Plain: lambda one, _: Order(one.kind),
            Value: lambda one, _: Order(one.kind, value=one.value),
            ChooseModel: lambda one, _: Order("model", one.name),
        }
        order = makers[type(message)](message, self._loop.latest.drawn)
        return order if message.clock is None else replace(order, echo=message.clock)

    def _pull(self, message: Pull, drawn: Drawn) -> Order:
        return Order("pull", self._take_up(message.hand, "pull"), node=message.node)

    def _push(self, message: Push, drawn: Drawn) -> Order:
        radius = None if message.radius is None else message.radius * drawn.longest
        return Order("push", self._take_up(message.hand, "sphere"), drawn.in_metres(message.place), radius)

    def _cut(self, message: Cut, drawn: Drawn) -> Order:
        depth = drawn.longest * np.asarray(message.depth)[: 0 if drawn.mesh.dim == len("xy") else None]
        return Order("cut", place=(*drawn.in_metres(message.start), *drawn.in_metres(message.end), *depth.tolist()))

    def _take_up(self, hand: int, what: str) -> str:
        """Return the name of what a hand holds from now on."""
        if hand in self._hands:
            raise LiveError(f"hand {hand} holds something: let go first")
        self._hands[hand] = self._names.new(what)
        return self._hands[hand]

    def _held(self, hand: int) -> str:
        if hand not in self._hands:
            raise LiveError(f"hand {hand} holds nothing: pull or push first")
        return self._hands[hand]

    def leave(self) -> bool:
        """Release what the page holds, and return whether all of it is; pins stay, and the session goes on."""
        left = {hand: name for hand, name in self._hands.items() if not self._loop.ask(Order("let-go", name))}
        self._hands = left
        return not left
