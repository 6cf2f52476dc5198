"""Loops over finite elements, LANES at a time: shape functions, strains, forces and stiffness matrices.

Arrays have two axes, (row, element), or three, (block, row, lane), those that only kernels read; the rows of tensors,
nodes and Gauss points follow each other. Row (i * dim + j) * n_points + q of F is F_ij at point q, row (a * dim + i) *
n_points + q of `gradients` the derivative in direction i of the shape function of node a. Symmetric tensors have
n_strains = dim (dim + 1) / 2 components in Voigt order; `voigt`, shape (dim, dim), is the component of each pair of
directions. The number of elements is a multiple of LANES; `first` and `last` count blocks of LANES elements.
"""

from typing import Any

from truespring.kernels.lanes import LANES, add_times, fill, load, room, store, zeros
from truespring.kernels.threads import kernel


@kernel
def _product(values: Any, k: int, slopes: Any, q: int, J: Any, zero: Any) -> None:
    """Write the derivative of a field by the coordinates of the parent element.

    Shapes: values (k * dim, LANES), slopes (points, k, dim), J (dim^2, LANES).
    """
    dim = len(zero)
    for i in range(dim):
        for j in range(dim):
            total = load(values, i, 0) * slopes[q, 0, j]
            for a in range(1, k):
                total = total + load(values, a * dim + i, 0) * slopes[q, a, j]
            store(J, i * dim + j, 0, total)


@kernel
def _cofactor(A: Any, row: int, column: int, zero: Any) -> Any:
    """Return a cofactor of a matrix, shape (dim^2, LANES)."""
    dim = len(zero)
    i, a = (row + 1) % dim, (column + 1) % dim
    if dim == 2:
        found = load(A, i * 2 + a, 0)
        return found if row == column else found * -1.0
    j, b = (row + 2) % 3, (column + 2) % 3
    return load(A, i * 3 + a, 0) * load(A, j * 3 + b, 0) - load(A, i * 3 + b, 0) * load(A, j * 3 + a, 0)


@kernel
def _invert(A: Any, inverse: Any, zero: Any) -> Any:
    """Write the inverse of a matrix and return its determinant; shapes (dim^2, LANES)."""
    dim = len(zero)
    for i in range(dim):
        for a in range(dim):
            store(inverse, a * dim + i, 0, _cofactor(A, i, a, zero))
    det = load(A, 0, 0) * load(inverse, 0, 0)
    for a in range(1, dim):
        det = det + load(A, a, 0) * load(inverse, a * dim, 0)
    share = 1.0 / det
    for i in range(dim * dim):
        store(inverse, i, 0, load(inverse, i, 0) * share)
    return det


@kernel
def _determinant(A: Any, zero: Any) -> Any:
    """Return the determinant of a matrix, shape (dim^2, LANES)."""
    total = load(A, 0, 0) * _cofactor(A, 0, 0, zero)
    for a in range(1, len(zero)):
        total = total + load(A, a, 0) * _cofactor(A, 0, a, zero)
    return total


@kernel
def _strain(F: Any, i: int, j: int, frame: int, zero: Any) -> Any:
    """Return the component i, j of the strain of a deformation gradient, shape (dim^2, LANES)."""
    dim = len(zero)
    if frame == 0:
        return (load(F, i * dim + j, 0) + load(F, j * dim + i, 0)) * 0.5 - (1.0 if i == j else 0.0)
    over, along = (1, dim) if frame == 2 else (dim, 1)
    total = load(F, i * along, 0) * load(F, j * along, 0)
    for m in range(1, dim):
        total = total + load(F, i * along + m * over, 0) * load(F, j * along + m * over, 0)
    return total


@kernel
def _gather(x: Any, elements: Any, first: int, k: int, values: Any) -> None:
    """Write the values of the first k nodes of LANES elements.

    Shapes: x (n_nodes, dim), elements (n, at least k), values (k * dim, LANES).
    """
    dim = x.shape[1]
    for lane in range(LANES):
        for a in range(k):
            for i in range(dim):
                values[a * dim + i, lane] = x[elements[first + lane, a], i]


