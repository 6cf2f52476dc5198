"""Many steps of leapfrog at once for springs of zero rest length and constant stiffness, with a pressure in elements.

One thread, and the same order of all sums in each run.
"""

import math
from typing import Any

import numpy as np
from numba.extending import overload

from truespring.kernels import measures
from truespring.kernels.gaussian import add_forces, pulls
from truespring.kernels.threads import kernel

# Volume ratio below which the pressure is continued linearly: that of the law is infinite for collapsed elements.
_SMALLEST = 0.1


def measure(count, x, elements, form, slope, volume):
    """Write volumes and slopes of all elements: `form` is (lanes,), (thickness,) or (simplices, weight, zero)."""


@overload(measure)
def _measure(count, x, elements, form, slope, volume):
    import numba

    def hexahedra(count, x, elements, form, slope, volume):
        measures.hexahedra(0, count, x, elements, form[0], 1, slope, volume)

    def quadrilaterals(count, x, elements, form, slope, volume):
        measures.quadrilaterals(0, count, x, elements, form[0], 1, slope, volume)

    def simplices(count, x, elements, form, slope, volume):
        measures.of_simplices(0, count, x, elements, form[0], form[1], form[2], 1, slope, volume)

    if len(form) == 3:
        return simplices
    return hexahedra if isinstance(form[0], numba.types.Integer) else quadrilaterals


@kernel
def pressures(volume: Any, undeformed: Any, offset: Any, slope: Any, pressure: Any) -> None:
    """Write the derivative of the energy by the volume of each element, (offset + slope ln J) / J; shapes (n,)."""
    bound = math.log(_SMALLEST)
    for e in range(len(volume)):
        ratio = volume[e] / undeformed[e]
        if ratio > _SMALLEST:
            pressure[0, e] = (offset[e] + slope[e] * math.log(ratio)) / ratio
        else:
            there = (offset[e] + slope[e] * bound) / _SMALLEST
            pressure[0, e] = there + (slope[e] / _SMALLEST - there) / _SMALLEST * (ratio - _SMALLEST)


@kernel
def forces(x: Any, springs: Any, cells: Any, form: Any, work: Any, external: Any, force: Any, zero: Any) -> None:
    """Write loads minus internal force of all nodes.

    Arguments as in `steps`.
    """
    elements, at_starts, at, undeformed, offset, slope_by = cells
    slope, volume, pressure = work
    measure(len(elements), x, elements, form, slope, volume)
    pressures(volume, undeformed, offset, slope_by, pressure)
    pulls(0, len(x), x, springs[0], springs[1], springs[2], force, zero)
    add_forces(0, len(x), at_starts, at, slope, pressure, force, zero)
    for i in range(len(x)):
        for c in range(len(zero)):
            force[i, c] = external[i, c] - force[i, c]


@kernel
def pull(x: Any, grips: Any, share: float, force: Any, held: Any) -> None:
    """Add the forces of springs from nodes to places that move, and write the sum for each grasp to `held`."""
    nodes, of, stiffness, rest, begin, end = grips
    held[:] = 0.0
    for q in range(len(nodes)):
        i, g = nodes[q], of[q]
        for c in range(x.shape[1]):
            motion = begin[g, c] + share * (end[g, c] - begin[g, c])
            own = stiffness[q] * (x[i, c] - rest[q, c] - motion)
            force[i, c] -= own
            held[g, c] += own


@kernel
def push(x: Any, balls: Any, share: float, force: Any, held: Any) -> None:
    """Add the forces of spheres on nodes of the surface, and write minus their sum for each sphere to `held`."""
    nodes, areas, radius, stiffness, begin, end = balls
    held[:] = 0.0
    dim = x.shape[1]
    arm, centre = np.empty(dim), np.empty(dim)
    for b in range(len(radius)):
        for c in range(dim):
            centre[c] = begin[b, c] + share * (end[b, c] - begin[b, c])
        for q in range(len(nodes)):
            i = nodes[q]
            square = 0.0
            for c in range(dim):
                arm[c] = x[i, c] - centre[c]
                square += arm[c] * arm[c]
            if square < radius[b] ** 2 and square > 0.0:
                length = math.sqrt(square)
                size = stiffness[b] * areas[q] * (radius[b] - length) / length
                for c in range(dim):
                    force[i, c] += size * arm[c]
                    held[b, c] -= size * arm[c]


