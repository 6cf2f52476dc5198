"""Meshes and solutions as grids of PyVista."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Bools, Floats, Ints, in_space
from truespring.errors import OutputError
from truespring.mesh import CELL_SHAPES, Mesh, edge_numbers
from truespring.mesh.files.vtk_grid import FACETS, WEDGE
from truespring.report.series import snapshot_of
from truespring.showing.levels import state_of
from truespring.solution import Solution

if TYPE_CHECKING:
    import pyvista

_Arrays = Mapping[str, NDArray[Any]]

# VTK's type of each kind of cell.
_TYPES = {"vertex": 1, **{kind: shape.vtk_type for kind, shape in CELL_SHAPES.items()}}

# Cells of second order, by those of first order: of triangles and tetrahedra with middle nodes.
_SECOND_ORDER = {"triangle": "triangle6", "tetra": "tetra10"}


def solution_grid(solution: Solution, level: int, warped: bool) -> "pyvista.UnstructuredGrid":
    """Return a state as a grid, see `Solution.to_pyvista`."""
    state = state_of(solution, level) if solution.states else None
    snapshot = snapshot_of(solution, state)
    points = in_space(snapshot.points)
    cells = _vertices(len(points)) if solution.is_cloud else snapshot.cells
    if warped and state is not None:
        points = points + snapshot.point_arrays["displacement"]
    return _grid(points, cells, snapshot.point_arrays, snapshot.cell_arrays)


def _vertices(n_points: int) -> list[tuple[str, Ints]]:
    """Return a cell for each point."""
    return [("vertex", np.arange(n_points)[:, None])]


def mesh_grid(mesh: Mesh) -> "pyvista.UnstructuredGrid":
    """Return a mesh as a grid, see `Mesh.to_pyvista`."""
    order = np.concatenate([numbers for numbers, _ in mesh.blocks])
    points, cells = _with_middles(mesh)
    n_points, n_elements = len(points), len(mesh.elements)
    of_elements: dict[str, NDArray[Any]] = {
        **{name: _within(members, n_elements)[order] for name, members in mesh.element_groups.items()},
        **{f"{FACETS}{name}": _bits(facets, n_elements)[order] for name, facets in mesh.facet_groups.items()},
        **{name: in_space(vectors)[order] for name, vectors in mesh.element_vectors.items()},
    }
    of_points = {name: _within(nodes, n_points) for name, nodes in mesh.node_groups.items()}
    return _grid(in_space(points), cells, of_points, of_elements)


def _with_middles(mesh: Mesh) -> tuple[Floats, list[tuple[str, Ints]]]:
    """Return points and cells; with middle nodes, these are the last points, and cells are of second order."""
    if mesh.middles is None:
        return mesh.nodes, [*mesh.cells.items()]
    between = edge_numbers(mesh, mesh.elements[:, np.array(mesh.kind.edges)])
    cells = np.concatenate([mesh.elements, mesh.n_nodes + between], axis=1)
    return np.concatenate([mesh.nodes, mesh.middles]), [(_SECOND_ORDER[mesh.kind.vtk], cells)]


def _within(members: Ints, n: int) -> Bools:
    """Return whether each of `n` numbers is a member, shape (n,)."""
    inside = np.zeros(n, dtype=bool)
    inside[members] = True
    return inside


def _bits(facets: Ints, n_elements: int) -> Ints:
    """Return for each element a number whose bit i is set if facet i belongs to a group, shape (n_elements,)."""
    bits = np.zeros(n_elements, dtype=np.int64)
    np.bitwise_or.at(bits, facets[:, 0], 1 << facets[:, 1])
    return bits


def _grid(
    points: Floats, cells: Sequence[tuple[str, Ints]], point_arrays: _Arrays, cell_arrays: _Arrays
) -> "pyvista.UnstructuredGrid":
    try:
        import pyvista
    except ImportError:
        raise OutputError("PyVista is not installed: pip install 'truespring[3d]'") from None
    blocks = [(kind, nodes[:, WEDGE] if kind == "wedge" else nodes) for kind, nodes in cells]
    listed = [np.column_stack([np.full(len(nodes), nodes.shape[1]), nodes]).ravel() for _, nodes in blocks]
    types = [np.full(len(nodes), _TYPES[kind], dtype=np.uint8) for kind, nodes in blocks]
    none = np.zeros(0, dtype=np.int64)
    grid = pyvista.UnstructuredGrid(np.concatenate([none, *listed]), np.concatenate([none, *types]), points)
    grid.point_data.update(dict(point_arrays))
    grid.cell_data.update(dict(cell_arrays))
    return grid
