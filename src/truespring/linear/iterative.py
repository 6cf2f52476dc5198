"""Conjugate gradients with multigrid as a linear solver."""

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

# Coarse levels that need more iterations than this for two digits are built anew for the state at hand.
_STALE = 25
_MAX_ITERATIONS = 150


class Multigrid:
    """Conjugate gradients, preconditioned by multigrid whose coarse levels are frozen and turn with the body."""

    name = "multigrid"

    def __init__(self, nodes: Floats, held: Bools) -> None:
        """Take the reference positions [m] and the directions that are held, shape (n_nodes, dim) both."""
        self.factorisations, self.cg_iterations, self.lanczos_iterations, self.memory = 0, 0, 0, 0
        self._held = np.ascontiguousarray(held)
        self._level: Level | None = None
        self._columns: ShortInts = np.empty(0, np.int32)
        self._coarse: Hierarchy | None = None
        self._built_at = nodes
        self._scale = 1.0
        self._stale = False

    def ready(self, matrix: SparseMatrix, positions: Floats) -> "Preconditioned":
        """Take a tangent; the coarse levels are built for the first one, and again where they have grown stale."""
        from truespring.kernels import multigrid
        from truespring.kernels.threads import run, writable

        level, tangent = self._room(matrix), Matrix(matrix.indptr, matrix.indices, matrix.data, self._held)
        if self._coarse is None or self._stale:
            self._scale = 2.0 ** -float(np.frexp(max(matrix.data.max(), -matrix.data.min()))[1])
        if not np.isfinite(self._scale):
            raise SingularMatrixError("the matrix holds values that are not finite")
        positive = condense(level, tangent, self._scale)
        if positive and (self._coarse is None or self._stale):
            self._build(level, tangent, positions)
        if self._coarse is None:
            raise SingularMatrixError("the matrix is not positive on the directions of a single node")
        turns = np.empty(matrix.data[: len(positions)].shape)
        around = (matrix.indptr, matrix.indices, writable(self._built_at), writable(positions), self._held)
        run(multigrid.rotations, len(positions), *around, turns, (0.0,) * positions.shape[1])
        return Preconditioned(self, level, self._coarse, turns, self._scale, positive)

    def _room(self, matrix: SparseMatrix) -> Level:
        """The level that tangents are written to, made for their sparsity."""
        columns: ShortInts = matrix.indices
        if self._level is None or (columns is not self._columns and not np.array_equal(columns, self._columns)):
            self._level = empty_level(matrix.indptr, columns, matrix.blocksize[0], np.float32)
            self._columns = columns
        return self._level

    def _build(self, level: Level, tangent: Matrix, positions: Floats) -> None:
        modes = rigid_body_modes(positions).reshape(*positions.shape, -1)
        modes = np.where(self._held[:, :, None], 0.0, modes)
        self._coarse = build(level, tangent, self._scale, modes)
        self._built_at, self._stale = positions, False
        self.factorisations += 1
        self.memory = max(self.memory, self._coarse.n_bytes + level.n_bytes)

    def spent(self, iterations: int, digits: float) -> None:
        """Count iterations, and mark the coarse levels as stale where they were many for so many digits."""
        self.cg_iterations += iterations
        self._stale = self._stale or iterations > _STALE * max(digits, 2.0) / 2


@dataclass(frozen=True, eq=False)
class Preconditioned:
    """A tangent with its multigrid; good until the solver is given the next one."""

    solver: Multigrid
    level: Level
    coarse: Hierarchy
    turns: Floats
    scale: float
    positive: bool

    lasting: ClassVar[bool] = False

    def _precondition(self, r: Floats) -> Floats:
        return self.coarse.cycle(self.level, self.turns, r)

    def solve(self, right: Floats, accuracy: float = 1e-10) -> Floats:
        """Return the solution of matrix x = right; raise IndefiniteError where a negative direction is met.

        SlowError where the accuracy is not reached: the next tangent gets new coarse levels.
        """
        if not self.positive:
            raise IndefiniteError("a block of the diagonal is not positive")
        if not right.any():
            return np.zeros(right.shape)
        wanted = (self.scale * right, accuracy, _MAX_ITERATIONS)
        try:
            found = conjugate_gradients(self.level.product, self._precondition, *wanted)
        except SlowError:
            self.solver.spent(_MAX_ITERATIONS, 0.0)
            raise
        self.solver.spent(found.iterations, -np.log10(accuracy))
        return found.solution

    @cached_property
    def negative_eigenvalues(self) -> int | None:
        """0 or 1, that is any, by the sign of the lowest eigenvalue; None where that did not settle."""
        if not self.positive:
            return 1
        start = np.random.default_rng(5).normal(size=self.turns.shape[:2])
        found = lowest_eigenvalue(self.level.product, self._precondition, np.where(self.solver._held, 0.0, start))
        self.solver.lanczos_iterations += found.iterations
        return None if found.eigenvalue is None else int(found.eigenvalue < 0)

    def lowest_mode(self) -> None:
        """There is no way to it here: branching asks a factorisation."""
        return
