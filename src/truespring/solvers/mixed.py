"""Newton's method with mixed integration points: few iterations, even to large rotations in one step.

The stress of each spring or element is an unknown of its own, eliminated on the spot: the geometric part
of the tangent is built from the stress carried on linearly along the last step, not from that of the
positions (Magisano, Leonetti, Garcea, CMAME 313, 2017). The balance itself is that of the positions. There
is no line search: where it does not converge, the caller has another way.
"""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.potential import Projectable, SparseMatrix, Stressed
from truespring.solvers.balance import Balance, Equilibrium, Found, Watch, stepped

# It converges in less than ten iterations or hardly ever.
_MAX_ITERATIONS = 20
# Steps into states without energy, an element turned inside out, are halved so often.
_MAX_HALVINGS = 5


class Start(NamedTuple):
    """Where to start: positions [m], the stress there, and a motion of held nodes still to be made [m]."""

    positions: Floats
    stress: Floats
    motion: Floats | None = None


def start_from(balance: Balance, level: float, last: Equilibrium, previous: Equilibrium | None) -> Start | None:
    """Return the start for a load level after one or two former states; None where the potential has no stress."""
    potential, loading = balance.potential, balance.loading
    if not isinstance(potential, Stressed):
        return None
    stress = potential.stress(last.positions)
    advance = level - last.load_factor
    if previous is not None and not last.branched:
        ratio = advance / (last.load_factor - previous.load_factor)
        ahead = last.positions + ratio * (last.positions - previous.positions)
        ahead = np.where(loading.held, potential.nodes + loading.motion(level), ahead)
        if np.isfinite(balance.total_energy(ahead, level)[0]):
            return Start(ahead, stress + ratio * (stress - potential.stress(previous.positions)))
    motion = loading.motion(level) - loading.motion(last.load_factor)
    return Start(last.positions, stress, motion if motion.any() else None)


def converge(balance: Balance, load_factor: float, start: Start) -> Found:
    """Find the balance from a start; where that fails, return the state with the least residual."""
    with np.errstate(over="ignore", invalid="ignore"):  # of iterates that run away
        return _converge(balance, load_factor, start)


def _converge(balance: Balance, load_factor: float, start: Start) -> Found:
    potential = balance.potential
    assert isinstance(potential, Stressed)  # it gave the start
    positions, stress, motion = start
    watch = Watch(balance, load_factor, positions)
    for iteration in range(min(_MAX_ITERATIONS, balance.max_iterations) + 1):
        if not watch.at(positions, iteration, motion is None):
            break
        tangent = balance.hessian(positions, load_factor, stress)
        if motion is None and watch.balanced(tangent, positions):
            del tangent  # the next one takes its room
            return watch.equilibrium()
        step = _step(balance, positions, tangent, watch, motion)
        del tangent
        if step is None:
            break
        moved = _moved(balance, positions, step, 0 if motion is not None else _MAX_HALVINGS)
        if moved is None:
            break
        (positions, stress), motion = moved, None
    return watch.failure()


def _step(
    balance: Balance, positions: Floats, tangent: SparseMatrix, watch: Watch, motion: Floats | None
) -> Floats | None:
    """Return Newton's step, the motion of held nodes in it; None where there is none."""
    for candidate in (tangent, None):
        if candidate is None:
            if not isinstance(balance.potential, Projectable):
                return None
            candidate = balance.in_blocks(balance.potential.projected_hessian(positions))
        right = -watch.force
        if motion is not None:
            right = np.where(balance.free, right - (candidate @ motion.ravel()).reshape(right.shape), 0.0)
        step = stepped(balance, candidate, positions, right, balance.accuracy(watch.residual))
        if step is not None:
            return step if motion is None else step + motion
    return None


def _moved(balance: Balance, positions: Floats, step: Floats, max_halvings: int) -> tuple[Floats, Floats] | None:
    """Return positions and the stress carried on; a step to where there is no energy is halved, or None."""
    potential = balance.potential
    assert isinstance(potential, Stressed)
    for _ in range(max_halvings + 1):
        if np.isfinite(potential.energy(positions + step)):
            return positions + step, potential.extrapolated_stress(positions, step)
        step = step / 2
    return None
