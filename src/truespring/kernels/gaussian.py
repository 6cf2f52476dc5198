"""Loops over elements whose energy depends on sums over springs of zero rest length, and on the volume.

A sum is the quadratic form Q = sum of w |x_a - x_b|^2 over the pairs of an element's nodes, with w minus the entry a, b
of a matrix of the element whose rows sum to zero. Elements of one class have the same matrix.
"""

from typing import Any

import numpy as np

from truespring.kernels.small import minus, row
from truespring.kernels.threads import kernel
from truespring.kernels.volumes import slopes, turns


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
    (n_simplices, dim + 1), numbers (k, k): of each pair; slope (n_elements, n_forms + 1, k, dim), turn (n_elements,
    pairs, 3): the vector w of the pair a < b, see `volumes`.
    """
    dim, k, n_forms = len(zero), elements.shape[1], len(matrices)
    own, around = np.empty((k, 3)), np.empty((k, k, 3))
    for e in range(first, last):
        slopes(x, elements[e], simplices, weight, own, zero)
        turns(x, elements[e], simplices, weight, around, zero)
        for a in range(k):
            for c in range(dim):
                slope[e, n_forms, a, c] = own[a, c]
            for f in range(n_forms):
                for c in range(dim):
                    slope[e, f, a, c] = 0.0
            for b in range(a + 1, k):
                for c in range(3):
                    turn[e, numbers[a, b], c] = around[a, b, c]
        for a in range(k):
            for b in range(a + 1, k):
                for f in range(n_forms):
                    for c in range(dim):
                        part = -2 * matrices[f, of[e], a, b] * (x[elements[e, a], c] - x[elements[e, b], c])
                        slope[e, f, a, c] += part
                        slope[e, f, b, c] -= part


@kernel
def growths(first: int, last: int, step: Any, elements: Any, slope: Any, growth: Any, zero: Any) -> None:
    """Write the change of the quadratic forms and of the volume that is linear in a step.

    Shapes: step (n_nodes, dim), elements (n_elements, k), slope (n_elements, n, k, dim), growth (n, n_elements).
    """
    dim, k = len(zero), elements.shape[1]
    for e in range(first, last):
        for m in range(slope.shape[1]):
            total = 0.0
            for a in range(k):
                for c in range(dim):
                    total += slope[e, m, a, c] * step[elements[e, a], c]
            growth[m, e] = total


@kernel
def _add_block(
    e: int,
    a: int,
    b: int,
    slope: Any,
    second: Any,
    matrices: Any,
    of: Any,
    factors: Any,
    turn: Any,
    pressure: Any,
    numbers: Any,
    by: Any,
    values: Any,
    p: int,
    top: int,
    left: int,
    zero: Any,
) -> None:
    """Add the second derivative of an element's energy by its nodes a and b to values[p, top:, left:].

    `by` is the product of the slopes at node a and the matrix `second`, shape (n_forms + 1, dim).
    """
    dim, n = len(zero), slope.shape[1]
    for i in range(dim):
        for j in range(dim):
            total = 0.0
            for m in range(n):
                total += by[m, i] * slope[e, m, b, j]
            values[p, top + i, left + j] += total
    if n > 1:
        spring = 0.0
        for f in range(n - 1):
            spring += 2 * factors[f, e] * matrices[f, of[e], a, b]
        for i in range(dim):
            values[p, top + i, left + i] += spring
    if a != b:
        sign = pressure[e] if a < b else -pressure[e]
        pair = numbers[a, b]
        for c in range(3):
            i, j = (c + 1) % 3, (c + 2) % 3
            if i < dim and j < dim:
                values[p, top + i, left + j] += sign * turn[e, pair, c]
                values[p, top + j, left + i] -= sign * turn[e, pair, c]


@kernel
def _weigh(e: int, a: int, slope: Any, second: Any, by: Any, zero: Any) -> None:
    """Write the product of the slopes at node a and the matrix `second` of an element."""
    for m in range(slope.shape[1]):
        for i in range(len(zero)):
            total = 0.0
            for n in range(slope.shape[1]):
                total += slope[e, n, a, i] * second[e, n, m]
            by[m, i] = total


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

    Shapes: at_starts (n_nodes + 1,), at (n_elements * k,), slots (n_elements, k, k), slope (n_elements, n_forms + 1, k,
    dim), second (n_elements, n_forms + 1, n_forms + 1), matrices (n_forms, n_classes, k, k), of (n_elements,), factors
    (n_forms, n_elements), turn (n_elements, pairs, 3), pressure (n_elements,), numbers (k, k), values (n_blocks, dim,
    dim).
    """
    k, n = slots.shape[1], slope.shape[1]
    by = np.empty((n, len(zero)))
    for i in range(first, last):
        for q in range(at_starts[i], at_starts[i + 1]):
            e, a = at[q] // k, at[q] % k
            _weigh(e, a, slope, second, by, zero)
            for b in range(k):
                p = slots[e, a, b]
                _add_block(
                    e, a, b, slope, second, matrices, of, factors, turn, pressure, numbers, by, values, p, 0, 0, zero
                )


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
    dim, k, n = len(zero), slope.shape[2], slope.shape[1]
    by = np.empty((n, dim))
    for e in range(first, last):
        for a in range(k):
            _weigh(e, a, slope, second, by, zero)
            for b in range(k):
                top, left = a * dim, b * dim
                _add_block(
                    e,
                    a,
                    b,
                    slope,
                    second,
                    matrices,
                    of,
                    factors,
                    turn,
                    pressure,
                    numbers,
                    by,
                    blocks,
                    e,
                    top,
                    left,
                    zero,
                )
