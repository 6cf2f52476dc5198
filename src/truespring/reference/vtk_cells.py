"""Names of cells: of VTK's numbers, and of what mesh files hold."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from truespring.arrays import Ints
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
