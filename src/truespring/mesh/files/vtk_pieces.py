"""Join the pieces of a parallel VTK file into one grid."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.files.vtk_grid import Arrays, Grid

# Points of two pieces closer than this, relative to the body's diameter, are merged. The tolerance is smaller than for
# torn meshes (contents.py, 1e-7): pieces hold exact copies of the coordinates.
_SAME_PLACE = 1e-9
# Coordinates above this are taken as damaged; their squares are finite.
_FAR = 1e30
# Flags of ghost cells and hidden cells: duplicate, refined, hidden.
_GHOST = 1 | 8 | 32
# Values of a point in two pieces that differ by more than this, relative to the largest, are reported.
_SAME_VALUE = 1e-6


def one_grid(pieces: Sequence[Grid]) -> Grid:
    """Return one grid of several pieces, without ghost cells, joined where their points coincide.

    Coincident points of the same piece stay distinct. Cells that are in two pieces are read once. Raises MeshError
    if no piece has a point.
    """
    there = [whole for piece in pieces if len(piece.points) and len((whole := _without_ghosts(piece)).points)]
    if not there:
        raise MeshError("there are no points: all pieces are empty")
    return there[0] if len(there) == 1 else _joined(there)


def _without_ghosts(grid: Grid) -> Grid:
    marks = {name.lower(): values for name, values in grid.cell_arrays.items() if values.dtype.kind in "iu"}
    if "vtkghosttype" in marks:
        is_ghost = (marks["vtkghosttype"].ravel() & _GHOST) != 0
    elif "vtkghostlevels" in marks:
        is_ghost = marks["vtkghostlevels"].ravel() > 0
    else:
        return grid
    if len(is_ghost) != len(grid.types) or not is_ghost.any():
        return grid
    own = _of_cells(grid, ~is_ghost)
    # Points that only ghost cells use are removed.
    seen = np.zeros(len(grid.points), dtype=bool)
    seen[_known(grid.connectivity, seen)] = True
    kept = ~seen
    kept[_known(own.connectivity, seen)] = True
    number = np.cumsum(kept) - 1
    if own.connectivity.size and not 0 <= own.connectivity.min() <= own.connectivity.max() < len(kept):
        return own  # damaged: reported when the cells are read
    return own._replace(
        points=own.points[kept],
        connectivity=number[own.connectivity],
        point_arrays={name: values[kept] for name, values in own.point_arrays.items()},
    )


def _known(nodes: Ints, points: Bools) -> Ints:
    return nodes[(nodes >= 0) & (nodes < len(points))]


def _of_cells(grid: Grid, kept: Bools) -> Grid:
    """Return the grid with the cells of `kept`, and all of its points."""
    sizes = np.diff(grid.offsets)
    return grid._replace(
        offsets=np.concatenate([[0], np.cumsum(sizes[kept])]).astype(np.int64),
        connectivity=grid.connectivity[np.repeat(kept, sizes)],
        types=grid.types[kept],
        cell_arrays={name: values[kept] for name, values in grid.cell_arrays.items()},
    )


def _joined(pieces: Sequence[Grid]) -> Grid:
    points = np.concatenate([piece.points for piece in pieces])
    begin = np.cumsum([0, *(len(piece.points) for piece in pieces)])
    owner = np.repeat(np.arange(len(pieces)), np.diff(begin))
    number, first, n_left = _numbered(points, owner)
    point_arrays, differing = _point_arrays([piece.point_arrays for piece in pieces], number, first)
    n_shared = len(points) - len(first)
    whole = Grid(
        points[first],
        np.concatenate([[0], np.cumsum(np.concatenate([np.diff(piece.offsets) for piece in pieces]))]).astype(np.int64),
        np.concatenate([_renumbered(piece, number, at) for piece, at in zip(pieces, begin[:-1], strict=True)]),
        np.concatenate([piece.types for piece in pieces]),
        point_arrays,
        _common([piece.cell_arrays for piece in pieces]),
    )
    cell_owner = np.repeat(np.arange(len(pieces)), [len(piece.types) for piece in pieces])
    is_again = _repeated(whole, cell_owner)
    notes = [
        *dict.fromkeys(note for piece in pieces for note in piece.notes),
        f"{len(pieces)} pieces were joined at the {n_shared} points that they share",
        *([f"{is_again.sum()} cells are in two pieces and were read once"] if is_again.any() else []),
        *([f"at {n_left} positions a piece has several points: pieces were not joined there"] if n_left else []),
        *(
            f"pieces differ in {name} by up to {gap:.2g} of its largest value at points that they share: the first "
            "piece's values are used"
            for name, gap in differing
        ),
    ]
    whole = _of_cells(whole, ~is_again) if is_again.any() else whole
    return whole._replace(notes=tuple(notes))


def _numbered(points: Floats, owner: Ints) -> tuple[Ints, Ints, int]:
    """Return the merged index of each point, the first point of each index, and the number of positions not merged."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import KDTree

    finite = np.flatnonzero((np.abs(points) < _FAR).all(axis=1))
    size = float(np.linalg.norm(np.ptp(points[finite], axis=0))) if finite.size else 0.0
    pairs = finite[KDTree(points[finite]).query_pairs(_SAME_PLACE * size, output_type="ndarray").reshape(-1, 2)]
    n = len(points)
    _, place = connected_components(coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n)))
    # A position with several points of the same piece may be a crack: it is ambiguous which points to merge.
    n_pieces = int(owner.max()) + 1
    key, inverse, counts = np.unique(place.astype(np.int64) * n_pieces + owner, return_inverse=True, return_counts=True)
    apart = np.unique(place[counts[inverse] > 1])
    meets = apart[np.bincount(key // n_pieces)[apart] > 1]
    alone = np.isin(place, apart)
    place = np.where(alone, place.max() + 1 + np.arange(n), place)
    _, first, number = np.unique(place, return_index=True, return_inverse=True)
    order = np.argsort(first)  # in the order of the pieces
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return rank[number], first[order], len(meets)


def _renumbered(piece: Grid, number: Ints, begin: int) -> Ints:
    nodes = piece.connectivity
    if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(piece.points):
        raise MeshError(
            f"a cell names points {nodes.min()} to {nodes.max()}, its piece has 0 to {len(piece.points) - 1}"
        )
    return np.asarray(number[begin + nodes])


def _point_arrays(pieces: Sequence[Arrays], number: Ints, first: Ints) -> tuple[Arrays, list[tuple[str, float]]]:
    """Return the arrays of the merged points, and the names and relative gaps of vectors that differ between pieces."""
    whole = _common(pieces)
    differing = []
    for name, values in whole.items():
        if values.dtype.kind != "f" or values.ndim != 2 or values.shape[1] > 3:
            continue
        with np.errstate(all="ignore"):
            gap = np.abs(values - values[first][number])
            share = float(np.nanmax(gap, initial=0.0) / max(float(np.nanmax(np.abs(values), initial=0.0)), 1e-300))
        if share > _SAME_VALUE:
            differing.append((name, share))
    return {name: values[first] for name, values in whole.items()}, differing


def _common(pieces: Sequence[Arrays]) -> dict[str, NDArray[Any]]:
    """Return the arrays that all pieces have with the same shape of rows, concatenated."""
    return {
        name: np.concatenate([piece[name] for piece in pieces])
        for name, values in pieces[0].items()
        if all(name in piece and piece[name].shape[1:] == values.shape[1:] for piece in pieces)
    }


def _repeated(grid: Grid, owner: Ints) -> Bools:
    """Return which cells repeat a cell of an earlier piece, by their points, shape (n_cells,)."""
    is_again = np.zeros(len(grid.types), dtype=bool)
    sizes = np.diff(grid.offsets)
    for size in np.unique(sizes).tolist():
        members = np.flatnonzero(sizes == size)
        nodes = np.sort(grid.connectivity[grid.offsets[members, None] + np.arange(size)], axis=1)
        _, first, same = np.unique(nodes, axis=0, return_index=True, return_inverse=True)
        is_again[members] = owner[members] != owner[members[first]][same.ravel()]
    return is_again
