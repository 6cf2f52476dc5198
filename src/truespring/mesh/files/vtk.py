"""Read legacy VTK files, .vtk, text and binary.

Source: "VTK File Formats", https://docs.vtk.org/en/latest/vtk_file_formats/; of version 5.1, whose cells are
offsets and connectivity, vtkDataReader and vtkDataWriter.
"""

import re
from collections.abc import Callable, Iterator
from typing import Any, NoReturn
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Ints
from truespring.errors import MeshError
from truespring.mesh.files.text import word
from truespring.mesh.files.vtk_grid import Arrays, Grid
from truespring.mesh.files.vtk_shapes import Lists, faces, lattice, lattice_points

# NumPy codes of the array types.
_BIT = "b1"
_CODES = {
    **{"char": "i1", "unsigned_char": "u1", "short": "i2", "unsigned_short": "u2", "int": "i4", "unsigned_int": "u4"},
    **{f"vtktype{sign}int{8 * size}": f"{sign or 'i'}{size}" for sign in ("", "u") for size in (1, 2, 4, 8)},
    **{"long": "i8", "unsigned_long": "u8", "float": "f4", "double": "f8", "bit": _BIT},
    "vtkidtype": "i4",  # for any size in memory
}


_FACES = {"VERTICES": "verts", "LINES": "lines", "POLYGONS": "polys", "TRIANGLE_STRIPS": "strips"}
_COORDINATES = ("X_COORDINATES", "Y_COORDINATES", "Z_COORDINATES")


def read_legacy_grid(data: bytes) -> Grid:
    """Read a legacy .vtk file with its arrays; raise MeshError if it is damaged or contains no grid."""
    head = re.match(
        rb"# vtk DataFile Version\s+(\d+)\.\d+[^\n]*\n[^\n]*\n\s*(ASCII|BINARY)\s+DATASET\s+(\w+)[ \t\r]*\n",
        data,
        re.IGNORECASE,
    )
    if head is None:
        raise MeshError(
            "this is no .vtk file: it must begin with # vtk DataFile Version, title, ASCII or BINARY, DATASET"
        )
    data_set = head[3].decode().upper()
    if data_set not in _MADE:
        raise MeshError(
            f"DATASET {word(head[3])} is not supported; supported: {', '.join(_MADE)}; in ParaView, Append Datasets "
            "and save as .vtu"
        )
    is_text = head[2].upper() == b"ASCII"
    if is_text and not data[-1:].isspace():
        raise MeshError("the last line has no line end: is the file truncated? If it is whole, add one")
    cursor = _Cursor(data, head.end(), is_text)
    grid: dict[str, Any] = {}
    arrays: dict[str, dict[str, NDArray[Any]]] = {"POINT_DATA": {}, "CELL_DATA": {}, "": {}}
    active: str = ""
    n_rows = 0  # the owner of the arrays that follow, and their number of rows
    while fields := cursor.fields():
        match [fields[0].upper(), *fields[1:]]:
            case ["POINTS", count, kind]:
                grid["points"] = cursor.array(kind, cursor.count(count), 3)
            case ["CELLS" | "VERTICES" | "LINES" | "POLYGONS" | "TRIANGLE_STRIPS" as cells, count, size]:
                grid[_FACES.get(cells, "cells")] = cursor.lists(cells, count, size, is_old=int(head[1]) < 5)
            case ["DIMENSIONS", *dims] if len(dims) == 3:
                grid["dims"] = [cursor.count(text) for text in dims]
            case ["X_COORDINATES" | "Y_COORDINATES" | "Z_COORDINATES" as axis, count, kind]:
                grid[axis] = cursor.array(kind, cursor.count(count))
            case ["CELL_TYPES", count]:
                grid["types"] = cursor.array("int", cursor.count(count))
            case ["POINT_DATA" | "CELL_DATA" as active, count]:
                n_rows = cursor.count(count)
            case ["FIELD", _, count]:
                for name, values in cursor.field(cursor.count(count)):
                    arrays[active][name] = values
            case ["SCALARS", name, kind] | ["SCALARS", name, kind, _]:
                if cursor.fields()[:1] != ["LOOKUP_TABLE"]:
                    cursor.refuse(f"SCALARS {name}: expected LOOKUP_TABLE")
                n_components = cursor.count(fields[3]) if len(fields) == 4 else 1
                arrays[active][unquote(name)] = cursor.array(kind, n_rows, n_components)
            case ["VECTORS" | "NORMALS", name, kind]:
                arrays[active][unquote(name)] = cursor.array(kind, n_rows, 3)
            case ["TENSORS" | "TENSORS6" as rank, name, kind]:
                arrays[active][unquote(name)] = cursor.array(kind, n_rows, 9 if rank == "TENSORS" else 6)
            case ["GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS", _, kind]:
                cursor.array(kind, n_rows)  # VTK's ids and flags
            case ["TEXTURE_COORDINATES", name, width, kind]:
                arrays[active][unquote(name)] = cursor.array(kind, n_rows, cursor.count(width))
            case ["COLOR_SCALARS", _, width]:
                cursor.colors(n_rows, cursor.count(width))
            case ["LOOKUP_TABLE", _, count]:
                cursor.colors(cursor.count(count), 4)
            case ["METADATA"]:
                cursor.skip_metadata()
            case _:
                cursor.refuse(f"'{' '.join(fields)[:40]}' is not a supported keyword, or lacks its counts")
    if data_set == "RECTILINEAR_GRID" and all(name in grid for name in _COORDINATES):
        grid["points"] = lattice_points([grid[name] for name in _COORDINATES])
    for name in _MADE[data_set]:
        if name not in grid:
            raise MeshError(f"there are no {name}: is the file truncated?")
    made = _made(data_set, grid, arrays["POINT_DATA"], arrays["CELL_DATA"])
    for what, there in (("POINT_DATA", len(made.points)), ("CELL_DATA", len(made.types))):
        for name, values in (made.point_arrays if what == "POINT_DATA" else made.cell_arrays).items():
            if len(values) != there:
                raise MeshError(f"array '{name}' of {what} has {len(values)} rows, expected {there}")
    return made


