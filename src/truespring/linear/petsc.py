"""Linear solver: conjugate gradients preconditioned by PETSc's algebraic multigrid GAMG, on one process or several.

Each process has the rows of its nodes. The iteration is that of `gradients`, with sums over the processes; PETSc has
the matrix and the preconditioner. Held directions get rows and columns of the identity.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any, ClassVar, NamedTuple

import numpy as np

from truespring.arrays import Bools, Floats, ShortInts
from truespring.errors import OneProcessError, one_line
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import SlowError, conjugate_gradients, lowest_eigenvalue, scalar_product
from truespring.memory import slices
from truespring.potential import SparseMatrix
from truespring.ranks import Layout
from truespring.rigid_modes import centred, modes_at

#: Python modules that the solver needs, and how to install them.
MODULES = ("mpi4py", "petsc4py")
INSTALL = "docs/large.md says how to install it (on Debian 12: apt-get install libpetsc-real3.18-dev, then make petsc)"

_MAX_ITERATIONS = 300
# Coarse levels are made anew if the iterations for two digits exceed this multiple of those after the last time.
_SLOWER = 1.5
# Memory of an entry of PETSc's matrices, its value and its column [bytes].
_ENTRY = 12
# Prefix of PETSc's options, and defaults for those that are not set.
_PREFIX = "truespring_"
_OPTIONS = {
    "pc_gamg_reuse_interpolation": True,
    "pc_gamg_esteig_ksp_type": "cg",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_pc_type": "jacobi",
    "mg_levels_ksp_max_it": 3,
}


class _Rows(NamedTuple):
    """Rows of the own nodes of a tangent.

    Attributes:
        starts: beginning of each row, shape (n_owned + 1,).
        columns: node of each block, shape (n_blocks,).
        data: [N/m], shape (n_blocks, dim, dim).
    """

    starts: ShortInts
    columns: ShortInts
    data: Floats


class Petsc:
    """Conjugate gradients preconditioned by PETSc's GAMG."""

    name = "PETSc (conjugate gradients, GAMG)"

    def __init__(self, held: Bools, layout: Layout) -> None:
        """Begin with the held directions, shape (n_nodes, dim), and the nodes of each process."""
        import petsc4py

        petsc4py.init(["truespring", "-no_signal_handler"], comm=layout.ranks.handle)
        from petsc4py import PETSc

        self.factorisations, self.cg_iterations, self.lanczos_iterations, self.memory = 0, 0, 0, 0
        self.held, self.layout, self.ranks = held, layout, layout.ranks
        self._library, self._comm = PETSc, layout.ranks.handle or PETSc.COMM_SELF
        self._matrix: Any = None
        self._preconditioner: Any = None
        # PETSc's vectors for operand and result.
        self.vectors: tuple[Any, ...] = ()
        self._starts: ShortInts = np.empty(0, np.int32)
        self._columns: ShortInts = np.empty(0, np.int32)
        self._first_pace, self._stale = 0.0, False
        PETSc.garbage_cleanup(
            self._comm
        )  # frees what former solvers left: objects that Python collects are only listed
        options = PETSc.Options(_PREFIX)
        for name, value in _OPTIONS.items():
            if not options.hasName(name):
                options.setValue(name, value)

    def ready(self, matrix: SparseMatrix, positions: Floats) -> "Preconditioned":
        """Prepare a tangent, shape (n_dof, n_dof), of which only the rows of the own nodes are used.

        Raises SingularMatrixError if values are not finite, or if no coarse levels exist.
        """
        largest = self.ranks.largest(self.ranks.together(lambda: float(np.abs(matrix.data).max(initial=0.0))))
        if not 0 < largest < np.inf:
            raise SingularMatrixError("the matrix is zero or has values that are not finite")
        scale = 2.0 ** -float(np.frexp(largest)[1])
        rows = self.ranks.together(lambda: self._own_rows(matrix))
        new = self.ranks.largest(float(self._new(rows)))
        try:
            if new:
                self._allocate(rows)
            self.ranks.together(lambda: self._fill(rows, scale))
            self._matrix.assemble()
            self._prepare(positions)
        except self._library.Error as error:
            if not self.ranks.is_on_all(error):
                raise OneProcessError(f"PETSc: {one_line(str(error))}") from error
            raise SingularMatrixError(f"PETSc: {error}") from None
        return Preconditioned(self, self._matrix, self._preconditioner, scale)

    def _own_rows(self, matrix: SparseMatrix) -> "_Rows":
        """Return the own rows of a tangent."""
        owned = self.layout.owned
        counts, data, columns = np.diff(matrix.indptr), matrix.data, matrix.indices
        if int(counts.sum()) > int(counts[owned].sum()):  # other rows are not empty
            own = np.repeat(self.layout.owner == self.ranks.rank, counts)
            data, columns = data[own], columns[own]
        counts = counts[owned]
        return _Rows(np.concatenate([[0], np.cumsum(counts, dtype=np.int32)], dtype=np.int32), columns, data)

    def _fill(self, given: "_Rows", scale: float) -> None:
        """Copy the own rows times `scale` to PETSc's matrix; nothing is exchanged."""
        owned, dim, (starts, columns, data) = self.layout.owned, self.held.shape[1], given
        row = self.layout.numbers[owned[0]]
        for part in slices(len(owned), 3 * 8 * dim * dim * max(len(columns) / len(owned), 1.0)):
            at = starts[part.start : part.stop + 1]
            inside = slice(int(at[0]), int(at[-1]))
            rows = owned[part]
            nodes = np.repeat(rows, np.diff(at))
            values = scale * data[inside]
            values *= ~self.held[nodes][:, :, None]
            values *= ~self.held[columns[inside]][:, None, :]
            own = np.flatnonzero(nodes == columns[inside])
            values[own] += self.held[rows][:, :, None] * np.eye(dim)
            numbers = np.arange(row + part.start, row + part.stop, dtype=np.int32)
            blocks = np.ascontiguousarray(values.transpose(0, 2, 1))
            self._matrix.setValuesBlockedIJV(at - at[0], self.layout.numbers[columns[inside]], blocks, rowmap=numbers)

    def _new(self, rows: "_Rows") -> bool:
        """Return whether the sparsity differs from that of the last matrix."""
        return not (np.array_equal(rows.starts, self._starts) and np.array_equal(rows.columns, self._columns))

    def _allocate(self, rows: "_Rows") -> None:
        """Make PETSc's matrix and vectors for a sparsity."""
        starts, columns, _ = rows
        dim, n_dof, n_own = self.held.shape[1], self.held.size, len(self.layout.owned) * self.held.shape[1]
        self._free()
        self._starts, self._columns = starts, columns.copy()
        inside = np.concatenate([[0], np.cumsum(self.layout.owner[columns] == self.ranks.rank)])
        own = np.diff(inside[starts]).astype(np.int32)
        others = np.diff(starts) - own
        self._matrix = self._library.Mat().create(self._comm)
        self._matrix.setSizes(((n_own, n_dof), (n_own, n_dof)))
        self._matrix.setBlockSize(dim)
        self._matrix.setType("aij")
        self._matrix.setPreallocationNNZ((np.repeat(dim * own, dim), np.repeat(dim * others, dim)))
        self._matrix.setOption(self._library.Mat.Option.ROW_ORIENTED, False)
        self._matrix.setOption(self._library.Mat.Option.SYMMETRIC, True)
        self.vectors = self._matrix.createVecs()

    def _prepare(self, positions: Floats) -> None:
        """Make the preconditioner, with new coarse levels if the last ones are missing or slow."""
        if self._preconditioner is not None and self.ranks.first(float(self._stale)):
            self._preconditioner.destroy()
            self._preconditioner = None
        building = self._preconditioner is None
        if building:
            self._set_rigid_body_modes(positions)
            self._preconditioner = self._library.PC().create(self._comm)
            self._preconditioner.setOptionsPrefix(_PREFIX)
            self._preconditioner.setType("gamg")
            self._preconditioner.setFromOptions()
            self._first_pace, self._stale = 0.0, False
        self._preconditioner.setOperators(self._matrix)
        self._preconditioner.setUp()
        if building:
            self.factorisations += 1
            self.memory = max(self.memory, int(self.ranks.sum(self._bytes())))

    def _set_rigid_body_modes(self, positions: Floats) -> None:
        """Make the rigid-body modes at positions [m] the near-null space of PETSc's matrix."""
        modes = modes_at(centred(positions)[self.layout.owned])
        vectors = []
        for mode in modes.T:
            vector = self._matrix.createVecRight()
            vector.array[:] = mode
            vectors.append(vector)
        for number, vector in enumerate(vectors):  # orthonormal, as PETSc requires
            for other in vectors[:number]:
                vector.axpy(-vector.dot(other), other)
            vector.normalize()
        space = self._library.NullSpace().create(vectors=vectors, comm=self._comm)
        self._matrix.setNearNullSpace(space)
        for one in (*vectors, space):  # the matrix keeps them
            one.destroy()

    def _bytes(self) -> float:
        """Return the memory of the matrices of all levels on this process [bytes]."""
        kept, local = self._preconditioner, self._library.Mat.InfoType.LOCAL
        levels = range(kept.getMGLevels())
        smoothers = [kept.getMGSmoother(level) for level in levels]
        operators = [smoother.getOperators() for smoother in smoothers]
        between = [kept.getMGInterpolation(level) for level in levels[1:]]
        matrices = [of_solution for of_solution, _ in operators] + between
        found = sum(_ENTRY * one.getInfo(local)["nz_allocated"] for one in matrices)
        for one in (*smoothers, *chain(*operators), *between):  # the preconditioner keeps them
            one.destroy()
        return float(found)

    def _free(self) -> None:
        """Free PETSc's memory."""
        for one in (self._preconditioner, self._matrix, *self.vectors):
            if one is not None:
                one.destroy()
        self._preconditioner, self._matrix, self.vectors = None, None, ()

    def spent(self, iterations: int, digits: float) -> None:
        """Count the iterations of a solution to `digits` digits; if there were many, replace the coarse levels."""
        self.cg_iterations += iterations
        pace = 2 * iterations / max(digits, 2.0)
        self._first_pace = self._first_pace or pace
        self._stale = pace > _SLOWER * self._first_pace

    def failed(self, iterations: int) -> None:
        """Count iterations that did not reach the accuracy; replace the coarse levels."""
        self.cg_iterations += iterations
        self._stale = True


