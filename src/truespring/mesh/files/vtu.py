"""VTK's XML files of unstructured grids, .vtu: text, base64 and raw, plain or compressed by zlib or LZMA.

Source: "VTK XML Formats", https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html
"""

import base64
import binascii
import itertools
import lzma
import re
import zlib
from collections.abc import Callable, Mapping
from typing import Any, TypeVar
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Ints
from truespring.errors import MeshError
from truespring.mesh.files.contents import Contents
from truespring.mesh.files.vtk import Grid, contents

_CODES = {
    **{"Int8": "i1", "Int16": "i2", "Int32": "i4", "Int64": "i8"},
    **{"UInt8": "u1", "UInt16": "u2", "UInt32": "u4", "UInt64": "u8"},
    **{"Float32": "f4", "Float64": "f8"},
}
_T = TypeVar("_T")
_ORDERS = {"LittleEndian": "<", "BigEndian": ">"}
_HEADERS = {"UInt32": "u4", "UInt64": "u8"}
_DECOMPRESS: dict[str, Callable[[bytes | memoryview], bytes]] = {
    "vtkZLibDataCompressor": zlib.decompress,
    "vtkLZMADataCompressor": lzma.decompress,
}


def read_vtu(data: bytes) -> Contents:
    """Read a .vtu file; raise MeshError where it is damaged, in several pieces or compressed in another way."""
    return contents(read_grid(data))


def read_grid(data: bytes) -> Grid:
    """Read a .vtu file with its arrays; raise MeshError as `read_vtu`."""
    root, reader = open_vtk(data, "UnstructuredGrid")
    grid = root.find("UnstructuredGrid")
    assert grid is not None  # open_vtk has looked
    pieces = [piece for piece in grid.iter("Piece") if piece.get("NumberOfPoints") != "0"]
    if len(pieces) != 1:
        raise MeshError(f"there are {len(pieces)} pieces: merge them into one grid")
    return reader.grid(pieces[0])


def open_vtk(data: bytes, kind: str) -> "tuple[ElementTree.Element, Reader]":
    """Return the XML of a VTK file of a kind, and what reads its arrays; raise MeshError where it is none."""
    tag = re.search(rb"<AppendedData[^>]*>", data)
    end = data.rfind(b"</AppendedData>")
    if tag and end < tag.end():
        raise MeshError("<AppendedData> has no end: the file is cut off")
    try:  # what is appended may be raw, which is no XML
        root = ElementTree.fromstring(data[: tag.end()] + data[end:] if tag else data)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise MeshError(f"this is no file of VTK's XML, or not a whole one: {error}") from None
    if root.tag != "VTKFile" or root.find(kind) is None:
        raise MeshError(f"a VTKFile of type {kind} is wanted, not {root.tag[:40]} of type {root.get('type')}")
    if tag is None:
        return root, Reader(root, memoryview(b""))
    begin = tag.end() + 1  # it begins with an underscore, maybe behind blanks
    while data[begin - 1 : begin].isspace():
        begin += 1
    return root, Reader(root, memoryview(data)[begin:end])  # no copy: it is nearly the file


