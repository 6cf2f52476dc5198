"""Coulomb friction: regularised, a dissipation of the slip in a step; or given by a scheme that applies it itself."""

from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np

from truespring.arrays import Floats, Ints


class Rubbing(Protocol):
    """Friction on nodes in a step; `positions` [m] have shape (n, dim), `place` is that of the tool [m]."""

    @property
    def limit(self) -> Floats:
        """Coefficient of friction times normal force of nodes whose friction depends on the slip [N], shape (n,)."""
        ...

    def renewed(self, normals: Floats, limit: Floats) -> Self:
        """Return the friction with other normals and limits."""
        ...

    def among(self, which: Ints) -> Self:
        """Return the friction of some of the nodes, shape (m,)."""
        ...

    def energy(self, positions: Floats, place: Floats) -> float:
        """Return the dissipation since the begin of the step [J]."""
        ...

    def gradient(self, positions: Floats, place: Floats) -> Floats:
        """Return minus the friction on the nodes [N], shape (n, dim)."""
        ...

    def blocks(self, positions: Floats, place: Floats) -> Floats:
        """Return the second derivatives [N/m], shape (n, dim, dim), positive semidefinite."""
        ...


@dataclass(frozen=True, eq=False)
class Given:
    """Friction that a scheme has found, with its dissipation: constant forces on the nodes [N], shape (n, dim)."""

    force: Floats

    @property
    def limit(self) -> Floats:
        """Zeros."""
        return np.zeros(len(self.force))

    def renewed(self, normals: Floats, limit: Floats) -> Self:
        """Return the friction itself."""
        return self

    def among(self, which: Ints) -> Self:
        """Return the friction of some of the nodes, shape (m,)."""
        return replace(self, force=self.force[which])

    def energy(self, positions: Floats, place: Floats) -> float:
        """Return zero: the scheme accounts for the dissipation."""
        return 0.0

    def gradient(self, positions: Floats, place: Floats) -> Floats:
        """Return minus the forces [N]."""
        return -self.force

    def blocks(self, positions: Floats, place: Floats) -> Floats:
        """Return zeros."""
        n, dim = self.force.shape
        return np.zeros((n, dim, dim))


@dataclass(frozen=True, eq=False)
class Friction:
    """Dissipation D = sum mu N f(|slip|) in a step; N and the tangent plane are those of an earlier state.

    f = y^2/c - y^3/(3 c^2) up to the slip c, y - c/3 beyond: its slope is 1 from c on (Li et al., Incremental Potential
    Contact, 2020). The slip is the tangential motion of a node relative to the tool since the begin of the step.

    Attributes:
        begin: positions of the nodes at the begin of the step [m], shape (n, dim).
        place: place of the tool then [m], shape (dim,).
        normals: unit normals, shape (n, dim).
        limit: coefficient of friction times normal force [N], shape (n,).
        creep: c [m].
    """

    begin: Floats
    place: Floats
    normals: Floats
    limit: Floats
    creep: float

    def renewed(self, normals: Floats, limit: Floats) -> Self:
        """Return the friction with the normals and limits of another state; the step begins where it did."""
        return replace(self, normals=normals, limit=limit)

    def among(self, which: Ints) -> Self:
        """Return the friction of some of the nodes, shape (m,)."""
        return replace(self, begin=self.begin[which], normals=self.normals[which], limit=self.limit[which])

    def energy(self, positions: Floats, place: Floats) -> float:
        """Return the dissipation since the begin of the step [J]; `positions` [m], shape (n, dim), `place` [m]."""
        size = np.linalg.norm(self._slip(positions, place), axis=1)
        share = np.minimum(size / self.creep, 1.0)
        within = self.creep * share**2 * (1 - share / 3)
        return float(self.limit @ (within + np.maximum(size - self.creep, 0.0)))

    def gradient(self, positions: Floats, place: Floats) -> Floats:
        """Return minus the friction on the nodes [N], shape (n, dim)."""
        slip = self._slip(positions, place)
        return np.asarray((self.limit * self._secant(np.linalg.norm(slip, axis=1)))[:, None] * slip)

    def blocks(self, positions: Floats, place: Floats) -> Floats:
        """Return the second derivatives [N/m], shape (n, dim, dim), positive semidefinite."""
        slip = self._slip(positions, place)
        size = np.linalg.norm(slip, axis=1)
        secant, tangent = self._secant(size), np.maximum(2 / self.creep * (1 - size / self.creep), 0.0)
        along = slip / np.maximum(size, np.finfo(float).tiny)[:, None]
        plane = np.eye(slip.shape[1]) - self.normals[:, :, None] * self.normals[:, None, :]
        line = along[:, :, None] * along[:, None, :]
        across = self.limit * secant
        return np.asarray(across[:, None, None] * plane + (self.limit * tangent - across)[:, None, None] * line)

    def _slip(self, positions: Floats, place: Floats) -> Floats:
        """Return the tangential motion relative to the tool [m], shape (n, dim)."""
        motion = (positions - self.begin) - (place - self.place)
        return np.asarray(motion - (motion * self.normals).sum(axis=1)[:, None] * self.normals)

    def _secant(self, size: Floats) -> Floats:
        """Return the slope of f over the slip [1/m], shape (n,), from the size of the slip [m]."""
        within = (2 - size / self.creep) / self.creep
        return np.where(size < self.creep, within, 1 / np.maximum(size, self.creep))