@kernel
def deformations(
    first: int,
    last: int,
    nodes: Any,
    x: Any,
    elements: Any,
    corner_slopes: Any,
    slopes: Any,
    weights: Any,
    frame: int,
    voigt: Any,
    gradients: Any,
    volumes: Any,
    F: Any,
    ratios: Any,
    strain: Any,
    zero: Any,
) -> None:
    """Write the gradients of the shape functions, the volume of each point, F, det F, and the strain.

    `slopes` are the derivatives of the shape functions on the parent element, `corner_slopes` those of the functions
    that map it to the undeformed body. Frames: 0, the small strain; 1, F^T F; 2, F F^T and gradients by the current
    coordinates, not by the undeformed ones.

    Shapes: nodes, x (n_nodes, dim), elements (n, k), corner_slopes (points, corners, dim), slopes (points, k, dim),
    weights (points,), voigt (dim, dim), gradients (n / LANES, k * dim * points, LANES), volumes, ratios (points, n), F
    (dim^2 * points, n), strain (n_strains * points, n).
    """
    dim, n_points, k, corners = len(zero), len(weights), slopes.shape[1], corner_slopes.shape[1]
    at_rest, moved = room(corners * dim), room(k * dim)
    J, inverse, now, back, deformed = (
        room(dim * dim),
        room(dim * dim),
        room(dim * dim),
        room(dim * dim),
        room(dim * dim),
    )
    for block in range(first, last):
        e = block * LANES
        _gather(nodes, elements, e, corners, at_rest)
        _gather(x, elements, e, k, moved)
        for q in range(n_points):
            _product(at_rest, corners, corner_slopes, q, J, zero)
            store(volumes, q, e, _invert(J, inverse, zero) * weights[q])
            _product(moved, k, slopes, q, now, zero)
            for i in range(dim):
                for j in range(dim):
                    total = load(now, i * dim, 0) * load(inverse, j, 0)
                    for m in range(1, dim):
                        total = total + load(now, i * dim + m, 0) * load(inverse, m * dim + j, 0)
                    store(deformed, i * dim + j, 0, total)
                    store(F, (i * dim + j) * n_points + q, e, total)
            store(ratios, q, e, _determinant(deformed, zero))
            for i in range(dim):
                for j in range(i, dim):
                    store(strain, voigt[i, j] * n_points + q, e, _strain(deformed, i, j, frame, zero))
            if frame == 2:
                _invert(now, back, zero)
            by = back if frame == 2 else inverse
            for i in range(dim):
                for a in range(k):
                    total = load(by, i, 0) * slopes[q, a, 0]
                    for j in range(1, dim):
                        total = total + load(by, j * dim + i, 0) * slopes[q, a, j]
                    store(gradients[block], (a * dim + i) * n_points + q, 0, total)


@kernel
def strain_changes(
    first: int,
    last: int,
    step: Any,
    elements: Any,
    gradients: Any,
    F: Any,
    turned: bool,
    voigt: Any,
    change: Any,
    zero: Any,
) -> None:
    """Write the symmetric part of F^T grad u for the nodal values u of a step; F is the identity unless `turned`.

    Shapes: step (n_nodes, dim), elements (n, k), gradients (n / LANES, k * dim * points, LANES), F (dim^2 * points, n),
    voigt (dim, dim), change (n_strains * points, n).
    """
    dim, k = len(zero), elements.shape[1]
    n_points = gradients.shape[1] // (k * dim)
    values, grad, product = room(k * dim), room(dim * dim), room(dim * dim)
    for block in range(first, last):
        e = block * LANES
        slopes = gradients[block]
        _gather(step, elements, e, k, values)
        for q in range(n_points):
            for i in range(dim):
                for j in range(dim):
                    total = load(values, i, 0) * load(slopes, j * n_points + q, 0)
                    for a in range(1, k):
                        total = total + load(values, a * dim + i, 0) * load(slopes, (a * dim + j) * n_points + q, 0)
                    store(grad, i * dim + j, 0, total)
            if turned:
                for i in range(dim):
                    for j in range(dim):
                        total = load(F, i * n_points + q, e) * load(grad, j, 0)
                        for m in range(1, dim):
                            total = total + load(F, (m * dim + i) * n_points + q, e) * load(grad, m * dim + j, 0)
                        store(product, i * dim + j, 0, total)
            found = product if turned else grad
            for i in range(dim):
                for j in range(i, dim):
                    both = load(found, i * dim + j, 0) + load(found, j * dim + i, 0)
                    store(change, voigt[i, j] * n_points + q, e, both * 0.5)


