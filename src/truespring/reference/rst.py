"""Read results of Ansys Mechanical APDL, .rst, by ansys-mapdl-reader.

On a damaged file that library may crash, exhaust the memory or hang: it runs in a separate process, which writes its
arrays to files.
"""

import importlib.util
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import ReferenceFileError
from truespring.mesh.files.contents import places
from truespring.opening import open_file
from truespring.reference.checks import checked, refuse_unreadable, without_modes
from truespring.reference.record import Level, Reading, Record
from truespring.reference.vtk_cells import VTK_EMPTY, sized

_CHILD = "import sys; from truespring.reference.rst import unpack; unpack(sys.argv[1], sys.argv[2])"

# Limits beyond which a file counts as damaged: time without a further result set [s] and [s/byte], memory [byte].
_PATIENCE, _SLOWEST = 60.0, 1e-6
_MEMORY, _MEMORY_PER_BYTE = 2 << 30, 50

# Words of four bytes. The first record begins with 100, and its code of results is 12. The second record is the header
# of the results, preceded by its length: 80; 40 in Ansys before 14, whose files were smaller than 2^32 words.
# Source: file fdresu.inc of Ansys, whose names the library's _rst_keys.py lists.
_LENGTH, _HEAD, _WORDS = 103, 105, 185
_RESULTS = 12
_MOST_SETS, _KIND, _N_SETS, _END, _LONG_END = 3, 7, 8, 9, 22
_POINTERS = slice(10, 16)  # to result sets, times, steps, elements, nodes, geometry
_HIGH = (40, 41, 42, 44, 45, 46)  # their upper words
_MODES = (1, 2)  # buckling and modal analysis
_AGAIN = "copy it again from the folder in which Ansys wrote it"


def is_rst(head: bytes) -> bool:
    """Return whether the beginning of a file is that of an Ansys result."""
    words = (np.frombuffer(head[:12], f"{order}i4") for order in "<>" if len(head) >= 12)
    return any(word[0] == 100 and word[2] == _RESULTS for word in words)


def read_rst(file: Path, reading: Reading | None = None) -> Record:
    """Read the nodal displacement of all result sets in a .rst file of Ansys.

    Needs `pip install 'truespring[ansys]'`. Cells are those that the library passes to VTK.

    Args:
        file: the result.
        reading: called with the fraction of the result sets that has been read.

    Returns a record of kind "rst", whose names are the node numbers and whose times are those of the result sets.
    Raises ReferenceFileError if the library is missing, or the file is damaged, truncated or no structural result.
    """
    refuse_unreadable(file)
    if importlib.util.find_spec("ansys") is None or importlib.util.find_spec("ansys.mapdl.reader") is None:
        raise ReferenceFileError(f"{file}: results of Ansys need a further library: pip install 'truespring[ansys]'")
    n_sets, is_mode = _header(file)
    with tempfile.TemporaryDirectory() as name:
        _run(file, Path(name), n_sets, reading)
        return checked(_record(file, Path(name), is_mode))


