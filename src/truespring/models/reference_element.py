"""Reference elements: derivatives of the shape functions and weights at the Gauss points."""

from functools import cache
from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.mesh import CELL_SHAPES, ELEMENT_KINDS

# Element of scikit-fem and its quadrature by kind: the order, or for the constant strain of simplices one point and its
# weight. 2 Gauss points per direction are exact for polynomials of third order.
_SKFEM: dict[str, tuple[str, Any]] = {
    "triangle": ("ElementTriP1", (np.full((2, 1), 1 / 3), np.array([0.5]))),
    "quadrilateral": ("ElementQuad1", 3),
    "tetrahedron": ("ElementTetP1", 1),
    "hexahedron": ("ElementHex1", 3),
}

# Points and weights of kinds without element or quadrature in scikit-fem, in the coordinates of CELL_SHAPES. Wedges:
# three points of a triangle times two Gauss points, full integration as for hexahedra. Pyramids: the strain is constant
# along lines to the tip, since shape functions and positions scale alike. One point along z, at the centre, with the
# integral of (1 - z)^2 as weight is exact, times two Gauss points along x and y.
_GAUSS = 1 / np.sqrt(3)
_TRIANGLE = np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]])
_QUADRATURE: dict[str, tuple[Floats, Floats]] = {
    "wedge": (np.array([(*at, (1 + z) / 2) for at in _TRIANGLE for z in (-_GAUSS, _GAUSS)]), np.full(6, 1 / 12)),
    "pyramid": (
        np.array([(0.75 * x, 0.75 * y, 0.25) for x in (-_GAUSS, _GAUSS) for y in (-_GAUSS, _GAUSS)]),
        np.full(4, 1 / 3),
    ),
}

# Corners of a hexahedron in the order of scikit-fem, which differs from that of VTK.
_ORDER = {"hexahedron": np.array([7, 4, 1, 5, 6, 2, 0, 3])}

#: Kinds that finite elements support.
FEM_KINDS = (*_SKFEM, *_QUADRATURE)


class Reference(NamedTuple):
    """Reference element at the Gauss points.

    Attributes:
        corner_slopes: derivatives of the shape functions of the geometry [-], axes (point, corner, direction).
        slopes: derivatives of the shape functions of the displacement [-], axes (point, node, direction).
        weights: weights of the Gauss points [-], axes (point,).
    """

    corner_slopes: Floats
    slopes: Floats
    weights: Floats


@cache
def reference_element(kind: str, element: str | None = None, order: int | None = None) -> Reference:
    """Return the reference element of a kind: of first order, or scikit-fem's `element` with quadrature of `order`.

    Pyramids are those of Bedrosian (IEEE Transactions on Magnetics 28, 1992), with rational shape functions:
    hexahedra with four corners collapsed to one.
    """
    if kind in _QUADRATURE:
        at, of_points = _QUADRATURE[kind]
        by_point = np.ascontiguousarray(CELL_SHAPES[ELEMENT_KINDS[kind].vtk].slopes(at))
        return Reference(by_point, by_point, of_points)
    import skfem
    from skfem.quadrature import get_quadrature

    first, own = _SKFEM[kind]
    corners = getattr(skfem, first)
    rule = own if order is None else order
    points, weights = rule if isinstance(rule, tuple) else get_quadrature(corners.refdom, rule)

    def slopes(functions: Any) -> Floats:
        by_node = [functions.lbasis(points, node)[1] for node in range(len(functions.doflocs))]
        return np.ascontiguousarray(np.stack(by_node)[_ORDER.get(kind, slice(None))].transpose(2, 0, 1))

    return Reference(slopes(corners()), slopes(corners() if element is None else getattr(skfem, element)()), weights)
