"""Meshes and solutions as grids of PyVista."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats, Ints, in_space
from truespring.errors import OutputError
from truespring.mesh import CELL_SHAPES, Mesh
from truespring.mesh.files.vtk_grid import WEDGE
from truespring.report.series import snapshot_of
from truespring.showing.levels import state_of
from truespring.solution import Solution

if TYPE_CHECKING:
    import pyvista


def solution_grid(solution: Solution, level: int, warped: bool) -> "pyvista.UnstructuredGrid":
    """Return a state as a grid, see `Solution.to_pyvista`."""
    state = state_of(solution, level) if solution.states else None
    snapshot = snapshot_of(solution, state)
    points = in_space(snapshot.points)
    moved = snapshot.point_arrays.get("displacement")
    if warped and moved is not None:
        points = points + moved
    return _grid(points, snapshot.cells, snapshot.point_arrays, snapshot.cell_arrays)


def mesh_grid(mesh: Mesh) -> "pyvista.UnstructuredGrid":
    """Return a mesh as a grid with its groups, see `Mesh.to_pyvista`."""
    numbers = np.concatenate([numbers for numbers, _ in mesh.blocks])
    grid = _grid(in_space(mesh.nodes), [*mesh.cells.items()], {}, {})
    for name, nodes in mesh.node_groups.items():
        grid.point_data[name] = np.isin(np.arange(mesh.n_nodes), nodes)
    for name, elements in mesh.element_groups.items():
        grid.cell_data[name] = np.isin(numbers, elements)
    return grid


def _grid(
    points: Floats,
    cells: Sequence[tuple[str, Ints]],
    point_arrays: Mapping[str, NDArray[Any]],
    cell_arrays: Mapping[str, NDArray[Any]],
) -> "pyvista.UnstructuredGrid":
    try:
        import pyvista
    except ImportError:
        raise OutputError("PyVista is not installed: pip install 'truespring[3d]'") from None
    blocks = [(kind, nodes[:, WEDGE] if kind == "wedge" else nodes) for kind, nodes in cells]
    listed = [np.column_stack([np.full(len(nodes), nodes.shape[1]), nodes]).ravel() for _, nodes in blocks]
    types = [np.full(len(nodes), CELL_SHAPES[kind].vtk_type, dtype=np.uint8) for kind, nodes in blocks]
    none = np.zeros(0, dtype=np.int64)
    grid = pyvista.UnstructuredGrid(np.concatenate([none, *listed]), np.concatenate([none, *types]), points)
    grid.point_data.update(dict(point_arrays))
    grid.cell_data.update(dict(cell_arrays))
    return grid
