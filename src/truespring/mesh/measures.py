"""What each corner's shape function integrates to over edges, faces and elements: how uniform loads are shared."""

import numpy as np

from truespring.arrays import Floats
from truespring.mesh.kinds import MIXED
from truespring.mesh.mesh import Mesh

_QUADRILATERAL = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
_HEXAHEDRON = np.array([[*corner, level] for level in (-1, 1) for corner in _QUADRILATERAL])


def element_corner_measures(mesh: Mesh) -> Floats:
    """Integrate each corner's shape function over the elements [m^dim of the kind], shape (n_elements, k).

    Corners of elements of several kinds that are one have parts that add up.
    """
    whole = corner_measures if mesh.dim == 2 else _hexahedra
    if mesh.element in ("quadrilateral", "hexahedron", MIXED):
        return whole(mesh.nodes[mesh.elements])
    if mesh.element in ("pyramid", "wedge"):
        share = np.zeros(mesh.elements.shape)
        parts = whole(mesh.nodes[mesh.elements[:, mesh.kind.merged]])
        for corner, part in zip(mesh.kind.merged, parts.T, strict=True):
            share[:, corner] += part
        return share
    k = mesh.elements.shape[1]
    return np.repeat(mesh.measures[:, None] / k, k, axis=1)


def _hexahedra(corners: Floats) -> Floats:
    """By 2 x 2 x 2 Gauss points, exact: shape function and Jacobian are of third order along each axis together.

    Also where corners are one, as those of other kinds in `ElementKind.merged`: towards these a Jacobian falls linearly
    or, of a pyramid, as the square, and the shape functions add up to those of the kind.
    """
    share = np.zeros(corners.shape[:2])
    for point in _HEXAHEDRON / np.sqrt(3):
        factors = 1 + point * _HEXAHEDRON  # of each corner along each axis
        slopes = np.stack([_HEXAHEDRON[:, i] * factors[:, i - 1] * factors[:, i - 2] / 8 for i in range(3)], axis=1)
        jacobian = np.linalg.det(np.einsum("nci,cj->nij", corners, slopes))
        share += jacobian[:, None] * factors.prod(axis=1) / 8
    return share


def corner_measures(corners: Floats) -> Floats:
    """Integrate each corner's shape function over edges, triangles or quadrilaterals [m^k], shape (n, corners).

    Corners of shape (n, 2 to 4, dim). Quadrilaterals by 2 x 2 Gauss points, exact where they are plane, and where two
    corners are one, a triangle.
    """
    n_corners = corners.shape[1]
    if n_corners < 4:
        return np.repeat(facet_measures(corners)[:, None] / n_corners, n_corners, axis=1)
    share = np.zeros(corners.shape[:2])
    signs = _QUADRILATERAL
    for s, t in signs / np.sqrt(3):
        shape = (1 + s * signs[:, 0]) * (1 + t * signs[:, 1]) / 4
        along_s = np.einsum("c,nci->ni", signs[:, 0] * (1 + t * signs[:, 1]) / 4, corners)
        along_t = np.einsum("c,nci->ni", signs[:, 1] * (1 + s * signs[:, 0]) / 4, corners)
        gram = (along_s**2).sum(axis=1) * (along_t**2).sum(axis=1) - (along_s * along_t).sum(axis=1) ** 2
        share += np.sqrt(np.maximum(gram, 0.0))[:, None] * shape
    return share


def facet_measures(corners: Floats) -> Floats:
    """Length [m] of edges or area [m^2] of triangles and quadrilaterals; corners of shape (n, 2 to 4, dim)."""
    if corners.shape[1] == 2:
        return np.asarray(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1))
    if corners.shape[1] == 4:
        return np.asarray(corner_measures(corners).sum(axis=1))
    spans = corners[:, 1:] - corners[:, :1]
    return np.asarray(np.sqrt(np.maximum(np.linalg.det(spans @ spans.swapaxes(1, 2)), 0.0)) / 2)
