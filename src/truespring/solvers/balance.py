"""Balance at one load level: Newton's method with line search on the total energy."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Floats, Ints
from truespring.potential import Loading, Potential, Projectable, SparseMatrix
from truespring.solvers.linear import Factorisation, SingularMatrixError, factorise

#: Called after each iteration with load factor, iteration and relative residual.
Reporter = Callable[[float, int, float], None]

_EPS = float(np.finfo(float).eps)
# Energies that differ by less than this share cannot be told apart; see Balance.search.
_DROWNED = 1e-9
# A state whose residual is within this factor of the best one's counts as it.
_NEAR_BEST = 10.0
# Rounding is estimated for bodies up to so many times their rest size.
_LARGEST_STRETCH = 100.0
# Armijo's constant, and how far one backtracking step may cut (Nocedal and Wright, 3.1 and 3.5).
_ARMIJO, _SHORTEST_CUT, _LONGEST_CUT = 1e-4, 0.1, 0.5
_MIN_STEP, _LONGEST_STEP = 1e-9, 1024.0


@dataclass(frozen=True)
class Equilibrium:
    """A state at one load level; an equilibrium where `converged`, else the best that was reached.

    Attributes:
        load_factor: share of the full load [-].
        positions: [m], shape (n_nodes, dim).
        internal_force: gradient of the potential [N], shape (n_nodes, dim).
        energy: stored elastic energy [J].
        iterations: Newton iterations spent, those of attempts that were cut back included.
        residual: unbalanced force over the largest of applied, reaction and internal force [-].
        negative_eigenvalues: of the tangent on the free directions: 0 if stable, None if not known.
        branched: true where an unstable equilibrium was left for a stable one nearby.
        snapped: true where the body moved much further than the step before lets expect.
    """

    load_factor: float
    positions: Floats
    internal_force: Floats
    energy: float
    iterations: int
    residual: float
    converged: bool
    negative_eigenvalues: int | None = None
    branched: bool = False
    snapped: bool = False


class Found(NamedTuple):
    """A state and the factorised tangent there, None where it is singular or the state is no equilibrium."""

    state: Equilibrium
    tangent: Factorisation | None = None


class Step(NamedTuple):
    """A direction [m], the slope of the total energy along it [J], and whether it is Newton's own."""

    direction: Floats
    slope: float
    newton: bool


