"""Loops over elements for their volume and its derivatives: closed forms, and the sum over simplices.

The second derivative of the volume by two nodes a, b maps v to v x w. In space w is linear in the positions: a table
of (a, b, c, coefficient) of an element kind holds its terms; in the plane w is constant, along the normal.

Shapes: x (n_nodes, dim), elements (n_elements, k), slope (n_elements * n, k, dim), whose rows e n + n - 1 are the
derivatives of the volume of element e, volume (n_elements,).
"""

from typing import Any

import numpy as np
from numba.extending import overload

from truespring.kernels.small import row, unsigned
from truespring.kernels.threads import kernel
from truespring.kernels.volumes import slopes

#: Number of hexahedra that are computed at a time, the lanes of vector registers.
LANES = 16
# First rows of the work array of `hexahedra`: modes, derivatives by the modes, volume; after 24 rows of coordinates.
_MODES, _BY_MODES, _VOLUME = 24, 42, 60


@kernel
def hexahedra(first: int, last: int, x: Any, elements: Any, lanes: int, n: int, slope: Any, volume: Any) -> None:
    """Write volume and slopes of trilinear hexahedra, with nodes in VTK's order. `lanes` is LANES.

    With the sums over the corners a_1 of x times the sign of xi, h_1 of x times the sign of eta zeta, and so on, the
    integral of the Jacobian is V = (det(a_1, a_2, a_3) + (det(a_1, h_3, h_2) + det(h_3, a_2, h_1) + det(h_2, h_1,
    a_3)) / 3) / 64; products of other modes have the mean zero. Its derivatives are those of Flanagan and Belytschko,
    Int. J. Numer. Meth. Eng. 17 (1981).
    """
    work = np.empty((_VOLUME + 1, LANES))
    for begin in range(first, last, LANES):
        count = min(LANES, last - begin)
        for lane in range(count):
            e = unsigned(begin + lane)
            for a in range(8):
                node = unsigned(elements[e, a])
                work[a, lane], work[8 + a, lane], work[16 + a, lane] = x[node, 0], x[node, 1], x[node, 2]
        for d in range(3):
            o, m = 8 * d, _MODES + 6 * d
            for lane in range(lanes):
                x0, x1, x2, x3 = work[o, lane], work[o + 1, lane], work[o + 2, lane], work[o + 3, lane]
                x4, x5, x6, x7 = work[o + 4, lane], work[o + 5, lane], work[o + 6, lane], work[o + 7, lane]
                low, right, high, left = x0 + x4, x1 + x5, x2 + x6, x3 + x7
                up_low, up_right, up_high, up_left = x4 - x0, x5 - x1, x6 - x2, x7 - x3
                work[m, lane] = (right - low) + (high - left)
                work[m + 1, lane] = (left + high) - (low + right)
                work[m + 2, lane] = (up_low + up_right) + (up_left + up_high)
                work[m + 3, lane] = (up_left + up_high) - (up_low + up_right)
                work[m + 4, lane] = (up_right - up_low) + (up_high - up_left)
                work[m + 5, lane] = (high - left) - (right - low)
        for d in range(3):
            i, j, g = _MODES + 6 * ((d + 1) % 3), _MODES + 6 * ((d + 2) % 3), _BY_MODES + 6 * d
            for lane in range(lanes):
                a1, a2, a3 = work[i, lane], work[i + 1, lane], work[i + 2, lane]
                h1, h2, h3 = work[i + 3, lane], work[i + 4, lane], work[i + 5, lane]
                b1, b2, b3 = work[j, lane], work[j + 1, lane], work[j + 2, lane]
                k1, k2, k3 = work[j + 3, lane], work[j + 4, lane], work[j + 5, lane]
                work[g, lane] = (a2 * b3 - a3 * b2 + (h3 * k2 - h2 * k3) / 3.0) / 64.0
                work[g + 1, lane] = (a3 * b1 - a1 * b3 + (h1 * k3 - h3 * k1) / 3.0) / 64.0
                work[g + 2, lane] = (a1 * b2 - a2 * b1 + (h2 * k1 - h1 * k2) / 3.0) / 64.0
                work[g + 3, lane] = (h3 * b2 - a2 * k3 + a3 * k2 - h2 * b3) / 192.0
                work[g + 4, lane] = (a1 * k3 - h3 * b1 + h1 * b3 - a3 * k1) / 192.0
                work[g + 5, lane] = (h2 * b1 - a1 * k2 + a2 * k1 - h1 * b2) / 192.0
        for lane in range(lanes):
            total = 0.0
            for q in range(18):
                total += work[_MODES + q, lane] * work[_BY_MODES + q, lane]
            work[_VOLUME, lane] = total / 3.0
        for d in range(3):
            o, g = 8 * d, _BY_MODES + 6 * d
            for lane in range(lanes):
                a1, a2, a3 = work[g, lane], work[g + 1, lane], work[g + 2, lane]
                h1, h2, h3 = work[g + 3, lane], work[g + 4, lane], work[g + 5, lane]
                low, right, high, left = h3 - a1 - a2, a1 - a2 - h3, a1 + a2 + h3, a2 - a1 - h3
                up_low, up_right, up_high, up_left = a3 - h1 - h2, a3 - h1 + h2, a3 + h1 + h2, a3 + h1 - h2
                work[o, lane], work[o + 4, lane] = low - up_low, low + up_low
                work[o + 1, lane], work[o + 5, lane] = right - up_right, right + up_right
                work[o + 2, lane], work[o + 6, lane] = high - up_high, high + up_high
                work[o + 3, lane], work[o + 7, lane] = left - up_left, left + up_left
        for lane in range(count):
            volume[unsigned(begin + lane)] = work[_VOLUME, lane]
            own = unsigned((begin + lane) * n + n - 1)
            for a in range(8):
                slope[own, a, 0], slope[own, a, 1], slope[own, a, 2] = (
                    work[a, lane],
                    work[8 + a, lane],
                    work[16 + a, lane],
                )


