"""Legacy VTK files, .vtk, text and binary, with a DATASET UNSTRUCTURED_GRID; and what they share with .vtu files.

Source: "VTK File Formats", https://docs.vtk.org/en/latest/vtk_file_formats/; of version 5.1, whose cells are
offsets and connectivity, vtkDataReader and vtkDataWriter.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, NoReturn
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.files.contents import CELL_KINDS, Cells, Contents
from truespring.mesh.files.text import word

Arrays = Mapping[str, NDArray[Any]]

# VTK's number of a cell type: its kind and the number of its nodes, None where that varies.
_TYPES: dict[int, tuple[str, int | None]] = {
    1: ("vertex", 1),
    2: ("vertex", None),
    3: ("line", 2),
    4: ("line", None),
    5: ("triangle", 3),
    6: ("triangle strip", None),
    7: ("polygon", None),
    8: ("quadrilateral", 4),  # pixel
    9: ("quadrilateral", 4),
    10: ("tetrahedron", 4),
    11: ("hexahedron", 8),  # voxel
    12: ("hexahedron", 8),
    13: ("wedge", 6),
    14: ("pyramid", 5),
    15: ("prism", 10),
    16: ("prism", 12),
    21: ("line", 3),
    22: ("triangle", 6),
    23: ("quadrilateral", 8),
    24: ("tetrahedron", 10),
    25: ("hexahedron", 20),
    26: ("wedge", 15),
    27: ("pyramid", 13),
    28: ("quadrilateral", 9),
    29: ("hexahedron", 27),
    30: ("quadrilateral", 6),
    31: ("wedge", 12),
    32: ("wedge", 18),
    33: ("hexahedron", 24),
    34: ("triangle", 7),
    35: ("line", 4),
    42: ("polyhedron", None),
    # Lagrange and Bezier cells of any order.
    **{
        first + place: (kind, None)
        for first in (68, 75)
        for place, kind in enumerate(
            ("line", "triangle", "quadrilateral", "tetrahedron", "hexahedron", "wedge", "pyramid")
        )
    },
}
_BEZIER = 75
# Pixels and voxels number their nodes along x, then y, then z.
_PIXEL, _VOXEL = (0, 1, 3, 2), (0, 1, 3, 2, 4, 5, 7, 6)

# More values than these are a quantity, not a choice of regions.
_MOST_VALUES = 64

# Arrays of numbers and marks that VTK and ParaView keep for themselves.
_NO_GROUPS = {
    *("vtkoriginalpointids", "vtkoriginalcellids", "vtkghosttype", "vtkghostlevels", "vtkvalidpointmask"),
    *("globalnodeid", "globalnodeids", "globalelementid", "globalelementids", "globalpointids", "globalcellids"),
    *("pedigreenodeid", "pedigreeelementid", "pointids", "cellids", "offset"),
}


class Grid(NamedTuple):
    """An unstructured grid, whose points and cells are numbered from 0.

    Attributes:
        points: shape (n_points, 3).
        offsets: where each cell begins in `connectivity`, and the end of the last one, shape (n_cells + 1,).
        connectivity: the points of all cells.
        types: VTK's numbers of the cell types, shape (n_cells,).
        point_arrays, cell_arrays: by name, a row for each point or cell.
    """

    points: Floats
    offsets: Ints
    connectivity: Ints
    types: Ints
    point_arrays: Arrays
    cell_arrays: Arrays


def contents(grid: Grid) -> Contents:
    """Return the contents of a grid; raise MeshError where its cells are not whole."""
    points, offsets, connectivity, types, point_arrays, cell_arrays = grid
    if len(offsets) != len(types) + 1 or offsets[0] != 0 or (np.diff(offsets) < 0).any():
        raise MeshError(f"{len(offsets)} offsets do not belong to {len(types)} cells, or do not ascend from 0")
    if offsets[-1] != len(connectivity):
        raise MeshError(f"the cells have {offsets[-1]} nodes by their offsets, {len(connectivity)} are listed")
    cells = [_cells(block, offsets, connectivity, int(types[block[0]])) for block in _blocks(types, np.diff(offsets))]
    return Contents(
        node_numbers=np.arange(len(points)),
        points=points,
        cells=cells,
        node_groups={
            name: np.flatnonzero(values)
            for name, values in _choices(point_arrays)
            if values.min() == 0 and values.max() == 1
        },
        cell_groups=_cell_groups(cells, cell_arrays),
    )


def _blocks(types: Ints, sizes: Ints) -> list[Ints]:
    """Return the numbers of the cells that have one type and one number of nodes."""
    _, kind = np.unique(np.stack([types, sizes], axis=1), axis=0, return_inverse=True)
    order = np.argsort(kind.ravel(), kind="stable")
    return np.split(order, np.flatnonzero(np.diff(kind.ravel()[order])) + 1) if len(order) else []


def _cells(numbers: Ints, offsets: Ints, connectivity: Ints, type_: int) -> Cells:
    first = numbers[0]
    if type_ not in _TYPES:
        raise MeshError(f"cell {first}: VTK's cell type {type_} is not supported")
    kind, wanted = _TYPES[type_]
    n_nodes = int(offsets[first + 1] - offsets[first])
    if n_nodes != wanted and (wanted is not None or n_nodes < CELL_KINDS[kind][1]):
        raise MeshError(f"cell {first} is a {kind} by its type {type_}, and has {n_nodes} nodes")
    nodes = connectivity[offsets[numbers, None] + np.arange(n_nodes)]
    order = {8: _PIXEL, 11: _VOXEL}.get(type_)
    if type_ >= _BEZIER:  # between the corners are control points, which lie on no edge
        nodes = nodes[:, : CELL_KINDS[kind][1]]
    return Cells(kind, nodes if order is None else nodes[:, order], numbers)


def _choices(arrays: Arrays) -> list[tuple[str, NDArray[Any]]]:
    """Return the arrays that may name groups: of whole numbers, one a row, and not VTK's own."""
    return [
        (name, values.ravel())
        for name, values in arrays.items()
        if values.dtype.kind in "iub" and values.size and values.size == len(values) and name.lower() not in _NO_GROUPS
    ]


