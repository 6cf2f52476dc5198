"""What is varied: `material.young=4 kPa,8 kPa`, `mesh.elements=[8,2],[16,4]`, `material.poisson=0:0.45:10`."""

import csv
import io
import itertools
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from truespring.errors import StudyError, TruespringError
from truespring.opening import read_file
from truespring.study import StudyText

#: How values are written, for messages.
FORMS = "values are written a,b,c or first:last:count, such as 4 kPa,8 kPa or [8,2],[16,4] or 0:0.45:10"

# More points than anyone waits for, and than one folder should hold files.
_MOST_POINTS = 1_000_000

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"\s*({_NUMBER})\s*([^\W\d_][^:]*)?\s*:\s*({_NUMBER})\s*([^\W\d_][^:]*?)?\s*(?::\s*(\d+)\s*)?")


@dataclass(frozen=True, slots=True)
class Range:
    """Numbers from `first` to `last` of one unit, which may be none: `count` of them, or any."""

    first: float
    last: float
    count: int | None
    unit: str
    whole: bool

    def values(self) -> list[Any]:
        """Return `count` evenly spaced values, from end to end; whole where both ends and all between them are."""
        found = np.linspace(self.first, self.last, self.count or 1)
        return self._written(found, self.whole and bool((found == found.round()).all()))

    def at(self, shares: Any, whole: bool) -> list[Any]:
        """Return the values at shares 0 to 1 of the way, each whole number of a whole range as often as any other."""
        if whole:
            low, high = sorted((self.first, self.last))
            return self._written(np.minimum(np.floor(low + (high - low + 1) * shares), high), True)
        return self._written(self.first + (self.last - self.first) * shares, False)

    def _written(self, values: Any, whole: bool) -> list[Any]:
        numbers = [int(value) if whole else float(f"{value:.12g}") for value in values.tolist()]
        return [f"{number!r} {self.unit}" for number in numbers] if self.unit else numbers


#: What a key takes: values one by one, or a range.
Values = Sequence[Any] | Range


def read_vary(text: str) -> tuple[str, Values]:
    """Read KEY=VALUES. Raises TruespringError with the text and how it is written."""
    key, equals, values = text.partition("=")
    if not equals:
        raise TruespringError(f"--vary {text!r}: KEY=VALUES is wanted; {FORMS}")
    return key.strip(), read_values(key.strip(), values)


def read_values(key: str, text: str) -> Values:
    """Read the values of a key. Raises TruespringError."""
    found = _RANGE.fullmatch(text)
    if found:
        return _range(key, text, *found.groups())
    parts = _split(text)
    if not all(part.strip() for part in parts):
        raise TruespringError(
            f"{key} = {text!r}: there is no value{' beside a comma' if len(parts) > 1 else ''}; {FORMS}"
        )
    return [read_value(part) for part in parts]


def _range(key: str, text: str, first: str, unit: str | None, last: str, other: str | None, count: str | None) -> Range:
    unit, other = (unit or "").strip(), (other or "").strip()
    if unit != other and unit:  # 2:8 kPa:4 is understood, 2 kPa:8 is not
        raise TruespringError(f"{key} = {text!r}: both ends of a range have one unit, here '{unit}' and '{other}'")
    if count is not None and int(count) < 2:
        raise TruespringError(f"{key} = {text!r}: a range has two values or more, here {count}; {FORMS}")
    whole = all(re.fullmatch(r"[-+]?\d+", end) for end in (first, last))
    return Range(float(first), float(last), None if count is None else int(count), other, whole)


def _split(text: str) -> list[str]:
    """Cut at the commas that stand in no bracket and no quotes."""
    parts, depth, quote = [""], 0, ""
    for letter in text:
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in "[{":
            depth += 1
        elif letter in "]}":
            depth -= 1
        if letter == "," and not depth and not quote:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def read_value(text: str) -> Any:
    """Read one value as a study writes it; quotes may be left out: 4 kPa, lloyd, [0 N, -0.01 N], 8, true."""
    text = text.strip()
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        if text.startswith("[") and text.endswith("]"):
            return [read_value(part) for part in _split(text[1:-1])]
        return text


