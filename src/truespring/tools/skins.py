"""The surfaces of tools, for pictures: lines in the plane, facets and lines in space."""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints

# Number of lines round a circle, and half of those from pole to pole of a sphere; lines along each side of a plane.
_ROUND, _UP, _GRID = 32, 12, 8
# Half the width of what is drawn of an unbounded plane, over the size of the picture.
_WIDE = 0.6


@dataclass(frozen=True, eq=False)
class Skin:
    """A surface.

    Attributes:
        points: relative to the place of the tool [m], shape (n, dim).
        lines: pairs of points, shape (m, 2): the outline in the plane; lines beside the facets in space.
        facets: in space, anticlockwise from outside, shape (k, 4), a corner named twice in triangles; empty for lines
            alone.
    """

    points: Floats
    lines: Ints
    facets: Ints


def closed(points: Floats) -> Skin:
    """Return a closed line in the plane through points [m], shape (n, 2), in their order."""
    numbers = np.arange(len(points))
    return Skin(points, np.column_stack([numbers, np.roll(numbers, -1)]), _no_facets())


def rounded(radius: float, start: Floats, end: Floats) -> Skin:
    """Return the surface of the places within `radius` of the line from `start` to `end` [m], shape (dim,) each."""
    axis = end - start
    length = float(np.linalg.norm(axis))
    axis = axis / length if length else np.eye(len(axis))[-1]
    if len(axis) == 2:
        across = np.array([-axis[1], axis[0]])
        around = np.linspace(-np.pi / 2, np.pi / 2, _ROUND + 1)[:, None]
        cap = radius * (np.cos(around) * axis + np.sin(around) * across)
        return closed(np.concatenate([end + cap, start - cap]) if length else np.concatenate([cap, -cap[1:-1]]))
    polar = np.linspace(0, np.pi, 2 * _UP + 1)
    ends = [(end, polar[: _UP + 1]), (start, polar[_UP:] if length else polar[_UP + 1 :])]
    rings = [(centre, angle) for centre, angles in ends for angle in angles]
    first = np.linalg.svd(axis[None])[2][1]
    second = np.cross(axis, first)
    around = 2 * np.pi * np.arange(_ROUND) / _ROUND
    ring = np.outer(np.cos(around), first) + np.outer(np.sin(around), second)
    points = [centre + radius * (np.cos(angle) * axis + np.sin(angle) * ring) for centre, angle in rings]
    number = np.arange(len(rings) * _ROUND).reshape(len(rings), _ROUND)
    here, beside = number, np.roll(number, -1, axis=1)
    facets = np.stack([here[:-1], here[1:], beside[1:], beside[:-1]], axis=-1).reshape(-1, 4)
    return Skin(np.concatenate(points), _no_lines(), facets)


def circles(radius: float, dim: int) -> Skin:
    """Return a circle of a radius [m] about the origin, in space one about each axis."""
    around = 2 * np.pi * np.arange(_ROUND) / _ROUND
    ring = np.zeros((_ROUND, dim))
    ring[:, 0], ring[:, 1] = radius * np.cos(around), radius * np.sin(around)
    several = [closed(np.roll(ring, axis, axis=1)) for axis in range(dim if dim > 2 else 1)]
    lines = np.concatenate([number * _ROUND + one.lines for number, one in enumerate(several)])
    return Skin(np.concatenate([one.points for one in several]), lines, _no_facets())


def cuboid(size: Floats) -> Skin:
    """Return the surface of a box along the axes about the origin, in the plane a rectangle; `size` [m], (dim,)."""
    if len(size) == 2:
        return closed(size / 2 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]))
    points = size / 2 * np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)])
    facets = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    return Skin(points, _no_lines(), facets)


def triangulated(points: Floats, triangles: Ints) -> Skin:
    """Return the surface of triangles, shape (n, 3), between points [m], shape (n_points, 3)."""
    return Skin(points, _no_lines(), triangles[:, [0, 1, 2, 2]])


def flat(normal: Floats, centre: Floats, size: float) -> Skin:
    """Return the plane through the origin with a normal, shape (dim,), within `size` [m] of the point nearest `centre`.

    In space it is a grid of lines, which does not hide what is behind it.
    """
    normal = normal / np.linalg.norm(normal)
    foot = centre - (centre @ normal) * normal
    along = np.linalg.svd(normal[None])[2][1:] * _WIDE * size
    steps = np.linspace(-1, 1, _GRID + 1)
    if len(normal) == 2:
        ends = foot + 10 * np.array([[-1], [0], [0], [1]]) * along[0]  # clipped by the picture
    else:
        ways = ((along[0], along[1]), (along[1], along[0]))
        sides = np.array([[-1.0], [1.0]])
        ends = np.concatenate([foot + step * one + sides * other for one, other in ways for step in steps])
    return Skin(ends, np.arange(len(ends)).reshape(-1, 2), _no_facets())


def _no_lines() -> Ints:
    return np.zeros((0, 2), dtype=np.int64)


def _no_facets() -> Ints:
    return np.zeros((0, 4), dtype=np.int64)
