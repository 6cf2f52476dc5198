"""Branching: from an unstable equilibrium to a stable one of lower energy nearby."""

from dataclasses import replace

import numpy as np

from truespring.solvers.balance import Balance, Found
from truespring.solvers.line_search import descend

# Large steps along the mode as shares of the body's size, each followed by this number of undamped iterations; a small
# step, followed by a descent.
_LEAPS, _UNDAMPED_ITERATIONS, _NUDGE = (0.03, 0.1, 0.2, 0.3), 25, 1e-3
# Largest number of equilibria to leave one after the other.
_MAX_ESCAPES = 3


def stabilised(balance: Balance, found: Found) -> Found:
    """Return a stable equilibrium of lower energy near an unstable one; `found` if it is stable or none is found."""
    for _ in range(_MAX_ESCAPES):
        if not found.state.converged or not found.state.negative_eigenvalues:
            break
        found = balance.factorised(found)
        if found.tangent is None or not found.state.negative_eigenvalues:
            break
        left = _escaped(balance, found)
        if left.state.positions is found.state.positions:
            return left
        found = left
    return found


def _escaped(balance: Balance, unstable: Found) -> Found:
    """Return an equilibrium of lower energy along the mode of an unstable one, or `unstable` if there is none.

    Undamped Newton iterations start from x + a v + w far along the mode v, on the side of lower energy. The correction
    w removes the stretch that a v causes in a slender body, H w = -(g(x + a v) + g(x - a v) - 2 g(x)) / 2, the second
    order of Koiter's expansion. If none leads to a stable state of lower energy, a descent with line search starts from
    a small step along v.
    """
    state, tangent = unstable.state, unstable.tangent
    assert tangent is not None  # a factorisation found the negative eigenvalue
    level, spent = state.load_factor, state.iterations
    lowest = tangent.lowest_mode()
    assert lowest is not None  # every factorisation returns one
    mode = balance.size * lowest
    unit = mode / np.linalg.norm(mode)
    energy, _ = balance.total_energy(state.positions, level)
    at_state = balance.force(state.positions, level)
    for share in (*_LEAPS, _NUDGE):
        leaping = share != _NUDGE
        sides = [state.positions + side * share * mode for side in (1, -1)]
        energies = [balance.total_energy(side, level)[0] for side in sides]
        if not np.isfinite(energies).all():
            continue
        start = sides[int(np.argmin(energies))]
        if leaping:
            bent = -tangent.solve(balance.force(sides[0], level) + balance.force(sides[1], level) - 2 * at_state) / 2
            start = start + bent - unit * (unit * bent).sum()
            if not np.isfinite(balance.total_energy(start, level)[0]):
                continue
        found = descend(balance, level, start, _UNDAMPED_ITERATIONS if leaping else None)
        spent += found.state.iterations
        lower = found.state.converged and balance.total_energy(found.state.positions, level)[0] < energy
        if lower and (not leaping or found.state.negative_eigenvalues == 0):
            return found._replace(state=replace(found.state, iterations=spent, branched=True))
    return unstable._replace(state=replace(state, iterations=spent))
