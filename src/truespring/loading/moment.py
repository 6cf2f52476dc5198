"""A moment that rotates with a face of a plane body; its potential is minus moment times rotation."""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, Self

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints
from truespring.assembly import Pattern
from truespring.errors import ProblemError
from truespring.loading.body import Body
from truespring.loading.history import History
from truespring.loading.load import FollowingLoad, Mark
from truespring.loading.values import number
from truespring.loading.words import selection_words
from truespring.mesh import Mesh, Selection, loaded
from truespring.potential import SparseMatrix


@dataclass(frozen=True)
class Moment(FollowingLoad):
    """A `moment` [N m], anticlockwise, on the nodes `on` of a plane body, which rotates with them.

    It does work on their mean rotation. If the nodes stay on a line, the forces are a linear stress along it.

    Example:
        >>> import truespring as ts
        >>> ts.Moment("right", 0.002).words()
        "moment 0.002 N m on 'right'"
    """

    on: Selection
    moment: float
    over: History | None = field(default=None, kw_only=True)
    instead = "the rotation of a support"

    def following(self, body: Body, held: Bools) -> "FaceMoment":
        """Return the potential; raise ProblemError in 3D and on fewer than two nodes."""
        moment = number(self.moment, "moment", "N m")
        mesh = body.mesh
        if mesh.dim == 3:
            raise ProblemError(
                "a moment in 3D has no potential, since its work depends on the order of rotations: "
                "prescribe the rotation of the face instead (a support with rotation and axis)"
            )
        nodes = loaded(mesh, self.on)
        if len(nodes) < 2:
            raise ProblemError("a moment acts on a face: select at least two nodes")
        route = _route_to(mesh, nodes, held[: mesh.n_nodes])
        return FaceMoment(body.nodes, *body.shares(self.on), moment, route)

    def scaled(self, factor: float) -> Self:
        """Return the load multiplied by a factor."""
        return replace(self, moment=factor * self.moment)

    def mark(self, body: Body, held: Bools) -> Mark:
        """Return an arrow along the motion of the node farthest from the centre of the face."""
        nodes = loaded(body.mesh, self.on)
        arms = body.mesh.nodes[nodes] - body.mesh.nodes[nodes].mean(axis=0)
        x, y = arms[np.linalg.norm(arms, axis=1).argmax()]
        return Mark(nodes, self.moment * np.array([-y, x]), "M", self.moment, "N m")

    def words(self) -> str:
        """Return the moment and where it acts."""
        return f"moment {self.moment:g} N m on {selection_words(self.on)}"


class FaceMoment:
    """Potential of a moment on nodes in the plane: minus moment times mean rotation.

    The mean rotation is the angle of the rotation R that minimises the weighted squares of d - R D, where D and d are
    the arms of the nodes about their weighted centre, undeformed and deformed.
    """

    def __init__(self, nodes: Floats, face: Ints, weights: Floats, moment: float, route: "_Route") -> None:
        """Store the moment [N m] on a face.

        Args:
            nodes: undeformed positions of all nodes [m], shape (n_nodes, 2).
            face: numbers of the loaded nodes, shape (n,).
            weights: weight of each loaded node, shape (n,).
            moment: the moment [N m].
            route: nodes from a held node to the face, by which whole turns are counted.
        """
        self.nodes, self._face, self._moment, self._route = nodes, face, moment, route
        arms = nodes[face] - weights @ nodes[face] / weights.sum()
        self._arms = weights[:, None] * arms
        self._across = self._arms[:, ::-1] * np.array([-1.0, 1.0])
        self._pattern = Pattern(face[None], *nodes.shape)

    def rotation(self, positions: Floats) -> float:
        """Return the rotation of the face from the undeformed body [rad], whole turns included."""
        cosine, sine = self._parts(positions)
        within = float(np.arctan2(sine, cosine))
        return within + 2 * np.pi * round((self._route.rotation(positions) - within) / (2 * np.pi))

    def _parts(self, positions: Floats) -> tuple[float, float]:
        """Return the cosine and sine of the rotation, both times the same positive factor [m^2]."""
        face = positions[self._face]
        return float((self._arms * face).sum()), float((self._across * face).sum())

    def energy(self, positions: Floats) -> float:
        """Return minus the work of the moment [J]."""
        return -self._moment * self.rotation(positions)

    def gradient(self, positions: Floats) -> Floats:
        """Return minus the nodal forces [N], shape (n_nodes, 2)."""
        cosine, sine = self._parts(positions)
        force = np.zeros(self.nodes.shape)
        slope = (cosine * self._across - sine * self._arms) / (cosine**2 + sine**2)
        force[self._face] = -self._moment * slope
        return force

    def hessian(self, positions: Floats) -> SparseMatrix:
        """Return the derivative of the gradient [N/m], shape (2 n_nodes, 2 n_nodes)."""
        cosine, sine = self._parts(positions)
        size = cosine**2 + sine**2
        along, across = self._arms.ravel(), self._across.ravel()
        slope = (cosine * across - sine * along) / size
        growth = 2 * (cosine * along + sine * across) / size
        # The derivative of (C s - S c) / r^2, where c and s are the gradients of C and S.
        block = (np.outer(across, along) - np.outer(along, across)) / size - np.outer(slope, growth)
        return self._pattern.summed(lambda first, last: -self._moment * block[None])


@dataclass(frozen=True, eq=False)
class _Route:
    """Nodes along edges from a held node to a face, each with its edges.

    The positions of a face give its rotation up to whole turns. The rotations of neighbouring nodes differ by less than
    half a turn, so adding up the differences along the route gives the whole turns.

    Attributes:
        nodes: undeformed positions of all nodes [m], shape (n_nodes, 2).
        pairs: for each node of the route, its edges as pairs of node numbers, shape (n, 2).
    """

    nodes: Floats
    pairs: tuple[Ints, ...]

    def rotation(self, positions: Floats) -> float:
        """Return the rotation of the last node of the route [rad], whole turns included."""
        angles = []
        for pairs in self.pairs:
            rest, now = (places[pairs[:, 1]] - places[pairs[:, 0]] for places in (self.nodes, positions))
            sine = float((rest[:, 0] * now[:, 1] - rest[:, 1] * now[:, 0]).sum())
            angles.append(float(np.arctan2(sine, (rest * now).sum())))
        steps = (b - a for a, b in pairwise(angles))
        return angles[0] + sum(step - 2 * np.pi * round(step / (2 * np.pi)) for step in steps)


def _route_to(mesh: Mesh, face: Ints, held: Bools) -> _Route:
    """Return the shortest route along edges of the mesh to the centre of the face from the nearest held node."""
    from scipy.sparse.csgraph import dijkstra

    edges = mesh.edges
    graph = sparse.coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(mesh.n_nodes,) * 2)
    goal = int(face[np.linalg.norm(mesh.nodes[face] - mesh.nodes[face].mean(axis=0), axis=1).argmin()])
    options: Any = {"directed": False, "indices": goal, "unweighted": True, "return_predecessors": True}
    distance, before = dijkstra(sparse.csr_array(graph), **options)
    known = np.flatnonzero(held.all(axis=1) if held.all(axis=1).any() else held.any(axis=1))
    node = int(known[distance[known].argmin()])
    route = [node]
    while node != goal and before[node] >= 0:
        node = int(before[node])
        route.append(node)
    ends = np.concatenate([edges, edges[:, ::-1]])
    return _Route(mesh.nodes, tuple(ends[ends[:, 0] == node] for node in route))
