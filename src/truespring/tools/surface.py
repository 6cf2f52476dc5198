"""The surface of a body as nodes with areas, for contact and grasps."""

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import TruespringError
from truespring.loading import Body
from truespring.mesh import Mesh, Selection, corner_measures, facets_within
from truespring.mesh.facets import triangles_of


def surface(body: Body, on: Selection | None) -> tuple[Ints, Floats]:
    """Return the nodes of boundary facets, ascending, and their areas [m^2], both of shape (n,).

    An area is the integral of the node's shape function over the facets, times the thickness in the plane; nodes
    without one, such as the corners of quadratic triangles, are left out.

    Args:
        body: the body.
        on: selection of the facets; None for the whole boundary.

    Raises TruespringError if there are no facets.
    """
    mesh = body.mesh
    if mesh.element == "line":
        raise TruespringError("needs the surface of elements, and the body is a network of springs without elements")
    facets = mesh.boundary if on is None else facets_within(mesh, on)
    cells, measures = body.carrying(facets, corner_measures(mesh.nodes[facets]))
    areas = np.zeros(len(body.nodes))
    np.add.at(areas, cells, body.thickness * measures)
    nodes = np.flatnonzero(areas > _LEAST * areas.max())
    return nodes, areas[nodes]


def within(mesh: Mesh, places: Floats) -> Bools:
    """Return whether places [m], shape (n, dim), lie inside the undeformed body; shape (n,).

    Inside, its boundary turns once around a place: the angles, in 3D solid angles, that its facets span add up to a
    full turn. Solid angles by van Oosterom and Strackee (1983).
    """
    facets = mesh.nodes[triangles_of(mesh.boundary)]
    return np.array([_turns(facets - place) > 0.5 for place in places], dtype=bool)


def _turns(arms: Floats) -> float:
    """Return the number of turns of facets around the origin, from their corners [m], shape (n, dim, dim)."""
    if arms.shape[2] == len("xy"):
        first, second = arms[:, 0], arms[:, 1]
        cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        return float(np.arctan2(cross, (first * second).sum(axis=1)).sum() / (2 * np.pi))
    a, b, c = arms.swapaxes(0, 1)
    sizes = np.linalg.norm(arms, axis=2)
    volume = (a * np.cross(b, c)).sum(axis=1)
    dots = sum((one * other).sum(axis=1) * sizes[:, left] for one, other, left in ((a, b, 2), (b, c, 0), (c, a, 1)))
    return float(2 * np.arctan2(volume, sizes.prod(axis=1) + dots).sum() / (4 * np.pi))


# Areas below this share of the largest are rounding errors.
_LEAST = 1e-9
