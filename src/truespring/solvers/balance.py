"""Balance of forces at one load level: residuals, tangents, and the criteria of convergence."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.conditions import Loading, Touch
from truespring.dynamics import Moving
from truespring.errors import ProblemError
from truespring.linear.choice import LinearSolver, Tangent, choose
from truespring.linear.direct import Direct, SingularMatrixError
from truespring.linear.gradients import IndefiniteError, SlowError, norm
from truespring.potential import Potential, Projectable, Scaled, SparseMatrix, Unstressed, with_diagonal
from truespring.ranks import ranks_of
from truespring.solvers.cost import Cost

#: Called after each iteration with load factor, iteration and relative residual.
Reporter = Callable[[float, int, float], None]

_EPS = float(np.finfo(float).eps)
# A residual within this factor of the best one counts as equally good.
_NEAR_BEST = 10.0
# Rounding errors are estimated for bodies up to this multiple of their undeformed size.
_LARGEST_STRETCH = 100.0
# An iterate that moved by more than this multiple of the body's size has diverged: its energies overflow.
_LOST = 1e8
# Relative accuracy of linear systems: usual, and finest, used only if it ends the iteration.
_ACCURACY, _FINEST_ACCURACY = 2e-3, 1e-5


@dataclass(frozen=True)
class Equilibrium:
    """A state at one load level: an equilibrium if `converged`, else the state of least residual.

    Attributes:
        load_factor: share of the full load [-].
        positions: [m], shape (n_nodes, dim).
        internal_force: gradient of the potential [N], shape (n_nodes, dim).
        external_force: force of the loads at the state [N], shape (n_nodes, dim).
        energy: stored elastic energy [J].
        iterations: number of Newton iterations, including attempts with larger steps that failed.
        residual: unbalanced force over the larger of external and internal force [-].
        converged: whether it is an equilibrium.
        negative_eigenvalues: number of negative eigenvalues of the tangent on the free directions: 0 if stable, None if
            not known.
        branched: true if the solver left an unstable equilibrium for a stable one nearby.
        snapped: true if the body moved much further than the previous step suggests.
        critical: "limit point" or "bifurcation" if stability changes at this state, else None.
        mode: buckling mode of a critical point, largest component 1 [-], shape (n_nodes, dim); None of other states.
        level: share of the controlled quantity, 0 to 1; None if that is the load factor.
        reason: why the solver did not look for an equilibrium, else empty.
        touches: what each tool and grasp does.
        moving: time, velocity and energies of a state of a motion, None at rest.
        cost: methods and costs up to this state.
    """

    load_factor: float
    positions: Floats
    internal_force: Floats
    external_force: Floats
    energy: float
    iterations: int
    residual: float
    converged: bool
    negative_eigenvalues: int | None = None
    branched: bool = False
    snapped: bool = False
    critical: str | None = None
    mode: Floats | None = None
    level: float | None = None
    reason: str = ""
    touches: tuple[Touch, ...] = ()
    moving: Moving | None = None
    cost: Cost | None = None


class Found(NamedTuple):
    """A state and its factorised tangent, None if it was not factorised or the state is no equilibrium."""

    state: Equilibrium
    tangent: Tangent | None = None


@dataclass(eq=False)
class Balance:
    """Balance of forces of a potential under a loading.

    Forces and steps have the shape of the positions, (n_nodes, dim), and are zero in held directions.

    Attributes:
        potential, loading: the potential and its loading.
        tolerance: relative residual below which a state is in equilibrium [-].
        max_iterations: largest number of Newton iterations at one level.
        linear: solver of the linear systems.
        report: called after each iteration.
        notes: changes of method, and their reasons.
        spent: number of Newton iterations at all levels.
        free: true for free directions, shape (n_nodes, dim).
        size: diagonal of the undeformed body's bounding box [m].
        ranks: the processes that share the potential: matrices have the rows of each, all else is that of all nodes.
        judges: whether the stability of equilibria is determined.
    """

    potential: Potential
    loading: Loading
    tolerance: float
    max_iterations: int
    linear: LinearSolver
    report: Reporter | None = None
    notes: list[str] = field(default_factory=list)
    spent: int = 0
    judges: bool = True

    def __post_init__(self) -> None:
        self.free = ~self.loading.held
        self.ranks = ranks_of(self.potential)
        self.size = float(np.linalg.norm(np.ptp(self.potential.nodes, axis=0)))

    def total_energy(self, positions: Floats, load_factor: float) -> tuple[float, float]:
        """Return stored energy minus the work of the loads that have a potential, and the sum of their sizes [J]."""
        with np.errstate(over="ignore", invalid="ignore"):
            stored = self.potential.energy(positions)
        work = self.loading.dead_force(load_factor) * (positions - self.potential.nodes)
        following = list(self.loading.energies(positions, load_factor))
        total = stored - float(work.sum()) + sum(following)
        size = abs(stored) + float(np.abs(work).sum()) + sum(map(abs, following))
        return self.ranks.first(total), self.ranks.first(size)

    def force(self, positions: Floats, load_factor: float) -> Floats:
        """Return the unbalanced force [N], zero in held directions, shape (n_nodes, dim)."""
        applied = self.loading.force(positions, load_factor)
        return self.unbalanced(self.potential.gradient(positions), applied)[0]

    def unbalanced(self, internal: Floats, applied: Floats) -> tuple[Floats, float]:
        """Return the unbalanced force [N], zero in held directions, shape (n_nodes, dim), and its scale [N]."""
        scale = max(self.norm(applied), self.norm(internal))
        if isinstance(self.potential, Scaled):
            scale = max(scale, self.potential.force_scale())
        return np.where(self.free, internal - applied, 0.0), scale

    def norm(self, vector: Floats) -> float:
        """Return the Euclidean norm of a vector of all nodes, shape (n_nodes, dim), the same on all processes."""
        return self.ranks.first(norm(vector))

    def scalar_product(self, one: Floats, other: Floats) -> float:
        """Return the scalar product of vectors of all nodes, shape (n_nodes, dim), the same on all processes."""
        return self.ranks.first(float((one * other).sum()))

    def hessian(self, positions: Floats, load_factor: float, *stress: Floats) -> SparseMatrix:
        """Return the tangent [N/m] with that of following loads, tools and grasps, in blocks of shape (dim, dim).

        Shape (n_dof, n_dof). It is not symmetric under loads without a potential, see Loading.symmetric.

        `stress` is passed on to the potential, see Stressed.hessian.
        """
        tangent = self.in_blocks(self.potential.hessian(positions, *stress))
        for following in self.loading.tangents(positions, load_factor):
            tangent = self.in_blocks(tangent + following)
        for one in self.loading.interactions:
            nodes, blocks = one.blocks(positions, load_factor)
            tangent = with_diagonal(tangent, blocks, nodes)
        return tangent

    def projected(self, positions: Floats, load_factor: float) -> SparseMatrix | None:
        """Return the projected Hessian of the potential plus the positive part of that of tools and grasps [N/m].

        None if the potential has none.
        """
        if not isinstance(self.potential, Projectable):
            return None
        tangent = self.in_blocks(self.potential.projected_hessian(positions))
        for one in self.loading.interactions:
            nodes, blocks = one.blocks(positions, load_factor)
            values, axes = np.linalg.eigh(blocks)
            tangent = with_diagonal(tangent, axes * np.maximum(values, 0.0)[:, None] @ axes.swapaxes(1, 2), nodes)
        return tangent

    def in_blocks(self, matrix: SparseMatrix) -> SparseMatrix:
        """Return a matrix of shape (n_dof, n_dof) in blocks of shape (dim, dim)."""
        dim = self.free.shape[1]
        if matrix.format == "bsr" and matrix.blocksize == (dim, dim):
            return matrix
        blocks = sparse.bsr_array(matrix, blocksize=(dim, dim))
        blocks.sort_indices()
        return blocks

    def product(self, matrix: SparseMatrix, motion: Floats) -> Floats:
        """Return a matrix times a displacement [m], shape (n_nodes, dim)."""
        return self.ranks.joined((matrix @ motion.ravel()).reshape(motion.shape))

    def diagonal(self, matrix: SparseMatrix) -> Floats:
        """Return the diagonal of a matrix, shape (n_nodes, dim)."""
        return self.ranks.joined(matrix.diagonal().reshape(self.free.shape))

    def is_finite(self, matrix: SparseMatrix) -> bool:
        """Return whether the values of a matrix and their sum are finite."""
        return bool(np.isfinite(self.ranks.sum(float(matrix.data.sum()))))

    def accuracy(self, residual: float) -> float:
        """Return the relative accuracy for a linear system at a relative residual of the balance."""
        last = self.tolerance / residual / 3 if residual else 1.0
        return last if _FINEST_ACCURACY <= last <= _ACCURACY else _ACCURACY

    def rounding(self, tangent: SparseMatrix, positions: Floats) -> float:
        """Return the unbalanced force due to rounding errors of the positions [N], a lower bound of the residual.

        Positions beyond _LARGEST_STRETCH times the undeformed size do not increase it: they come from divergence.
        """
        from truespring.kernels import blocks
        from truespring.kernels.threads import run

        centred = np.minimum(np.abs(positions - positions.mean(axis=0)), _LARGEST_STRETCH * self.size)
        rows, zero = (tangent.indptr, tangent.indices, tangent.data), (0.0,) * centred.shape[1]
        squares = run(blocks.rounding, len(centred), *rows, centred, self.loading.held, zero)
        return 8 * _EPS * float(np.sqrt(self.ranks.sum(float(sum(squares)))))

    def judged(self, state: Equilibrium) -> Found:
        """Return an equilibrium with its stability, and the tangent if it was factorised.

        Stability is not determined under loads without a potential.
        """
        if not self.judges:
            return Found(state)
        if not self.free.any():
            return Found(replace(state, negative_eigenvalues=0))
        if not self.loading.has_potential(state.load_factor):
            return Found(replace(state, negative_eigenvalues=None))
        if not isinstance(self.linear, Direct) and self._stable_at_rest(state):
            return Found(replace(state, negative_eigenvalues=0))
        try:
            tangent = self.ready(self.hessian(state.positions, state.load_factor), state.positions)
        except SingularMatrixError:
            return Found(replace(state, negative_eigenvalues=None))
        negative = tangent.negative_eigenvalues
        if negative is None and not tangent.lasting and self.go_direct("stability was not determined"):
            return self.judged(state)
        judged = replace(state, negative_eigenvalues=negative)
        return Found(judged, tangent if tangent.lasting else None)

    def _stable_at_rest(self, state: Equilibrium) -> bool:
        """Return whether a state is the undeformed one without load, and the potential knows that it is stable."""
        at_rest = state.positions is self.potential.nodes and self.loading.vanishes(state.load_factor, state.positions)
        return at_rest and isinstance(self.potential, Unstressed) and self.potential.semidefinite_at_rest

    def ready(self, matrix: SparseMatrix, positions: Floats) -> Tangent:
        """Return a tangent prepared for solving, factorised if multigrid has no coarse levels for it.

        Raises SingularMatrixError if the tangent has no inverse.
        """
        try:
            return self.linear.ready(matrix, positions)
        except SingularMatrixError:
            if isinstance(self.linear, Direct) or not self.go_direct("no coarse levels could be built"):
                raise
            return self.linear.ready(matrix, positions)

    def factorised(self, found: Found) -> Found:
        """Return an equilibrium with its tangent factorised, if that fits in memory."""
        if found.tangent is not None:
            return found
        return self.judged(found.state) if self.go_direct("an unstable state was found") else found

    def go_direct(self, reason: str) -> bool:
        """Use factorisations from now on; return whether they fit in memory and one process has the whole matrix."""
        if self.ranks.size > 1:
            self.note(f"{reason}: a factorisation would help, but needs one process")
            return False
        try:
            directly = choose("direct", self.potential.nodes, self.loading.held, symmetric=self.loading.symmetric)
        except ProblemError:
            self.note(f"{reason}: a factorisation would help, but does not fit in memory")
            return False
        assert isinstance(directly, Direct)
        self.note(f"{reason}: {directly.name} from then on instead of {self.linear.name}")
        before = self.linear
        directly.cg_iterations, directly.lanczos_iterations = before.cg_iterations, before.lanczos_iterations
        directly.factorisations, directly.memory = before.factorisations, before.memory
        self.linear = directly
        return True

    def cost(self, newton: str, coarse: tuple[Cost, ...] = ()) -> Cost:
        """Return methods and costs up to now; `newton` names the variant of Newton's method."""
        from truespring.kernels.threads import n_threads

        return Cost(
            newton=newton,
            linear=self.linear.name,
            newton_iterations=self.spent,
            cg_iterations=self.linear.cg_iterations,
            lanczos_iterations=self.linear.lanczos_iterations,
            factorisations=self.linear.factorisations,
            memory=self.linear.memory,
            threads=n_threads(),
            notes=tuple(self.notes),
            coarse=coarse,
        )

    def note(self, text: str) -> None:
        """Add a note, unless it is there already."""
        if text not in self.notes:
            self.notes.append(text)


