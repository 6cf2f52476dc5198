"""Read VTK XML files, .vtu, .vtp, .vts and .vtr: text, base64 and raw, plain or compressed by zlib or LZMA.

Source: "VTK XML Formats", https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html
"""

import base64
import binascii
import itertools
import math
import re
from collections.abc import Callable, Mapping
from typing import Any, TypeVar
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.files.inflate import inflated, refuse_too_large
from truespring.mesh.files.vtk_grid import Grid
from truespring.mesh.files.vtk_shapes import Lists, faces, lattice, lattice_points

#: NumPy codes of the array types.
CODES = {
    **{"Int8": "i1", "Int16": "i2", "Int32": "i4", "Int64": "i8"},
    **{"UInt8": "u1", "UInt16": "u2", "UInt32": "u4", "UInt64": "u8"},
    **{"Float32": "f4", "Float64": "f8"},
}
_T = TypeVar("_T")
_SECTIONS = ("Verts", "Lines", "Polys", "Strips")
_ORDERS = {"LittleEndian": "<", "BigEndian": ">"}
_HEADERS = {"UInt32": "u4", "UInt64": "u8"}
_METHODS = {"vtkZLibDataCompressor": "zlib", "vtkLZMADataCompressor": "lzma"}


def read_grids(data: bytes, kind: str | None = None) -> list[Grid]:
    """Return the pieces of a file of `kind`, a key of GRIDS; of any of these by default.

    Raises MeshError if it is damaged, of another kind, or compressed by an unsupported method.
    """
    root = root_of(data)
    type_ = root.get("type", "")
    root, reader = open_vtk(data, kind or type_)
    return [reader.grid(piece, type_) for piece in root.iterfind(f"{type_}/Piece")]


def root_of(data: bytes) -> ElementTree.Element:
    """Return the XML of a VTK file without the appended data; raise MeshError if it is no VTK file."""
    tag, end = _appended(data)
    text = data[: tag.end()] + data[end:] if tag else data
    if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
        raise MeshError("this is no VTK XML file: it declares entities")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise MeshError(f"this is no VTK XML file, or an incomplete one: {error}") from None
    if root.tag != "VTKFile":
        raise MeshError(f"this is no VTK XML file: expected VTKFile, found {root.tag[:40]}")
    return root


def _appended(data: bytes) -> tuple[re.Match[bytes] | None, int]:
    """Return the match of the <AppendedData> tag (None without appended data), and the end of the appended data."""
    tag = re.search(rb"<AppendedData[^>]*>", data)
    end = data.rfind(b"</AppendedData>")
    if tag and end < tag.end():
        raise MeshError("<AppendedData> has no end tag: the file is truncated")
    return tag, end


def open_vtk(data: bytes, kind: str) -> "tuple[ElementTree.Element, Reader]":
    """Return the XML of a VTK file, and the Reader of its arrays; raise MeshError if it is of another kind."""
    root = root_of(data)
    if root.find(kind) is None:
        raise MeshError(f"expected a VTKFile of type {kind}, found type {root.get('type', 'none')[:40]}")
    tag, end = _appended(data)
    if tag is None:
        return root, Reader(root, memoryview(b""))
    begin = tag.end() + 1  # the data begin with an underscore, which blanks may precede
    while data[begin - 1 : begin].isspace():
        begin += 1
    return root, Reader(root, memoryview(data)[begin:end])  # no copy: the data are most of the file


