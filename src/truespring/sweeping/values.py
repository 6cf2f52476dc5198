"""Values of varied keys: `material.young=4 kPa,8 kPa`, `mesh.elements=[8,2],[16,4]`, `material.poisson=0:0.45:10`."""

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

#: The syntax of values, for messages.
FORMS = "write a,b,c or first:last:count, such as 4 kPa,8 kPa or [8,2],[16,4] or 0:0.45:10"

# Largest number of points; each is a file.
_MOST_POINTS = 1_000_000

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"\s*({_NUMBER})\s*([^\W\d_][^:]*)?\s*:\s*({_NUMBER})\s*([^\W\d_][^:]*?)?\s*(?::\s*(\d+)\s*)?")


@dataclass(frozen=True, slots=True)
class Range:
    """Numbers from `first` to `last` in one unit, which may be empty: `count` of them, or a continuous range."""

    first: float
    last: float
    count: int | None
    unit: str
    whole: bool

    def values(self) -> list[Any]:
        """Return `count` evenly spaced values; integers if the range is whole and all values are."""
        found = np.linspace(self.first, self.last, self.count or 1)
        return self._written(found, self.whole and bool((found == found.round()).all()))

    def at(self, shares: Any, whole: bool) -> list[Any]:
        """Return the values at shares 0 to 1 of the range; integers of a whole range are equally frequent."""
        if whole:
            low, high = sorted((self.first, self.last))
            return self._written(np.minimum(np.floor(low + (high - low + 1) * shares), high), True)
        return self._written(self.first + (self.last - self.first) * shares, False)

    def _written(self, values: Any, whole: bool) -> list[Any]:
        numbers = [int(value) if whole else float(f"{value:.12g}") for value in values.tolist()]
        return [f"{number!r} {self.unit}" for number in numbers] if self.unit else numbers


#: Values of a key: a list or a range.
Values = Sequence[Any] | Range


def read_vary(text: str) -> tuple[str, Values]:
    """Return the key and values of KEY=VALUES; raise TruespringError with the syntax."""
    key, equals, values = text.partition("=")
    if not equals:
        raise TruespringError(f"--vary {text!r}: write KEY=VALUES; {FORMS}")
    return key.strip(), read_values(key.strip(), values)


def read_values(key: str, text: str) -> Values:
    """Return the values of a key from text; raise TruespringError with the syntax."""
    found = _RANGE.fullmatch(text)
    if found:
        return _range(key, text, *found.groups())
    parts = _split(text)
    if not all(part.strip() for part in parts):
        raise TruespringError(
            f"{key} = {text!r}: {'a value between commas' if len(parts) > 1 else 'the value'} is empty; {FORMS}"
        )
    return [read_value(part) for part in parts]


def _range(key: str, text: str, first: str, unit: str | None, last: str, other: str | None, count: str | None) -> Range:
    unit, other = (unit or "").strip(), (other or "").strip()
    if unit != other and unit:  # 2:8 kPa:4 is allowed, 2 kPa:8 is not
        raise TruespringError(
            f"{key} = {text!r}: both ends of a range must have the same unit, here '{unit}' and '{other}'"
        )
    if count is not None and int(count) < 2:
        raise TruespringError(f"{key} = {text!r}: a range has at least 2 values, here {count}; {FORMS}")
    whole = all(re.fullmatch(r"[-+]?\d+", end) for end in (first, last))
    return Range(float(first), float(last), None if count is None else int(count), other, whole)


def _split(text: str) -> list[str]:
    """Return a text split at commas outside brackets and quotes."""
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
    """Return one value written as in a study, with optional quotes: 4 kPa, lloyd, [0 N, -0.01 N], 8, true."""
    text = text.strip()
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        if text.startswith("[") and text.endswith("]"):
            return [read_value(part) for part in _split(text[1:-1])]
        return text


