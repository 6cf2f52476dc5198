"""The points of a sweep, checked before any is solved, each named by a digest of all input of its result."""

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

# Largest number of errors that are listed.
_MOST_FAULTS = 8


@dataclass(frozen=True)
class Point:
    """One study of a sweep.

    Attributes:
        name: digest of the study, its values, the files it refers to, and the version of truespring.
        changes: the varied values as given, by key.
        values: the varied values in SI, by key.
        files: digest of each file that the study refers to.
    """

    name: str
    changes: Mapping[str, Any]
    values: Mapping[str, Any]
    files: Mapping[str, str]


@dataclass(frozen=True)
class Plan:
    """The distinct points of a sweep.

    Attributes:
        text: the study.
        keys: the varied keys, in the order given.
        points: by name.
        n_twice: number of duplicate points.
    """

    text: StudyText
    keys: tuple[str, ...]
    points: Mapping[str, Point]
    n_twice: int

    @cached_property
    def frame(self) -> str:
        """Digest of the study without the varied values."""
        fixed = changed(self.text.document, dict.fromkeys(self.keys))
        files = digests(self.text.file.parent, fixed, {})
        return _digest(json.dumps([fixed, files, version("truespring")], sort_keys=True, default=str))


def make_plan(text: StudyText, several: Sequence[Mapping[str, Any]]) -> Plan:
    """Check every point against the schema of studies and return the plan; raise StudyError with all errors.

    Args:
        text: the study.
        several: the changes of each point by key, all with the same keys.
    """
    if not several:
        raise TruespringError("no points: give at least one")
    keys = tuple(several[0])
    points: dict[str, Point] = {}
    faults: dict[str, str] = {}
    known: dict[Path, str] = {}
    for number, changes in enumerate(several, 1):
        if set(changes) != set(keys):
            raise TruespringError(
                f"point {number} has the keys {', '.join(changes)}, the first one {', '.join(keys)}: use the same keys"
            )
        try:
            point = _point(text, changes, keys, known)
        except StudyError as error:
            faults.setdefault(str(error), f"point {number} ({in_words(changes)}): {error}")
        else:
            points.setdefault(point.name, point)
    if faults:
        shown = list(faults.values())[:_MOST_FAULTS]
        more = len(faults) - len(shown)
        raise StudyError("\n".join([*shown, *([f"and {more} more errors"] if more else [])]))
    return Plan(text, keys, points, len(several) - len(points))


def _point(text: StudyText, changes: Mapping[str, Any], keys: Sequence[str], known: dict[Path, str]) -> Point:
    checked = text.keys(changes)
    files = digests(text.file.parent, changed(text.document, changes), known)
    # Use the checked keys, not the text, so that comments and units (4 kPa or 4000) do not matter.
    name = _digest(json.dumps([repr(checked), files, version("truespring")], sort_keys=True))[:20]
    return Point(name, changes, {key: _plain(value_at(checked, key), changes[key]) for key in keys}, files)


def in_words(values: Mapping[str, Any]) -> str:
    """Return values by key as text: material.young = 4 kPa, mesh.elements = [8, 2]."""
    return ", ".join(f"{key} = {value}" for key, value in values.items())


def digests(folder: Path, tables: Any, known: dict[Path, str]) -> dict[str, str]:
    """Return the digest of every file in the folder of the study that a string of its tables names."""
    found = {}
    for text in sorted(set(_texts(tables))):
        file = folder / text
        if file not in known:
            known[file] = _digest_of(file)
        if known[file]:
            found[text] = known[file]
    return found


def _digest_of(file: Path) -> str:
    """Return the digest of a file, empty if there is none."""
    try:
        if not file.is_file():
            return ""
        with open_file(file, TruespringError) as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except (OSError, ValueError, TruespringError):  # not a valid file name
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


def _plain(value: Any, original: Any) -> Any:
    """Return a value of the checked study if JSON can hold it, else the original value."""
    try:
        json.dumps(value)
    except TypeError:
        return original
    return value
