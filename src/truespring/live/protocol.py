"""Frames from the server to a page, and messages from a page to the server; docs/live.md describes both."""

import json
import math
import struct
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from truespring.arrays import Floats
from truespring.errors import LiveError
from truespring.live.snapshot import MARKS, Overlay, Snapshot

#: Header of a binary frame, little-endian, 32 bytes: kind, flags, number of marks, number of the body's description,
#: number of the frame, number of nodes, time [s], echo of the page's clock (nan without one).
HEADER = struct.Struct("<BBHIIIdd")
#: Kinds of binary frames.
FRAME, GHOST = 1, 2
#: Flags of a frame and of a ghost.
RUNNING, MOVING = 1, 1
#: Numbers of a mark: which of MARKS, radius, place that it was moved to, place on the body.
MARK = 8
#: Largest message of a page [bytes].
LARGEST = 4096
#: Largest coordinate of a place, in units of the page: edges of the undeformed body's box about its middle.
REACH = 10.0

_Coordinate = Annotated[float, Field(ge=-REACH, le=REACH)]
_Place = tuple[_Coordinate, _Coordinate, _Coordinate]
_Hand = Annotated[int, Field(ge=0, le=9)]
_Node = Annotated[int, Field(ge=0, lt=2**32)]
_Name = Annotated[str, Field(min_length=1, max_length=100)]


class Message(BaseModel):
    """A message of a page; `clock` comes back with the first frame after it."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, frozen=True)

    clock: float | None = None


class Pull(Message):
    """Hold the patch around a drawn node; `hand` is the page's number for it."""

    kind: Literal["pull"]
    hand: _Hand
    node: _Node


class Push(Message):
    """Add a sphere at a place."""

    kind: Literal["push"]
    hand: _Hand
    place: _Place
    radius: Annotated[float, Field(gt=0, le=1)] | None = None


class Move(Message):
    """Move what a hand holds."""

    kind: Literal["move"]
    hand: _Hand
    place: _Place


class LetGo(Message):
    """Release what a hand holds."""

    kind: Literal["let-go"]
    hand: _Hand


class Pin(Message):
    """Hold the patch around a drawn node where it is."""

    kind: Literal["pin"]
    node: _Node


class Cut(Message):
    """Cut along a line, in space with a blade that reaches from it by a vector of depth."""

    kind: Literal["cut"]
    start: _Place
    end: _Place
    depth: _Place


class Release(Message):
    """Release a grasp, pin or sphere by its name in the readout."""

    kind: Literal["release"]
    name: _Name


class Plain(Message):
    """Something without further values."""

    kind: Literal["restart", "pause", "play", "step", "release-all", "save"]


class Value(Message):
    """Set a value; its range is checked by the session."""

    kind: Literal["gravity", "young", "poisson", "damping", "speed"]
    value: float


class ChooseModel(Message):
    """Change to another model of the study."""

    kind: Literal["model"]
    name: _Name


class Seen(Message):
    """A frame has arrived; without this the server sends no more than three."""

    kind: Literal["seen"]
    number: _Node


_Any = Annotated[
    Pull | Push | Move | LetGo | Pin | Cut | Release | Plain | Value | ChooseModel | Seen, Field(discriminator="kind")
]
_MESSAGES: TypeAdapter[Message] = TypeAdapter(_Any)


def parsed(text: str | bytes) -> Message:
    """Return a message of a page; raise LiveError unless it is known, finite, in range and at most LARGEST bytes."""
    size = len(text.encode("utf-8", "surrogatepass")) if isinstance(text, str) else len(text)
    if size > LARGEST:
        raise LiveError(f"a message of {size} bytes: at most {LARGEST} are allowed")
    try:
        return _MESSAGES.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(one) for one in first["loc"])
        raise LiveError(f"message: {place}{': ' * bool(place)}{first['msg']}") from None


def frame(snapshot: Snapshot) -> bytes:
    """Return a frame: HEADER, places of the drawn nodes (nodes, 3) and marks (marks, MARK), single precision."""
    body, marks = snapshot.drawn, snapshot.marks
    places = body.on_page(snapshot.positions[body.nodes])
    number = snapshot.number % 2**32
    flags = RUNNING * snapshot.running
    head = HEADER.pack(FRAME, flags, len(marks), body.number, number, len(places), snapshot.time, snapshot.echo)
    rows = np.zeros((len(marks), MARK), dtype="<f4")
    for row, mark in zip(rows, marks, strict=True):
        row[:2] = MARKS.index(mark.what), mark.radius / body.longest
        row[2:] = body.on_page(np.stack([mark.held, mark.at])).ravel()
    return head + places.tobytes() + rows.tobytes()


def ghost(snapshot: Snapshot, overlay: Overlay) -> bytes:
    """Return a reference: HEADER, places of the drawn nodes (nodes, 3) and their distances (nodes,), single precision.

    Its time is that at which both were compared; distances are in units of the page.
    """
    body = snapshot.drawn
    places = body.on_page(overlay.positions[body.nodes])
    flags, number = MOVING * (overlay.kind == "moving"), overlay.number % 2**32
    head = HEADER.pack(GHOST, flags, 0, body.number, number, len(places), overlay.time, math.nan)
    apart: Floats = overlay.distances[body.nodes] / body.longest
    return head + places.tobytes() + apart.astype("<f4").tobytes()


def text(values: Any) -> str:
    """Return JSON values as a message; what is not finite becomes null."""
    return json.dumps(_finite(values), allow_nan=False)


def _finite(values: Any) -> Any:
    """Return JSON values with null for numbers that are not finite."""
    if isinstance(values, float):
        return values if math.isfinite(values) else None
    if isinstance(values, dict):
        return {key: _finite(one) for key, one in values.items()}
    return [_finite(one) for one in values] if isinstance(values, list | tuple) else values
