"""Newton steps for loads without a potential: halved until the residual decreases.

The residual is measured by the displacement that it causes, by the tangent at the begin of the step (the natural
monotonicity test of Deuflhard, Newton Methods for Nonlinear Problems, 3.3.1): in newtons, the forces of bending of a
slender body are hidden by those of stretch.
"""

import numpy as np

from truespring.arrays import Floats
from truespring.linear.gradients import SlowError
from truespring.linear.protocols import Tangent
from truespring.potential import SparseMatrix
from truespring.solvers.balance import Balance, Watch, stepped_by

# Required decrease, as a share of the length of the step over the full one, and largest number of halvings.
_DECREASE, _MAX_HALVINGS = 0.25, 12
# Relative accuracy of the displacement that a residual causes.
_MEASURE = 0.1


def reduced(
    balance: Balance, load_factor: float, positions: Floats, tangent: SparseMatrix, watch: Watch
) -> Floats | None:
    """Return the positions after a Newton step that reduces the residual, None if there is none.

    `watch` has the residual at the positions [m], shape (n_nodes, dim).
    """
    found = stepped_by(balance, tangent, positions, -watch.force, balance.accuracy(watch.residual))
    if found is None:
        return None
    length, size = 1.0, balance.norm(found.step)
    for _ in range(_MAX_HALVINGS + 1):
        moved = positions + length * found.step
        if np.isfinite(balance.total_energy(moved, load_factor)[0]):
            caused = balance.norm(_caused(found.tangent, balance.force(moved, load_factor)))
            if caused <= (1 - _DECREASE * length) * size:
                return moved
        length /= 2
    return None


def _caused(tangent: Tangent, force: Floats) -> Floats:
    """Return the displacement that a force causes [m], shape (n_nodes, dim)."""
    try:
        return tangent.solve(force, _MEASURE)
    except SlowError as slow:
        return slow.best
