"""Read measured markers: tables of undeformed positions and displacements."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.columns import Columns
from truespring.errors import ReferenceFileError
from truespring.reference.checks import checked, refuse_unreadable
from truespring.reference.components import DISPLACEMENTS, PLACES, components
from truespring.reference.record import Level, Reading, Record
from truespring.units import Dimension

_AXES = "xyz"
_LENGTHS = ("x", "y", "z", "ux", "uy", "uz")
_KNOWN: dict[str, Dimension | None] = {"marker": None, "load_factor": None}
_KNOWN.update(dict.fromkeys(_LENGTHS, "length"))

_FORM = "marker,x [mm],y [mm],ux [mm],uy [mm]"
# Other names of columns.
_SYNONYMS = {
    "name": "marker",
    "id": "marker",
    "marker_id": "marker",
    "marker id": "marker",
    "load factor": "load_factor",
}


def _synonyms(names: Sequence[str]) -> dict[str, str]:
    """Return the column for each name of other programs, such as U of VIC-3D, "displacement:0" of ParaView."""
    places = components(names, PLACES)
    moves = components(names, DISPLACEMENTS) or components(names, (), "uvw")
    return {
        **{name: _SYNONYMS[name.lower()] for name in names if name.lower() in _SYNONYMS},
        **{name: axis for axis, name in places.items()},
        **{name: f"u{axis}" for axis, name in moves.items()},
    }


def read_markers(file: Path, reading: Reading | None = None, undeformed: Path | None = None) -> Record:
    """Read markers from CSV files whose first line names the columns.

    Columns are x, y, in space z, for the undeformed position; ux, uy, uz for the displacement; optional are `marker`, a
    name, and `load_factor`, whose rows of equal value are a level. Numbers are in metres, or in the unit given in the
    column's name: "x [mm]", "x (mm)", "x_mm". The columns of VIC-3D (X, Y, Z, U, V, W) and ParaView ("Points:0",
    "displacement:0") are recognised; other columns are skipped, with a note.

    Args:
        file: undeformed positions and displacements; with `undeformed`, deformed positions.
        reading: called with the fraction that has been read.
        undeformed: undeformed positions; markers are matched by name, or by row if they have no names.

    Returns a record of kind "csv" in metres. Raises ReferenceFileError, with file and line, if a file is damaged, a
    level has other markers than the first, or there is no displacement.
    """
    data = _columns(file)
    notes = _notes(data, file)
    axes = [axis for axis in _AXES if axis in data.columns]
    moved = [axis for axis in _AXES if f"u{axis}" in data.columns]
    if undeformed is None and not moved:
        if data.unknown:
            data.raise_unknown()
        raise ReferenceFileError(
            f"{file}: there is no displacement: add columns {', '.join(f'u{axis}' for axis in axes)}, or add a second "
            f"file with the undeformed markers (--undeformed); the first line may be: {_FORM}"
        )
    if undeformed is not None and moved:
        raise ReferenceFileError(f"{file} has the displacement in column u{moved[0]}: leave undeformed out")
    if moved and moved != axes:
        if data.unknown:
            data.raise_unknown()
        raise ReferenceFileError(f"{file}:1: positions have {', '.join(axes)}, displacements u{', u'.join(moved)}")
    groups = _levels(data)
    rest = data if undeformed is None else _columns(undeformed)
    rest_rows = groups[0][1] if undeformed is None else np.arange(rest.n_rows)
    rest_axes = [axis for axis in _AXES if axis in rest.columns]
    if rest_axes != axes:
        raise ReferenceFileError(
            f"{file}:1: positions have {', '.join(axes)}, those in {undeformed} {', '.join(rest_axes)}"
        )
    names, points = _names(rest, rest_rows, undeformed or file), _in_space(rest, axes)[rest_rows]
    places = _in_space(data, axes)
    levels = []
    for load_factor, unordered in groups:
        rows = _in_order(data, unordered, names, len(points), load_factor, file)
        if undeformed is not None:
            levels.append(Level(load_factor, places[rows] - points))
            continue
        _refuse_other_rest(data, places[rows], points, rows, file)
        levels.append(Level(load_factor, _in_space(data, axes, "u")[rows]))
    if reading:
        reading(1.0)
    return checked(Record(file, "csv", points, {}, tuple(levels), names, notes, in_load_factors=True))


def _columns(file: Path) -> Columns:
    refuse_unreadable(file)
    return Columns(file, _KNOWN, ("x", "y"), ReferenceFileError, _synonyms, _FORM)


def _notes(data: Columns, file: Path) -> tuple[str, ...]:
    """Return notes on the columns; raise ReferenceFileError if only positions, or only displacements, have units."""
    without = [name for name in _LENGTHS if name in data.columns and not data.units[name]]
    having = [name for name in _LENGTHS if name in data.columns and data.units[name]]
    notes = []
    if data.unknown:
        notes.append(f"ignored columns: {', '.join(head.strip() for head in data.unknown)}")
    if without and having:
        if {name[0] for name in without}.isdisjoint(name[0] for name in having) and _are_halves(without, having):
            raise ReferenceFileError(
                f"{file}:1: column {having[0]} is in {data.units[having[0]]}, {without[0]} has no unit: is it in "
                f"metres? Write {without[0]} [m], or {without[0]} [{data.units[having[0]]}]"
            )
        notes.append(f"columns without a unit are in metres: {', '.join(without)}")
    return tuple(notes)


def _are_halves(without: Sequence[str], having: Sequence[str]) -> bool:
    """Return whether one list holds only positions and the other only displacements."""
    return len({name[0] == "u" for name in without}) == len({name[0] == "u" for name in having}) == 1


def _in_space(data: Columns, axes: list[str], quantity: str = "") -> Floats:
    """Return the columns of a vector [m], zero for missing axes, shape (n_rows, 3)."""
    values = np.zeros((data.n_rows, 3))
    for axis in axes:
        values[:, _AXES.index(axis)] = data.numbers(quantity + axis)
    return values


def _levels(data: Columns) -> list[tuple[float, Ints]]:
    """Return each load factor and its rows, in the file's order."""
    if "load_factor" not in data.columns:
        return [(1.0, np.arange(data.n_rows))]
    load_factor = data.numbers("load_factor")
    return [(value, np.flatnonzero(load_factor == value)) for value in dict.fromkeys(load_factor.tolist())]


