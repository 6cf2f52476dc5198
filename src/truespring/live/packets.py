"""The packets of a haptic device: requests and replies of 64 bytes, little-endian; docs/live.md has a table of them."""

import hmac
import math
import struct
from typing import NamedTuple

from truespring.errors import LiveError

#: A packet: magic, version, flags, 0, sequence, number, token, clock [s], vector [m or N], clock [s].
FRAME = struct.Struct("<4sBBHIIQd3dd")
MAGIC, VERSION = b"TSHP", 1
#: Flags of a request, and of the reply where it is so: hold the patch at the place; touch with a sphere there.
HOLD, TOUCH = 1, 2
# Sequence numbers have 32 bits: the next of the largest is 0.
_SEQUENCES = 2**32


class Request(NamedTuple):
    """A packet of a device.

    Attributes:
        flags: HOLD, TOUCH, both or 0.
        sequence: number of the packet, larger by 1 than the last one.
        clock: time of the device [s]; it comes back with the reply.
        place: of the device [m], three values; a plane body does not use the third.
    """

    flags: int
    sequence: int
    clock: float
    place: tuple[float, float, float]


class Reply(NamedTuple):
    """What a device receives.

    Attributes:
        flags: HOLD while the body is held, TOUCH while a sphere is there.
        sequence: that of the request.
        frames: number of frames that the request advanced the body by.
        total: number of frames of the session.
        time: simulated time [s].
        force: of the body on the device [N], three values.
        clock: that of the request [s].
    """

    flags: int
    sequence: int
    frames: int
    total: int
    time: float
    force: tuple[float, float, float]
    clock: float


def packed_request(token: int, request: Request) -> bytes:
    """Return the frame of a request."""
    flags, sequence, clock, place = request
    return FRAME.pack(MAGIC, VERSION, flags, 0, sequence % _SEQUENCES, 0, token, clock, *place, 0.0)


def read_request(packet: bytes, token: int) -> Request | str:
    """Return the request of a packet, or why it is not accepted: "size", "magic", "version", "token", "numbers"."""
    if len(packet) != FRAME.size:
        return "size"
    magic, version, flags, _, sequence, _, theirs, clock, *rest = FRAME.unpack(packet)
    if magic != MAGIC:
        return "magic"
    if version != VERSION:
        return "version"
    if not hmac.compare_digest(theirs.to_bytes(8, "little"), token.to_bytes(8, "little")):
        return "token"
    if not all(map(math.isfinite, (clock, *rest))) or flags & ~(HOLD | TOUCH):
        return "numbers"
    return Request(flags, sequence, clock, (rest[0], rest[1], rest[2]))


def packed_reply(reply: Reply) -> bytes:
    """Return the frame of a reply; its place of the token has the number of frames of the session."""
    flags, sequence, frames, total, seconds, force, clock = reply
    return FRAME.pack(MAGIC, VERSION, flags, 0, sequence, frames, total, seconds, *force, clock)


def read_reply(packet: bytes) -> Reply:
    """Return the reply of a packet; raise LiveError if it is none."""
    if len(packet) != FRAME.size or packet[:5] != MAGIC + bytes([VERSION]):
        raise LiveError(f"a packet of {len(packet)} bytes is no reply of a haptic session: version {VERSION} has 64")
    _, _, flags, _, sequence, frames, total, seconds, *rest = FRAME.unpack(packet)
    return Reply(flags, sequence, frames, total, seconds, (rest[0], rest[1], rest[2]), rest[3])


def ahead(one: int, other: int) -> int:
    """Return by how many packets a sequence number is after another, also past the largest; 0 if it is not after it."""
    away = (one - other) % _SEQUENCES
    return away if away < _SEQUENCES // 2 else 0


def before(sequence: int) -> int:
    """Return the sequence number before another."""
    return (sequence - 1) % _SEQUENCES