def make_changes(
    text: StudyText, vary: Mapping[str, Any], lhs: int | None = None, seed: int = 0
) -> list[dict[str, Any]]:
    """Return the changes of every point: all combinations, or `lhs` points of a Latin hypercube over the ranges.

    Values are sequences, Ranges, or texts for `read_values`. A Latin hypercube divides each range into as many layers
    as there are points, with one point in each; values of a list are equally frequent. Raises TruespringError.
    """
    read = {
        key: read_values(key, values) if isinstance(values, str) else _native(values) for key, values in vary.items()
    }
    if not read:
        raise TruespringError("nothing is varied: give a key and its values, such as --vary material.poisson=0:0.45:10")
    for key, other in itertools.permutations(read, 2):
        if other.startswith(f"{key}."):
            raise TruespringError(f"{key} and {other} are both varied, but {other} is part of {key}: vary one of them")
    for key, values in read.items():
        if not isinstance(values, Range | list) or values == []:
            raise TruespringError(f"{key} = {values!r}: give a list of values or a text: {FORMS}")
    columns = _grid(read) if lhs is None else _hypercube(text, read, lhs, seed)
    return [dict(zip(read, values, strict=True)) for values in columns]


def _native(values: Any) -> Any:
    """Return values with numpy's arrays and numbers replaced by Python's."""
    if hasattr(values, "tolist"):
        return values.tolist()
    return [_native(value) for value in values] if isinstance(values, list | tuple) else values


def _grid(vary: Mapping[str, Values]) -> Iterator[tuple[Any, ...]]:
    several = []
    for key, values in vary.items():
        if isinstance(values, Range) and values.count is None:
            shown = f"{values.first:g}:{values.last:g}"
            raise TruespringError(f"{key} = {shown}: add the number of values, such as {shown}:5, or use --lhs")
        several.append(values.values() if isinstance(values, Range) else list(values))
    _limit_points(int(np.prod([len(one) for one in several], dtype=float)))
    return itertools.product(*several)


def _hypercube(text: StudyText, vary: Mapping[str, Values], count: int, seed: int) -> Iterator[tuple[Any, ...]]:
    from scipy.stats import qmc

    if count < 1:
        raise TruespringError(f"--lhs {count}: it must be at least 1")
    _limit_points(count)
    shares = qmc.LatinHypercube(len(vary), rng=seed).random(count).T
    columns = []
    for (key, values), share in zip(vary.items(), shares, strict=True):
        if isinstance(values, Range):
            columns.append(values.at(share, values.whole and _takes_whole_numbers_only(text, key, values)))
        else:
            columns.append([values[place] for place in (share * len(values)).astype(int).tolist()])
    return zip(*columns, strict=True)


def _takes_whole_numbers_only(text: StudyText, key: str, values: Range) -> bool:
    """Return whether a study accepts the integers at both ends of a range, but no fraction in between."""
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


def _limit_points(count: int) -> None:
    if count > _MOST_POINTS:
        raise TruespringError(f"{count:,} points are more than {_MOST_POINTS:,}: use fewer values, or --lhs")


def read_points(file: str | Path) -> list[dict[str, Any]]:
    """Return the changes of every point in a CSV file: keys in its first row, then one row per point.

    Raises TruespringError with file and row.
    """
    place = Path(file)
    data = read_file(place, TruespringError)
    try:
        stream = io.StringIO(data.decode("utf-8-sig"), newline="")
        rows = [(number, row) for number, row in enumerate(csv.reader(stream), 1) if any(map(str.strip, row))]
    except (UnicodeDecodeError, csv.Error) as error:
        raise TruespringError(f"{place} is not a CSV file in UTF-8: {error}") from None
    if len(rows) < 2:
        raise TruespringError(f"{place} has no points: write keys into the first row, then one row per point")
    (_, head), *rows = rows
    keys = [key.strip() for key in head]
    if twice := {key for key in keys if keys.count(key) > 1}:
        raise TruespringError(f"{place}:1: {', '.join(sorted(twice))}: a key may be in one column only")
    points = []
    for number, row in rows:
        if len(row) != len(keys):
            raise TruespringError(f"{place}:{number}: {len(row)} values for {len(keys)} keys")
        if empty := [key for key, value in zip(keys, row, strict=True) if not value.strip()]:
            raise TruespringError(f"{place}:{number}: {empty[0]} has no value")
        points.append({key: read_value(value) for key, value in zip(keys, row, strict=True)})
    return points
