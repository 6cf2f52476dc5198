"""Newton's method for equilibrium along a load path, with line search on the total energy."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Floats, Ints
from truespring.errors import ProblemError
from truespring.potential import Loading, Potential, Projectable, SparseMatrix
from truespring.solvers.linear import Factorisation, SingularMatrixError, factorise

#: Called after each iteration with load factor, iteration and relative residual.
Reporter = Callable[[float, int, float], None]

_EPS = float(np.finfo(float).eps)
# Energies that differ by less than this share cannot be told apart; see _search.
_DROWNED = 1e-9
# Rounding is estimated for bodies up to so many times their rest size.
_LARGEST_STRETCH = 100.0
# Armijo's constant, and how far one backtracking step may cut (Nocedal and Wright, 3.1 and 3.5).
_ARMIJO, _SHORTEST_CUT, _LONGEST_CUT = 1e-4, 0.1, 0.5
_MIN_STEP, _LONGEST_STEP = 1e-9, 1024.0
# An unstable state is left along its mode by this share of the body's size, at most so many times.
_NUDGE, _MAX_ESCAPES = 1e-3, 3


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


@dataclass(frozen=True, slots=True)
class Newton:
    """Full Newton with load steps: cut back where they fail, grown again where they succeed.

    Attributes:
        load_steps: the levels k / load_steps are all reached and recorded.
        tolerance: relative residual at which a state counts as balanced [-].
        max_iterations: Newton iterations at one level before its step is cut back.
        max_cutbacks: how often a load step may be halved.
    """

    load_steps: int = 10
    tolerance: float = 1e-10
    max_iterations: int = 50
    max_cutbacks: int = 6

    def __post_init__(self) -> None:
        if self.load_steps < 1 or self.max_iterations < 1 or self.max_cutbacks < 0:
            raise ProblemError("load_steps and max_iterations must be at least 1, max_cutbacks at least 0")
        if not 0 < self.tolerance < 1:
            raise ProblemError(f"tolerance = {self.tolerance}: a relative residual between 0 and 1 is wanted")

    def follow(
        self,
        potential: Potential,
        loading: Loading,
        report: Reporter | None = None,
        admissible: Callable[[Floats], bool] = lambda positions: True,
    ) -> Iterator[Equilibrium]:
        """Yield the equilibria from load factor 0 to 1 in order.

        Where a level cannot be reached the last one yielded is not converged: the best state there.
        Equilibria whose positions are not `admissible` (an inverted element) are taken only from where
        the smallest load step leads to no other.
        """
        balance = _Balance(potential, loading, self, report)
        state = balance.find(0.0, potential.nodes)
        yield state
        previous: Equilibrium | None = None
        step, spent = 1.0 / self.load_steps, 0
        smallest, strict = step / 2**self.max_cutbacks, admissible(state.positions)
        while state.converged and state.load_factor < 1.0:
            requested = (np.floor(state.load_factor * self.load_steps + 1e-9) + 1) / self.load_steps
            level = float(min(requested, state.load_factor + step, 1.0))
            if requested - level < 1e-9:
                level = float(requested)
            reached = balance.find(level, *balance.predictions(state, previous, level))
            spent += reached.iterations
            wanted = reached.converged and (not strict or admissible(reached.positions))
            if not wanted and step > smallest:
                step /= 2
                continue
            if not wanted and strict:
                strict, step = False, 1.0 / self.load_steps
                continue
            previous, state, spent = state, replace(reached, iterations=spent), 0
            step = min(2 * step, 1.0 / self.load_steps)
            yield state


class _Step(NamedTuple):
    """A direction [m], the slope of the total energy along it [J], and whether it is Newton's own."""

    direction: Floats
    slope: float
    newton: bool


