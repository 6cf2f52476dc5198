"""Linear solvers of tangents that are not symmetric, as under a load without a potential.

Each has a solver of symmetric matrices beside it, which takes the tangents that are symmetric, as without load. The
signs of eigenvalues of the other tangents are not determined.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats
from truespring.linear.direct import Direct, Factors, FreeMatrix
from truespring.linear.gradients import IndefiniteError, SlowError, norm, scalar_product
from truespring.linear.protocols import LinearSolver, Tangent
from truespring.potential import SparseMatrix

# A matrix is symmetric up to this share of its largest entry.
_ROUNDING = 1e-12
# SuperLU keeps a pivot on the diagonal that is at least this share of the largest in its column: less fill.
_DIAGONAL = 0.1
# Relative accuracy of the systems with the symmetric part, and largest number of these systems.
_INNER, _MAX_ITERATIONS = 0.03, 60


class Lu(Direct):
    """Linear solver that factorises the free directions: by SuperLU with row pivoting if they are not symmetric."""

    def __init__(self, held: Bools, name: str) -> None:
        """Choose a library for symmetric matrices, as Direct does; `held` directions have shape (n_nodes, dim)."""
        super().__init__(held, name)
        symmetric = self._library
        pivoted = symmetric.module == "scipy"
        title = f"{symmetric.title}, {'' if pivoted else 'SuperLU '}with row pivoting where not symmetric"

        def factorise(matrix: FreeMatrix) -> Factors:
            """Factorise by the library if a matrix is symmetric, else by SuperLU."""
            askew = abs(matrix - matrix.T).max()
            return symmetric.factorise(matrix) if askew <= _ROUNDING * abs(matrix).max() else _pivoted(matrix)

        self._library = symmetric._replace(title=title, factorise=factorise)
        self.name = f"direct ({title})"


def _pivoted(matrix: FreeMatrix) -> Factors:
    """Factorise by SuperLU with row pivoting."""
    from scipy.sparse.linalg import splu

    lu = splu(sparse.csc_array(matrix), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=_DIAGONAL)
    return Factors(lambda right: np.asarray(lu.solve(right)), None, 12 * lu.nnz)


class Gmres:
    """GMRES, preconditioned by a solver of the symmetric part."""

    def __init__(self, symmetric: LinearSolver, held: Bools) -> None:
        """Begin with a solver of symmetric matrices and the held directions, shape (n_nodes, dim)."""
        self._symmetric, self._free = symmetric, ~held

    @property
    def name(self) -> str:
        """Name for notes and reports."""
        return f"GMRES with {self._symmetric.name} of the symmetric part"

    @property
    def factorisations(self) -> int:
        """The number of factorisations, or of times that coarse levels were built."""
        return self._symmetric.factorisations

    @property
    def cg_iterations(self) -> int:
        """The number of iterations of conjugate gradients for the symmetric part."""
        return self._symmetric.cg_iterations

    @property
    def lanczos_iterations(self) -> int:
        """The number of Lanczos iterations."""
        return self._symmetric.lanczos_iterations

    @property
    def memory(self) -> int:
        """Largest memory of factors or coarse levels [bytes]."""
        return self._symmetric.memory

    def ready(self, matrix: SparseMatrix, positions: Floats) -> Tangent:
        """Prepare the tangent at `positions` [m], shape (n_nodes, dim); `matrix` has shape (n_dof, n_dof).

        Raises SingularMatrixError if the symmetric part has no coarse levels.
        """
        if self._is_symmetric(matrix):
            return self._symmetric.ready(matrix, positions)
        part = sparse.bsr_array((matrix + matrix.T) / 2, blocksize=matrix.blocksize)
        part.sort_indices()
        return _Split(matrix, self._symmetric.ready(part, positions), self._free)

    def _is_symmetric(self, matrix: SparseMatrix) -> bool:
        """Return whether the free directions of a matrix are symmetric."""
        askew = sparse.bsr_array(matrix - matrix.T, blocksize=matrix.blocksize)
        slightly = _ROUNDING * float(np.abs(matrix.data).max(initial=0.0))
        block, row, column = np.nonzero(np.abs(askew.data) > slightly)
        nodes = np.repeat(np.arange(len(askew.indptr) - 1), np.diff(askew.indptr))
        free = self._free[nodes[block], row] & self._free[askew.indices[block], column]
        return not free.any()


@dataclass(frozen=True, eq=False)
class _Split:
    """A tangent that is not symmetric, with its symmetric part, valid until the solver prepares the next one.

    Attributes:
        matrix: the tangent, shape (n_dof, n_dof).
        symmetric: its symmetric part, prepared for solving.
        free: free directions, shape (n_nodes, dim).
    """

    matrix: SparseMatrix
    symmetric: Tangent
    free: Bools

    lasting: ClassVar[bool] = False
    negative_eigenvalues: ClassVar[None] = None

    def solve(self, right: Floats, accuracy: float = 1e-10) -> Floats:
        """Return x of tangent x = right [m], shape (n_nodes, dim), with a relative residual of at most `accuracy`.

        The residual is the least in the span of the preconditioned residuals, as in GMRES with a preconditioner that
        varies (GCR: Eisenstat, Elman, Schultz, SIAM J. Numer. Anal. 20, 1983). Raises SlowError if the accuracy is not
        reached.
        """
        x, left = np.zeros(right.shape), np.where(self.free, right, 0.0)
        target = accuracy * norm(left)
        steps: list[Floats] = []
        images: list[Floats] = []  # of the steps, orthonormal
        while norm(left) > target:
            if len(steps) == _MAX_ITERATIONS:
                raise SlowError(x)
            step = self._nearly(left, x)
            image = np.where(self.free, (self.matrix @ step.ravel()).reshape(step.shape), 0.0)
            for earlier, its_image in zip(steps, images, strict=True):
                share = scalar_product(its_image, image)
                step, image = step - share * earlier, image - share * its_image
            size = norm(image)
            if not (np.isfinite(size) and size):
                raise SlowError(x)
            step, image = step / size, image / size
            gain = scalar_product(image, left)
            x, left = x + gain * step, left - gain * image
            steps.append(step)
            images.append(image)
        return x

    def _nearly(self, left: Floats, best: Floats) -> Floats:
        """Return an approximate solution for a residual; raise SlowError with `best` if there is none."""
        try:
            return self.symmetric.solve(left, _INNER)
        except SlowError as slow:
            return slow.best
        except IndefiniteError:
            raise SlowError(best) from None

    def lowest_mode(self) -> None:
        """Return None: the matrix has no orthogonal modes."""
        return
