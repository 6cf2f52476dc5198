"""What the loop makes known of a session after a frame. Nothing in it changes afterwards."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from truespring.arrays import Floats
from truespring.live.drawn import Drawn

#: What acts on the body at a place, by number.
MARKS = ("grasp", "pin", "sphere")


@dataclass(frozen=True, eq=False, slots=True)
class Mark:
    """A grasp, pin or sphere.

    Attributes:
        what: one of MARKS.
        name: its name.
        radius: of the patch or sphere [m].
        held: place that it was moved to [m], shape (dim,).
        at: place of the held patch of the body, or the centre of the sphere [m], shape (dim,).
    """

    what: str
    name: str
    radius: float
    held: Floats
    at: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Overlay:
    """A reference, compared with the session at one time.

    Attributes:
        number: counts them.
        kind: "rest" or "moving".
        time: at which both were compared [s].
        positions: of the reference at the nodes of the mesh [m], shape (n_nodes, dim).
        distances: of the nodes from those of the session at that time [m], shape (n_nodes,).
    """

    number: int
    kind: str
    time: float
    positions: Floats
    distances: Floats


@dataclass(frozen=True, eq=False, slots=True)
class Snapshot:
    """A session after a frame.

    Attributes:
        number: counts snapshots.
        frames: number of frames since the begin of the session.
        time: [s].
        running: whether it advances.
        drawn: what is drawn of the body.
        positions: of the nodes of the mesh [m], shape (n_nodes, dim).
        marks: what acts on the body.
        overlay: the last reference; None without one.
        readout: figures, notes and warnings as JSON values; the same object until they change.
        echo: time that a page gave to the last order before this frame; nan without one.
    """

    number: int
    frames: int
    time: float
    running: bool
    drawn: Drawn
    positions: Floats
    marks: tuple[Mark, ...]
    overlay: Overlay | None
    readout: Mapping[str, Any]
    echo: float
