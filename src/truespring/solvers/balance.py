"""The balance of forces at one load level: what is asked of a state, and how good it is."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.conditions import Loading
from truespring.errors import ProblemError
from truespring.linear.choice import LinearSolver, Tangent, choose
from truespring.linear.direct import Direct, SingularMatrixError
from truespring.linear.gradients import IndefiniteError, SlowError, norm
from truespring.potential import Potential, SparseMatrix
from truespring.solvers.cost import Cost

#: Called after each iteration with load factor, iteration and relative residual.
Reporter = Callable[[float, int, float], None]

_EPS = float(np.finfo(float).eps)
# A state whose residual is within this factor of the best one's counts as it.
_NEAR_BEST = 10.0
# Rounding is estimated for bodies up to so many times their rest size.
_LARGEST_STRETCH = 100.0
# An iteration that is so many times the body's size away from rest will not come back, and its energies overflow.
_LOST = 1e8
# Linear systems are solved to this share of their right side, and to less only where that ends the iteration.
_ACCURACY, _FINEST_ACCURACY = 2e-3, 1e-5


@dataclass(frozen=True)
class Equilibrium:
    """A state at one load level; an equilibrium where `converged`, else the best that was reached.

    Attributes:
        load_factor: share of the full load [-].
        positions: [m], shape (n_nodes, dim).
        internal_force: gradient of the potential [N], shape (n_nodes, dim).
        energy: stored elastic energy [J].
        iterations: Newton iterations spent, those of attempts that were cut back included.
        external_force: of the loads at the state [N], shape (n_nodes, dim).
        residual: unbalanced force over the largest of applied, reaction and internal force [-].
        negative_eigenvalues: of the tangent on the free directions: 0 if stable, None if not known.
        branched: true where an unstable equilibrium was left for a stable one nearby.
        snapped: true where the body moved much further than the step before lets expect.
        critical: "limit point" or "bifurcation" where stability changes there, else None.
        mode: the way in which a body gives way at a critical point, largest component 1, shape (n_nodes, dim).
        level: the share of what the solver controls, 0 to 1, where that is not the load factor.
        reason: why no balance was looked for, in words, where it was not.
        cost: of the path up to here.
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
    cost: Cost | None = None


class Found(NamedTuple):
    """A state, and the factorised tangent there, None where there is none or the state is no equilibrium."""

    state: Equilibrium
    tangent: Tangent | None = None