class Reader:
    """Reads the arrays of a file, which are written in one way."""

    def __init__(self, root: ElementTree.Element, appended: memoryview) -> None:
        self._order = _choice(root, "byte_order", _ORDERS, "LittleEndian")
        self._header = np.dtype(self._order + _choice(root, "header_type", _HEADERS, "UInt32"))
        self._decompress = _choice(root, "compressor", _DECOMPRESS) if "compressor" in root.attrib else None
        section = root.find("AppendedData")
        self._is_raw = section is not None and section.get("encoding") == "raw"
        self._appended = appended

    def grid(self, piece: ElementTree.Element) -> Grid:
        """Return what a piece holds."""
        n_points, n_cells = (_count(piece, name) for name in ("NumberOfPoints", "NumberOfCells"))
        points = next(iter(self.arrays(piece, "Points", n_points).values()), np.zeros((0, 0)))
        if points.shape != (n_points, 3):
            raise MeshError(f"<Points> holds an array of shape {points.shape}, wanted is ({n_points}, 3)")
        cells = self.arrays(piece, "Cells", None)
        connectivity, ends, types = (_integers(cells, name) for name in ("connectivity", "offsets", "types"))
        if len(ends) != n_cells:
            raise MeshError(f"{n_cells} cells are announced, there are {len(ends)} offsets")
        return Grid(
            points.astype(np.float64),
            np.concatenate([[0], ends]),
            connectivity,
            types,
            self.arrays(piece, "PointData", n_points),
            self.arrays(piece, "CellData", n_cells),
        )

    def arrays(self, piece: ElementTree.Element, section: str, n_rows: int | None) -> dict[str, NDArray[Any]]:
        """Return the arrays of a section by name, shape (n_rows,) or (n_rows, components); texts are passed over."""
        arrays = {}
        for element in piece.findall(f"{section}/DataArray"):
            name, code = element.get("Name", section), _CODES.get(element.get("type", ""))
            if code is None:
                continue
            try:
                values = self._values(element, code)
                n_components = int(element.get("NumberOfComponents") or 1)
                arrays[name] = values if n_components == 1 else values.reshape(-1, n_components)
            except (ValueError, OverflowError, binascii.Error, zlib.error, lzma.LZMAError) as error:
                raise MeshError(f"array '{name}' of <{section}> is damaged: {error}") from None
            if n_rows is not None and len(arrays[name]) != n_rows:
                raise MeshError(f"array '{name}' of <{section}> has {len(arrays[name])} rows, wanted are {n_rows}")
        return arrays

    def _values(self, element: ElementTree.Element, code: str) -> NDArray[Any]:
        """Return the values of an array; raise ValueError or what decoding raises."""
        text = (element.text or "").split()
        match element.get("format", "ascii"):
            case "ascii" if code.startswith("f"):
                return np.array([float(word) for word in text], dtype=np.float64)
            case "ascii":
                return np.array([int(word) for word in text], dtype=np.int64)
            case "binary":
                data = self._bytes(memoryview("".join(text).encode()), is_raw=False)
            case "appended":
                data = self._bytes(self._appended[int(element.get("offset", "")) :], self._is_raw)
            case other:
                raise ValueError(f"format {other[:40]} is not read")
        return np.frombuffer(data, np.dtype(self._order + code))

    def _bytes(self, coded: memoryview, is_raw: bool) -> bytes | memoryview:
        """Return the data that `coded` begins with: behind a header, base64 or raw, in compressed blocks or not."""
        size = self._header.itemsize
        (count,) = self._sizes(coded, 1, is_raw)
        if self._decompress is None:
            head_alone, rest = _split(coded, size, is_raw)
            if is_raw or coded[: _length(size)].tobytes().endswith(b"="):
                return _split(rest, count, is_raw)[0]
            return _split(coded, size + count, is_raw)[0][len(head_alone) :]  # header and data are coded as one
        if count == 0:
            return b""
        compressed = self._sizes(coded, 3 + count, is_raw)[3:]  # before: how many, and how large when they are not
        data = _split(_split(coded, (3 + count) * size, is_raw)[1], sum(compressed), is_raw)[0]
        ends = np.cumsum([0, *compressed]).tolist()
        return b"".join(self._decompress(data[begin:end]) for begin, end in itertools.pairwise(ends))

    def _sizes(self, coded: memoryview, count: int, is_raw: bool) -> list[int]:
        """Return the first words of a header."""
        sizes: list[int] = np.frombuffer(_split(coded, count * self._header.itemsize, is_raw)[0], self._header).tolist()
        return sizes


def _split(coded: memoryview, size: int, is_raw: bool) -> tuple[bytes | memoryview, memoryview]:
    """Return the first `size` bytes, decoded, and what is coded behind them; raise ValueError where there are fewer."""
    length = size if is_raw else _length(size)
    data = coded[:length] if is_raw else base64.b64decode(coded[:length], validate=True)
    if len(data) < size:
        raise ValueError(f"{size} bytes are announced, {len(data)} are there")
    return data[:size], coded[length:]


def _length(size: int) -> int:
    """Return the number of characters of so many bytes in base64."""
    return 4 * -(-size // 3)


def _integers(cells: Mapping[str, NDArray[Any]], name: str) -> Ints:
    if name not in cells or cells[name].dtype.kind not in "iu" or cells[name].ndim != 1:
        raise MeshError(f"<Cells> has no array '{name}' of integers")
    return cells[name].astype(np.int64)


def _count(piece: ElementTree.Element, name: str) -> int:
    text = piece.get(name, "")
    if not re.fullmatch(r"\s*[0-9]{1,18}\s*", text):
        raise MeshError(f'a Piece has {name}="{text[:40]}"')
    return int(text)


def _choice(element: ElementTree.Element, name: str, allowed: Mapping[str, _T], default: str = "") -> _T:
    value = element.get(name, default)
    if value not in allowed:
        raise MeshError(f'{name}="{value[:40]}" is not read; {", ".join(allowed)} are')
    return allowed[value]
