"""What is asked of the loop of a session, in a bounded queue in which the latest of equal orders counts."""

import threading
from dataclasses import dataclass

# Orders of these kinds replace an earlier one of the same kind and name, if only such orders came between.
_LATEST = frozenset({"move", "gravity", "young", "poisson", "damping", "speed"})
#: Number of orders that wait at most.
MOST = 256


@dataclass(frozen=True, slots=True)
class Order:
    """What is asked of a loop: a command of the session, or "pull", "pin", "push", "pause", "play", "step" and others.

    Attributes:
        kind: what is asked, a kind of COMMANDS or of `Loop`.
        name: of the grasp, sphere, pin or model.
        place: coordinates [m].
        radius: [m].
        value: what the kind needs.
        node: number of a node.
        echo: time that a page gave to its message; it comes back with the first frame after it.
    """

    kind: str
    name: str = ""
    place: tuple[float, ...] = ()
    radius: float | None = None
    value: float | None = None
    node: int | None = None
    echo: float | None = None


class Orders:
    """A queue of orders from any thread to the loop."""

    def __init__(self, most: int = MOST) -> None:
        """Begin empty; `most` orders wait at most."""
        self._most = most
        self._waiting: list[Order] = []
        self._changed = threading.Condition()

    def __len__(self) -> int:
        return len(self._waiting)

    def add(self, order: Order) -> bool:
        """Add an order; return False if the queue is full and it was left out. Never blocks for long."""
        with self._changed:
            same = self._earlier(order)
            if same is not None:
                self._waiting[same] = order
            elif len(self._waiting) < self._most:
                self._waiting.append(order)
            else:
                return False
            self._changed.notify()
            return True

    def _earlier(self, order: Order) -> int | None:
        """Return the index of the order that this one replaces, None without one."""
        if order.kind not in _LATEST:
            return None
        for index in range(len(self._waiting) - 1, -1, -1):
            one = self._waiting[index]
            if one.kind not in _LATEST:
                return None
            if (one.kind, one.name) == (order.kind, order.name):
                return index
        return None

    def take(self) -> list[Order]:
        """Return the orders that wait, oldest first, and remove them."""
        with self._changed:
            taken, self._waiting = self._waiting, []
        return taken

    def wait(self, seconds: float) -> None:
        """Return when an order waits, or after some time [s]."""
        with self._changed:
            if not self._waiting:
                self._changed.wait(seconds)