@dataclass(eq=False)
class Balance:
    """The balance of forces of one potential under one loading.

    Forces and steps have the shape of the positions, and are zero in the directions that are held.

    Attributes:
        tolerance: the relative residual at which a state counts as balanced.
        max_iterations: of Newton's method at one level.
        linear: what solves the linear systems.
        notes: where a first choice was given up, and for what.
    """

    potential: Potential
    loading: Loading
    tolerance: float
    max_iterations: int
    linear: LinearSolver
    report: Reporter | None = None
    notes: list[str] = field(default_factory=list)
    spent: int = 0

    def __post_init__(self) -> None:
        self.free = ~self.loading.held
        self.size = float(np.linalg.norm(np.ptp(self.potential.nodes, axis=0)))

    def total_energy(self, positions: Floats, load_factor: float) -> tuple[float, float]:
        """Return stored energy less the work of the loads, and the size of these two together [J]."""
        with np.errstate(over="ignore", invalid="ignore"):
            stored = self.potential.energy(positions)
        work = load_factor * self.loading.external_force * (positions - self.potential.nodes)
        following = [load_factor * load.energy(positions) for load in self.loading.following]
        total = stored - float(work.sum()) + sum(following)
        return total, abs(stored) + float(np.abs(work).sum()) + sum(map(abs, following))

    def force(self, positions: Floats, load_factor: float) -> Floats:
        """Return the unbalanced force on the free directions [N]."""
        applied = self.loading.force(positions, load_factor)
        return self.unbalanced(self.potential.gradient(positions), applied)[0]

    def unbalanced(self, internal: Floats, applied: Floats) -> tuple[Floats, float]:
        """Return the unbalanced force on the free directions [N], and the force scale it is relative to [N]."""
        scale = max(norm(applied), norm(internal))
        return np.where(self.free, internal - applied, 0.0), scale

    def hessian(self, positions: Floats, load_factor: float, *stress: Floats) -> SparseMatrix:
        """Return the tangent in blocks of one row a direction, loads that follow the body included."""
        tangent = self.in_blocks(self.potential.hessian(positions, *stress))
        for load in self.loading.following if load_factor else ():
            tangent = self.in_blocks(tangent + load_factor * load.hessian(positions))
        return tangent

    def in_blocks(self, matrix: SparseMatrix) -> SparseMatrix:
        """Return a matrix in blocks of one row a direction."""
        dim = self.free.shape[1]
        if matrix.format == "bsr" and matrix.blocksize == (dim, dim):
            return matrix
        blocks = sparse.bsr_array(matrix, blocksize=(dim, dim))
        blocks.sort_indices()
        return blocks

    def accuracy(self, residual: float) -> float:
        """Return the relative accuracy that a linear system deserves at a relative residual."""
        last = self.tolerance / residual / 3 if residual else 1.0
        return last if _FINEST_ACCURACY <= last <= _ACCURACY else _ACCURACY

    def rounding(self, tangent: SparseMatrix, positions: Floats) -> float:
        """Return the unbalanced force that rounding of the positions alone makes [N]: no residual can go below.

        A body that runs away without bound is not excused by its own size.
        """
        from truespring.kernels import blocks
        from truespring.kernels.threads import run

        centred = np.minimum(np.abs(positions - positions.mean(axis=0)), _LARGEST_STRETCH * self.size)
        rows = (tangent.indptr, tangent.indices, tangent.data)
        return (
            8
            * _EPS
            * float(
                np.sqrt(
                    sum(
                        run(blocks.rounding, len(centred), *rows, centred, self.loading.held, (0.0,) * centred.shape[1])
                    )
                )
            )
        )

    def judged(self, state: Equilibrium) -> Found:
        """Add the stability of the tangent to an equilibrium."""
        if not self.free.any():
            return Found(replace(state, negative_eigenvalues=0))
        try:
            tangent = self.ready(self.hessian(state.positions, state.load_factor), state.positions)
        except SingularMatrixError:
            return Found(replace(state, negative_eigenvalues=None))
        negative = tangent.negative_eigenvalues
        if negative is None and not tangent.lasting and self.go_direct("stability could not be told"):
            return self.judged(state)
        judged = replace(state, negative_eigenvalues=negative)
        return Found(judged, tangent if tangent.lasting else None)

    def ready(self, matrix: SparseMatrix, positions: Floats) -> Tangent:
        """Make a tangent ready; where there are no coarse levels for it, by a factorisation.

        Raises SingularMatrixError where it has no inverse.
        """
        try:
            return self.linear.ready(matrix, positions)
        except SingularMatrixError:
            if isinstance(self.linear, Direct) or not self.go_direct("no coarse levels could be built"):
                raise
            return self.linear.ready(matrix, positions)

    def factorised(self, found: Found) -> Found:
        """Return an equilibrium with its tangent factorised, as far as memory allows."""
        if found.tangent is not None:
            return found
        return self.judged(found.state) if self.go_direct("an unstable state was met") else found

    def go_direct(self, reason: str) -> bool:
        """Take a factorisation from here on; tell whether that fits in memory."""
        try:
            directly = choose("direct", self.potential.nodes, self.loading.held)
        except ProblemError:
            self.note(f"{reason}: a factorisation, which would help, does not fit in memory")
            return False
        self.note(f"{reason}: {directly.name} from there on instead of {self.linear.name}")
        before = self.linear
        directly.cg_iterations, directly.lanczos_iterations = before.cg_iterations, before.lanczos_iterations
        directly.factorisations, directly.memory = before.factorisations, before.memory
        self.linear = directly
        return True

    def note(self, text: str) -> None:
        """Keep in words, once, that a first choice was given up."""
        if text not in self.notes:
            self.notes.append(text)


