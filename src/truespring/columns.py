"""Read CSV files whose header line has names and units."""

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

#: Function from unknown column names to the known names that they stand for.
Synonyms = Callable[[Sequence[str]], Mapping[str, str]]

# A name with a unit: "x [mm]", "x (mm)"; or without brackets: "x_mm", "x mm".
_HEAD = re.compile(r"\s*(?P<name>[^\[\]()]*?)\s*(?:[\[(]\s*(?P<unit>[^\[\]()]+?)\s*[\])])?\s*")
_GLUED = re.compile(r"(?P<name>.*[^\s_])[\s_]+(?P<unit>[^\W\d_]+)")
# A number in Fortran's format, 1.0D-03.
_FORTRAN = re.compile(r"([\d.])[dD]([+-]?\d+)$")
# Units of lengths in images, which have no size in SI units.
_PIXELS = ("px", "pix", "pixel", "pixels")
# Encodings by byte order mark.
_CODINGS = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}


class Columns:
    """A CSV file with a header line; values are separated by commas, semicolons or tabs.

    A name may have a unit: "x [mm]", "x (mm)" or "x_mm"; numbers without a unit are in SI units. Names are not case
    sensitive. If values are not separated by commas, numbers may have decimal commas.

    Args:
        file: path of the file.
        known: dimension of each allowed column, None for columns without a unit; other columns are an error.
        required: columns that must be present.
        error: class of the exception, which is raised with file and line if the file is wrong.
        synonyms: function from unknown names to known ones; with it, columns that remain unknown are ignored.
        form: example of a header line, for error messages.

    Attributes:
        columns: index of each known column in the file, by name.
        units: unit of each known column as written in the header, by name; empty without a unit.
        unknown: headers of the columns that were ignored.
        n_rows: number of rows below the header line.
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
            raise error(f"{file}: needs a header line and at least one row{self._form}")
        self.columns: dict[str, int] = {}
        self.units: dict[str, str] = {}
        self.unknown: list[str] = []
        self._scales: dict[str, float] = {}
        self._name(rows[0], synonyms)
        missing = [name for name in required if name not in self.columns]
        if missing:
            if self.unknown:
                self.raise_unknown()
            there = ", ".join(self.columns) or "none"
            raise error(f"{file}:1: column {missing[0]} is missing; known columns found: {there}{self._form}")
        self._rows = rows[1:]
        self.n_rows = len(self._rows)
        for row, line in zip(rows, self._lines, strict=True):
            if len(row) != len(rows[0]):
                raise error(f"{file}:{line}: {len(row)} values for {len(rows[0])} columns")
        self._comma = self._has_decimal_commas()

    def _read(self) -> tuple[list[list[str]], list[int], str]:
        """Return the rows that are not blank, their line numbers, and the separator."""
        data = read_file(self._file, self._error)
        rows: list[list[str]] = []
        lines: list[int] = []
        try:
            text = data.decode(_CODINGS.get(data[:2], "utf-8-sig"))
            first = next((line for line in text.splitlines() if line.strip()), "")
            named = re.fullmatch(r"sep=([,;\t])", first.strip("\r\n "))  # a first line of some spreadsheet programs
            separator = named[1] if named else "\t" if "\t" in first else ";" if ";" in first else ","
            reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, skipinitialspace=True)
            for row in reader:
                if any(cell.strip() for cell in row) and not (named and not rows and reader.line_num == 1):
                    rows.append(row)
                    lines.append(reader.line_num)
        except (UnicodeDecodeError, csv.Error) as error:
            raise self._error(f"{self._file} is not a CSV file: {error}") from None
        return rows, lines, separator

    def _name(self, heads: Sequence[str], synonyms: Synonyms | None) -> None:
        """Set `columns`, `units`, `unknown` and `_scales` from the header line."""
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
                self.raise_unknown()

    def _split(self, head: str) -> tuple[str, str]:
        """Return name and unit of a column from its header, a known name in its known spelling."""
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
        """Return a name in lower case if only that is known."""
        return name if name in self._known or name.lower() not in self._known else name.lower()

    def _dimension(self, name: str) -> bool:
        """Return whether a column of this name may have a unit; an unknown name may."""
        return self._known.get(name, "length") is not None

    def _is_unit(self, text: str) -> bool:
        """Return whether a text is a unit of any known column."""
        for dimension in {one for one in self._known.values() if one is not None}:
            try:
                unit_size(text, dimension)
            except TruespringError:
                continue
            return True
        return False

    def raise_unknown(self) -> NoReturn:
        """Raise an error that names the first unknown column."""
        name = self.unknown[0].strip()
        allowed = ", ".join(self._known)
        raise self._error(
            f"{self._file}:1: column '{name}' is unknown{nearest(name, self._known)}; allowed: {allowed}{self._form}"
        )

    def _column(self, name: str, place: int, unit: str, head: str) -> None:
        """Add a known column with its index in the file and its unit; raise an error for a duplicate or wrong unit."""
        if name in self.columns:
            raise self._error(f"{self._file}:1: column {name} is defined twice, the second time as '{head.strip()}'")
        dimension = self._known[name]
        if unit and dimension is None:
            raise self._error(f"{self._file}:1: column {name} cannot have a unit")
        try:
            self._scales[name] = unit_size(unit, dimension) if unit and dimension else 1.0
        except TruespringError as error:
            raise self._error(f"{self._file}:1: {name}: {error}") from None
        self.columns[name], self.units[name] = place, unit

    def _has_decimal_commas(self) -> bool:
        """Return whether numbers have decimal commas; raise an error if some have commas and others points."""
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
                f"{self._file}:{line}: '{comma}' has a comma, '{point}' a point: use one decimal sign, and no "
                "thousands separator"
            )
        return "," in found

    def texts(self, name: str) -> list[str]:
        """Return the texts of a column without surrounding blanks."""
        return [row[self.columns[name]].strip() for row in self._rows]

    def numbers(self, name: str, rows: Sequence[int] | None = None) -> Floats:
        """Return a column as numbers in SI units, shape (n_rows,), or those of some rows, counted from 0."""

        def convert(text: str) -> float:
            text = text.replace(",", ".") if self._comma else text
            return float(_FORTRAN.sub(r"\1e\2", text))

        asked = range(self.n_rows) if rows is None else rows
        return self._scales[name] * np.array([self._value(name, row, convert, "is not a number") for row in asked])

    def line(self, row: int) -> int:
        """Return the line number of a row in the file."""
        return self._lines[1 + row]

    def known(self, name: str, row: int, number: dict[str, int]) -> int:
        """Return the number of the node whose name is in a column of a row, where `number` has the numbers by name."""
        place: int = self._value(name, row, lambda text: number[text], "is not the name of a node")
        return place

    def _value(self, name: str, row: int, convert: Callable[[str], Any], wrong: str) -> Any:
        """Return the converted text of a cell; an error message ends with `wrong`."""
        text = self._rows[row][self.columns[name]].strip()
        try:
            return convert(text)
        except (ValueError, KeyError):
            raise self._error(f"{self._file}:{self.line(row)}: {name} = '{text}' {wrong}") from None
