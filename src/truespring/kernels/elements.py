"""Loops over finite elements: shape functions, deformation gradients, forces and stiffness matrices.

Tensors have their own axes first, then elements and points, as in laws. Symmetric tensors have one axis of n_strains =
dim (dim + 1) / 2 components in Voigt order; `voigt`, shape (dim, dim), is the component of each pair of directions.
"""

from typing import Any

import numpy as np

from truespring.kernels.rows import add_times, write
from truespring.kernels.threads import kernel


@kernel
def _invert(A: Any, inverse: Any, zero: Any) -> Any:
    """Write the inverse of a matrix, shape (dim, dim), and return its determinant."""
    if len(zero) == 2:
        det = A[0, 0] * A[1, 1] - A[0, 1] * A[1, 0]
        inverse[0, 0], inverse[0, 1] = A[1, 1] / det, -A[0, 1] / det
        inverse[1, 0], inverse[1, 1] = -A[1, 0] / det, A[0, 0] / det
        return det
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            inverse[a, i] = A[j, b] * A[k, c] - A[j, c] * A[k, b]
    det = A[0, 0] * inverse[0, 0] + A[0, 1] * inverse[1, 0] + A[0, 2] * inverse[2, 0]
    for i in range(3):
        for a in range(3):
            inverse[a, i] /= det
    return det


@kernel
def quadrature(
    first: int,
    last: int,
    places: Any,
    corner_slopes: Any,
    slopes: Any,
    weights: Any,
    gradients: Any,
    volumes: Any,
    zero: Any,
) -> None:
    """Write the gradients of the shape functions at the Gauss points, and the volume of each point.

    `slopes` are the derivatives of the shape functions on the parent element, `corner_slopes` those of the functions
    that map it to space.

    Shapes: places (n_elements, corners, dim), corner_slopes (points, corners, dim), slopes (points, k, dim), weights
    (points,); gradients (n_elements, points, k, dim), volumes (n_elements, points).
    """
    dim = len(zero)
    J, inverse = np.empty((dim, dim)), np.empty((dim, dim))
    for e in range(first, last):
        for q in range(len(weights)):
            for i in range(dim):
                total = zero
                for a in range(corner_slopes.shape[1]):
                    total = add_times(total, places[e, a, i], corner_slopes, q, a)
                for j in range(dim):
                    J[i, j] = total[j]
            volumes[e, q] = weights[q] * _invert(J, inverse, zero)
            for a in range(slopes.shape[1]):
                for i in range(dim):
                    result = 0.0
                    for j in range(dim):
                        result += slopes[q, a, j] * inverse[j, i]
                    gradients[e, q, a, i] = result


@kernel
def gradients(first: int, last: int, values: Any, slopes: Any, result: Any, zero: Any) -> None:
    """Write the gradient of a vector field from its values at the elements' nodes.

    Shapes: values (n_elements, k, dim), slopes (n_elements, points, k, dim), result (dim, dim, n_elements, points).
    """
    dim = len(zero)
    for e in range(first, last):
        slopes_here = slopes[e]
        for q in range(slopes.shape[1]):
            for i in range(dim):
                total = zero
                for a in range(values.shape[1]):
                    total = add_times(total, values[e, a, i], slopes_here, q, a)
                for j in range(dim):
                    result[i, j, e, q] = total[j]


@kernel
def forces(
    first: int, last: int, F: Any, S: Any, voigt: Any, gradients: Any, volumes: Any, force: Any, zero: Any
) -> None:
    """Write the element forces, the sum over the points of F S : grad v.

    Shapes: F (dim, dim, n_elements, points), S (n_strains, n_elements, points), voigt (dim, dim), gradients
    (n_elements, points, k, dim), volumes (n_elements, points), force (n_elements, k * dim).
    """
    dim, k = len(zero), gradients.shape[2]
    P = np.empty((dim, dim))
    for e in range(first, last):
        force[e] = 0.0
        for q in range(gradients.shape[1]):
            for i in range(dim):
                for j in range(dim):
                    P[i, j] = 0.0
                    for m in range(dim):
                        P[i, j] += F[i, m, e, q] * S[voigt[m, j], e, q] * volumes[e, q]
            for a in range(k):
                for i in range(dim):
                    for j in range(dim):
                        force[e, a * dim + i] += P[i, j] * gradients[e, q, a, j]


@kernel
def stiffnesses(
    first: int,
    last: int,
    F: Any,
    S: Any,
    D: Any,
    voigt: Any,
    gradients: Any,
    volumes: Any,
    blocks: Any,
    zero: Any,
    square: Any,
) -> None:
    """Write the element stiffnesses, the sum over the points of F^T grad u : D : F^T grad v + S : (grad u^T grad v).

    The derivative of F S by F is A_mn,ij = F_il D_lm,on F_jo + S_mn I_ij, with undeformed directions m and n.

    Shapes: F (dim, dim, n_elements, points), S (n_strains, n_elements, points), D (n_strains, n_strains, n_elements,
    points), voigt (dim, dim), gradients (n_elements, points, k, dim), volumes (n_elements, points), blocks (n_elements,
    k * dim, k * dim); `square` is a tuple of dim^2 zeros.
    """
    dim, n_points, k = len(zero), gradients.shape[1], gradients.shape[2]
    n_strains = dim * (dim + 1) // 2  # len(D), known when compiled
    pulled, A = np.empty((dim, dim, n_strains)), np.empty((dim, dim, dim * dim))
    by_node = np.empty((k, n_points * dim, dim * dim))
    for e in range(first, last):
        for q in range(n_points):
            volume = volumes[e, q]
            for m in range(dim):
                for two in range(n_strains):
                    for i in range(dim):
                        value = 0.0
                        for j in range(dim):
                            value += F[i, j, e, q] * D[voigt[j, m], two, e, q]
                        pulled[i, m, two] = volume * value
            for i in range(dim):
                for m in range(dim):
                    for j in range(dim):
                        for n in range(dim):
                            value = volume * S[voigt[m, n], e, q] if i == j else 0.0
                            for o in range(dim):
                                value += pulled[i, m, voigt[o, n]] * F[j, o, e, q]
                            A[m, n, i * dim + j] = value
            for b in range(k):
                for m in range(dim):
                    total = square
                    for n in range(dim):
                        total = add_times(total, gradients[e, q, b, n], A, m, n)
                    write(by_node, b, q * dim + m, total)
        for a in range(k):
            for b in range(a, k):
                total = square
                for q in range(n_points):
                    for m in range(dim):
                        total = add_times(total, gradients[e, q, a, m], by_node, b, q * dim + m)
                for i in range(dim):
                    for j in range(dim):
                        blocks[e, a * dim + i, b * dim + j] = total[i * dim + j]
                        blocks[e, b * dim + j, a * dim + i] = total[i * dim + j]
