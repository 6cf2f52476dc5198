"""Networks from two CSV files: nodes, and the springs between them."""

import csv
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from truespring.errors import MeshError, TruespringError, nearest
from truespring.models import SpringNetwork
from truespring.units import Dimension, to_si

# Columns by name, and what they measure; others are refused.
_NODE_COLUMNS: dict[str, Dimension | None] = {"node": None, "x": "length", "y": "length", "z": "length"}
_SPRING_COLUMNS: dict[str, Dimension | None] = {
    "a": None,
    "b": None,
    "stiffness": "stiffness",
    "rest_length": "length",
}


def read_network(nodes: str | Path, springs: str | Path) -> SpringNetwork:
    """Read a network from two CSV files with a line of column names each.

    Args:
        nodes: columns x, y and in space z; `node`, where there is one, names each.
        springs: columns a and b, the nodes that a spring joins, by their names or, where they have none, by their
            numbers from 0; stiffness; and rest_length, where springs do not have the distance of their nodes.

    Numbers are SI; a unit may stand behind a column's name: "x [mm]", "stiffness [N/mm]". Raises MeshError, with file
    and line, where a file is damaged or names what is not there.
    """
    table = _Table(Path(nodes), _NODE_COLUMNS, ("x", "y"))
    axes = [axis for axis in "xyz" if axis in table.columns]
    places = np.stack([table.numbers(axis) for axis in axes], axis=1)
    names = table.texts("node") if "node" in table.columns else [str(number) for number in range(len(places))]
    number = {name: place for place, name in enumerate(names)}
    if len(number) < len(names):
        twice = next(name for place, name in enumerate(names) if number[name] != place)
        raise MeshError(f"{nodes}: node {twice} is there twice")
    joined = _Table(Path(springs), _SPRING_COLUMNS, ("a", "b", "stiffness"))
    ends = np.array([[joined.known(column, row, number) for column in "ab"] for row in range(joined.n_rows)])
    rest = joined.numbers("rest_length") if "rest_length" in joined.columns else np.zeros(0)
    try:
        return SpringNetwork(places, ends, joined.numbers("stiffness"), rest)
    except TruespringError as error:
        raise MeshError(f"{springs}: {error}") from None


class _Table:
    """A CSV file with a line of names."""

    def __init__(self, file: Path, known: dict[str, Dimension | None], required: tuple[str, ...]) -> None:
        self._file, self._known = file, known
        try:
            with file.open(newline="", encoding="utf-8-sig") as stream:
                rows = [row for row in csv.reader(stream) if any(cell.strip() for cell in row)]
        except OSError as error:
            raise MeshError(f"{file} cannot be read: {error.strerror}") from None
        except (UnicodeDecodeError, csv.Error) as error:
            raise MeshError(f"{file} is no CSV file: {error}") from None
        if len(rows) < 2:
            raise MeshError(f"{file}: a line of column names and a row at least are wanted")
        self.columns: dict[str, int] = {}
        self._scales: dict[str, float] = {}
        for place, head in enumerate(rows[0]):
            self._column(head, place)
        missing = [name for name in required if name not in self.columns]
        if missing:
            raise MeshError(f"{file}:1: column {missing[0]} is missing; there are {', '.join(self.columns)}")
        self._rows = rows[1:]
        self.n_rows = len(self._rows)
        for number, row in enumerate(self._rows, 2):
            if len(row) != len(rows[0]):
                raise MeshError(f"{file}:{number}: {len(row)} values, there are {len(rows[0])} columns")

    def _column(self, head: str, place: int) -> None:
        read = re.fullmatch(r"\s*(\w+)\s*(?:\[(.+)\])?\s*", head)
        name = read[1] if read else head.strip()
        if read is None or name not in self._known:
            allowed = ", ".join(self._known)
            raise MeshError(
                f"{self._file}:1: column '{name}' is unknown{nearest(name, self._known)}; allowed: {allowed}"
            )
        if name in self.columns:
            raise MeshError(f"{self._file}:1: column {name} is there twice")
        dimension = self._known[name]
        if read[2] and dimension is None:
            raise MeshError(f"{self._file}:1: column {name} has no unit")
        try:
            self._scales[name] = to_si(f"1 {read[2]}", dimension) if read[2] and dimension else 1.0
        except TruespringError as error:
            raise MeshError(f"{self._file}:1: {name}: {error}") from None
        self.columns[name] = place

    def texts(self, name: str) -> list[str]:
        return [row[self.columns[name]].strip() for row in self._rows]

    def numbers(self, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
        return self._scales[name] * np.array(
            [self._value(name, row, float, "is no number") for row in range(self.n_rows)]
        )

    def known(self, name: str, row: int, number: dict[str, int]) -> int:
        place: int = self._value(name, row, lambda text: number[text], "names no node")
        return place

    def _value(self, name: str, row: int, convert: Callable[[str], Any], wrong: str) -> Any:
        text = self._rows[row][self.columns[name]].strip()
        try:
            return convert(text)
        except (ValueError, KeyError):
            raise MeshError(f"{self._file}:{row + 2}: {name} = '{text}' {wrong}") from None