@kernel
def congruences(first: int, last: int, F: Any, S: Any, inverse: bool, voigt: Any, result: Any, zero: Any) -> None:
    """Write F S F^T, or with the inverse of F instead of F.

    Shapes: F (dim^2 * points, n), S, result (n_strains * points, n), voigt (dim, dim).
    """
    dim = len(zero)
    n_points = F.shape[0] // (dim * dim)
    A, back, product = room(dim * dim), room(dim * dim), room(dim * dim)
    for block in range(first, last):
        e = block * LANES
        for q in range(n_points):
            for i in range(dim * dim):
                store(A, i, 0, load(F, i * n_points + q, e))
            if inverse:
                _invert(A, back, zero)
            by = back if inverse else A
            for i in range(dim):
                for j in range(dim):
                    total = load(by, i * dim, 0) * load(S, voigt[0, j] * n_points + q, e)
                    for m in range(1, dim):
                        total = total + load(by, i * dim + m, 0) * load(S, voigt[m, j] * n_points + q, e)
                    store(product, i * dim + j, 0, total)
            for i in range(dim):
                for j in range(i, dim):
                    total = load(product, i * dim, 0) * load(by, j * dim, 0)
                    for m in range(1, dim):
                        total = total + load(product, i * dim + m, 0) * load(by, j * dim + m, 0)
                    store(result, voigt[i, j] * n_points + q, e, total)


@kernel
def forces(
    first: int,
    last: int,
    F: Any,
    turned: bool,
    S: Any,
    voigt: Any,
    gradients: Any,
    volumes: Any,
    force: Any,
    zero: Any,
) -> None:
    """Write the element forces, the sum over the points of F S : grad v; F is the identity unless `turned`.

    Shapes: F (dim^2 * points, n), S (n_strains * points, n), voigt (dim, dim), gradients (n / LANES, k * dim * points,
    LANES), volumes (points, n), force (k * dim, n).
    """
    dim, n_points = len(zero), volumes.shape[0]
    k = gradients.shape[1] // (dim * n_points)
    P = room(dim * dim)
    for block in range(first, last):
        e, slopes = block * LANES, gradients[block]
        for q in range(n_points):
            volume = load(volumes, q, e)
            for i in range(dim):
                for m in range(dim):
                    total = load(S, voigt[i, m] * n_points + q, e)
                    if turned:
                        total = load(F, i * dim * n_points + q, e) * load(S, voigt[0, m] * n_points + q, e)
                        for j in range(1, dim):
                            total = total + load(F, (i * dim + j) * n_points + q, e) * load(
                                S, voigt[j, m] * n_points + q, e
                            )
                    store(P, m * dim + i, 0, volume * total)  # transposed
            for a in range(k):
                total = zeros(zero)
                for m in range(dim):
                    total = add_times(total, load(slopes, (a * dim + m) * n_points + q, 0), P, m * dim, 0)
                if q > 0:
                    total = add_times(total, 1.0, force, a * dim, e)
                fill(force, a * dim, e, total)


@kernel
def _elasticity(
    e: int, q: int, n_points: int, alike: Any, shear: Any, coupled: Any, rest: Any, D: Any, zero: Any
) -> None:
    """Write the elasticity of a point, see `stiffnesses`; D (n_strains^2, LANES)."""
    dim = len(zero)
    n_strains = dim * (dim + 1) // 2
    nothing = load(alike, q, e) * 0.0
    for one in range(n_strains):
        for two in range(n_strains):
            value = load(rest, (one * n_strains + two) * n_points + q, e) if len(rest) else nothing
            if one < dim and two < dim:
                value = value + load(alike, q, e)
            if one == two:
                value = value + load(shear, q, e) * (2.0 if one < dim else 1.0)
            if len(coupled) and two < dim:
                value = value + load(coupled, one * n_points + q, e)
            if len(coupled) and one < dim:
                value = value + load(coupled, two * n_points + q, e)
            store(D, one * n_strains + two, 0, value)


@kernel
def _moduli(
    e: int, q: int, n_points: int, F: Any, turned: bool, S: Any, D: Any, voigt: Any, volume: Any, A: Any, zero: Any
) -> None:
    """Write the derivative of F S by F times the volume of a point: A_mn,ij = F_il D_lm,on F_jo + S_mn I_ij.

    Shapes: D (n_strains^2, LANES), A (dim^4, LANES), others as in `stiffnesses`.
    """
    dim = len(zero)
    n_strains = dim * (dim + 1) // 2
    pulled = room(dim * dim * n_strains if turned else 0)
    for m in range(dim if turned else 0):
        for two in range(n_strains):
            for i in range(dim):
                total = load(F, i * dim * n_points + q, e) * load(D, voigt[0, m] * n_strains + two, 0)
                for j in range(1, dim):
                    factor = load(F, (i * dim + j) * n_points + q, e)
                    total = total + factor * load(D, voigt[j, m] * n_strains + two, 0)
                store(pulled, (i * dim + m) * n_strains + two, 0, total)
    for m in range(dim):
        for n in range(dim):
            for i in range(dim):
                for j in range(dim):
                    total = load(D, voigt[i, m] * n_strains + voigt[j, n], 0)
                    if turned:
                        row = (i * dim + m) * n_strains
                        total = load(pulled, row + voigt[0, n], 0) * load(F, j * dim * n_points + q, e)
                        for o in range(1, dim):
                            factor = load(F, (j * dim + o) * n_points + q, e)
                            total = total + load(pulled, row + voigt[o, n], 0) * factor
                    if i == j:
                        total = total + load(S, voigt[m, n] * n_points + q, e)
                    store(A, (m * dim + n) * dim * dim + i * dim + j, 0, volume * total)