def _cell_groups(cells: Sequence[Cells], arrays: Arrays) -> dict[str, Ints]:
    dims = np.zeros(sum(len(block.numbers) for block in cells), dtype=np.int64)
    for block in cells:
        dims[block.numbers] = block.dim
    groups = {}
    for name, values in _choices(arrays):
        distinct = np.unique(values)
        for value in distinct if len(distinct) <= _MOST_VALUES else []:
            members = np.flatnonzero(values == value)
            groups[f"{name}-{int(value)}"] = members[dims[members] == dims[members].max()]
    return groups


# --- the legacy format ----------------------------------------------------------------------------

# The type of an array and numpy's name of it.
_BIT = "b1"
_CODES = {
    **{"char": "i1", "unsigned_char": "u1", "short": "i2", "unsigned_short": "u2", "int": "i4", "unsigned_int": "u4"},
    **{f"vtktype{sign}int{8 * size}": f"{sign or 'i'}{size}" for sign in ("", "u") for size in (1, 2, 4, 8)},
    **{"long": "i8", "unsigned_long": "u8", "float": "f4", "double": "f8", "bit": _BIT},
    "vtkidtype": "i4",  # whatever its size in memory
}


def read_vtk(data: bytes) -> Contents:
    """Read a legacy .vtk file; raise MeshError where it is damaged or no unstructured grid."""
    return contents(read_legacy_grid(data))


