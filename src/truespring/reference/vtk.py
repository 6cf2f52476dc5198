"""Read results in VTK files: grids and surfaces of all formats, in pieces, and series of .pvd and .vtkhdf files."""

import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError, ReferenceFileError, nearest
from truespring.mesh.files.heads import HEAD, format_by_head, is_vtk_xml
from truespring.mesh.files.vtk_file import VTK_FORMATS, read_vtk_grid
from truespring.mesh.files.vtk_grid import Grid, contents
from truespring.mesh.files.vtk_pieces import one_grid
from truespring.mesh.files.vtu import root_of
from truespring.opening import file_beside, open_file, read_file
from truespring.reference.checks import checked, refuse_unreadable
from truespring.reference.components import DISPLACEMENTS, components
from truespring.reference.record import Level, Reading, Record
from truespring.reference.vtk_cells import named, refuse_unknown
from truespring.reference.vtkhdf import TimedGrid, is_hdf5, read_vtkhdf

# Scalars of these names are the components of a displacement, as Elmer writes them.
_ALONE = "uvw"

#: Formats of results that `read_vtk_result` reads, by suffix.
RESULTS = {**VTK_FORMATS, ".pvd": is_vtk_xml("Collection"), ".vtkhdf": is_hdf5}


class _Part(NamedTuple):
    """A file of a series: time, part of the body, path."""

    time: float
    part: str
    file: Path


def read_vtk_result(file: Path, reading: Reading | None = None, field: str | None = None) -> Record:
    """Read the displacement in a VTK file, one level of time 1, or in the series of a .pvd or .vtkhdf file.

    Points must be at their undeformed positions. The cell array `strain_energy` [J] of finite elements written by
    truespring is summed to the energy of the level; in files of other programs it may be a density, and that of springs
    does not include volume terms.

    Args:
        file: the result.
        reading: called with the fraction that has been read, after each level of a series.
        field: name of the displacement among the point arrays; by default the only one called displacement,
            displacements, u, disp or deformation in upper or lower case, else scalars by such a name and an axis
            ("displacement 1", "disp:0", "u_x"), or u, v and w.

    Returns a record whose kind is the file's suffix. Raises ReferenceFileError if a file is damaged, the displacement
    is not found, or points or cells differ between the levels of a series.
    """
    refuse_unreadable(file)
    kind = _kind(file)
    notes: list[str] = []
    if kind == "vtkhdf":
        timed = read_vtkhdf(file)
    elif kind == "pvd":
        parts, notes = _series(file)
        timed = _grids(parts)
    else:
        timed = _grids([_Part(1.0, "", file)])
    first: Record | None = None
    levels: list[Level] = []
    for one in timed:
        displacement, remarks = _displacement(one.grid, field, one.file)
        cells = _cells(one.grid, one.file)
        level = Level(one.time, displacement, _energy(one.grid))
        record = Record(one.file, kind, one.grid.points, cells, (level,))
        first = first or record
        _refuse_other_mesh(record, first)
        levels.append(level)
        notes += [note for note in (*one.grid.notes, *remarks) if note not in notes]
        if reading:
            reading(one.share)
    if first is None:
        raise ReferenceFileError(f"{file} has no steps")
    return checked(Record(file, kind, first.points, first.cells, tuple(levels), notes=tuple(notes)))


def _grids(parts: Sequence[_Part]) -> Iterator[TimedGrid]:
    """Yield the grid of each time, of one or several files."""
    n_read = 0
    for time, members in itertools.groupby(parts, lambda part: part.time):
        files = [part.file for part in members]
        n_read += len(files)
        yield TimedGrid(time, one_grid([_grid(one) for one in files]), files[0], n_read / len(parts))


def _kind(file: Path) -> str:
    """Return the format of a file, such as "vtu": by its content, else by its suffix."""
    with open_file(file, ReferenceFileError) as stream:
        head = stream.read(HEAD)
    return (format_by_head(file.suffix, head, RESULTS) or ".vtu").lstrip(".")