class _Balance:
    """The balance of forces of one potential under one loading, on the free directions."""

    def __init__(self, potential: Potential, loading: Loading, settings: Newton, report: Reporter | None) -> None:
        self.potential, self.loading, self.settings, self.report = potential, loading, settings, report
        self.free: Ints = np.flatnonzero(~loading.held.ravel())
        self.size = float(np.linalg.norm(np.ptp(potential.nodes, axis=0)))
        self._last_tangent: Factorisation | None = None

    def total_energy(self, positions: Floats, load_factor: float) -> tuple[float, float]:
        """Return stored energy less the work of the loads, and the size of these two together [J]."""
        with np.errstate(over="ignore", invalid="ignore"):
            stored = self.potential.energy(positions)
        work = load_factor * self.loading.external_force * (positions - self.potential.nodes)
        return stored - float(work.sum()), abs(stored) + float(np.abs(work).sum())

    def unbalanced(self, internal: Floats, load_factor: float) -> tuple[Floats, float]:
        """Return the unbalanced force on the free directions [N], and the force scale it is relative to [N]."""
        applied = load_factor * self.loading.external_force
        scale = max(float(np.linalg.norm(applied)), float(np.linalg.norm(internal)))
        return (internal - applied).ravel()[self.free], scale

    def moved(self, positions: Floats, step: Floats) -> Floats:
        """Return `positions` with the free directions moved by `step` [m]."""
        result = positions.copy()
        result.ravel()[self.free] += step
        return result

    def tangent(self, positions: Floats) -> SparseMatrix:
        """Return the true tangent on the free directions [N/m]."""
        return self._free_block(self.potential.hessian(positions))

    def _free_block(self, matrix: SparseMatrix) -> SparseMatrix:
        return sparse.csr_array(matrix[self.free][:, self.free])

    def predictions(self, state: Equilibrium, previous: Equilibrium | None, level: float) -> list[Floats]:
        """Return starting points for a level: along the tangent, by extrapolation, and where the last one ended."""
        advance = level - state.load_factor
        motion = np.where(self.loading.held, advance * self.loading.displacement, 0.0)
        guesses = [state.positions + motion]
        if self._last_tangent is not None:
            push = advance * self.loading.external_force.ravel()
            if motion.any():
                push = push - self.potential.hessian(state.positions) @ motion.ravel()
            guesses.append(self.moved(state.positions + motion, self._last_tangent.solve(push[self.free])))
        if previous is not None and not state.branched:
            ratio = advance / (state.load_factor - previous.load_factor)
            extrapolated = state.positions + ratio * (state.positions - previous.positions)
            guesses.append(np.where(self.loading.held, state.positions + motion, extrapolated))
        return guesses

    def find(self, load_factor: float, *guesses: Floats) -> Equilibrium:
        """Return the equilibrium at `load_factor`, from the guess with the least unbalanced force."""
        usable = [guess for guess in guesses if np.isfinite(self.potential.energy(guess))]
        if not usable:
            nothing = np.full_like(guesses[0], np.nan)
            return Equilibrium(load_factor, guesses[0], nothing, np.inf, 0, np.inf, converged=False)
        start = usable[0] if len(usable) == 1 else min(usable, key=lambda guess: self._misfit(guess, load_factor))
        state = self._descend(load_factor, start)
        for _ in range(_MAX_ESCAPES):
            if not state.converged or not state.negative_eigenvalues:
                break
            state = self._escape(state)
        return state

    def _force(self, positions: Floats, load_factor: float) -> Floats:
        return self.unbalanced(self.potential.gradient(positions), load_factor)[0]

    def _misfit(self, positions: Floats, load_factor: float) -> float:
        return float(np.linalg.norm(self._force(positions, load_factor)))

    def _escape(self, state: Equilibrium) -> Equilibrium:
        """Leave an unstable equilibrium along its mode, to the side of lower energy."""
        assert self._last_tangent is not None  # it was found negative by factorising
        mode = _NUDGE * self.size * self._last_tangent.lowest_mode()
        sides = [self.moved(state.positions, mode), self.moved(state.positions, -mode)]
        start = min(sides, key=lambda side: self.total_energy(side, state.load_factor)[0])
        found = self._descend(state.load_factor, start)
        spent = state.iterations + found.iterations
        return replace(found, iterations=spent, branched=True) if found.converged else state

    def _descend(self, load_factor: float, positions: Floats) -> Equilibrium:
        """Newton with line search at one level; the state with the least residual where it fails."""
        best = Equilibrium(load_factor, positions, np.full_like(positions, np.nan), np.inf, 0, np.inf, converged=False)
        for iteration in range(self.settings.max_iterations + 1):
            internal = self.potential.gradient(positions)
            force, scale = self.unbalanced(internal, load_factor)
            size = float(np.linalg.norm(force))
            residual = size / scale if scale else 0.0
            if self.report:
                self.report(load_factor, iteration, residual)
            if residual < best.residual:
                best = replace(best, positions=positions, internal_force=internal, residual=residual)
            tangent = self.tangent(positions)
            if size <= max(self.settings.tolerance * scale, self._rounding(tangent, positions)):
                energy = self.potential.energy(positions)
                state = Equilibrium(load_factor, positions, internal, energy, iteration, residual, converged=True)
                return self._judged(state, tangent)
            found = self._step(positions, tangent, force)
            moved = found and self._search(load_factor, positions, found)
            if moved is None:
                break
            positions = moved
        return replace(best, energy=self.potential.energy(best.positions), iterations=iteration)

    def _rounding(self, tangent: SparseMatrix, positions: Floats) -> float:
        """The unbalanced force that rounding of the positions alone makes [N]: no residual can go below.

        A body that runs away without bound is not excused by its own size.
        """
        centred = np.abs(positions - positions.mean(axis=0)).ravel()[self.free]
        return 8 * _EPS * float(np.linalg.norm(abs(tangent) @ np.minimum(centred, _LARGEST_STRETCH * self.size)))

    def _judged(self, state: Equilibrium, tangent: SparseMatrix) -> Equilibrium:
        """Add the inertia of the tangent."""
        if not self.free.size:
            return replace(state, negative_eigenvalues=0)
        try:
            self._last_tangent = factorise(tangent)
        except SingularMatrixError:
            self._last_tangent = None
            return replace(state, negative_eigenvalues=None)
        return replace(state, negative_eigenvalues=self._last_tangent.negative_eigenvalues)

    def _step(self, positions: Floats, tangent: SparseMatrix, force: Floats) -> _Step | None:
        """Return a direction of descent: Newton's where the tangent is positive, else that of a positive neighbour."""
        if not np.isfinite(tangent.data).all():
            return None
        for candidate in self._positive_neighbours(positions, tangent):
            try:
                factors = factorise(candidate)
            except SingularMatrixError:
                continue
            step = -factors.solve(force)
            if not factors.negative_eigenvalues and np.isfinite(step).all() and step @ force < 0:
                return _Step(step, float(step @ force), candidate is tangent)
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

    def _search(self, load_factor: float, positions: Floats, step: _Step) -> Floats | None:
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
            return bool(drowned and step.direction @ self._force(moved, load_factor) <= -step.slope / 2)

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
            if not descends(further, 2 * length) or step.direction @ self._force(further, load_factor) > 0:
                break
            moved, length = further, 2 * length
        return moved
