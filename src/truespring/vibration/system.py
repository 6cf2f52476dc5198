"""The eigenvalue problem K u = omega^2 M u of a body at rest, in x = M^1/2 u of the free directions."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints
from truespring.conditions import Refined
from truespring.equilibrium import coarse_weights
from truespring.errors import ModelError, ProblemError
from truespring.linear import LinearSolver, choose
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import IndefiniteError, SlowError
from truespring.potential import Potential, SparseMatrix, volumes_of, with_diagonal
from truespring.problem import Problem
from truespring.rigid_modes import centred, modes_at
from truespring.vibration.eigen import Matrix, size_of

# Motions of less than this share of the largest stiffness or size are zero.
_ZERO = 1e-8
# Share of the mass matrix, over the largest stiffness per mass, that makes the stiffness of a free body invertible.
_SHIFT = 1e-10
# Accuracy of linear systems that precondition: fewer cycles of multigrid than with more accurate ones, by a third.
_ACCURACY = 0.5


@dataclass(frozen=True, eq=False)
class System:
    """Stiffness and mass of a body at rest.

    Attributes:
        stiffness: of all directions [N/m], in blocks of shape (dim, dim), shape (n_dof, n_dof).
        mass: of each node [kg], shape (n_nodes,).
        nodes: undeformed positions [m], shape (n_nodes, dim).
        held: true in directions that supports hold, shape (n_nodes, dim).
        matrix: M^-1/2 K M^-1/2 of the free directions [1/s^2], shape (n_free, n_free).
        rigid: M^1/2 times the rigid-body motions that supports leave, orthonormal, shape (n_free, n_rigid).
        unbalanced: largest internal force in a free direction [N] over the largest stiffness times the body's size.
    """

    stiffness: SparseMatrix
    mass: Floats
    nodes: Floats
    held: Bools
    matrix: Matrix
    rigid: Floats
    unbalanced: float

    @property
    def root(self) -> Floats:
        """M^1/2 of the free directions [kg^1/2], shape (n_free,)."""
        return _root(self.mass, self.held)

    def shapes(self, vectors: Floats) -> Floats:
        """Return u = M^-1/2 x [kg^-1/2] of vectors x, shape (n_free, k), as shape (k, n_nodes, dim)."""
        found = np.zeros((vectors.shape[1], *self.held.shape))
        found[:, ~self.held] = (vectors / self.root[:, None]).T
        return found

    def inverse(self, problem: Problem, potential: Potential, linear: str) -> Callable[[Floats], Floats]:
        """Return a function that solves `matrix` x = right approximately, for right sides of shape (n_free, k).

        A small share of the mass is added to the stiffness. `linear` is a name of `linear.choose`.
        """
        shift = _SHIFT * float(self.matrix.diagonal().max())
        dim = self.held.shape[1]
        shifted = with_diagonal(self.stiffness, shift * self.mass[:, None, None] * np.eye(dim))
        solver = choose(
            linear, self.nodes, self.held, lambda: coarse_weights(problem, potential), volumes_of(potential)
        )
        one = _Inverse(shifted, self.nodes, self.held, solver)
        root = self.root

        def solve(right: Floats) -> Floats:
            found = np.empty(right.shape)
            for column, values in enumerate(right.T):
                force = np.zeros(self.held.shape)
                force[~self.held] = root * values
                found[:, column] = root * one(force)[~self.held]
            return found

        return solve


class _Inverse:
    """Approximate solutions with one matrix: by a linear solver, or factorised where that fails."""

    def __init__(self, matrix: SparseMatrix, nodes: Floats, held: Bools, solver: LinearSolver) -> None:
        self._matrix, self._nodes, self._held = matrix, nodes, held
        try:
            self._tangent = solver.ready(matrix, nodes)
        except SingularMatrixError:
            self._factorise()

    def _factorise(self) -> None:
        self._tangent = choose("direct", self._nodes, self._held).ready(self._matrix, self._nodes)

    def __call__(self, force: Floats) -> Floats:
        """Return the displacement of a force [N], both of shape (n_nodes, dim)."""
        try:
            return self._tangent.solve(force, _ACCURACY)
        except SlowError as slow:
            return slow.best
        except IndefiniteError:
            self._factorise()
            return self._tangent.solve(force, _ACCURACY)


def system_of(problem: Problem, potential: Potential) -> System:
    """Return stiffness and mass of a potential at rest.

    Raises ProblemError without a density, or if all directions are held; ModelError if a node has no mass, or if the
    stiffness is not finite.
    """
    if problem.body.density is None:
        raise ProblemError("modes need a mass: set density [kg/m^3] of the material and of each region")
    if isinstance(potential, Refined):
        held, mass = potential.loading.held, potential.lumped_mass()
    else:
        held, mass = problem.loading.held, problem.mass
    nodes = potential.nodes
    if mass.shape != (len(nodes),):
        raise ModelError(f"the potential has {len(nodes)} nodes, the body {len(mass)}: their mass is not known")
    if held.all():
        raise ProblemError("all nodes are held in all directions: nothing vibrates")
    if not mass[~held.all(axis=1)].min() > 0:
        raise ModelError(f"node {int(mass.argmin())} is free and has no mass: remove it, or join it to an element")
    stiffness = in_blocks(potential.hessian(nodes), nodes.shape[1])
    if not np.isfinite(stiffness.data).all():
        raise ModelError("the stiffness of the undeformed body is not finite")
    free = np.flatnonzero(~held.ravel())
    scale = sparse.diags_array(1 / _root(mass, held))
    matrix: Matrix = sparse.csr_array(scale @ sparse.csr_array(stiffness)[free][:, free] @ scale)
    force = np.abs(potential.gradient(nodes)[~held]).max()
    size = float(np.linalg.norm(np.ptp(nodes, axis=0))) * float(np.abs(stiffness.data).max())
    return System(
        stiffness, mass, nodes, held, matrix, _rigid(nodes, stiffness, mass, held, matrix), float(force) / (size or 1.0)
    )


def in_blocks(matrix: SparseMatrix, dim: int) -> SparseMatrix:
    """Return a matrix of shape (n_dof, n_dof) in sorted blocks of shape (dim, dim), with all blocks of the diagonal."""
    if matrix.format != "bsr" or matrix.blocksize != (dim, dim):
        matrix = sparse.bsr_array(
            sparse.csr_array(matrix) + 0 * sparse.eye_array(matrix.shape[0]), blocksize=(dim, dim)
        )
        matrix.sort_indices()
    return matrix


def _root(mass: Floats, held: Bools) -> Floats:
    """Return the square root of the mass of each free direction, shape (n_free,)."""
    return np.asarray(np.sqrt(np.broadcast_to(mass[:, None], held.shape)[~held]))


def _rigid(nodes: Floats, stiffness: SparseMatrix, mass: Floats, held: Bools, matrix: Matrix) -> Floats:
    """Return the rigid-body motions that supports leave, times M^1/2, orthonormal, shape (n_free, n_rigid).

    Parts that no stiffness connects move each for itself. A motion that has a stiffness, as a turn of a body that is
    not in equilibrium at rest, is none.
    """
    number = np.full(held.shape, -1)
    number[~held] = np.arange(int((~held).sum()))
    found = [np.zeros((matrix.shape[0], 0))]
    for part in _parts(stiffness):
        motions = modes_at(centred(nodes[part])).reshape(len(part), nodes.shape[1], -1)
        left = motions[~held[part]] @ _kernel(motions[held[part]])
        scaled = np.sqrt(np.broadcast_to(mass[part, None], held[part].shape)[~held[part]])[:, None] * left
        basis = np.zeros((matrix.shape[0], scaled.shape[1]))
        basis[number[part][~held[part]]] = scaled
        found.append(_span(basis))
    whole = np.concatenate(found, axis=1)
    forces = matrix @ whole
    return whole @ _kernel(np.linalg.qr(forces)[1], size_of(matrix)) if whole.shape[1] else whole


def _parts(stiffness: SparseMatrix) -> list[Ints]:
    """Return the nodes of each part that blocks of a matrix connect."""
    from scipy.sparse.csgraph import connected_components

    n_nodes = len(stiffness.indptr) - 1
    linked = np.abs(stiffness.data).max(axis=(1, 2)) > 0
    graph = sparse.csr_array((linked, stiffness.indices, stiffness.indptr), shape=(n_nodes, n_nodes))
    graph.eliminate_zeros()
    parts = connected_components(graph, directed=False)[1]
    order = np.argsort(parts, kind="stable")
    return [np.asarray(one) for one in np.split(order, np.flatnonzero(np.diff(parts[order])) + 1)]


def _kernel(rows: Floats, size: float = 0.0) -> Floats:
    """Return orthonormal combinations of the columns that vanish in all rows, shape (n_columns, k).

    Zero is below a share of the largest singular value, or of `size`.
    """
    n = rows.shape[1]
    if not len(rows):
        return np.eye(n)
    _, values, vectors = np.linalg.svd(rows, full_matrices=len(rows) < n)
    rank = int((values > _ZERO * max(size, float(values.max(initial=0.0)))).sum())
    return np.asarray(vectors[rank:].T)


def _span(columns: Floats) -> Floats:
    """Return an orthonormal basis of the span of columns, shape (n, k)."""
    if not columns.shape[1]:
        return columns
    vectors, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(vectors[:, values > _ZERO * values.max(initial=0.0)])