def _series(file: Path) -> tuple[list[_Part], list[str]]:
    """Return the files of a .pvd file by ascending time, and notes."""
    try:
        root = root_of(read_file(file, ReferenceFileError))
    except MeshError as error:
        raise ReferenceFileError(f"{file} is no .pvd file, or an incomplete one: {error}") from None
    entries = root.findall("Collection/DataSet")
    if not entries:
        raise ReferenceFileError(f"{file} refers to no file: expected a VTKFile of type Collection with DataSets")
    parts: list[_Part] = []
    known: set[tuple[float, str]] = set()
    for number, entry in enumerate(entries, 1):
        place = f"{file}: DataSet {number}"
        time = _time(entry.get("timestep", str(number)), place)
        name = entry.get("file", "")
        if Path(name).suffix.lower() not in VTK_FORMATS:
            raise ReferenceFileError(
                f"{place} refers to '{name[:80]}', which is not supported; supported: {', '.join(VTK_FORMATS)}"
            )
        one = file_beside(file.parent, name, ReferenceFileError, f"{place} ")
        part = entry.get("part", "0")
        if (time, part) in known:
            raise ReferenceFileError(
                f"{file}: time {time:g} is defined twice: merge the parts of the body into one grid, or give each "
                "a different part (part=)"
            )
        known.add((time, part))
        parts.append(_Part(time, part, one))
    ordered = sorted(parts, key=lambda part: part.time)  # parts of one time keep their order
    is_other = [part.time for part in ordered] != [part.time for part in parts]
    return ordered, [f"the times of {file.name} do not ascend and were sorted"] if is_other else []


def _time(text: str, place: str) -> float:
    try:
        time = float(text)
    except ValueError:
        time = math.nan
    if not math.isfinite(time):
        raise ReferenceFileError(f'{place} has timestep="{text[:40]}", which is not a finite number')
    return time


def _grid(file: Path) -> Grid:
    refuse_unreadable(file)
    try:
        return read_vtk_grid(read_file(file, ReferenceFileError), file.parent)
    except MeshError as error:
        raise ReferenceFileError(f"{file}: {error}") from None


def _cells(grid: Grid, file: Path) -> dict[str, Ints]:
    try:
        found = contents(grid)
    except MeshError as error:
        raise ReferenceFileError(f"{file}: {error}") from None
    refuse_unknown(grid.types, file)
    cells = named(found.cells, file)
    for name, nodes in cells.items():
        if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(grid.points):
            raise ReferenceFileError(
                f"{file}: a {name} refers to points {nodes.min()} to {nodes.max()}, there are 0 to "
                f"{len(grid.points) - 1}"
            )
    return cells


def _displacement(grid: Grid, field: str | None, file: Path) -> tuple[Floats, list[str]]:
    """Return the displacement in the file's unit, shape (n_points, 3), and a note if it was read from components."""
    vectors = {
        name: values for name, values in grid.point_arrays.items() if values.ndim == 2 and values.shape[1] in (2, 3)
    }
    there = f"vectors of the points are {', '.join(vectors)}" if vectors else "its points have no vectors"
    parts = _parts(grid, field)
    if parts and field not in vectors and (field or not any(name.lower() in DISPLACEMENTS for name in vectors)):
        displacement = np.zeros((len(grid.points), 3))
        for axis, name in parts.items():
            displacement[:, "xyz".index(axis)] = grid.point_arrays[name]
        return displacement, [f"the displacement was read from {', '.join(parts.values())}"]
    if field is not None and field not in vectors:
        raise ReferenceFileError(f"{file}: there is no vector '{field}'{nearest(field, vectors)}; {there}")
    known = [name for name in vectors if name.lower() in DISPLACEMENTS] if field is None else [field]
    if len(known) != 1:
        which = f"{' and '.join(known)} may all be the displacement" if known else "none has the name displacement"
        raise ReferenceFileError(f"{file}: {there}, {which}: select one by field (--field)")
    displacement = np.zeros((len(grid.points), 3))
    displacement[:, : vectors[known[0]].shape[1]] = vectors[known[0]]
    return displacement, []


def _parts(grid: Grid, field: str | None) -> dict[str, str]:
    """Return the names of scalar displacement components by axis, of `field` if given; empty without them."""
    numbers = [name for name, values in grid.point_arrays.items() if values.ndim == 1 and values.dtype.kind == "f"]
    if field is not None:
        return components(numbers, (field.lower(),))
    return components(numbers, DISPLACEMENTS) or components(numbers, (), _ALONE)


def _energy(grid: Grid) -> float | None:
    is_ours = {"displacement", "reaction"} <= grid.point_arrays.keys() and "stress" in grid.cell_arrays
    energy: NDArray[Any] | None = grid.cell_arrays.get("strain_energy") if is_ours else None
    return None if energy is None or energy.ndim != 1 or not energy.size else float(energy.sum())


def _refuse_other_mesh(record: Record, first: Record) -> None:
    """Raise ReferenceFileError if points or cells differ from those of the first file of a series."""
    if record is first:
        return
    if not np.array_equal(record.points, first.points):
        raise ReferenceFileError(
            f"{record.file}: its points differ from those of {first.file.name}: all files of a series must have one "
            "undeformed mesh: save it before it is warped by the displacement"
        )
    same = record.cells.keys() == first.cells.keys()
    if not same or any(not np.array_equal(nodes, first.cells[name]) for name, nodes in record.cells.items()):
        raise ReferenceFileError(f"{record.file}: its cells differ from those of {first.file.name}")
