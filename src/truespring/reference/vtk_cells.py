"""Names of cells: of VTK's numbers, and of what mesh files hold."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from truespring.arrays import Bools, Ints
from truespring.errors import ReferenceFileError
from truespring.mesh.files.contents import Cells

#: By VTK's number of the type: meshio's name. Pixels and voxels (8, 11) are cells in another order of nodes.
VTK_NAMES: Mapping[int, str] = {
    **{3: "line", 5: "triangle", 8: "quad", 9: "quad", 10: "tetra", 11: "hexahedron", 12: "hexahedron", 13: "wedge"},
    **{14: "pyramid", 21: "line3", 22: "triangle6", 23: "quad8", 24: "tetra10", 25: "hexahedron20", 26: "wedge15"},
    **{27: "pyramid13", 28: "quad9", 29: "hexahedron27", 32: "wedge18"},
}
#: Vertices: points alone.
VTK_POINTS = (1, 2)
#: No cell: what Ansys' reader makes of elements that no body has, such as those of contact.
VTK_EMPTY = 0

_CORNERS = {"line": 2, "triangle": 3, "quad": 4, "tetra": 4, "hexahedron": 8, "wedge": 6, "pyramid": 5}

# By kind and number of nodes.
_NAMES = {
    **{("line", 2): "line", ("line", 3): "line3", ("triangle", 3): "triangle", ("triangle", 6): "triangle6"},
    **{("quadrilateral", 4): "quad", ("quadrilateral", 8): "quad8", ("quadrilateral", 9): "quad9"},
    **{("tetrahedron", 4): "tetra", ("tetrahedron", 10): "tetra10", ("hexahedron", 8): "hexahedron"},
    **{("hexahedron", 20): "hexahedron20", ("hexahedron", 27): "hexahedron27", ("wedge", 6): "wedge"},
    **{("wedge", 15): "wedge15", ("wedge", 18): "wedge18", ("pyramid", 5): "pyramid", ("pyramid", 13): "pyramid13"},
}


def named(blocks: Iterable[Cells], file: Path) -> dict[str, Ints]:
    """Return the nodes of the cells by meshio's name, without vertices; raise where a kind is not read."""
    found: dict[str, list[Ints]] = {}
    for block in blocks:
        if block.kind == "vertex":
            continue
        name = _NAMES.get((block.kind, block.nodes.shape[1]))
        if name is None:
            raise ReferenceFileError(
                f"{file}: a {block.kind} of {block.nodes.shape[1]} nodes is not read; {', '.join(_NAMES.values())} are"
            )
        found.setdefault(name, []).append(block.nodes)
    return {name: np.concatenate(nodes) for name, nodes in found.items()}


def refuse_unknown(types: Ints, file: Path) -> None:
    """Raise ReferenceFileError where a cell is of a type that is not read."""
    for number in np.unique(types).tolist():
        if number not in VTK_NAMES and number not in VTK_POINTS:
            raise ReferenceFileError(
                f"{file}: cells of VTK's type {number} are not read; {', '.join(dict.fromkeys(VTK_NAMES.values()))} are"
            )


def sized(types: Ints, offsets: Ints, connectivity: Ints, is_made: Bools, file: Path) -> tuple[dict[str, Ints], int]:
    """Return cells whose order is told by their number of nodes alone, as Ansys' reader gives them to VTK.

    Args:
        types: VTK's numbers, of a first order whatever the cells have, shape (n_cells,).
        offsets, connectivity: of the cells, shape (n_cells + 1,) and their points.
        is_made: of the points, whether the reader made them up: cells with such a middle become their corners.
        file: for messages.

    Returns the points of the cells by meshio's name, and how many lost their middles.
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
            raise ReferenceFileError(f"{file}: a {base} of {size} nodes is not read")
        lost = np.asarray(is_made[nodes].any(axis=1))
        n_lost += int(lost.sum())
        found.setdefault(name, []).append(nodes[~lost])
        found.setdefault(base, []).append(nodes[lost][:, : _CORNERS[base]])
    joined = {name: np.concatenate(blocks) for name, blocks in found.items()}
    return {name: nodes for name, nodes in joined.items() if len(nodes)}, n_lost
