"""Linear equilibrium of springs near rest, for what is told of them before a solve."""

from typing import Any

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import cg, splu

from truespring.arrays import Floats, Ints
from truespring.potential import rigid_body_modes

FreeMatrix = sparse.csr_array[Any, tuple[int, int]]

# Up to so many unknowns, in the plane and in space, a factorisation is quick.
_DIRECT = {2: 300_000, 3: 20_000}


def relaxed(matrix: FreeMatrix, right: Floats, dim: int) -> Floats | None:
    """Solve matrix x = right, columns of shape (n, k); None where the matrix is not seen to be positive definite.

    By factorisation, whose pivots tell; of large bodies in space by conjugate gradients, which may not notice.
    """
    if matrix.shape[0] > _DIRECT[dim]:
        return _by_gradients(matrix, right)
    try:
        factors = splu(
            sparse.csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        return None
    if (factors.perm_r != factors.perm_c).any() or (factors.U.diagonal() <= 0).any():
        return None
    return np.asarray(factors.solve(right))


def _by_gradients(matrix: FreeMatrix, right: Floats) -> Floats | None:
    diagonal = matrix.diagonal()
    if (diagonal <= 0).any():
        return None
    found = np.zeros_like(right)
    for column in range(right.shape[1]):
        inverse = sparse.diags_array(1 / diagonal)
        found[:, column], failed = cg(matrix, right[:, column], rtol=1e-9, maxiter=20_000, M=inverse)
        if failed:
            return None
    return found


def pinned(nodes: Floats) -> Ints:
    """Return dofs that hold a body against rigid motion and no more: without them no strain is hindered."""
    _, order = linalg.qr(rigid_body_modes(nodes).T, mode="r", pivoting=True)
    n_modes = np.linalg.matrix_rank(rigid_body_modes(nodes))
    return np.sort(np.asarray(order[:n_modes], dtype=np.int64))
