"""The twin of a session: the reference, and shorter steps, in another process that runs at its own pace."""

import copyreg
import io
import multiprocessing
import os
import pickle
import queue
import signal
import threading
from collections import deque
from contextlib import suppress
from multiprocessing.connection import Connection
from types import MappingProxyType, TracebackType
from typing import Any, Self

from truespring.errors import LiveError, one_line
from truespring.live.beside import Beside, Job
from truespring.live.commands import Command
from truespring.live.ghost import Ghost
from truespring.live.session import Live
from truespring.models import Model
from truespring.potential import Potential

# Number of frames for which a body must be still, and nothing that holds it moved, until it counts as held.
_STILL = 12
# Frames between two measurements of the solver's error.
_ONCE = 60
# Kinetic over elastic energy of a body that is still.
_KINETIC = 0.01
# Number of ghosts that are kept until `news` is called.
_KEPT = 100
# Time for the process to end [s].
_PATIENCE = 5.0
# How much less urgent the process is (nice).
_NICE = 5


class Twin:
    """A process that receives the commands of a session and its number of frames; `news` returns what it found.

    All methods but `close` return at once. If the process ends, `ended` has the reason, and the session goes on. The
    process has one thread of kernels and a lower priority.

    Attributes:
        notes: what happened, in sentences.
        ended: why the process has ended, empty while it runs.
    """

    def __init__(self, live: Live, reference: Model | Potential) -> None:
        """Start the process beside a session at its begin; `reference` is the model to compare with.

        Raises LiveError if problem or models cannot be sent to another process.
        """
        self._live = live
        scheme = live.scheme.split(",")[0]
        job = Job(live.problem, reference, live.model, live.models, live.settings, scheme)
        self.notes: list[str] = []
        self.ended = ""
        self._log, self._told, self._frame = live.log, 0, -1
        self._run, self._quiet, self._state_due, self._closing = 0, 0, True, False
        self._found: deque[Ghost] = deque(maxlen=_KEPT)
        self._to_send: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self._to_send.put(packed(job))
        context = multiprocessing.get_context("spawn")
        self._connection, theirs = context.Pipe()
        self._process = context.Process(target=serve, args=(theirs,), name="truespring twin", daemon=True)
        self._process.start()
        theirs.close()
        for work in (self._send, self._receive):
            threading.Thread(target=work, name="truespring twin", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def tell(self, command: Command) -> None:
        """Take a command of the session."""
        self._quiet = 0
        if command.kind == "restart":
            self._run += 1
            self._state_due = True
        self._put("tell", command)

    def frames(self, n: int, still: bool) -> None:
        """Take the number of frames of the session, and whether it is still; in the thread of the session.

        A body that was still for some frames, while no command came, is held: its equilibrium is looked for.
        """
        advanced, self._frame = n != self._frame, n
        if advanced:
            self._quiet = self._quiet + 1 if still and not self._moves else 0
        held = self._quiet >= _STILL
        begins = advanced and self._quiet == _STILL
        state = self._live.state if begins or self._state_due else None
        self._state_due = False
        live = self._live
        self._put("frames", n, held, live.step_length, state)
        if live.settings.iterations and not live.scheme.startswith("leapfrog") and n % _ONCE == 0:
            self._put("present", live.state, live.step_length)

    def follow(self) -> None:
        """Send what is new in the session, after each frame: instead of `tell` and `frames`."""
        log = self._live.log
        if log is not self._log:
            self._log, self._told = log, 0
            self.tell(Command(0, "restart"))
        for command in log.commands[self._told :]:
            self.tell(command)
        self._told = len(log.commands)
        energies = self._live.energies()
        self.frames(log.frames, energies.kinetic <= _KINETIC * energies.elastic)

    @property
    def _moves(self) -> bool:
        """Whether a grasp or sphere is on its way to where it was asked to go."""
        state = self._live.state
        ends = {name: one.end for several in (state.grips, state.balls) for name, one in several.items()}
        return any((end != state.targets[name]).any() for name, end in ends.items())

    def news(self) -> list[Ghost]:
        """Return what was found since the last call, oldest first, without what belongs to a run before a restart."""
        found = []
        with suppress(IndexError):
            while True:
                found.append(self._found.popleft())
        return [one for one in found if one.run == self._run]

    @property
    def pid(self) -> int | None:
        """The number of the process."""
        return self._process.pid

    def close(self) -> None:
        """End the process."""
        self._closing = True
        self.ended = self.ended or "it was closed"
        self._to_send.put(None)
        self._process.terminate()
        self._process.join(_PATIENCE)
        if self._process.is_alive():
            self._process.kill()
        self._connection.close()

    def _put(self, *message: Any) -> None:
        if not self.ended:
            self._to_send.put(pickle.dumps(message))

    def _send(self) -> None:
        """Send what is asked, in a thread: a process that computes does not read."""
        with suppress(OSError, ValueError):
            while (message := self._to_send.get()) is not None:
                self._connection.send_bytes(message)

    def _receive(self) -> None:
        """Take what was found, in a thread, until the process ends."""
        try:
            while True:
                found = self._connection.recv()
                if isinstance(found, Ghost):
                    self._found.append(found)
                elif isinstance(found, str):
                    self.notes.append(found)
                else:
                    self._state_due = True
        except (EOFError, OSError, pickle.UnpicklingError):
            if not self._closing:
                self._process.join(1.0)
                self.ended = (
                    f"the twin's process has ended, exit code {self._process.exitcode}: no model error is known"
                )
                self.notes.append(self.ended)


def serve(connection: Connection) -> None:
    """Run what is beside a session in this process until the connection is closed."""
    from threadpoolctl import threadpool_limits

    from truespring.kernels.threads import set_threads

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt of the terminal is for the session
    if hasattr(os, "nice"):
        os.nice(_NICE)
    set_threads(1)
    with suppress(EOFError, OSError), threadpool_limits(1):
        _Served(connection).run()


class _Served:
    """The other end of a twin."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._beside = Beside(pickle.loads(connection.recv_bytes()))
        self._asked = False

    def run(self) -> None:
        """Work until the connection is closed."""
        idle = True
        while True:
            if idle:
                self._connection.poll(None)
            self._hear()
            try:
                found = self._beside.turn(self._hear)
            except Exception as error:  # of a numerical library: the next turn does other work
                found = []
                self._beside.notes.append(f"the twin: {type(error).__name__}: {one_line(str(error))}")
            idle = found is None
            for one in [*(found or []), *self._beside.notes]:
                self._connection.send(one)
            self._beside.notes.clear()

    def _hear(self) -> None:
        """Take what the session has sent."""
        while self._connection.poll():
            kind, *values = pickle.loads(self._connection.recv_bytes())
            getattr(self._beside, kind)(*values)
        needs, asked = self._beside.needs_state, self._asked
        if needs and not asked:
            self._connection.send(None)
        self._asked = needs


def packed(job: Job) -> bytes:
    """Return a job as bytes; raise LiveError if that is not possible."""
    file = io.BytesIO()
    pickler = pickle.Pickler(file)
    pickler.dispatch_table = copyreg.dispatch_table | {MappingProxyType: _by_its_values}
    try:
        pickler.dump(job)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        text = "problem and models cannot be sent to the process of the twin"
        raise LiveError(f"{text}: {one_line(str(error))}: define models in a module, not within a function") from None
    return file.getvalue()


def _by_its_values(one: "MappingProxyType[Any, Any]") -> tuple[Any, ...]:
    return _unchangeable, (dict(one),)


def _unchangeable(values: dict[Any, Any]) -> "MappingProxyType[Any, Any]":
    return MappingProxyType(values)
