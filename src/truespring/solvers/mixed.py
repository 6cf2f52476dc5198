"""Newton's method with mixed integration points: few iterations, even for large rotations in one step.

The stress of each spring or element is an additional unknown, which is eliminated locally: the geometric part of the
tangent uses the stress extrapolated linearly along the last step, not that of the positions (Magisano, Leonetti,
Garcea, CMAME 313, 2017). The residual is that of the positions. There is no line search: if the iteration does not
converge, the caller uses another method.
"""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.potential import SparseMatrix, Stressed
from truespring.solvers.balance import Balance, Equilibrium, Found, Watch, stepped

# Largest number of iterations: it converges in less than ten, or hardly ever.
_MAX_ITERATIONS = 20
# Largest number of halvings of a step to a state without finite energy (an inverted element).
_MAX_HALVINGS = 5


class Start(NamedTuple):
    """Start of an iteration.

    Attributes:
        positions: [m], shape (n_nodes, dim).
        stress: stress of the potential, see Stressed.stress.
        motion: prescribed motion that the first step adds [m], shape (n_nodes, dim); None if there is none.
    """

    positions: Floats
    stress: Floats
    motion: Floats | None = None


def start_from(balance: Balance, level: float, last: Equilibrium, previous: Equilibrium | None) -> Start | None:
    """Return the start for a load level, extrapolated from one or two previous states; None without a stress."""
    potential, loading = balance.potential, balance.loading
    if not isinstance(potential, Stressed):
        return None
    stress = potential.stress(last.positions)
    advance = level - last.load_factor
    if previous is not None and not last.branched:
        ratio = advance / (last.load_factor - previous.load_factor)
        ahead = last.positions + ratio * (last.positions - previous.positions)
        ahead = loading.cleared(np.where(loading.held, potential.nodes + loading.motion(level), ahead), level)
        if np.isfinite(balance.total_energy(ahead, level)[0]):
            return Start(ahead, stress + ratio * (stress - potential.stress(previous.positions)))
    motion = loading.motion(level) - loading.motion(last.load_factor)
    return Start(loading.cleared(last.positions, level), stress, motion if motion.any() else None)


def converge(balance: Balance, load_factor: float, start: Start) -> Found:
    """Return the equilibrium found from a start, else the state of least residual."""
    with np.errstate(over="ignore", invalid="ignore"):  # of iterates that diverge
        return _converge(balance, load_factor, start)


def _converge(balance: Balance, load_factor: float, start: Start) -> Found:
    """Iterate as `converge` does, with floating point warnings."""
    potential = balance.potential
    assert isinstance(potential, Stressed)  # `start_from` checked it
    positions, stress, motion = start
    watch = Watch(balance, load_factor, positions)
    for iteration in range(min(_MAX_ITERATIONS, balance.max_iterations) + 1):
        if not watch.at(positions, iteration, motion is None):
            break
        if motion is None and watch.within_tolerance:
            return watch.equilibrium()
        tangent = balance.hessian(positions, load_factor, stress)
        if motion is None and watch.balanced(tangent, positions):
            del tangent  # its memory is used again
            return watch.equilibrium()
        step = _step(balance, positions, tangent, watch, motion)
        del tangent
        if step is None:
            break
        moved = _moved(balance, positions, load_factor, step, 0 if motion is not None else _MAX_HALVINGS)
        if moved is None:
            break
        (positions, stress), motion = moved, None
    return watch.failure()


def _step(
    balance: Balance, positions: Floats, tangent: SparseMatrix, watch: Watch, motion: Floats | None
) -> Floats | None:
    """Return the Newton step with the motion of held nodes [m], shape (n_nodes, dim); None if there is none.

    If the tangent is not positive definite, the projected Hessian replaces it.
    """
    for candidate in (tangent, None):
        if candidate is None:
            candidate = balance.projected(positions, watch.load_factor)
            if candidate is None:
                return None
        right = -watch.force
        if motion is not None:
            right = np.where(balance.free, right - balance.product(candidate, motion), 0.0)
        step = stepped(balance, candidate, positions, right, balance.accuracy(watch.residual))
        if step is not None:
            return step if motion is None else step + motion
    return None


def _moved(
    balance: Balance, positions: Floats, load_factor: float, step: Floats, max_halvings: int
) -> tuple[Floats, Floats] | None:
    """Return positions after a step, and the stress extrapolated along it; None if the energy is not finite.

    A step to a state without finite energy is halved up to `max_halvings` times.
    """
    potential = balance.potential
    assert isinstance(potential, Stressed)
    for _ in range(max_halvings + 1):
        if np.isfinite(balance.total_energy(positions + step, load_factor)[0]):
            return positions + step, potential.extrapolated_stress(positions, step)
        step = step / 2
    return None