def _header(file: Path) -> tuple[int, bool]:
    """Return the number of result sets, and whether they are modes; raise if the header contradicts the file."""
    with open_file(file, ReferenceFileError) as stream:
        data = stream.read(4 * _WORDS)
    order = ">" if data[:4] == (100).to_bytes(4, "big") else "<"
    words = np.frombuffer(data[: len(data) // 4 * 4], f"{order}i4").astype(np.int64)
    if len(words) < 3 or words[0] != 100 or words[2] != _RESULTS:
        raise ReferenceFileError(f"{file} is no .rst file of Ansys: its first words are not 100 and 12")
    if len(words) < _WORDS:
        raise ReferenceFileError(f"{file} is truncated in its header: {_AGAIN}")
    length, size = int(words[_LENGTH]), file.stat().st_size
    head = np.where(
        np.arange(_WORDS - _HEAD) < length, words[_HEAD:_WORDS], 0
    )  # words missing in an older header are 0
    end = int(head[_LONG_END] % 2**32 + (head[_LONG_END + 1] << 32)) or int(head[_END])
    if 4 * end > size:
        raise ReferenceFileError(f"{file} is truncated: its header states {4 * end:,} bytes, it has {size:,}: {_AGAIN}")
    pointers = head[_POINTERS] % 2**32 + (head[list(_HIGH)] << 32)
    n_sets = int(head[_N_SETS])
    if not 0 <= n_sets <= head[_MOST_SETS] <= size or (pointers < 0).any() or (pointers >= end).any():
        raise ReferenceFileError(f"{file} is damaged in its header: {_AGAIN}")
    if not n_sets:
        raise ReferenceFileError(f"{file} has no result set: was it solved?")
    return n_sets, int(head[_KIND]) in _MODES


def _run(file: Path, folder: Path, n_sets: int, reading: Reading | None) -> None:
    """Unpack a file into a folder in a separate process; raise if it fails, hangs or exhausts the memory."""
    import psutil

    size = file.stat().st_size
    patience, memory = _PATIENCE + _SLOWEST * size, _MEMORY + _MEMORY_PER_BYTE * size
    with (folder / "log.txt").open("wb") as said:
        command = [sys.executable, "-P", "-c", _CHILD, str(file.resolve()), str(folder)]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=said)
    try:
        done, since = 0, time.monotonic()
        while process.poll() is None:
            time.sleep(0.02)
            there = len(list(folder.glob("set*.npy")))
            if there > done:
                done, since = there, time.monotonic()
                if reading and done < n_sets:
                    reading(done / n_sets)
            if time.monotonic() - since > patience:
                raise ReferenceFileError(f"{file} is damaged: nothing was read for {patience:.0f} s: {_AGAIN}")
            try:
                used = psutil.Process(process.pid).memory_info().rss
            except psutil.Error:
                continue  # it has just ended
            if used > memory:
                raise ReferenceFileError(f"{file} is damaged: reading it needed {used >> 20} MiB: {_AGAIN}")
    finally:
        process.kill()
        process.wait()
    if (folder / "error.txt").exists():
        raise ReferenceFileError(f"{file}: {(folder / 'error.txt').read_text(encoding='utf-8')}")
    if process.returncode:
        lines = (folder / "log.txt").read_text(encoding="utf-8", errors="replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "its reader was terminated")
        raise ReferenceFileError(f"{file} is damaged or not supported ({last[:200]}): {_AGAIN}")
    if reading:
        reading(1.0)


def _record(file: Path, folder: Path, is_mode: bool) -> Record:
    with np.load(folder / "mesh.npz") as mesh:
        numbers, points, types, times = mesh["numbers"], mesh["points"], mesh["types"], mesh["times"]
        cells, n_lost = sized(types, mesh["offsets"], mesh["connectivity"], numbers < 1, file)
    own = np.flatnonzero(numbers > 0)
    row = np.full(len(numbers), -1)
    row[own] = np.arange(len(own))
    levels = [
        Level(time, np.load(one)[own])
        for time, one in zip(times.tolist(), sorted(folder.glob("set*.npy")), strict=True)
    ]
    kept, notes = without_modes(levels, [is_mode] * len(levels))
    n_empty = int((types == VTK_EMPTY).sum())
    if n_empty:
        notes += (f"{n_empty} elements of types without volume were left out",)
    if n_lost:
        notes += (f"{n_lost} cells lack some of their mid-edge nodes and are reduced to their corners",)
    placed = {name: row[nodes] for name, nodes in cells.items()}
    return Record(file, "rst", points[own], placed, kept, tuple(map(str, numbers[own].tolist())), notes)


# --- in the other process -------------------------------------------------------------------------


def unpack(file: str, folder: str) -> None:
    """Read a file by the library; write its arrays to a folder: mesh.npz, set000000.npy, ..., or error.txt."""
    from ansys.mapdl import reader

    result = reader.read_binary(file)
    why = _why_not(result)
    if why:
        (Path(folder) / "error.txt").write_text(why, encoding="utf-8")
        return
    grid = result.grid
    numbers = np.asarray(grid.point_data["ansys_node_num"], dtype=np.int64)
    offsets = grid.cell_offsets if hasattr(grid, "cell_offsets") else grid.offset  # as pyvista called it before 0.49
    arrays: dict[str, Any] = {
        "numbers": numbers,
        "points": np.asarray(grid.points, dtype=np.float64),
        "types": np.asarray(grid.celltypes, dtype=np.int64),
        "times": np.asarray(result.time_values, dtype=np.float64),
        "connectivity": np.asarray(grid.cell_connectivity, dtype=np.int64),
        "offsets": np.asarray(offsets, dtype=np.int64),
    }
    np.savez(Path(folder) / "mesh.npz", **arrays)
    for number in range(result.nsets):
        np.save(Path(folder) / f"set{number:06d}.npy", _displacement(result, number, numbers))


def _why_not(result: Any) -> str:
    if not hasattr(result, "nodal_solution"):
        return "this is no result file of Ansys"
    if result.n_sector > 1:
        return "results of a sector of a cyclic body are not supported: expand them in Ansys"
    if not {"UX", "UY", "UZ"} & set(result.result_dof(0)):
        return f"it has {', '.join(result.result_dof(0))}, no displacement"
    return ""


def _displacement(result: Any, number: int, numbers: Ints) -> Floats:
    """Return the displacement at the numbered nodes, NaN where the set has none, shape (n_nodes, 3)."""
    nodes, values = result.nodal_solution(number)
    names = result.result_dof(number)
    displacement = np.full((len(numbers), 3), np.nan)
    rows = places(numbers, np.asarray(nodes, dtype=np.int64))
    known = rows >= 0  # no cell that is read has the others
    for axis, name in enumerate(("UX", "UY", "UZ")):
        displacement[rows[known], axis] = values[known, names.index(name)] if name in names else 0.0
    return displacement
