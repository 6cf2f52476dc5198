"""The server of a session on this machine: one page, one socket, one owner, up to 15 pages that watch."""

import asyncio
import secrets
import signal
import socket
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from importlib.resources import files
from importlib.util import find_spec
from string import Template
from typing import TYPE_CHECKING, Any

from truespring.errors import LiveError
from truespring.live.guest import Guest, Names
from truespring.live.loop import Loop
from truespring.live.protocol import LARGEST, parsed, text

if TYPE_CHECKING:
    from starlette.applications import Starlette
    from starlette.requests import Request
    from starlette.responses import Response
    from starlette.websockets import WebSocket

#: The address that the server is bound to: no other machine reaches it.
ADDRESS = "127.0.0.1"
# Names of this machine in the headers Host and Origin.
_HOSTS = (ADDRESS, "localhost")
# A page is closed after so many wrong messages; no more pages than these may watch.
_WRONG, _PAGES = 20, 16
# WebSocket close codes: a policy was violated; try again later.
_REFUSED, _LATER = 1008, 1013
# Time between attempts to release what a page that left has held [s].
_AGAIN = 0.05
_POLICY = (
    "default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; img-src data:; "
    "connect-src 'self' ws://{host}; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)


class _Bell:
    """Wakes the task that sends to a page, from the thread of the loop."""

    def __init__(self) -> None:
        self.event = asyncio.Event()
        self._loop, self._rung = asyncio.get_running_loop(), False

    def ring(self) -> None:
        """Wake the task; rings before it is awake count once."""
        if not self._rung:
            self._rung = True
            with suppress(RuntimeError):  # the server has ended
                self._loop.call_soon_threadsafe(self._answer)

    def _answer(self) -> None:
        self._rung = False
        self.event.set()


class Server:
    """What answers the pages of a session.

    Attributes:
        token: what an address must carry.
    """

    def __init__(self, loop: Loop, title: str, port: int, token: str | None = None) -> None:
        """Take the loop, a title for the page, and the port that browsers use."""
        self.token = secrets.token_urlsafe(24) if token is None else token
        self._loop, self._title, self._names = loop, title, Names()
        self._hosts = {f"{host}:{port}" for host in _HOSTS}
        self._origins = {f"http://{host}" for host in self._hosts}
        self._guests: dict[Guest, _Bell] = {}
        self._changing = threading.Lock()
        loop.watch(self._wake)

    def _wake(self) -> None:
        for bell in list(self._guests.values()):
            bell.ring()

    # --- who is let in ------------------------------------------------------------------------------------------

    def refusal(self, headers: Mapping[str, str], query: Mapping[str, str]) -> str | None:
        """Return why a request is not answered; None if it is.

        The header Host keeps out pages of other names that lead to this machine, the header Origin pages of other
        servers; a program may leave Origin out. Neither has the token.
        """
        if headers.get("host", "") not in self._hosts:
            return "the header Host is not that of this server"
        if headers.get("origin") is not None and headers["origin"] not in self._origins:
            return "the header Origin is not that of this server"
        if not secrets.compare_digest(query.get("token", "").encode(), self.token.encode()):
            return "the token is missing or wrong: open the address that was printed"
        return None

    # --- the page -----------------------------------------------------------------------------------------------

    async def page(self, request: "Request") -> "Response":
        """Answer with the page."""
        from starlette.responses import HTMLResponse, PlainTextResponse

        common = {"Cache-Control": "no-store", "X-Content-Type-Options": "nosniff", "Referrer-Policy": "no-referrer"}
        refused = self.refusal(request.headers, request.query_params)
        if refused is not None:
            return PlainTextResponse(refused, 403, common)
        nonce = secrets.token_urlsafe(16)
        policy = _POLICY.format(nonce=nonce, host=request.headers["host"])
        return HTMLResponse(page(self._title, nonce), headers={**common, "Content-Security-Policy": policy})

    # --- the socket ---------------------------------------------------------------------------------------------

    async def session(self, socket: "WebSocket") -> None:
        """Serve a page until it leaves."""
        if self.refusal(socket.headers, socket.query_params) is not None:
            await socket.close(_REFUSED)
            return
        if len(self._guests) >= _PAGES:
            await socket.close(_LATER)
            return
        await socket.accept()
        bell, replies = _Bell(), deque[str](maxlen=_WRONG)
        guest = self._enter(bell)
        sending = asyncio.create_task(self._send(socket, guest, bell, replies))
        try:
            await self._receive(socket, guest, bell, replies)
        finally:
            sending.cancel()
            self._leave(guest)
            while not guest.leave():
                await asyncio.sleep(_AGAIN)

    def _enter(self, bell: _Bell) -> Guest:
        with self._changing:
            guest = Guest(self._loop, self._names, owner=not any(one.owner for one in self._guests))
            self._guests[guest] = bell
        bell.ring()
        return guest

    def _leave(self, guest: Guest) -> None:
        """Forget a page; the page that has watched for the longest time becomes the owner."""
        with self._changing:
            del self._guests[guest]
            following = next(iter(self._guests), None)
            if guest.owner and following is not None:
                following.owner = True
        self._wake()

    async def _send(self, socket: "WebSocket", guest: Guest, bell: _Bell, replies: deque[str]) -> None:
        """Send what is due whenever the bell rings; a page that reads slowly only holds up itself."""
        from starlette.websockets import WebSocketDisconnect

        with suppress(WebSocketDisconnect, RuntimeError):  # the page has left
            while True:
                await bell.event.wait()
                bell.event.clear()
                while replies:
                    await socket.send_text(replies.popleft())
                for one in guest.due():
                    await (socket.send_text(one) if isinstance(one, str) else socket.send_bytes(one))

    async def _receive(self, socket: "WebSocket", guest: Guest, bell: _Bell, replies: deque[str]) -> None:
        """Take messages until the page leaves or has sent too many wrong ones."""
        wrong = 0
        while (event := await socket.receive())["type"] == "websocket.receive":
            try:
                guest.take(parsed(_content(event)))
            except LiveError as error:
                wrong += 1
                replies.append(text({"kind": "wrong", "text": str(error)}))
            bell.ring()
            if wrong >= _WRONG:
                await socket.close(_REFUSED)
                return


def _content(event: Mapping[str, Any]) -> str | bytes:
    """Return what a page has sent."""
    content: str | bytes | None = event.get("text")
    return event.get("bytes") or b"" if content is None else content


def page(title: str, nonce: str) -> str:
    """Return the page as HTML, with its style and script; it loads nothing more."""
    from html import escape

    folder = files("truespring").joinpath("live")
    parts = {name: folder.joinpath(file).read_text("utf-8") for name, file in _FILES.items()}
    return Template(parts.pop("page")).substitute(parts, title=escape(title), nonce=escape(nonce))


_FILES = {"page": "page.html", "style": "page.css", "script": "live.min.js"}


def application(server: Server) -> "Starlette":
    """Return the server as an ASGI application."""
    from starlette.applications import Starlette
    from starlette.routing import Route, WebSocketRoute

    return Starlette(routes=[Route("/", server.page), WebSocketRoute("/session", server.session)])


def listening(port: int) -> socket.socket:
    """Return a socket on this machine's own address; 0 takes any free port. Raises LiveError if the port is taken."""
    own = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        own.bind((ADDRESS, port))
        own.listen()  # what connects before the server runs waits for it
    except OSError as error:
        own.close()
        raise LiveError(f"port {port}: {error.strerror}: choose another port, or none for a free one") from None
    return own


def require() -> None:
    """Raise LiveError if a package that the server needs is missing."""
    for name in ("starlette", "uvicorn", "websockets"):
        if find_spec(name) is None:
            raise LiveError(f"live needs the package {name}: pip install 'truespring[live]'")


@contextmanager
def _interrupted(end: Callable[[], None]) -> Iterator[None]:
    """Call a function where the process is interrupted or terminated within the block, instead of ending at once."""
    known = (signal.SIGINT, signal.SIGTERM)
    if threading.current_thread() is not threading.main_thread():  # only that may change what a signal does
        yield
        return
    former = [signal.signal(one, lambda *_: end()) for one in known]
    try:
        yield
    finally:
        for one, before in zip(known, former, strict=True):
            signal.signal(one, before)


def serve(
    loop: Loop,
    title: str,
    *,
    port: int = 0,
    seconds: float | None = None,
    opened: Callable[[str], None] = lambda _: None,
) -> None:
    """Serve a session until the process is interrupted.

    Args:
        loop: the session; it is started, and stopped at the end.
        title: of the page.
        port: 0 for any free one.
        seconds: time after which to end [s]; None for none.
        opened: called with the address, which carries the token.

    Raises LiveError if the port is taken, or as `require`.
    """
    require()
    import uvicorn

    own = listening(port)
    server = Server(loop, title, own.getsockname()[1])
    limits: dict[str, Any] = {"ws_max_size": LARGEST, "ws_per_message_deflate": False, "ws": "websockets-sansio"}
    quiet: dict[str, Any] = {"log_level": "error", "access_log": False, "server_header": False, "lifespan": "off"}
    running = uvicorn.Server(uvicorn.Config(application(server), timeout_graceful_shutdown=1, **limits, **quiet))
    running.capture_signals = nullcontext  # type: ignore[method-assign,assignment]  # it would end the process at once
    ends = threading.Timer(seconds or 0.0, lambda: setattr(running, "should_exit", True))
    ends.daemon = True
    loop.start()
    try:
        if seconds is not None:
            ends.start()
        opened(f"http://{ADDRESS}:{own.getsockname()[1]}/?token={server.token}")
        with _interrupted(lambda: setattr(running, "should_exit", True)):
            running.run(sockets=[own])
    finally:
        ends.cancel()
        loop.stop()
        own.close()
