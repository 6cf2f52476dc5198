"""Contact of a tool with the surface of a body: forces on its nodes by their gaps, and friction."""

from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Slide, Touch
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


@dataclass(frozen=True, eq=False)
class Contact:
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

    def gaps(self, positions: Floats, level: float) -> tuple[Floats, Floats]:
        """Return the gaps of the nodes [m], shape (n,), and the normals [-], shape (n, dim).

        Nodes out of reach of the tool's bounds have an infinite gap and no normal.
        """
        places = positions[self.nodes] - self.track.at(level)
        lower, upper = self.shape.bounds
        near = ((places >= lower - self.law.reach) & (places <= upper + self.law.reach)).all(axis=1)
        gaps, normals = np.full(len(places), np.inf), np.zeros_like(places)
        gaps[near], normals[near] = self.shape.gaps(places[near])
        return gaps, normals

    def energy(self, positions: Floats, level: float) -> float:
        """Return the stored energy plus the dissipation since the begin of the step [J]; infinite inside a barrier."""
        stored = self.stored(positions, level)
        if self.friction is None:
            return stored
        return stored + self.friction.energy(positions[self.nodes], self.track.at(level))

    def stored(self, positions: Floats, level: float) -> float:
        """Return the stored energy alone [J]."""
        return float(self.areas @ self.law.energy(self.gaps(positions, level)[0]))

    def gradient(self, positions: Floats, level: float) -> Floats:
        """Return minus the force on the nodes [N], shape (n_nodes, dim)."""
        found = np.zeros_like(positions)
        found[self.nodes] = self._gradient(positions, level)
        return found

    def _gradient(self, positions: Floats, level: float) -> Floats:
        """Return minus the force on the nodes that the tool may touch [N], shape (n, dim)."""
        gaps, normals = self.gaps(positions, level)
        pushed: Floats = (self.areas * self.law.slope(gaps))[:, None] * normals
        if self.friction is not None:
            pushed = pushed + self.friction.gradient(positions[self.nodes], self.track.at(level))
        return pushed

    def blocks(self, positions: Floats, level: float) -> tuple[Ints, Floats]:
        """Return nodes, shape (n,), and the second derivatives of the energy [N/m], shape (n, dim, dim), symmetric.

        They are exact: on a convex tool they include the negative stiffness of nodes that slide off.
        """
        gaps, normals = self.gaps(positions, level)
        slid = np.zeros(len(gaps)) if self.friction is None else self.friction.limit
        near = np.flatnonzero((gaps < self.law.reach) | (slid > 0))
        gap, normal, areas = gaps[near], normals[near], self.areas[near]
        found = (areas * self.law.bend(gap))[:, None, None] * (normal[:, :, None] * normal[:, None, :])
        places = positions[self.nodes[near]]
        found += (areas * self.law.slope(gap))[:, None, None] * self.shape.bends(places - self.track.at(level))
        if self.friction is not None:
            found += self.friction.among(near).blocks(places, self.track.at(level))
        return self.nodes[near], found

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
        gaps, normals = self.gaps(positions, level)
        return -self.coefficient * self.areas * self.law.slope(gaps), normals

    def slide(self, positions: Floats, level: float) -> Slide:
        """Return the largest friction of the nodes that touch, for schemes that apply it node by node."""
        limit, normals = self._limit(positions, level)
        there = limit > 0
        return Slide(self.nodes[there], normals[there], limit[there], self.track.velocity(level))

    def cleared(self, positions: Floats, level: float) -> Floats:
        """Return positions with the nodes inside of a barrier moved out of it [m], shape (n_nodes, dim)."""
        gaps, normals = self.gaps(positions, level)
        inside = np.flatnonzero(gaps < self.law.clearance)
        if not len(inside):
            return positions
        moved = positions.copy()
        moved[self.nodes[inside]] += (self.law.clearance - gaps[inside])[:, None] * normals[inside]
        return moved

    def touch(self, positions: Floats, level: float) -> Touch:
        """Return place, force of the body on the tool, and depth, which is zero as long as a barrier holds."""
        gaps, _ = self.gaps(positions, level)
        force = self._gradient(positions, level).sum(axis=0)
        return Touch(self.track.at(level), force, max(0.0, -float(gaps.min())))

    def largest_stiffness(self) -> Floats:
        """Return an upper bound of the stiffness of each node without friction [N/m], shape (n_nodes,).

        Infinite for a barrier.
        """
        found = np.zeros(self.n_nodes)
        found[self.nodes] = self.areas * self.law.largest
        return found
