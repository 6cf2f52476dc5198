"""The equilibrium of a body that is held still: under grasps and spheres where they are, gravity and supports."""

from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy import sparse

from truespring.arrays import Floats, Ints
from truespring.coarsening import CoarseBody, restated
from truespring.conditions import Amplitude, Interaction, Loading
from truespring.equilibrium import geometry_of
from truespring.live.session import Live
from truespring.live.state import State
from truespring.motion.follow import balance_of
from truespring.motion.moving import Body
from truespring.motion.still import Still
from truespring.potential import Potential, SparseMatrix, Stressed
from truespring.solvers import Geometry, Newton, mixed
from truespring.solvers.balance import Balance, Reporter
from truespring.solvers.line_search import descend

# Load steps of an equilibrium that is approached from the undeformed body.
_STEPS = 5
# A coarser mesh has at most so many nodes.
_QUICK = 3000


class InterruptedSearchError(Exception):
    """The body is not held still any more."""


@dataclass(frozen=True, eq=False)
class Rest:
    """What is needed for the equilibria of a body.

    Attributes:
        body: the body; of its loading, grasps and spheres of the session are missing.
        geometry: functions of the mesh.
        balance: the balance of forces, with its linear solver.
    """

    body: Body
    geometry: Geometry
    balance: Balance

    @classmethod
    def of(cls, body: Body, geometry: Geometry) -> Self:
        """Return it for a body."""
        return cls(body, geometry, balance_of(body, Newton(), None, geometry))

    def find(self, loading: Loading, starts: Iterable[Floats], stop: Callable[[], bool]) -> Floats | None:
        """Return the equilibrium [m], shape (n_nodes, dim), found from a start that leads to one; else None.

        Starts of less energy are tried first.

        Args:
            loading: all that acts, at full load.
            starts: positions [m], shape (n_nodes, dim).
            stop: asked after each iteration whether to give up: then InterruptedSearchError is raised.
        """
        balance, potential = self.balance, self.body.potential
        balance.potential, balance.loading, balance.report = potential, loading, _asking(stop)
        held = potential.nodes + loading.motion()
        placed = [loading.cleared(np.where(loading.held, held, one), 1.0) for one in starts]
        for positions in sorted(placed, key=self._energy):
            found = None
            if isinstance(potential, Stressed) and np.isfinite(self._energy(positions)):
                found = mixed.converge(balance, 1.0, mixed.Start(positions, potential.stress(positions))).state
            if found is None or not found.converged or not self.geometry.admissible(found.positions):
                found = descend(balance, 1.0, positions).state
            if found.converged:
                return found.positions
        return None

    def approach(self, loading: Loading, stop: Callable[[], bool]) -> Floats | None:
        """Return the equilibrium that loads and grasps lead to as they grow from nothing; else None. As `find`."""
        path = Newton(load_steps=_STEPS).follow(self.body.potential, loading, _asking(stop), self.geometry)
        last = deque(path, maxlen=1)[0]
        return last.positions if last.converged and last.load_factor == 1.0 else None

    def _energy(self, positions: Floats) -> float:
        """Return the energy with that of the loads [J], infinite where it is not defined."""
        energy = self.balance.total_energy(positions, 1.0)[0]
        return energy if np.isfinite(energy) else np.inf


def _asking(stop: Callable[[], bool]) -> Reporter:
    """Return a function that is called after each iteration, and raises InterruptedSearchError when `stop` says so."""

    def report(load_factor: float, iteration: int, residual: float) -> None:
        if stop():
            raise InterruptedSearchError

    return report


def steady(live: Live, held: State, grow: bool = False) -> Loading:
    """Return all that acts on the body of a session while it is held as in a state, as loads that do not change.

    Tools are where they are at the time of that state, without friction. With `grow`, loads, supports and grasps grow
    from nothing to what they are.
    """
    body, span = live.body, live.body.duration
    level = held.moment.time / span

    def constant(part: Loading) -> Loading:
        share = part.amplitude.at(level)
        return replace(part, amplitude=Amplitude((0.0, 1.0), (0.0 if grow else share, share)))

    nodes, times = body.potential.nodes, (0.0, span)
    acting: list[Interaction] = [Still(one, level) for one in body.loading.interactions]
    for grip in (one.on(live.acted_on) for one in held.grips.values()):
        there = replace(grip, begin=np.zeros_like(grip.end)) if grow else grip.settled
        acting.append(there.interaction(nodes, times, span))
    acting += [one.settled.interaction(live.touched, len(nodes), times, span) for one in held.balls.values()]
    return replace(body.loading.mapped(constant), interactions=tuple(acting))


