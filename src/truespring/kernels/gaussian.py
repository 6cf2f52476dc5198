"""Loops over elements whose energy depends on sums over springs of zero rest length, and on the volume.

A sum is the quadratic form Q = sum of w |x_a - x_b|^2 over the pairs of an element's nodes, with w minus the entry a, b
of a matrix of the element whose rows sum to zero. Elements of one class have the same matrix.
"""

from typing import Any

import numpy as np
from numba.extending import overload

from truespring.kernels.measures import turn
from truespring.kernels.small import line, minus, plus, put, row, scaled, unsigned
from truespring.kernels.threads import kernel

# A tuple of three zeros: vectors in space.
_SPACE = (0.0, 0.0, 0.0)
ZERO, ONE, TWO = unsigned(0), unsigned(1), unsigned(2)
#: Number of element matrices that are factorised at a time, the lanes of vector registers.
LANES = 16
# Shares are multiples of 2^-_HALVINGS.
_HALVINGS = 4
# Share of the positive parts that is added to them: rotations may have no stiffness but for rounding errors.
_ROUNDING = 1e-10


@kernel
def element(place: Any, k: Any) -> Any:
    """Return place // k; dividing by a number that is not known when compiled takes several times as long."""
    if k == 8:
        return place >> unsigned(3)
    return place >> TWO if k == 4 else place // k


@kernel
def pulls(first: int, last: int, x: Any, starts: Any, columns: Any, weights: Any, force: Any, zero: Any) -> None:
    """Write the force of springs of zero rest length on the nodes first to last, the sum of w (x_i - x_j).

    Shapes: x, force (n_nodes, dim), starts (n_nodes + 1,), columns, weights (n_blocks,).
    """
    for i in range(first, last):
        here, total = row(x, i, zero), zero
        for p in range(starts[i], starts[i + 1]):
            d = minus(here, row(x, columns[unsigned(p)], zero))
            total = plus(total, scaled(weights[unsigned(p)], d))
        put(force, i, total)


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
def slopes(first: int, last: int, x: Any, elements: Any, matrices: Any, of: Any, slope: Any, zero: Any) -> None:
    """Write the derivatives of the quadratic forms of each element by its nodes.

    Shapes: x (n_nodes, dim), elements (n_elements, k), matrices (n_forms, n_classes, k, k), of (n_elements,), slope
    (n_elements * (n_forms + 1), k, dim): rows of the forms, then that of the volume, for each element.
    """
    dim, k, n_forms = len(zero), elements.shape[1], len(matrices)
    for e in range(first, last):
        for f in range(n_forms):
            at = e * (n_forms + 1) + f
            slope[at] = 0.0
            for a in range(k):
                for b in range(a + 1, k):
                    for c in range(dim):
                        part = -2 * matrices[f, of[e], a, b] * (x[elements[e, a], c] - x[elements[e, b], c])
                        slope[at, a, c] += part
                        slope[at, b, c] -= part


@kernel
def add_forces(first: int, last: int, at_starts: Any, at: Any, slope: Any, factors: Any, force: Any, zero: Any) -> None:
    """Add the forces of the elements, the sum of slopes times a factor each, to the nodes first to last.

    Shapes: at_starts (n_nodes + 1,), at (n_elements * k,), slope (n_elements * n, k, dim), factors (n, n_elements),
    force (n_nodes, dim).
    """
    k, n = unsigned(slope.shape[1]), unsigned(len(factors))
    for i in range(first, last):
        total = row(force, i, zero)
        for m in range(n):
            for q in range(at_starts[i], at_starts[i + 1]):
                place = unsigned(at[unsigned(q)])
                e = element(place, k)
                total = plus(total, scaled(factors[m, e], line(slope, e * n + m, place - e * k, zero)))
        put(force, i, total)


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


def add_part(blocks, p, i, j, a, b, w):
    """Add a b^T and the matrix that maps v to v x w to block p, from row i and column j on."""


@overload(add_part)
def _add_part(blocks, p, i, j, a, b, w):
    def two(blocks, p, i, j, a, b, w):
        p, i, j = unsigned(p), unsigned(i), unsigned(j)
        blocks[p, i, j] += a[0] * b[0]
        blocks[p, i, j + ONE] += a[0] * b[1] + w[2]
        blocks[p, i + ONE, j] += a[1] * b[0] - w[2]
        blocks[p, i + ONE, j + ONE] += a[1] * b[1]

    def three(blocks, p, i, j, a, b, w):
        p, i, j = unsigned(p), unsigned(i), unsigned(j)
        blocks[p, i, j] += a[0] * b[0]
        blocks[p, i, j + ONE] += a[0] * b[1] + w[2]
        blocks[p, i, j + TWO] += a[0] * b[2] - w[1]
        blocks[p, i + ONE, j] += a[1] * b[0] - w[2]
        blocks[p, i + ONE, j + ONE] += a[1] * b[1]
        blocks[p, i + ONE, j + TWO] += a[1] * b[2] + w[0]
        blocks[p, i + TWO, j] += a[2] * b[0] + w[1]
        blocks[p, i + TWO, j + ONE] += a[2] * b[1] - w[0]
        blocks[p, i + TWO, j + TWO] += a[2] * b[2]

    return {2: two, 3: three}[len(a)]


