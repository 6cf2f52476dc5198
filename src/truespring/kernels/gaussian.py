"""Loops over elements whose energy depends on sums over springs of zero rest length, and on the volume.

A sum is the quadratic form Q = sum of w |x_a - x_b|^2 over the pairs of an element's nodes, with w minus the entry a, b
of a matrix of the element whose rows sum to zero. Elements of one class have the same matrix.
"""

from typing import Any

import numpy as np
from numba.extending import overload

from truespring.kernels.small import line, minus, plus, row, scaled, unsigned
from truespring.kernels.threads import kernel
from truespring.kernels.volumes import slopes, turns

# A tuple of three zeros: vectors in space.
_SPACE = (0.0, 0.0, 0.0)


@kernel
def pulls(first: int, last: int, x: Any, starts: Any, columns: Any, weights: Any, force: Any, zero: Any) -> None:
    """Write the force of springs of zero rest length on the nodes first to last, the sum of w (x_i - x_j).

    Shapes: x, force (n_nodes, dim), starts (n_nodes + 1,), columns, weights (n_blocks,).
    """
    dim = len(zero)
    total = np.empty(dim)
    for i in range(first, last):
        total[:] = 0.0
        for p in range(starts[i], starts[i + 1]):
            j = columns[p]
            for c in range(dim):
                total[c] += weights[p] * (x[i, c] - x[j, c])
        for c in range(dim):
            force[i, c] = total[c]


@kernel
def sums(first: int, last: int, x: Any, elements: Any, matrices: Any, of: Any, Q: Any, zero: Any) -> None:
    """Write the quadratic forms of each element.

    Shapes: x (n_nodes, dim), elements (n_elements, k), matrices (n_forms, n_classes, k, k), of (n_elements,), Q
    (n_forms, n_elements).
    """
    dim, k = len(zero), elements.shape[1]
    for e in range(first, last):
        for f in range(len(matrices)):
            Q[f, e] = 0.0
        for a in range(k):
            for b in range(a + 1, k):
                square = 0.0
                for c in range(dim):
                    square += (x[elements[e, a], c] - x[elements[e, b], c]) ** 2
                for f in range(len(matrices)):
                    Q[f, e] -= matrices[f, of[e], a, b] * square


@kernel
def forces(
    first: int,
    last: int,
    x: Any,
    elements: Any,
    matrices: Any,
    of: Any,
    factors: Any,
    force: Any,
    zero: Any,
) -> None:
    """Add the derivative of the quadratic forms, times a factor each, to the forces of each element.

    Shapes: x (n_nodes, dim), elements (n_elements, k), matrices (n_forms, n_classes, k, k), of (n_elements,), factors
    (n_forms, n_elements), force (n_elements, k * dim).
    """
    dim, k = len(zero), elements.shape[1]
    for e in range(first, last):
        for a in range(k):
            for b in range(a + 1, k):
                weight = 0.0
                for f in range(len(matrices)):
                    weight -= 2 * factors[f, e] * matrices[f, of[e], a, b]
                d = minus(row(x, elements[e, a], zero), row(x, elements[e, b], zero))
                for c in range(dim):
                    force[e, a * dim + c] += weight * d[c]
                    force[e, b * dim + c] -= weight * d[c]


@kernel
def slopes_and_turns(
    first: int,
    last: int,
    x: Any,
    elements: Any,
    matrices: Any,
    of: Any,
    simplices: Any,
    weight: float,
    numbers: Any,
    slope: Any,
    turn: Any,
    zero: Any,
) -> None:
    """Write the derivatives of the quadratic forms, then of the volume, and the second derivatives of the volume.

    Shapes: x (n_nodes, dim), elements (n_elements, k), matrices (n_forms, n_classes, k, k), of (n_elements,), simplices
    (n_simplices, dim + 1), numbers (k, k): of each pair; slope (n_elements * (n_forms + 1), k, dim), turn (n_elements,
    pairs, 3): the vector w of the pair a < b, see `volumes`.
    """
    dim, k, n_forms = len(zero), elements.shape[1], len(matrices)
    n = n_forms + 1
    own, around = np.empty((k, 3)), np.empty((k, k, 3))
    for e in range(first, last):
        slopes(x, elements[e], simplices, weight, own, zero)
        turns(x, elements[e], simplices, weight, around, zero)
        for a in range(k):
            for c in range(dim):
                slope[e * n + n_forms, a, c] = own[a, c]
            for f in range(n_forms):
                for c in range(dim):
                    slope[e * n + f, a, c] = 0.0
            for b in range(a + 1, k):
                for c in range(3):
                    turn[e, numbers[a, b], c] = around[a, b, c]
        for a in range(k):
            for b in range(a + 1, k):
                for f in range(n_forms):
                    for c in range(dim):
                        part = -2 * matrices[f, of[e], a, b] * (x[elements[e, a], c] - x[elements[e, b], c])
                        slope[e * n + f, a, c] += part
                        slope[e * n + f, b, c] -= part


@kernel
def growths(first: int, last: int, step: Any, elements: Any, slope: Any, growth: Any, zero: Any) -> None:
    """Write the change of the quadratic forms and of the volume that is linear in a step.

    Shapes: step (n_nodes, dim), elements (n_elements, k), slope (n_elements * n, k, dim), growth (n, n_elements).
    """
    dim, k, n = len(zero), elements.shape[1], len(growth)
    for e in range(first, last):
        for m in range(n):
            total = 0.0
            for a in range(k):
                for c in range(dim):
                    total += slope[e * n + m, a, c] * step[elements[e, a], c]
            growth[m, e] = total


def add_turn(blocks, p, i, j, factor, w, zero):
    """Add factor times the matrix that maps v to v x w to block p, from row i and column j on, of len(zero) rows."""