@kernel
def steps(
    n: int,
    h: float,
    alpha: float,
    x: Any,
    v: Any,
    force: Any,
    mass: Any,
    free: Any,
    external: Any,
    springs: Any,
    cells: Any,
    form: Any,
    work: Any,
    grips: Any,
    balls: Any,
    held: Any,
    account: Any,
    zero: Any,
) -> None:
    """Take n steps of length h [s] of leapfrog with half a kick at both ends, as `motion.Leapfrog` does.

    Grasps and spheres move linearly from their begin before the first step to their end after the last.

    Args:
        alpha: damping by mass [1/s].
        x, v, force: positions [m], velocities [m/s], and loads minus internal forces [N] with those of grasps and
            spheres; all are overwritten. Shape (n_nodes, dim).
        mass: [kg], shape (n_nodes,).
        free: 1 for free directions, else 0, shape (n_nodes, dim).
        external: dead loads [N], shape (n_nodes, dim).
        springs: starts (n_nodes + 1,), columns, weights (n_blocks,), see `gaussian.pulls`.
        cells: elements (n_elements, k), at_starts, at, see `gaussian.add_forces`; undeformed volumes, and the offset
            and the slope of the pressure over ln J, shape (n_elements,).
        form: see `measure`.
        work: slopes (n_elements, k, dim), volumes (n_elements,), pressures (1, n_elements).
        grips: nodes, numbers of their grasp, stiffness, shape (n,), rest (n, dim), motion at begin and end (n_grasps,
            dim).
        balls: nodes of the surface and their areas (n,), radius, stiffness (n_balls,), centre at begin and end
            (n_balls, dim).
        held: forces of the body on grasps (n_grasps, dim), and on spheres (n_balls, dim); overwritten.
        account: work of grasps and spheres on the body [J], and energy dissipated by damping [J]; added to.
        zero: tuple of dim zeros.
    """
    dim, half_step = len(zero), h / 2
    on_grips, on_balls = held
    before_grips, before_balls = on_grips.copy(), on_balls.copy()
    for s in range(n):
        for i in range(len(x)):
            for c in range(dim):
                half = free[i, c] * (v[i, c] + half_step * (force[i, c] / mass[i] - alpha * v[i, c]))
                x[i, c] += h * half
                v[i, c] = half
        if alpha > 0.0:
            lost = 0.0
            for i in range(len(x)):
                for c in range(dim):
                    lost += mass[i] * v[i, c] * v[i, c]
            account[1] += alpha * h * lost
        forces(x, springs, cells, form, work, external, force, zero)
        share = (s + 1) / n
        before_grips[:] = on_grips
        before_balls[:] = on_balls
        pull(x, grips, share, force, on_grips)
        push(x, balls, share, force, on_balls)
        for g in range(len(on_grips)):
            for c in range(dim):
                moved = (grips[5][g, c] - grips[4][g, c]) / n
                account[0] -= (before_grips[g, c] + on_grips[g, c]) / 2 * moved
        for b in range(len(on_balls)):
            for c in range(dim):
                moved = (balls[5][b, c] - balls[4][b, c]) / n
                account[0] -= (before_balls[b, c] + on_balls[b, c]) / 2 * moved
        braked = 1 + half_step * alpha
        for i in range(len(x)):
            for c in range(dim):
                v[i, c] = free[i, c] * (v[i, c] + half_step * force[i, c] / mass[i]) / braked