def read_legacy_grid(data: bytes) -> Grid:
    """Read a legacy .vtk file with its arrays; raise MeshError where it is damaged or no unstructured grid."""
    head = re.match(
        rb"# vtk DataFile Version\s+(\d+)\.\d+[^\n]*\n[^\n]*\n\s*(ASCII|BINARY)\s+DATASET\s+(\w+)[ \t\r]*\n",
        data,
        re.IGNORECASE,
    )
    if head is None:
        raise MeshError("this is no .vtk file: it begins with # vtk DataFile Version, title, ASCII or BINARY, DATASET")
    if head[3].upper() != b"UNSTRUCTURED_GRID":
        raise MeshError(f"DATASET {word(head[3])} is not read, UNSTRUCTURED_GRID is")
    is_text = head[2].upper() == b"ASCII"
    if is_text and not data[-1:].isspace():
        raise MeshError("the last line has no line end: is the file cut off? If it is whole, add one")
    cursor = _Cursor(data, head.end(), is_text)
    grid: dict[str, NDArray[Any]] = {}
    arrays: dict[str, dict[str, NDArray[Any]]] = {"POINT_DATA": {}, "CELL_DATA": {}, "": {}}
    active, n_rows = "", 0  # whose arrays follow, and how many rows they have
    while fields := cursor.fields():
        match [fields[0].upper(), *fields[1:]]:
            case ["POINTS", count, kind]:
                grid["points"] = cursor.array(kind, cursor.count(count), 3)
            case ["CELLS", n_cells, size] if int(head[1]) < 5:
                grid["offsets"], grid["connectivity"] = cursor.cells(cursor.count(n_cells), cursor.count(size))
            case ["CELLS", n_offsets, size]:
                grid["offsets"] = cursor.headed_array("OFFSETS", cursor.count(n_offsets))
                grid["connectivity"] = cursor.headed_array("CONNECTIVITY", cursor.count(size))
            case ["CELL_TYPES", count]:
                grid["types"] = cursor.array("int", cursor.count(count))
            case ["POINT_DATA" | "CELL_DATA" as active, count]:
                n_rows = cursor.count(count)
            case ["FIELD", _, count]:
                for name, values in cursor.field(cursor.count(count)):
                    arrays[active][name] = values
            case ["SCALARS", name, kind] | ["SCALARS", name, kind, _]:
                if cursor.fields()[:1] != ["LOOKUP_TABLE"]:
                    cursor.refuse(f"SCALARS {name}: its LOOKUP_TABLE is wanted here")
                n_components = cursor.count(fields[3]) if len(fields) == 4 else 1
                arrays[active][unquote(name)] = cursor.array(kind, n_rows, n_components)
            case ["VECTORS" | "NORMALS", name, kind]:
                arrays[active][unquote(name)] = cursor.array(kind, n_rows, 3)
            case ["TENSORS" | "TENSORS6" as rank, name, kind]:
                arrays[active][unquote(name)] = cursor.array(kind, n_rows, 9 if rank == "TENSORS" else 6)
            case ["GLOBAL_IDS" | "PEDIGREE_IDS" | "EDGE_FLAGS", _, kind]:
                cursor.array(kind, n_rows)  # numbers and marks of VTK's own
            case ["TEXTURE_COORDINATES", name, width, kind]:
                arrays[active][unquote(name)] = cursor.array(kind, n_rows, cursor.count(width))
            case ["COLOR_SCALARS", _, width]:
                cursor.colors(n_rows, cursor.count(width))
            case ["LOOKUP_TABLE", _, count]:
                cursor.colors(cursor.count(count), 4)
            case ["METADATA"]:
                cursor.skip_metadata()
            case _:
                cursor.refuse(f"'{' '.join(fields)[:40]}' is no keyword that is read here, or lacks its counts")
    for name in ("points", "offsets", "connectivity", "types"):
        if name not in grid:
            raise MeshError(f"there are no {name} of {'points' if name == 'points' else 'cells'}: is the file cut off?")
    for what, there in (("POINT_DATA", len(grid["points"])), ("CELL_DATA", len(grid["types"]))):
        for name, values in arrays[what].items():
            if len(values) != there:
                raise MeshError(f"array '{name}' of {what} has {len(values)} rows, wanted are {there}")
    return Grid(**grid, point_arrays=arrays["POINT_DATA"], cell_arrays=arrays["CELL_DATA"])


