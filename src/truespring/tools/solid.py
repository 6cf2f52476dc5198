"""Signed distance from a solid that is bounded by triangles."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.distance import blocks

# Number of triangles of nearest centres that are compared first.
_FIRST = 8
# Distance over the size of the solid below which a point lies on the surface.
_ON = 1e-9


class Feet(NamedTuple):
    """The nearest points of a surface.

    Attributes:
        triangles: number of the triangle of each, shape (n,).
        shares: its barycentric coordinates, shape (n, 3): exactly zero on edges.
        arms: vectors from them to the places [m], shape (n, 3).
    """

    triangles: Ints
    shares: Floats
    arms: Floats


@dataclass(frozen=True, eq=False)
class Solid:
    """A solid bounded by triangles, anticlockwise seen from outside.

    Attributes:
        corners: positions of the vertices [m], shape (n_vertices, 3).
        triangles: numbers of their vertices, shape (n_triangles, 3).
    """

    corners: Floats
    triangles: Ints

    @classmethod
    def of(cls, facets: Floats) -> "Solid":
        """Return the solid of facets [m], shape (n, 3, 3); raise MeshError if they do not bound one."""
        if not np.isfinite(facets).all():
            raise MeshError("a vertex is not finite")
        corners, number = np.unique(facets.reshape(-1, 3), axis=0, return_inverse=True)
        triangles = number.reshape(-1, 3)
        triangles = triangles[(triangles != np.roll(triangles, 1, axis=1)).all(axis=1)]
        ways = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2).reshape(-1, 2)
        forth, back = (np.unique(way, axis=0) for way in (ways, ways[:, ::-1]))
        if len(forth) != len(ways) or not np.array_equal(forth, back):
            keys = {tuple(way) for way in ways.tolist()}
            n_open = sum((end, start) not in keys for start, end in keys)
            raise MeshError(
                f"the surface is not closed, or its facets are not turned alike: {n_open} edges have no neighbour; a "
                "tool needs a surface that separates inside from outside"
            )
        volume = float(np.linalg.det(corners[triangles]).sum()) / 6
        return cls(corners, triangles if volume > 0 else triangles[:, ::-1])

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Smallest and largest coordinates [m], shape (3,) each."""
        return self.corners.min(axis=0), self.corners.max(axis=0)

    @cached_property
    def _slack(self) -> float:
        """Distance below which a point lies on the surface [m]."""
        return _ON * float(np.linalg.norm(np.ptp(self.corners, axis=0)))

    @cached_property
    def _tree(self) -> Any:
        """Search tree of the centres of the triangles."""
        from scipy.spatial import KDTree

        return KDTree(self.corners[self.triangles].mean(axis=1))

    @cached_property
    def _reach(self) -> float:
        """Largest distance of a corner from the centre of its triangle [m]."""
        facets = self.corners[self.triangles]
        return float(np.linalg.norm(facets - facets.mean(axis=1)[:, None], axis=2).max())

    @cached_property
    def _faces(self) -> Floats:
        """Unit normals of the triangles, shape (n_triangles, 3)."""
        a, b, c = self.corners[self.triangles].swapaxes(0, 1)
        across = np.cross(b - a, c - a)
        return np.asarray(across / np.maximum(np.linalg.norm(across, axis=1), np.finfo(float).tiny)[:, None])

    @cached_property
    def _edges(self) -> Floats:
        """Sum of the normals of both triangles at the edge opposite to each corner, shape (n_triangles, 3, 3)."""
        ends = np.sort(np.stack([np.roll(self.triangles, -1, axis=1), np.roll(self.triangles, -2, axis=1)], axis=2))
        edges, number = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
        total = np.zeros((len(edges), 3))
        np.add.at(total, number.ravel(), np.repeat(self._faces, 3, axis=0))
        return np.asarray(total[number.ravel()].reshape(-1, 3, 3))

    @cached_property
    def _vertices(self) -> Floats:
        """Sum of the normals of the triangles around each vertex, weighted by their angles, shape (n_vertices, 3)."""
        places = self.corners[self.triangles]
        to_next, to_last = np.roll(places, -1, axis=1) - places, np.roll(places, 1, axis=1) - places
        cosine = (to_next * to_last).sum(axis=2)
        sine = np.linalg.norm(np.cross(to_next, to_last), axis=2)
        total = np.zeros_like(self.corners)
        np.add.at(total, self.triangles, np.arctan2(sine, cosine)[:, :, None] * self._faces[:, None])
        return total

    def feet(self, places: Floats) -> Feet:
        """Return the nearest points of the surface to places [m], shape (n, 3)."""
        facets = self.corners[self.triangles]
        first = np.asarray(self._tree.query(places, k=np.arange(1, min(_FIRST, len(facets)) + 1))[1])
        found = _nearest(places, facets, first)
        # The centre of a nearer triangle is at most this far.
        reach = np.linalg.norm(found.arms, axis=1) + self._reach
        near = self._tree.query_ball_point(places, reach * (1 + _ON))
        counts = np.array([len(one) for one in near], dtype=np.int64)
        for some in blocks(np.flatnonzero(counts > first.shape[1]), 9 * int(counts.max(initial=1))):
            padded = np.array([(near[row] + near[row][:1] * counts.max())[: counts[some].max()] for row in some])
            for whole, part in zip(found, _nearest(places[some], facets, padded), strict=True):
                whole[some] = part
        return found

    def outward(self, feet: Feet) -> tuple[Floats, Floats, Bools]:
        """Return signed distances [m], normals, and which places off the surface are nearest to an edge or vertex.

        Shapes (n,), (n, 3) and (n,). The sign is that of the angle-weighted normal at the nearest point (Baerentzen and
        Aanaes 2005).
        """
        zero = feet.shares == 0
        n_zero = zero.sum(axis=1)
        pseudo = self._faces[feet.triangles].copy()
        edge, vertex = n_zero == 1, n_zero == 2
        pseudo[edge] = self._edges[feet.triangles[edge], zero[edge].argmax(axis=1)]
        pseudo[vertex] = self._vertices[self.triangles[feet.triangles[vertex], feet.shares[vertex].argmax(axis=1)]]
        pseudo /= np.maximum(np.linalg.norm(pseudo, axis=1), np.finfo(float).tiny)[:, None]
        length = np.linalg.norm(feet.arms, axis=1)
        sign = np.where((feet.arms * pseudo).sum(axis=1) < 0, -1.0, 1.0)
        off = (length > self._slack) & (n_zero > 0)
        normals = np.where(off[:, None], (sign / np.where(off, length, 1.0))[:, None] * feet.arms, pseudo)
        return sign * length, normals, off

    def gaps(self, places: Floats) -> tuple[Floats, Floats]:
        """Return signed distances [m] and normals of places [m], see `Shape.gaps`."""
        gaps, normals, _ = self.outward(self.feet(places))
        return gaps, normals

    def bends(self, places: Floats) -> Floats:
        """Return the second derivatives of the distance [1/m]: across edges and around vertices, see `Shape.bends`."""
        feet = self.feet(places)
        gaps, normals, off = self.outward(feet)
        zero = feet.shares == 0
        along = np.zeros((len(places), 3))
        edge = zero.sum(axis=1) == 1
        corners = self.corners[self.triangles[feet.triangles[edge]]]
        opposite = zero[edge].argmax(axis=1)
        rows = np.arange(len(corners))
        along[edge] = corners[rows, (opposite + 1) % 3] - corners[rows, (opposite + 2) % 3]
        along /= np.maximum(np.linalg.norm(along, axis=1), np.finfo(float).tiny)[:, None]
        across = np.eye(3) - along[:, :, None] * along[:, None, :] - normals[:, :, None] * normals[:, None, :]
        return np.asarray((off / np.where(off, gaps, 1.0))[:, None, None] * across)