# Required entries of each kind of data set.
_MADE = {
    "UNSTRUCTURED_GRID": ("points", "cells", "types"),
    "STRUCTURED_GRID": ("points", "dims"),
    "RECTILINEAR_GRID": ("points", "dims"),
    "POLYDATA": ("points",),
}


def _made(data_set: str, grid: dict[str, Any], point_arrays: Arrays, cell_arrays: Arrays) -> Grid:
    """Return the grid of a data set of any kind."""
    points = grid["points"].astype(np.float64)
    if data_set in ("STRUCTURED_GRID", "RECTILINEAR_GRID"):
        return lattice(grid["dims"], points, point_arrays, cell_arrays)
    if data_set == "UNSTRUCTURED_GRID":
        offsets, connectivity = grid["cells"]
        return Grid(points, offsets, connectivity, grid["types"].astype(np.int64), point_arrays, cell_arrays)
    return faces(points, {name: grid[name] for name in _FACES.values() if name in grid}, point_arrays, cell_arrays)


class _Cursor:
    """Reads a legacy file from start to end."""

    def __init__(self, data: bytes, begin: int, is_text: bool) -> None:
        self._data = data
        self._next = begin
        self._here = begin  # the start of the last item read
        self._is_text = is_text

    def refuse(self, why: str) -> NoReturn:
        """Raise MeshError with the line or byte and the reason."""
        line = self._data.count(b"\n", 0, self._here) + 1
        raise MeshError(f"line {line}: {why}" if self._is_text else f"byte {self._here}: {why}")

    def line(self) -> str:
        """Return the next line, blank or not, without its end."""
        end = self._data.find(b"\n", self._next) + 1 or len(self._data)
        line = self._data[self._next : end]
        self._here, self._next = self._next, end
        return line.decode("utf-8", errors="replace").strip()

    def fields(self) -> list[str]:
        """Return the words of the next line that is not blank; empty at the end of the file."""
        words: list[str] = []
        while not words and self._next < len(self._data):
            words = self.line().split()
        return words

    def count(self, text: str) -> int:
        """Return a count of a keyword line; raise MeshError if it is not one."""
        if not re.fullmatch(r"\d{1,18}", text, re.ASCII):
            self.refuse(f"'{text[:40]}' is no count")
        return int(text)

    def array(self, kind: str, n_rows: int, n_columns: int = 1) -> NDArray[Any]:
        """Return the next values, shape (n_rows,) or (n_rows, n_columns)."""
        count = n_rows * n_columns
        code = _CODES.get(kind.lower())
        if code is None:
            self.refuse(f"an array of type '{kind[:40]}' is not supported: save without it, or as .vtu")
        values = self._text_values(code, count) if self._is_text else self._binary_values(code, count)
        return values if n_columns == 1 else values.reshape(n_rows, n_columns)

    def _text_values(self, code: str, count: int) -> NDArray[Any]:
        if count > len(self._data) - self._next:
            self.refuse(f"{count} numbers are stated, the file ends before")
        words = self._data[self._next :].split(None, count)
        rest = len(words[count]) if len(words) > count else 0
        convert, dtype = (float, np.float64) if code.startswith("f") else (int, np.int64)
        try:
            values = np.array([convert(text) for text in words[:count]], dtype=dtype)
        except (ValueError, OverflowError):
            good = next(place for place, text in enumerate(words) if not _is(convert, text))
            self._here = len(self._data) - len(self._data[self._next :].split(None, good)[-1])
            self.refuse(f"{count} numbers are stated here, number {good + 1} is '{word(words[good])}'")
        if len(values) < count:
            self.refuse(f"{count} numbers are stated, the file ends after {len(values)}")
        self._next = len(self._data) - rest
        return values

    def _binary_values(self, code: str, count: int) -> NDArray[Any]:
        dtype = np.dtype(f">{code}")
        size = -(-count // 8) if code == _BIT else count * dtype.itemsize
        left = len(self._data) - self._next
        if size > left:
            self.refuse(f"{size} bytes are stated, the file ends after {left}")
        raw = self._data[self._next : self._next + size]
        self._next += size
        if code == _BIT:
            return np.unpackbits(np.frombuffer(raw, np.uint8), count=count)
        return np.frombuffer(raw, dtype).astype(dtype.newbyteorder("="))

    def _headed_array(self, name: str, count: int) -> Ints:
        """Return an integer array that follows a line with its name and type, shape (count,)."""
        fields = self.fields()
        if len(fields) != 2 or fields[0].upper() != name or _CODES.get(fields[1].lower(), "f").startswith("f"):
            self.refuse(f"expected {name} and an integer type, found '{' '.join(fields)[:40]}'")
        return self.array(fields[1], count).astype(np.int64)

    def lists(self, what: str, count: str, size: str, is_old: bool) -> Lists:
        """Return cells: before version 5 the count and points of each, since then offsets and connectivity."""
        if is_old:
            return self._old_lists(what, self.count(count), self.count(size))
        offsets = self._headed_array("OFFSETS", self.count(count))
        return Lists(offsets, self._headed_array("CONNECTIVITY", self.count(size)))

    def _old_lists(self, what: str, n_cells: int, size: int) -> Lists:
        flat = self.array("int", size).tolist()
        heads, place = [], 0
        while place < len(flat) and flat[place] >= 0:
            heads.append(place)
            place += 1 + flat[place]
        if len(heads) != n_cells or place != len(flat):
            self.refuse(f"{what} states {n_cells} cells in {size} numbers, these contain {len(heads)}")
        values = np.array(flat, dtype=np.int64)
        return Lists(np.concatenate([[0], np.cumsum(values[heads])]).astype(np.int64), np.delete(values, heads))

    def field(self, count: int) -> Iterator[tuple[str, NDArray[Any]]]:
        """Yield the name and values of each array of a FIELD."""
        for _ in range(count):
            fields = self.fields()
            while fields[:1] == ["METADATA"]:
                self.skip_metadata()
                fields = self.fields()
            if len(fields) != 4:
                self.refuse(f"an array must have a name, components, rows and a type, not '{' '.join(fields)[:40]}'")
            yield unquote(fields[0]), self.array(fields[3], self.count(fields[2]), self.count(fields[1]))

    def colors(self, n_rows: int, n_columns: int) -> None:
        """Skip colours: numbers from 0 to 1 in text files, bytes in binary ones."""
        self.array("float" if self._is_text else "unsigned_char", n_rows, n_columns)

    def skip_metadata(self) -> None:
        """Skip the metadata of an array, up to a blank line."""
        while self.line():
            pass


def _is(convert: Callable[[bytes], float], text: bytes) -> bool:
    try:
        return abs(convert(text)) < 2**63
    except ValueError:
        return False
