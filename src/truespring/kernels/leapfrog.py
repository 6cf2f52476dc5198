"""Many steps of leapfrog at once for springs of zero rest length and constant stiffness, with a pressure in elements.

One thread, and the same order of all sums in each run. Positions, velocities and forces have shape (dim, n_nodes), so
that loops over nodes use vector registers.

A `body` is (columns, straight, which, constants, springs, cells): hexahedra as in `kernels.columns`; springs of the
other elements as starts (n_nodes + 1,), columns and weights (n_blocks,), see `gaussian.pulls`; and the other elements
of all kinds: node numbers (n,) and the first of each element among them (n_elements + 1,), its kind (n_elements,), for
each kind the number of simplices (n_kinds,), the simplices (n_kinds, n_simplices, dim + 1) and their weight (n_kinds,),
and undeformed volumes, across, offset and slope of the pressure (n_elements,), see `kernels.pressures`. `zero` is a
tuple of dim zeros.
"""

import math
from typing import Any

import numpy as np
from numba.extending import overload

from truespring.kernels import columns
from truespring.kernels.pressures import density, pressure
from truespring.kernels.small import minus, plus, scaled, unsigned
from truespring.kernels.threads import kernel
from truespring.kernels.volumes import slopes

# Most nodes of an element.
_MOST = 32


def _at(x, i, zero):
    """Return column i of an array of shape (len(zero), n)."""


@overload(_at)
def _at_column(x, i, zero):
    return {
        2: lambda x, i, zero: (x[0, unsigned(i)], x[1, unsigned(i)]),
        3: lambda x, i, zero: (x[0, unsigned(i)], x[1, unsigned(i)], x[2, unsigned(i)]),
    }[len(zero)]


@kernel
def _subtract_springs(x: Any, starts: Any, others: Any, weights: Any, force: Any, zero: Any) -> None:
    """Subtract the forces of springs, the sum of w (x_i - x_j), from those on the nodes."""
    for i in range(x.shape[1]):
        if starts[i + 1] > starts[i]:
            here, total = _at(x, i, zero), zero
            for p in range(starts[i], starts[i + 1]):
                d = minus(here, _at(x, others[unsigned(p)], zero))
                total = plus(total, scaled(weights[unsigned(p)], d))
            for c in range(len(zero)):
                force[c, i] -= total[c]


@kernel
def _measure(x: Any, e: int, cells: Any, at: Any, slope: Any, zero: Any) -> float:
    """Write the derivatives of an element's volume, shape (k, 3), return the volume; `at` is a work array (k, 3)."""
    numbers, starts, kinds, counts, simplices, weights = cells[:6]
    first, k, kind, total = starts[e], starts[e + 1] - starts[e], kinds[e], 0.0
    for a in range(k):
        for c in range(len(zero)):
            at[a, c] = x[c, unsigned(numbers[first + a])]
    slopes(at, np.arange(k), simplices[kind, : counts[kind]], weights[kind], slope, zero)
    for a in range(k):
        for c in range(len(zero)):
            total += slope[a, c] * (at[a, c] - at[0, c])
    return total / len(zero)


@kernel
def _subtract_pressures(x: Any, cells: Any, force: Any, zero: Any) -> None:
    """Subtract the forces of the pressure in elements from those on their nodes."""
    numbers, starts = cells[:2]
    undeformed, across, offset, by_log = cells[6:]
    at, slope = np.zeros((_MOST, 3)), np.empty((_MOST, 3))
    for e in range(len(undeformed)):
        volume = _measure(x, e, cells, at, slope, zero)
        p = pressure(volume / undeformed[e], across[e], offset[e], by_log[e])
        for a in range(starts[e + 1] - starts[e]):
            for c in range(len(zero)):
                force[c, unsigned(numbers[starts[e] + a])] -= p * slope[a, c]


@kernel
def _subtract_forces(x: Any, body: Any, force: Any, zero: Any) -> None:
    """Subtract the internal force of a body from the forces on its nodes [N], shape (dim, n_nodes)."""
    lattice, straight, which, constants, springs, cells = body
    columns.subtract_forces(x, lattice, straight, which, constants, force)
    if len(springs[1]) > 0:
        _subtract_springs(x, springs[0], springs[1], springs[2], force, zero)
    _subtract_pressures(x, cells, force, zero)


@kernel
def energy(x: Any, body: Any, zero: Any) -> Any:
    """Return the energy of a body, but for a constant [J]; finite in inverted elements, too, see `pressure`."""
    lattice, straight, which, constants, springs, cells = body
    total = columns.energy(x, lattice, straight, which, constants)
    for i in range(len(springs[0]) - 1):
        for p in range(springs[0][i], springs[0][i + 1]):
            for c in range(len(zero)):
                away = x[c, i] - x[c, unsigned(springs[1][p])]
                total += springs[2][p] / 4 * away * away
    undeformed, across, offset, by_log = cells[6:]
    at, slope = np.zeros((_MOST, 3)), np.empty((_MOST, 3))
    for e in range(len(undeformed)):
        ratio = _measure(x, e, cells, at, slope, zero) / undeformed[e]
        total += undeformed[e] * density(ratio, across[e], offset[e], by_log[e])
    return total


