"""The work that is done during a motion, and its energies."""

from dataclasses import dataclass, field

import numpy as np

from truespring.arrays import Floats
from truespring.conditions import Loading, Touch
from truespring.dynamics import Energies


@dataclass(slots=True)
class Account:
    """The work of loads, supports and tools since the begin of a motion, and what was dissipated [J].

    A tool or grasp that begins to act brings the energy that it stores there, and takes along what it stores as it
    ceases: both count as its work.

    Attributes:
        done: work of loads, supports and tools.
        damped: energy dissipated by damping and friction.
        begin: energy at the begin, None before the first call of `energies`.
    """

    done: float = 0.0
    damped: float = 0.0
    begin: float | None = None
    _force: Floats | None = field(default=None, repr=False)
    _touches: tuple[Touch, ...] = field(default=(), repr=False)
    _level: float = field(default=0.0, repr=False)

    def open(self, loading: Loading, positions: Floats, level: float) -> None:
        """Begin at a state: `positions` [m], shape (n_nodes, dim)."""
        self._force, self._touches = loading.loads(positions, level), loading.touches(positions, level)
        self._level = level

    def step(self, loading: Loading, before: Floats, positions: Floats, level: float) -> None:
        """Add the work of loads and tools in a step to `positions` from those before [m], shape (n_nodes, dim).

        Forces and tools are those of the mean of begin and end.
        """
        assert self._force is not None
        force, touches = loading.loads(positions, level), loading.touches(positions, level)
        self.done += float(((force + self._force) * (positions - before)).sum()) / 2
        for last, now in zip(self._touches, touches, strict=True):
            self.done -= float((last.force + now.force) @ (now.place - last.place)) / 2
        self.done += sum(one.brought(before, self._level, level) for one in loading.interactions)
        self._force, self._touches, self._level = force, touches, level

    def support(self, reaction: Floats, moved: Floats) -> None:
        """Add the work of supports: a reaction [N] on nodes that moved [m], both of shape (n_nodes, dim)."""
        self.done += float((reaction * moved).sum())

    def energies(
        self, mass: Floats, velocity: Floats, elastic: float, loading: Loading, positions: Floats, level: float
    ) -> Energies:
        """Return the energies at a state.

        Args:
            mass: mass of the nodes [kg], shape (n_nodes,).
            velocity: [m/s], shape (n_nodes, dim).
            elastic: elastic energy [J].
            loading: loads and tools.
            positions: [m], shape (n_nodes, dim).
            level: share of the duration [-].
        """
        kinetic = float(np.einsum("n,ni,ni->", mass, velocity, velocity)) / 2
        contact = sum(one.stored(positions, level) for one in loading.interactions)
        total = kinetic + elastic - self.done + contact
        if self.begin is None:
            self.begin = total
        numerical = self.begin - total - self.damped
        return Energies(kinetic, elastic, -self.done, contact, self.damped, numerical)
