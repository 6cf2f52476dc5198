"""A pressure that follows the body; its potential is pressure times the volume that the surface sweeps.

A potential exists if the edge of the surface is held or slides in a plane, or if the surface is closed. The work of any
other pressure depends on the path, and its tangent is not symmetric.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints
from truespring.assembly import Pattern
from truespring.loading.body import Body
from truespring.loading.history import History
from truespring.loading.load import Along, FacePressure, FollowingLoad, Mark
from truespring.loading.values import number
from truespring.loading.words import selection_words
from truespring.mesh import CELL_SHAPES, Mesh, Selection, loaded, outer_facets, quadrature
from truespring.mesh.rows import ascending, distinct_rows
from truespring.potential import SparseMatrix

# Forces of a pressure are quadratic polynomials along a straight motion: two Gauss points integrate the work exactly.
_GAUSS = ((0.5 - 0.5 / np.sqrt(3), 0.5), (0.5 + 0.5 / np.sqrt(3), 0.5))
# A load has a potential if its tangent is symmetric up to the first share of its size, at positions that are displaced
# by up to the second share of the surface's size.
_SYMMETRIC, _DEFORMED = 1e-9, 0.05
# A resultant below this share of the sum of forces is zero: the pressure acts on a closed surface.
_BALANCED = 1e-6


@dataclass(frozen=True)
class Pressure(FollowingLoad):
    """A `pressure` [Pa] on the boundary facets `on`, positive towards the body, which stays normal to them.

    `on` is a group of facets; or a side, another group of the mesh, a Plane, a Box or node numbers, which select the
    boundary facets that have all their nodes in the selection.

    Example:
        >>> import truespring as ts
        >>> ts.Pressure("top", 200.0).words()
        "pressure 200 Pa on 'top'"
    """

    on: Selection
    pressure: float
    over: History | None = field(default=None, kw_only=True)
    instead = "a traction, which is dead"

    def following(self, body: Body, held: Bools) -> "SurfacePressure":
        """Return minus the work of the pressure and its derivatives; see SurfacePressure.symmetric."""
        pressure = number(self.pressure, "pressure", "Pa")
        facets = body.whole(outer_facets(body.mesh, self.on))
        return SurfacePressure(body.nodes, facets, body.thickness * pressure, held)

    def rim(self, mesh: Mesh) -> Ints:
        """Return the edges of the loaded surface in 3D as node numbers, shape (n, 2)."""
        facets = outer_facets(mesh, self.on)
        if mesh.dim == 2:
            return np.zeros((0, 2), dtype=np.int64)
        edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=2).reshape(-1, 2)
        found = distinct_rows(ascending(edges.T))
        return np.asarray(edges[found.first[found.count == 1]])

    def scaled(self, factor: float) -> Self:
        """Return the load multiplied by a factor."""
        return replace(self, pressure=factor * self.pressure)

    def mark(self, body: Body, held: Bools) -> Mark:
        """Return the facets, and an arrow along the total force on the body at rest, or on one node if it is zero."""
        force = -self.following(body, held).gradient(body.nodes)
        nodes = loaded(body.mesh, self.on)
        total = force.sum(axis=0)
        if np.linalg.norm(total) < _BALANCED * np.abs(force).sum():  # a closed surface
            nodes = nodes[[body.mesh.nodes[nodes, 0].argmax()]]
            total = force[nodes[0]]
        return Mark(nodes, total, "p", self.pressure, "Pa", self._along(body.mesh))

    def _along(self, mesh: Mesh) -> Along:
        corners = mesh.nodes[outer_facets(mesh, self.on)]
        if mesh.dim == 2:
            across = (corners[:, 1] - corners[:, 0])[:, ::-1] * np.array([1.0, -1.0])
        else:
            across = np.cross(corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1])
            if corners.shape[1] == 3:
                across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        outward = across / np.linalg.norm(across, axis=1, keepdims=True)
        return Along(corners.mean(axis=1), outward, -self.pressure * outward)

    def words(self) -> str:
        """Return the pressure and where it acts."""
        return f"pressure {self.pressure:g} Pa on {selection_words(self.on)}"

    def cards(self, mesh: Mesh) -> tuple[FacePressure]:
        """Return the pressure on each facet."""
        facets = outer_facets(mesh, self.on)
        return (FacePressure(facets, np.full(len(facets), float(self.pressure))),)


# Cell and number of Gauss points along each axis for a facet, by dimension of the body and number of nodes. They
# integrate the forces, shape functions times products of their derivatives, exactly.
_FACETS = {
    (2, 2): ("line", 1),
    (2, 3): ("line3", 2),
    (3, 3): ("triangle", 1),
    (3, 4): ("quad", 2),
    (3, 6): ("triangle6", 3),
}


@dataclass(frozen=True)
class _Points:
    """Gauss points on a facet.

    Attributes:
        shape: shape functions at the points, shape (points, k).
        slopes: their derivatives by the local coordinates, shape (points, k, axes).
        weights: weights of the points, shape (points,).
    """

    shape: Floats
    slopes: Floats
    weights: Floats


def _points(k: int, dim: int) -> _Points:
    name, n = _FACETS[dim, k]
    cell = CELL_SHAPES[name]
    at, weights = quadrature(cell.base, n)
    return _Points(cell.shapes(at), cell.slopes(at), weights)


class SurfacePressure:
    """Pressure times the volume that the free nodes of the surface sweep: a potential if `symmetric`.

    The gradient includes the forces on held nodes. The hessian is symmetrised, which changes nothing for free nodes if
    there is a potential.
    """

    def __init__(self, nodes: Floats, facets: Ints, pressure: float, held: Bools) -> None:
        """Store the pressure on a surface.

        Args:
            nodes: undeformed positions of all nodes [m], shape (n_nodes, dim).
            facets: node numbers of each facet, anticlockwise from outside, shape (n, k).
            pressure: the pressure [Pa]; in 2D times the thickness [N/m].
            held: whether each displacement is prescribed, shape (n_nodes, dim).
        """
        self.nodes, self._facets, self._pressure, self._free = nodes, facets, pressure, ~held
        self._points = _points(facets.shape[1], nodes.shape[1])
        self._pattern = Pattern(facets, *nodes.shape)

    def energy(self, positions: Floats) -> float:
        """Return minus the work [J] of the pressure on a straight motion of the free nodes to `positions`.

        Held nodes are at their final positions throughout. Without a potential, other motions do other work.
        """
        moved = np.where(self._free, positions - self.nodes, 0.0)
        start = positions - moved
        return float(sum(weight * (self.gradient(start + at * moved) * moved).sum() for at, weight in _GAUSS))

    def gradient(self, positions: Floats) -> Floats:
        """Return minus the nodal forces [N], shape (n_nodes, dim): p times the integral of N n over the surface."""
        points, dim = self._points, positions.shape[1]
        along = np.einsum("qka,fki->aqfi", points.slopes, positions[self._facets])
        normal = np.cross(along[0], along[1]) if dim == 3 else along[0][..., ::-1] * np.array([1.0, -1.0])
        forces = self._pressure * np.einsum("q,qk,qfi->fki", points.weights, points.shape, normal)
        return self._pattern.vector(forces.reshape(len(self._facets), -1))

    def hessian(self, positions: Floats) -> SparseMatrix:
        """Return the symmetric part of the derivative of the gradient [N/m], shape (n_nodes dim, n_nodes dim)."""

        def symmetric(first: int, last: int) -> Floats:
            blocks = self._slopes(positions, first, last)
            return (blocks + blocks.swapaxes(1, 2)) / 2

        return self._pattern.summed(symmetric)

    def tangent(self, positions: Floats) -> SparseMatrix:
        """Return the derivative of the gradient [N/m], shape (n_nodes dim, n_nodes dim), not symmetric at edges."""
        return self._pattern.summed(lambda first, last: self._slopes(positions, first, last))

    def _slopes(self, positions: Floats, first: int, last: int) -> Floats:
        """Return the derivative of the gradient of a range of facets by their nodes [N/m], shape (n, k dim, k dim)."""
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

    @cached_property
    def symmetric(self) -> bool:
        """Whether the tangent of the free nodes is symmetric: the work then does not depend on the path."""
        random = np.random.default_rng(1).uniform(-1.0, 1.0, self.nodes.shape)
        size = float(np.ptp(self.nodes[np.unique(self._facets)], axis=0).max())
        there = self.nodes + np.where(self._free, _DEFORMED * size * random, 0.0)
        slightly = _SYMMETRIC * float(np.abs(self._slopes(there, 0, len(self._facets))).max())
        free = sparse.diags_array(self._free.ravel().astype(float))
        within = sparse.csr_array(free @ sparse.csr_array(self.tangent(there)) @ free)
        return bool(abs(within - within.T).max() <= slightly)


def _cross_matrix(v: Floats) -> Floats:
    """Return the matrix M with M w = v x w, shape (..., 3, 3)."""
    matrix = np.zeros((*v.shape, 3))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        matrix[..., i, j], matrix[..., i, k] = -v[..., k], v[..., j]
    return matrix