@kernel
def quadrilaterals(
    first: int, last: int, x: Any, elements: Any, thickness: float, n: int, slope: Any, volume: Any
) -> None:
    """Write area times thickness, and slopes, of quadrilaterals: half the cross product of the diagonals."""
    half = thickness / 2
    for e in range(unsigned(first), unsigned(last)):
        a, b, c, d = elements[e, 0], elements[e, 1], elements[e, 2], elements[e, 3]
        px, py = half * (x[c, 0] - x[a, 0]), half * (x[c, 1] - x[a, 1])
        qx, qy = half * (x[d, 0] - x[b, 0]), half * (x[d, 1] - x[b, 1])
        volume[e] = (px * qy - py * qx) / half
        own = e * unsigned(n) + unsigned(n - 1)
        slope[own, 0, 0], slope[own, 0, 1], slope[own, 2, 0], slope[own, 2, 1] = -qy, qx, qy, -qx
        slope[own, 1, 0], slope[own, 1, 1], slope[own, 3, 0], slope[own, 3, 1] = py, -px, -py, px


@kernel
def of_simplices(
    first: int,
    last: int,
    x: Any,
    elements: Any,
    simplices: Any,
    weight: float,
    zero: Any,
    n: int,
    slope: Any,
    volume: Any,
) -> None:
    """Write volume and slopes of elements that are weighted sums of simplices, shape (n_simplices, dim + 1)."""
    dim, k = len(zero), elements.shape[1]
    own = np.empty((k, 3))
    for e in range(first, last):
        slopes(x, elements[e], simplices, weight, own, zero)
        total = 0.0
        for a in range(k):
            for c in range(dim):
                slope[e * n + n - 1, a, c] = own[a, c]
                total += own[a, c] * (x[elements[e, a], c] - x[elements[e, 0], c])
        volume[e] = total / dim


def turn(x, nodes, starts, others, coefficients, pair, zero):
    """Return w of a pair of nodes, a k + b, shape (3,), from the table of an element kind.

    Shapes: nodes (k,), starts (k * k + 1,), others, coefficients (n_terms,).
    """


@overload(turn)
def _turn(x, nodes, starts, others, coefficients, pair, zero):
    def two(x, nodes, starts, others, coefficients, pair, zero):
        total = 0.0
        for q in range(starts[unsigned(pair)], starts[unsigned(pair + 1)]):
            total += coefficients[unsigned(q)]
        return 0.0, 0.0, total

    def three(x, nodes, starts, others, coefficients, pair, zero):
        u, v, w = 0.0, 0.0, 0.0
        for q in range(starts[unsigned(pair)], starts[unsigned(pair + 1)]):
            at = row(x, nodes[unsigned(others[unsigned(q)])], zero)
            coefficient = coefficients[unsigned(q)]
            u, v, w = u + coefficient * at[0], v + coefficient * at[1], w + coefficient * at[2]
        return u, v, w

    return {2: two, 3: three}[len(zero)]
