"""Distances between surfaces: segments that bound a plane body, triangles that bound a solid."""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints

# Size of blocks of rows times columns: limits the memory.
_BLOCK = 250_000

# Points of a facet at which its distance is evaluated, as fractions of its corners, and their weights in a mean square.
# Of a segment nine by the composite Simpson rule, of a triangle corners, middles of edges and centre (exact to degree
# three): exact where the distance is linear along it.
_ALONG = np.linspace(0, 1, 9)
_PLACES = {
    2: np.stack([1 - _ALONG, _ALONG], axis=1),
    3: np.concatenate([np.eye(3), (1 - np.eye(3)) / 2, np.full((1, 3), 1 / 3)]),
}
_WEIGHTS = {2: np.array([1, 4, 2, 4, 2, 4, 2, 4, 1]) / 24, 3: np.array([3, 3, 3, 8, 8, 8, 27]) / 60}


class Gap(NamedTuple):
    """Distance between two surfaces [m]: root mean square over the measure of both, and maximum (Hausdorff)."""

    rms: float
    max: float


def gap(mine: Floats, theirs: Floats) -> Gap:
    """Return the distance between two surfaces, taken in both directions.

    `mine` and `theirs` are the corners of their facets [m], shape (n, 2, 2) or (n, 3, 3). Distances are evaluated
    at nine points of each segment and seven of each triangle.
    """
    if np.array_equal(mine, theirs):
        return Gap(0.0, 0.0)  # exactly; projected points are not
    apart = np.concatenate([_apart(mine, theirs), _apart(theirs, mine)])
    size = np.concatenate([_sizes(mine), _sizes(theirs)])
    mean = np.average(apart**2 @ _WEIGHTS[mine.shape[1]], weights=size) if size.any() else (apart**2).mean()
    return Gap(float(np.sqrt(mean)), float(apart.max()))


def _apart(facets: Floats, others: Floats) -> Floats:
    """Return the distance of places on each facet to the nearest of the others [m], shape (n, places)."""
    shares = _PLACES[facets.shape[1]]
    places = np.einsum("pc,ncd->npd", shares, facets)
    return distance_to(places.reshape(-1, facets.shape[2]), others).reshape(-1, len(shares))


def distance_to(points: Floats, facets: Floats) -> Floats:
    """Return the distance of each point to the nearest facet [m], shape (n,).

    `points` have shape (n, dim) [m], `facets` shape (m, 2 or 3, dim) [m]. Only the facets with the nearest centres are
    compared; for points to which a facet with a farther centre may be nearer, more facets are compared.
    """
    from scipy.spatial import KDTree

    middles = facets.mean(axis=1)
    tree = KDTree(middles)
    reach = float(np.linalg.norm(facets - middles[:, None], axis=2).max())
    nearest = np.empty(len(points))
    unsure = np.arange(len(points))
    for n_near in (8, 64):
        if n_near < len(facets) and len(unsure):
            farthest = np.empty(len(unsure))
            for some in blocks(np.arange(len(unsure)), n_near):
                distance, near = (np.asarray(one) for one in tree.query(points[unsure[some]], k=n_near))
                nearest[unsure[some]] = _to_each(points[unsure[some]], facets[near]).min(axis=1)
                farthest[some] = distance[:, -1]
            unsure = unsure[farthest - reach < nearest[unsure]]
    for some in blocks(unsure, len(facets)):
        nearest[some] = _to_each(points[some], facets[None]).min(axis=1)
    return nearest


def _to_each(points: Floats, facets: Floats) -> Floats:
    """Return distances [m], shape (n_points, k); `facets` have shape (n_points or 1, k, corners, dim)."""
    if facets.shape[2] == 2:
        return _to_segments(points, facets[:, :, 0], facets[:, :, 1])
    a, b, c = facets[:, :, 0], facets[:, :, 1], facets[:, :, 2]
    offset = points[:, None] - a
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=2)
    flat = size <= 1e-12 * np.maximum(((b - a) ** 2).sum(axis=2), ((c - a) ** 2).sum(axis=2))
    unit = normal / np.where(size > 0, size, 1.0)[:, :, None]
    height = (offset * unit).sum(axis=2)
    foot = offset - height[:, :, None] * unit
    # Shares of b and c at the foot, from the areas that it spans with the edges.
    share_b = (np.cross(foot, c - a) * unit).sum(axis=2)
    share_c = (np.cross(b - a, foot) * unit).sum(axis=2)
    over = (share_b >= 0) & (share_c >= 0) & (share_b + share_c <= size) & ~flat
    edges = np.minimum.reduce([_to_segments(points, a, b), _to_segments(points, b, c), _to_segments(points, c, a)])
    return np.asarray(np.where(over, np.abs(height), edges))


def _to_segments(points: Floats, start: Floats, end: Floats) -> Floats:
    along = end - start
    offset = points[:, None] - start
    squared = np.maximum((along**2).sum(axis=2), np.finfo(float).tiny)  # a segment may be a point
    share = np.clip((offset * along).sum(axis=2) / squared, 0, 1)
    return np.asarray(np.linalg.norm(offset - share[:, :, None] * along, axis=2))


def blocks(rows: Ints, n_columns: int) -> list[Ints]:
    """Divide rows into blocks, shape (n,) each, that limit the memory for `n_columns` numbers per row."""
    size = max(1, _BLOCK // n_columns)
    return [rows[first : first + size] for first in range(0, len(rows), size)]


def _sizes(facets: Floats) -> Floats:
    """Return lengths of segments [m] or areas of triangles [m^2], shape (n,)."""
    if facets.shape[1] == 2:
        return np.asarray(np.linalg.norm(facets[:, 1] - facets[:, 0], axis=1))
    spans = np.cross(facets[:, 1] - facets[:, 0], facets[:, 2] - facets[:, 0])
    return np.asarray(np.linalg.norm(spans, axis=1) / 2)
