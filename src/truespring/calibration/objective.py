"""The objective of a calibration, from solved equilibria, with its gradient and Jacobian."""

import math
from collections.abc import Container, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.calibration.cases import LoadCase, Observation
from truespring.calibration.unknowns import Unknowns
from truespring.equilibrium import Solution, State, Status, solve
from truespring.errors import ModelError
from truespring.linear.choice import Tangent, choose
from truespring.linear.direct import SingularMatrixError
from truespring.linear.gradients import IndefiniteError, SlowError
from truespring.solvers import Newton
from truespring.solvers.balance import Balance

# Relative residual of the linear systems of a gradient. Iterative solvers hold their matrix in single precision:
# tolerance of each of their solves, and largest number of solves.
_ACCURACY, _AT_A_TIME, _MOST_TIMES = 1e-8, 1e-3, 12


class _Seen(NamedTuple):
    """An observation of a case, and the equilibrium at its level."""

    case: int
    observation: Observation
    state: State


@dataclass(eq=False)
class Objective:
    """J(c) = 1/2 mean of the squared relative errors + regularisation^2 / 2 mean of (c - 1)^2.

    The mean is over all observations of all cases; each error is |B x(c) - y| over the scale of its observation, with
    the equilibrium x(c) at its level. J is infinite if a path ends early, or is unstable or inverted, unless `excused`
    contains the name of its case.
    """

    unknowns: Unknowns
    cases: Sequence[LoadCase]
    regularisation: float
    excused: Container[str] = ()
    solves: int = 0
    _last: tuple[Floats, list[Solution] | None] | None = field(default=None, repr=False)

    @property
    def _weights(self) -> float:
        """Factor of each relative error, so that the squares sum to their mean."""
        return 1 / math.sqrt(sum(len(case.observations) for case in self.cases))

    def paths(self, values: Floats) -> list[Solution] | None:
        """Return the springs' path of each case; None if one does not reach full load."""
        if self._last is None or not np.array_equal(self._last[0], values):
            self._last = np.array(values), self._solved(values)
        return self._last[1]

    def _solved(self, values: Floats) -> list[Solution] | None:
        found = []
        for case in self.cases:
            try:
                path = solve(case.problem, self.unknowns.potential(values), case.solver)
            except ModelError:  # a mechanism
                return None
            self.solves += 1
            if not path.complete or (path.status is not Status.CONVERGED and case.name not in self.excused):
                return None
            found.append(path)
        return found

    def _seen(self, values: Floats) -> list[_Seen] | None:
        paths = self.paths(values)
        if paths is None:
            return None
        found = []
        for number, (case, path) in enumerate(zip(self.cases, paths, strict=True)):
            for one in case.observations:
                state = path.at(one.level)
                assert state is not None  # a complete path has all levels
                found.append(_Seen(number, one, state))
        return found

    def residuals(self, values: Floats) -> Floats:
        """Return the residuals whose squared norm is 2 J [-], shape (n_data + n,); infinite without an equilibrium."""
        seen = self._seen(values)
        pull = self.regularisation * (values - 1) / np.sqrt(len(values))
        if seen is None:
            n_data = sum(len(one.data) for case in self.cases for one in case.observations)
            return np.full(n_data + len(values), np.inf)
        parts = [self._weights / one.observation.scale * _misfit(one) for one in seen]
        return np.concatenate([*parts, pull])

    def value(self, values: Floats) -> float:
        """Return J; infinite without an equilibrium."""
        residuals = self.residuals(values)
        return float(residuals @ residuals / 2) if np.isfinite(residuals).all() else np.inf

    def gradient(self, values: Floats) -> Floats:
        """Return dJ/dc [-], shape (n,), by the adjoint method, with one linear system per level.

        With f the internal force and K its tangent, K dx = -df/dc on the free directions. Of displacements
        K^T lam = B^T r gives dJ/dc = -lam . df/dc; of forces and torques of supports r = G (f - F) - y, which depends
        on c directly too: K^T lam = (G K)^T r and dJ/dc = (G^T r - lam) . df/dc.
        """
        seen = self._seen(values)
        if seen is None:
            raise ModelError("there is no equilibrium at these unknowns, so no gradient")
        total = self.regularisation**2 * (values - 1) / len(values)
        for group in _by_state(seen):
            tangent = _At(self, group[0], transposed=True)
            right, direct = np.zeros(tangent.shape), np.zeros(tangent.shape)
            for one in group:
                scaled = (self._weights / one.observation.scale) ** 2 * _misfit(one)
                back = (one.observation.rows.T @ scaled).reshape(tangent.shape)
                if one.observation.quantity != "displacement":
                    direct += back
                    right += tangent.apply(back)
                else:
                    right += back
            adjoint = tangent.solve(right)
            total += tangent.forces.T @ (direct - adjoint).ravel()
        return total

    def jacobian(self, values: Floats) -> Floats:
        """Return the derivative of `residuals` [-], shape (n_data + n, n): one linear system per unknown and level."""
        seen = self._seen(values)
        if seen is None:
            raise ModelError("there is no equilibrium at these unknowns, so no derivative")
        blocks: dict[int, Floats] = {}
        for group in _by_state(seen):
            tangent = _At(self, group[0])
            pushes = np.asarray(tangent.forces.toarray()).T
            moves = np.stack([-tangent.solve(push.reshape(tangent.shape)).ravel() for push in pushes], axis=1)
            for one in group:
                change = moves
                if one.observation.quantity != "displacement":
                    pulled = [tangent.apply(move.reshape(tangent.shape)).ravel() for move in moves.T]
                    change = np.stack(pulled, axis=1) + pushes.T
                blocks[id(one)] = self._weights / one.observation.scale * (one.observation.rows @ change)
        n = len(values)
        return np.concatenate([*(blocks[id(one)] for one in seen), self.regularisation / np.sqrt(n) * np.eye(n)])


