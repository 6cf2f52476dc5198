"""Richardson extrapolation on meshes of which each has elements half as large as the one before.

The error of a mesh with elements of size h is assumed to be C h^p, p being the order of convergence.
Source: Roache, Verification and Validation in Computational Science and Engineering, Hermosa, 1998, chapter 5.
"""

import math


def observed_order(before: float, last: float) -> float | None:
    """Return the order p of two successive changes of a value, from three meshes; None if they do not show one.

    `before` is the change from the first mesh to the second, `last` that from the second to the third.
    """
    return math.log2(before / last) if last and before / last > 0 else None


def remaining_error(change: float, order: float) -> float:
    """Return the error of the finer of two meshes, given its change from the coarser one: change / (2^p - 1)."""
    return change / (2**order - 1)
