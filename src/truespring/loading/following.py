"""Loads that follow the body, as potentials: a pressure on its surface, a moment on a face of a plane body.

A load has a potential where its work does not depend on the way: of a pressure, where the edge of the surface is held
or slides within planes, or there is none; of a moment, in the plane. Others are refused.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from truespring.arrays import Bools, Floats, Ints
from truespring.errors import ProblemError
from truespring.loading.dead import Body
from truespring.loading.values import number
from truespring.mesh import CELL_SHAPES, Mesh, Selection, loaded, outer_facets, quadrature
from truespring.mesh.rows import ascending, distinct_rows
from truespring.potential import Pattern, Potential, SparseMatrix

# Forces of a pressure are polynomials of second order along a straight way: two Gauss points give its work exactly.
_GAUSS = ((0.5 - 0.5 / np.sqrt(3), 0.5), (0.5 + 0.5 / np.sqrt(3), 0.5))
# The tangent of a load that has a potential is symmetric to this share of its size, at a state deformed by a
# share of the body's size.
_SYMMETRIC, _DEFORMED = 1e-9, 0.05


@runtime_checkable
class FollowingLoad(Protocol):
    """A load that follows the body."""

    def following(self, body: Body, held: Bools) -> Potential:
        """Return the potential on `body`, whose nodes are held where `held` is true, shape (n_nodes, dim)."""
        ...

    def rim(self, mesh: Mesh) -> Ints:
        """Return the edges around the surface in space, by their ends, shape (n, 2)."""
        ...


@dataclass(frozen=True)
class Pressure:
    """A `pressure` [Pa] that presses on the facets of the boundary `on` and stays normal to them as they move.

    `on` is a group of facets, or a side, another group of the mesh, a Plane, a Box or node numbers: all facets of the
    boundary whose nodes are among them.
    """

    on: Selection
    pressure: float

    def following(self, body: Body, held: Bools) -> "SurfacePressure":
        """Return the potential; raise ProblemError where the load has none."""
        pressure = number(self.pressure, "pressure", "Pa")
        facets = body.whole(outer_facets(body.mesh, self.on))
        load = SurfacePressure(body.nodes, facets, body.thickness * pressure, held)
        if pressure:
            load.refuse_open_edges()
        return load

    def rim(self, mesh: Mesh) -> Ints:
        """Return the edges around the surface in space, by their ends, shape (n, 2)."""
        facets = outer_facets(mesh, self.on)
        if mesh.dim == 2:
            return np.zeros((0, 2), dtype=np.int64)
        edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2)
        found = distinct_rows(ascending(edges.T))
        return np.asarray(edges[found.first[found.count == 1]])


@dataclass(frozen=True)
class Moment:
    """A `moment` [N m], anticlockwise, on the nodes `on` of a plane body, that turns with them.

    It does work on their mean rotation; while they stay on a line its forces are a linear stress across it.
    """

    on: Selection
    moment: float

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

    def rim(self, mesh: Mesh) -> Ints:
        """Return no edges: a moment acts in the plane."""
        return np.zeros((0, 2), dtype=np.int64)


# The cell that a facet of so many nodes is, by dimensions of the body, and Gauss points along its axes: forces of a
# pressure are the integral of shape functions times products of slopes, which they give exactly.
_FACETS = {
    (2, 2): ("line", 1),
    (2, 3): ("line3", 2),
    (3, 3): ("triangle", 1),
    (3, 4): ("quad", 2),
    (3, 6): ("triangle6", 3),
}


@dataclass(frozen=True)
class _Points:
    """Gauss points on a facet: shape functions, their slopes and weights, shapes (points, k), (points, k, axes)."""

    shape: Floats
    slopes: Floats
    weights: Floats


def _points(k: int, dim: int) -> _Points:
    name, n = _FACETS[dim, k]
    cell = CELL_SHAPES[name]
    at, weights = quadrature(cell.base, n)
    return _Points(cell.shapes(at), cell.slopes(at), weights)


class SurfacePressure:
    """A pressure times the volume that the free nodes of a surface sweep: energy, and the forces -p n on the surface.

    Forces are those of the whole surface, held nodes included; the tangent is that of the free nodes, where it is
    symmetric.
    """

    def __init__(self, nodes: Floats, facets: Ints, pressure: float, held: Bools) -> None:
        """Take reference positions [m], facets anticlockwise from outside, and the pressure, in 2D times thickness."""
        self.nodes, self._facets, self._pressure, self._free = nodes, facets, pressure, ~held
        self._points = _points(facets.shape[1], nodes.shape[1])
        self._pattern = Pattern(facets, *nodes.shape)

    def energy(self, positions: Floats) -> float:
        """Minus the work of the pressure as the free nodes move straight to their places, the others there [J]."""
        moved = np.where(self._free, positions - self.nodes, 0.0)
        start = positions - moved
        return float(sum(weight * (self.gradient(start + at * moved) * moved).sum() for at, weight in _GAUSS))

    def gradient(self, positions: Floats) -> Floats:
        """Minus the force on the nodes [N], shape (n_nodes, dim): p times the integral of N n over the surface."""
        points, dim = self._points, positions.shape[1]
        along = np.einsum("qka,fki->aqfi", points.slopes, positions[self._facets])
        normal = np.cross(along[0], along[1]) if dim == 3 else along[0][..., ::-1] * np.array([1.0, -1.0])
        forces = self._pressure * np.einsum("q,qk,qfi->fki", points.weights, points.shape, normal)
        return self._pattern.vector(forces.reshape(len(self._facets), -1))

    def hessian(self, positions: Floats) -> SparseMatrix:
        """The derivative of the gradient, its symmetric part [N/m]."""

        def symmetric(first: int, last: int) -> Floats:
            blocks = self._slopes(positions, first, last)
            return (blocks + blocks.swapaxes(1, 2)) / 2

        return self._pattern.summed(symmetric)

    def _slopes(self, positions: Floats, first: int, last: int) -> Floats:
        """The derivative of each facet's forces by its nodes, shape (n, k * dim, k * dim)."""
        points, dim = self._points, positions.shape[1]
        facets = self._facets[first:last]
        if dim == 2:
            turned = np.broadcast_to(np.array([[0.0, 1.0], [-1.0, 0.0]]), (1, len(points.weights), len(facets), 2, 2))
        else:
            along = np.einsum("qka,fki->aqfi", points.slopes, positions[facets])
            turned = np.stack([-_cross_matrix(along[1]), _cross_matrix(along[0])])
        weights = self._pressure * points.weights
        found = np.einsum("q,qk,qla,aqfij->fkilj", weights, points.shape, points.slopes, turned, optimize=True)
        n = facets.shape[1] * dim
        return np.asarray(found.reshape(len(facets), n, n))

    def refuse_open_edges(self) -> None:
        """Raise ProblemError where the derivative is not symmetric: the work of such a load depends on the way."""
        random = np.random.default_rng(1).uniform(-1.0, 1.0, self.nodes.shape)
        size = float(np.ptp(self.nodes[np.unique(self._facets)], axis=0).max())
        there = self.nodes + np.where(self._free, _DEFORMED * size * random, 0.0)
        tangent = self._pattern.summed(lambda first, last: self._slopes(there, first, last))
        slightly = _SYMMETRIC * float(np.abs(self._slopes(there, 0, len(self._facets))).max())
        free = sparse.diags_array(self._free.ravel().astype(float))
        within = sparse.csr_array(free @ sparse.csr_array(tangent) @ free)
        askew = abs(within - within.T)
        if askew.nnz and askew.max() > slightly:
            where = np.unique(np.flatnonzero(askew.max(axis=1).toarray() > slightly))
            nodes = np.unique(where // self.nodes.shape[1])
            some = ", ".join(map(str, nodes[:4])) + (", ..." if len(nodes) > 4 else "")
            raise ProblemError(
                f"this pressure has no potential: the edge of its surface is free to move at {len(nodes)} "
                f"node{'s' * (len(nodes) != 1)} ({some}). Hold the edge, or the direction across a plane that it lies "
                "in, or press on a closed surface; a dead traction has a potential everywhere"
            )


def _cross_matrix(v: Floats) -> Floats:
    """The matrix of v x, shape (..., 3, 3)."""
    matrix = np.zeros((*v.shape, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        matrix[..., i, j], matrix[..., i, k] = -v[..., k], v[..., j]
    return matrix


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
