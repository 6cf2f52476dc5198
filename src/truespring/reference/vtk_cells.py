"""Names of cells by VTK type, and by kind and number of nodes."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from truespring.arrays import Bools, Ints
from truespring.errors import ReferenceFileError
from truespring.mesh.cells import CELL_SHAPES
from truespring.mesh.files.contents import Cells
from truespring.mesh.kinds import ELEMENT_KINDS

#: Key in CELL_SHAPES by VTK type. Pixels (8) and voxels (11) are cells with another node order.
VTK_NAMES: Mapping[int, str] = {
    **{shape.vtk_type: name for name, shape in CELL_SHAPES.items()},
    **{8: "quad", 11: "hexahedron"},
}
#: VTK types of vertices.
VTK_POINTS = (1, 2)
#: VTK type of no cell: the reader of Ansys files assigns it to elements without volume, such as contact elements.
VTK_EMPTY = 0

_CORNERS = {name: len(shape.corners) for name, shape in CELL_SHAPES.items() if name == shape.base}

_KINDS = {kind.vtk: name for name, kind in ELEMENT_KINDS.items()}
# Key in CELL_SHAPES by element kind and number of nodes.
_NAMES = {(_KINDS[shape.base], len(shape.places)): name for name, shape in CELL_SHAPES.items()}


def named(blocks: Iterable[Cells], file: Path) -> dict[str, Ints]:
    """Return the nodes of cells by key of CELL_SHAPES, shape (n, k), without vertices.

    Raise if a kind is not supported.
    """
    found: dict[str, list[Ints]] = {}
    for block in blocks:
        if block.kind == "vertex":
            continue
        name = _NAMES.get((block.kind, block.nodes.shape[1]))
        if name is None:
            raise ReferenceFileError(
                f"{file}: a {block.kind} of {block.nodes.shape[1]} nodes is not supported; supported: "
                f"{', '.join(_NAMES.values())}"
            )
        found.setdefault(name, []).append(block.nodes)
    return {name: np.concatenate(nodes) for name, nodes in found.items()}


def refuse_unknown(types: Ints, file: Path) -> None:
    """Raise ReferenceFileError if the VTK type of a cell is not supported."""
    for number in np.unique(types).tolist():
        if number not in VTK_NAMES and number not in VTK_POINTS:
            raise ReferenceFileError(
                f"{file}: cells of VTK's type {number} are not supported; supported: "
                f"{', '.join(dict.fromkeys(VTK_NAMES.values()))}"
            )


def sized(types: Ints, offsets: Ints, connectivity: Ints, is_made: Bools, file: Path) -> tuple[dict[str, Ints], int]:
    """Return cells whose order follows from their number of nodes, as Ansys' reader passes them to VTK.

    Args:
        types: VTK types of first-order cells, also for second-order ones, shape (n_cells,).
        offsets, connectivity: points of the cells as in VTK; offsets of shape (n_cells + 1,).
        is_made: whether the reader invented a point, shape (n_points,): cells with such points become first order.
        file: file for messages.

    Returns the points of the cells by key of CELL_SHAPES, and the number of cells that became first order.
    """
    refuse_unknown(types[types != VTK_EMPTY], file)
    n_lost = 0
    found: dict[str, list[Ints]] = {}
    for number, size in np.unique(np.stack([types, np.diff(offsets)], axis=1), axis=0).tolist():
        if number in (*VTK_POINTS, VTK_EMPTY):
            continue
        base = VTK_NAMES[number].rstrip("0123456789")
        members = np.flatnonzero((types == number) & (np.diff(offsets) == size))
        nodes = connectivity[offsets[members, None] + np.arange(size)]
        name = base if size == _CORNERS[base] else f"{base}{size}"
        if name not in VTK_NAMES.values():
            raise ReferenceFileError(f"{file}: a {base} of {size} nodes is not supported")
        lost = np.asarray(is_made[nodes].any(axis=1))
        n_lost += int(lost.sum())
        found.setdefault(name, []).append(nodes[~lost])
        found.setdefault(base, []).append(nodes[lost][:, : _CORNERS[base]])
    joined = {name: np.concatenate(blocks) for name, blocks in found.items()}
    return {name: nodes for name, nodes in joined.items() if len(nodes)}, n_lost
