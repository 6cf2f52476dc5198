"""The points of a sweep, checked before any is solved, each known by all that its result depends on."""

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any

from truespring.errors import StudyError, TruespringError
from truespring.opening import open_file
from truespring.study import StudyText, value_at
from truespring.study.changes import changed

# So many faults are told one by one.
_MOST_FAULTS = 8


@dataclass(frozen=True)
class Point:
    """One study of a sweep.

    Attributes:
        name: digest of all that its result depends on: study, values, files that it names, version of truespring.
        changes: the varied values as they were given, by key.
        values: the same as the study has them, in SI.
        files: digest of each file that the study names, beside it.
    """

    name: str
    changes: Mapping[str, Any]
    values: Mapping[str, Any]
    files: Mapping[str, str]


@dataclass(frozen=True)
class Plan:
    """All points of a sweep, none twice.

    Attributes:
        text: the study that is varied.
        keys: what is varied, in the order it was given.
        points: by name.
        n_twice: how many points were given again.
    """

    text: StudyText
    keys: tuple[str, ...]
    points: Mapping[str, Point]
    n_twice: int

    @cached_property
    def frame(self) -> str:
        """Digest of all that is not varied."""
        fixed = changed(self.text.document, dict.fromkeys(self.keys))
        files = digests(self.text.file.parent, fixed, {})
        return _digest(json.dumps([fixed, files, version("truespring")], sort_keys=True, default=str))


def make_plan(text: StudyText, several: Sequence[Mapping[str, Any]]) -> Plan:
    """Check every point against the schema of studies; raise StudyError with the faults of all of them.

    Args:
        text: the study.
        several: the changes of each point, by key; all have the same keys.
    """
    if not several:
        raise TruespringError("there is no point")
    keys = tuple(several[0])
    points: dict[str, Point] = {}
    faults: dict[str, str] = {}
    known: dict[Path, str] = {}
    for number, changes in enumerate(several, 1):
        if set(changes) != set(keys):
            raise TruespringError(f"point {number} sets {', '.join(changes)}, the first one {', '.join(keys)}")
        try:
            point = _point(text, changes, keys, known)
        except StudyError as error:
            faults.setdefault(str(error), f"point {number} ({in_words(changes)}): {error}")
        else:
            points.setdefault(point.name, point)
    if faults:
        told = list(faults.values())[:_MOST_FAULTS]
        more = len(faults) - len(told)
        raise StudyError("\n".join([*told, *([f"and {more} more like these"] if more else [])]))
    return Plan(text, keys, points, len(several) - len(points))


def _point(text: StudyText, changes: Mapping[str, Any], keys: Sequence[str], known: dict[Path, str]) -> Point:
    table = text.keys(changes)
    files = digests(text.file.parent, changed(text.document, changes), known)
    # The checked table, not the text: comments, and 4 kPa beside 4000, change nothing.
    name = _digest(json.dumps([repr(table), files, version("truespring")], sort_keys=True))[:20]
    return Point(name, changes, {key: _plain(value_at(table, key), changes[key]) for key in keys}, files)


def in_words(values: Mapping[str, Any]) -> str:
    """Return values as people write them: material.young = 4 kPa, mesh.elements = [8, 2]."""
    return ", ".join(f"{key} = {value}" for key, value in values.items())


def digests(folder: Path, tables: Any, known: dict[Path, str]) -> dict[str, str]:
    """Return the digest of every file beside the study that any text of its tables names."""
    found = {}
    for text in sorted(set(_texts(tables))):
        file = folder / text
        if file not in known:
            known[file] = _digest_of(file)
        if known[file]:
            found[text] = known[file]
    return found


def _digest_of(file: Path) -> str:
    """The digest of a file, nothing where there is none."""
    try:
        if not file.is_file():
            return ""
        with open_file(file, TruespringError) as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except (OSError, ValueError, TruespringError):  # a text that no file can be called
        return ""


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, Mapping):
        for one in value.values():
            yield from _texts(one)
    elif isinstance(value, list):
        for one in value:
            yield from _texts(one)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: Any, given: Any) -> Any:
    """A value of the checked study as JSON can hold it; where it is an object by then, as it was given."""
    try:
        json.dumps(value)
    except TypeError:
        return given
    return value
