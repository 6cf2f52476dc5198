"""Results as VTK's unstructured grids: .vtu, legacy .vtk, and .pvd, a series of .vtu files."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError, ReferenceFileError, nearest
from truespring.mesh.files.heads import HEAD, format_by_head, is_vtk, is_vtk_xml
from truespring.mesh.files.vtk import Grid, contents, read_legacy_grid
from truespring.mesh.files.vtu import read_grid
from truespring.opening import open_file
from truespring.reference.checks import checked, refuse_unreadable
from truespring.reference.record import Level, Reading, Record
from truespring.reference.vtk_cells import named, refuse_unknown

# What other programs call the displacement, in small letters.
_NAMES = ("displacement", "displacements", "u", "disp")

_GRIDS: Mapping[str, Callable[[bytes], Grid]] = {"vtu": read_grid, "vtk": read_legacy_grid}
_KINDS = {".vtu": is_vtk_xml("UnstructuredGrid"), ".vtk": is_vtk, ".pvd": is_vtk_xml("Collection")}


def read_vtk_result(file: Path, reading: Reading | None = None, field: str | None = None) -> Record:
    """Read the displacement in a .vtu or .vtk file, one level of time 1, or in the series of a .pvd file.

    Points must stand where they were at rest. `strain_energy` of the cells of a file that truespring wrote for
    elements (J a cell) is summed to the level's energy; what other programs call so may be a density, and what
    springs have lacks that of volume terms.

    Args:
        file: the result.
        reading: is called with the share that is read, after each file of a series.
        field: name of the displacement among the points' arrays; by default the only one that is called
            displacement, displacements, u or disp in any spelling.

    Returns a record of kind "vtu", "vtk" or "pvd". Raises ReferenceFileError where a file is damaged, the displacement
    is not found, or the files of a series do not share points and cells.
    """
    refuse_unreadable(file)
    kind = _kind(file)
    series = _series(file) if kind == "pvd" else [(1.0, file)]
    first: Record | None = None
    levels: list[Level] = []
    for number, (time, one) in enumerate(series, 1):
        grid = _grid(one)
        record = Record(one, kind, grid.points, _cells(grid, one), (Level(time, *_values(grid, field, one)),))
        first = first or record
        _refuse_other_mesh(record, first)
        levels += record.levels
        if reading:
            reading(number / len(series))
    assert first is not None  # _series holds one at least
    return checked(Record(file, kind, first.points, first.cells, tuple(levels)))


def _kind(file: Path) -> str:
    """The format of a file without the point: by its content, else its suffix."""
    with open_file(file, ReferenceFileError) as stream:
        head = stream.read(HEAD)
    return (format_by_head(file.suffix, head, _KINDS) or ".vtu").lstrip(".")


def _series(file: Path) -> list[tuple[float, Path]]:
    """Return times and files of a .pvd file."""
    try:
        root = ElementTree.fromstring(file.read_bytes())
    except OSError as error:
        raise ReferenceFileError(f"{file} cannot be read: {error.strerror}") from None
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise ReferenceFileError(f"{file} is no .pvd file, or not a whole one: {error}") from None
    entries = root.findall("Collection/DataSet")
    if root.tag != "VTKFile" or not entries:
        raise ReferenceFileError(f"{file} names no file: a VTKFile of type Collection with DataSets is wanted")
    series: list[tuple[float, Path]] = []
    for number, entry in enumerate(entries, 1):
        text, name = entry.get("timestep", str(number)), entry.get("file", "")
        try:
            time = float(text)
        except ValueError:
            raise ReferenceFileError(
                f'{file}: DataSet {number} has timestep="{text[:40]}", which is no number'
            ) from None
        one = file.parent / name
        if one.suffix.lower() != ".vtu":
            raise ReferenceFileError(f"{file}: DataSet {number} names '{name[:80]}'; .vtu files are read")
        if not one.is_file():
            raise ReferenceFileError(
                f"{file}: DataSet {number} names '{name[:80]}', which is not there: keep it beside"
            )
        if time in (known for known, _ in series):
            raise ReferenceFileError(f"{file}: time {time:g} is there twice: merge the parts of the body into one grid")
        series.append((time, one))
    return series


def _grid(file: Path) -> Grid:
    refuse_unreadable(file)
    try:
        return _GRIDS.get(_kind(file), read_grid)(file.read_bytes())
    except OSError as error:
        raise ReferenceFileError(f"{file} cannot be read: {error.strerror}") from None
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
                f"{file}: a {name} names points {nodes.min()} to {nodes.max()}, there are 0 to {len(grid.points) - 1}"
            )
    return cells


def _values(grid: Grid, field: str | None, file: Path) -> tuple[Floats, float | None]:
    """Return the displacement, shape (n_points, 3), and the energy, None where the file does not tell it."""
    vectors = {
        name: values for name, values in grid.point_arrays.items() if values.ndim == 2 and values.shape[1] in (2, 3)
    }
    there = f"vectors of the points are {', '.join(vectors)}" if vectors else "its points have no vectors"
    if field is not None and field not in vectors:
        raise ReferenceFileError(f"{file}: there is no vector '{field}'{nearest(field, vectors)}; {there}")
    known = [name for name in vectors if name.lower() in _NAMES] if field is None else [field]
    if len(known) != 1:
        which = f"{' and '.join(known)} may all be the displacement" if known else "none is called displacement"
        raise ReferenceFileError(f"{file}: {there}, {which}: name the right one by field (--field)")
    displacement = np.zeros((len(grid.points), 3))
    displacement[:, : vectors[known[0]].shape[1]] = vectors[known[0]]
    return displacement, _energy(grid)


def _energy(grid: Grid) -> float | None:
    is_ours = {"displacement", "reaction"} <= grid.point_arrays.keys() and "stress" in grid.cell_arrays
    energy: NDArray[Any] | None = grid.cell_arrays.get("strain_energy") if is_ours else None
    return None if energy is None or energy.ndim != 1 or not energy.size else float(energy.sum())


def _refuse_other_mesh(record: Record, first: Record) -> None:
    """Raise where a file of a series has other points or cells than its first."""
    if record is first:
        return
    if not np.array_equal(record.points, first.points):
        raise ReferenceFileError(
            f"{record.file}: its points are not those of {first.file.name}: all files of a series must have one mesh, "
            "at rest: save it before it is warped by the displacement"
        )
    same = record.cells.keys() == first.cells.keys()
    if not same or any(not np.array_equal(nodes, first.cells[name]) for name, nodes in record.cells.items()):
        raise ReferenceFileError(f"{record.file}: its cells are not those of {first.file.name}")
