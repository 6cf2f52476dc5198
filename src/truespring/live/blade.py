"""A plane blade, and the elements that it passes."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Self

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import LiveError
from truespring.mesh import Mesh

# Over the size of the body: the blade is moved so far along its normal, so that one that lies in facets between
# elements passes those on one side; what it enters by less is not passed.
_BESIDE, _TOUCHED = 1e-9, 1e-10
# A blade is a line, and a direction is none, where a product of vectors is smaller than this share of their lengths.
_PARALLEL = 1e-9


@dataclass(frozen=True, eq=False)
class Blade:
    """A line in the plane, a parallelogram in space.

    Attributes:
        start: a corner [m], shape (dim,).
        sides: from there along the stroke and, in space, into the depth [m], shape (dim - 1, dim).
    """

    start: Floats
    sides: Floats

    @classmethod
    def of(cls, place: Sequence[float], dim: int) -> Self:
        """Return the blade from start, end and, in space, the vector of depth [m], dim numbers each.

        Raises LiveError if it has no length or area.
        """
        start, end, *depth = np.array(place, dtype=float).reshape(dim, dim)
        blade = cls(start, np.array([end - start, *depth]))
        lengths = np.linalg.norm(blade.sides, axis=1)
        if not lengths.all() or np.linalg.norm(blade.normal) <= _PARALLEL * lengths.prod():
            what = "its start and end are one place" if dim == 2 else "give a depth across the way from start to end"
            raise LiveError(f"cut: the blade has no {'length' if dim == 2 else 'area'}: {what}")
        return blade

    @property
    def normal(self) -> Floats:
        """A vector across the blade, shape (dim,)."""
        if len(self.start) == 2:
            ((x, y),) = self.sides
            return np.array([-y, x])
        return np.cross(*self.sides)

    @property
    def corners(self) -> Floats:
        """Its corners relative to the start [m], shape (2 or 4, dim)."""
        first, *second = self.sides
        ends = np.array([np.zeros_like(first), first])
        return np.concatenate([ends, ends + second[0]]) if second else ends

    def passed(self, mesh: Mesh, positions: Floats) -> Ints:
        """Return the elements that the blade passes, ascending, shape (n,); `positions` of the nodes [m].

        Where a convex part of an element (a triangle, a tetrahedron) and the blade are apart, a line exists on which
        their projections are (separating axes; Gottschalk, Lin, Manocha, SIGGRAPH 1996): one along a normal of a
        facet of one of them, or across an edge of each.
        """
        size = float(np.linalg.norm(np.ptp(positions, axis=0)))
        normal = self.normal / np.linalg.norm(self.normal)
        places = positions - self.start - _BESIDE * size * normal
        corners = self.corners
        found = []
        for numbers, block in mesh.blocks:
            at = places[block.elements]
            near = (at.min(axis=1) <= corners.max(axis=0)).all(axis=1) & (at.max(axis=1) >= corners.min(axis=0)).all(
                axis=1
            )
            across = at @ normal
            near = np.flatnonzero(near & (across.min(axis=1) <= 0) & (across.max(axis=1) >= 0))
            parts = np.array(block.kind.simplices or block.kind.edges)
            simplices = at[near][:, parts]
            meets = self._enters(simplices.reshape(-1, *simplices.shape[2:]), _TOUCHED * size)
            found.append(numbers[near[meets.reshape(simplices.shape[:2]).any(axis=1)]])
        return np.sort(np.concatenate(found))

    def _enters(self, simplices: Floats, touched: float) -> Bools:
        """Return whether simplices, relative to the start, overlap with the blade by a length [m]; (n, k, dim)."""
        axes = self._axes(simplices)
        length = np.linalg.norm(axes, axis=2)
        theirs, own = axes @ simplices.swapaxes(1, 2), axes @ self.corners.T
        overlap = np.minimum(theirs.max(axis=2) - own.min(axis=2), own.max(axis=2) - theirs.min(axis=2))
        return np.asarray(((overlap > touched * length) | (length == 0)).all(axis=1))

    def _axes(self, simplices: Floats) -> Floats:
        """Return the lines on which projections are compared, zero where two edges are parallel, shape (n, m, dim)."""
        n, k, dim = simplices.shape
        edges = np.stack([simplices[:, j] - simplices[:, i] for i, j in combinations(range(k), 2)], axis=1)
        normal = np.broadcast_to(self.normal, (n, 1, dim))
        if dim == 2:
            return np.concatenate([normal, edges[:, :, ::-1] * np.array([-1.0, 1.0])], axis=1)
        facets = [
            np.cross(simplices[:, j] - simplices[:, i], simplices[:, m] - simplices[:, i])[:, None]
            for i, j, m in combinations(range(k), 3)
        ]
        across = np.concatenate([np.cross(edges, side) for side in self.sides], axis=1)
        lengths = np.concatenate([np.linalg.norm(edges, axis=2) * np.linalg.norm(side) for side in self.sides], axis=1)
        across[np.linalg.norm(across, axis=2) <= _PARALLEL * lengths] = 0.0
        return np.concatenate([normal, *facets, across], axis=1)
