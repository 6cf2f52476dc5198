"""Lowest eigenpairs of a sparse symmetric matrix beside known ones, by LOBPCG or, if it is small, a dense solver.

LOBPCG: Knyazev, SIAM J. Sci. Comput. 23 (2001). All three blocks of the search space, and the vectors that are known,
are made orthogonal by one QR factorisation.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.errors import ProblemError

Matrix = sparse.csr_array[Any, tuple[int, int]]

# Up to this number of unknowns a dense solver is as fast.
_DENSE = 400
# LOBPCG is used up to this fraction of all vectors, one in so many; else a dense solver, up to a number of unknowns.
_SHARE, _LARGEST_DENSE = 5, 10_000
# Further vectors that are iterated, which speeds up the last ones asked for.
_GUARDS = 4
# Relative error of a vector in the norm of the energy, whose square is that of its eigenvalue; and most iterations.
_ACCURACY, _MOST = 1e-7, 200


class Eigenpairs(NamedTuple):
    """Eigenvalues, ascending, and orthonormal eigenvectors.

    Attributes:
        values: shape (k,).
        vectors: shape (n, k).
        residuals: norm of A x - value x, a bound of the distance to an eigenvalue, shape (k,).
        converged: whether each vector is accurate to 1e-7 in the norm of the energy, by estimate, shape (k,).
        method: the name of the method.
    """

    values: Floats
    vectors: Floats
    residuals: Floats
    converged: np.ndarray
    method: str


def lowest(matrix: Matrix, known: Floats, inverse: Callable[[], Callable[[Floats], Floats]], count: int) -> Eigenpairs:
    """Return the `count` lowest eigenpairs, or all, orthogonal to `known` vectors, which are orthonormal eigenvectors.

    Args:
        matrix: symmetric, shape (n, n).
        known: shape (n, n_known).
        inverse: makes a function that returns approximate solutions for right sides, both of shape (n, k); called for
            large matrices only.
        count: number of eigenpairs.

    Raises ProblemError if almost all eigenpairs of a large matrix are asked for.
    """
    n, n_known = known.shape
    count = min(count, n - n_known)
    if n <= max(_DENSE, n_known + _SHARE * (count + _GUARDS)):
        if n > _LARGEST_DENSE:
            most = (n - n_known) // _SHARE - _GUARDS
            raise ProblemError(f"count = {count}: of a body with {n:,} unknowns at most {most:,} modes are computed")
        return _dense(matrix, known, count)
    return _iterated(matrix, known, inverse(), count)


def size_of(matrix: Matrix) -> float:
    """Return an upper bound of the size of eigenvalues, the largest sum of a row."""
    return float(abs(matrix).sum(axis=1).max(initial=0.0))


def _dense(matrix: Matrix, known: Floats, count: int) -> Eigenpairs:
    """Return eigenpairs by a dense solver, with the known vectors moved above all others."""
    whole = matrix.toarray()
    values, vectors = np.linalg.eigh(whole + 2 * size_of(matrix) * known @ known.T)
    values, vectors = values[:count], vectors[:, :count]
    residuals = np.linalg.norm(whole @ vectors - vectors * values, axis=0)
    return Eigenpairs(values, vectors, residuals, np.ones(count, dtype=bool), "dense")


def _iterated(matrix: Matrix, known: Floats, inverse: Callable[[Floats], Floats], count: int) -> Eigenpairs:
    """Return eigenpairs by LOBPCG."""
    n, n_known = known.shape
    m = count + _GUARDS
    floor = float(np.finfo(float).eps) * size_of(matrix)
    start = inverse(np.random.default_rng(n).standard_normal((n, m)))
    x, before = np.zeros((n, 0)), start
    values = error = residuals = np.zeros(0)
    for _ in range(_MOST):
        basis = np.linalg.qr(np.concatenate([known, x, before], axis=1))[0][:, n_known:]
        image = matrix @ basis
        found, mixed = np.linalg.eigh(_symmetric(basis.T @ image))
        mixed, values = mixed[:, :m], found[:m]
        # What the new vectors have beside the old ones is the third block of the next search space.
        width = x.shape[1]
        moved = basis[:, width:] @ mixed[width:]
        x, ax = basis @ mixed, image @ mixed
        right = ax - x * values
        right -= known @ (known.T @ right)
        residuals = np.linalg.norm(right, axis=0)
        open_ = residuals > floor
        steps = np.zeros(right.shape)
        steps[:, open_] = inverse(right[:, open_])
        error = np.sqrt(np.abs((right * steps).sum(axis=0)) / np.maximum(np.abs(values), floor))
        open_ &= error > _ACCURACY
        if not open_[:count].any():
            break
        before = np.concatenate([steps[:, open_], moved[:, open_] if width else moved[:, :0]], axis=1)
    return Eigenpairs(
        values[:count], x[:, :count], residuals[:count], (error <= _ACCURACY)[:count] | ~open_[:count], "LOBPCG"
    )


def _symmetric(matrix: Floats) -> Floats:
    return np.asarray((matrix + matrix.T) / 2)