@kernel
def _weighed(e: int, a: int, m: int, slope: Any, second: Any, zero: Any) -> Any:
    """Return column m of the product of the slopes at node a and the matrix `second` of an element."""
    n = unsigned(second.shape[1])
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
def rows(
    first: int,
    last: int,
    at_starts: Any,
    at: Any,
    slots: Any,
    row_starts: Any,
    weights: Any,
    x: Any,
    elements: Any,
    starts: Any,
    others: Any,
    coefficients: Any,
    slope: Any,
    second: Any,
    pressure: Any,
    matrices: Any,
    of: Any,
    factors: Any,
    values: Any,
    zero: Any,
) -> None:
    """Write the second derivatives of the energy in the rows of the nodes first to last of a matrix.

    The energy of an element depends on quadratic forms and the volume; `second` are the second derivatives by these,
    `factors` the first derivatives by the forms, `pressure` that by the volume; `starts`, `others`, `coefficients` are
    the table of `measures.turn`. Forms of constant stiffness have no slopes; their stiffness is in `weights`, or in
    `matrices` and `factors`.

    Shapes: at_starts, row_starts (n_nodes + 1,), at (n_elements * k,), slots (n_elements, k, k), weights (n_blocks,),
    or none of them, x (n_nodes, dim), elements (n_elements, k), slope (n_elements * n, k, dim), second (n_elements, n,
    n), pressure (n_elements,), matrices (n_forms, n_classes, k, k), of (n_elements,), factors (n_forms, n_elements),
    values (n_blocks, dim, dim).
    """
    dim, k, n = unsigned(len(zero)), unsigned(slots.shape[1]), unsigned(second.shape[1])
    for i in range(first, last):
        for p in range(row_starts[i], row_starts[i + 1]):
            for c in range(dim):
                for d in range(dim):
                    values[unsigned(p), c, d] = -weights[unsigned(p)] if c == d and len(weights) > 0 else 0.0
        for q in range(at_starts[i], at_starts[i + 1]):
            place = unsigned(at[unsigned(q)])
            e = element(place, k)
            a = place - e * k
            for m in range(n):
                by = _weighed(e, a, m, slope, second, zero)
                for b in range(k):
                    w = _SPACE
                    if m == n - ONE:
                        w = scaled(pressure[e], turn(x, elements[e], starts, others, coefficients, a * k + b, zero))
                    add_part(values, slots[e, a, b], ZERO, ZERO, by, line(slope, e * n + m, b, zero), w)
            if len(matrices) > 0:
                for b in range(k):
                    spring = _stiffness(e, a, b, matrices, of, factors)
                    for c in range(dim):
                        values[unsigned(slots[e, a, b]), c, c] += spring


@kernel
def add_matrices(
    first: int,
    last: int,
    x: Any,
    elements: Any,
    starts: Any,
    others: Any,
    coefficients: Any,
    slope: Any,
    second: Any,
    pressure: Any,
    matrices: Any,
    of: Any,
    factors: Any,
    blocks: Any,
    zero: Any,
) -> None:
    """Add the second derivatives of the elements' energies to element matrices, shape (n_elements, k * dim, k * dim).

    Other shapes as in `rows`.
    """
    dim, k, n = unsigned(len(zero)), unsigned(slope.shape[1]), unsigned(second.shape[1])
    for e in range(unsigned(first), unsigned(last)):
        for a in range(k):
            for m in range(n):
                by = _weighed(e, a, m, slope, second, zero)
                for b in range(k):
                    w = _SPACE
                    if m == n - ONE:
                        w = scaled(pressure[e], turn(x, elements[e], starts, others, coefficients, a * k + b, zero))
                    add_part(blocks, e, a * dim, b * dim, by, line(slope, e * n + m, b, zero), w)
            if len(matrices) > 0:
                for b in range(k):
                    spring = _stiffness(e, a, b, matrices, of, factors)
                    for c in range(dim):
                        blocks[e, a * dim + c, b * dim + c] += spring


