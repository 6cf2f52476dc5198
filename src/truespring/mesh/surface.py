"""Deformed surfaces from other programs: triangulated regions of the plane or in space, and distances to them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truespring.arrays import Floats, Ints, frozen_floats, frozen_ints
from truespring.errors import MeshError
from truespring.mesh.distance import blocks, distance_to, gap

# Tolerance outside the edges of a triangle as a fraction of the surface's diameter: above the rounding of
# single-precision files, far below the size of any element.
_INSIDE = 1e-6

# Triangles with a smaller ratio of height to length contain no place: barycentric coordinates would be rounding.
_NEEDLE = 1e-6


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangulated region of the plane.

    Attributes:
        points: [m], shape (n_points, 2).
        triangles: point numbers, shape (n_triangles, 3).
        load_factor: its load level.

    Raises MeshError if there is no triangle, a triangle names a point that does not exist, or there is no outline.
    """

    points: Floats
    triangles: Ints
    load_factor: float = 1.0

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "points", frozen_floats(self.points, (None, 2), "points"))
            object.__setattr__(self, "triangles", frozen_ints(self.triangles, (None, 3), "triangles"))
        except ValueError as error:
            raise MeshError(str(error)) from None
        if not len(self.triangles):
            raise MeshError("a surface without triangles is empty")
        if self.triangles.min() < 0 or self.triangles.max() >= len(self.points):
            raise MeshError(
                f"triangles name points {self.triangles.min()} to {self.triangles.max()}, "
                f"there are 0 to {len(self.points) - 1}"
            )
        if not len(self.outline):
            raise MeshError("every edge of the surface belongs to several triangles: it has no outline")

    @cached_property
    def outline(self) -> Ints:
        """The edges that belong to one triangle only, shape (n_edges, 2)."""
        edges = self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
        return np.asarray(edges[first[count == 1]])

    @property
    def facets(self) -> Floats:
        """The ends of the edges of the outline [m], shape (n_edges, 2, 2)."""
        return np.asarray(self.points[self.outline])

    @property
    def lower(self) -> Floats:
        """The smallest coordinates [m], shape (2,)."""
        return np.asarray(self.points.min(axis=0))

    @property
    def upper(self) -> Floats:
        """The largest coordinates [m], shape (2,)."""
        return np.asarray(self.points.max(axis=0))

    @property
    def diameter(self) -> float:
        """The diagonal of the bounding box [m]."""
        return float(np.linalg.norm(self.upper - self.lower))

    def locate(self, places: Floats) -> tuple[Ints, Floats, Floats]:
        """Find the triangle that contains each of `places` [m], shape (n, 2), or else one near by.

        Returns the numbers of the triangles, shape (n,); the barycentric coordinates, shape (n, 3), sum 1; and the
        distance to the surface [m], shape (n,), zero inside.
        """
        from scipy.spatial import KDTree

        centres = self._corners.mean(axis=1)
        tree = KDTree(centres)
        slack = _INSIDE * self.diameter
        # No triangle contains a place further from its centre.
        reach = float(np.linalg.norm(self._corners - centres[:, None], axis=2).max()) + slack
        triangle, shares = np.empty(len(places), dtype=np.int64), np.empty((len(places), 3))
        beyond, seen = np.empty(len(places)), np.empty(len(places))
        unsure = np.arange(len(places))
        for n_near in sorted({min(few, len(centres)) for few in (16, 256, len(centres))}):
            for some in blocks(unsure, n_near):
                distance, near = tree.query(places[some], k=np.arange(1, n_near + 1))
                triangle[some], shares[some], beyond[some] = self._least_beyond(places[some], np.asarray(near))
                seen[some] = np.asarray(distance)[:, -1]
            unsure = unsure[(beyond[unsure] > slack) & (seen[unsure] <= reach)]
        outside = np.flatnonzero(beyond > slack)
        apart = np.zeros(len(places))
        apart[outside] = distance_to(places[outside], self.points[self.outline])
        return triangle, shares, apart

    @cached_property
    def _corners(self) -> Floats:
        return np.asarray(self.points[self.triangles])

    def _least_beyond(self, places: Floats, candidates: Ints) -> tuple[Ints, Floats, Floats]:
        """Return the best candidate triangle for each place, barycentric coordinates, and distance outside [m]."""
        corners = self._corners[candidates]
        to_corner = corners - places[:, None, None]
        # Twice the signed areas of the triangles of a place and the edge opposite to each corner.
        areas = np.stack([_cross(to_corner[:, :, (c + 1) % 3], to_corner[:, :, (c + 2) % 3]) for c in range(3)], axis=2)
        whole = areas.sum(axis=2, keepdims=True)
        opposite = np.linalg.norm(np.roll(corners, -1, axis=2) - np.roll(corners, -2, axis=2), axis=3)
        with np.errstate(divide="ignore", invalid="ignore"):
            beyond = (-areas * np.sign(whole) / opposite).max(axis=2)
            all_shares = areas / whole
        beyond[np.abs(whole[:, :, 0]) <= _NEEDLE * opposite.max(axis=2) ** 2] = np.inf
        best = beyond.argmin(axis=1)
        row = np.arange(len(places))
        chosen = np.broadcast_to(candidates, beyond.shape)[row, best]
        return np.asarray(chosen), np.asarray(all_shares[row, best]), np.asarray(beyond[row, best])


@dataclass(frozen=True, eq=False)
class Shell:
    """A triangulated surface in space.

    Attributes:
        points: [m], shape (n_points, 3).
        triangles: point numbers, shape (n_triangles, 3).
        load_factor: its load level.
    """

    points: Floats
    triangles: Ints
    load_factor: float = 1.0

    @property
    def facets(self) -> Floats:
        """The corners of the triangles [m], shape (n_triangles, 3, 3)."""
        return np.asarray(self.points[self.triangles])


@dataclass(frozen=True, slots=True)
class SurfaceDistance:
    """Distances of a body's outline and nodes to a surface [m].

    Attributes:
        outline_rms, outline_max: distance of each outline to the other; the rms is over the length of both, independent
            of their subdivision.
        nodes_rms, nodes_max: distance of each node of the body to the nearest point of the surface.
    """

    outline_rms: float
    outline_max: float
    nodes_rms: float
    nodes_max: float


def surface_distance(positions: Floats, boundary: Ints, surface: Surface) -> SurfaceDistance:
    """Return the distances of a body to a surface.

    `positions` are its nodes [m], shape (n_nodes, 2); `boundary` its outline, node numbers of shape (n_edges, 2).
    """
    outlines = gap(positions[boundary], surface.points[surface.outline])
    nodes = _nearest(surface.points, positions, 1)[0]
    return SurfaceDistance(
        outline_rms=outlines.rms,
        outline_max=outlines.max,
        nodes_rms=float(np.sqrt((nodes**2).mean())),
        nodes_max=float(nodes.max()),
    )


def _nearest(points: Floats, places: Floats, n_near: int) -> tuple[Floats, Ints]:
    """Return distances [m] and numbers of the `n_near` points nearest to each place, shape (n_places, n_near)."""
    from scipy.spatial import KDTree

    distance, number = KDTree(points).query(places, k=np.arange(1, n_near + 1))
    return np.asarray(distance, dtype=np.float64), np.asarray(number, dtype=np.int64)


def _cross(first: Floats, second: Floats) -> Floats:
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0])
