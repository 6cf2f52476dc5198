"""Locate the keys of a study file for error messages: file, line and key."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path

from truespring.errors import StudyError, TruespringError, one_line, shown

#: A key as a path from the top of the file: ("load", 0, "force"); lists count from 0.
Key = tuple[str | int, ...]


class Places:
    """A study file and the lines of its keys."""

    def __init__(self, file: Path, source: str) -> None:
        """Store the path as the user gave it, and the text of the file."""
        self.file, self._source = file, source

    @cached_property
    def lines(self) -> Mapping[Key, int]:
        """The line number of each key, from 1."""
        return line_numbers(self._source)

    def beside(self, name: str) -> Path:
        """Return the path of a file that the study refers to, relative to the study's folder."""
        return self.file.parent / name

    def of(self, key: Key) -> str:
        """Return the start of an error message: "study.toml:12: load.1.force"."""
        return place_of(self.file, key, self.lines)

    @contextmanager
    def at(self, *key: str | int) -> Iterator[None]:
        """Convert a TruespringError or OSError to a StudyError that begins with file, line and key."""
        try:
            yield
        except TruespringError as error:
            if isinstance(error, StudyError) and str(error).startswith(
                f"{self.file}:"
            ):  # already located, more precisely
                raise
            raise StudyError(f"{self.of(key)}: {one_line(str(error))}") from None
        except OSError as error:
            what = f"{shown(str(error.filename))}: {error.strerror}" if error.filename else str(error)
            raise StudyError(f"{self.of(key)}: {what}") from None


def place_of(file: Path, key: Key, lines: Mapping[Key, int]) -> str:
    """Return the file, the line of the key or of the table around it, and the key; lists count from 1."""
    known = next((lines[key[:n]] for n in range(len(key), 0, -1) if key[:n] in lines), None)
    dotted = one_line(".".join(str(part + 1) if isinstance(part, int) else part for part in key), 200)
    return f"{file}:{known}: {dotted}" if known else f"{file}: {dotted}"


def line_numbers(source: str) -> dict[Key, int]:
    """Return the line number of each table and key; keys in inline tables and dotted keys are left out."""
    lines: dict[Key, int] = {}
    count: dict[str, int] = {}
    table: Key = ()
    for number, line in enumerate(source.splitlines(), 1):
        if found := re.match(r"\s*\[\[\s*([\w.\-]+)\s*\]\]", line):
            count[found[1]] = count.get(found[1], -1) + 1
            table = (*found[1].split("."), count[found[1]])
            lines[table] = number
            lines.setdefault(table[:-1], number)
        elif found := re.match(r"\s*\[\s*([\w.\-]+)\s*\]", line):
            table = tuple(found[1].split("."))
            lines[table] = number
        elif found := re.match(r"\s*([\w\-]+)\s*=", line):
            lines[(*table, found[1])] = number
    return lines
