"""The surface of an exported body as triangles, or its springs as lines where it has no elements."""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Ints
from truespring.exports.whole import Whole
from truespring.mesh.facets import triangles_of


class Cells(NamedTuple):
    """Cells and their nodes.

    Attributes:
        nodes: numbers of the nodes that occur, ascending, shape (n,).
        cells: rows of `nodes` of each cell, shape (n_cells, 2, 3 or 4): lines, triangles or tetrahedra.
    """

    nodes: Ints
    cells: Ints


def cells_of(cells: Ints) -> Cells:
    """Return cells given by their nodes, shape (n_cells, k)."""
    nodes, rows = np.unique(cells, return_inverse=True)
    return Cells(nodes, rows.reshape(cells.shape))


def is_surface(cells: Cells) -> bool:
    """Return whether the cells are triangles, not lines."""
    return bool(cells.cells.shape[1] > len("ab"))


def surface_of(whole: Whole) -> Cells:
    """Return the triangles of the surface, anticlockwise seen from outside; of a plane body those of its elements.

    Elements of second order are flat between their corners here. Bodies without elements are lines.
    """
    mesh = whole.exported.problem.mesh
    if mesh.element == "line":
        return cells_of(whole.springs)
    return cells_of(triangles_of(mesh.elements if mesh.dim == 2 else mesh.boundary))
