"""Factorisations of tangents; their pivots give the number of negative eigenvalues."""

import importlib.util
import math
from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats
from truespring.potential import SparseMatrix

# Largest number of unknowns for which eigenvalues are computed if the pivots do not give their signs.
_DENSE = 2000

# Peak memory over n log2 n in the plane, over n^(4/3) in space [bytes]: the fill is 25 million entries at 1e5 nodes and
# 433 million at 1e6 in the plane, 119 million at 3.2e4 in space.
_BYTES_PLANE, _BYTES_SPACE = 450.0, 2500.0

FreeMatrix = sparse.csr_array[Any, tuple[int, int]]


class SingularMatrixError(ArithmeticError):
    """The matrix has no inverse: the body is a mechanism, or the state is a critical point."""


class Factors(NamedTuple):
    """Factors of a matrix.

    Attributes:
        solve: returns the solution for a right side, shape (n,).
        negative_eigenvalues: number of negative eigenvalues, None if not known.
        n_bytes: memory of the factors [bytes].
    """

    solve: Callable[[Floats], Floats]
    negative_eigenvalues: int | None
    n_bytes: int


def _superlu(matrix: FreeMatrix) -> Factors:
    """Factorise by SciPy's SuperLU."""
    from scipy.sparse.linalg import splu

    # Without row pivoting, the diagonal of SuperLU's U is D of L D L^T.
    lu = splu(
        sparse.csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    if (lu.perm_r == lu.perm_c).all():
        negative: int | None = int((lu.U.diagonal() < 0).sum())
    elif matrix.shape[0] <= _DENSE:
        negative = int((np.linalg.eigvalsh(matrix.toarray()) < 0).sum())
    else:
        negative = None
    return Factors(lambda right: np.asarray(lu.solve(right)), negative, 12 * lu.nnz)


def _rslab(matrix: FreeMatrix) -> Factors:
    """Factorise by rslab."""
    import rslab

    from truespring.kernels.threads import n_threads

    factors = rslab.ldlt(sparse.csc_array(matrix), threads=n_threads())
    positive, negative, _ = factors.inertia
    if positive + negative < matrix.shape[0]:
        raise RuntimeError("the matrix is singular")
    return Factors(lambda right: np.asarray(factors.solve(right)), int(negative), 8 * int(factors.factor_nnz))


def _pardiso(matrix: FreeMatrix) -> Factors:
    """Factorise by MKL Pardiso."""
    import pypardiso

    solver = pypardiso.PyPardisoSolver(mtype=-2)  # real, symmetric, indefinite: uses the upper triangle
    upper = sparse.csr_matrix(sparse.triu(matrix))
    try:
        solver.factorize(upper)
    except pypardiso.PyPardisoError as error:
        raise RuntimeError(str(error)) from None
    negative = int(solver.get_iparm(23))

    def solve(right: Floats) -> Floats:
        return np.asarray(solver.solve(upper, right))

    return Factors(solve, negative, 1024 * int(solver.get_iparm(17)))


class Factoriser(NamedTuple):
    """A library of factorisations: title, package on PyPI, module, and function."""

    title: str
    package: str
    module: str
    factorise: Callable[[FreeMatrix], Factors]


#: Libraries by their name in `linear`; "direct" chooses the first that is installed.
FACTORISERS: MappingProxyType[str, Factoriser] = MappingProxyType(
    {
        "pardiso": Factoriser("MKL Pardiso", "pypardiso", "pypardiso", _pardiso),
        "rslab": Factoriser("rslab", "rslab", "rslab", _rslab),
        "scipy": Factoriser("SuperLU", "scipy", "scipy", _superlu),
    }
)


def present(name: str) -> bool:
    """Return whether a library of FACTORISERS is installed."""
    return importlib.util.find_spec(FACTORISERS[name].module) is not None


def direct_bytes(shape: tuple[int, int]) -> float:
    """Return an estimate of the peak memory of a factorisation [bytes] for nodes of shape (n_nodes, dim)."""
    n_nodes, dim = shape
    if dim < 3:
        return _BYTES_PLANE * n_nodes * max(1.0, math.log2(max(n_nodes, 1)))
    return _BYTES_SPACE * math.pow(n_nodes, 4 / 3)


class Direct:
    """Linear solver that factorises the free directions by one of FACTORISERS."""

    def __init__(self, held: Bools, name: str) -> None:
        """Choose a library, a name of FACTORISERS or "direct"; `held` directions have shape (n_nodes, dim)."""
        chosen = next(filter(present, FACTORISERS)) if name == "direct" else name
        self._library = FACTORISERS[chosen]
        self.name = f"direct ({self._library.title})"
        self.factorisations, self.cg_iterations, self.lanczos_iterations, self.memory = 0, 0, 0, 0
        self._free = np.flatnonzero(~held.ravel())

    def ready(self, matrix: SparseMatrix, positions: Floats) -> "Factorisation":
        """Factorise a tangent of shape (n_dof, n_dof); raise SingularMatrixError if it has no inverse."""
        if not np.isfinite(matrix.data).all():
            raise SingularMatrixError("the matrix has values that are not finite")
        free = sparse.csr_array(sparse.csr_array(matrix)[self._free][:, self._free])
        # A power of two that makes the largest entry about one: results are then the same in any units.
        scale = 2.0 ** -np.frexp(np.abs(free.data).max(initial=0.0))[1]
        try:
            factors = self._library.factorise(scale * free)
        except RuntimeError as error:
            raise SingularMatrixError(str(error)) from None
        self.factorisations += 1
        self.memory = max(self.memory, factors.n_bytes)
        return Factorisation(scale * free, scale, factors, self._free, positions.shape)


@dataclass(frozen=True, eq=False)
class Factorisation:
    """L D L^T of the free directions of a symmetric matrix.

    Attributes:
        matrix: the free directions times `scale`.
        scale: factor of the matrix.
        factors: the factors of `matrix`.
        free: indices of the free directions, shape (n,).
        shape: (n_nodes, dim).
    """

    matrix: FreeMatrix
    scale: float
    factors: Factors
    free: Any
    shape: tuple[int, ...]

    lasting: ClassVar[bool] = True

    @property
    def negative_eigenvalues(self) -> int | None:
        """The number of negative eigenvalues, that of negative pivots by Sylvester's law of inertia.

        None if pivots are not on the diagonal and the matrix is too large to compute its eigenvalues.
        """
        return self.factors.negative_eigenvalues

    def solve(self, right: Floats, accuracy: float = 0.0) -> Floats:
        """Return x of tangent x = right [m], shape (n_nodes, dim); `accuracy` has no effect."""
        return self._whole(self.factors.solve(self.scale * right.ravel()[self.free]))

    def _whole(self, values: Floats) -> Floats:
        """Return values of the free directions, shape (n,), as an array of shape (n_nodes, dim), else zero."""
        whole = np.zeros(self.shape)
        whole.ravel()[self.free] = values
        return whole

    def lowest_mode(self) -> Floats:
        """Return the eigenvector of a negative eigenvalue, largest component +1 [-], shape (n_nodes, dim).

        The negative eigenvalue nearest to zero; the lowest one for at most ten unknowns.
        """
        return self._mode("SA", lambda values: int(values.argmin()))

    def nearest_mode(self) -> Floats:
        """Return the eigenvector of the eigenvalue nearest to zero, largest component +1 [-], shape (n_nodes, dim)."""
        return self._mode("LM", lambda values: int(np.abs(values).argmin()))

    def _mode(self, which: Any, chosen: Callable[[Floats], int]) -> Floats:
        """Return an eigenvector, shape (n_nodes, dim): `which` of eigsh, `chosen` from all values of a small matrix."""
        n = self.matrix.shape[0]
        if n <= 10:
            values, vectors = np.linalg.eigh(self.matrix.toarray())
            vector = vectors[:, chosen(values)]
        else:
            from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh

            inverse = LinearOperator((n, n), matvec=self.factors.solve, dtype=np.float64)
            start = np.random.default_rng(9).normal(size=n)
            try:
                vector = eigsh(self.matrix, k=1, sigma=0.0, which=which, OPinv=inverse, v0=start)[1][:, 0]
            except ArpackError:  # use inverse iteration instead
                vector = start
                for _ in range(50):
                    vector = self.factors.solve(vector)
                    vector = vector / np.linalg.norm(vector)
        return self._whole(vector / vector[np.abs(vector).argmax()])
