"""Integrals of the shape functions over edges, faces and elements: the nodal shares of uniform loads."""

import numpy as np

from truespring.arrays import Floats
from truespring.mesh.kinds import MIXED
from truespring.mesh.mesh import Mesh

_QUADRILATERAL = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
_HEXAHEDRON = np.array([[*corner, level] for level in (-1, 1) for corner in _QUADRILATERAL])


def element_corner_measures(mesh: Mesh) -> Floats:
    """Return the integral of each corner's shape function over its element [m^dim], shape (n_elements, corners).

    The parts of corners that a mesh of several kinds repeats sum to that of the node.
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
    """Return the integrals over hexahedra of corners (n, 8, 3), shape (n, 8), by 2 x 2 x 2 Gauss points.

    Exact: the product of shape function and Jacobian is of third order along each axis. This includes repeated corners
    (`ElementKind.merged`): towards these the Jacobian decreases linearly, in a pyramid quadratically, and the shape
    functions of equal corners sum to that of the kind.
    """
    share = np.zeros(corners.shape[:2])
    for point in _HEXAHEDRON / np.sqrt(3):
        factors = 1 + point * _HEXAHEDRON  # of each corner along each axis
        slopes = np.stack([_HEXAHEDRON[:, i] * factors[:, i - 1] * factors[:, i - 2] / 8 for i in range(3)], axis=1)
        jacobian = np.linalg.det(np.einsum("nci,cj->nij", corners, slopes))
        share += jacobian[:, None] * factors.prod(axis=1) / 8
    return share


def corner_measures(corners: Floats) -> Floats:
    """Return the integral of each corner's shape function over edges [m] or faces [m^2], shape (n, corners).

    `corners` are positions [m], shape (n, 2 to 4, dim). Quadrilaterals use 2 x 2 Gauss points, which is exact for plane
    ones, also with two equal corners.
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
    """Return lengths [m] of edges or areas [m^2] of faces, shape (n,); `corners` [m] of shape (n, 2 to 4, dim)."""
    if corners.shape[1] == 2:
        return np.asarray(np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1))
    if corners.shape[1] == 4:
        return np.asarray(corner_measures(corners).sum(axis=1))
    spans = corners[:, 1:] - corners[:, :1]
    return np.asarray(np.sqrt(np.maximum(np.linalg.det(spans @ spans.swapaxes(1, 2)), 0.0)) / 2)