class Reader:
    """Reads the arrays of a file, which share byte order, header type and compression."""

    def __init__(self, root: ElementTree.Element, appended: memoryview) -> None:
        self._order = _choice(root, "byte_order", _ORDERS, "LittleEndian")
        self._header = np.dtype(self._order + _choice(root, "header_type", _HEADERS, "UInt32"))
        self._method = _choice(root, "compressor", _METHODS) if "compressor" in root.attrib else None
        section = root.find("AppendedData")
        self._is_raw = section is not None and section.get("encoding") == "raw"
        self._appended = appended
        self._n_bytes = 0  # decompressed so far

    def grid(self, piece: ElementTree.Element, kind: str) -> Grid:
        """Return the grid of a piece; `kind` is a key of GRIDS."""
        return GRIDS[kind](self, piece)

    def unstructured(self, piece: ElementTree.Element) -> Grid:
        """Return a piece of an UnstructuredGrid."""
        n_points, n_cells = (_count(piece, name) for name in ("NumberOfPoints", "NumberOfCells"))
        offsets, connectivity = self._lists(piece, "Cells", n_cells)
        return Grid(
            self._points(piece, n_points),
            offsets,
            connectivity,
            self._integers(piece, "Cells", "types", n_cells) if n_cells else np.zeros(0, dtype=np.int64),
            self.arrays(piece, "PointData", n_points),
            self.arrays(piece, "CellData", n_cells),
        )

    def poly(self, piece: ElementTree.Element) -> Grid:
        """Return a piece of PolyData."""
        n_points = _count(piece, "NumberOfPoints")
        counts = {section.lower(): _count(piece, f"NumberOf{section}", "0") for section in _SECTIONS}
        lists = {name: self._lists(piece, name.capitalize(), count) for name, count in counts.items() if count}
        cells = self.arrays(piece, "CellData", sum(counts.values()))
        return faces(self._points(piece, n_points), lists, self.arrays(piece, "PointData", n_points), cells)

    def structured(self, piece: ElementTree.Element) -> Grid:
        """Return a piece of a StructuredGrid."""
        dims = dims_of(piece)
        return self._lattice(piece, dims, self._points(piece, math.prod(dims)))

    def rectilinear(self, piece: ElementTree.Element) -> Grid:
        """Return a piece of a RectilinearGrid."""
        dims = dims_of(piece)
        elements = piece.findall("Coordinates/DataArray")
        if len(elements) != 3:
            raise MeshError(f"<Coordinates> has {len(elements)} arrays: expected three")
        axes = [self._array(one, "Coordinates", count) for one, count in zip(elements, dims, strict=True)]
        return self._lattice(piece, dims, lattice_points([axis.ravel().astype(np.float64) for axis in axes]))

    def _lattice(self, piece: ElementTree.Element, dims: list[int], points: Floats) -> Grid:
        n_cells = math.prod(max(count - 1, 1) for count in dims)
        cells = self.arrays(piece, "CellData", n_cells)
        return lattice(dims, points, self.arrays(piece, "PointData", math.prod(dims)), cells)

    def _points(self, piece: ElementTree.Element, n_points: int) -> Floats:
        points = next(iter(self.arrays(piece, "Points", n_points).values()), np.zeros((0, 3)))
        if points.shape != (n_points, 3):
            raise MeshError(f"<Points> has an array of shape {points.shape}, not ({n_points}, 3)")
        return points.astype(np.float64)

    def _lists(self, piece: ElementTree.Element, section: str, n_cells: int) -> Lists:
        """Return offsets and connectivity of a section."""
        if not n_cells:
            return Lists(np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64))
        ends = self._integers(piece, section, "offsets", n_cells)
        if len(ends) != n_cells:
            raise MeshError(f"{n_cells} cells are stated, found {len(ends)} offsets")
        return Lists(np.concatenate([[0], ends]), self._integers(piece, section, "connectivity", int(ends[-1])))

    def _integers(self, piece: ElementTree.Element, section: str, name: str, n_values: int) -> Ints:
        for element in piece.iterfind(f"{section}/DataArray"):
            if element.get("Name") == name and CODES.get(element.get("type", ""), "f")[0] in "iu":
                values = self._array(element, section, n_values)
                if values.ndim == 1:
                    return values.astype(np.int64)
        raise MeshError(f"<{section}> has no array '{name}' of integers")

    def arrays(self, piece: ElementTree.Element, section: str, n_rows: int) -> dict[str, NDArray[Any]]:
        """Return the arrays of a section by name, shape (n_rows,) or (n_rows, components); strings are skipped."""
        arrays = {}
        for element in piece.iterfind(f"{section}/DataArray"):
            name = element.get("Name", section)
            if element.get("type", "") not in CODES:
                continue
            arrays[name] = self._array(element, section, n_rows)
            if len(arrays[name]) != n_rows:
                raise MeshError(f"array '{name}' of <{section}> has {len(arrays[name])} rows, expected {n_rows}")
        return arrays

    def _array(self, element: ElementTree.Element, section: str, n_rows: int) -> NDArray[Any]:
        """Return an array; the caller checks its number of rows, except that compressed ones must have `n_rows`."""
        try:
            code = CODES.get(element.get("type", ""))
            if code is None:
                raise ValueError(f"its type is '{element.get('type', '')[:20]}'")
            n_components = int(element.get("NumberOfComponents") or 1)
            values = self._values(element, code, n_rows * n_components)
            return values if n_components == 1 else values.reshape(-1, n_components)
        except (ValueError, OverflowError, binascii.Error) as error:
            name = element.get("Name", section)
            raise MeshError(f"array '{name}' of <{section}> is damaged: {error}") from None

    def _values(self, element: ElementTree.Element, code: str, n_values: int) -> NDArray[Any]:
        """Return the values of an array; raise ValueError or an error of the decoder if it is damaged."""
        text = (element.text or "").split()
        match element.get("format", "ascii"):
            case "ascii" if code.startswith("f"):
                return np.array([float(word) for word in text], dtype=np.float64)
            case "ascii":
                return np.array([int(word) for word in text], dtype=np.int64)
            case "binary":
                data = self._bytes(memoryview("".join(text).encode()), False, n_values * np.dtype(code).itemsize)
            case "appended":
                begin = int(element.get("offset", ""))
                if not 0 <= begin <= len(self._appended):
                    raise ValueError(f"offset {begin} lies outside of the appended data")
                data = self._bytes(self._appended[begin:], self._is_raw, n_values * np.dtype(code).itemsize)
            case other:
                raise ValueError(f"format {other[:40]} is not supported")
        return np.frombuffer(data, np.dtype(self._order + code))

    def _bytes(self, coded: memoryview, is_raw: bool, expected: int) -> bytes | memoryview:
        """Return the data at the start of `coded`: after a header, base64 or raw, plain or in compressed blocks.

        The header of compressed data is checked against the expected number of bytes before decompression.
        """
        size = self._header.itemsize
        (count,) = self._sizes(coded, 1, is_raw)
        if self._method is None:
            head_alone, rest = _split(coded, size, is_raw)
            if is_raw or coded[: _length(size)].tobytes().endswith(b"="):
                return _split(rest, count, is_raw)[0]
            return _split(coded, size + count, is_raw)[0][len(head_alone) :]  # header and data are one base64 text
        if count == 0:
            return b""
        _, block, last, *compressed = self._sizes(coded, 3 + count, is_raw)
        sizes = [block] * (count - 1) + [last or block]  # of the decompressed blocks
        if sum(sizes) != expected:
            raise ValueError(f"its header states {sum(sizes)} bytes, expected {expected}")
        self._n_bytes += expected
        refuse_too_large(self._n_bytes)
        data = _split(_split(coded, (3 + count) * size, is_raw)[1], sum(compressed), is_raw)[0]
        ends = np.cumsum([0, *compressed]).tolist()
        parts = zip(itertools.pairwise(ends), sizes, strict=True)
        return b"".join(inflated(data[begin:end], size, self._method) for (begin, end), size in parts)

    def _sizes(self, coded: memoryview, count: int, is_raw: bool) -> list[int]:
        """Return the first words of a header."""
        sizes: list[int] = np.frombuffer(_split(coded, count * self._header.itemsize, is_raw)[0], self._header).tolist()
        return sizes


