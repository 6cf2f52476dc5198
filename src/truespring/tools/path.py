"""Paths of tools and grasps: places along the way at rest or over time, linear between rows."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ToolError
from truespring.loading import vector_words

#: Rows of the place on the way and the coordinates [m]: the place is a share of the way at rest, 0 to 1, or a time [s]
#: in motion. Or the coordinates alone [m], of a tool that does not move.
Path = Sequence[Sequence[float]] | Sequence[float]

# Share of the span by which a path may begin late or end early: rounding errors of units.
_ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Track:
    """A path over levels.

    Attributes:
        ways: ascending, as shares of the way [-] at rest, as times [s] in motion, shape (n,).
        places: [m], shape (n, dim).
        span: place on the way at level 1: 1 at rest, the duration in motion [s].
    """

    ways: Floats
    places: Floats
    span: float

    def at(self, level: float) -> Floats:
        """Return the place at a level [m], shape (dim,)."""
        way = level * self.span
        return np.array([np.interp(way, self.ways, along) for along in self.places.T])

    def velocity(self, level: float) -> Floats:
        """Return the change of place along the way [m], per time [m/s] in motion, shape (dim,).

        At a corner it is that after it, at the end that before.
        """
        if len(self.ways) == 1:
            return np.zeros(self.places.shape[1])
        part = int(np.searchsorted(self.ways, level * self.span, side="right")) - 1
        part = min(max(part, 0), len(self.ways) - 2)
        return np.asarray((self.places[part + 1] - self.places[part]) / (self.ways[part + 1] - self.ways[part]))

    @property
    def corners(self) -> tuple[float, ...]:
        """The levels between 0 and 1 at which the velocity may change [-]."""
        return tuple(float(way) / self.span for way in self.ways if 0 < way < self.span)


def track_of(name: str, path: Path, dim: int, span: float, during: tuple[float, float] | None = None) -> Track:
    """Return the track of a path.

    Args:
        name: what moves along the path, for messages: "tool 'probe'".
        path: the path.
        dim: number of directions of the body.
        span: place on the way at level 1: 1 at rest, the duration in motion [s].
        during: the part of the way that it must cover; None for the whole.

    Raises ToolError unless rows are numbers, ascend, and reach from 0 to `span`, or from begin to end of `during`.
    """
    rows = _rows(name, path)
    if rows.ndim == 1:
        _check_width(name, rows, dim, "the place of a tool that does not move has")
        return Track(np.zeros(1), rows[None], span)
    _check_width(name, rows[0], 1 + dim, "each row has the place on the way and")
    ways = rows[:, 0]
    if np.any(np.diff(ways) <= 0):
        raise ToolError(name, f"the first column, the place on the way, must ascend, not {ways.tolist()}", "path")
    (begin, end), part = during or (0.0, span), "way" if during is None else "interval in which it acts"
    missing = [("begins", ways[0], begin)] if ways[0] > begin + _ROUNDING * span else []
    missing += [("ends", ways[-1], end)] if ways[-1] < end - _ROUNDING * span else []
    for says, way, needed in missing:
        raise ToolError(
            name,
            f"the path {says} at {way:g}, the {part} {says} at {needed:g} (a share at rest, seconds in motion): "
            f"add a row [{needed:g}, ...]",
            "path",
        )
    return Track(ways, rows[:, 1:], span)


def varies(path: Path) -> bool:
    """Return whether the place changes along a path."""
    rows = np.asarray(path, dtype=float)
    return rows.ndim == 2 and bool((rows[:, 1:] != rows[0, 1:]).any())


def path_words(path: Path) -> str:
    """Return the begin and the end of a path for tables: "from (0.03, 0.041) m to (0.03, 0.037) m"."""
    rows = np.asarray(path, dtype=float)
    if rows.ndim == 1:
        return f"at {vector_words(rows)} m"
    return f"from {vector_words(rows[0, 1:])} m to {vector_words(rows[-1, 1:])} m"


def _rows(name: str, path: Any) -> Floats:
    """Return a path as an array of one or two axes; raise ToolError if it is none of finite numbers."""
    try:
        rows = np.array(path, dtype=float)
    except (TypeError, ValueError):
        rows = np.zeros(0)
    if rows.ndim not in (1, 2) or not rows.size or not np.isfinite(rows).all():
        raise ToolError(
            name,
            "give rows of equal length, each a place on the way and coordinates [m], such as [[0, 0.1, 0.2], "
            f"[1, 0.1, 0.15]], not {path!r}",
            "path",
        )
    return rows


def _check_width(name: str, row: Floats, width: int, says: str) -> None:
    """Raise ToolError unless a row has `width` values."""
    if len(row) != width:
        dim = width - says.startswith("each")
        raise ToolError(name, f"{says} {dim} coordinates [m]: {width} values, not {len(row)}: {row.tolist()}", "path")
