"""Forces and energies of hexahedra whose springs have one stiffness for each mode, many elements at a time.

Elements that share faces in a row are computed side by side, in the lanes of vector registers: an element is between
two columns of four nodes, and the sums over a column serve both of its elements. A batch of WIDTH columns stays in the
first cache, and no derivative is written to memory. Where a row ends, there is no element between its last column and
the first of the next row: the stiffness there is zero.

With the sums over the corners a_1 of x times the sign of xi, h_1 of x times the sign of eta zeta, g of x times all
three signs, and so on, the volume is that of `measures.hexahedra`, and the energy of the springs is half the sum of the
squares of the modes times their stiffness.

Shapes: x, force (3, n_nodes); columns (n_batches, 4, WIDTH), the nodes around xi; straight (n_batches, 4, WIDTH //
GROUP), whether GROUP nodes have consecutive numbers; which (n_batches,), the constants of a batch; constants (n,
CONSTANTS, WIDTH): stiffness of a_1, a_2, a_3, h_1, h_2, h_3, g [N/m], the inverse of the undeformed volume [1/m^3], 1
for an element and 0 for none, and the offset and slope of the pressure [Pa]; work (_ROWS, WIDTH + 2 _PAD).
"""

from typing import Any

import numba
import numpy as np

from truespring.kernels.pressures import density, pressure
from truespring.kernels.small import unsigned
from truespring.kernels.threads import FASTMATH, kernel

#: Number of columns of a batch.
WIDTH = 32
#: Number of nodes that are read or written at once if their numbers are consecutive.
GROUP = 8
#: Rows of `constants`.
CONSTANTS = 11
# First rows of the work array: positions and forces of nodes, 4 rows for each direction; sums over columns, 4 each;
# modes, 7 each; derivatives, 6 each; change of volume and pressure; derivatives by the modes, 7 each.
_NODES, _SUMS, _MODES, _BY, _CHANGE, _PRESSURE, _FORCES, _ROWS = 0, 12, 24, 45, 63, 64, 65, 86
# Lanes before those of `_FORCES`, zeros, and after the others.
_PAD = 8
# Changes of volume between which ln J is summed as a series.
_LOW, _HIGH = -0.4, 0.66

# Part of a kernel: always inlined, so that loops know that rows of the work array differ; divisions are not checked,
# which would keep loops out of vector registers.
_part = numba.njit(nogil=True, cache=True, fastmath=FASTMATH, error_model="numpy", forceinline=True)