class Watch:
    """Monitor an iteration at one level: keep the state of least residual, decide on convergence."""

    def __init__(self, balance: Balance, load_factor: float, positions: Floats) -> None:
        """Begin at a load factor and positions [m], shape (n_nodes, dim)."""
        self._balance, self.load_factor = balance, load_factor
        nowhere = np.full_like(positions, np.nan)
        self.best = Equilibrium(load_factor, positions, nowhere, nowhere, np.inf, 0, np.inf, converged=False)
        self.force: Floats = nowhere
        self.residual = np.inf
        #: Whether the unbalanced force is below rounding errors.
        self.below_rounding = False
        self._size, self._scale, self._size_before, self._noise = np.inf, 0.0, np.inf, False
        self._here, self._best_size = self.best, np.inf

    def at(self, positions: Floats, iteration: int, held_moved: bool = True) -> bool:
        """Evaluate a state; return False if the iteration has diverged.

        `held_moved` is false as long as held nodes lack their prescribed motion: such a state is never the best one.
        """
        if not np.abs(positions - self._balance.potential.nodes).max() <= _LOST * self._balance.size:
            return False
        internal = self._balance.potential.gradient(positions)
        applied = self._balance.loading.force(positions, self.load_factor)
        self.force, self._scale = self._balance.unbalanced(internal, applied)
        self._size = self._balance.norm(self.force)
        self.residual = self._size / self._scale if self._scale else 0.0
        if self._balance.report:
            self._balance.report(self.load_factor, iteration, self.residual)
        self._here = replace(
            self.best,
            load_factor=self.load_factor,
            positions=positions,
            internal_force=internal,
            external_force=applied,
            residual=self.residual,
            iterations=iteration,
        )
        if held_moved and self.residual < self.best.residual:
            self.best, self._best_size = self._here, self._size
        self.best = replace(self.best, iterations=iteration)
        return bool(np.isfinite(self.residual))

    @property
    def within_tolerance(self) -> bool:
        """Whether the last state evaluated is in equilibrium up to the tolerance."""
        return self._size <= self._balance.tolerance * self._scale

    def balanced(self, tangent: SparseMatrix, positions: Floats) -> bool:
        """Return whether the last state evaluated is in equilibrium.

        A force below rounding errors ends the iteration only if the residual is near the best one (else it has
        diverged), and if another step does not reduce it (else it may be the force of a small load).
        """
        rounding = self._balance.rounding(tangent, positions)
        below = self._size <= rounding
        self.below_rounding = below and self.residual <= _NEAR_BEST * self.best.residual
        loading = self._balance.loading
        unloaded = loading.vanishes(self.load_factor, positions)
        unloaded |= bool(loading.interactions) and self._scale <= rounding  # a tool that only just touches
        self._noise = unloaded and self.below_rounding
        noise = self._noise or (self.below_rounding and self._size > self._size_before / 2)
        self._size_before = self._size if self.below_rounding else np.inf
        return noise or self.within_tolerance

    def equilibrium(self) -> Found:
        """Return the last state evaluated, or an earlier one of less unbalanced force, as converged.

        Compares forces, not residuals: if all forces vanish, as in a body moved as a whole, their ratio is noise. Where
        nothing acts the residual is zero.
        """
        state = self.best if self._best_size < self._size else self._here
        if self._noise:
            state = replace(state, residual=0.0)
        energy = self._balance.potential.energy(state.positions)
        self._balance.spent += state.iterations
        touches = self._balance.loading.touches(state.positions, state.load_factor)
        return self._balance.judged(replace(state, energy=energy, converged=True, touches=touches))

    def last(self) -> Equilibrium:
        """Return the last state evaluated, as not converged."""
        self._balance.spent += self._here.iterations
        return self._here

    def failure(self) -> Found:
        """Return the state of least residual, as not converged."""
        self._balance.spent += self.best.iterations
        with np.errstate(over="ignore", invalid="ignore"):
            return Found(replace(self.best, energy=self._balance.potential.energy(self.best.positions)))