class _Cursor:
    """A legacy file that is read from its top to its bottom."""

    def __init__(self, data: bytes, begin: int, is_text: bool) -> None:
        self._data = data
        self._next = begin
        self._here = begin  # where what was read last begins
        self._is_text = is_text

    def refuse(self, why: str) -> NoReturn:
        """Raise MeshError."""
        line = self._data.count(b"\n", 0, self._here) + 1
        raise MeshError(f"line {line}: {why}" if self._is_text else f"byte {self._here}: {why}")

    def line(self) -> str:
        """Return the next line, blank or not, without its end."""
        end = self._data.find(b"\n", self._next) + 1 or len(self._data)
        line = self._data[self._next : end]
        self._here, self._next = self._next, end
        return line.decode("utf-8", errors="replace").strip()

    def fields(self) -> list[str]:
        """Return the words of the next line that is not blank, none at the end of the file."""
        words: list[str] = []
        while not words and self._next < len(self._data):
            words = self.line().split()
        return words

    def count(self, text: str) -> int:
        """Return a count that a keyword line gives."""
        if not re.fullmatch(r"\d{1,18}", text, re.ASCII):
            self.refuse(f"'{text[:40]}' is no count")
        return int(text)

    def array(self, kind: str, n_rows: int, n_columns: int = 1) -> NDArray[Any]:
        """Return the next values, shape (n_rows,) or (n_rows, n_columns)."""
        count = n_rows * n_columns
        code = _CODES.get(kind.lower())
        if code is None:
            self.refuse(f"an array of type '{kind[:40]}' is not read: save without it, or as .vtu")
        values = self._text_values(code, count) if self._is_text else self._binary_values(code, count)
        return values if n_columns == 1 else values.reshape(n_rows, n_columns)

    def _text_values(self, code: str, count: int) -> NDArray[Any]:
        if count > len(self._data) - self._next:
            self.refuse(f"{count} numbers are announced, the file ends before")
        words = self._data[self._next :].split(None, count)
        rest = len(words[count]) if len(words) > count else 0
        convert, dtype = (float, np.float64) if code.startswith("f") else (int, np.int64)
        try:
            values = np.array([convert(text) for text in words[:count]], dtype=dtype)
        except (ValueError, OverflowError):
            good = next(place for place, text in enumerate(words) if not _is(convert, text))
            self._here = len(self._data) - len(self._data[self._next :].split(None, good)[-1])
            self.refuse(f"{count} numbers are announced here, number {good + 1} is '{word(words[good])}'")
        if len(values) < count:
            self.refuse(f"{count} numbers are announced, the file ends after {len(values)}")
        self._next = len(self._data) - rest
        return values

    def _binary_values(self, code: str, count: int) -> NDArray[Any]:
        dtype = np.dtype(f">{code}")
        size = -(-count // 8) if code == _BIT else count * dtype.itemsize
        left = len(self._data) - self._next
        if size > left:
            self.refuse(f"{size} bytes are announced, the file ends after {left}")
        raw = self._data[self._next : self._next + size]
        self._next += size
        if code == _BIT:
            return np.unpackbits(np.frombuffer(raw, np.uint8), count=count).astype(bool)
        return np.frombuffer(raw, dtype).astype(dtype.newbyteorder("="))

    def headed_array(self, name: str, count: int) -> Ints:
        """Return an array that its own line heads: its name and type."""
        fields = self.fields()
        if len(fields) != 2 or fields[0].upper() != name or _CODES.get(fields[1].lower(), "f").startswith("f"):
            self.refuse(f"{name} and a type of integers are wanted here, not '{' '.join(fields)[:40]}'")
        return self.array(fields[1], count).astype(np.int64)

    def cells(self, n_cells: int, size: int) -> tuple[Ints, Ints]:
        """Return offsets and connectivity of cells before version 5: each a number of nodes and these."""
        flat = self.array("int", size).tolist()
        heads, place = [], 0
        while place < len(flat) and flat[place] >= 0:
            heads.append(place)
            place += 1 + flat[place]
        if len(heads) != n_cells or place != len(flat):
            self.refuse(f"CELLS announces {n_cells} cells in {size} numbers, these hold {len(heads)}")
        values = np.array(flat, dtype=np.int64)
        return np.concatenate([[0], np.cumsum(values[heads])]), np.delete(values, heads)

    def field(self, count: int) -> Iterator[tuple[str, NDArray[Any]]]:
        """Yield the name and values of each array of a FIELD."""
        for _ in range(count):
            fields = self.fields()
            while fields[:1] == ["METADATA"]:
                self.skip_metadata()
                fields = self.fields()
            if len(fields) != 4:
                self.refuse(f"an array has a name, components, rows and a type, not '{' '.join(fields)[:40]}'")
            yield unquote(fields[0]), self.array(fields[3], self.count(fields[2]), self.count(fields[1]))

    def colors(self, n_rows: int, n_columns: int) -> None:
        """Pass over colours: numbers from 0 to 1 in a text, bytes else."""
        self.array("float" if self._is_text else "unsigned_char", n_rows, n_columns)

    def skip_metadata(self) -> None:
        """Pass over what VTK says of an array, up to a blank line."""
        while self.line():
            pass


def _is(convert: Callable[[bytes], float], text: bytes) -> bool:
    try:
        return abs(convert(text)) < 2**63
    except ValueError:
        return False
