"""Grids of cells of any kinds, and interpolation in them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints, frozen_floats, frozen_ints
from truespring.errors import MeshError
from truespring.mesh.cells import CELL_SHAPES, CellShape

# Tolerance outside of all cells as a fraction of the diameter: sides may be chords of a curve.
_OUTSIDE = 1e-3

# Newton's method for reference coordinates: tolerance of a step, number of steps.
_FOUND = 1e-12
_MOST_STEPS = 30
_FAR = 4.0  # coordinates beyond this have diverged

# Number of pairs of a place and a cell per block: limits the memory.
_BLOCK = 200_000


@dataclass(frozen=True, eq=False)
class Interpolation:
    """Interpolation from the points of a grid to other places.

    Attributes:
        weights: sparse, shape (n_places, n_points): rows sum to 1. Just outside the grid, within a tolerance, the
            nearest cell is extrapolated; farther outside, the value is that of the nearest point.
        distance: to the grid [m], zero inside, shape (n_places,).
        outside: whether a place lies outside of the body, shape (n_places,).
    """

    weights: sparse.csr_array[Any]
    distance: Floats
    outside: Bools

    def carry(self, values: Floats) -> Floats:
        """Return interpolated `values`, shape (n_points, ...) in any unit, as shape (n_places, ...)."""
        return np.asarray(self.weights @ values)


@dataclass(frozen=True, eq=False)
class Grid:
    """Points and cells of any kinds.

    Attributes:
        points: undeformed positions [m], shape (n_points, dim).
        cells: point numbers by a key of CELL_SHAPES, in VTK's order, shape (n_cells, k).

    Raises MeshError if a kind is unknown or a cell names a point that does not exist.
    """

    points: Floats
    cells: Mapping[str, Ints]

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "points", frozen_floats(self.points, (None, None), "points"))
            frozen = {}
            for kind, cells in self.cells.items():
                if kind not in CELL_SHAPES:
                    raise MeshError(f"cells of kind '{kind}' are not supported; supported: {', '.join(CELL_SHAPES)}")
                frozen[kind] = frozen_ints(cells, (None, len(CELL_SHAPES[kind].powers)), f"cells of kind {kind}")
                if cells.size and not 0 <= frozen[kind].min() <= frozen[kind].max() < len(self.points):
                    raise MeshError(
                        f"cells of kind {kind} name points {cells.min()} to {cells.max()}, there are 0 to "
                        f"{len(self.points) - 1}"
                    )
        except ValueError as error:
            raise MeshError(str(error)) from None
        filled = {kind: cells for kind, cells in frozen.items() if len(cells)}
        most = max((CELL_SHAPES[kind].dim for kind in filled), default=0)
        body = {kind: cells for kind, cells in filled.items() if CELL_SHAPES[kind].dim == most}
        object.__setattr__(self, "cells", MappingProxyType(body))  # cells of a lower dimension only bound others

    @property
    def dim(self) -> int:
        """Dimension of the space."""
        return int(self.points.shape[1])

    @property
    def diameter(self) -> float:
        """The diagonal of the bounding box [m]."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @property
    def cell_dim(self) -> int:
        """Dimension of the cells, 0 without cells."""
        return max((CELL_SHAPES[kind].dim for kind in self.cells), default=0)

    @property
    def fills(self) -> bool:
        """Whether the cells have the dimension of the space."""
        return self.cell_dim == self.dim

    def locate(self, places: Floats) -> Interpolation:
        """Return the interpolation to `places` [m], shape (n, dim), from the cells that contain them or are nearest.

        Reference coordinates are found by Newton's method. Far outside, the value is that of the nearest point.
        """
        n_places, width = len(places), max(len(CELL_SHAPES[kind].powers) for kind in self.cells)
        best = np.full(n_places, np.inf)
        columns, shares = np.zeros((n_places, width), dtype=np.int64), np.zeros((n_places, width))
        for number, (kind, cells) in enumerate(self.cells.items()):
            shape = CELL_SHAPES[kind]
            for at, cell in self._bins[number].pairs(places):
                own, away = _found(shape, self.points[cells[cell]], places[at])
                order = np.lexsort((away, at))  # of each place's cells the nearest
                first = order[np.diff(at[order], prepend=-1) > 0]
                nearer = first[away[first] < best[at[first]]]
                rows = at[nearer]
                best[rows] = away[nearer]
                columns[rows], shares[rows] = 0, 0.0
                columns[rows, : cells.shape[1]] = cells[cell[nearer]]
                shares[rows, : cells.shape[1]] = shape.shapes(own[nearer])
        self._stand_in(places, best > self._tolerance, best, columns, shares)
        away = np.where(best > 1e-9 * self.diameter, best, 0.0)
        rows = np.repeat(np.arange(n_places), width)
        weights = sparse.csr_array((shares.ravel(), (rows, columns.ravel())), shape=(n_places, len(self.points)))
        return Interpolation(weights, away, best > self._tolerance)

    def _stand_in(self, places: Floats, missing: Bools, best: Floats, columns: Ints, shares: Floats) -> None:
        """Assign the nearest point to places outside of all cells."""
        from scipy.spatial import KDTree

        if not missing.any():
            return
        used = np.unique(np.concatenate([cells.ravel() for cells in self.cells.values()]))
        distance, near = KDTree(self.points[used]).query(places[missing])
        best[missing] = distance
        columns[missing], shares[missing] = 0, 0.0
        columns[missing, 0], shares[missing, 0] = used[near], 1.0

    @property
    def _tolerance(self) -> float:
        return _OUTSIDE * self.diameter

    @cached_property
    def _bins(self) -> "list[_Bins]":
        return [_Bins(self.points[cells], self._tolerance) for cells in self.cells.values()]


