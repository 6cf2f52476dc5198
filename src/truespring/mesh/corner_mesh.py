"""The mesh of a grid's corners: what is drawn of a result, and what bounds its body."""

from collections.abc import Iterator

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.cells import CELL_SHAPES
from truespring.mesh.grid import Grid
from truespring.mesh.kinds import ELEMENT_KINDS, MIXED
from truespring.mesh.merged import kinds_in, merged, mirrored
from truespring.mesh.mesh import Mesh


def corner_mesh(grid: Grid) -> tuple[Mesh, Ints]:
    """Return a mesh of a grid's corners and the number in the grid of each of its nodes, ascending.

    Cells become elements of first order. Where corners of some are one, all become triangles or tetrahedra, which meet
    face to face. What has no inside becomes lines: the edges of a surface; of points alone the shortest lines that join
    them all. Elements of either orientation are turned one by one. Raises MeshError where that is no mesh.
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
        if is_whole and is_mirrored.any() and not is_mirrored.all():  # all are where an axis is turned
            notes = (f"{is_mirrored.sum()} of {len(elements)} elements are inverted and were mirrored",)
    return Mesh(points, elements, element, notes=notes), nodes


def _elements(grid: Grid) -> tuple[str, Ints]:
    corners = {kind: cells[:, : len(CELL_SHAPES[kind].corners)] for kind, cells in grid.cells.items()}
    if not grid.fills:
        return "line", _lines(grid, corners)
    bases = {CELL_SHAPES[kind].base for kind in corners}
    plain = {kind.vtk: name for name, kind in ELEMENT_KINDS.items()}
    whole = [cells for cells in corners.values() if not _collapsed(cells).any()]
    if bases <= plain.keys() and len(whole) == len(corners):
        of_base: dict[str, list[Ints]] = {}
        for kind, cells in corners.items():
            of_base.setdefault(plain[CELL_SHAPES[kind].base], []).append(cells)
        if len(of_base) == 1:
            return plain[bases.pop()], np.concatenate(list(corners.values()))
        return MIXED, merged({kind: np.concatenate(cells) for kind, cells in of_base.items()})
    simplices = np.concatenate([one for kind, cells in corners.items() for one in _simplices(kind, cells)])
    simplices = simplices[~_collapsed(simplices)]
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
    """The shortest lines that join all points, among those to near neighbours and a chain that joins what is left."""
    from scipy import sparse
    from scipy.sparse.csgraph import minimum_spanning_tree
    from scipy.spatial import KDTree

    n_points = len(points)
    if n_points < 2:
        raise MeshError("a single point is no body: two or more are wanted")
    found = KDTree(points).query(points, k=np.arange(2, min(9, n_points) + 1))
    distance, near = (np.asarray(one) for one in found)
    start = np.concatenate([np.repeat(np.arange(n_points), near.shape[1]), np.arange(n_points - 1)])
    end = np.concatenate([near.ravel(), np.arange(1, n_points)])
    length = np.concatenate([distance.ravel(), np.linalg.norm(np.diff(points, axis=0), axis=1)])
    length = np.maximum(length, 1e-12 * max(float(length.max()), np.finfo(float).tiny))  # nothing long is no line there
    low, high = np.minimum(start, end), np.maximum(start, end)
    _, first = np.unique(low * n_points + high, return_index=True)  # both ends may name a pair
    graph = sparse.coo_array((length[first], (low[first], high[first])), shape=(n_points, n_points))
    tree = minimum_spanning_tree(graph.tocsr()).tocoo()
    return np.stack([tree.row, tree.col], axis=1).astype(np.int64)


def _collapsed(cells: Ints) -> Bools:
    """Whether a cell names a point twice, shape (n_cells,)."""
    ordered = np.sort(cells, axis=1)
    return np.asarray((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))


def _simplices(kind: str, cells: Ints) -> Iterator[Ints]:
    """Yield triangles or tetrahedra: of each cell those that its lowest point spans with what bounds it elsewhere.

    Faces of four corners are divided from their own lowest point on, so that neighbours divide them alike.
    Source: Dompierre, Labbe, Vallet, Camarero, How to subdivide pyramids, prisms, and hexahedra into tetrahedra (1999).
    """
    shape = CELL_SHAPES[CELL_SHAPES[kind].base]
    lowest = cells.argmin(axis=1)
    for corner in range(cells.shape[1]):
        here = cells[lowest == corner]
        for facet in shape.facets:
            if corner in facet or not len(here):
                continue
            for part in _divided(here[:, list(facet)]):
                yield np.concatenate([here[:, [corner]], part], axis=1)


def _divided(facets: Ints) -> list[Ints]:
    """Triangles as they are, and edges; quadrilaterals as two triangles from their lowest point on."""
    if facets.shape[1] < 4:
        return [facets]
    around = (facets.argmin(axis=1)[:, None] + np.arange(4)) % 4
    turned = np.take_along_axis(facets, around, axis=1)
    return [turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]]


def _orientation(points: Floats, elements: Ints, element: str) -> Floats:
    """The sum of the corner Jacobians of each element, negative where it is inverted, shape (n_elements,)."""
    total = np.zeros(len(elements))
    for first, *others in ELEMENT_KINDS[element].corners:
        spans = points[elements[:, others]] - points[elements[:, first]][:, None]
        total += np.linalg.det(spans)
    return total