def _misfit(one: _Seen) -> Floats:
    """Return computed minus observed data, shape (m,)."""
    field = one.state.displacement if one.observation.quantity == "displacement" else one.state.reaction
    return np.asarray(one.observation.rows @ field.ravel() - one.observation.data)


def _by_state(seen: Sequence[_Seen]) -> list[list[_Seen]]:
    """Return observations grouped by equilibrium."""
    groups: dict[tuple[int, float], list[_Seen]] = {}
    for one in seen:
        groups.setdefault((one.case, one.observation.level), []).append(one)
    return list(groups.values())


class _At:
    """The tangent at an equilibrium, with that of following loads, and the derivative of the force by each unknown.

    `transposed` if it is that of an adjoint system.
    """

    def __init__(self, objective: Objective, one: _Seen, transposed: bool = False) -> None:
        case, state = objective.cases[one.case], one.state
        loading, positions = case.problem.loading, state.positions
        assert objective._last is not None  # a state was seen
        values, paths = objective._last
        assert paths is not None
        potential = paths[one.case].potential
        assert potential is not None  # it was solved
        linear = choose(case.solver.linear, potential.nodes, loading.held, symmetric=loading.symmetric)
        usual = Newton()
        balance = Balance(potential, loading, usual.tolerance, usual.max_iterations, linear)
        self.shape, self._free, self._positions, self._balance = positions.shape, ~loading.held, positions, balance
        tangent = balance.hessian(positions, state.load_factor)
        self._matrix = balance.in_blocks(tangent.T) if transposed and not loading.symmetric else tangent
        try:
            self._ready: Tangent = balance.ready(self._matrix, positions)
        except SingularMatrixError:
            raise ModelError(
                f"{case.name}: at load factor {state.load_factor:g} the tangent is singular, so there is no gradient"
            ) from None
        self.forces = objective.unknowns.forces(positions, values)

    def apply(self, move: Floats) -> Floats:
        """Return the tangent times a displacement of all nodes [N], shape (n_nodes, dim)."""
        return np.asarray((self._matrix @ move.ravel()).reshape(self.shape))

    def solve(self, right: Floats) -> Floats:
        """Return the displacement of the free directions under forces [m], shape (n_nodes, dim)."""
        if self._ready.lasting:
            return self._ready.solve(right)
        target = np.where(self._free, right, 0.0)
        left, found = target, np.zeros(self.shape)
        for _ in range(_MOST_TIMES):
            if np.linalg.norm(left) <= _ACCURACY * np.linalg.norm(target):
                return found
            try:
                found = found + self._ready.solve(left, _AT_A_TIME)
            except (SlowError, IndefiniteError):
                break
            left = np.where(self._free, target - self.apply(found), 0.0)
        if self._balance.go_direct("an accurate gradient needs a direct solver"):
            self._ready = self._balance.ready(self._matrix, self._positions)
            return self._ready.solve(right)
        return found


def relative_errors(case: LoadCase, path: Solution, quantity: str = "displacement") -> dict[float, float]:
    """Return the relative error of a path by load factor: norm of the misfit over the norm of the data.

    For displacements it is the rms error of a comparison, for forces and torques the largest of all supports.
    """
    found: dict[float, float] = {}
    for one in case.observations:
        state = path.at(one.level)
        if one.quantity == quantity and state is not None:
            error = float(np.linalg.norm(_misfit(_Seen(0, one, state)))) / one.size
            found[one.level] = max(found.get(one.level, 0.0), error)
    return found