def _names(data: Columns, rows: Ints, file: Path) -> tuple[str, ...]:
    """Return the names of the markers in `rows`, empty if the file has no names."""
    if "marker" not in data.columns:
        return ()
    texts = data.texts("marker")
    first: dict[str, int] = {}
    for row in rows.tolist():
        if texts[row] in first:
            raise ReferenceFileError(
                f"{file}:{data.line(row)}: marker '{texts[row]}' is defined twice, first in line "
                f"{data.line(first[texts[row]])}: use a column load_factor for several levels"
            )
        first[texts[row]] = row
    return tuple(first)


def _in_order(
    data: Columns, rows: Ints, names: tuple[str, ...], n_markers: int, load_factor: float, file: Path
) -> Ints:
    """Return the rows of a level in the order of the undeformed markers; raise if the markers differ."""
    level = f"at load_factor {load_factor:g}" if "load_factor" in data.columns else "here"
    if bool(names) != ("marker" in data.columns):
        raise ReferenceFileError(f"{file}:1: only one of both files has a column marker: add it to both, or to none")
    if not names and len(rows) != n_markers:
        raise ReferenceFileError(
            f"{file}: {len(rows)} markers are {level}, {n_markers} are undeformed: add a column marker with their names"
        )
    if not names:
        return rows
    own = _names(data, rows, file)
    other = set(names) ^ set(own)
    if other:
        which = next(name for name in (*own, *names) if name in other)
        where = f"is there only {level}" if which in own else f"is missing {level}"
        raise ReferenceFileError(f"{file}: marker '{which}' {where}: all levels need the same markers")
    row = dict(zip(own, rows.tolist(), strict=True))
    return np.array([row[name] for name in names])


def _refuse_other_rest(data: Columns, places: Floats, points: Floats, rows: Ints, file: Path) -> None:
    """Raise ReferenceFileError if the undeformed position of a marker differs from that in the first level."""
    other = (places != points).any(axis=1) & np.isfinite(points).all(axis=1)
    if other.any():
        where = data.line(int(rows[other.argmax()]))
        raise ReferenceFileError(
            f"{file}:{where}: the undeformed position of this marker differs from that in the first level"
        )
