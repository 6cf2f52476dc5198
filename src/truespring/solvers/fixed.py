"""A fixed number of Newton iterations, as real-time programs take them."""

from collections.abc import Iterator

import numpy as np

from truespring.arrays import Floats
from truespring.potential import SparseMatrix
from truespring.solvers.balance import Balance, Equilibrium, Watch, stepped

# Largest number of halvings of a step to a state without finite energy (an inverted element).
_MAX_HALVINGS = 5


def iterated(balance: Balance, load_factor: float, positions: Floats, iterations: int) -> Equilibrium:
    """Return the state after a number of iterations from `positions` [m], shape (n_nodes, dim).

    It is not converged, whatever its residual. An iteration without a solution ends them early.
    """
    with np.errstate(over="ignore", invalid="ignore"):  # of iterates that diverge
        watch = Watch(balance, load_factor, positions)
        for iteration in range(iterations):
            if not watch.at(positions, iteration):
                break
            moved = _moved(balance, load_factor, positions, watch)
            if moved is None:
                break
            positions = moved
        watch.at(positions, iterations)
        return watch.last()


def _moved(balance: Balance, load_factor: float, positions: Floats, watch: Watch) -> Floats | None:
    """Return the positions after an iteration; None if it has no solution, or leads to no finite energy."""
    for matrix in _tangents(balance, load_factor, positions):
        step = stepped(balance, matrix, positions, -watch.force, balance.accuracy(watch.residual))
        if step is None:
            continue
        for _ in range(_MAX_HALVINGS + 1):
            if np.isfinite(balance.total_energy(positions + step, load_factor)[0]):
                return positions + step
            step = step / 2
    return None


def _tangents(balance: Balance, load_factor: float, positions: Floats) -> Iterator[SparseMatrix]:
    """Yield the tangent, and if it is not positive definite, its projection."""
    yield balance.hessian(positions, load_factor)
    projected = balance.projected(positions, load_factor)
    if projected is not None:
        yield projected
