"""Factorisations, which also tell the inertia of their matrix."""

import importlib.util
import math
from collections.abc import Callable
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh, splu

from truespring.arrays import Bools, Floats
from truespring.potential import SparseMatrix

# Up to this size the eigenvalues themselves decide where the pivots cannot.
_DENSE = 2000

# What a factorisation takes at its peak: its fill grows with n log n in the plane (25 million entries at 1e5
# nodes, 433 million at 1e6), with n^(4/3) in space (119 million at 3.2e4).
_BYTES_PLANE, _BYTES_SPACE = 450.0, 2500.0

FreeMatrix = sparse.csr_array[Any, tuple[int, int]]


class SingularMatrixError(ArithmeticError):
    """The matrix has no inverse: a mechanism, or a state exactly at a limit or bifurcation point."""


class Factors(NamedTuple):
    """What a library made of a matrix: how to solve with it, its negative eigenvalues if known, its size [bytes]."""

    solve: Callable[[Floats], Floats]
    negative_eigenvalues: int | None
    n_bytes: int


def _superlu(matrix: FreeMatrix) -> Factors:
    # Without row pivoting on the diagonal SuperLU's U carries D of L D L^T.
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
    import rslab

    from truespring.kernels.threads import n_threads

    factors = rslab.ldlt(sparse.csc_array(matrix), threads=n_threads())
    positive, negative, _ = factors.inertia
    if positive + negative < matrix.shape[0]:
        raise RuntimeError("the matrix is singular")
    return Factors(lambda right: np.asarray(factors.solve(right)), int(negative), 8 * int(factors.factor_nnz))


def _pardiso(matrix: FreeMatrix) -> Factors:
    import pypardiso

    solver = pypardiso.PyPardisoSolver(mtype=-2)  # real, symmetric, indefinite: its upper half is taken
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
    """A library: what it is called, the package it is installed by and its module, and how it factorises."""

    title: str
    package: str
    module: str
    factorise: Callable[[FreeMatrix], Factors]


#: Libraries by the names under which they may be chosen; "direct" takes the first that is present.
FACTORISERS: MappingProxyType[str, Factoriser] = MappingProxyType(
    {
        "pardiso": Factoriser("MKL Pardiso", "pypardiso", "pypardiso", _pardiso),
        "rslab": Factoriser("rslab", "rslab", "rslab", _rslab),
        "scipy": Factoriser("SuperLU", "scipy", "scipy", _superlu),
    }
)


def present(name: str) -> bool:
    """Return whether the library of this name is installed."""
    return importlib.util.find_spec(FACTORISERS[name].module) is not None


def direct_bytes(shape: tuple[int, int]) -> float:
    """Estimate what a factorisation for nodes of shape (n_nodes, dim) takes at its peak [bytes]."""
    n_nodes, dim = shape
    if dim < 3:
        return _BYTES_PLANE * n_nodes * max(1.0, math.log2(max(n_nodes, 1)))
    return _BYTES_SPACE * math.pow(n_nodes, 4 / 3)


class Direct:
    """Factorisation of the free directions by one of FACTORISERS."""

    def __init__(self, held: Bools, name: str) -> None:
        """Take the directions that are held, shape (n_nodes, dim), and a name of FACTORISERS or "direct"."""
        chosen = next(filter(present, FACTORISERS)) if name == "direct" else name
        self._library = FACTORISERS[chosen]
        self.name = f"direct ({self._library.title})"
        self.factorisations, self.cg_iterations, self.lanczos_iterations, self.memory = 0, 0, 0, 0
        self._free = np.flatnonzero(~held.ravel())

    def ready(self, matrix: SparseMatrix, positions: Floats) -> "Factorisation":
        """Factorise a tangent; raise SingularMatrixError where it has no inverse."""
        if not np.isfinite(matrix.data).all():
            raise SingularMatrixError("the matrix holds values that are not finite")
        free = sparse.csr_array(sparse.csr_array(matrix)[self._free][:, self._free])
        # By a power of two to the order of one: libraries that scale by themselves then do the same in any units.
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
    """L D L^T of the free directions of a symmetric matrix times `scale`."""

    matrix: FreeMatrix
    scale: float
    factors: Factors
    free: Any
    shape: tuple[int, ...]

    lasting: ClassVar[bool] = True

    @property
    def negative_eigenvalues(self) -> int | None:
        """Their number, by Sylvester's law from the pivots.

        None where these were permuted away from the diagonal and the matrix is too large for another way.
        """
        return self.factors.negative_eigenvalues

    def solve(self, right: Floats, accuracy: float = 0.0) -> Floats:
        """Return the solution of matrix x = right, shape (n_nodes, dim) both."""
        return self._whole(self.factors.solve(self.scale * right.ravel()[self.free]))

    def _whole(self, values: Floats) -> Floats:
        whole = np.zeros(self.shape)
        whole.ravel()[self.free] = values
        return whole

    def lowest_mode(self) -> Floats:
        """Return the eigenvector of a negative eigenvalue, largest component +1, shape (n_nodes, dim).

        The one nearest to zero; in tiny systems the lowest.
        """
        return self._mode("SA", lambda values: int(values.argmin()))

    def nearest_mode(self) -> Floats:
        """Return the eigenvector of the eigenvalue nearest to zero, largest component +1, shape (n_nodes, dim)."""
        return self._mode("LM", lambda values: int(np.abs(values).argmin()))

    def _mode(self, which: Any, chosen: Callable[[Floats], int]) -> Floats:
        n = self.matrix.shape[0]
        if n <= 10:
            values, vectors = np.linalg.eigh(self.matrix.toarray())
            vector = vectors[:, chosen(values)]
        else:
            inverse = LinearOperator((n, n), matvec=self.factors.solve, dtype=np.float64)
            start = np.random.default_rng(9).normal(size=n)
            try:
                vector = eigsh(self.matrix, k=1, sigma=0.0, which=which, OPinv=inverse, v0=start)[1][:, 0]
            except ArpackError:  # inverse iteration needs no more than solves
                vector = start
                for _ in range(50):
                    vector = self.factors.solve(vector)
                    vector = vector / np.linalg.norm(vector)
        return self._whole(vector / vector[np.abs(vector).argmax()])