@dataclass(frozen=True, eq=False)
class Preconditioned:
    """A tangent with its preconditioner, valid until the solver prepares the next one.

    Attributes:
        solver: solver that counts the iterations.
        matrix, preconditioner: PETSc's matrix, the tangent times `scale`, and its preconditioner.
        scale: factor of the tangent.
    """

    solver: Petsc
    matrix: Any
    preconditioner: Any
    scale: float

    lasting: ClassVar[bool] = False

    @cached_property
    def _held(self) -> Bools:
        """Held directions of the own nodes, shape (n_owned, dim)."""
        return np.asarray(self.solver.held[self.solver.layout.owned])

    def product(self, x: Floats, result: Floats) -> float:
        """Write the product of the matrix and x to `result`, shape (n_owned, dim) both; return x . A x of all nodes."""
        given, found = self.solver.vectors
        given.array[:] = x.ravel()
        self.matrix.mult(given, found)
        result[:] = found.array_r.reshape(x.shape)
        return self.solver.ranks.sum(scalar_product(x, result))

    def precondition(self, r: Floats) -> Floats:
        """Return an approximate solution for a residual, shape (n_owned, dim), zero in held directions."""
        given, found = self.solver.vectors
        given.array[:] = r.ravel()
        self.preconditioner.apply(given, found)
        return np.where(self._held, 0.0, found.array_r.reshape(r.shape))

    def solve(self, right: Floats, accuracy: float = 1e-10) -> Floats:
        """Return x of tangent x = right [m], shape (n_nodes, dim), with a relative residual of at most `accuracy`.

        Raises IndefiniteError if a direction of negative curvature is found, SlowError if the accuracy is not reached;
        the coarse levels are then made anew for the next tangent.
        """
        if not right.any():
            return np.zeros(right.shape)
        solver = self.solver
        system = (self.scale * right[solver.layout.owned], accuracy, _MAX_ITERATIONS, solver.ranks.sum)
        try:
            found = conjugate_gradients(self.product, self.precondition, *system)
        except SlowError as slow:
            solver.failed(_MAX_ITERATIONS)
            raise SlowError(self._of_all(slow.best)) from None
        solver.spent(found.iterations, -np.log10(accuracy))
        return self._of_all(found.solution)

    def _of_all(self, rows: Floats) -> Floats:
        """Return the values of all nodes, shape (n_nodes, dim), from those of the own ones, shape (n_owned, dim)."""
        whole = np.zeros(self.solver.held.shape)
        whole[self.solver.layout.owned] = rows
        return self.solver.ranks.joined(whole)

    @cached_property
    def negative_eigenvalues(self) -> int | None:
        """1 if the lowest eigenvalue is negative, else 0; None if it did not converge."""
        solver = self.solver
        start = np.random.default_rng(5).normal(size=solver.held.shape)[solver.layout.owned]
        start = np.where(self._held, 0.0, start)
        found = lowest_eigenvalue(self.product, self.precondition, start, solver.ranks.sum)
        solver.lanczos_iterations += found.iterations
        return None if found.eigenvalue is None else int(found.eigenvalue < 0)

    def lowest_mode(self) -> None:
        """Return None: modes need a factorisation."""
        return
