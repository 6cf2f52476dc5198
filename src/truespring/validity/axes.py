"""Axes of a map: the load, the mesh, the material, the rule, the load type; their ranges and the grid upon them."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.errors import StudyError, nearest
from truespring.validity.bodies import Body

#: The axes that have numbers, and how they are called at a figure; and those that have names.
NUMBERS = {
    "load": "load",
    "depth": "elements through the depth",
    "aspect": "length over height of the elements",
    "poisson": "Poisson's ratio",
}
NAMES = {"rule": "rule", "load-type": "load type"}

# Values of the finest grid on an axis of real numbers, and intervals between the sizes of the load.
_FINEST, _SIZES = 17, 120


@dataclass(frozen=True, slots=True)
class Range:
    """The range of an axis, as of `--range`: from `first` to `last`, with `count` values on the finest grid."""

    first: float
    last: float
    count: int | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Axis:
    """An axis of numbers: the finest grid upon it, and with which of it a map begins.

    Attributes:
        name: load, depth, aspect or poisson.
        values: the grid, ascending, shape (n,).
        start: numbers of those of the grid that are solved first.
        note: what had to be left out, empty where nothing was.
    """

    name: str
    values: Floats
    start: tuple[int, ...]
    note: str = ""

    @property
    def label(self) -> str:
        """What stands at the axis."""
        return NUMBERS[self.name]


def read_range(text: str) -> tuple[str, Range]:
    """Read "depth=1:8" or "poisson=0:0.45:8"; raise StudyError where it is no range."""
    name, _, values = text.partition("=")
    known(name, {**NUMBERS})
    parts = values.split(":")
    try:
        first, last = (float(part) for part in (parts if len(parts) == 2 else parts[:-1]))
        count = int(parts[2]) if len(parts) == 3 else None
    except ValueError:
        raise StudyError(f"--range {text}: {name}=first:last or {name}=first:last:count is wanted") from None
    return name, checked(name, Range(first, last, count))


def range_of(name: str, given: Range | Sequence[float]) -> Range:
    """Return (first, last) or (first, last, number of values) as a range; raise StudyError where it is none."""
    if isinstance(given, Range):
        return checked(name, given)
    if len(given) not in (2, 3):
        raise StudyError(f"range of {name} = {list(given)}: give first, last and, optionally, the number of values")
    return checked(name, Range(float(given[0]), float(given[1]), int(given[2]) if len(given) == 3 else None))


def checked(name: str, given: Range) -> Range:
    """Return a range; raise StudyError where it is not for its axis."""
    place = f"range of {name} = {given.first:g}:{given.last:g}"
    if not (math.isfinite(given.first) and math.isfinite(given.last) and given.first < given.last):
        raise StudyError(f"{place}: the first must be below the last")
    if given.count is not None and given.count < 2:
        raise StudyError(f"{place}:{given.count}: give at least 2 values, from the first to the last")
    if name == "depth" and not (given.first >= 1 and given.first.is_integer() and given.last.is_integer()):
        raise StudyError(f"{place}: whole numbers from 1 on are wanted, elements through the depth")
    if name == "aspect" and given.first <= 0:
        raise StudyError(f"{place}: length over height of an element is above 0")
    if name == "load" and given.first != 0:
        raise StudyError(f"{place}: a load begins at 0, load=0:{given.last:g}")
    if name == "poisson" and not (given.first > -1 and given.last < 0.5):
        raise StudyError(f"{place}: Poisson's ratio lies between -1 and 0.5, both excluded")
    return given


def known(name: str, allowed: Mapping[str, object]) -> str:
    """Return the name of an axis; raise StudyError where there is none of it."""
    if name not in allowed:
        raise StudyError(f"axis '{name}' is unknown{nearest(name, allowed)}; allowed: {', '.join(allowed)}")
    return name


def axis_of(name: str, body: Body, ranges: Mapping[str, Range]) -> Axis:
    """Return an axis of numbers other than the load; raise StudyError where the body has none such."""
    if body.shape is None and name in ("depth", "aspect"):
        raise StudyError(f"axis {name}: a mesh from a file is taken as it is; axes for it are load, poisson, rule")
    given = ranges.get(name)
    if name == "depth":
        return _depths(body, given)
    if name == "aspect":
        return _even(name, given or Range(0.5 * body.aspect, 2 * body.aspect))
    return _even(name, given or Range(0.0, 0.45))


def sizes_to(last: float) -> Floats:
    """Return the sizes of a load for which errors are told, from 0 on."""
    return np.linspace(0.0, last, _SIZES + 1)


def _even(name: str, given: Range) -> Axis:
    count = given.count or _FINEST
    values = np.linspace(given.first, given.last, count)
    step = max(1, (count - 1) // 4)
    return Axis(name, values, tuple(dict.fromkeys([*range(0, count - 1, step), count - 1])))


def _depths(body: Body, given: Range | None) -> Axis:
    """Whole numbers for which the elements keep the aspect of the study's; each about twice the last at first."""
    given = given or Range(1, max(8, 2 * body.depth) if body.dim == 2 else max(4, body.depth))
    asked = range(int(given.first), int(given.last) + 1)
    whole = [depth for depth in asked if body.counts(depth, body.aspect)[1]]
    note = ""
    if 2 <= len(whole) < len(asked):
        left = ", ".join(str(depth) for depth in asked if depth not in whole)
        note = f"left out: {left} elements through the depth, for which those along the body are no whole number"
    elif len(whole) < len(asked):
        whole = list(asked)
        note = "elements along the body are rounded to whole numbers: their aspect differs a little from depth to depth"
    values = np.array(whole, dtype=float)
    start = [0]
    for place, depth in enumerate(whole):
        if depth >= 2 * whole[start[-1]]:
            start.append(place)
    return Axis("depth", values, tuple(dict.fromkeys([*start, len(whole) - 1])), note)


def check_axes(names: Sequence[str | None]) -> list[str]:
    """Return the axes chosen, checked; raise StudyError where they do not go together."""
    found = [known(name, {**NUMBERS, **NAMES}) for name in names if name is not None]
    if len(set(found)) < len(found):
        raise StudyError(f"both axes are {found[0]}: give two different ones, or one")
    if found[0] in NAMES:
        raise StudyError(f"x = {found[0]}: names go along y; along x are {', '.join(NUMBERS)}")
    return found
