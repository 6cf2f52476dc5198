"""The surface of a body in 3D: facets, normals, lines on it, and its projection to the picture plane."""

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.mesh import Mesh

# Direction to the viewer, far away: in front, to the right, above. y is up, as in the selections bottom and top.
_TOWARDS = (0.55, 0.5, 1.0)

# Facets whose normals differ by more than this angle have a sharp edge between them.
_SHARP = np.cos(np.radians(30))


def _axes_of_view() -> Floats:
    towards = np.array(_TOWARDS) / np.linalg.norm(_TOWARDS)
    right = np.cross([0.0, 1.0, 0.0], towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


#: Unit vectors to the right, upwards and towards the viewer, shape (3, 3).
VIEW = _axes_of_view()


def seen(points: Floats) -> Floats:
    """Return points, shape (..., 3), in coordinates of the view: right, up, towards the viewer; units stay."""
    return np.asarray(points @ VIEW.T)


def facets_of(mesh: Mesh) -> Ints:
    """Return the boundary facets of a body, anticlockwise from outside, shape (n, 3 or 4); none of a network."""
    return mesh.boundary if mesh.boundary.shape[1] > 2 else np.zeros((0, 3), dtype=np.int64)


def normals(points: Floats, facets: Ints) -> Floats:
    """Return the unit normals of facets, shape (n, 3); zero where a facet is flat."""
    a, b, c, d = (points[facets[:, corner]] for corner in (0, 1, 2, -1))
    across = np.cross(c - a, d - b) if facets.shape[1] == 4 else np.cross(b - a, c - a)
    length = np.linalg.norm(across, axis=1, keepdims=True)
    return np.asarray(across / np.where(length > 0, length, 1.0))


def lines_on(facets: Ints, lines: Ints) -> tuple[Bools, Ints]:
    """Return which lines, shape (n, 2), join two nodes of a facet, and of those the first and last such facet.

    The results have shapes (n,) and (m, 2).
    """
    k = facets.shape[1]
    pairs = np.array([(i, j) for j in range(k) for i in range(j)])
    n_nodes = int(max(facets.max(initial=0), lines.max(initial=0))) + 1

    def keys(ends: Ints) -> Ints:
        ordered = np.sort(ends, axis=-1)
        return np.asarray(ordered[..., 0] * n_nodes + ordered[..., 1])

    of_facets = keys(facets[:, pairs]).ravel()
    order = np.argsort(of_facets, kind="stable")
    known, sought = of_facets[order], keys(lines)
    first, last = (np.searchsorted(known, sought, side) for side in ("left", "right"))
    on = first < last
    return on, np.stack([order[first[on]], order[last[on] - 1]], axis=1) // len(pairs)


def edges_of(facets: Ints) -> Ints:
    """Return every edge of the facets once, shape (n, 2)."""
    return np.unique(np.sort(rims(facets), axis=1), axis=0)


def rims(facets: Ints) -> Ints:
    """Return the edges of each facet in their order round it, shape (n, 2), facet after facet."""
    around = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2)
    return np.asarray(around[around[:, 0] != around[:, 1]])


def outline(points: Floats, facets: Ints, silhouette: bool = False) -> Ints:
    """Return the sharp edges of a surface, shape (n, 2); with `silhouette` also its edges against hidden facets."""
    edges = edges_of(facets)
    if not len(edges):
        return edges
    _, sides = lines_on(facets, edges)
    first, second = (normals(points, facets)[sides[:, side]] for side in (0, 1))
    drawn = (first * second).sum(axis=1) < _SHARP
    if silhouette:
        drawn |= (first[:, 2] > 0) != (second[:, 2] > 0)
    return np.asarray(edges[drawn])
