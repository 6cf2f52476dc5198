"""A live session in a notebook: the scene of the page, with the mouse. Needs the package anywidget."""

import asyncio
import time
from pathlib import Path
from typing import Any

try:
    import anywidget
    import traitlets
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(f"{error}: pip install 'truespring[notebook]' for a live session in a notebook") from None

from truespring.errors import TruespringError, one_line
from truespring.live.guest import Guest, Names
from truespring.live.loop import Loop
from truespring.live.protocol import frame, parsed, text
from truespring.live.session import Live


class _Kernel:
    """The clock of a kernel: its event loop waits, the session does not."""

    def now(self) -> float:
        """Return the time [s] since an arbitrary begin."""
        return time.perf_counter()

    def sleep(self, seconds: float) -> None:
        """Return at once."""


class LiveWidget(anywidget.AnyWidget):
    """A live session that is drawn in a notebook, and pulled and cut with the mouse.

    Between cells the session runs at the pace of the clock, once `play` was called or the button was pressed. In a
    cell, advance the session itself by `live.step`, and call `update` to draw it.

    Attributes:
        live: the session.
        body: what is drawn, as JSON; see docs/live.md.
        frame: the present state, a frame of the page.
        running: whether it runs.
        message: what went wrong last.
    """

    _esm = Path(__file__).with_name("widget.min.js")

    body = traitlets.Unicode("").tag(sync=True)
    frame = traitlets.Bytes(b"").tag(sync=True)
    running = traitlets.Bool(False).tag(sync=True)
    message = traitlets.Unicode("").tag(sync=True)

    def __init__(self, live: Live, **more: Any) -> None:
        """Draw a session, paused; `more` are values of other traits, such as `layout`."""
        super().__init__(**more)
        self.live = live
        self._loop = Loop(live, clock=_Kernel())
        self._guest = Guest(self._loop, Names(), owner=True)
        self._loop.running = False
        self._drawn = -1
        self._task: asyncio.Task[None] | None = None
        self.on_msg(self._heard)
        self.update()

    def update(self) -> None:
        """Draw the present state."""
        self._loop.show()
        self._publish()

    def play(self) -> None:
        """Run, while the kernel does nothing else; without an event loop call `update` after each step instead."""
        self._loop.running = self.running = True
        self._loop.pace.begin_again()
        if self._task is None or self._task.done():
            self._task = asyncio.get_running_loop().create_task(self._run())

    def pause(self) -> None:
        """Stand still."""
        self._loop.running = self.running = False

    def close(self) -> None:
        """Remove the widget; the session stays."""
        self.pause()
        super().close()

    async def _run(self) -> None:
        """Advance by a frame when it is due, as long as it runs."""
        while self.running:
            due = time.perf_counter() + self.live.settings.frame / self._loop.pace.speed
            self.turn()
            await asyncio.sleep(max(0.0, due - time.perf_counter()))

    def turn(self) -> None:
        """Carry out what was asked, advance by a frame if it runs, and draw."""
        self._loop.turn()
        if self._loop.messages:
            self.message = self._loop.messages[-1]
        self._publish()

    def _heard(self, widget: Any, content: Any, buffers: Any) -> None:
        """Take a message of the page."""
        try:
            message = parsed(content if isinstance(content, str) else "")
            kind = getattr(message, "kind", "")
            if kind in ("play", "pause"):
                self.play() if kind == "play" else self.pause()
                return
            self._guest.take(message)
        except TruespringError as error:
            self.message = one_line(str(error))
            return
        if not self.running:
            self.turn()

    def _publish(self) -> None:
        """Give the page the last snapshot, and the body if it changed."""
        snapshot = self._loop.latest
        if snapshot.drawn.number != self._drawn:
            self._drawn, self.body = snapshot.drawn.number, text(snapshot.drawn.values)
        self.frame = frame(snapshot)
