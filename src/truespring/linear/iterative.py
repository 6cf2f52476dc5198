"""Linear solver: conjugate gradients preconditioned by multigrid."""

from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from truespring.arrays import Bools, Floats, ShortInts
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import IndefiniteError, SlowError, conjugate_gradients, lowest_eigenvalue
from truespring.linear.multigrid import Hierarchy, Level, Matrix, build, condense, empty_level
from truespring.modes import rigid_body_modes
from truespring.potential import SparseMatrix

# Coarse levels are rebuilt if two digits of accuracy take more iterations than this.
_STALE = 25
_MAX_ITERATIONS = 150


class Multigrid:
    """Conjugate gradients preconditioned by multigrid, whose coarse levels are fixed and rotate with the body."""

    name = "multigrid"

    def __init__(self, nodes: Floats, held: Bools) -> None:
        """Begin with the undeformed positions [m] and the held directions, shape (n_nodes, dim) both."""
        self.factorisations, self.cg_iterations, self.lanczos_iterations, self.memory = 0, 0, 0, 0
        self._held = np.ascontiguousarray(held)
        self._level: Level | None = None
        self._columns: ShortInts = np.empty(0, np.int32)
        self._coarse: Hierarchy | None = None
        self._built_at = nodes
        self._scale = 1.0
        self._stale = False

    def ready(self, matrix: SparseMatrix, positions: Floats) -> "Preconditioned":
        """Prepare a tangent, shape (n_dof, n_dof); build the coarse levels for the first one, and if they are stale.

        Raises SingularMatrixError if values are not finite, or if no coarse levels exist.
        """
        from truespring.kernels import multigrid
        from truespring.kernels.threads import run, writable

        level, tangent = self._room(matrix), Matrix(matrix.indptr, matrix.indices, matrix.data, self._held)
        if self._coarse is None or self._stale:
            self._scale = 2.0 ** -float(np.frexp(max(matrix.data.max(), -matrix.data.min()))[1])
        if not np.isfinite(self._scale):
            raise SingularMatrixError("the matrix has values that are not finite")
        positive = condense(level, tangent, self._scale)
        if positive and (self._coarse is None or self._stale):
            self._build(level, tangent, positions)
        if self._coarse is None:
            raise SingularMatrixError("a diagonal block of the matrix is not positive definite")
        turns = np.empty(matrix.data[: len(positions)].shape)
        around = (matrix.indptr, matrix.indices, writable(self._built_at), writable(positions), self._held)
        run(multigrid.rotations, len(positions), *around, turns, (0.0,) * positions.shape[1])
        return Preconditioned(self, level, self._coarse, turns, self._scale, positive)

    def _room(self, matrix: SparseMatrix) -> Level:
        """Return the finest level, allocated for the sparsity of a tangent."""
        columns: ShortInts = matrix.indices
        if self._level is None or (columns is not self._columns and not np.array_equal(columns, self._columns)):
            self._level = empty_level(matrix.indptr, columns, matrix.blocksize[0], np.float32)
            self._columns = columns
        return self._level

    def _build(self, level: Level, tangent: Matrix, positions: Floats) -> None:
        """Build the coarse levels for a tangent at positions [m]."""
        modes = rigid_body_modes(positions).reshape(*positions.shape, -1)
        modes = np.where(self._held[:, :, None], 0.0, modes)
        self._coarse = build(level, tangent, self._scale, modes)
        self._built_at, self._stale = positions, False
        self.factorisations += 1
        self.memory = max(self.memory, self._coarse.n_bytes + level.n_bytes)

    def spent(self, iterations: int, digits: float) -> None:
        """Count iterations; mark the coarse levels as stale if they were many for this number of digits."""
        self.cg_iterations += iterations
        self._stale = self._stale or iterations > _STALE * max(digits, 2.0) / 2


@dataclass(frozen=True, eq=False)
class Preconditioned:
    """A tangent with its multigrid preconditioner, valid until the solver prepares the next one.

    Attributes:
        solver: solver that counts the iterations.
        level: finest level, the tangent times `scale`.
        coarse: coarse levels.
        turns: rotation of each node since they were built, shape (n_nodes, dim, dim).
        scale: factor of the tangent.
        positive: whether all diagonal blocks are positive definite.
    """

    solver: Multigrid
    level: Level
    coarse: Hierarchy
    turns: Floats
    scale: float
    positive: bool

    lasting: ClassVar[bool] = False

    def _precondition(self, r: Floats) -> Floats:
        """Return an approximate solution for a residual, shape (n_nodes, dim)."""
        return self.coarse.cycle(self.level, self.turns, r)

    def solve(self, right: Floats, accuracy: float = 1e-10) -> Floats:
        """Return x of tangent x = right [m], shape (n_nodes, dim), with a relative residual of at most `accuracy`.

        Raises IndefiniteError if a direction of negative curvature is found, SlowError if the accuracy is not reached;
        the coarse levels are then rebuilt for the next tangent.
        """
        if not self.positive:
            raise IndefiniteError("a diagonal block is not positive definite")
        if not right.any():
            return np.zeros(right.shape)
        system = (self.scale * right, accuracy, _MAX_ITERATIONS)
        try:
            found = conjugate_gradients(self.level.product, self._precondition, *system)
        except SlowError:
            self.solver.spent(_MAX_ITERATIONS, 0.0)
            raise
        self.solver.spent(found.iterations, -np.log10(accuracy))
        return found.solution

    @cached_property
    def negative_eigenvalues(self) -> int | None:
        """1 if the lowest eigenvalue is negative, else 0; None if it did not converge."""
        if not self.positive:
            return 1
        start = np.random.default_rng(5).normal(size=self.turns.shape[:2])
        found = lowest_eigenvalue(self.level.product, self._precondition, np.where(self.solver._held, 0.0, start))
        self.solver.lanczos_iterations += found.iterations
        return None if found.eigenvalue is None else int(found.eigenvalue < 0)

    def lowest_mode(self) -> None:
        """Return None: modes need a factorisation."""
        return
