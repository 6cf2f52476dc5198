"""Newton's method with line search on the total energy: robust, but slow.

Under loads without a potential there is no such energy: steps are halved until the residual decreases.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import IndefiniteError, SlowError
from truespring.potential import SparseMatrix
from truespring.solvers.balance import Balance, Found, Watch, stepped
from truespring.solvers.residual_search import reduced

# Relative differences of energy below this are rounding errors; see `_search`.
_ENERGY_ROUNDING = 1e-9
# Armijo's constant, and the bounds of a cut in backtracking (Nocedal and Wright, 3.1 and 3.5).
_ARMIJO, _SHORTEST_CUT, _LONGEST_CUT = 1e-4, 0.1, 0.5
_MIN_STEP, _LONGEST_STEP = 1e-9, 1024.0


class Step(NamedTuple):
    """A search direction.

    Attributes:
        direction: [m], shape (n_nodes, dim).
        slope: derivative of the total energy along it [J].
        newton: whether it is the Newton step of the tangent itself.
    """

    direction: Floats
    slope: float
    newton: bool


def descend(balance: Balance, load_factor: float, positions: Floats, undamped_iterations: int | None = None) -> Found:
    """Return the equilibrium found from `positions`, else the state of least residual.

    `positions` [m] has shape (n_nodes, dim). With `undamped_iterations`, at most so many full Newton steps replace the
    line search.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of iterates that diverge
        return _descend(balance, load_factor, positions, undamped_iterations)


def _descend(balance: Balance, load_factor: float, positions: Floats, undamped_iterations: int | None) -> Found:
    """Iterate as `descend` does, with floating point warnings."""
    watch = Watch(balance, load_factor, positions)
    for iteration in range((undamped_iterations or balance.max_iterations) + 1):
        if not watch.at(positions, iteration):
            break
        if watch.within_tolerance:
            return watch.equilibrium()
        tangent = balance.hessian(positions, load_factor)
        if watch.balanced(tangent, positions):
            del tangent  # its memory is used again
            return watch.equilibrium()
        if undamped_iterations or watch.below_rounding:
            moved = _full_step(balance, positions, tangent, watch)
        elif not balance.loading.has_potential(load_factor):
            moved = reduced(balance, load_factor, positions, tangent, watch)
        else:
            step = _step(balance, positions, tangent, watch)
            moved = step and _search(balance, load_factor, positions, step)
        del tangent
        if moved is None:
            break
        positions = moved
    return watch.failure()


def _full_step(balance: Balance, positions: Floats, tangent: SparseMatrix, watch: Watch) -> Floats | None:
    """Return the positions after a full Newton step, None if there is none or its energy is not finite.

    An iterative solver that does not reach its accuracy gives its last iterate.
    """
    try:
        step = balance.ready(tangent, positions).solve(watch.force)
    except (SingularMatrixError, IndefiniteError):
        return None
    except SlowError as slow:
        step = slow.best
    moved = positions - step
    return moved if np.isfinite(balance.total_energy(moved, watch.load_factor)[0]) else None


def _step(balance: Balance, positions: Floats, tangent: SparseMatrix, watch: Watch) -> Step | None:
    """Return a descent direction by the tangent if it is positive definite, else by an approximation that is."""
    if not balance.is_finite(tangent):
        return None
    for candidate in _candidates(balance, positions, tangent, watch.load_factor):
        direction = stepped(balance, candidate, positions, -watch.force, balance.accuracy(watch.residual))
        if direction is None:
            continue
        slope = balance.scalar_product(direction, watch.force)
        if slope < 0:
            return Step(direction, slope, candidate is tangent)
    return None


def _candidates(
    balance: Balance, positions: Floats, tangent: SparseMatrix, load_factor: float
) -> Iterator[SparseMatrix]:
    """Yield the tangent, its projection, then the projection plus a growing share of its diagonal."""
    yield tangent
    projected = balance.projected(positions, load_factor)
    if projected is None:
        projected = tangent
    else:
        yield projected
    diagonal = np.abs(balance.diagonal(projected)).ravel()
    for share in (1e-6, 1e-4, 1e-2, 1.0, 10.0):
        yield balance.in_blocks(projected + sparse.diags_array(share * (diagonal + diagonal.mean())).tocsr())


def _search(balance: Balance, load_factor: float, positions: Floats, step: Step) -> Floats | None:
    """Return the positions after a step that reduces the total energy enough, by backtracking; None if there is none.

    Near equilibrium the decrease is below the rounding error of the energy; there the slope decides (the approximate
    Wolfe condition of Hager and Zhang 2005). A step that is not the Newton step of the tangent is often too short, as
    when a straight column begins to buckle: it is doubled while the energy falls.
    """
    energy, size = balance.total_energy(positions, load_factor)

    def descends(moved: Floats, length: float) -> bool:
        """Return whether a step of this length reduces the energy enough."""
        there, size_there = balance.total_energy(moved, load_factor)
        if not np.isfinite(there) or there <= energy + _ARMIJO * length * step.slope:
            return bool(np.isfinite(there))
        equal = there - energy <= _ENERGY_ROUNDING * max(size, size_there)
        return equal and balance.scalar_product(step.direction, balance.force(moved, load_factor)) <= -step.slope / 2

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
        if not descends(further, 2 * length):
            break
        if balance.scalar_product(step.direction, balance.force(further, load_factor)) > 0:
            break
        moved, length = further, 2 * length
    return moved
