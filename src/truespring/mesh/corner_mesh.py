"""The mesh of the corners of a grid's cells, used to draw results and to find the boundary."""

from collections.abc import Iterator

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.cells import CELL_SHAPES
from truespring.mesh.facets import divided
from truespring.mesh.grid import Grid
from truespring.mesh.kinds import ELEMENT_KINDS, MIXED
from truespring.mesh.merged import kinds_in, mirrored, mixed_table, repeats
from truespring.mesh.mesh import Mesh


def corner_mesh(grid: Grid) -> tuple[Mesh, Ints]:
    """Return a mesh of the corners of a grid's cells, and the grid point of each of its nodes, ascending, shape (n,).

    Cells become first-order elements. If corners of a cell coincide, all cells are divided into triangles or
    tetrahedra, consistently on shared faces. A surface becomes the lines of its edges; points become the minimum
    spanning tree. Inverted elements are mirrored. Raises MeshError if the result is not a valid mesh.
    """
    element, elements = _elements(grid)
    nodes, local = np.unique(elements, return_inverse=True)
    elements = local.reshape(elements.shape)
    points = grid.points[nodes]
    notes: tuple[str, ...] = ()
    if element != "line":
        is_mirrored = np.zeros(len(elements), dtype=bool)
        for kind, numbers, own in kinds_in(elements, element):
            is_mirrored[numbers] = _orientation(points, own, kind) < 0
        elements = mirrored(elements, element, is_mirrored)
        is_whole = len(elements) == sum(len(cells) for cells in grid.cells.values())
        if is_whole and is_mirrored.any() and not is_mirrored.all():  # all are if an axis is reversed
            notes = (f"{is_mirrored.sum()} of {len(elements)} elements are inverted and were mirrored",)
    return Mesh(points, elements, element, notes=notes), nodes


def _elements(grid: Grid) -> tuple[str, Ints]:
    corners = {kind: cells[:, : len(CELL_SHAPES[kind].corners)] for kind, cells in grid.cells.items()}
    if not grid.fills:
        return "line", _lines(grid, corners)
    bases = {CELL_SHAPES[kind].base for kind in corners}
    plain = {kind.vtk: name for name, kind in ELEMENT_KINDS.items()}
    whole = [cells for cells in corners.values() if not repeats(cells).any()]
    if bases <= plain.keys() and len(whole) == len(corners):
        of_base: dict[str, list[Ints]] = {}
        for kind, cells in corners.items():
            of_base.setdefault(plain[CELL_SHAPES[kind].base], []).append(cells)
        if len(of_base) == 1:
            return plain[bases.pop()], np.concatenate(list(corners.values()))
        return MIXED, mixed_table({kind: np.concatenate(cells) for kind, cells in of_base.items()})
    simplices = np.concatenate([one for kind, cells in corners.items() for one in _simplices(kind, cells)])
    simplices = simplices[~repeats(simplices)]
    if not len(simplices):
        raise MeshError("all cells are flat")
    size = np.abs(_orientation(grid.points, simplices, _SIMPLEX[grid.dim]))
    longest = np.linalg.norm(grid.points[simplices] - grid.points[simplices[:, :1]], axis=2).max(axis=1)
    return _SIMPLEX[grid.dim], simplices[size > 1e-9 * longest**grid.dim]


_SIMPLEX = {2: "triangle", 3: "tetrahedron"}


def _lines(grid: Grid, corners: dict[str, Ints]) -> Ints:
    if not corners:
        return _spanning_lines(grid.points)
    edges = [
        cells[:, [one, other]]
        for kind, cells in corners.items()
        for facet in (CELL_SHAPES[kind].facets if CELL_SHAPES[kind].dim > 1 else ((0, 1),))
        for one, other in [facet]
    ]
    found = np.unique(np.sort(np.concatenate(edges), axis=1), axis=0)
    return np.asarray(found[found[:, 0] < found[:, 1]])


def _spanning_lines(points: Floats) -> Ints:
    """Return the minimum spanning tree of points, over lines to near neighbours and a chain of all points."""
    from scipy import sparse
    from scipy.sparse.csgraph import minimum_spanning_tree
    from scipy.spatial import KDTree

    n_points = len(points)
    if n_points < 2:
        raise MeshError("a single point is not a body: at least two are required")
    found = KDTree(points).query(points, k=np.arange(2, min(9, n_points) + 1))
    distance, near = (np.asarray(one) for one in found)
    start = np.concatenate([np.repeat(np.arange(n_points), near.shape[1]), np.arange(n_points - 1)])
    end = np.concatenate([near.ravel(), np.arange(1, n_points)])
    length = np.concatenate([distance.ravel(), np.linalg.norm(np.diff(points, axis=0), axis=1)])
    shortest = 1e-12 * max(float(length.max()), np.finfo(float).tiny)  # a length of zero means that there is no line
    length = np.maximum(length, shortest)
    low, high = np.minimum(start, end), np.maximum(start, end)
    _, first = np.unique(low * n_points + high, return_index=True)  # a pair may be listed by both of its points
    graph = sparse.coo_array((length[first], (low[first], high[first])), shape=(n_points, n_points))
    tree = minimum_spanning_tree(graph.tocsr()).tocoo()
    return np.stack([tree.row, tree.col], axis=1).astype(np.int64)


def _simplices(kind: str, cells: Ints) -> Iterator[Ints]:
    """Yield the triangles or tetrahedra of cells, as `in_simplices` divides elements."""
    shape = CELL_SHAPES[CELL_SHAPES[kind].base]
    lowest = cells.argmin(axis=1)
    for corner in range(cells.shape[1]):
        here = cells[lowest == corner]
        for facet in shape.facets:
            if corner in facet or not len(here):
                continue
            for part in divided(here[:, list(facet)]):
                yield np.concatenate([here[:, [corner]], part], axis=1)


def _orientation(points: Floats, elements: Ints, element: str) -> Floats:
    """Return the sum of the corner Jacobians of each element, negative if it is inverted, shape (n_elements,)."""
    total = np.zeros(len(elements))
    for first, *others in ELEMENT_KINDS[element].corners:
        spans = points[elements[:, others]] - points[elements[:, first]][:, None]
        total += np.linalg.det(spans)
    return total
