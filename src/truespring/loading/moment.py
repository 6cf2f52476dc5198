"""A moment that turns with a face of a plane body, as a potential: minus moment times rotation."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Self

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from truespring.arrays import Bools, Floats, Ints
from truespring.assembly import Pattern
from truespring.errors import ProblemError
from truespring.loading.body import Body
from truespring.loading.load import FollowingLoad, Mark
from truespring.loading.values import number
from truespring.loading.words import selection_words
from truespring.mesh import Mesh, Selection, loaded
from truespring.potential import SparseMatrix


@dataclass(frozen=True)
class Moment(FollowingLoad):
    """A `moment` [N m], anticlockwise, on the nodes `on` of a plane body, that turns with them.

    It does work on their mean rotation; while they stay on a line its forces are a linear stress across it.
    """

    on: Selection
    moment: float
    instead = "the rotation of a support"

    def following(self, body: Body, held: Bools) -> "FaceMoment":
        """Return the potential; raise ProblemError where the load has none."""
        moment = number(self.moment, "moment", "N m")
        mesh = body.mesh
        if mesh.dim == 3:
            raise ProblemError(
                "a moment in space has no potential: its work depends on the order of turns about several axes; "
                "prescribe the rotation of the face instead (a support with rotation and axis)"
            )
        nodes = loaded(mesh, self.on)
        if len(nodes) < 2:
            raise ProblemError("a moment turns a face: select at least two nodes")
        way = _way_to(mesh, nodes, held[: mesh.n_nodes])
        return FaceMoment(body.nodes, *body.shares(self.on), moment, way)

    def scaled(self, factor: float) -> Self:
        """Return the load times a factor."""
        return replace(self, moment=factor * self.moment)

    def mark(self, body: Body, held: Bools) -> Mark:
        """Return an arrow along which the moment moves the node farthest from the middle of the face."""
        nodes = loaded(body.mesh, self.on)
        arms = body.mesh.nodes[nodes] - body.mesh.nodes[nodes].mean(axis=0)
        x, y = arms[np.linalg.norm(arms, axis=1).argmax()]
        return Mark(nodes, self.moment * np.array([-y, x]), "M", self.moment, "N m")

    def words(self) -> str:
        """Return the moment and where it acts."""
        return f"moment {self.moment:g} N m on {selection_words(self.on)}"


class FaceMoment:
    """Minus a moment times the mean rotation of nodes in the plane: the angle that fits d = R D best."""

    def __init__(self, nodes: Floats, face: Ints, weights: Floats, moment: float, way: "_Way") -> None:
        """Take reference positions [m], the nodes of the face, the weight of each, and a way to it from elsewhere."""
        self.nodes, self._face, self._moment, self._way = nodes, face, moment, way
        arms = nodes[face] - weights @ nodes[face] / weights.sum()
        self._arms = weights[:, None] * arms
        self._across = self._arms[:, ::-1] * np.array([-1.0, 1.0])
        self._pattern = Pattern(face[None], *nodes.shape)

    def rotation(self, positions: Floats) -> float:
        """The rotation of the face since rest [rad], whole turns included."""
        cosine, sine = self._parts(positions)
        within = float(np.arctan2(sine, cosine))
        return within + 2 * np.pi * round((self._way.rotation(positions) - within) / (2 * np.pi))

    def _parts(self, positions: Floats) -> tuple[float, float]:
        face = positions[self._face]
        return float((self._arms * face).sum()), float((self._across * face).sum())

    def energy(self, positions: Floats) -> float:
        """Minus the work of the moment [J]."""
        return -self._moment * self.rotation(positions)

    def gradient(self, positions: Floats) -> Floats:
        """Minus the force on the nodes [N], shape (n_nodes, dim)."""
        cosine, sine = self._parts(positions)
        force = np.zeros(self.nodes.shape)
        slope = (cosine * self._across - sine * self._arms) / (cosine**2 + sine**2)
        force[self._face] = -self._moment * slope
        return force

    def hessian(self, positions: Floats) -> SparseMatrix:
        """The derivative of the gradient [N/m]."""
        cosine, sine = self._parts(positions)
        size = cosine**2 + sine**2
        along, across = self._arms.ravel(), self._across.ravel()
        slope = (cosine * across - sine * along) / size
        growth = 2 * (cosine * along + sine * across) / size
        # The derivative of (C s - S c) / r^2: s c^T - c s^T is what of it is not symmetric, and cancels.
        block = (np.outer(across, along) - np.outer(along, across)) / size - np.outer(slope, growth)
        return self._pattern.summed(lambda first, last: -self._moment * block[None])


@dataclass(frozen=True, eq=False)
class _Way:
    """Nodes from one that turns little to a face, step by step, and the neighbours of each.

    The rotation of a face is known up to whole turns; that of each node on the way differs little from the last one's.
    """

    nodes: Floats
    pairs: tuple[Ints, ...]

    def rotation(self, positions: Floats) -> float:
        angles = []
        for pairs in self.pairs:
            rest, now = (places[pairs[:, 1]] - places[pairs[:, 0]] for places in (self.nodes, positions))
            sine = float((rest[:, 0] * now[:, 1] - rest[:, 1] * now[:, 0]).sum())
            angles.append(float(np.arctan2(sine, (rest * now).sum())))
        steps = (b - a for a, b in pairwise(angles))
        return angles[0] + sum(step - 2 * np.pi * round(step / (2 * np.pi)) for step in steps)


def _way_to(mesh: Mesh, face: Ints, held: Bools) -> _Way:
    """The way from the nearest held node, along edges of the mesh."""
    edges = mesh.edges
    graph = sparse.coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(mesh.n_nodes,) * 2)
    goal = int(face[np.linalg.norm(mesh.nodes[face] - mesh.nodes[face].mean(axis=0), axis=1).argmin()])
    asked: Any = {"directed": False, "indices": goal, "unweighted": True, "return_predecessors": True}
    distance, before = csgraph.dijkstra(sparse.csr_array(graph), **asked)
    known = np.flatnonzero(held.all(axis=1) if held.all(axis=1).any() else held.any(axis=1))
    node = int(known[distance[known].argmin()])
    way = [node]
    while node != goal and before[node] >= 0:
        node = int(before[node])
        way.append(node)
    ends = np.concatenate([edges, edges[:, ::-1]])
    return _Way(mesh.nodes, tuple(ends[ends[:, 0] == node] for node in way))
