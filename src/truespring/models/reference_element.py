"""The reference element of each kind: derivatives of its shape functions and weights at the Gauss points."""

from typing import Any, NamedTuple

import numpy as np
import skfem
from skfem.quadrature import get_quadrature

from truespring.arrays import Floats
from truespring.mesh import CELL_SHAPES, ELEMENT_KINDS

# scikit-fem's element of each kind and its quadrature: the order, or for the constant strain of a triangle its one
# point and weight. 2 Gauss points a direction integrate polynomials of third order.
_SKFEM: dict[str, tuple[Any, Any]] = {
    "triangle": (skfem.ElementTriP1, (np.full((2, 1), 1 / 3), np.array([0.5]))),
    "quadrilateral": (skfem.ElementQuad1, 3),
    "tetrahedron": (skfem.ElementTetP1, 1),
    "hexahedron": (skfem.ElementHex1, 3),
}

# Points and weights of kinds that scikit-fem lacks, or lacks a quadrature of, in the coordinates of CELL_SHAPES.
# Wedges: three points of a triangle by two Gauss points along, as full as those of hexahedra. Pyramids: strain is the
# same all along a line to the tip, since shape functions and places shrink alike towards it. So one point along it,
# at the centre, with the integral of the shrinking (1 - z)^2, is exact, beside two Gauss points along x and y.
_GAUSS = 1 / np.sqrt(3)
_TRIANGLE = np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]])
_QUADRATURE: dict[str, tuple[Floats, Floats]] = {
    "wedge": (np.array([(*at, (1 + z) / 2) for at in _TRIANGLE for z in (-_GAUSS, _GAUSS)]), np.full(6, 1 / 12)),
    "pyramid": (
        np.array([(0.75 * x, 0.75 * y, 0.25) for x in (-_GAUSS, _GAUSS) for y in (-_GAUSS, _GAUSS)]),
        np.full(4, 1 / 3),
    ),
}

# scikit-fem counts the corners of a hexahedron in another order than VTK: its places of ours.
_ORDER = {"hexahedron": np.array([7, 4, 1, 5, 6, 2, 0, 3])}

#: The kinds that finite elements take.
FEM_KINDS = (*_SKFEM, *_QUADRATURE)


class Reference(NamedTuple):
    """What is known of every element of a kind, axes (point, node of the element, direction) and (point,).

    Attributes:
        corner_slopes: derivatives of the functions that place the reference element in space.
        slopes: derivatives of its shape functions.
        weights: of the Gauss points.
    """

    corner_slopes: Floats
    slopes: Floats
    weights: Floats


def reference_element(kind: str, element: Any = None, order: int | None = None) -> Reference:
    """Return scikit-fem's reference element of a kind: of first order, or `element` with the quadrature of `order`.

    Of pyramids it is the element of Bedrosian (IEEE Transactions on Magnetics 28, 1992), whose shape functions are
    rational: a hexahedron with four corners made one.
    """
    if kind in _QUADRATURE:
        at, of_points = _QUADRATURE[kind]
        by_point = np.ascontiguousarray(CELL_SHAPES[ELEMENT_KINDS[kind].vtk].slopes(at))
        return Reference(by_point, by_point, of_points)
    corners, own = _SKFEM[kind]
    rule = own if order is None else order
    points, weights = rule if isinstance(rule, tuple) else get_quadrature(corners.refdom, rule)

    def slopes(functions: Any) -> Floats:
        by_node = [functions.lbasis(points, node)[1] for node in range(len(functions.doflocs))]
        return np.ascontiguousarray(np.stack(by_node)[_ORDER.get(kind, slice(None))].transpose(2, 0, 1))

    return Reference(slopes(corners()), slopes(corners() if element is None else element), weights)
