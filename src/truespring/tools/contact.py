"""Contact of a tool with the surface of a body: forces on its nodes by their gaps, and friction."""

from dataclasses import dataclass, replace
from typing import NamedTuple, Protocol, Self

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Always, Slide, Touch
from truespring.tools.friction import Friction, Given, Rubbing
from truespring.tools.laws import Law
from truespring.tools.path import Track


class Shape(Protocol):
    """The surface of a rigid body."""

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Smallest and largest coordinates of the body [m], shape (dim,) each or one number; may be infinite."""
        ...

    def gaps(self, places: Floats) -> tuple[Floats, Floats]:
        """Return the gaps at places relative to that of the body [m], negative inside, and their gradients [-].

        Gaps have shape (n,); the gradients, unit normals that point away from the body, have the shape of the places,
        (n, dim).
        """
        ...

    def bends(self, places: Floats) -> Floats:
        """Return the second derivatives of the gap [1/m], shape (n, dim, dim); symmetric."""
        ...


class Near(NamedTuple):
    """Nodes near a tool.

    Attributes:
        rows: their places among the nodes of a contact, shape (n,).
        gaps: [m], shape (n,).
        normals: shape (n, dim).
    """

    rows: Ints
    gaps: Floats
    normals: Floats

    def on_all(self, n_nodes: int, dim: int) -> tuple[Floats, Floats]:
        """Return gaps and normals of all nodes of the contact; others have an infinite gap and no normal."""
        gaps, normals = np.full(n_nodes, np.inf), np.zeros((n_nodes, dim))
        gaps[self.rows], normals[self.rows] = self.gaps, self.normals
        return gaps, normals


@dataclass(frozen=True, eq=False)
class Contact(Always):
    """Contact of a tool with nodes of a surface, an Interaction.

    Attributes:
        name: name of the tool.
        shape: its surface.
        track: its path.
        law: energy per area over the gap.
        nodes: the nodes that it may touch, shape (n,).
        areas: their shares of the undeformed surface, times thickness in the plane [m^2], shape (n,); positive.
        n_nodes: number of all nodes.
        coefficient: coefficient of friction [-].
        friction: friction in the present step; None outside of steps and without friction.
    """

    name: str
    shape: Shape
    track: Track
    law: Law
    nodes: Ints
    areas: Floats
    n_nodes: int
    coefficient: float = 0.0
    friction: Rubbing | None = None

    @property
    def corners(self) -> tuple[float, ...]:
        """The levels between 0 and 1 at which the path has a corner [-]."""
        return self.track.corners

    @property
    def dissipates(self) -> bool:
        """Whether there is friction."""
        return self.coefficient > 0

    def near(self, positions: Floats, level: float) -> Near:
        """Return the nodes that lie within the bounds of the tool and its reach."""
        places = positions.take(self.nodes, axis=0) - self.track.at(level)
        lower, upper = self.shape.bounds
        there = (places >= lower - self.law.reach) & (places <= upper + self.law.reach)
        rows = np.flatnonzero(np.logical_and.reduce(there.T))
        if not len(rows):
            return Near(rows, np.zeros(0), np.zeros((0, positions.shape[1])))
        return Near(rows, *self.shape.gaps(places.take(rows, axis=0)))

    def energy(self, positions: Floats, level: float) -> float:
        """Return the stored energy plus the dissipation since the begin of the step [J]; infinite inside a barrier."""
        stored = self.stored(positions, level)
        if self.friction is None:
            return stored
        return stored + self.friction.energy(positions[self.nodes], self.track.at(level))

    def stored(self, positions: Floats, level: float) -> float:
        """Return the stored energy alone [J]."""
        near = self.near(positions, level)
        return float(self.areas[near.rows] @ self.law.energy(near.gaps))

    def gradient(self, positions: Floats, level: float) -> Floats:
        """Return minus the force on the nodes [N], shape (n_nodes, dim)."""
        found, near = np.zeros_like(positions), self.near(positions, level)
        if len(near.rows):
            found[self.nodes[near.rows]] = self._pushed(near)
        if self.friction is not None:
            found[self.nodes] += self.friction.gradient(positions[self.nodes], self.track.at(level))
        return found

    def _pushed(self, near: Near) -> Floats:
        """Return minus the normal force on nodes [N], shape (n, dim)."""
        return np.asarray((self.areas[near.rows] * self.law.slope(near.gaps))[:, None] * near.normals)

    def blocks(self, positions: Floats, level: float) -> tuple[Ints, Floats]:
        """Return nodes, shape (n,), and the second derivatives of the energy [N/m], shape (n, dim, dim), symmetric.

        They are exact: on a convex tool they include the negative stiffness of nodes that slide off.
        """
        near = self.near(positions, level)
        rows, gaps, normals = near.rows, near.gaps, near.normals
        if self.friction is not None:  # it may act on nodes that have left the tool
            rows = np.arange(len(self.nodes))
            gaps, normals = near.on_all(len(rows), positions.shape[1])
        slid = np.zeros(len(rows)) if self.friction is None else self.friction.limit
        act = np.flatnonzero((gaps < self.law.reach) | (slid > 0))
        rows, gap, normal = rows[act], gaps[act], normals[act]
        areas, places = self.areas[rows], positions[self.nodes[rows]]
        found = (areas * self.law.bend(gap))[:, None, None] * (normal[:, :, None] * normal[:, None, :])
        found += (areas * self.law.slope(gap))[:, None, None] * self.shape.bends(places - self.track.at(level))
        if self.friction is not None:
            found += self.friction.among(rows).blocks(places, self.track.at(level))
        return self.nodes[rows], found

    def since(self, positions: Floats, level: float, creep: float) -> Self:
        """Return the contact in a step that begins at a state; friction is full from a slip of `creep` [m] on."""
        if not self.dissipates:
            return self
        begin, limit, normals = positions[self.nodes].copy(), *self._limit(positions, level)
        return replace(self, friction=Friction(begin, self.track.at(level), normals, limit, creep))

    def lagged(self, positions: Floats, level: float) -> Self:
        """Return the contact with the normal forces of a state, for friction; the step begins where it did."""
        if self.friction is None:
            return self
        limit, normals = self._limit(positions, level)
        return replace(self, friction=self.friction.renewed(normals, limit))

    def rubbed(self, force: Floats) -> Self:
        """Return the contact with friction on the nodes that a scheme has found [N], shape (n_nodes, dim)."""
        return replace(self, friction=Given(force[self.nodes]))

    def _limit(self, positions: Floats, level: float) -> tuple[Floats, Floats]:
        """Return the largest friction of each node [N], shape (n,), and the normals, shape (n, dim)."""
        gaps, normals = self.near(positions, level).on_all(len(self.nodes), positions.shape[1])
        return -self.coefficient * self.areas * self.law.slope(gaps), normals

    def slide(self, positions: Floats, level: float) -> Slide:
        """Return the largest friction of the nodes that touch, for schemes that apply it node by node."""
        near = self.near(positions, level)
        limit = -self.coefficient * self.areas[near.rows] * self.law.slope(near.gaps)
        there = limit > 0
        nodes = self.nodes[near.rows[there]]
        return Slide(nodes, near.normals[there], limit[there], self.track.velocity(level))

    def cleared(self, positions: Floats, level: float) -> Floats:
        """Return positions with the nodes inside of a barrier moved out of it [m], shape (n_nodes, dim)."""
        near = self.near(positions, level)
        inside = near.gaps < self.law.clearance
        if not inside.any():
            return positions
        moved = positions.copy()
        out = (self.law.clearance - near.gaps[inside])[:, None] * near.normals[inside]
        moved[self.nodes[near.rows[inside]]] += out
        return moved

    def touch(self, positions: Floats, level: float) -> Touch:
        """Return place, force of the body on the tool, and depth, which is zero as long as a barrier holds."""
        near, place = self.near(positions, level), self.track.at(level)
        force = self._pushed(near).sum(axis=0)
        if self.friction is not None:
            force = force + self.friction.gradient(positions[self.nodes], place).sum(axis=0)
        return Touch(place, force, max(0.0, -float(near.gaps.min(initial=0.0))))

    def largest_stiffness(self) -> Floats:
        """Return an upper bound of the stiffness of each node without friction [N/m], shape (n_nodes,).

        Infinite for a barrier.
        """
        found = np.zeros(self.n_nodes)
        found[self.nodes] = self.areas * self.law.largest
        return found
