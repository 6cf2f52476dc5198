"""Linear solver: conjugate gradients preconditioned by multigrid."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from truespring.arrays import Bools, Floats, ShortInts
from truespring.linear.aggregates import Aggregates
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import IndefiniteError, SlowError, conjugate_gradients, lowest_eigenvalue
from truespring.linear.levels import Level, Matrix, condense, empty_level
from truespring.linear.multigrid import Coarsening, Hierarchy
from truespring.linear.nested import Nested
from truespring.potential import SparseMatrix

_MAX_ITERATIONS = 150


class Multigrid:
    """Conjugate gradients preconditioned by multigrid."""

    def __init__(self, nodes: Floats, held: Bools, interpolations: Sequence[Any] = ()) -> None:
        """Begin with the undeformed positions [m] and the held directions, shape (n_nodes, dim) both.

        `interpolations` are the weights of the nodes from those of a coarser mesh, and so on, sparse, shape (n,
        n_coarse); without them coarse levels are made by aggregation.
        """
        from truespring.kernels.threads import writable

        self.factorisations, self.cg_iterations, self.lanczos_iterations, self.memory = 0, 0, 0, 0
        self._held = writable(held)
        self._coarsening: Coarsening = (
            Nested(nodes, self._held, interpolations) if len(interpolations) else Aggregates(nodes, self._held)
        )
        self._level: Level | None = None
        self._columns: ShortInts = np.empty(0, np.int32)
        self._scale = 0.0

    @property
    def name(self) -> str:
        """Name for notes and reports: "geometric multigrid" with interpolations, else "multigrid"."""
        return self._coarsening.name

    def ready(self, matrix: SparseMatrix, positions: Floats) -> "Preconditioned":
        """Prepare a tangent, shape (n_dof, n_dof).

        Raises SingularMatrixError if values are not finite, or if no coarse levels exist.
        """
        level, tangent = self._room(matrix), Matrix(matrix.indptr, matrix.indices, matrix.data, self._held)
        building = self._coarsening.stale
        if not self._scale or building:
            self._scale = 2.0 ** -float(np.frexp(max(matrix.data.max(), -matrix.data.min()))[1])
        if not np.isfinite(self._scale):
            raise SingularMatrixError("the matrix has values that are not finite")
        positive = condense(level, tangent, self._scale)
        coarse = self._coarsening.hierarchy(level, tangent, self._scale, positions, positive)
        if coarse is None and not self.factorisations:
            raise SingularMatrixError("a diagonal block of the matrix is not positive definite")
        if coarse is not None and building:
            self.factorisations += 1
            self.memory = max(self.memory, self._coarsening.n_bytes + level.n_bytes)
        return Preconditioned(self, level, coarse, self._scale)

    def _room(self, matrix: SparseMatrix) -> Level:
        """Return the finest level, allocated for the sparsity of a tangent."""
        columns: ShortInts = matrix.indices
        if self._level is None or (columns is not self._columns and not np.array_equal(columns, self._columns)):
            self._level = empty_level(matrix.indptr, columns, matrix.blocksize[0], np.float32)
            self._columns = columns
        return self._level

    def spent(self, iterations: int, digits: float) -> None:
        """Count iterations; choose the coarse levels of the next tangent by them and by the digits that they gave."""
        self.cg_iterations += iterations
        self._coarsening = self._coarsening.after(2 * iterations / max(digits, 2.0))


@dataclass(frozen=True, eq=False)
class Preconditioned:
    """A tangent with its multigrid preconditioner, valid until the solver prepares the next one.

    Attributes:
        solver: solver that counts the iterations.
        level: finest level, the tangent times `scale`.
        coarse: coarse levels; None if a diagonal block is not positive definite.
        scale: factor of the tangent.
    """

    solver: Multigrid
    level: Level
    coarse: Hierarchy | None
    scale: float

    lasting: ClassVar[bool] = False

    def precondition(self, r: Floats) -> Floats:
        """Return an approximate solution for a residual, shape (n_nodes, dim)."""
        assert self.coarse is not None
        return self.coarse.cycle(self.level, r)

    def solve(self, right: Floats, accuracy: float = 1e-10) -> Floats:
        """Return x of tangent x = right [m], shape (n_nodes, dim), with a relative residual of at most `accuracy`.

        Raises IndefiniteError if a direction of negative curvature is found, SlowError if the accuracy is not reached;
        the coarse levels are then rebuilt for the next tangent.
        """
        if self.coarse is None:
            raise IndefiniteError("a diagonal block is not positive definite")
        if not right.any():
            return np.zeros(right.shape)
        system = (self.scale * right, accuracy, _MAX_ITERATIONS)
        try:
            found = conjugate_gradients(self.level.product, self.precondition, *system)
        except SlowError:
            self.solver.spent(_MAX_ITERATIONS, 0.0)
            raise
        self.solver.spent(found.iterations, -np.log10(accuracy))
        return found.solution

    @cached_property
    def negative_eigenvalues(self) -> int | None:
        """1 if the lowest eigenvalue is negative, else 0; None if it did not converge."""
        if self.coarse is None:
            return 1
        start = np.random.default_rng(5).normal(size=self.level.shape)
        found = lowest_eigenvalue(self.level.product, self.precondition, np.where(self.solver._held, 0.0, start))
        self.solver.lanczos_iterations += found.iterations
        return None if found.eigenvalue is None else int(found.eigenvalue < 0)

    def lowest_mode(self) -> None:
        """Return None: modes need a factorisation."""
        return
