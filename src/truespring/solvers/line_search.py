"""Newton's method with line search on the total energy: slow and sure."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import IndefiniteError
from truespring.potential import Projectable, SparseMatrix
from truespring.solvers.balance import Balance, Found, Watch, stepped

# Energies that differ by less than this share cannot be told apart; see `_search`.
_DROWNED = 1e-9
# Armijo's constant, and how far one backtracking step may cut (Nocedal and Wright, 3.1 and 3.5).
_ARMIJO, _SHORTEST_CUT, _LONGEST_CUT = 1e-4, 0.1, 0.5
_MIN_STEP, _LONGEST_STEP = 1e-9, 1024.0


class Step(NamedTuple):
    """A direction [m], the slope of the total energy along it [J], and whether it is Newton's own."""

    direction: Floats
    slope: float
    newton: bool


def descend(balance: Balance, load_factor: float, positions: Floats, undamped_iterations: int | None = None) -> Found:
    """Find the balance from `positions`; where that fails, return the state with the least residual.

    With `undamped_iterations` Newton's full steps are taken, so many of them, wherever they lead.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of iterates that run away
        return _descend(balance, load_factor, positions, undamped_iterations)


def _descend(balance: Balance, load_factor: float, positions: Floats, undamped_iterations: int | None) -> Found:
    watch = Watch(balance, load_factor, positions)
    for iteration in range((undamped_iterations or balance.max_iterations) + 1):
        if not watch.at(positions, iteration):
            break
        tangent = balance.hessian(positions, load_factor)
        if watch.balanced(tangent, positions):
            del tangent  # the next one takes its room
            return watch.equilibrium()
        if undamped_iterations or watch.drowned:
            moved = _leap(balance, positions, tangent, watch.force)
        else:
            step = _step(balance, positions, tangent, watch.force, watch.residual)
            moved = step and _search(balance, load_factor, positions, step)
        del tangent
        if moved is None:
            break
        positions = moved
    return watch.failure()


def _leap(balance: Balance, positions: Floats, tangent: SparseMatrix, force: Floats) -> Floats | None:
    """Return where Newton's full step leads, None where there is no energy."""
    try:
        moved = positions - balance.ready(tangent, positions).solve(force)
    except (SingularMatrixError, IndefiniteError):
        return None
    return moved if np.isfinite(balance.total_energy(moved, 0.0)[0]) else None


def _step(balance: Balance, positions: Floats, tangent: SparseMatrix, force: Floats, residual: float) -> Step | None:
    """Return a direction of descent: Newton's where the tangent is positive, else that of a positive neighbour."""
    if not np.isfinite(tangent.data).all():
        return None
    for candidate in _positive_neighbours(balance, positions, tangent):
        direction = stepped(balance, candidate, positions, -force, balance.accuracy(residual))
        if direction is None:
            continue
        slope = float((direction * force).sum())
        if slope < 0:
            return Step(direction, slope, candidate is tangent)
    return None


def _positive_neighbours(balance: Balance, positions: Floats, tangent: SparseMatrix) -> Iterator[SparseMatrix]:
    """Yield the tangent, its projection, then the projection with a growing share of its diagonal added."""
    yield tangent
    projected = tangent
    if isinstance(balance.potential, Projectable):
        projected = balance.in_blocks(balance.potential.projected_hessian(positions))
        yield projected
    diagonal = np.abs(projected.diagonal())
    for share in (1e-6, 1e-4, 1e-2, 1.0, 10.0):
        yield balance.in_blocks(projected + sparse.diags_array(share * (diagonal + diagonal.mean())).tocsr())


def _search(balance: Balance, load_factor: float, positions: Floats, step: Step) -> Floats | None:
    """Backtrack along a step until the total energy falls enough; None where it never does.

    Near equilibrium the fall drowns in the rounding of the energy; there the slope decides
    (the approximate Wolfe condition of Hager and Zhang 2005). A step that is not Newton's own
    is often too short, as when a straight column begins to buckle: it is doubled while it descends.
    """
    energy, size = balance.total_energy(positions, load_factor)

    def descends(moved: Floats, length: float) -> bool:
        there, size_there = balance.total_energy(moved, load_factor)
        if not np.isfinite(there) or there <= energy + _ARMIJO * length * step.slope:
            return bool(np.isfinite(there))
        drowned = there - energy <= _DROWNED * max(size, size_there)
        return bool(drowned and (step.direction * balance.force(moved, load_factor)).sum() <= -step.slope / 2)

    length = 1.0
    while not descends(moved := positions + length * step.direction, length):
        there, _ = balance.total_energy(moved, load_factor)
        curvature = there - energy - step.slope * length
        cut = -step.slope * length / (2 * curvature) if np.isfinite(curvature) and curvature > 0 else _SHORTEST_CUT
        length *= min(max(cut, _SHORTEST_CUT), _LONGEST_CUT)
        if length < _MIN_STEP:
            return None
    while not step.newton and length >= 1 and length < _LONGEST_STEP:
        further = positions + 2 * length * step.direction
        if not descends(further, 2 * length) or (step.direction * balance.force(further, load_factor)).sum() > 0:
            break
        moved, length = further, 2 * length
    return moved
