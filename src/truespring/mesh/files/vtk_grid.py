"""VTK grids, independent of the file format, and their conversion to cells and groups of a mesh.

Source: "VTK File Formats", https://docs.vtk.org/en/latest/vtk_file_formats/
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.files.contents import CELL_KINDS, Cells, Contents

Arrays = Mapping[str, NDArray[Any]]

# Kind and number of nodes by VTK's cell type; None if the number varies.
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
#: Node order of VTK's linear wedge from ours, and back: its first triangle is counterclockwise from outside, ours
#: from inside.
WEDGE = (0, 2, 1, 3, 5, 4)

#: Names of arrays of `Mesh.to_pyvista` begin with this for a group of facets: bit i of a cell's number is its facet i.
FACETS = "facets:"

# An array of more distinct values is a quantity, not region labels.
_MOST_VALUES = 64

# Arrays of ids and flags for internal use of VTK and ParaView.
_NO_GROUPS = {
    *("vtkoriginalpointids", "vtkoriginalcellids", "vtkghosttype", "vtkghostlevels", "vtkvalidpointmask"),
    *("globalnodeid", "globalnodeids", "globalelementid", "globalelementids", "globalpointids", "globalcellids"),
    *("pedigreenodeid", "pedigreeelementid", "pointids", "cellids", "offset"),
}


class Grid(NamedTuple):
    """An unstructured grid, whose points and cells are numbered from 0.

    Attributes:
        points: shape (n_points, 3).
        offsets: the start of each cell in `connectivity`, and the end of the last one, shape (n_cells + 1,).
        connectivity: the points of all cells, concatenated.
        types: VTK's cell types, shape (n_cells,).
        point_arrays, cell_arrays: by name, one row per point or cell.
        notes: remarks about the file for the user.
    """

    points: Floats
    offsets: Ints
    connectivity: Ints
    types: Ints
    point_arrays: Arrays
    cell_arrays: Arrays
    notes: tuple[str, ...] = ()


def contents(grid: Grid) -> Contents:
    """Return the contents of a grid; raise MeshError if offsets and connectivity do not fit."""
    points, offsets, connectivity, types, point_arrays, cell_arrays, notes = grid
    if len(offsets) != len(types) + 1 or offsets[0] != 0 or (np.diff(offsets) < 0).any():
        raise MeshError(f"{len(offsets)} offsets do not match {len(types)} cells, or do not ascend from 0")
    if offsets[-1] != len(connectivity):
        raise MeshError(f"the offsets give {offsets[-1]} nodes of cells, {len(connectivity)} are listed")
    cells = [_cells(block, offsets, connectivity, int(types[block[0]])) for block in _blocks(types, np.diff(offsets))]
    return Contents(
        node_numbers=np.arange(len(points)),
        points=points,
        cells=cells,
        node_groups=point_groups(point_arrays),
        cell_groups=cell_groups(cells, cell_arrays),
        facet_groups=_facet_groups(cell_arrays),
        cell_vectors=vectors(cell_arrays, len(types)),
        notes=notes,
    )


def kind_of(vtk_type: int) -> str:
    """Return the kind of a cell of VTK's types, a key of CELL_KINDS."""
    return _TYPES[vtk_type][0]


def _blocks(types: Ints, sizes: Ints) -> list[Ints]:
    """Return the indices of cells, grouped by type and number of nodes."""
    _, kind = np.unique(np.stack([types, sizes], axis=1), axis=0, return_inverse=True)
    order = np.argsort(kind.ravel(), kind="stable")
    return np.split(order, np.flatnonzero(np.diff(kind.ravel()[order])) + 1) if len(order) else []


def _cells(numbers: Ints, offsets: Ints, connectivity: Ints, type_: int) -> Cells:
    first = numbers[0]
    if type_ not in _TYPES:
        raise MeshError(f"cell {first}: VTK's cell type {type_} is not supported")
    kind, expected = _TYPES[type_]
    n_nodes = int(offsets[first + 1] - offsets[first])
    if n_nodes != expected and (expected is not None or n_nodes < CELL_KINDS[kind][1]):
        raise MeshError(f"cell {first} is a {kind} by its type {type_}, but has {n_nodes} nodes")
    nodes = connectivity[offsets[numbers, None] + np.arange(n_nodes)]
    order = {8: _PIXEL, 11: _VOXEL, 13: WEDGE}.get(type_)
    if type_ >= _BEZIER:  # the other nodes are control points, which do not lie on the edges
        nodes = nodes[:, : CELL_KINDS[kind][1]]
    return Cells(kind, nodes if order is None else nodes[:, order], numbers)


def _choices(arrays: Arrays) -> list[tuple[str, NDArray[Any]]]:
    """Return the arrays that may define groups: integers, one per row, not internal to VTK."""
    return [
        (name, values.ravel())
        for name, values in arrays.items()
        if values.dtype.kind in "iub"
        and values.size
        and values.size == len(values)
        and name.lower() not in _NO_GROUPS
        and not name.startswith(FACETS)
    ]


def _facet_groups(arrays: Arrays) -> dict[str, Ints]:
    """Return groups of facets, rows of cell and local facet, of the arrays that `Mesh.to_pyvista` makes of them."""
    found = {}
    for name, values in arrays.items():
        if name.startswith(FACETS) and values.dtype.kind in "iu" and values.ndim == 1:
            local = np.arange(max(int(values.max(initial=0)).bit_length(), 1))
            found[name.removeprefix(FACETS)] = np.argwhere((values[:, None].astype(np.int64) >> local) & 1)
    return found


def point_groups(arrays: Arrays) -> dict[str, Ints]:
    """Return groups of points by the name of an array of 0 and 1."""
    return {
        name: np.flatnonzero(values)
        for name, values in _choices(arrays)
        if values.dtype.kind == "b" or (values.min() == 0 and values.max() == 1)
    }


def vectors(arrays: Arrays, n_cells: int) -> dict[str, Floats]:
    """Return the arrays of three components of the cells, shape (n_cells, 3)."""
    return {
        name: values.astype(np.float64)
        for name, values in arrays.items()
        if values.dtype.kind in "fiu" and values.shape == (n_cells, 3)
    }


def cell_groups(cells: Sequence[Cells], arrays: Arrays) -> dict[str, Ints]:
    """Return groups of cells: ARRAY of truth values, else ARRAY-VALUE, of the cells of the highest dimension."""
    dims = np.zeros(sum(len(block.numbers) for block in cells), dtype=np.int64)
    for block in cells:
        dims[block.numbers] = block.dim
    groups = {}
    for name, values in _choices(arrays):
        if values.dtype.kind == "b":  # arrays of PyVista; bits of files are numbers
            groups[name] = np.flatnonzero(values)
            continue
        distinct = np.unique(values)
        for value in distinct if len(distinct) <= _MOST_VALUES else []:
            members = np.flatnonzero(values == value)
            groups[f"{name}-{int(value)}"] = members[dims[members] == dims[members].max()]
    return groups
