"""Axes of a map: load, mesh, material, rule or load type; with their ranges and grids."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.errors import StudyError, nearest
from truespring.validity.bodies import Body

#: Axes of numbers with their labels, and axes of names.
NUMBERS = {
    "load": "load",
    "depth": "elements through the depth",
    "aspect": "length over height of the elements",
    "poisson": "Poisson's ratio",
}
NAMES = {"rule": "rule", "load-type": "load type"}

# Number of values of the finest grid on an axis of real numbers, and of intervals of the load.
_FINEST, _SIZES = 17, 120


@dataclass(frozen=True, slots=True)
class Range:
    """The range of an axis, as of `--range`: from `first` to `last`, with `count` values on the finest grid."""

    first: float
    last: float
    count: int | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Axis:
    """An axis of numbers with its finest grid.

    Attributes:
        name: load, depth, aspect or poisson.
        values: the grid, ascending, shape (n,).
        start: indices of the values that are solved first.
        note: a remark on values that were left out, else empty.
    """

    name: str
    values: Floats
    start: tuple[int, ...]
    note: str = ""

    @property
    def label(self) -> str:
        """Label of the axis."""
        return NUMBERS[self.name]


def read_range(text: str) -> tuple[str, Range]:
    """Return name and range of "depth=1:8" or "poisson=0:0.45:8"; raise StudyError for other texts."""
    name, _, values = text.partition("=")
    known(name, {**NUMBERS})
    parts = values.split(":")
    try:
        first, last = (float(part) for part in (parts if len(parts) == 2 else parts[:-1]))
        count = int(parts[2]) if len(parts) == 3 else None
    except ValueError:
        raise StudyError(f"--range {text}: write {name}=first:last or {name}=first:last:count") from None
    return name, checked(name, Range(first, last, count))


def range_of(name: str, bounds: Range | Sequence[float]) -> Range:
    """Return (first, last) or (first, last, number of values) as a Range; raise StudyError for an invalid one."""
    if isinstance(bounds, Range):
        return checked(name, bounds)
    if len(bounds) not in (2, 3):
        raise StudyError(f"range of {name} = {list(bounds)}: give first, last and, optionally, the number of values")
    return checked(name, Range(float(bounds[0]), float(bounds[1]), int(bounds[2]) if len(bounds) == 3 else None))


def checked(name: str, bounds: Range) -> Range:
    """Return a range; raise StudyError if it is invalid for its axis."""
    place = f"range of {name} = {bounds.first:g}:{bounds.last:g}"
    if not (math.isfinite(bounds.first) and math.isfinite(bounds.last) and bounds.first < bounds.last):
        raise StudyError(f"{place}: the first must be below the last")
    if bounds.count is not None and bounds.count < 2:
        raise StudyError(f"{place}:{bounds.count}: give at least 2 values, from the first to the last")
    if name == "depth" and not (bounds.first >= 1 and bounds.first.is_integer() and bounds.last.is_integer()):
        raise StudyError(f"{place}: numbers of elements through the depth must be integers, at least 1")
    if name == "aspect" and bounds.first <= 0:
        raise StudyError(f"{place}: length over height of an element must be above 0")
    if name == "load" and bounds.first != 0:
        raise StudyError(f"{place}: the load must start at 0, load=0:{bounds.last:g}")
    if name == "poisson" and not (bounds.first > -1 and bounds.last < 0.5):
        raise StudyError(f"{place}: Poisson's ratio must be above -1 and below 0.5")
    return bounds


def known(name: str, allowed: Mapping[str, object]) -> str:
    """Return the name of an axis; raise StudyError if it is not allowed."""
    if name not in allowed:
        raise StudyError(f"axis '{name}' is unknown{nearest(name, allowed)}; allowed: {', '.join(allowed)}")
    return name


def axis_of(name: str, body: Body, ranges: Mapping[str, Range]) -> Axis:
    """Return an axis of numbers other than the load; raise StudyError if the body does not have it."""
    if body.shape is None and name in ("depth", "aspect"):
        raise StudyError(f"axis {name}: a mesh from a file is not changed; allowed axes: load, poisson, rule")
    bounds = ranges.get(name)
    if name == "depth":
        return _depths(body, bounds)
    if name == "aspect":
        return _even(name, bounds or Range(0.5 * body.aspect, 2 * body.aspect))
    return _even(name, bounds or Range(0.0, 0.45))


def sizes_to(last: float) -> Floats:
    """Return the sizes of a load, shape (n,), at which errors are evaluated: from 0 to `last`, in its unit."""
    return np.linspace(0.0, last, _SIZES + 1)


def _even(name: str, bounds: Range) -> Axis:
    count = bounds.count or _FINEST
    values = np.linspace(bounds.first, bounds.last, count)
    step = max(1, (count - 1) // 4)
    return Axis(name, values, tuple(dict.fromkeys([*range(0, count - 1, step), count - 1])))


def _depths(body: Body, bounds: Range | None) -> Axis:
    """Return the axis of depths for which elements keep the aspect of the study; the start doubles each time."""
    bounds = bounds or Range(1, max(8, 2 * body.depth) if body.dim == 2 else max(4, body.depth))
    depths = range(int(bounds.first), int(bounds.last) + 1)
    whole = [depth for depth in depths if body.counts(depth, body.aspect)[1]]
    note = ""
    if 2 <= len(whole) < len(depths):
        left = ", ".join(str(depth) for depth in depths if depth not in whole)
        note = f"left out: {left} elements through the depth, whose number along the body is not an integer"
    elif len(whole) < len(depths):
        whole = list(depths)
        note = "numbers of elements along the body are rounded, so that their aspect varies slightly with the depth"
    values = np.array(whole, dtype=float)
    start = [0]
    for place, depth in enumerate(whole):
        if depth >= 2 * whole[start[-1]]:
            start.append(place)
    return Axis("depth", values, tuple(dict.fromkeys([*start, len(whole) - 1])), note)


def check_axes(names: Sequence[str | None]) -> list[str]:
    """Return the names of the axes; raise StudyError for an invalid combination."""
    found = [known(name, {**NUMBERS, **NAMES}) for name in names if name is not None]
    if len(set(found)) < len(found):
        raise StudyError(f"both axes are {found[0]}: give different ones, or only one")
    if found[0] in NAMES:
        raise StudyError(f"x = {found[0]} is allowed for y only; allowed for x: {', '.join(NUMBERS)}")
    return found