@kernel
def stiffnesses(
    first: int,
    last: int,
    F: Any,
    turned: bool,
    S: Any,
    alike: Any,
    shear: Any,
    coupled: Any,
    rest: Any,
    voigt: Any,
    gradients: Any,
    volumes: Any,
    along: Any,
    across: Any,
    blocks: Any,
    zero: Any,
    square: Any,
) -> None:
    """Write the element stiffnesses, the sum over the points of F^T grad u : D : F^T grad v + S : (grad u^T grad v).

    D = alike I (x) I + shear (I_ik I_jl + I_il I_jk) + T (x) I + I (x) T + rest, T given by `coupled`, the last two
    unless they have no rows. F is the identity unless `turned`. Adds a b^T + b a^T of the columns a of `along` and b of
    `across`, unless these have no rows. Only the blocks of pairs of nodes a <= b are written: row (b (b + 1) / 2 + a)
    dim^2 + i * dim + j is the entry i, j of a pair.

    Shapes: F (dim^2 * points, n), S (n_strains * points, n), alike, shear (points, n), coupled (n_strains * points or
    0, n), rest (n_strains^2 * points or 0, n), voigt (dim, dim), gradients (n / LANES, k * dim * points, LANES),
    volumes (points, n), along, across (k * dim or 0, n), blocks (n / LANES, k (k + 1) / 2 * dim^2, LANES); `square` is
    a tuple of dim^2 zeros.
    """
    dim, n_points = len(zero), volumes.shape[0]
    squares, k = dim * dim, gradients.shape[1] // (dim * n_points)
    n_strains = dim * (dim + 1) // 2
    D, A, slopes = room(n_strains * n_strains), room(squares * squares), room(k * dim * n_points)
    width = n_points * dim * squares
    by_node = room(k * width)
    for block in range(first, last):
        e, found = block * LANES, blocks[block]
        for row in range(k * dim * n_points):
            store(slopes, row, 0, load(gradients[block], row, 0))
        for q in range(n_points):
            _elasticity(e, q, n_points, alike, shear, coupled, rest, D, zero)
            _moduli(e, q, n_points, F, turned, S, D, voigt, load(volumes, q, e), A, zero)
            for b in range(0, k, 2):
                other = min(b + 1, k - 1)
                for m in range(dim):
                    one, two = zeros(square), zeros(square)
                    for n in range(dim):
                        at = (m * dim + n) * squares
                        one = add_times(one, load(slopes, (b * dim + n) * n_points + q, 0), A, at, 0)
                        two = add_times(two, load(slopes, (other * dim + n) * n_points + q, 0), A, at, 0)
                    fill(by_node, b * width + (m * n_points + q) * squares, 0, one)
                    fill(by_node, other * width + (m * n_points + q) * squares, 0, two)
        for b in range(k):
            for a in range(0, b + 1, 2):
                other = min(a + 1, b)
                one, two = zeros(square), zeros(square)
                for row in range(dim * n_points):
                    at = b * width + row * squares
                    one = add_times(one, load(slopes, a * dim * n_points + row, 0), by_node, at, 0)
                    two = add_times(two, load(slopes, other * dim * n_points + row, 0), by_node, at, 0)
                pair = b * (b + 1) // 2
                fill(found, (pair + a) * squares, 0, one)
                fill(found, (pair + other) * squares, 0, two)
        for b in range(k if len(along) else 0):
            for a in range(b + 1):
                for i in range(dim):
                    for j in range(dim):
                        row = (b * (b + 1) // 2 + a) * squares + i * dim + j
                        value = load(found, row, 0)
                        value = value + load(along, a * dim + i, e) * load(across, b * dim + j, e)
                        value = value + load(across, a * dim + i, e) * load(along, b * dim + j, e)
                        store(found, row, 0, value)
