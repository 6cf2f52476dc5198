"""Read unstructured grids of .vtkhdf files, HDF5 files of VTK, at each of their steps.

Source: "VTKHDF format specification", https://docs.vtk.org/en/latest/vtk_file_formats/vtkhdf_file_format/
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truespring.errors import MeshError, ReferenceFileError
from truespring.mesh.files.vtk_grid import Grid
from truespring.mesh.files.vtk_pieces import one_grid

_SIGNATURE = b"\x89HDF\r\n\x1a\n"
# Version of the format that is known.
_MAJOR = 2


class TimedGrid(NamedTuple):
    """A grid of a series: its time, the file that it is from, and the fraction of the series that has been read."""

    time: float
    grid: Grid
    file: Path
    share: float


def is_hdf5(head: bytes) -> bool:
    """Return whether a file begins as an HDF5 file."""
    return head.startswith(_SIGNATURE)


def read_vtkhdf(file: Path) -> Iterator[TimedGrid]:
    """Yield the grid of each step; without steps, one of time 1.

    Raises ReferenceFileError if the file is damaged, has other contents than an unstructured grid, or h5py is not
    installed.
    """
    try:
        import h5py
    except ImportError:
        raise ReferenceFileError(f"{file}: h5py is not installed: pip install 'truespring[vtkhdf]'") from None
    try:
        with h5py.File(file, "r") as root:
            yield from _steps(_checked(root, file), file)
    except (MeshError, OSError, LookupError, ValueError, TypeError, RuntimeError, MemoryError) as error:
        raise ReferenceFileError(f"{file} is no .vtkhdf file, or a damaged one: {error}") from None


def _checked(root: Any, file: Path) -> Any:
    """Return the group of the grid; raise ReferenceFileError if it is missing or of another type."""
    if "VTKHDF" not in root:
        raise ReferenceFileError(f"{file} is an HDF5 file, but not of VTK: it has no group VTKHDF")
    grid = root["VTKHDF"]
    kind = np.bytes_(grid.attrs["Type"]).decode("utf-8", "replace")
    if kind != "UnstructuredGrid":
        raise ReferenceFileError(
            f"{file} has type '{kind[:40]}', supported is UnstructuredGrid: in ParaView, apply Merge Blocks or Append "
            "Datasets and save it again"
        )
    version = np.ravel(grid.attrs["Version"]).tolist()
    if version[0] > _MAJOR:
        raise ReferenceFileError(f"{file} has version {version} of VTKHDF, supported is {_MAJOR}: save it as .vtu")
    return grid


def _steps(grid: Any, file: Path) -> Iterator[TimedGrid]:
    steps = grid.get("Steps")
    times = [1.0] if steps is None else [float(time) for time in steps["Values"][:]]
    for number, time in enumerate(times):
        yield TimedGrid(time, _at(grid, steps, number), file, (number + 1) / len(times))


def _at(grid: Any, steps: Any, number: int) -> Grid:
    """Return the grid of a step, its parts joined."""
    counts = {name: grid[name][:] for name in ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds")}
    first, n_parts = 0, len(counts["NumberOfPoints"])
    if steps is not None:
        first = _entry(steps, "PartOffsets", number)
        n_parts = _entry(steps, "NumberOfParts", number) if "NumberOfParts" in steps else 1
    places = {
        name: _entry(steps, f"{what}Offsets", number)
        for name, what in (("Points", "Point"), ("Types", "Cell"), ("Connectivity", "ConnectivityId"))
    }
    places["Offsets"] = places["Types"] + first  # each part has an offset more than cells
    arrays = {
        kind: {name: _entry(steps, f"{kind}Offsets/{name}", number) for name in grid.get(kind, ())}
        for kind in ("PointData", "CellData")
    }
    parts = []
    for part in range(first, first + n_parts):
        n_points, n_cells, n_ids = (int(count[part]) for count in counts.values())
        parts.append(_part(grid, places, arrays, (n_points, n_cells, n_ids)))
        lengths = {"Points": n_points, "Types": n_cells, "Connectivity": n_ids, "Offsets": n_cells + 1}
        places = {name: place + lengths[name] for name, place in places.items()}
        arrays = {
            kind: {name: place + size for name, place in known.items()}
            for (kind, known), size in zip(arrays.items(), (n_points, n_cells), strict=True)
        }
    return one_grid(parts)


def _part(grid: Any, places: Mapping[str, int], arrays: Mapping[str, Mapping[str, int]], counts: Any) -> Grid:
    """Return a part, whose arrays begin at the given rows."""
    n_points, n_cells, n_ids = counts
    of_points, of_cells = (
        {name: _rows(grid[f"{kind}/{name}"], place, size) for name, place in known.items()}
        for (kind, known), size in zip(arrays.items(), (n_points, n_cells), strict=True)
    )
    return Grid(
        _rows(grid["Points"], places["Points"], n_points).astype(float),
        _rows(grid["Offsets"], places["Offsets"], n_cells + 1).astype(np.int64),
        _rows(grid["Connectivity"], places["Connectivity"], n_ids).astype(np.int64),
        _rows(grid["Types"], places["Types"], n_cells).astype(np.int64),
        of_points,
        of_cells,
    )


def _entry(steps: Any, name: str, number: int) -> int:
    """Return a value of a step, 0 without steps."""
    return 0 if steps is None or name not in steps else int(np.ravel(steps[name][number])[0])


def _rows(dataset: Any, first: int, count: int) -> NDArray[Any]:
    """Return rows of a dataset; raise ValueError if it ends before."""
    found = np.asarray(dataset[first : first + count])
    if first < 0 or len(found) != count:
        raise ValueError(f"{dataset.name} has {len(dataset)} rows, {first + count} are needed")
    return found