class Stepped(NamedTuple):
    """A Newton step [m], shape (n_nodes, dim), and the tangent that it was computed by."""

    step: Floats
    tangent: Tangent


def stepped(
    balance: Balance, tangent: SparseMatrix, positions: Floats, right: Floats, accuracy: float
) -> Floats | None:
    """Return the solution of tangent x = right [m], shape (n_nodes, dim).

    None if the tangent is singular, or not positive definite although all loads have potentials.
    """
    found = stepped_by(balance, tangent, positions, right, accuracy)
    return None if found is None else found.step


def stepped_by(
    balance: Balance, tangent: SparseMatrix, positions: Floats, right: Floats, accuracy: float
) -> Stepped | None:
    """Return the solution as `stepped` does, and the tangent prepared for solving."""
    if not balance.is_finite(tangent):
        return None
    try:
        found = _solved(balance, tangent, positions, right, accuracy)
    except (SingularMatrixError, IndefiniteError):
        return None
    return found if found is not None and np.isfinite(found.step).all() else None


def _solved(
    balance: Balance, tangent: SparseMatrix, positions: Floats, right: Floats, accuracy: float
) -> Stepped | None:
    """Solve a linear system; if multigrid is slow even with new coarse levels, by a factorisation.

    Returns None if the tangent is not positive definite, the last iterate if a factorisation does not fit in memory.
    """
    for attempt in range(3):
        ready = balance.ready(tangent, positions)
        if ready.lasting and ready.negative_eigenvalues != 0 and balance.loading.symmetric:
            return None
        try:
            return Stepped(ready.solve(right, accuracy), ready)
        except SlowError as slow:
            if attempt and not balance.go_direct("the iterations for a linear system were slow"):
                return Stepped(slow.best, ready)
    return None