def _split(coded: memoryview, size: int, is_raw: bool) -> tuple[bytes | memoryview, memoryview]:
    """Return the first `size` bytes, decoded, and the rest, still coded; raise ValueError if there are fewer."""
    length = size if is_raw else _length(size)
    data = coded[:length] if is_raw else base64.b64decode(coded[:length], validate=True)
    if len(data) < size:
        raise ValueError(f"{size} bytes are stated, found {len(data)}")
    return data[:size], coded[length:]


def _length(size: int) -> int:
    """Return the number of base64 characters of `size` bytes."""
    return 4 * -(-size // 3)


#: The methods that read a piece, by the type of the file.
GRIDS: dict[str, Callable[[Reader, ElementTree.Element], Grid]] = {
    "UnstructuredGrid": Reader.unstructured,
    "PolyData": Reader.poly,
    "StructuredGrid": Reader.structured,
    "RectilinearGrid": Reader.rectilinear,
}


def dims_of(piece: ElementTree.Element, name: str = "Extent") -> list[int]:
    """Return the number of points along each axis of a piece of a structured grid."""
    text = piece.get(name, "")
    if not re.fullmatch(r"\s*(-?[0-9]{1,9}\s+){5}-?[0-9]{1,9}\s*", text):
        raise MeshError(f'{piece.tag} has {name}="{text[:40]}": expected six integers')
    ends = [int(word) for word in text.split()]
    dims = [high - low + 1 for low, high in zip(ends[::2], ends[1::2], strict=True)]
    if min(dims) < 1:
        raise MeshError(f'{piece.tag} has {name}="{text[:40]}": an axis has no point')
    return dims


def _count(piece: ElementTree.Element, name: str, default: str = "") -> int:
    text = piece.get(name, default)
    if not re.fullmatch(r"\s*[0-9]{1,18}\s*", text):
        raise MeshError(f'a Piece has {name}="{text[:40]}"')
    return int(text)


def _choice(element: ElementTree.Element, name: str, allowed: Mapping[str, _T], default: str = "") -> _T:
    value = element.get(name, default)
    if value not in allowed:
        raise MeshError(f'{name}="{value[:40]}" is not supported; supported: {", ".join(allowed)}')
    return allowed[value]
