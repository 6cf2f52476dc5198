"""Coulomb friction, regularised: a dissipation of the slip in a step, with the normal forces of an earlier state."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from truespring.arrays import Floats, Ints


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
