"""Read the path of a tool or grasp from a CSV file, which may have the paths of several."""

from pathlib import Path

import numpy as np

from truespring.columns import Columns
from truespring.errors import StudyError, nearest
from truespring.units import Dimension

#: Columns of a path, then those by which a row is chosen, then those that are only read by live sessions.
PATH_COLUMNS: dict[str, Dimension | None] = {
    "t": "time",
    "x": "length",
    "y": "length",
    "z": "length",
    "name": None,
    "kind": None,
    "frame": None,
    "radius": "length",
    "value": None,
}
#: The word in the column `kind` of the rows of a path.
PATH_PLACE = "place"
_AXES = ("x", "y", "z")


def read_path(file: Path, name: str) -> list[list[float]]:
    """Return the rows of place on the way and coordinates [m] in a file, those of a name if it has a column of names.

    Rows whose column `kind`, if there is one, is not "place" are skipped.

    Raises StudyError with file, line and column for a value that is no finite number and for a place on the way that
    does not ascend, and if no row has the name.
    """
    table = Columns(file, PATH_COLUMNS, ("t", "x", "y"), StudyError, form="t,name,x,y,z")
    rows = _rows_of(table, file, name)
    columns = ["t", *(axis for axis in _AXES if axis in table.columns)]
    values = np.stack([table.numbers(column, rows) for column in columns], axis=1)
    wrong = np.argwhere(~np.isfinite(values))
    if len(wrong):
        row, column = wrong[0]
        raise StudyError(f"{file}:{table.line(rows[row])}: {columns[column]} = {values[row, column]} is not finite")
    back = np.flatnonzero(np.diff(values[:, 0]) <= 0)
    if len(back):
        row = int(back[0]) + 1
        raise StudyError(
            f"{file}:{table.line(rows[row])}: t = {values[row, 0]:g} is not after {values[row - 1, 0]:g} in the row "
            f"before it: the places on the way of '{name}' must ascend"
        )
    return [[float(one) for one in row] for row in values]


def _rows_of(table: Columns, file: Path, name: str) -> list[int]:
    """Return the rows of a path, counted from 0."""
    rows = list(range(table.n_rows))
    if "kind" in table.columns:
        kinds = table.texts("kind")
        rows = [row for row in rows if kinds[row] == PATH_PLACE]
        if not rows:
            raise StudyError(f"{file}:1: no row has kind = '{PATH_PLACE}': these are the rows of paths")
    if "name" in table.columns:
        names = table.texts("name")
        known = list(dict.fromkeys(names[row] for row in rows))
        rows = [row for row in rows if names[row] == name]
        if not rows:
            raise StudyError(
                f"{file}:1: no row has name = '{name}'{nearest(name, known)}; names: {', '.join(known) or 'none'}"
            )
    return rows
