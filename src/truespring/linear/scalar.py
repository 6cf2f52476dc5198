"""Scalar matrices like that of heat conduction: factorised, or solved by conjugate gradients if they are large."""

from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.linear.direct import FACTORISERS, Factors, present
from truespring.linear.gradients import SlowError

# Largest number of unknowns for a factorisation.
_DIRECT = 40_000
# Relative accuracy, and the largest number of iterations: a preconditioner that uses solutions is then nearly linear.
_ACCURACY, _MAX_ITERATIONS = 1e-4, 60
# Smallest off-diagonal entry, relative to the diagonal, that joins two unknowns in one aggregate.
_STRONG = 0.02
_COARSEST = 100


class Scalar:
    """A symmetric positive definite matrix, sparse, shape (n, n)."""

    def __init__(self, matrix: Any) -> None:
        """Begin with the matrix; it is factorised, or coarse levels are made, for the first solution."""
        # Times a power of two, so that results are the same in any units.
        self._scale = 2.0 ** -float(np.frexp(matrix.diagonal().max())[1])
        self._matrix = sparse.csr_matrix(self._scale * matrix)

    @cached_property
    def _factors(self) -> Factors:
        return FACTORISERS[next(filter(present, FACTORISERS))].factorise(sparse.csr_array(self._matrix))

    @cached_property
    def _cycle(self) -> Any:
        """The V-cycle of smoothed aggregation; its weights are local, hence not random."""
        from pyamg import smoothed_aggregation_solver

        return smoothed_aggregation_solver(
            self._matrix,
            symmetry="symmetric",
            strength=("symmetric", {"theta": _STRONG}),
            smooth=("jacobi", {"omega": 4 / 3, "weighting": "local"}),
            presmoother=("gauss_seidel", {"sweep": "forward"}),
            postsmoother=("gauss_seidel", {"sweep": "backward"}),
            max_coarse=_COARSEST,
        ).aspreconditioner()

    def solve(self, right: Floats) -> Floats:
        """Return the solution for a right side, shape (n,); raise SlowError if the accuracy is not reached."""
        if len(right) <= _DIRECT:
            return self._factors.solve(self._scale * right)
        x, r = np.zeros(right.shape), self._scale * right
        z = self._cycle @ r
        p, slope = z.copy(), float(r @ z)
        target = _ACCURACY**2 * slope
        for _ in range(_MAX_ITERATIONS):
            if not slope > target:
                return x
            image = self._matrix @ p
            length = slope / float(p @ image)
            x += length * p
            r -= length * image
            z = self._cycle @ r
            before, slope = slope, float(r @ z)
            p = z + slope / before * p
        raise SlowError(x)
