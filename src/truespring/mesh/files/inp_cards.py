"""Parse decks of Abaqus and CalculiX: lines, comments, keywords, parameters and included files.

Source: "Input syntax rules" in the manual of Abaqus, and that of CalculiX CrunchiX, https://www.dhondt.de
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from truespring.errors import MeshError
from truespring.mesh.files.text import Rows, integers, reals, word
from truespring.opening import file_beside, read_file

# Limits of nested and of all included files.
_DEEPEST, _MOST = 16, 1000

# A place is the number of the file times this, plus the line counted from 1. The deck is file 0.
_A_FILE = 1 << 40

# Parameters without a value: a line that begins with one continues the keyword line.
_FLAGS = {b"GENERATE", b"INTERNAL", b"UNSORTED"}


class Lines:
    """The lines of a deck, with included files inserted.

    Attributes:
        notes: remarks for the user.
        open_ends: places of last lines that have no line end.
    """

    def __init__(self, data: bytes, folder: Path | None) -> None:
        self.notes: list[str] = []
        self.open_ends: set[int] = set()
        self._folder = folder
        self._names = [""]
        self._open: list[tuple[Path | None, Iterator[tuple[int, bytes]]]] = [(None, self._of(0, data))]

    def __iter__(self) -> Iterator[tuple[int, bytes]]:
        """Yield place and text of each line that is neither blank nor a comment."""
        while self._open:
            found = next(self._open[-1][1], None)
            if found is None:
                self._open.pop()
            else:
                yield found

    def _of(self, file: int, data: bytes) -> Iterator[tuple[int, bytes]]:
        lines = data.splitlines()
        if not data.endswith((b"\n", b"\r")):
            self.open_ends.add(file * _A_FILE + len(lines))
        for number, line in enumerate(lines, 1):
            text = line.strip()
            if text and not text.startswith(b"**"):
                yield file * _A_FILE + number, text

    def at(self, place: int) -> str:
        """Return "line 5", or "line 5 of mesh.inc"."""
        file, line = divmod(int(place), _A_FILE)
        return f"line {line} of {self._names[file]}" if file else f"line {line}"

    def is_included(self, place: int) -> bool:
        """Return whether a line is from an included file: its text is not shown in messages."""
        return place >= _A_FILE

    def include(self, name: str) -> None:
        """Continue with the lines of a file; raise MeshError if it cannot be read or lies outside of the deck's folder.

        Names are relative to the deck's folder, also in included files, as in both programs.
        """
        if self._folder is None:
            raise MeshError("only a deck that is read from a file can include files")
        path = file_beside(self._folder, name, MeshError, who="the deck ")
        if path in [one for one, _ in self._open]:
            raise MeshError("this file includes itself: remove the line")
        if len(self._open) > _DEEPEST or len(self._names) > _MOST:
            raise MeshError(f"files are included {_DEEPEST} deep and {_MOST} times at most: write them into one")
        data = read_file(path, MeshError)
        if b"\0" in data:
            raise MeshError("this file is binary, not text")
        self._names.append(path.relative_to(self._folder).as_posix())
        self._open.append((path, self._of(len(self._names) - 1, data.removeprefix(b"\xef\xbb\xbf"))))


@dataclass
class Card:
    """A keyword with its parameters, and the lines of data below it.

    Attributes:
        deck: the lines of the deck, which convert places to text.
        place: the place of the keyword.
        head: the keyword line with its continuation lines.
        rows, places: the data lines and their places.
    """

    deck: Lines
    place: int
    head: bytes
    rows: list[bytes] = field(default_factory=list)
    places: list[int] = field(default_factory=list)

    @cached_property
    def keyword(self) -> str:
        """The keyword in capitals, without blanks."""
        name = self.head.partition(b",")[0].decode("latin-1")
        return re.sub(r"\s", "", name).upper().lstrip("*")

    @property
    def parameters(self) -> dict[str, str]:
        """The parameters by name in upper case; values as in the file, with quotation marks."""
        pairs = [decoded(one).partition("=") for one in fields(self.head)[1:]]
        return {name.strip().upper(): value.strip() for name, _, value in pairs if name.strip()}

    def error(self, why: str, place: int | None = None) -> MeshError:
        """Return an error with the keyword and a place, by default that of the keyword."""
        return MeshError(f"{self.deck.at(place or self.place)}: *{self.keyword}: {why}")

    def shown(self, text: bytes, place: int) -> str:
        """Return a field for a message; empty if it is from an included file."""
        return "the entry" if self.deck.is_included(place) else f"'{word(text)}'"

    def integers(self, rows: Rows, places: Sequence[int], what: str) -> Any:
        """Return all fields as integers, shape (n,); raise MeshError with the place of one that is not."""
        return self._numbers(integers, rows, places, what, "whole numbers")

    def reals(self, rows: Rows, places: Sequence[int], what: str) -> Any:
        """Return all fields as numbers, shape (n,); raise MeshError with the place of one that is not."""
        return self._numbers(reals, rows, places, what, "numbers")

    def _numbers(
        self,
        read: Callable[[Rows, Sequence[int], str], Any],
        rows: Rows,
        places: Sequence[int],
        what: str,
        expected: str,
    ) -> Any:
        try:
            return read(rows, places, what)
        except MeshError:
            if not any(map(self.deck.is_included, places)):
                raise
        for row, place in zip(rows, places, strict=True):
            try:
                read([row], [place], what)
            except MeshError as error:
                why = f"{self.deck.at(place)}: {what}: expected {expected}"
                raise (MeshError(why) if self.deck.is_included(place) else error) from None
        raise AssertionError("no row without a number was found")  # pragma: no cover


def cards(lines: Lines) -> Iterator[Card]:
    """Yield the cards of a deck; raise MeshError if it is not a deck, add a note if it may be truncated.

    A line that begins with * is a keyword, even if the line before ends with a comma.
    """
    card: Card | None = None  # whose data follow
    head: Card | None = None  # whose keyword line may continue
    in_step = False
    for place, text in lines:
        if text.startswith(b"*"):
            head = Card(lines, place, text)
            if head.keyword != "INCLUDE":
                if card:
                    yield card
                card = head
                in_step = card.keyword == "STEP" or (in_step and card.keyword != "ENDSTEP")
        elif head and head.head.endswith(b",") and _are_parameters(text):
            head.head += text
        else:
            head = None
            if card is None:
                what = "" if lines.is_included(place) else f", found '{word(text)}'"
                raise MeshError(f"{lines.at(place)}: this is no .inp file: expected a keyword such as *NODE{what}")
            card.rows.append(text)
            card.places.append(place)
            continue
        _follow(head, in_step)
    if card is None:
        raise MeshError("there is no keyword such as *NODE")
    yield card
    if in_step:
        lines.notes.append("a *STEP has no *END STEP: the file may be truncated after its mesh")
    for place in sorted(lines.open_ends):
        if lines.is_included(place) or not card.keyword.startswith("END"):
            lines.notes.append(f"{lines.at(place)} is the last one and has no line end: it may be truncated there")


def _follow(card: Card, in_step: bool) -> None:
    """Continue with the file that a keyword includes; in a step, a missing file only adds a note."""
    name = bare(card.parameters.get("INPUT", ""))
    goes_on = card.head.endswith(b",") and card.keyword != "INCLUDE"
    if not name or goes_on or card.keyword not in ("INCLUDE", "NODE", "ELEMENT"):
        return
    try:
        card.deck.include(name)
    except MeshError as error:
        full = card.error(str(error))
        if not in_step:
            raise full from None
        card.deck.notes.append(str(full))


def _are_parameters(text: bytes) -> bool:
    """Return whether a line continues the parameters of a keyword, rather than being a data line."""
    return b"=" in text or all(one.strip().upper() in _FLAGS for one in fields(text))


def fields(row: bytes) -> list[bytes]:
    """Split a line at the commas outside of quotation marks; drop blank fields at the end."""
    if b'"' in row:
        found = [one or other for one, other in re.findall(rb'((?:[^,"]|"[^"]*")+)|(?:^|(?<=,))()(?=,)', row)]
    else:
        found = row.split(b",")
    while found and not found[-1].strip():
        found.pop()
    return found


def decoded(data: bytes) -> str:
    """Decode text as UTF-8, else as Latin-1, which older programs write."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def bare(name: str) -> str:
    """Return a name without its quotation marks."""
    return name.strip().strip("\"'")
