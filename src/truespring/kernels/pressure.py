"""Loop that takes the stiffness of cells against a change of volume out of a matrix."""

from typing import Any

from truespring.kernels.small import unsigned
from truespring.kernels.threads import kernel


@kernel
def subtract(
    first: int, last: int, at_starts: Any, at: Any, slots: Any, slope: Any, stiffness: Any, values: Any, zero: Any
) -> None:
    """Subtract stiffness s s^T of each cell, s its slope, from the rows of the nodes first to last of a matrix.

    Shapes: at_starts (n_nodes + 1,), at (n_cells * k,), slots (n_cells, k, k), slope (n_cells, k, dim), stiffness
    (n_cells,), values (n_blocks, dim, dim); `zero` has length dim.
    """
    k, dim = unsigned(slots.shape[1]), len(zero)
    for i in range(first, last):
        for q in range(at_starts[i], at_starts[i + 1]):
            place = unsigned(at[unsigned(q)])
            e = place // k
            a = place - e * k
            for b in range(k):
                p = unsigned(slots[e, a, b])
                for c in range(dim):
                    factor = stiffness[e] * slope[e, a, c]
                    for d in range(dim):
                        values[p, c, d] -= factor * slope[e, b, d]
