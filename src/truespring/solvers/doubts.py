"""Doubts about a state: reasons why it may not be on the path of the states before it."""

from collections.abc import Callable

from truespring.arrays import Floats
from truespring.linear.gradients import norm
from truespring.solvers.balance import Equilibrium

# A body that moves by more than this multiple of what the previous step suggests may have snapped through.
_SNAP = 5.0


def doubt(
    state: Equilibrium,
    last: Equilibrium,
    previous: Equilibrium | None,
    admissible: Callable[[Floats], bool],
    length: Callable[[Floats], float] = norm,
) -> str:
    """Return why a state found without line search may not be on the path, empty if it is accepted.

    `length` returns the norm of a displacement [m], shape (n_nodes, dim).
    """
    if not state.converged:
        return "did not converge"
    if state.negative_eigenvalues:
        return "led to an unstable state"
    if not admissible(state.positions):
        return "inverted an element"
    return "led to a distant state" if snapped(state, last, previous, length=length) else ""


def snapped(
    state: Equilibrium,
    last: Equilibrium,
    previous: Equilibrium | None,
    most: float = _SNAP,
    length: Callable[[Floats], float] = norm,
) -> bool:
    """Return whether a body moved by more than `most` times what the previous step suggests, with `length` as norm."""
    if previous is None or state.branched:
        return False
    ratio = (state.load_factor - last.load_factor) / (last.load_factor - previous.load_factor)
    expected = ratio * length(last.positions - previous.positions)
    return length(state.positions - last.positions) > most * expected
