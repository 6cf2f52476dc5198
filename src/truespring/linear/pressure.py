"""Linear solver for nearly incompressible bodies: multigrid beside exact changes of volume.

The tangent T = A + B^T s B has a stiffness s against the change of volume of each cell, with the derivatives B of the
volumes. Where s is large, multigrid for T is slow: its coarse levels do not keep volumes. A, which keeps as much of s
as multigrid handles, is the tangent of a compressible body. Conjugate gradients for T are preconditioned by a sweep of
multigrid for A between two solutions with a simple matrix G in place of A,

    G x + B^T p = r,    B x - p / s = q,

which leave no change of volume that s resists: with p as the unknown, (B G^-1 B^T + 1 / s) p = B G^-1 r - q, a small
scalar problem like that of heat conduction. G are the diagonal blocks of A times a factor (Braess and Sarazin, Appl.
Numer. Math. 23, 1997, use this solution as a smoother). The iterations do not depend on s.

The part of s is positive semidefinite: T is stable if A is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, ShortInts
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import SlowError, conjugate_gradients, norm
from truespring.linear.iterative import Multigrid, Preconditioned
from truespring.linear.scalar import Scalar
from truespring.potential import SparseMatrix, VolumeStiffness

# Stiffness against a change of volume over that against shear: the part that stays in A; from which on A tells whether
# T is stable; and from which on the solutions above are worth their time.
_KEPT, _STIFF, _LARGE = 3.0, 20.0, 100.0
# Factor of the diagonal blocks in G: 2 G is larger than A.
_DAMPING = 1.5
# Largest residual beside the forces other than those of pressures.
_SHARE = 0.03
# Smallest accuracy of conjugate gradients at a time, and the largest number of iterations.
_LEAST, _MAX_ITERATIONS = 1e-6, 100


@dataclass(frozen=True)
class _Places:
    """Where the cells of one kind are in a matrix.

    Attributes:
        at_starts, at: the cells of each node, see Pattern.
        slots: index of the block of each pair of a cell's nodes, shape (n_cells, k, k).
    """

    at_starts: ShortInts
    at: ShortInts
    slots: ShortInts

    @classmethod
    def of(cls, elements: ShortInts, matrix: SparseMatrix) -> "_Places":
        """Find cells with nodes `elements`, shape (n_cells, k)."""
        from truespring.kernels import sparsity
        from truespring.kernels.threads import run

        slots = np.empty((*elements.shape, elements.shape[1]), np.int32)
        run(sparsity.fill_slots, len(elements), elements, matrix.indptr, matrix.indices, slots)
        starts, at = sparsity.incidence(elements, len(matrix.indptr) - 1)
        return cls(starts, at, slots)


class PressureMultigrid:
    """Multigrid that takes large stiffness against changes of volume apart, and is usual multigrid without such."""

    def __init__(
        self,
        nodes: Floats,
        held: Bools,
        interpolations: Sequence[Any],
        volumes: Callable[[Floats], Sequence[VolumeStiffness]],
    ) -> None:
        """Begin with nodes, held directions and interpolations as Multigrid does.

        `volumes` returns the stiffness of cells against a change of volume at positions [m], shape (n_nodes, dim).
        """
        self._held, self._volumes = held, volumes
        self._begin = (nodes, held, interpolations)
        self._multigrids: list[Multigrid] = []
        self._columns: ShortInts = np.empty(0, np.int32)
        self._places: tuple[_Places, ...] = ()
        self._values = np.empty(0)
        self._apart = False

    @property
    def name(self) -> str:
        """Name for notes and reports."""
        return f"{self._shear.name} with pressures" if self._apart else self._whole.name

    @cached_property
    def _whole(self) -> Multigrid:
        return self._counted()

    @cached_property
    def _shear(self) -> Multigrid:
        return self._counted()

    def _counted(self) -> Multigrid:
        """Return a multigrid whose costs count."""
        self._multigrids.append(Multigrid(*self._begin))
        return self._multigrids[-1]

    def ready(self, matrix: SparseMatrix, positions: Floats) -> "Preconditioned | Separated":
        """Prepare a tangent, shape (n_dof, n_dof), at `positions` [m]; raise SingularMatrixError as Multigrid does."""
        cells = tuple(self._volumes(positions))
        largest = max((float(np.max(one.stiffness / one.shear)) for one in cells), default=0.0)
        if not largest > _STIFF:
            return self.whole(matrix, positions)
        tangent = Separated(self, matrix, positions, cells, largest > _LARGE)
        if tangent.apart:
            self._apart = True
        else:
            _ = tangent.whole
        return tangent

    def whole(self, matrix: SparseMatrix, positions: Floats) -> Preconditioned:
        """Prepare a tangent for multigrid."""
        return self._whole.ready(matrix, positions)

    def sheared(
        self, matrix: SparseMatrix, positions: Floats, cells: Sequence[VolumeStiffness]
    ) -> "tuple[Preconditioned, Volumes] | None":
        """Prepare A, and return it with the stiffness of the volumes; None if a diagonal block is not positive."""
        excess = [np.maximum(one.stiffness - _KEPT * one.shear, 0.0) for one in cells]
        try:
            shear = self._shear.ready(self._without(matrix, cells, excess), positions)
        except SingularMatrixError:
            return None
        return None if shear.coarse is None else (shear, _volumes(cells, excess, self._held, shear))

    def spent(self, iterations: int, digits: float) -> None:
        """Count iterations for this number of digits."""
        self._shear.spent(iterations, digits)

    @property
    def factorisations(self) -> int:
        """The number of times that coarse levels were built, of both multigrids."""
        return sum(one.factorisations for one in self._multigrids)

    @property
    def cg_iterations(self) -> int:
        """The number of iterations of conjugate gradients, of both multigrids."""
        return sum(one.cg_iterations for one in self._multigrids)

    @property
    def lanczos_iterations(self) -> int:
        """The number of Lanczos iterations, of both multigrids."""
        return sum(one.lanczos_iterations for one in self._multigrids)

    @property
    def memory(self) -> int:
        """Largest memory of the coarse levels of both multigrids, and of the values of A [bytes]."""
        return sum(one.memory for one in self._multigrids) + self._values.nbytes

    def _without(
        self, matrix: SparseMatrix, cells: Sequence[VolumeStiffness], excess: Sequence[Floats]
    ) -> SparseMatrix:
        """Return a tangent without the stiffness `excess` of the cells, shape (n_cells,) for each kind."""
        from truespring.kernels import pressure
        from truespring.kernels.threads import run

        columns: ShortInts = matrix.indices
        if columns is not self._columns and not np.array_equal(columns, self._columns):
            self._places = tuple(_Places.of(one.elements, matrix) for one in cells)
            self._columns, self._values = columns, np.empty(matrix.data.shape)
        np.copyto(self._values, matrix.data)
        zero = (0.0,) * matrix.blocksize[0]
        for one, place, stiffness in zip(cells, self._places, excess, strict=True):
            known = (place.at_starts, place.at, place.slots, one.slope, stiffness, self._values, zero)
            run(pressure.subtract, len(self._held), *known, smallest=256)
        return sparse.bsr_array((self._values, matrix.indices, matrix.indptr), shape=matrix.shape)


@dataclass(frozen=True, eq=False)
class Volumes:
    """Changes of volume, and their stiffness.

    Attributes:
        slopes: B, sparse, shape (n_volumes, n_dof), zero in held directions.
        stiffness: s times the scale of the tangent, shape (n_volumes,).
        smoothing: G^-1, sparse, shape (n_dof, n_dof).
    """

    slopes: Any
    stiffness: Floats
    smoothing: Any

    @cached_property
    def _scalar(self) -> Scalar:
        """The matrix B G^-1 B^T + 1 / s."""
        return Scalar(self.slopes @ self.smoothing @ self.slopes.T + sparse.diags_array(1 / self.stiffness))

    def forces(self, x: Floats) -> Floats:
        """Return B^T s B x, shape (n_nodes, dim)."""
        return np.asarray(self.slopes.T @ (self.stiffness * (self.slopes @ x.ravel()))).reshape(x.shape)

    def balanced(self, r: Floats, q: Floats) -> tuple[Floats, Floats]:
        """Return x, shape (n_nodes, dim), and the forces B^T p of G x + B^T p = r, B x - p / s = q."""
        free = self.smoothing @ r.ravel()
        forces = self.slopes.T @ self._scalar.solve(self.slopes @ free - q)
        return (free - self.smoothing @ forces).reshape(r.shape), np.asarray(forces).reshape(r.shape)


def _volumes(cells: Sequence[VolumeStiffness], excess: Sequence[Floats], held: Bools, shear: Preconditioned) -> Volumes:
    """Return the changes of volume of the cells whose `excess` is not zero, with G of a tangent A."""
    n_nodes, dim = held.shape
    values, columns, lengths, stiffness = [], [], [], []
    for one, beyond in zip(cells, excess, strict=True):
        chosen = np.flatnonzero(beyond)
        nodes = one.elements[chosen]
        values.append(np.where(held[nodes], 0.0, one.slope[chosen]).ravel())
        columns.append((nodes[:, :, None] * dim + np.arange(dim)).ravel())
        lengths.append(np.full(len(chosen), nodes.shape[1] * dim))
        stiffness.append(shear.scale * beyond[chosen])
    starts = np.concatenate([[0], np.cumsum(np.concatenate(lengths))])
    slopes = sparse.csr_array(
        (np.concatenate(values), np.concatenate(columns), starts), shape=(len(starts) - 1, held.size)
    )
    blocks = shear.level.inverse.astype(np.float64) / _DAMPING
    smoothing = sparse.bsr_array((blocks, np.arange(n_nodes), np.arange(n_nodes + 1)), shape=(held.size, held.size))
    return Volumes(slopes, np.concatenate(stiffness), sparse.csr_array(smoothing))


@dataclass(frozen=True, eq=False)
class Separated:
    """A tangent with the stiffness of the volumes apart, valid until the solver prepares the next one.

    Attributes:
        solver: solver that counts the iterations.
        matrix, positions: the tangent, and where it is.
        cells: the stiffness against changes of volume.
        apart: whether systems are solved with the volumes apart; else only stability is determined with them.
    """

    solver: PressureMultigrid
    matrix: SparseMatrix
    positions: Floats
    cells: tuple[VolumeStiffness, ...]
    apart: bool

    lasting: ClassVar[bool] = False

    @cached_property
    def whole(self) -> Preconditioned:
        """The tangent for multigrid."""
        return self.solver.whole(self.matrix, self.positions)

    @cached_property
    def _parts(self) -> tuple[Preconditioned, Volumes] | None:
        return self.solver.sheared(self.matrix, self.positions, self.cells)

    def solve(self, right: Floats, accuracy: float = 1e-10) -> Floats:
        """Return x of tangent x = right [m], shape (n_nodes, dim), with a relative residual of at most `accuracy`.

        Raises IndefiniteError if a direction of negative curvature is found, SlowError if the accuracy is not reached.
        """
        if not right.any():
            return np.zeros(right.shape)
        if not self.apart or self._parts is None:  # parts are built when they are asked for
            return self.whole.solve(right, accuracy)
        r = self._parts[0].scale * right
        x, left, spent, target = np.zeros(r.shape), r, 0, accuracy * norm(r)
        try:
            while norm(left) > target:
                share = max(target / norm(left) / 2, _LEAST)
                found = conjugate_gradients(self._product, self._precondition, left, share, _MAX_ITERATIONS - spent)
                x, spent = x + found.solution, spent + found.iterations
                self._parts[0].level.product(x, image := np.empty(r.shape))
                left = r - image - self._parts[1].forces(x)
                # Pressures may nearly balance r, as where a support moves: the other forces are to be accurate, too.
                target = min(accuracy * norm(r), _SHARE * norm(image))
        except SlowError as slow:
            self.solver.spent(_MAX_ITERATIONS, 0.0)
            raise SlowError(x + slow.best) from None
        self.solver.spent(spent, -np.log10(accuracy))
        return x

    def _product(self, x: Floats, result: Floats) -> float:
        """Write T x to `result` and return x . T x."""
        assert self._parts is not None
        shear, volumes = self._parts
        shear.level.product(x, result)
        result += volumes.forces(x)
        return float((x * result).sum())

    def _precondition(self, r: Floats) -> Floats:
        """Return an approximate solution for a residual, shape (n_nodes, dim)."""
        assert self._parts is not None
        shear, volumes = self._parts
        first, forces = volumes.balanced(r, np.zeros(len(volumes.stiffness)))
        shear.level.product(first, image := np.empty(r.shape))
        left = r - image - forces
        middle = shear.precondition(left)
        shear.level.product(middle, image)
        last, _ = volumes.balanced(left - image, -(volumes.slopes @ middle.ravel()))
        return first + middle + last

    @cached_property
    def negative_eigenvalues(self) -> int | None:
        """0 if the lowest eigenvalue of A is positive, else as multigrid finds it for the whole tangent."""
        found = None if self._parts is None else self._parts[0].negative_eigenvalues
        return self.whole.negative_eigenvalues if found != 0 else found

    def lowest_mode(self) -> None:
        """Return None: modes need a factorisation."""
        return
