"""Starts from coarser meshes: the path is followed there first, and its states, interpolated, start the iteration.

Newton's iteration on a fine mesh needs most of its work to remove errors that are smooth, which a coarse mesh removes
for a fraction of the cost (nested iteration; Deuflhard, Newton Methods for Nonlinear Problems, 8.3). The state on a
coarse mesh only starts the iteration on the next finer one: the equilibrium found is that of the fine mesh.

A start must not change the branch. Coarse states are used as long as the path there is simple: on the coarsest mesh,
followed in small steps, each state is stable, and no step moves the body much further than the step before, as it does
near a bifurcation or a limit point; on the next meshes, the state found is stable and near its start. If it is not, the
coarsest mesh was too coarse, and the path is followed in small steps on the next one.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np
from scipy import sparse

from truespring.arrays import Floats
from truespring.errors import one_line
from truespring.linear.choice import choose
from truespring.linear.gradients import norm
from truespring.potential import Stressed, volumes_of
from truespring.solvers import mixed
from truespring.solvers.balance import Balance, Equilibrium, Found, stepped
from truespring.solvers.cost import Cost
from truespring.solvers.doubts import doubt, snapped
from truespring.solvers.solver import Geometry

# Smallest number of nodes, in the plane and in space, and smallest load step, as a share of the full load, for which a
# start from coarser meshes saves time.
_WORTH, _LARGE_STEP = {2: 20_000, 3: 8_000}, 0.3
# A mesh with fewer nodes is the coarsest, in the plane and in space.
_COARSEST = {2: 2_500, 3: 1_200}
# Largest number of free directions for which "auto" factorises: stability is needed here, but not modes.
_DIRECT = 600
# Largest step on the coarsest mesh, as a share of the full load.
_STEP = 1 / 4
# A step that moves the body by more than this multiple of what the step before suggests is near a critical point.
_STEADY = 2.0
# Largest distance of a state from its start, over the motion from the last state.
_NEAR = 0.25
# Tolerance on coarse meshes, whose states differ more from that of the fine mesh.
_TOLERANCE = 1e-3
# Smallest ratio of the number of nodes to that of the coarsest mesh.
_MUCH_COARSER = 12
# Relative accuracy of the linear response.
_LINEAR = 1e-3

#: Name of Newton's method on coarse meshes.
METHOD = "mixed integration points"

_Found = TypeVar("_Found")


class CoarsePath:
    """The path on a coarse mesh, as long as it is simple; levels are asked for in ascending order."""

    def __init__(
        self, balance: Balance, admissible: Callable[[Floats], bool], jump: "Jump | None", small: bool
    ) -> None:
        """Begin at the undeformed body; `jump` starts from the next coarser mesh, None on the coarsest.

        `small` states whether small steps on this mesh are cheap compared with the finest one.
        """
        self.balance, self.jump, self._admissible, self._small = balance, jump, admissible, small
        self._marches = jump is None
        nodes = balance.potential.nodes
        still = np.zeros_like(nodes)
        self._last = Equilibrium(0.0, nodes, still, still, 0.0, 0, 0.0, converged=True)
        self._previous: Equilibrium | None = None

    @property
    def costs(self) -> tuple[Cost, ...]:
        """Costs on this mesh and on coarser ones, the coarsest first."""
        below = () if self.jump is None else self.jump.costs
        return (*below, self.balance.cost(METHOD))

    @property
    def coarsest(self) -> int:
        """Number of nodes of the coarsest mesh."""
        return len(self.balance.potential.nodes) if self.jump is None else self.jump.coarsest

    def displacement(self, level: float) -> Floats | None:
        """Return the displacement at a level [m], shape (n_nodes, dim); None if the path is not simple up to there."""
        reached = self._marched(level) if self.jump is None or self._marches else self._jumped(self.jump, level)
        return self._last.positions - self.balance.potential.nodes if reached else None

    def _jumped(self, jump: "Jump", level: float) -> bool:
        """Move to a level by a start from the next coarser mesh, else in small steps; return whether that succeeded."""
        found, why = jump.find(level, self._last, self._previous)
        if found is None:
            return False
        if why:
            self._marches = self._small
            return self._marches and self._marched(level)
        self._previous, self._last = self._last, found.state
        return True

    def _marched(self, level: float) -> bool:
        """Move to a level in steps of at most _STEP; return whether the path is simple up to there."""
        first = self._last.load_factor
        n_steps = int(np.ceil((level - first) / _STEP - 1e-9))
        for step in range(1, n_steps + 1):
            to = first + (level - first) * step / n_steps
            start = mixed.start_from(self.balance, to, self._last, self._previous)
            if start is None:
                return False
            state = mixed.converge(self.balance, to, start).state
            if unproven(state, self._last, self._previous, self._admissible) or not self._steady(state):
                return False
            self._previous, self._last = self._last, state
        return n_steps > 0

    def _steady(self, state: Equilibrium) -> bool:
        """Return whether the step to a state is not much longer than the step before suggests."""
        if self._previous is not None:
            return not snapped(state, self._last, self._previous, _STEADY)
        nodes = self.balance.potential.nodes
        linear = _linear_response(self.balance, state.load_factor)
        return linear is not None and norm(state.positions - nodes) <= _STEADY * norm(linear)


def _linear_response(balance: Balance, level: float) -> Floats | None:
    """Return the displacement at a level by the tangent of the undeformed body [m], shape (n_nodes, dim)."""
    nodes, loading = balance.potential.nodes, balance.loading
    tangent, motion = balance.hessian(nodes, 0.0), loading.motion(level)
    right = np.where(balance.free, loading.force(nodes, level) - balance.product(tangent, motion), 0.0)
    step = stepped(balance, tangent, nodes, right, _LINEAR)
    return None if step is None else step + motion


def unproven(
    state: Equilibrium, last: Equilibrium, previous: Equilibrium | None, admissible: Callable[[Floats], bool]
) -> str:
    """Return why a state may not be on the path, as `doubt` does, or that its stability is not known; else empty."""
    if state.converged and state.negative_eigenvalues is None:
        return "led to a state of unknown stability"
    return doubt(state, last, previous, admissible)


class Jump:
    """Iterations on a mesh that start from the states of the next coarser one."""

    def __init__(
        self, balance: Balance, admissible: Callable[[Floats], bool], path: CoarsePath, weights: "sparse.csr_array[Any]"
    ) -> None:
        """Store the balance on the mesh, the path on the coarser one, and the interpolation from it."""
        self._balance, self._admissible, self._weights = balance, admissible, weights
        self._path: CoarsePath | None = path
        self._spent: tuple[Cost, ...] = ()
        self._carried = {0.0: np.zeros_like(balance.potential.nodes)}

    @property
    def costs(self) -> tuple[Cost, ...]:
        """Costs on the coarser meshes, the coarsest first."""
        return self._spent if self._path is None else self._path.costs

    @property
    def coarsest(self) -> int:
        """Number of nodes of the coarsest mesh, 0 after the last start."""
        return 0 if self._path is None else self._path.coarsest

    def find(self, level: float, last: Equilibrium, previous: Equilibrium | None) -> tuple[Found | None, str]:
        """Return the state at a level from a coarse start, and why it is doubtful, empty if it is accepted.

        The state is None if there is no start. After a doubt there are no further starts.
        """
        if self._path is None:
            return None, ""
        start = self._start(level, last, previous)
        if start is None:
            return self._closed(None, level, "the path on a coarser mesh is not simple")
        found = mixed.converge(self._balance, level, start)
        why = unproven(found.state, last, previous, self._admissible)
        away = norm(found.state.positions - start.positions)
        if not why and away > _NEAR * norm(found.state.positions - last.positions):
            why = "led to a distant state"
        if why:
            return self._closed(found, level, f"a start from a coarser mesh {why}")
        self._balance.note(f"started from solutions on {len(self._path.balance.potential.nodes):,} nodes")
        if level >= 1.0:
            self._close()
        return found, ""

    def _closed(self, found: Found | None, level: float, why: str) -> tuple[Found | None, str]:
        """Return a state and a doubt; offer no more starts."""
        self._balance.note(f"not started from a coarser mesh from load factor {level:.6g} on: {why}")
        self._close()
        return found, why

    def _close(self) -> None:
        """Free the memory of the coarser meshes."""
        self._spent, self._path = self.costs, None

    def _start(self, level: float, last: Equilibrium, previous: Equilibrium | None) -> mixed.Start | None:
        """Return the interpolated coarse state plus its error, extrapolated from one or two states; None without one.

        The error is the displacement on this mesh minus the interpolated one.
        """
        potential, loading = self._balance.potential, self._balance.loading
        path = self._path
        assert path is not None and isinstance(potential, Stressed)  # `find` and `_jump` checked it
        moved = _unless_it_fails(lambda: path.displacement(level), self._balance)
        if moved is None:
            return None
        self._carried[level] = self._weights @ moved
        positions = last.positions - self._carried[last.load_factor] + self._carried[level]
        if previous is not None:
            ratio = (level - last.load_factor) / (last.load_factor - previous.load_factor)
            before = previous.positions - self._carried.pop(previous.load_factor)
            positions += ratio * (last.positions - self._carried[last.load_factor] - before)
        positions = np.where(loading.held, potential.nodes + loading.motion(level), positions)
        if not np.isfinite(self._balance.total_energy(positions, level)[0]):
            return None
        return mixed.Start(positions, potential.stress(positions))


def jump_from_coarser(balance: Balance, geometry: Geometry, linear: str, load_step: float) -> Jump | None:
    """Return starts from coarser meshes; None if there is no such mesh, or if it would not save time.

    Args:
        balance: balance of forces on the fine mesh.
        geometry: the fine mesh.
        linear: the linear solver, see Newton.
        load_step: share of the full load.
    """
    nodes = balance.potential.nodes
    if len(nodes) < _WORTH.get(nodes.shape[1], np.inf) or load_step < _LARGE_STEP:
        return None
    jump = _unless_it_fails(lambda: _jump(balance, geometry, linear, len(nodes) // _MUCH_COARSER), balance)
    return jump if jump is not None and _MUCH_COARSER * jump.coarsest <= len(nodes) else None


def _jump(balance: Balance, geometry: Geometry, linear: str, n_small: int) -> Jump | None:
    """Return starts from the next coarser mesh, whose own starts are from the one after it, and so on.

    Steps are small on the coarsest mesh, and if need be on meshes of up to `n_small` nodes.
    """
    nodes = balance.potential.nodes
    if len(nodes) < _COARSEST[nodes.shape[1]] or not isinstance(balance.potential, Stressed):
        return None
    coarse = geometry.coarse_body()
    if coarse is None:
        return None
    tolerance = max(balance.tolerance, _TOLERANCE)
    nodes, held, volumes = coarse.potential.nodes, coarse.loading.held, volumes_of(coarse.potential)
    linear_here = "multigrid" if linear == "auto" and (~held).sum() > _DIRECT else linear
    chosen = choose(linear_here, nodes, held, coarse.geometry.interpolations, volumes)
    # Without a reporter, whose exceptions are not to be taken for failures of the coarse mesh.
    below = Balance(coarse.potential, coarse.loading, tolerance, balance.max_iterations, chosen)
    still_coarser = _jump(below, coarse.geometry, linear, n_small)
    path = CoarsePath(below, coarse.geometry.admissible, still_coarser, len(nodes) <= n_small)
    return Jump(balance, geometry.admissible, path, coarse.weights)


def _unless_it_fails(compute: Callable[[], _Found], balance: Balance) -> _Found | None:
    """Return what a function of coarse meshes returns; None with a note if it raises: the fine mesh needs no such."""
    try:
        return compute()
    except Exception as error:  # a model may raise anything on a mesh that is not that of the user
        balance.note(f"a coarser mesh failed: {type(error).__name__}: {one_line(str(error))}")
        return None
