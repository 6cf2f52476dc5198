"""The surface of a body as nodes with areas, for contact and grasps."""

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import TruespringError
from truespring.loading import Body
from truespring.mesh import Selection, corner_measures, facets_within


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


# Areas below this share of the largest are rounding errors.
_LEAST = 1e-9