def choose(text: StudyText, vary: Mapping[str, Any], lhs: int | None = None, seed: int = 0) -> list[dict[str, Any]]:
    """Return the changes of every point: the full grid, or `lhs` points of a Latin hypercube over the ranges.

    Values are sequences, Ranges, or texts as `read_values` reads them. Of a Latin hypercube each range is cut into as
    many layers as there are points, and every layer of it holds one; values one by one come equally often. Raises
    TruespringError.
    """
    read = {
        key: read_values(key, values) if isinstance(values, str) else _native(values) for key, values in vary.items()
    }
    if not read:
        raise TruespringError("nothing is varied: name a key and its values, as in --vary material.poisson=0:0.45:10")
    for key, other in itertools.permutations(read, 2):
        if other.startswith(f"{key}."):
            raise TruespringError(f"{key} and {other} are both varied, and the one holds the other: vary one of them")
    for key, values in read.items():
        if not isinstance(values, Range | list) or values == []:
            raise TruespringError(f"{key} = {values!r}: no values; a list of them is wanted, or a text: {FORMS}")
    columns = _grid(read) if lhs is None else _hypercube(text, read, lhs, seed)
    return [dict(zip(read, values, strict=True)) for values in columns]


def _native(values: Any) -> Any:
    """Numbers of numpy as Python has them, as in a study file."""
    if hasattr(values, "tolist"):
        return values.tolist()
    return [_native(value) for value in values] if isinstance(values, list | tuple) else values


def _grid(vary: Mapping[str, Values]) -> Iterator[tuple[Any, ...]]:
    several = []
    for key, values in vary.items():
        if isinstance(values, Range) and values.count is None:
            shown = f"{values.first:g}:{values.last:g}"
            raise TruespringError(f"{key} = {shown}: how many? {shown}:5 has five; without, it is for --lhs")
        several.append(values.values() if isinstance(values, Range) else list(values))
    _refuse_too_many(int(np.prod([len(one) for one in several], dtype=float)))
    return itertools.product(*several)


def _hypercube(text: StudyText, vary: Mapping[str, Values], count: int, seed: int) -> Iterator[tuple[Any, ...]]:
    from scipy.stats import qmc

    if count < 1:
        raise TruespringError(f"--lhs {count}: one point or more is wanted")
    _refuse_too_many(count)
    shares = qmc.LatinHypercube(len(vary), rng=seed).random(count).T
    columns = []
    for (key, values), share in zip(vary.items(), shares, strict=True):
        if isinstance(values, Range):
            columns.append(values.at(share, values.whole and _takes_whole_numbers_only(text, key, values)))
        else:
            columns.append([values[place] for place in (share * len(values)).astype(int).tolist()])
    return zip(*columns, strict=True)


def _takes_whole_numbers_only(text: StudyText, key: str, values: Range) -> bool:
    """Whether a study takes both ends of a range, and nothing between two whole numbers of it."""
    try:
        for end in (values.first, values.last):
            text.keys({key: int(end)})
    except StudyError:
        return False
    try:
        text.keys({key: (values.first + values.last) / 2 + 0.37})
    except StudyError:
        return True
    return False


def _refuse_too_many(count: int) -> None:
    if count > _MOST_POINTS:
        raise TruespringError(f"{count:,} points are more than {_MOST_POINTS:,}: take fewer values, or --lhs")


def read_points(file: str | Path) -> list[dict[str, Any]]:
    """Read the changes of every point from a CSV file: keys in its first row, then a row a point.

    Raises TruespringError with file, row and what is wrong.
    """
    place = Path(file)
    data = read_file(place, TruespringError)
    try:
        stream = io.StringIO(data.decode("utf-8-sig"), newline="")
        rows = [(number, row) for number, row in enumerate(csv.reader(stream), 1) if any(map(str.strip, row))]
    except (UnicodeDecodeError, csv.Error) as error:
        raise TruespringError(f"{place}: is no CSV file in UTF-8: {error}") from None
    if len(rows) < 2:
        raise TruespringError(f"{place}: there is no point: the first row names keys, each other row is a point")
    (_, head), *rows = rows
    keys = [key.strip() for key in head]
    if twice := {key for key in keys if keys.count(key) > 1}:
        raise TruespringError(f"{place}:1: {', '.join(sorted(twice))} stands there more than once")
    points = []
    for number, row in rows:
        if len(row) != len(keys):
            raise TruespringError(f"{place}:{number}: {len(row)} values, and {len(keys)} keys in the first row")
        if empty := [key for key, value in zip(keys, row, strict=True) if not value.strip()]:
            raise TruespringError(f"{place}:{number}: {empty[0]} has no value")
        points.append({key: read_value(value) for key, value in zip(keys, row, strict=True)})
    return points
