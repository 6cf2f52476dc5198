"""Write VTK unstructured grids as .vtu files: base64 of zlib-compressed blocks, in native byte order.

Source: "VTK XML Formats", https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html
"""

import base64
import sys
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats, Ints, in_space
from truespring.mesh.cells import CELL_SHAPES
from truespring.mesh.files.vtk_grid import WEDGE
from truespring.mesh.files.vtu import CODES

_NAMES = {np.dtype(code): name for name, code in CODES.items()}
_BLOCK = 1 << 20  # uncompressed bytes of a block


def write_vtu(
    file: Path,
    points: Floats,
    cells: Iterable[tuple[str, Ints]],
    point_arrays: Mapping[str, NDArray[Any]] | None = None,
    cell_arrays: Mapping[str, NDArray[Any]] | None = None,
) -> None:
    """Write an unstructured grid as a .vtu file.

    Args:
        file: the file.
        points: shape (n_points, 1 to 3); missing components are 0.
        cells: blocks of a key of CELL_SHAPES and the points of its cells in VTK's order, shape (n_cells, k); wedges
            of first order are in the order of ELEMENT_KINDS, which differs from VTK's.
        point_arrays, cell_arrays: by name, one row per point, or per cell of all blocks in their order; floats or
            integers.
    """
    listed = listed_cells(cells)
    order = {"little": "LittleEndian", "big": "BigEndian"}[sys.byteorder]
    lines = [
        f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="{order}" header_type="UInt64" '
        'compressor="vtkZLibDataCompressor">',
        "<UnstructuredGrid>",
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(listed.types)}">',
        *_section("Points", {"Points": in_space(points)}),
        *_section("Cells", listed._asdict()),
        *_section("PointData", point_arrays or {}),
        *_section("CellData", cell_arrays or {}),
        "</Piece>",
        "</UnstructuredGrid>",
        "</VTKFile>",
    ]
    file.write_text("\n".join([*lines, ""]), encoding="utf-8")


class ListedCells(NamedTuple):
    """Cells as VTK lists them.

    Attributes:
        connectivity: the points of all cells, concatenated.
        offsets: the end of each cell in `connectivity`, shape (n_cells,).
        types: VTK's cell types, shape (n_cells,).
    """

    connectivity: NDArray[np.int64]
    offsets: NDArray[np.int64]
    types: NDArray[np.uint8]


def listed_cells(cells: Iterable[tuple[str, Ints]]) -> ListedCells:
    """Return blocks of cells as VTK lists them, see `write_vtu`."""
    blocks = [(kind, nodes[:, WEDGE] if kind == "wedge" else nodes) for kind, nodes in cells]
    sizes = [np.full(len(nodes), nodes.shape[1], dtype=np.int64) for _, nodes in blocks]
    types = [np.full(len(nodes), CELL_SHAPES[kind].vtk_type, dtype=np.uint8) for kind, nodes in blocks]
    none = np.zeros(0, dtype=np.int64)
    return ListedCells(
        np.concatenate([none, *(nodes.ravel().astype(np.int64) for _, nodes in blocks)]),
        np.cumsum(np.concatenate([none, *sizes])),
        np.concatenate([none.astype(np.uint8), *types]),
    )


def _section(name: str, arrays: Mapping[str, NDArray[Any]]) -> list[str]:
    return [f"<{name}>", *(_array(key, values) for key, values in arrays.items()), f"</{name}>"]


def _array(name: str, values: NDArray[Any]) -> str:
    components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    kind = _NAMES[values.dtype.newbyteorder("=")]
    return f'<DataArray type="{kind}" Name={quoteattr(name)}{components} format="binary">{_coded(values)}</DataArray>'


def _coded(values: NDArray[Any]) -> str:
    """Return base64 text: the header (number and sizes of blocks), then the compressed blocks."""
    data = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("=")).tobytes()
    blocks = [zlib.compress(data[first : first + _BLOCK]) for first in range(0, len(data), _BLOCK)]
    header = np.array([len(blocks), _BLOCK, len(data) % _BLOCK, *map(len, blocks)], dtype=np.uint64)
    return (base64.b64encode(header.tobytes()) + base64.b64encode(b"".join(blocks))).decode("ascii")
