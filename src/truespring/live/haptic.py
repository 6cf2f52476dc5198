"""A haptic device at a live session: places in, forces out, over a local UDP port at 1 kHz.

The body advances by a frame of the session for each packet: the reply has the force at the place of that packet, and
the log of the session repeats it bit for bit.
"""

import math
import secrets
import socket
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Self

from truespring.errors import LiveError
from truespring.live.packets import FRAME, HOLD, TOUCH, Reply, Request, ahead, before, packed_reply, read_request
from truespring.live.session import Live

#: Time between frames of a session with a device [s].
PERIOD = 1e-3
#: Without a packet for this time [s] what the device holds stays where it is, and the body moves on by the clock.
SILENT = 0.1
#: Without a packet for this time [s] it is released, and another device may come.
GONE = 1.0
# Packets that are read before the body moves on.
_AT_ONCE = 64
# Frames that one packet advances at most: packets that were lost, or that came while the body was computed.
_MOST = 4
#: Names of what a device holds and touches with.
GRASP, SPHERE = "haptic", "haptic sphere"


@dataclass
class _Device:
    """The device that a session follows.

    Attributes:
        address: where its packets come from.
        sequence: of its last packet.
        seen: when that came, by the clock [s].
        offset: from its place to that of the grasp [m].
        flags: of its last packet.
    """

    address: tuple[str, int]
    sequence: int
    seen: float
    offset: tuple[float, ...] = ()
    flags: int = 0


class Haptic:
    """A UDP port of 127.0.0.1 at which one device at a time moves a grasp or a sphere of a session.

    Call `turn` again and again, in the thread that owns the session.

    Attributes:
        live: the session.
        port: the port.
        token: what each request must have, a number of 64 bits.
        counts: number of requests by what became of them: "followed", "late" (replaced by a later one that waited), and
            those left out: "size", "magic", "version", "token", "numbers", "old", "other device".
    """

    def __init__(
        self,
        live: Live,
        port: int = 0,
        *,
        token: int | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        """Open the port.

        Args:
            live: the session, with frames of PERIOD for a device of 1 kHz.
            port: number of the port; 0 for a free one.
            token: what requests must have; None for a random one.
            clock: the time [s].

        Raises LiveError if the port is not free.
        """
        self.live, self.counts = live, Counter[str]()
        self.token = secrets.randbits(64) if token is None else token
        self._clock, self._device, self._advanced = clock, _NOBODY, clock()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(("127.0.0.1", port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            raise LiveError(f"haptic port {port}: {error}: take another, or 0 for a free one") from None
        self.port: int = self._socket.getsockname()[1]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the port."""
        self._socket.close()

    @property
    def is_followed(self) -> bool:
        """Whether a device moves the body now."""
        return self._device is not _NOBODY and not self._is_silent

    def turn(self) -> int:
        """Wait for a packet, follow it and answer; return the number of frames that the body advanced by.

        Without a device, or while it is silent, the body advances by the clock.
        """
        found = self._newest()
        if found is None:
            return self._without()
        request, address = found
        frames = self._newer(request)
        if not frames:
            return 0
        frames = min(frames, _MOST)
        held = self._move(request)
        self._device.sequence, self._device.seen, self._device.flags = request.sequence, self._clock(), request.flags
        self.live.step(frames)
        self._advanced = self._clock()
        self.counts["followed"] += 1
        flags, force = self._felt(held)
        reply = Reply(flags, request.sequence, frames, self.live.log.frames, self.live.time, force, request.clock)
        try:
            self._socket.sendto(packed_reply(reply), address)
        except OSError:  # the device has gone: its silence is noticed
            self.counts["unanswered"] += 1
        return frames

    # --- packets ------------------------------------------------------------------------------------------------

    def _newest(self) -> tuple[Request, tuple[str, int]] | None:
        """Return the newest packet that is accepted, after waiting for one; None if none came."""
        found = None
        for _ in range(_AT_ONCE):  # a flood of packets does not stop the body
            self._socket.settimeout(0.0 if found else self._patience)
            try:
                packet, address = self._socket.recvfrom(2 * FRAME.size)
            except (TimeoutError, BlockingIOError, ConnectionError):
                return found
            request = self._accepted(packet, address)
            if request is not None and found is not None:
                self.counts["late"] += 1
                request = request if ahead(request.sequence, found[0].sequence) else found[0]
            found = found if request is None else (request, address)
        return found

    @property
    def _patience(self) -> float:
        """How long to wait for a packet [s]."""
        return max(SILENT - (self._clock() - self._device.seen), 1e-6) if self.is_followed else PERIOD

    def _accepted(self, packet: bytes, address: tuple[str, int]) -> Request | None:
        """Return the request of a packet; None if it is left out, which is counted."""
        request = read_request(packet, self.token)
        if isinstance(request, str):
            self.counts[request] += 1
            return None
        if self._device is _NOBODY:
            self._device = _Device(address, before(request.sequence), self._clock())
        if address != self._device.address:
            self.counts["other device"] += 1
            return None
        return request

    def _newer(self, request: Request) -> int:
        """Return by how many packets a request is newer than the last one, 0 for an old one."""
        frames = ahead(request.sequence, self._device.sequence)
        if not frames:
            self.counts["old"] += 1
        return frames

    # --- the body -----------------------------------------------------------------------------------------------

    def _move(self, request: Request) -> str | None:
        """Ask the session for what a request says; return the name of the grasp or sphere that the device feels."""
        live, place = self.live, request.place[: self.live.dim]
        hold, held = bool(request.flags & HOLD), GRASP in live.grasps
        if hold and not self._device.flags & HOLD and not held:
            live.pull(place, name=GRASP)
            self._device.offset = tuple(live.grasps[GRASP].place - place)
        elif hold and held:
            live.pull(place, [one + off for one, off in zip(place, self._device.offset, strict=True)], name=GRASP)
        elif held:
            live.release(GRASP)
        touch = bool(request.flags & TOUCH) and not hold
        if touch:
            live.push(place, name=SPHERE)
        elif SPHERE in live.spheres:
            live.release(SPHERE)
        return GRASP if hold else SPHERE if touch else None

    def _felt(self, name: str | None) -> tuple[int, tuple[float, float, float]]:
        """Return flags and force of a grasp or sphere [N], 0 without one."""
        force = None if name is None else self.live.forces.get(name)
        if force is None or not all(map(math.isfinite, force)):
            return 0, (0.0, 0.0, 0.0)
        x, y, z = (*force.tolist(), 0.0)[:3]
        return HOLD if name == GRASP else TOUCH, (x, y, z)

    @property
    def _is_silent(self) -> bool:
        return self._clock() - self._device.seen >= SILENT

    def _without(self) -> int:
        """Advance by the clock, without a packet; release what a device holds that has gone."""
        now = self._clock()
        if self._device is not _NOBODY and now - self._device.seen >= GONE:
            for name in (GRASP, SPHERE):
                if name in self.live.grasps or name in self.live.spheres:
                    self.live.release(name)
            self._device = _NOBODY
        if self.is_followed:
            return 0
        due = int((now - self._advanced) / self.live.settings.frame)
        if not due:
            return 0
        self._advanced = now if due > _MOST else self._advanced + due * self.live.settings.frame
        self.live.step(min(due, _MOST))
        return min(due, _MOST)


_NOBODY = _Device(("", 0), 0, -math.inf)
