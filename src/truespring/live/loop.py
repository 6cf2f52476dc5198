"""The thread that owns a session: it carries out orders, keeps the pace of the clock and makes known each frame."""

import threading
from collections import deque
from collections.abc import Callable, Sequence

import numpy as np

from truespring.errors import TruespringError, one_line
from truespring.live.commands import COMMANDS, Log
from truespring.live.companion import Companion, Gauge
from truespring.live.compared import Compared
from truespring.live.drawn import Drawn, drawn
from truespring.live.marks import marks_of
from truespring.live.orders import Order, Orders
from truespring.live.pace import Clock, Meter, Pace, WallClock
from truespring.live.readout import Facts, Readout
from truespring.live.ring import Kept, Ring
from truespring.live.session import Live
from truespring.live.snapshot import Mark, Snapshot

#: Slowest and fastest simulated time per real time.
SPEEDS = (0.01, 10.0)
# Kinetic over elastic energy below which a body is held still, and how often that is looked at [frames].
_STILL, _LOOK = 0.01, 6
# Time between looks at the orders while the session is paused [s].
_IDLE = 0.05
# A body of more nodes is cut aside.
_LARGE = 3000
# Number of messages of the loop that are kept.
_MESSAGES = 50


class Loop:
    """A session that runs at the pace of the clock, in a thread of its own.

    `ask` and `latest` may be called from any thread and never wait for the session.

    Attributes:
        live: the session; only the thread of the loop uses it.
        orders: the queue of what is asked.
        ring: the last frames.
        latest: the last snapshot.
    """

    def __init__(
        self,
        live: Live,
        *,
        model: str = "",
        speed: float = 1.0,
        twin: Companion | None = None,
        gauge: Gauge | None = None,
        save: Callable[[Live], str] | None = None,
        about: Sequence[str] = (),
        clock: Clock | None = None,
    ) -> None:
        """Take a session.

        Args:
            live: the session.
            model: name of its model.
            speed: simulated time per real time.
            twin: a reference that follows it; None for none.
            gauge: what measures the errors; None for none.
            save: writes the session to files, and returns what was written, as a sentence.
            about: sentences about the session, for the page.
            clock: what the pace is kept by; None for the clock of the machine.
        """
        self.live, self.orders = live, Orders()
        self.clock: Clock = clock if clock is not None else WallClock()
        self.pace, self.meter = Pace(live.settings.frame, speed), Meter()
        self.ring = Ring(live.settings.frame)
        self.running, self.still, self.pins = True, False, set[str]()
        self.messages: deque[str] = deque(about, maxlen=_MESSAGES)
        self._compared = Compared(twin, gauge, live.log)
        self._save = save
        self._single, self._echo, self._numbers = 0, float("nan"), 0
        self._drawn: Drawn = drawn(live.problem.mesh)
        self._readout = Readout(model)
        self._watchers: list[Callable[[], None]] = []
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self.latest: Snapshot = self._snapshot(fresh=True)

    # --- from other threads -------------------------------------------------------------------------------------

    def ask(self, order: Order) -> bool:
        """Ask for something before the next frame; return False if too much is waiting and it was left out."""
        return self.orders.add(order)

    def watch(self, seen: Callable[[], None]) -> None:
        """Call a function, which must return at once, after each frame in the thread of the loop."""
        self._watchers.append(seen)

    def start(self) -> None:
        """Begin to advance, in a thread."""
        self._thread = threading.Thread(target=self._run, name="truespring live", daemon=True)
        self._thread.start()

    def stop(self, seconds: float = 10.0) -> None:
        """End the thread, after the frame that it is at; wait for it some time at most [s]."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(seconds)
        self._compared.close()

    def save(self) -> str:
        """Write the session to files, after `stop` or before `start`, and return what was written, as a sentence.

        Empty without a folder to write to, or where nothing has moved.
        """
        return "" if self._save is None or not self.live.log.frames else self._save(self.live)

    # --- the thread ---------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while not self._ended.is_set():
            self.turn()

    def turn(self) -> None:
        """Carry out what is asked and, unless paused, advance by a frame when it is due."""
        if self.running or self._single:
            self.clock.sleep(self.pace.wait(self.clock.now()))
        else:
            self.orders.wait(_IDLE)
            self.pace.begin_again()
        asked = self._asked()
        moves = self.running or self._single > 0
        if moves:
            self._guarded(self._advance)
        self._end_turn(moves, asked)

    def _asked(self) -> bool:
        """Carry out what is asked; return whether anything was."""
        asked = self.orders.take()
        for order in asked:
            self._guarded(lambda order=order: self._carry_out(order))  # type: ignore[misc]
        return bool(asked)

    def _end_turn(self, moves: bool, asked: bool) -> None:
        """Compare with the twin, and make known what changed."""
        before = self._compared.overlay
        self._guarded(lambda: self._compared.news(self.ring, self.messages))
        if moves or asked or self._compared.overlay is not before:
            self._publish(fresh=asked)

    def _guarded(self, done: Callable[[], None]) -> None:
        """Do something; what goes wrong becomes a message, and pauses the session unless it is a wrong order."""
        try:
            done()
        except TruespringError as error:
            self.messages.append(one_line(str(error)))
        except Exception as error:
            self.running, self._single = False, 0
            self.messages.append(f"paused after an error: {type(error).__name__}: {one_line(str(error))}: restart")

    def _advance(self) -> None:
        """Advance the session by a frame."""
        self._single = max(0, self._single - 1)
        before = self.live.log
        self.live.step()
        self._count(1, before)

    def _count(self, frames: int, before: Log) -> None:
        """Count frames by which the session advanced; `before` is its log then, another one if it began again."""
        log = self.live.log
        self.meter.add(self.clock.now(), frames * self.live.settings.frame if log is before else 0.0)
        self.ring.add(Kept(log.frames, self.live.time, self.live.positions))
        if log.frames % _LOOK < frames:
            energies = self.live.energies()
            self.still = energies.kinetic < _STILL * energies.elastic
        self._compared.tell(log, self.still)

    # --- orders -------------------------------------------------------------------------------------------------

    def _carry_out(self, order: Order) -> None:
        """Carry out an order."""
        if order.echo is not None:
            self._echo = order.echo
        own: dict[str, Callable[[Order], object]] = {
            "pull": lambda one: self.live.pull(self._node(one), name=one.name),
            "push": lambda one: self.live.push(one.place, name=one.name, radius=one.radius),
            "pin": self._pin,
            "cut": self._cut,
            "let-go": self._let_go,
            "release-all": self._release_all,
            "pause": lambda _: self._set_running(False),
            "play": lambda _: self._set_running(True),
            "step": self._step_once,
            "speed": self._set_speed,
            "save": self._do_save,
        }
        if order.kind in own:
            own[order.kind](order)
        else:
            self.live.do(order.kind, order.name, order.place, order.radius, order.value)
            self._readout.changed(order)
            if not COMMANDS[order.kind].repeats:
                self.messages.append(f"{order.kind} was changed: a recording ends before it")
        if order.kind == "restart":
            self.ring, self.pins = Ring(self.live.settings.frame), set()
        self._compared.tell(self.live.log, self.still)

    def _node(self, order: Order) -> int:
        """Return the number of the node of an order among those of the mesh, or of the surface's node nearest to it."""
        nodes = self._drawn.nodes
        if order.node is None or not 0 <= order.node < len(nodes):
            raise TruespringError(f"{order.kind}: node {order.node}: the drawn nodes are 0 to {len(nodes) - 1}")
        return self.live.node_at(self.live.positions[nodes[order.node]].tolist())

    def _held(self) -> list[str]:
        return [*self.live.grasps, *self.live.spheres]

    def _pin(self, order: Order) -> None:
        self.live.pin(self._node(order), name=order.name)
        self.pins.add(order.name)

    def _cut(self, order: Order) -> None:
        """Cut; a large body is built aside, while it moves on."""
        start, end, *depth = np.reshape(order.place, (-1, self.live.dim)).tolist()
        self.live.cut(start, end, *depth, aside=self.live.problem.mesh.n_nodes > _LARGE)
        self.messages.append("the body was cut: a recording ends before the first cut")

    def _let_go(self, order: Order) -> None:
        """Release what may have been released already."""
        if order.name in self._held():
            self.live.release(order.name)

    def _release_all(self, order: Order) -> None:
        for name in self._held():
            self.live.release(name)

    def _set_running(self, running: bool) -> None:
        self.running = running
        self.meter.clear()
        self.pace.begin_again()

    def _step_once(self, order: Order) -> None:
        self._set_running(False)
        self._single = 1

    def _set_speed(self, order: Order) -> None:
        low, high = SPEEDS
        if order.value is None or not low <= order.value <= high:
            raise TruespringError(f"speed = {order.value!r}: must be a number from {low:g} to {high:g}")
        self.pace.speed = order.value
        self.pace.begin_again()
        self.meter.clear()

    def _do_save(self, order: Order) -> None:
        if self._save is None:
            raise TruespringError("there is no folder to write to: start with --record DIR")
        self.messages.append(self._save(self.live))

    # --- making known -------------------------------------------------------------------------------------------

    def show(self) -> None:
        """Make known the present state of a session that was advanced from outside, in the thread of the session."""
        self._publish(fresh=True)

    def _publish(self, fresh: bool) -> None:
        """Make known the present state; `fresh` with readouts of this moment."""
        self.latest = self._snapshot(fresh)
        for seen in self._watchers:
            seen()

    def _snapshot(self, fresh: bool) -> Snapshot:
        live = self.live
        if live.problem.mesh is not self._drawn.mesh:
            self._drawn, self._compared.overlay = drawn(live.problem.mesh, self._drawn.number + 1), None
        marks = marks_of(live, self.pins)
        readout = self._readout.values(self.clock.now(), live, lambda: self._facts(marks), fresh)
        self._numbers += 1
        echo, self._echo = self._echo, float("nan")
        known = (live.log.frames, live.time, self.running, self._drawn, live.positions, marks)
        return Snapshot(self._numbers, *known, self._compared.overlay, readout, echo)

    def _facts(self, marks: Sequence[Mark]) -> Facts:
        overlay, errors = self._compared.overlay, self._compared.errors
        pace = self.running, self.pace.speed, self.meter.rates()
        return Facts(*pace, self.still, marks, overlay, errors, tuple(self.messages), self._save is not None)
