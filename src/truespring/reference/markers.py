"""Measured markers: tables of where each was at rest and how far it has moved."""

from pathlib import Path

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ReferenceFileError
from truespring.reference.checks import checked, refuse_unreadable
from truespring.reference.record import Level, Reading, Record
from truespring.table import Table
from truespring.units import Dimension

_AXES = "xyz"
_LENGTHS = ("x", "y", "z", "ux", "uy", "uz")
_KNOWN: dict[str, Dimension | None] = {"marker": None, "load_factor": None}
_KNOWN.update(dict.fromkeys(_LENGTHS, "length"))


def read_markers(file: Path, reading: Reading | None = None, undeformed: Path | None = None) -> Record:
    """Read the positions of markers from CSV files with a line of column names.

    Columns are x, y and in space z; ux, uy, uz, the displacement; and, where there are any, `marker`, a name, and
    `load_factor`: rows with one value of it are a level. Numbers are metres, or in the unit behind a column's name:
    "x [mm]".

    Args:
        file: where the markers were at rest, and their displacement; with `undeformed`, where they have gone.
        reading: is called with the share that is read.
        undeformed: where they were at rest; markers are the same by name, or by row where they have none.

    Returns a record of kind "csv" in metres. Raises ReferenceFileError with file and line where a table is damaged, a
    level has other markers than the first, or there is no displacement.
    """
    table = _table(file)
    axes = [axis for axis in _AXES if axis in table.columns]
    moved = [axis for axis in _AXES if f"u{axis}" in table.columns]
    if undeformed is None and not moved:
        raise ReferenceFileError(
            f"{file}: there is no displacement: add columns {', '.join(f'u{axis}' for axis in axes)}, or give a second "
            "file with the markers at rest (--undeformed)"
        )
    if undeformed is not None and moved:
        raise ReferenceFileError(f"{file} has the displacement in column u{moved[0]}: leave undeformed out")
    if moved and moved != axes:
        raise ReferenceFileError(f"{file}:1: places have {', '.join(axes)}, displacements u{', u'.join(moved)}")
    groups = _levels(table)
    rest = table if undeformed is None else _table(undeformed)
    rest_rows = groups[0][1] if undeformed is None else np.arange(rest.n_rows)
    rest_axes = [axis for axis in _AXES if axis in rest.columns]
    if rest_axes != axes:
        raise ReferenceFileError(
            f"{file}:1: places have {', '.join(axes)}, those in {undeformed} {', '.join(rest_axes)}"
        )
    names, points = _names(rest, rest_rows, undeformed or file), _in_space(rest, axes)[rest_rows]
    places = _in_space(table, axes)
    levels = []
    for load_factor, unordered in groups:
        rows = _in_order(table, unordered, names, len(points), load_factor, file)
        if undeformed is not None:
            levels.append(Level(load_factor, places[rows] - points))
            continue
        _refuse_other_rest(table, places[rows], points, rows, file)
        levels.append(Level(load_factor, _in_space(table, axes, "u")[rows]))
    if reading:
        reading(1.0)
    return checked(Record(file, "csv", points, {}, tuple(levels), names))


def _table(file: Path) -> Table:
    refuse_unreadable(file)
    return Table(file, _KNOWN, ("x", "y"), ReferenceFileError)


def _in_space(table: Table, axes: list[str], quantity: str = "") -> Floats:
    """Return a column for each axis, of zeros where there is none, shape (n_rows, 3)."""
    values = np.zeros((table.n_rows, 3))
    for axis in axes:
        values[:, _AXES.index(axis)] = table.numbers(quantity + axis)
    return values


def _levels(table: Table) -> list[tuple[float, Ints]]:
    """Return each load factor and its rows, in the file's order."""
    if "load_factor" not in table.columns:
        return [(1.0, np.arange(table.n_rows))]
    load_factor = table.numbers("load_factor")
    return [(value, np.flatnonzero(load_factor == value)) for value in dict.fromkeys(load_factor.tolist())]


def _names(table: Table, rows: Ints, file: Path) -> tuple[str, ...]:
    """Return the names of the markers in some rows, none where the table has none."""
    if "marker" not in table.columns:
        return ()
    texts = table.texts("marker")
    first: dict[str, int] = {}
    for row in rows.tolist():
        if texts[row] in first:
            raise ReferenceFileError(
                f"{file}:{table.line(row)}: marker '{texts[row]}' is there twice, first in line "
                f"{table.line(first[texts[row]])}: several levels need a column load_factor"
            )
        first[texts[row]] = row
    return tuple(first)


def _in_order(table: Table, rows: Ints, names: tuple[str, ...], n_markers: int, load_factor: float, file: Path) -> Ints:
    """Return the rows of a level in the order of the markers at rest; raise where the markers are others."""
    level = f"at load_factor {load_factor:g}" if "load_factor" in table.columns else "here"
    if bool(names) != ("marker" in table.columns):
        raise ReferenceFileError(f"{file}:1: only one of both files has a column marker: add it to both, or to none")
    if not names and len(rows) != n_markers:
        raise ReferenceFileError(f"{file}: {len(rows)} markers are {level}, {n_markers} at rest: give them names")
    if not names:
        return rows
    own = _names(table, rows, file)
    other = set(names) ^ set(own)
    if other:
        which = next(name for name in (*own, *names) if name in other)
        where = f"is there only {level}" if which in own else f"is missing {level}"
        raise ReferenceFileError(f"{file}: marker '{which}' {where}: all levels need the same markers")
    row = dict(zip(own, rows.tolist(), strict=True))
    return np.array([row[name] for name in names])


def _refuse_other_rest(table: Table, places: Floats, points: Floats, rows: Ints, file: Path) -> None:
    """Raise where a marker rests elsewhere than in the first level."""
    other = (places != points).any(axis=1) & np.isfinite(points).all(axis=1)
    if other.any():
        where = table.line(int(rows[other.argmax()]))
        raise ReferenceFileError(f"{file}:{where}: this marker rests elsewhere than in the first level")