class Watch:
    """Keeps the best state of an iteration at one level, and tells when it is balanced."""

    def __init__(self, balance: Balance, load_factor: float, positions: Floats) -> None:
        self._balance, self.load_factor = balance, load_factor
        nowhere = np.full_like(positions, np.nan)
        self.best = Equilibrium(load_factor, positions, nowhere, nowhere, np.inf, 0, np.inf, converged=False)
        self.force: Floats = nowhere
        self.residual = np.inf
        #: Whether the unbalanced force is below what rounding makes.
        self.drowned = False
        self._size, self._scale, self._drowned_before = np.inf, 0.0, np.inf
        self._here, self._best_size = self.best, np.inf

    def at(self, positions: Floats, iteration: int, held_moved: bool = True) -> bool:
        """Look at a state; tell whether it is one: an iteration that ran away is over.

        A state whose held nodes have not made their motion yet is none to return.
        """
        if not np.abs(positions - self._balance.potential.nodes).max() <= _LOST * self._balance.size:
            return False
        internal = self._balance.potential.gradient(positions)
        applied = self._balance.loading.force(positions, self.load_factor)
        self.force, self._scale = self._balance.unbalanced(internal, applied)
        self._size = norm(self.force)
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

    def balanced(self, tangent: SparseMatrix, positions: Floats) -> bool:
        """Tell whether the state looked at is balanced.

        The rounding of a body that has run away excuses nothing: the best state is what is returned. A force
        below rounding may still be that of a small load: only where steps no longer help is it noise.
        """
        below = self._size <= self._balance.rounding(tangent, positions)
        self.drowned = below and self.residual <= _NEAR_BEST * self.best.residual
        helpless = self.drowned and (self.load_factor == 0 or self._size > self._drowned_before / 2)
        self._drowned_before = self._size if self.drowned else np.inf
        return helpless or self._size <= self._balance.tolerance * self._scale

    def equilibrium(self) -> Found:
        """Return the state looked at as the equilibrium that it is, or a former one that is better balanced.

        By the force itself: where all forces vanish, as in a body moved as a whole, their ratio tells nothing.
        """
        state = self.best if self._best_size < self._size else self._here
        energy = self._balance.potential.energy(state.positions)
        self._balance.spent += state.iterations
        return self._balance.judged(replace(state, energy=energy, converged=True))

    def failure(self) -> Found:
        """Return the best state as no equilibrium."""
        self._balance.spent += self.best.iterations
        with np.errstate(over="ignore", invalid="ignore"):
            return Found(replace(self.best, energy=self._balance.potential.energy(self.best.positions)))


def stepped(
    balance: Balance, tangent: SparseMatrix, positions: Floats, right: Floats, accuracy: float
) -> Floats | None:
    """Return the solution of a tangent that is positive; None where it is not."""
    if not np.isfinite(tangent.data.sum()):
        return None
    try:
        step = _solved(balance, tangent, positions, right, accuracy)
    except (SingularMatrixError, IndefiniteError):
        return None
    return step if step is not None and np.isfinite(step).all() else None


def _solved(
    balance: Balance, tangent: SparseMatrix, positions: Floats, right: Floats, accuracy: float
) -> Floats | None:
    """Solve; where that is slow even on coarse levels of the state itself, by a factorisation if that fits."""
    for attempt in range(3):
        ready = balance.ready(tangent, positions)
        if ready.lasting and ready.negative_eigenvalues != 0:
            return None
        try:
            return ready.solve(right, accuracy)
        except SlowError as slow:
            if attempt and not balance.go_direct("conjugate gradients were slow"):
                return slow.best
    return None