@kernel
def _pull(x: Any, grips: Any, share: float, force: Any, held: Any) -> None:
    """Add the forces of springs from nodes to places that move, and write the sum for each grasp to `held`."""
    nodes, of, stiffness, rest, begin, end = grips
    held[:] = 0.0
    for q in range(len(nodes)):
        i, g = nodes[q], of[q]
        for c in range(len(x)):
            motion = begin[g, c] + share * (end[g, c] - begin[g, c])
            own = stiffness[q] * (x[c, i] - rest[q, c] - motion)
            force[c, i] -= own
            held[g, c] += own


@kernel
def _push(x: Any, balls: Any, share: float, force: Any, held: Any) -> None:
    """Add the forces of spheres on nodes of the surface, and write minus their sum for each sphere to `held`."""
    nodes, areas, radius, stiffness, begin, end = balls
    held[:] = 0.0
    dim = len(x)
    arm, centre = np.empty(dim), np.empty(dim)
    for b in range(len(radius)):
        for c in range(dim):
            centre[c] = begin[b, c] + share * (end[b, c] - begin[b, c])
        for q in range(len(nodes)):
            i = nodes[q]
            square = 0.0
            for c in range(dim):
                arm[c] = x[c, i] - centre[c]
                square += arm[c] * arm[c]
            if square < radius[b] ** 2 and square > 0.0:
                length = math.sqrt(square)
                size = stiffness[b] * areas[q] * (radius[b] - length) / length
                for c in range(dim):
                    force[c, i] += size * arm[c]
                    held[b, c] -= size * arm[c]


@kernel
def _work(n: int, ends: Any, before: Any, after: Any) -> float:
    """Return the work of grasps or spheres in a step of n from the forces on them before and after it [J]."""
    total = 0.0
    for g in range(len(before)):
        for c in range(before.shape[1]):
            total -= (before[g, c] + after[g, c]) / 2 * (ends[1][g, c] - ends[0][g, c]) / n
    return total


@kernel
def _advance(h: float, ended: float, alpha: float, x: Any, v: Any, force: Any, inverse: Any, external: Any) -> None:
    """End a step, by `ended` times half a kick, and begin the next one; the force becomes the loads.

    Arguments as in `steps`.
    """
    kick, braked, kept = h / 2, 1 / (1 + ended * h / 2 * alpha), 1 - h / 2 * alpha
    for c in range(len(x)):
        for i in range(x.shape[1]):
            change = kick * force[c, i] * inverse[c, i]
            half = kept * ((v[c, i] + ended * change) * braked) + change
            x[c, i] += h * half
            v[c, i] = half
            force[c, i] = external[c, i]


@kernel
def _dissipated(v: Any, inverse: Any) -> float:
    """Return the sum of mass times squared velocity over the free directions [J]."""
    total = 0.0
    for c in range(len(v)):
        for i in range(v.shape[1]):
            total += v[c, i] * v[c, i] / inverse[c, i] if inverse[c, i] > 0 else 0.0
    return total


@kernel
def steps(
    n: int,
    h: float,
    alpha: float,
    x: Any,
    v: Any,
    force: Any,
    inverse: Any,
    external: Any,
    body: Any,
    grips: Any,
    balls: Any,
    held: Any,
    account: Any,
    zero: Any,
    known: bool,
) -> None:
    """Take n steps of length h [s] of leapfrog with half a kick at both ends, as `motion.Leapfrog` does.

    Grasps and spheres move linearly from their begin before the first step to their end after the last.

    Args:
        alpha: damping by mass [1/s].
        x, v, force: positions [m], velocities [m/s], zero in held directions, and all forces [N]; overwritten.
        inverse: 1 / mass of the nodes [1/kg], 0 in held directions, shape (dim, n_nodes).
        external: dead loads [N], shape (dim, n_nodes).
        body: see above.
        grips: nodes, numbers of their grasp, stiffness, shape (n,), rest (n, dim), motion at begin and end (n_grasps,
            dim).
        balls: nodes of the surface and their areas (n,), radius, stiffness (n_balls,), centre at begin and end
            (n_balls, dim).
        held: forces of the body on grasps (n_grasps, dim), and on spheres (n_balls, dim); overwritten.
        account: work of grasps and spheres on the body [J], and energy dissipated by damping [J]; added to.
        zero: tuple of dim zeros.
        known: whether `force` is that at the begin; else it is computed.
    """
    on_grips, on_balls = held
    begin = force.copy()  # with the grasps of the frame before, where it is known
    if not known:
        begin[:] = external
        _subtract_forces(x, body, begin, zero)
    _pull(x, grips, 0.0, begin, on_grips)
    _push(x, balls, 0.0, begin, on_balls)
    if not known:
        force[:] = begin
    ended = 0.0
    for s in range(n):
        _advance(h, ended, alpha, x, v, force, inverse, external)
        ended = 1.0
        if alpha > 0.0:
            account[1] += alpha * h * _dissipated(v, inverse)
        _subtract_forces(x, body, force, zero)
        share = (s + 1) / n
        before_grips, before_balls = on_grips.copy(), on_balls.copy()
        _pull(x, grips, share, force, on_grips)
        _push(x, balls, share, force, on_balls)
        account[0] += _work(n, grips[4:], before_grips, on_grips) + _work(n, balls[4:], before_balls, on_balls)
    braked = 1 + h / 2 * alpha
    for c in range(len(x)):
        for i in range(x.shape[1]):
            v[c, i] = (v[c, i] + h / 2 * force[c, i] * inverse[c, i]) / braked