@overload(add_turn)
def _add_turn(blocks, p, i, j, factor, w, zero):
    def two(blocks, p, i, j, factor, w, zero):
        blocks[p, i, j + 1] += factor * w[2]
        blocks[p, i + 1, j] -= factor * w[2]

    def three(blocks, p, i, j, factor, w, zero):
        x, y, z = factor * w[0], factor * w[1], factor * w[2]
        blocks[p, i, j + 1] += z
        blocks[p, i + 1, j] -= z
        blocks[p, i + 1, j + 2] += x
        blocks[p, i + 2, j + 1] -= x
        blocks[p, i + 2, j] += y
        blocks[p, i, j + 2] -= y

    return {2: two, 3: three}[len(zero)]


def add_dyad(blocks, p, i, j, a, b):
    """Add a b^T to block p, from row i and column j on."""


@overload(add_dyad)
def _add_dyad(blocks, p, i, j, a, b):
    def two(blocks, p, i, j, a, b):
        blocks[p, i, j] += a[0] * b[0]
        blocks[p, i, j + 1] += a[0] * b[1]
        blocks[p, i + 1, j] += a[1] * b[0]
        blocks[p, i + 1, j + 1] += a[1] * b[1]

    def three(blocks, p, i, j, a, b):
        blocks[p, i, j] += a[0] * b[0]
        blocks[p, i, j + 1] += a[0] * b[1]
        blocks[p, i, j + 2] += a[0] * b[2]
        blocks[p, i + 1, j] += a[1] * b[0]
        blocks[p, i + 1, j + 1] += a[1] * b[1]
        blocks[p, i + 1, j + 2] += a[1] * b[2]
        blocks[p, i + 2, j] += a[2] * b[0]
        blocks[p, i + 2, j + 1] += a[2] * b[1]
        blocks[p, i + 2, j + 2] += a[2] * b[2]

    return {2: two, 3: three}[len(a)]


@kernel
def _weighed(e: int, a: int, m: int, slope: Any, second: Any, zero: Any) -> Any:
    """Return column m of the product of the slopes at node a and the matrix `second` of an element."""
    n = second.shape[1]
    total = zero
    for other in range(n):
        total = plus(total, scaled(second[e, other, m], line(slope, e * n + other, a, zero)))
    return total


@kernel
def _stiffness(e: int, a: int, b: int, matrices: Any, of: Any, factors: Any) -> float:
    """Return entry a, b of the sum of the matrices of an element, times twice their factors."""
    total = 0.0
    for f in range(len(matrices)):
        total += 2 * factors[f, e] * matrices[f, of[e], a, b]
    return total


@kernel
def add_rows(
    first: int,
    last: int,
    at_starts: Any,
    at: Any,
    slots: Any,
    slope: Any,
    second: Any,
    matrices: Any,
    of: Any,
    factors: Any,
    turn: Any,
    pressure: Any,
    numbers: Any,
    values: Any,
    zero: Any,
) -> None:
    """Add the second derivatives of the elements' energies to the rows of the nodes first to last of a matrix.

    The energy depends on n_forms quadratic forms and the volume; `second` are the second derivatives by these,
    `factors` the first derivatives by the forms, `pressure` that by the volume. With n_forms = 0 the forms have no
    part in the result.

    Shapes: at_starts (n_nodes + 1,), at (n_elements * k,), slots (n_elements, k, k), slope (n_elements * (n_forms + 1),
    k, dim), second (n_elements, n_forms + 1, n_forms + 1), matrices (n_forms, n_classes, k, k), of (n_elements,),
    factors (n_forms, n_elements), turn (n_elements, pairs, 3), pressure (n_elements,), numbers (k, k), values
    (n_blocks, dim, dim).
    """
    k, n = unsigned(slots.shape[1]), second.shape[1]
    for i in range(first, last):
        for q in range(at_starts[i], at_starts[i + 1]):
            place = unsigned(at[unsigned(q)])
            e = place // k
            a = place - e * k
            for m in range(n):
                by = _weighed(e, a, m, slope, second, zero)
                for b in range(k):
                    add_dyad(values, unsigned(slots[e, a, b]), 0, 0, by, line(slope, e * n + m, b, zero))
            for b in range(k):
                p = unsigned(slots[e, a, b])
                if n > 1:
                    spring = _stiffness(e, a, b, matrices, of, factors)
                    for c in range(len(zero)):
                        values[p, c, c] += spring
                if a != b:
                    sign = pressure[e] if a < b else -pressure[e]
                    add_turn(values, p, 0, 0, sign, line(turn, e, numbers[a, b], _SPACE), zero)


@kernel
def add_matrices(
    first: int,
    last: int,
    slope: Any,
    second: Any,
    matrices: Any,
    of: Any,
    factors: Any,
    turn: Any,
    pressure: Any,
    numbers: Any,
    blocks: Any,
    zero: Any,
) -> None:
    """Add the second derivatives of the elements' energies to element matrices, shape (n_elements, k * dim, k * dim).

    Other shapes as in `add_rows`.
    """
    dim, k, n = len(zero), slope.shape[1], second.shape[1]
    for e in range(first, last):
        for a in range(k):
            for m in range(n):
                by = _weighed(e, a, m, slope, second, zero)
                for b in range(k):
                    add_dyad(blocks, e, a * dim, b * dim, by, line(slope, e * n + m, b, zero))
            for b in range(k):
                if n > 1:
                    spring = _stiffness(e, a, b, matrices, of, factors)
                    for c in range(dim):
                        blocks[e, a * dim + c, b * dim + c] += spring
                if a != b:
                    sign = pressure[e] if a < b else -pressure[e]
                    add_turn(blocks, e, a * dim, b * dim, sign, line(turn, e, numbers[a, b], _SPACE), zero)
