"""Semidefinite parts of stacks of element matrices."""

import numpy as np

from truespring.arrays import Floats

# Smallest number of matrices that is worth another thread.
_SMALLEST_PIECE = 64
# Negative eigenvalues of a smaller size are rounding errors, over the largest eigenvalue.
_ROUNDING = 1e-12


def semidefinite(matrices: Floats, dim: int) -> Floats:
    """Return symmetric matrices with their negative eigenvalues set to zero, shape (n, n_dof, n_dof).

    The matrices are those of energies that translations do not change, node by node: with `dim` directions, n_dof is
    nodes times dim. Eigenvectors are computed without the translations, which have the eigenvalue zero.
    """
    from truespring.kernels.threads import one_blas_thread, run

    n, n_dof = len(matrices), matrices.shape[1]
    moved = np.kron(_differences(n_dof // dim), np.eye(dim))
    found = np.empty((n, n_dof, n_dof))

    def project(first: int, last: int) -> None:
        values, vectors = np.linalg.eigh(moved.T @ matrices[first:last] @ moved)
        vectors = moved @ vectors
        found[first:last] = (vectors * np.maximum(values, 0.0)[:, None]) @ vectors.swapaxes(1, 2)

    with one_blas_thread():
        run(project, n, smallest=_SMALLEST_PIECE)
    return found


def clipped(matrices: Floats) -> Floats:
    """Return symmetric matrices of a few rows, shape (n, m, m), with their negative eigenvalues set to zero."""
    if matrices.shape[1] == 1:
        return np.maximum(matrices, 0.0)
    values, vectors = np.linalg.eigh(matrices)
    return np.asarray((vectors * np.maximum(values, 0.0)[:, None]) @ vectors.swapaxes(1, 2))


def is_semidefinite(matrices: Floats) -> bool:
    """Return whether symmetric matrices, shape (n, n_dof, n_dof), have no negative eigenvalues, but for rounding."""
    from truespring.kernels.threads import one_blas_thread

    with one_blas_thread():
        values = np.linalg.eigvalsh(matrices)
    return bool((values[:, 0] >= -_ROUNDING * values[:, -1]).all())


def _differences(k: int) -> Floats:
    """Return an orthonormal basis of the vectors of k numbers whose sum is zero, shape (k, k - 1)."""
    return np.linalg.qr(np.eye(k)[:, 1:] - 1 / k)[0]
