"""Write VTK unstructured grids with fields that change in time as one HDF5 file, .vtkhdf.

Source: "VTKHDF format specification", https://docs.vtk.org/en/latest/vtk_file_formats/vtkhdf_file_format/
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats, Ints, in_space
from truespring.errors import OutputError
from truespring.mesh.files.vtu_writing import listed_cells

_Arrays = Mapping[str, NDArray[Any]]

# Of the format: 2.0 was the first with steps.
_VERSION = (2, 0)
# Largest number of rows of a chunk, which is compressed and read as a whole.
_CHUNK = 1 << 16
# Level of gzip; higher ones take longer and save little.
_LEVEL = 4


class Step(NamedTuple):
    """A step of a series: time, and fields of points and cells by name, with the same names in all steps."""

    time: float
    point_arrays: _Arrays
    cell_arrays: _Arrays


def write_vtkhdf(file: Path, points: Floats, cells: Iterable[tuple[str, Ints]], steps: Iterable[Step]) -> None:
    """Write a grid and its fields in several steps; ParaView 5.12 and VTK 9.3 read them as a series.

    Points and cells are stored once. A field that is equal to that of the step before is not stored again.

    Args:
        file: the file.
        points: shape (n_points, 1 to 3); missing components are 0.
        cells: blocks of cells, as for `write_vtu`.
        steps: at least one; they are stored as they come, so that one is in memory at a time.

    Raises OutputError if h5py is not installed.
    """
    try:
        import h5py
    except ImportError:
        raise OutputError("h5py is not installed: pip install 'truespring[vtkhdf]'") from None
    listed = listed_cells(cells)
    with h5py.File(file, "w") as root:
        grid = root.create_group("VTKHDF")
        grid.attrs["Version"] = np.array(_VERSION, dtype=np.int64)
        grid.attrs["Type"] = np.bytes_("UnstructuredGrid")  # of fixed length, as VTK requires
        for name, values in {
            "Points": in_space(points),
            "Connectivity": listed.connectivity,
            "Offsets": np.concatenate([np.zeros(1, dtype=np.int64), listed.offsets]),
            "Types": listed.types,
        }.items():
            _Column(grid, name, values).add(values)
        for name, count in (
            ("NumberOfPoints", len(points)),
            ("NumberOfCells", len(listed.types)),
            ("NumberOfConnectivityIds", len(listed.connectivity)),
        ):
            grid[name] = np.array([count], dtype=np.int64)  # of one part
        _write_steps(grid, steps)


def _write_steps(grid: Any, steps: Iterable[Step]) -> None:
    """Write the fields, and the group that says where those of each step begin."""
    group = grid.create_group("Steps")
    times: list[float] = []
    columns: dict[str, dict[str, _Column]] = {"PointData": {}, "CellData": {}}
    for step in steps:
        times.append(step.time)
        for (kind, known), arrays in zip(columns.items(), (step.point_arrays, step.cell_arrays), strict=True):
            for name, values in arrays.items():
                if name not in known:
                    known[name] = _Column(grid, f"{kind}/{name}", values)
                known[name].add(values)
    group.attrs["NSteps"] = np.int64(len(times))
    group["Values"] = np.array(times)
    none = np.zeros(len(times), dtype=np.int64)
    for name in ("PartOffsets", "PointOffsets"):
        group[name] = none
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        group[name] = none[:, None]  # of the only topology
    group["NumberOfParts"] = none + 1
    for kind, known in columns.items():
        for name, column in known.items():
            group[f"{kind}Offsets/{name}"] = np.array(column.offsets, dtype=np.int64)


class _Column:
    """A dataset that grows by rows.

    Attributes:
        offsets: the first row of each array that was added.
    """

    def __init__(self, group: Any, name: str, values: NDArray[Any]) -> None:
        """Create the dataset for arrays of the form of `values`."""
        self.offsets: list[int] = []
        self._last: NDArray[Any] | None = None
        rest = values.shape[1:]
        chunk = (max(1, min(len(values), _CHUNK)), *rest)
        form = {"maxshape": (None, *rest), "chunks": chunk, "compression": _LEVEL, "shuffle": True}
        self._rows = group.create_dataset(name, (0, *rest), values.dtype, **form)

    def add(self, values: NDArray[Any]) -> None:
        """Add an array, unless it equals the last one."""
        if self._last is not None and np.array_equal(self._last, values, equal_nan=values.dtype.kind == "f"):
            self.offsets.append(self.offsets[-1])
            return
        first = len(self._rows)
        self._rows.resize(first + len(values), axis=0)
        self._rows[first:] = values
        self.offsets.append(first)
        self._last = values