@_part
def _gather(x: Any, columns: Any, straight: Any, batch: int, d: int, work: Any) -> None:
    """Write the positions of the nodes of columns in a direction."""
    b = unsigned(batch)
    for c in range(4):
        for k in range(WIDTH // GROUP):
            o, first = GROUP * k, unsigned(columns[b, c, GROUP * k])
            if straight[b, c, k]:
                for i in range(GROUP):
                    work[_NODES + 4 * d + c, o + i] = x[d, first + unsigned(i)]
            else:
                for i in range(GROUP):
                    work[_NODES + 4 * d + c, o + i] = x[d, unsigned(columns[b, c, o + i])]


@_part
def _sum_columns(d: int, work: Any) -> None:
    """Write the sums over columns in a direction, without signs and with those of eta, zeta and eta zeta."""
    n, o = _NODES + 4 * d, _SUMS + 4 * d
    for j in range(WIDTH):
        x0, x1, x2, x3 = work[n, j], work[n + 1, j], work[n + 2, j], work[n + 3, j]
        right, left, up_right, up_left = x1 + x2, x0 + x3, x2 - x1, x3 - x0
        work[o, j] = right + left
        work[o + 1, j] = right - left
        work[o + 2, j] = up_right + up_left
        work[o + 3, j] = up_right - up_left


@_part
def _find_modes(d: int, work: Any) -> None:
    """Write the modes of elements in a direction from the sums over their columns."""
    o, m = _SUMS + 4 * d, _MODES + 7 * d
    for j in range(WIDTH):
        work[m, j] = work[o, j + 1] - work[o, j]
        work[m + 1, j] = work[o + 1, j + 1] + work[o + 1, j]
        work[m + 2, j] = work[o + 2, j + 1] + work[o + 2, j]
        work[m + 3, j] = work[o + 3, j + 1] + work[o + 3, j]
        work[m + 4, j] = work[o + 2, j + 1] - work[o + 2, j]
        work[m + 5, j] = work[o + 1, j + 1] - work[o + 1, j]
        work[m + 6, j] = work[o + 3, j + 1] - work[o + 3, j]


@_part
def _differentiate(d: int, work: Any) -> None:
    """Write the derivatives of 64 V by the modes of a direction, those by h times 3."""
    i, k, g = _MODES + 7 * ((d + 1) % 3), _MODES + 7 * ((d + 2) % 3), _BY + 6 * d
    third = 1.0 / 3.0
    for j in range(WIDTH):
        a1, a2, a3 = work[i, j], work[i + 1, j], work[i + 2, j]
        h1, h2, h3 = work[i + 3, j], work[i + 4, j], work[i + 5, j]
        b1, b2, b3 = work[k, j], work[k + 1, j], work[k + 2, j]
        k1, k2, k3 = work[k + 3, j], work[k + 4, j], work[k + 5, j]
        work[g, j] = a2 * b3 - a3 * b2 + (h3 * k2 - h2 * k3) * third
        work[g + 1, j] = a3 * b1 - a1 * b3 + (h1 * k3 - h3 * k1) * third
        work[g + 2, j] = a1 * b2 - a2 * b1 + (h2 * k1 - h1 * k2) * third
        work[g + 3, j] = h3 * b2 - a2 * k3 + a3 * k2 - h2 * b3
        work[g + 4, j] = a1 * k3 - h3 * b1 + h1 * b3 - a3 * k1
        work[g + 5, j] = h2 * b1 - a1 * k2 + a2 * k1 - h1 * b2


@_part
def _find_changes(constants: Any, batch: int, work: Any) -> int:
    """Write J - 1 of each element; return how many are outside of the range of the series."""
    b, outside = unsigned(batch), 0
    third = 1.0 / 3.0
    for j in range(WIDTH):
        volume = work[_MODES, j] * work[_BY, j]
        volume += work[_MODES + 1, j] * work[_BY + 1, j] + work[_MODES + 2, j] * work[_BY + 2, j]
        rest = work[_MODES + 3, j] * work[_BY + 3, j]
        rest += work[_MODES + 4, j] * work[_BY + 4, j] + work[_MODES + 5, j] * work[_BY + 5, j]
        change = (volume + third * rest) * (constants[b, 7, j] / 64.0) - constants[b, 8, j]
        work[_CHANGE, j] = change
        outside += 0 if _LOW < change < _HIGH else 1
    return outside


@_part
def _find_pressures(constants: Any, batch: int, outside: int, work: Any) -> None:
    """Write the pressures over 64; ln J is 2 (z + z^3 / 3 + ...), z = (J - 1) / (J + 1), where all J allow it."""
    b = unsigned(batch)
    if outside > 0:
        for j in range(WIDTH):
            ratio = 1.0 + work[_CHANGE, j]
            work[_PRESSURE, j] = pressure(ratio, 0.0, constants[b, 9, j], constants[b, 10, j]) / 64.0
        return
    for j in range(WIDTH):
        change = work[_CHANGE, j]
        z = change / (2.0 + change)
        s = z * z
        series = 1.0 / 27.0
        series = series * s + 1.0 / 25.0
        series = series * s + 1.0 / 23.0
        series = series * s + 1.0 / 21.0
        series = series * s + 1.0 / 19.0
        series = series * s + 1.0 / 17.0
        series = series * s + 1.0 / 15.0
        series = series * s + 1.0 / 13.0
        series = series * s + 1.0 / 11.0
        series = series * s + 1.0 / 9.0
        series = series * s + 1.0 / 7.0
        series = series * s + 1.0 / 5.0
        series = series * s + 1.0 / 3.0
        series = series * s + 1.0
        y = 2.0 * z * series
        work[_PRESSURE, j] = (constants[b, 9, j] + constants[b, 10, j] * y) / (64.0 + 64.0 * change)


@_part
def _find_forces(constants: Any, batch: int, d: int, work: Any) -> None:
    """Write the derivatives of the energy by the modes of a direction, _PAD lanes to the right."""
    b, m, g, f = unsigned(batch), _MODES + 7 * d, _BY + 6 * d, _FORCES + 7 * d
    third = 1.0 / 3.0
    for j in range(WIDTH):
        p = work[_PRESSURE, j]
        q = p * third
        work[f, j + _PAD] = constants[b, 0, j] * work[m, j] + p * work[g, j]
        work[f + 1, j + _PAD] = constants[b, 1, j] * work[m + 1, j] + p * work[g + 1, j]
        work[f + 2, j + _PAD] = constants[b, 2, j] * work[m + 2, j] + p * work[g + 2, j]
        work[f + 3, j + _PAD] = constants[b, 3, j] * work[m + 3, j] + q * work[g + 3, j]
        work[f + 4, j + _PAD] = constants[b, 4, j] * work[m + 4, j] + q * work[g + 4, j]
        work[f + 5, j + _PAD] = constants[b, 5, j] * work[m + 5, j] + q * work[g + 5, j]
        work[f + 6, j + _PAD] = constants[b, 6, j] * work[m + 6, j]


@_part
def _sum_forces(d: int, work: Any) -> None:
    """Write the forces in a direction on the nodes of columns."""
    f, n, here, left = _FORCES + 7 * d, _NODES + 4 * d, _PAD, _PAD - 1
    for j in range(WIDTH):
        s = work[f, j + left] - work[f, j + here]
        y = (work[f + 1, j + left] + work[f + 5, j + left]) + (work[f + 1, j + here] - work[f + 5, j + here])
        z = (work[f + 2, j + left] + work[f + 4, j + left]) + (work[f + 2, j + here] - work[f + 4, j + here])
        yz = (work[f + 3, j + left] + work[f + 6, j + left]) + (work[f + 3, j + here] - work[f + 6, j + here])
        right, low, up, down = s + y, s - y, z + yz, z - yz
        work[n, j] = low - down
        work[n + 1, j] = right - up
        work[n + 2, j] = right + up
        work[n + 3, j] = low + down


@_part
def _scatter(columns: Any, straight: Any, batch: int, d: int, work: Any, force: Any) -> None:
    """Subtract the forces on the nodes of columns in a direction."""
    b = unsigned(batch)
    for c in range(4):
        for k in range(WIDTH // GROUP):
            o, first = GROUP * k, unsigned(columns[b, c, GROUP * k])
            if straight[b, c, k]:
                for i in range(GROUP):
                    force[d, first + unsigned(i)] -= work[_NODES + 4 * d + c, o + i]
            else:
                for i in range(GROUP):
                    force[d, unsigned(columns[b, c, o + i])] -= work[_NODES + 4 * d + c, o + i]


@_part
def _measure(x: Any, columns: Any, straight: Any, which: Any, constants: Any, batch: int, work: Any) -> int:
    """Write modes, derivatives and changes of volume of a batch; return the value of `_find_changes`."""
    for d in range(3):
        _gather(x, columns, straight, batch, d, work)
    _sum_columns(0, work)
    _sum_columns(1, work)
    _sum_columns(2, work)
    _find_modes(0, work)
    _find_modes(1, work)
    _find_modes(2, work)
    _differentiate(0, work)
    _differentiate(1, work)
    _differentiate(2, work)
    return _find_changes(constants, which[batch], work)


@kernel
def subtract_forces(x: Any, columns: Any, straight: Any, which: Any, constants: Any, force: Any) -> None:
    """Subtract the internal forces of hexahedra from the forces on their nodes."""
    work = np.empty((_ROWS, WIDTH + 2 * _PAD))
    work[:] = 0.0
    for batch in range(len(columns)):
        outside, own = _measure(x, columns, straight, which, constants, batch, work), which[batch]
        _find_pressures(constants, own, outside, work)
        _find_forces(constants, own, 0, work)
        _find_forces(constants, own, 1, work)
        _find_forces(constants, own, 2, work)
        _sum_forces(0, work)
        _sum_forces(1, work)
        _sum_forces(2, work)
        for d in range(3):
            _scatter(columns, straight, batch, d, work, force)


@kernel
def energy(x: Any, columns: Any, straight: Any, which: Any, constants: Any) -> float:
    """Return the energy of hexahedra, but for a constant [J]."""
    work = np.empty((_ROWS, WIDTH + 2 * _PAD))
    work[:] = 0.0
    total = 0.0
    for batch in range(len(columns)):
        _measure(x, columns, straight, which, constants, batch, work)
        own = which[batch]
        for j in range(WIDTH):
            if constants[own, 8, j] > 0:
                stored = density(1 + work[_CHANGE, j], 0.0, constants[own, 9, j], constants[own, 10, j])
                total += stored / constants[own, 7, j]
            for q in range(7):
                square = 0.0
                for d in range(3):
                    square += work[_MODES + 7 * d + q, j] ** 2
                total += constants[own, q, j] / 2 * square
    return total
