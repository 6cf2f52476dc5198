"""The linear solver: a factorisation that also tells the inertia of its matrix."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh, splu

from truespring.arrays import Floats
from truespring.potential import SparseMatrix

# Up to this size the eigenvalues themselves decide where the pivots cannot.
_DENSE = 2000


class SingularMatrixError(ArithmeticError):
    """The matrix has no inverse: a mechanism, or a state exactly at a limit or bifurcation point."""


@dataclass(frozen=True)
class Factorisation:
    """L D L^T of a symmetric matrix.

    Attributes:
        matrix: what was factorised, shape (n, n).
        negative_eigenvalues: their number, by Sylvester's law from the pivots; None where the
            pivots were permuted away from the diagonal and the matrix is too large for another way.
    """

    matrix: SparseMatrix
    negative_eigenvalues: int | None
    _lu: Any

    def solve(self, right: Floats) -> Floats:
        """Return the solution of matrix x = right, shape (n,)."""
        return np.asarray(self._lu.solve(right))

    def lowest_mode(self) -> Floats:
        """Return the eigenvector of a negative eigenvalue, largest component +1, shape (n,).

        The one nearest to zero; in tiny systems the lowest.
        """
        n = self.matrix.shape[0]
        if n <= 10:
            vector = np.linalg.eigh(self.matrix.toarray())[1][:, 0]
        else:
            inverse = LinearOperator((n, n), matvec=self._lu.solve, dtype=np.float64)
            start = np.random.default_rng(9).normal(size=n)
            try:
                vector = eigsh(self.matrix, k=1, sigma=0.0, which="SA", OPinv=inverse, v0=start)[1][:, 0]
            except ArpackError:  # inverse iteration needs no more than solves
                vector = start
                for _ in range(50):
                    vector = self.solve(vector)
                    vector = vector / np.linalg.norm(vector)
        return np.asarray(vector / vector[np.abs(vector).argmax()])


def factorise(matrix: SparseMatrix) -> Factorisation:
    """Factorise a symmetric matrix; raise SingularMatrixError where it has no inverse."""
    if not np.isfinite(matrix.data).all():
        raise SingularMatrixError("the matrix holds values that are not finite")
    try:
        # Without row pivoting on the diagonal SuperLU's U carries D of L D L^T.
        lu = splu(
            sparse.csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise SingularMatrixError(str(error)) from None
    return Factorisation(matrix, _negative_eigenvalues(lu, matrix), lu)


def _negative_eigenvalues(lu: Any, matrix: SparseMatrix) -> int | None:
    if (lu.perm_r == lu.perm_c).all():
        return int((lu.U.diagonal() < 0).sum())
    if matrix.shape[0] <= _DENSE:
        return int((np.linalg.eigvalsh(matrix.toarray()) < 0).sum())
    return None
