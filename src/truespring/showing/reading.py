"""Meshes of PyVista and meshio as meshes of truespring, by the code that reads files."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Ints, in_space
from truespring.errors import MeshError, shown
from truespring.mesh import CELL_SHAPES, Mesh
from truespring.mesh.files.contents import Cells, Contents
from truespring.mesh.files.vtk_grid import Grid, cell_groups, contents, kind_of, point_groups, vectors
from truespring.units import unit_of

# Arrays of meshio's reader of gmsh: the number of the physical group of a cell, and of its geometrical entity.
_PHYSICAL, _ENTITY = "gmsh:physical", "gmsh:geometrical"


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
    points = np.asarray(mesh.points, dtype=float)
    arrays = {str(name): np.concatenate([np.asarray(one) for one in parts]) for name, parts in mesh.cell_data.items()}
    cells, number = _cells(mesh, repeated=_PHYSICAL in arrays)
    members = {name: group for groups in _groups(mesh, arrays) for name, group in groups.items()}
    return Contents(
        node_numbers=np.arange(len(points)),
        points=in_space(points),
        cells=cells,
        node_groups={
            **point_groups({str(name): np.asarray(values) for name, values in mesh.point_data.items()}),
            **{str(name): np.asarray(nodes, dtype=np.int64).ravel() for name, nodes in mesh.point_sets.items()},
        },
        cell_groups={name: np.unique(number[group]) for name, group in members.items()},
        cell_vectors=vectors(arrays, len(number)),
    ).mesh(scale, join)


def _kind(name: str) -> str:
    """Return the kind of a cell of meshio, such as "quadrilateral" of "quad8"; raise MeshError for others."""
    if name == "vertex":
        return name
    if name not in CELL_SHAPES:
        raise MeshError(f"cells of type '{name}' of meshio are not supported; supported: {', '.join(CELL_SHAPES)}")
    return kind_of(CELL_SHAPES[name].vtk_type)


def _cells(mesh: Any, repeated: bool) -> tuple[list[Cells], Ints]:
    """Return the cells by type, numbered block after block, and the number of each.

    With `repeated`, cells with the same nodes in the same order are one: gmsh's version 2 repeats a cell for each of
    its physical groups.
    """
    found, alias = [], [np.zeros(0, dtype=np.int64)]
    by_type: dict[str, list[Ints]] = {}
    for first, block in zip(_starts(mesh), mesh.cells, strict=True):
        _kind(str(block.type))
        numbers = np.arange(first, first + len(block.data))
        by_type.setdefault(str(block.type), []).append(np.column_stack([numbers, block.data]))
        alias.append(numbers)
    number = np.concatenate(alias)
    for name, tables in by_type.items():
        table = np.concatenate(tables)
        if repeated:
            _, first_of, cell = np.unique(table[:, 1:], axis=0, return_index=True, return_inverse=True)
            number[table[:, 0]] = table[first_of[cell.ravel()], 0]
            table = table[np.sort(first_of)]
        found.append(Cells(_kind(name), table[:, 1:], table[:, 0]))
    return found, number


def _starts(mesh: Any) -> list[int]:
    """Return the number of the first cell of each block."""
    return [0, *np.cumsum([len(block.data) for block in mesh.cells]).tolist()][: len(mesh.cells)]


def _groups(mesh: Any, arrays: dict[str, NDArray[Any]]) -> Iterator[dict[str, Ints]]:
    """Yield groups of cells: of values of integer arrays, physical groups of gmsh by their names, and sets."""
    whole = [
        Cells(_kind(str(block.type)), block.data, np.arange(first, first + len(block.data)))
        for first, block in zip(_starts(mesh), mesh.cells, strict=True)
    ]
    yield cell_groups(whole, {name: values for name, values in arrays.items() if name not in (_PHYSICAL, _ENTITY)})
    if _PHYSICAL in arrays:
        dims = np.concatenate([np.full(len(block.numbers), block.dim) for block in whole])
        yield _physical(arrays[_PHYSICAL].astype(np.int64), dims, mesh.field_data)
    sets = {name: parts for name, parts in mesh.cell_sets.items() if not str(name).startswith("gmsh:")}
    yield {
        str(name): np.concatenate(
            [
                first + np.asarray([] if part is None else part, dtype=np.int64)
                for first, part in zip(_starts(mesh), parts, strict=True)
            ]
        )
        for name, parts in sets.items()
    }


def _physical(tags: Ints, dims: Ints, field_data: Any) -> dict[str, Ints]:
    """Return the physical groups of cells by their names, or by their numbers without one."""
    names = {(int(tag), int(dim)): str(name) for name, (tag, dim) in field_data.items()}
    return {
        names.get((tag, dim), str(tag)): np.flatnonzero((tags == tag) & (dims == dim))
        for tag, dim in np.unique(np.stack([tags, dims], axis=1), axis=0).tolist()
        if tag
    }
