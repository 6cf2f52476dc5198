"""Tables in CSV files, whose columns have names and units."""

import csv
import io
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.errors import MeshError, TruespringError, nearest
from truespring.opening import read_file
from truespring.units import Dimension, to_si


class Table:
    """A CSV file with a line of names; a unit may stand behind a name: "x [mm]", numbers without one are SI.

    Args:
        file: the table.
        known: the columns that may be there, and what they measure; others are refused.
        required: those that must be there.
        error: what is raised, with file and line, where the file is damaged or misses something.

    Attributes:
        columns: place of each column that is there, by name.
        n_rows: number of rows below the names.
    """

    def __init__(
        self,
        file: Path,
        known: dict[str, Dimension | None],
        required: tuple[str, ...],
        error: type[TruespringError] = MeshError,
    ) -> None:
        self._file, self._known, self._error = file, known, error
        rows, self._lines = self._read()
        if len(rows) < 2:
            raise error(f"{file}: a line of column names and a row at least are wanted")
        if len(rows[0]) == 1 and ";" in rows[0][0]:
            raise error(f"{file}:1: values are separated by ';': commas are wanted, and points in numbers")
        self.columns: dict[str, int] = {}
        self._scales: dict[str, float] = {}
        for place, head in enumerate(rows[0]):
            self._column(head, place)
        missing = [name for name in required if name not in self.columns]
        if missing:
            raise error(f"{file}:1: column {missing[0]} is missing; there are {', '.join(self.columns)}")
        self._rows = rows[1:]
        self.n_rows = len(self._rows)
        for row, line in zip(rows, self._lines, strict=True):
            if len(row) != len(rows[0]):
                raise error(f"{file}:{line}: {len(row)} values, there are {len(rows[0])} columns")

    def _read(self) -> tuple[list[list[str]], list[int]]:
        """Return the rows that are not blank, and their lines."""
        data = read_file(self._file, self._error)
        rows, lines = [], []
        try:
            reader = csv.reader(io.StringIO(data.decode("utf-8-sig"), newline=""))
            for row in reader:
                if any(cell.strip() for cell in row):
                    rows.append(row)
                    lines.append(reader.line_num)
        except (UnicodeDecodeError, csv.Error) as error:
            raise self._error(f"{self._file} is no CSV file: {error}") from None
        return rows, lines

    def _column(self, head: str, place: int) -> None:
        read = re.fullmatch(r"\s*(\w+)\s*(?:\[(.+)\])?\s*", head)
        name = read[1] if read else head.strip()
        if read is None or name not in self._known:
            allowed = ", ".join(self._known)
            raise self._error(
                f"{self._file}:1: column '{name}' is unknown{nearest(name, self._known)}; allowed: {allowed}"
            )
        if name in self.columns:
            raise self._error(f"{self._file}:1: column {name} is there twice")
        dimension = self._known[name]
        if read[2] and dimension is None:
            raise self._error(f"{self._file}:1: column {name} has no unit")
        try:
            self._scales[name] = to_si(f"1 {read[2]}", dimension) if read[2] and dimension else 1.0
        except TruespringError as error:
            raise self._error(f"{self._file}:1: {name}: {error}") from None
        self.columns[name] = place

    def texts(self, name: str) -> list[str]:
        """Return a column as it stands."""
        return [row[self.columns[name]].strip() for row in self._rows]

    def numbers(self, name: str) -> Floats:
        """Return a column in SI units, shape (n_rows,)."""
        return self._scales[name] * np.array(
            [self._value(name, row, float, "is no number") for row in range(self.n_rows)]
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