class Balance:
    """The balance of forces of one potential under one loading, on the free directions."""

    def __init__(
        self,
        potential: Potential,
        loading: Loading,
        tolerance: float,
        max_iterations: int,
        report: Reporter | None = None,
    ) -> None:
        """Take the relative residual at which a state counts as balanced, and the iterations it may take."""
        self.potential, self.loading, self.report = potential, loading, report
        self.tolerance, self.max_iterations = tolerance, max_iterations
        self.free: Ints = np.flatnonzero(~loading.held.ravel())
        self.size = float(np.linalg.norm(np.ptp(potential.nodes, axis=0)))

    def total_energy(self, positions: Floats, load_factor: float) -> tuple[float, float]:
        """Return stored energy less the work of the loads, and the size of these two together [J]."""
        with np.errstate(over="ignore", invalid="ignore"):
            stored = self.potential.energy(positions)
        work = load_factor * self.loading.external_force * (positions - self.potential.nodes)
        return stored - float(work.sum()), abs(stored) + float(np.abs(work).sum())

    def force(self, positions: Floats, load_factor: float) -> Floats:
        """Return the unbalanced force on the free directions [N], shape (n_free,)."""
        return self._unbalanced(self.potential.gradient(positions), load_factor)[0]

    def _unbalanced(self, internal: Floats, load_factor: float) -> tuple[Floats, float]:
        """Return the unbalanced force on the free directions [N], and the force scale it is relative to [N]."""
        applied = load_factor * self.loading.external_force
        scale = max(float(np.linalg.norm(applied)), float(np.linalg.norm(internal)))
        return (internal - applied).ravel()[self.free], scale

    def moved(self, positions: Floats, step: Floats) -> Floats:
        """Return `positions` with the free directions moved by `step` [m]."""
        result = positions.copy()
        result.ravel()[self.free] += step
        return result

    def _free_block(self, matrix: SparseMatrix) -> SparseMatrix:
        return sparse.csr_array(matrix[self.free][:, self.free])

    def descend(self, load_factor: float, positions: Floats, undamped_iterations: int | None = None) -> Found:
        """Find the balance from `positions`; where that fails, return the state with the least residual.

        With `undamped_iterations` Newton's full steps are taken, so many of them, wherever they lead.
        """
        with np.errstate(over="ignore", invalid="ignore"):  # of iterates that run away
            return self._descend(load_factor, positions, undamped_iterations)

    def _descend(self, load_factor: float, positions: Floats, undamped_iterations: int | None) -> Found:
        nowhere = np.full_like(positions, np.nan)
        best = Equilibrium(load_factor, positions, nowhere, np.inf, 0, np.inf, converged=False)
        drowned_before = np.inf
        for iteration in range((undamped_iterations or self.max_iterations) + 1):
            internal = self.potential.gradient(positions)
            force, scale = self._unbalanced(internal, load_factor)
            size = float(np.linalg.norm(force))
            residual = size / scale if scale else 0.0
            if self.report:
                self.report(load_factor, iteration, residual)
            if not np.isfinite(residual):  # it ran away
                break
            if residual < best.residual:
                best = replace(best, positions=positions, internal_force=internal, residual=residual)
            tangent = self._free_block(self.potential.hessian(positions))
            # The rounding of a body that has run away excuses nothing: the best state is what is returned.
            drowned = size <= self._rounding(tangent, positions) and residual <= _NEAR_BEST * best.residual
            # A force below rounding may still be that of a small load: only where steps no longer help is it noise.
            if size <= self.tolerance * scale or (drowned and (load_factor == 0 or size > drowned_before / 2)):
                energy = self.potential.energy(best.positions)
                state = replace(best, energy=energy, iterations=iteration, converged=True)
                return _judged(state, self._free_block(self.potential.hessian(best.positions)))
            drowned_before = size if drowned else np.inf
            if undamped_iterations or drowned:
                moved = self._leap(positions, tangent, force)
            else:
                step = self._step(positions, tangent, force)
                moved = step and self._search(load_factor, positions, step)
            if moved is None:
                break
            positions = moved
        return Found(replace(best, energy=self.potential.energy(best.positions), iterations=iteration))

    def _rounding(self, tangent: SparseMatrix, positions: Floats) -> float:
        """The unbalanced force that rounding of the positions alone makes [N]: no residual can go below.

        A body that runs away without bound is not excused by its own size.
        """
        centred = np.abs(positions - positions.mean(axis=0)).ravel()[self.free]
        return 8 * _EPS * float(np.linalg.norm(abs(tangent) @ np.minimum(centred, _LARGEST_STRETCH * self.size)))

    def _leap(self, positions: Floats, tangent: SparseMatrix, force: Floats) -> Floats | None:
        """Return where Newton's full step leads, None where there is no energy."""
        try:
            moved = self.moved(positions, -factorise(tangent).solve(force))
        except SingularMatrixError:
            return None
        return moved if np.isfinite(self.total_energy(moved, 0.0)[0]) else None

    def _step(self, positions: Floats, tangent: SparseMatrix, force: Floats) -> Step | None:
        """Return a direction of descent: Newton's where the tangent is positive, else that of a positive neighbour."""
        if not np.isfinite(tangent.data).all():
            return None
        for candidate in self._positive_neighbours(positions, tangent):
            try:
                factors = factorise(candidate)
            except SingularMatrixError:
                continue
            direction = -factors.solve(force)
            slope = float(direction @ force)
            if not factors.negative_eigenvalues and np.isfinite(direction).all() and slope < 0:
                return Step(direction, slope, candidate is tangent)
        return None

    def _positive_neighbours(self, positions: Floats, tangent: SparseMatrix) -> Iterator[SparseMatrix]:
        """Yield the tangent, its projection, then the projection with a growing share of its diagonal added."""
        yield tangent
        projected = tangent
        if isinstance(self.potential, Projectable):
            projected = self._free_block(self.potential.projected_hessian(positions))
            yield projected
        diagonal = np.abs(projected.diagonal())
        for share in (1e-6, 1e-4, 1e-2, 1.0, 10.0):
            yield sparse.csr_array(projected + sparse.diags_array(share * (diagonal + diagonal.mean())))

    def _search(self, load_factor: float, positions: Floats, step: Step) -> Floats | None:
        """Backtrack along a step until the total energy falls enough; None where it never does.

        Near equilibrium the fall drowns in the rounding of the energy; there the slope decides
        (the approximate Wolfe condition of Hager and Zhang 2005). A step that is not Newton's own
        is often too short, as when a straight column begins to buckle: it is doubled while it descends.
        """
        energy, size = self.total_energy(positions, load_factor)

        def descends(moved: Floats, length: float) -> bool:
            there, size_there = self.total_energy(moved, load_factor)
            if not np.isfinite(there) or there <= energy + _ARMIJO * length * step.slope:
                return bool(np.isfinite(there))
            drowned = there - energy <= _DROWNED * max(size, size_there)
            return bool(drowned and step.direction @ self.force(moved, load_factor) <= -step.slope / 2)

        length = 1.0
        while not descends(moved := self.moved(positions, length * step.direction), length):
            there, _ = self.total_energy(moved, load_factor)
            curvature = there - energy - step.slope * length
            cut = -step.slope * length / (2 * curvature) if np.isfinite(curvature) and curvature > 0 else _SHORTEST_CUT
            length *= min(max(cut, _SHORTEST_CUT), _LONGEST_CUT)
            if length < _MIN_STEP:
                return None
        while not step.newton and length >= 1 and length < _LONGEST_STEP:
            further = self.moved(positions, 2 * length * step.direction)
            if not descends(further, 2 * length) or step.direction @ self.force(further, load_factor) > 0:
                break
            moved, length = further, 2 * length
        return moved


def _judged(state: Equilibrium, tangent: SparseMatrix) -> Found:
    """Add the inertia of the tangent to an equilibrium."""
    if not tangent.shape[0]:
        return Found(replace(state, negative_eigenvalues=0))
    try:
        factors = factorise(tangent)
    except SingularMatrixError:
        return Found(replace(state, negative_eigenvalues=None))
    return Found(replace(state, negative_eigenvalues=factors.negative_eigenvalues), factors)
