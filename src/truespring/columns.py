"""CSV files, whose columns have names and units."""

import csv
import difflib
import io
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from truespring.arrays import Floats
from truespring.errors import MeshError, TruespringError, nearest
from truespring.opening import read_file
from truespring.units import Dimension, unit_size

#: Returns which columns other names may mean: from the names that are not known to those that are.
Synonyms = Callable[[Sequence[str]], Mapping[str, str]]

# How a unit may stand behind a name: "x [mm]", "x (mm)"; or glued: "x_mm", "x mm".
_HEAD = re.compile(r"\s*(?P<name>[^\[\]()]*?)\s*(?:[\[(]\s*(?P<unit>[^\[\]()]+?)\s*[\])])?\s*")
_GLUED = re.compile(r"(?P<name>.*[^\s_])[\s_]+(?P<unit>[^\W\d_]+)")
# A number as Fortran writes it, 1.0D-03.
_FORTRAN = re.compile(r"([\d.])[dD]([+-]?\d+)$")
# Lengths in a picture, which are no unit of length.
_PIXELS = ("px", "pix", "pixel", "pixels")
# By the mark that a file of another coding begins with.
_CODINGS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}


class Columns:
    """Values of a CSV file, separated by commas, semicolons or tabs below a line of names.

    A unit may stand behind a name: "x [mm]", "x (mm)" or "x_mm"; numbers without one are SI. Names may be capital.
    Where commas do not separate values, numbers may have decimal commas.

    Args:
        file: the CSV file.
        known: the columns that may be there, and what they measure; others are an error.
        required: those that must be there.
        error: what is raised, with file and line, where the file is damaged or misses something.
        synonyms: what other names mean; where it is given, columns that still are unknown are left out.
        form: how the first line may look, for messages.

    Attributes:
        columns: place of each column that is there, by name.
        units: the unit of each of them as it is written, empty where there is none.
        unknown: what was left out, as it is written.
        n_rows: number of rows below the names.
    """

    def __init__(
        self,
        file: Path,
        known: dict[str, Dimension | None],
        required: tuple[str, ...],
        error: type[TruespringError] = MeshError,
        synonyms: Synonyms | None = None,
        form: str = "",
    ) -> None:
        self._file, self._known, self._error = file, known, error
        self._form = f"; the first line may be: {form}" if form else ""
        rows, self._lines, self._separator = self._read()
        if len(rows) < 2:
            raise error(f"{file}: needs a line of column names and a row at least{self._form}")
        self.columns: dict[str, int] = {}
        self.units: dict[str, str] = {}
        self.unknown: list[str] = []
        self._scales: dict[str, float] = {}
        self._name(rows[0], synonyms)
        missing = [name for name in required if name not in self.columns]
        if missing:
            if self.unknown:
                self.refuse_unknown()
            there = ", ".join(self.columns) or "none that is known"
            raise error(f"{file}:1: column {missing[0]} is missing; there are {there}{self._form}")
        self._rows = rows[1:]
        self.n_rows = len(self._rows)
        for row, line in zip(rows, self._lines, strict=True):
            if len(row) != len(rows[0]):
                raise error(f"{file}:{line}: {len(row)} values, there are {len(rows[0])} columns")
        self._comma = self._has_decimal_commas()

    def _read(self) -> tuple[list[list[str]], list[int], str]:
        """Return the rows that are not blank, their lines, and what separates values."""
        data = read_file(self._file, self._error)
        rows: list[list[str]] = []
        lines: list[int] = []
        try:
            text = data.decode(_CODINGS.get(data[:2], "utf-8-sig"))
            first = next((line for line in text.splitlines() if line.strip()), "")
            told = re.fullmatch(r"sep=([,;\t])", first.strip("\r\n "))  # as spreadsheets may begin
            separator = told[1] if told else "\t" if "\t" in first else ";" if ";" in first else ","
            reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True)
            for row in reader:
                if any(cell.strip() for cell in row) and not (told and not rows and reader.line_num == 1):
                    rows.append(row)
                    lines.append(reader.line_num)
        except (UnicodeDecodeError, csv.Error) as error:
            raise self._error(f"{self._file} is no CSV file: {error}") from None
        return rows, lines, separator

    def _name(self, heads: Sequence[str], synonyms: Synonyms | None) -> None:
        """Find what each column holds, and its unit."""
        read = [(place, head, *self._split(head)) for place, head in enumerate(heads)]
        if synonyms is not None:
            self.unknown += [head for _, head, _, unit in read if unit.lower() in _PIXELS]
            read = [one for one in read if one[3].lower() not in _PIXELS]
        other = [name for _, _, name, _ in read if name not in self._known]
        meant = synonyms(other) if synonyms is not None else {}
        for place, head, name, unit in read:
            known = meant.get(name, name)
            if known in self._known:
                self._column(known, place, unit, head)
                continue
            near = difflib.get_close_matches(name, self._known, 1, 0.85)
            self.unknown.append(head)
            if synonyms is None or near:
                self.unknown = [head]
                self.refuse_unknown()

    def _split(self, head: str) -> tuple[str, str]:
        """Return the name, in the spelling that is known where one is, and the unit in a column's head."""
        read = _HEAD.fullmatch(head)
        if read is None:
            return head.strip(), ""
        name, unit = self._spelt(read["name"]), read["unit"] or ""
        glued = None if name in self._known else _GLUED.fullmatch(name)
        if glued and self._dimension(self._spelt(glued["name"])) and self._is_unit(glued["unit"]):
            if unit and unit != glued["unit"]:
                raise self._error(
                    f"{self._file}:1: column '{head.strip()}' has two units, {glued['unit']} and {unit}: keep one"
                )
            return self._spelt(glued["name"]), glued["unit"]
        return name, unit

    def _spelt(self, name: str) -> str:
        return name if name in self._known or name.lower() not in self._known else name.lower()

    def _dimension(self, name: str) -> bool:
        """Whether a column of this name, or of one that may mean another, has a unit."""
        return self._known.get(name, "length") is not None

    def _is_unit(self, text: str) -> bool:
        for dimension in {one for one in self._known.values() if one is not None}:
            try:
                unit_size(text, dimension)
            except TruespringError:
                continue
            return True
        return False

    def refuse_unknown(self) -> NoReturn:
        """Raise for the first column that is not known."""
        name = self.unknown[0].strip()
        allowed = ", ".join(self._known)
        raise self._error(
            f"{self._file}:1: column '{name}' is unknown{nearest(name, self._known)}; allowed: {allowed}{self._form}"
        )

    def _column(self, name: str, place: int, unit: str, head: str) -> None:
        if name in self.columns:
            raise self._error(f"{self._file}:1: column {name} is there twice, the second is '{head.strip()}'")
        dimension = self._known[name]
        if unit and dimension is None:
            raise self._error(f"{self._file}:1: column {name} has no unit")
        try:
            self._scales[name] = unit_size(unit, dimension) if unit and dimension else 1.0
        except TruespringError as error:
            raise self._error(f"{self._file}:1: {name}: {error}") from None
        self.columns[name], self.units[name] = place, unit

    def _has_decimal_commas(self) -> bool:
        """Whether numbers have decimal commas; raise where some have commas, others points."""
        if self._separator == ",":
            return False
        numbers = [place for name, place in self.columns.items() if self._known[name] is not None]
        found: dict[str, tuple[str, int]] = {}
        for number, row in enumerate(self._rows):
            for place in numbers:
                for sign in ",.":
                    if sign in row[place]:
                        found.setdefault(sign, (row[place].strip(), self.line(number)))
        if len(found) > 1:
            (comma, line), (point, _) = found[","], found["."]
            raise self._error(
                f"{self._file}:{line}: '{comma}' has a comma, '{point}' a point: write one decimal sign, and none "
                "between thousands"
            )
        return "," in found

    def texts(self, name: str) -> list[str]:
        """Return a column as it stands."""
        return [row[self.columns[name]].strip() for row in self._rows]

    def numbers(self, name: str) -> Floats:
        """Return a column in SI units, shape (n_rows,)."""

        def convert(text: str) -> float:
            text = text.replace(",", ".") if self._comma else text
            return float(_FORTRAN.sub(r"\1e\2", text))

        return self._scales[name] * np.array(
            [self._value(name, row, convert, "is no number") for row in range(self.n_rows)]
        )

    def line(self, row: int) -> int:
        """Return the line of the file that a row stands in."""
        return self._lines[1 + row]

    def known(self, name: str, row: int, number: dict[str, int]) -> int:
        """Return the number of the node that a row names in a column."""
        place: int = self._value(name, row, lambda text: number[text], "names no node")
        return place

    def _value(self, name: str, row: int, convert: Callable[[str], Any], wrong: str) -> Any:
        text = self._rows[row][self.columns[name]].strip()
        try:
            return convert(text)
        except (ValueError, KeyError):
            raise self._error(f"{self._file}:{self.line(row)}: {name} = '{text}' {wrong}") from None