def _nearest(places: Floats, facets: Floats, near: Ints) -> Feet:
    """Return the nearest points on some triangles: `near` has their numbers for each place, shape (n, k)."""
    corners = facets[near]
    shares, squared = _on_faces(places, corners)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        start, along = corners[:, :, first], corners[:, :, second] - corners[:, :, first]
        length = np.maximum((along**2).sum(axis=2), np.finfo(float).tiny)
        share = np.clip(((places[:, None] - start) * along).sum(axis=2) / length, 0.0, 1.0)
        distance = ((places[:, None] - start - share[:, :, None] * along) ** 2).sum(axis=2)
        better = distance < squared
        squared = np.where(better, distance, squared)
        there = np.zeros_like(shares)
        there[:, :, first], there[:, :, second] = 1 - share, share
        shares = np.where(better[:, :, None], there, shares)
    rows, best = np.arange(len(places)), squared.argmin(axis=1)
    shares = shares[rows, best]
    return Feet(near[rows, best], shares, places - np.einsum("nk,nki->ni", shares, corners[rows, best]))


def _on_faces(places: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """Return barycentric coordinates of the feet inside triangles, and squared distances, infinite without such a foot.

    Shapes (n, k, 3) and (n, k) from places, (n, 3), and corners, (n, k, 3, 3).
    """
    a, b, c = (corners[:, :, corner] for corner in range(3))
    normal = np.cross(b - a, c - a)
    size = np.maximum((normal**2).sum(axis=2), np.finfo(float).tiny)
    offset = places[:, None] - a
    of_b = (np.cross(offset, c - a) * normal).sum(axis=2) / size
    of_c = (np.cross(b - a, offset) * normal).sum(axis=2) / size
    inside = (of_b > 0) & (of_c > 0) & (of_b + of_c < 1)
    height = (offset * normal).sum(axis=2)
    return np.stack([1 - of_b - of_c, of_b, of_c], axis=2), np.where(inside, height**2 / size, np.inf)