@kernel
def shares(
    first: int,
    last: int,
    x: Any,
    elements: Any,
    starts: Any,
    others: Any,
    coefficients: Any,
    slope: Any,
    second: Any,
    pressure: Any,
    matrices: Any,
    of: Any,
    factors: Any,
    negative: Any,
    lanes: int,
    share: Any,
    zero: Any,
) -> None:
    """Write the largest share of pressure and `negative` for which each element's tangent is positive semidefinite.

    By bisection: the tangent is semidefinite if its Cholesky factorisation exists, without the rows of the first node,
    as the energy does not depend on translations. Without the share it must be semidefinite. `negative` is added to the
    second derivatives `second`. `lanes` is LANES; shapes: negative as second, share (n_elements,), others as in `rows`.
    """
    dim, k = len(zero), slope.shape[1]
    n = (k - 1) * dim
    size = n * (n + 1) // 2
    block = np.empty((2, k * dim, k * dim))
    base, added, factor = np.empty((size, LANES)), np.empty((size, LANES)), np.empty((size, LANES))
    column, inverse = np.empty((n, LANES)), np.empty(LANES)
    low, high, tried, positive = np.empty(LANES), np.empty(LANES), np.empty(LANES), np.empty(LANES)
    for begin in range(first, last, LANES):
        for lane in range(lanes):
            low[lane], high[lane] = 0.0, 2.0
            e = unsigned(min(begin + lane, last - 1))
            table = (starts, others, coefficients)
            _parts(e, x, elements, table, slope, second, negative, pressure, matrices, of, factors, block, zero)
            p = 0
            for i in range(dim, n + dim):
                for j in range(dim, i + 1):
                    base[p, lane], added[p, lane] = (1 + _ROUNDING) * block[0, i, j], block[1, i, j]
                    p += 1
        for _ in range(_HALVINGS + 1):
            for lane in range(lanes):
                tried[lane], positive[lane] = (low[lane] + high[lane]) / 2, 1.0
            for p in range(size):
                for lane in range(lanes):
                    factor[p, lane] = base[p, lane] + tried[lane] * added[p, lane]
            for j in range(n):
                diagonal = unsigned(j * (j + 1) // 2 + j)
                for lane in range(lanes):
                    pivot = factor[diagonal, lane]
                    positive[lane] = positive[lane] if pivot > 0 else 0.0
                    inverse[lane] = 1 / pivot if pivot > 0 else 0.0
                for i in range(j + 1, n):
                    for lane in range(lanes):
                        column[unsigned(i), lane] = factor[unsigned(i * (i + 1) // 2 + j), lane] * inverse[lane]
                for i in range(j + 1, n):
                    own = i * (i + 1) // 2
                    for m in range(j + 1, i + 1):
                        for lane in range(lanes):
                            factor[unsigned(own + m), lane] -= (
                                factor[unsigned(own + j), lane] * column[unsigned(m), lane]
                            )
            for lane in range(lanes):
                low[lane] = tried[lane] if positive[lane] > 0 else low[lane]
                high[lane] = high[lane] if positive[lane] > 0 else tried[lane]
            if low.min() >= 1:
                break
        for lane in range(min(lanes, last - begin)):
            share[begin + lane] = min(low[lane], 1.0)


@kernel
def _parts(
    e: int,
    x: Any,
    elements: Any,
    table: Any,
    slope: Any,
    second: Any,
    negative: Any,
    pressure: Any,
    matrices: Any,
    of: Any,
    factors: Any,
    block: Any,
    zero: Any,
) -> None:
    """Write the lower triangle of an element's tangent without pressure and `negative`, and that of these.

    `table` is that of `turn`. `block` has shape (2, k * dim, k * dim); the rows of the first node are not written.
    """
    dim, k, n = unsigned(len(zero)), unsigned(slope.shape[1]), unsigned(second.shape[1])
    starts, others, coefficients = table
    block[:] = 0.0
    for a in range(ONE, k):
        for b in range(ONE, a + ONE):
            w = scaled(pressure[e], turn(x, elements[e], starts, others, coefficients, a * k + b, zero))
            add_part(block, ONE, a * dim, b * dim, zero, zero, w)
            for m in range(n):
                to = line(slope, e * n + m, b, zero)
                add_part(block, ZERO, a * dim, b * dim, _weighed(e, a, m, slope, second, zero), to, _SPACE)
                add_part(block, ONE, a * dim, b * dim, _weighed(e, a, m, slope, negative, zero), to, _SPACE)
            spring = _stiffness(e, a, b, matrices, of, factors)
            for c in range(dim):
                block[ZERO, a * dim + c, b * dim + c] += spring