class _Fixed:
    """A tool or grasp at full load as a potential of all nodes."""

    def __init__(self, acting: Interaction, nodes: Floats) -> None:
        """Store it, and the undeformed positions [m], shape (n_nodes, dim)."""
        self.nodes, self._acting = nodes, acting

    def energy(self, positions: Floats) -> float:
        """Return the stored energy [J]."""
        return self._acting.stored(positions, 1.0)

    def gradient(self, positions: Floats) -> Floats:
        """Return minus the force on the nodes [N], shape (n_nodes, dim)."""
        return self._acting.gradient(positions, 1.0)

    def hessian(self, positions: Floats) -> SparseMatrix:
        """Return the second derivatives [N/m], shape (n_dof, n_dof)."""
        nodes, blocks = self._acting.blocks(positions, 1.0)
        return _on_the_diagonal(nodes, blocks, positions.shape)


def _on_the_diagonal(nodes: Ints, blocks: Floats, shape: tuple[int, ...]) -> SparseMatrix:
    """Return blocks of shape (n, dim, dim) on the diagonal of a matrix of all nodes, `shape` (n_nodes, dim)."""
    n_nodes, dim = shape
    order = np.argsort(nodes, kind="stable")
    starts = np.concatenate([[0], np.cumsum(np.bincount(nodes, minlength=n_nodes))])
    matrix: Any = sparse.bsr_array((blocks[order], nodes[order], starts), shape=(n_nodes * dim,) * 2)
    return matrix  # type: ignore[no-any-return]


@dataclass(frozen=True, eq=False)
class CoarseRest:
    """The same for a body on a mesh of larger cells, which is quicker.

    Attributes:
        rest: the body on the coarser mesh, without supports and loads.
        nodes: undeformed nodes of the finer mesh [m], shape (n_nodes, dim).
        weights: interpolation of the finer nodes from the coarser ones, sparse, shape (n_nodes, n_coarse).
    """

    rest: Rest
    nodes: Floats
    weights: "sparse.csr_array[Any]"

    @property
    def n_nodes(self) -> int:
        """The number of nodes of the coarser mesh."""
        return self.weights.shape[1]

    def find(self, loading: Loading, start: Floats, stop: Callable[[], bool]) -> Floats | None:
        """Return the equilibrium, interpolated to the finer nodes [m], shape (n_nodes, dim); as `Rest.find`.

        `loading` and `start` are those of the finer mesh.
        """
        coarse, nodes = self.rest.body.potential.nodes, self.nodes
        acting: tuple[Potential, ...] = tuple(_Fixed(one, nodes) for one in loading.interactions)
        own = Loading(np.zeros(nodes.shape), loading.held, np.zeros(nodes.shape), following=acting)
        always = replace(own, amplitude=Amplitude((0.0,), (1.0,)))
        whole = replace(loading, further=(*loading.further, always), interactions=())
        there = restated(whole, nodes, coarse, self.weights)
        found = self.rest.find(there, (self._sampled(start), coarse), stop)
        if found is None:
            return None
        moved = nodes + self.weights @ (found - coarse)
        return np.where(loading.held, nodes + loading.motion(), moved)

    def _sampled(self, positions: Floats) -> Floats:
        """Return positions of the coarser nodes [m], shape (n_coarse, dim): means over the finer nodes around each."""
        heavy = sparse.csr_array(self.weights.multiply(self.weights))
        total = np.asarray(heavy.sum(axis=0)).ravel()
        moved = heavy.T @ (positions - self.nodes) / np.where(total > 0, total, 1.0)[:, None]
        return np.asarray(self.rest.body.potential.nodes + moved)


def coarse_rest(live: Live) -> CoarseRest | None:
    """Return the body of a session on a mesh of larger cells; None unless its mesh is a lattice with enough cells."""
    body, problem = live.body, live.problem
    plain = replace(body.loading, interactions=())
    if plain.held.shape != problem.mesh.nodes.shape or not (live.model.finite and live.model.any_mesh):
        return None
    coarse: CoarseBody | None = CoarseBody.finest(replace(problem, tools=(), grasps=(), stated=False), plain)
    weights = None
    while coarse is not None and coarse.mesh.n_nodes > _QUICK:
        coarse = coarse.coarser()
        if coarse is None or min(coarse.counts) < 1:
            return None
        weights = coarse.weights if weights is None else sparse.csr_array(weights @ coarse.weights)
    if coarse is None or weights is None:
        return None
    potential = live.model.potential(coarse.problem)
    if potential.nodes.shape != coarse.mesh.nodes.shape:
        return None
    loading = restated(plain, problem.mesh.nodes, coarse.mesh.nodes, weights)
    there = replace(body, potential=potential, loading=loading)
    return CoarseRest(Rest.of(there, geometry_of(coarse.problem)), problem.mesh.nodes, weights)
