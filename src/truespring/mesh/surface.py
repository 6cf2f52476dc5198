"""A deformed body as another program left it: a triangulated piece of the plane, and distances to it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from truespring.arrays import Floats, Ints


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangulated region of the plane.

    Attributes:
        points: [m], shape (n_points, 2).
        triangles: point numbers, shape (n_triangles, 3).
        load_factor: the load level that it belongs to.
    """

    points: Floats
    triangles: Ints
    load_factor: float = 1.0

    @cached_property
    def outline(self) -> Ints:
        """The edges that belong to one triangle only, shape (n_edges, 2)."""
        edges = self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
        return np.asarray(edges[first[count == 1]])


@dataclass(frozen=True, slots=True)
class SurfaceDistance:
    """Distances of a body's outline and nodes to a surface [m].

    Attributes:
        outline_rms, outline_max: of points along either outline to the other one.
        nodes_rms, nodes_max: of each node of the body to the nearest point of the surface.
    """

    outline_rms: float
    outline_max: float
    nodes_rms: float
    nodes_max: float


def surface_distance(positions: Floats, boundary: Ints, surface: Surface) -> SurfaceDistance:
    """Measure nodes at `positions`, shape (n_nodes, 2), and the outline of edges `boundary` against `surface`."""
    mine, theirs = positions[boundary], surface.points[surface.outline]
    apart = np.concatenate([_to_segments(_along(mine), theirs), _to_segments(_along(theirs), mine)])
    nodes = _to_points(positions, surface.points)
    return SurfaceDistance(_rms(apart), float(apart.max()), _rms(nodes), float(nodes.max()))


def _along(segments: Floats) -> Floats:
    """Nine evenly spaced points of each segment, shape (9 n, 2)."""
    share = np.linspace(0, 1, 9)[None, :, None]
    return np.asarray((segments[:, :1] * (1 - share) + segments[:, 1:] * share).reshape(-1, segments.shape[2]))


def _to_segments(points: Floats, segments: Floats) -> Floats:
    """Distance of each point to the nearest segment [m], shape (n_points,)."""
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    squared = np.maximum((along**2).sum(axis=1), np.finfo(float).tiny)
    nearest = np.empty(len(points))
    for first in range(0, len(points), 1024):  # in blocks, so that long outlines fit in memory
        offset = points[first : first + 1024, None] - start
        share = np.clip((offset * along).sum(axis=2) / squared, 0, 1)
        nearest[first : first + 1024] = np.linalg.norm(offset - share[:, :, None] * along, axis=2).min(axis=1)
    return nearest


def _to_points(points: Floats, others: Floats) -> Floats:
    from scipy.spatial import KDTree

    return np.asarray(KDTree(others).query(points)[0])


def _rms(values: Floats) -> float:
    return float(np.sqrt((values**2).mean()))