class _Bins:
    """Regular grid of boxes with the cells whose bounding box intersects each."""

    def __init__(self, nodes: Floats, tolerance: float) -> None:
        """Store the nodes of each cell, shape (n_cells, k, dim), and the tolerance around its bounding box [m]."""
        lower, upper = nodes.min(axis=1), nodes.max(axis=1)
        size = upper - lower
        # The nodes of a curved cell do not quite span it.
        room = tolerance + 0.05 * size.max(axis=1, keepdims=True)
        self.lower, self.upper = lower - room, upper + room
        self.origin = self.lower.min(axis=0)
        extent = self.upper.max(axis=0) - self.origin
        self.counts = np.clip(extent / np.maximum(np.median(size, axis=0), 1e-3 * extent), 1, 512).astype(np.int64)
        while self.counts.prod() > 4 * len(nodes) + 64:
            self.counts = np.maximum(self.counts // 2, 1)
        self.size = extent / self.counts
        self.starts, self.members = self._filled()

    def _place(self, at: Floats) -> Ints:
        return np.asarray(np.clip((at - self.origin) / self.size, 0, self.counts - 1).astype(np.int64))

    def _filled(self) -> tuple[Ints, Ints]:
        """Return where each box's cells begin, and the cells box by box."""
        first, last = self._place(self.lower), self._place(self.upper)
        spans = last - first + 1
        count = spans.prod(axis=1)
        cell = np.repeat(np.arange(len(first)), count)
        rest = np.arange(len(cell)) - np.repeat(np.cumsum(count) - count, count)
        box = np.zeros(len(cell), dtype=np.int64)
        for axis in range(first.shape[1]):
            rest, offset = np.divmod(rest, spans[cell, axis])
            box = box * self.counts[axis] + first[cell, axis] + offset
        order = np.argsort(box, kind="stable")
        return np.searchsorted(box[order], np.arange(self.counts.prod() + 1)), cell[order]

    def pairs(self, places: Floats) -> Iterator[tuple[Ints, Ints]]:
        """Yield numbers of places, ascending, and of cells whose box holds them."""
        box = np.zeros(len(places), dtype=np.int64)
        for axis, one in enumerate(self._place(places).T):
            box = box * self.counts[axis] + one
        count = self.starts[box + 1] - self.starts[box]
        ends = np.cumsum(count)
        begin = 0
        while begin < len(places):
            done = ends[begin - 1] if begin else 0
            end = max(begin + 1, int(np.searchsorted(ends, done + _BLOCK, side="right")))
            at = np.repeat(np.arange(begin, end), count[begin:end])
            offset = np.arange(len(at)) - np.repeat(ends[begin:end] - count[begin:end] - done, count[begin:end])
            cell = self.members[self.starts[box[at]] + offset]
            near = ((places[at] >= self.lower[cell]) & (places[at] <= self.upper[cell])).all(axis=1)
            if near.any():
                yield at[near], cell[near]
            begin = end


def _found(shape: CellShape, nodes: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Return reference coordinates of places (n, dim) in cells with `nodes` (n, k, dim), and distances outside [m].

    Coordinates of places outside are extrapolated; of places off a surface they are those of the projection.
    """
    own = np.tile(shape.corners.mean(axis=0), (len(places), 1))
    going = np.arange(len(places))
    for _ in range(_MOST_STEPS):
        jacobian = np.einsum("nka,nkd->nda", shape.slopes(own[going]), nodes[going])
        step = _solved(jacobian, _missing(shape, nodes[going], places[going], own[going]))
        own[going] += step
        going = going[(np.abs(step).max(axis=1) > _FOUND) & (np.abs(own[going]).max(axis=1) < _FAR)]
        if not going.size:
            break
    lost = np.zeros(len(own), dtype=bool)
    lost[going] = True
    inside = shape.clipped(own)
    away = np.linalg.norm(_missing(shape, nodes, places, inside), axis=1)
    lost |= np.abs(own).max(axis=1) >= _FAR
    return np.where(lost[:, None], inside, own), np.asarray(away)


def _missing(shape: CellShape, nodes: Floats, places: Floats, own: Floats) -> Floats:
    return np.asarray(places - np.einsum("nk,nkd->nd", shape.shapes(own), nodes))


def _solved(jacobian: Floats, missing: Floats) -> Floats:
    """Return the Newton steps, at most 1: least squares on a surface, zero in a degenerate cell."""
    turned = jacobian.swapaxes(1, 2)
    normal, right = turned @ jacobian, turned @ missing[:, :, None]
    size = np.einsum("naa->n", normal) / normal.shape[1]
    flat = np.abs(np.linalg.det(normal)) <= 1e-20 * size ** normal.shape[1]
    normal[flat], right[flat] = np.eye(normal.shape[1]), 0.0
    return np.clip(np.linalg.solve(normal, right)[:, :, 0], -1.0, 1.0)
