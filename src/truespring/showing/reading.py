"""Meshes of PyVista and meshio as meshes of truespring, by the code that reads files."""

from typing import Any

import numpy as np

from truespring.arrays import Ints, in_space
from truespring.errors import MeshError, shown
from truespring.mesh import CELL_SHAPES, Mesh
from truespring.mesh.files.contents import Cells, Contents
from truespring.mesh.files.vtk_grid import Grid, cell_groups, contents, kind_of, point_groups, vectors
from truespring.units import unit_of


def mesh_of_pyvista(grid: Any, unit: str | float, join: bool | None) -> Mesh:
    """Return the mesh of a grid of PyVista, see `Mesh.from_pyvista`."""
    if not hasattr(grid, "cast_to_unstructured_grid"):
        raise MeshError(f"a data set of PyVista is expected, not {shown(grid)}; files are read by truespring.read_mesh")
    scale = unit_of(unit, "length", "unit", MeshError)
    cells = grid.cast_to_unstructured_grid()
    offsets = cells.cell_offsets if hasattr(cells, "cell_offsets") else cells.offset  # before PyVista 0.48
    found = contents(
        Grid(
            np.asarray(cells.points, dtype=float),
            np.asarray(offsets, dtype=np.int64),
            np.asarray(cells.cell_connectivity, dtype=np.int64),
            np.asarray(cells.celltypes, dtype=np.int64),
            {name: np.asarray(cells.point_data[name]) for name in cells.point_data},
            {name: np.asarray(cells.cell_data[name]) for name in cells.cell_data},
        )
    )
    return found.mesh(scale, join)


def mesh_of_meshio(mesh: Any, unit: str | float, join: bool | None) -> Mesh:
    """Return the mesh of a mesh of meshio, see `Mesh.from_meshio`."""
    if not hasattr(mesh, "cells") or not hasattr(mesh, "points"):
        raise MeshError(f"a mesh of meshio is expected, not {shown(mesh)}; files are read by truespring.read_mesh")
    scale = unit_of(unit, "length", "unit", MeshError)
    first, cells = 0, []
    for block in mesh.cells:
        kind = _kind(str(block.type))
        cells.append(_cells(kind, str(block.type), np.asarray(block.data, dtype=np.int64), first))
        first += len(block.data)
    starts = np.cumsum([0, *(len(block.numbers) for block in cells)])
    points = np.asarray(mesh.points, dtype=float)
    return Contents(
        node_numbers=np.arange(len(points)),
        points=in_space(points),
        cells=cells,
        node_groups=_node_groups(mesh),
        cell_groups=_cell_groups(mesh, cells, starts),
        cell_vectors=_vectors(mesh, int(starts[-1])),
    ).mesh(scale, join)


def _kind(name: str) -> str:
    """Return the kind of a cell of meshio, such as "quadrilateral" of "quad8"; raise MeshError for others."""
    if name not in CELL_SHAPES and name != "vertex":
        raise MeshError(
            f"cells of type '{shown(name)}' of meshio are not supported; supported: {', '.join(CELL_SHAPES)}"
        )
    return "vertex" if name == "vertex" else kind_of(CELL_SHAPES[name].vtk_type)


def _cells(kind: str, name: str, nodes: Ints, first: int) -> Cells:
    return Cells(kind, nodes, np.arange(first, first + len(nodes)))


def _node_groups(mesh: Any) -> dict[str, Ints]:
    found = {str(name): np.asarray(nodes, dtype=np.int64).ravel() for name, nodes in mesh.point_sets.items()}
    return {**point_groups({str(name): np.asarray(values) for name, values in mesh.point_data.items()}), **found}


def _cell_groups(mesh: Any, cells: list[Cells], starts: Ints) -> dict[str, Ints]:
    """Return groups of cells: sets, physical groups of gmsh by their names, and values of integer arrays."""
    found: dict[str, Ints] = {}
    arrays = {str(name): np.concatenate([np.asarray(one) for one in parts]) for name, parts in mesh.cell_data.items()}
    physical = arrays.pop("gmsh:physical", None)
    if physical is not None:
        dims = np.concatenate([np.full(len(block.numbers), block.dim) for block in cells])
        names = {(int(tag), int(dim)): str(name) for name, (tag, dim) in mesh.field_data.items()}
        for tag, dim in np.unique(np.stack([physical.astype(np.int64), dims], axis=1), axis=0).tolist():
            if tag:
                found[names.get((tag, dim), str(tag))] = np.flatnonzero((physical == tag) & (dims == dim))
    arrays.pop("gmsh:geometrical", None)
    found = {**cell_groups(cells, arrays), **found}
    for name, parts in mesh.cell_sets.items():
        if not str(name).startswith("gmsh:"):
            members = [start + np.asarray(part, dtype=np.int64) for start, part in zip(starts, parts, strict=False)]
            found[str(name)] = np.concatenate([np.zeros(0, dtype=np.int64), *members])
    return found


def _vectors(mesh: Any, n_cells: int) -> dict[str, Any]:
    arrays = {str(name): np.concatenate([np.asarray(one) for one in parts]) for name, parts in mesh.cell_data.items()}
    return vectors(arrays, n_cells)
