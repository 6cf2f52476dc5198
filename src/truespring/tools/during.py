"""Tools and grasps that act in a part of the way only."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Interaction, Slide, Touch
from truespring.errors import ToolError

# Levels that differ by this share of the way are equal: sums of steps have rounding errors.
_SAME = 1e-9


def interval(name: str, during: Sequence[float] | None, span: float) -> tuple[float, float] | None:
    """Return the begin and the end of an interval as places on the way; None for the whole way.

    Args:
        name: what acts in it, for messages.
        during: begin and end, as shares of the way at rest, in motion as times [s]; None for the whole way.
        span: place on the way at level 1: 1 at rest, the duration in motion [s].

    Raises ToolError unless they are numbers that ascend, from 0 to `span`.
    """
    if during is None:
        return None
    try:
        found = np.array(during, dtype=float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    slack = _SAME * span
    ascend = found.shape == (2,) and -slack <= found[0] < found[1] - slack and found[1] <= span + slack
    if not ascend:
        raise ToolError(
            name,
            f"{during!r}: give the begin and the end of the interval in which it acts, ascending from 0 to {span:g} "
            "(shares of the way at rest, seconds in motion); leave it out for the whole way",
            "during",
        )
    return max(0.0, float(found[0])), min(span, float(found[1]))


def limited(action: Interaction, during: tuple[float, float] | None, span: float) -> Interaction:
    """Return an action within an interval of places on the way, see `interval`; None for the whole way."""
    if during is None:
        return action
    return During(action, during[0] / span, during[1] / span)


def during_words(during: Sequence[float] | None) -> str:
    """Return an interval for tables, ", acts from 0.2 to 1.4"; empty without one."""
    return "" if during is None else f", acts from {during[0]:g} to {during[1]:g}"


@dataclass(frozen=True, eq=False)
class During:
    """An action that is there at levels above `begin`, up to and with `end`; an Interaction.

    Outside, it exerts no force and stores no energy. What it stores as it begins to act comes from outside, and what it
    stores as it ceases goes there, see `brought`.

    Attributes:
        action: the tool or grasp.
        begin, end: levels [-].
    """

    action: Interaction
    begin: float
    end: float

    @property
    def name(self) -> str:
        """The name, for tables."""
        return self.action.name

    @property
    def corners(self) -> tuple[float, ...]:
        """The levels between 0 and 1 at which it begins or ceases to act, or between them its path has a corner [-]."""
        within = {corner for corner in self.action.corners if self.begin < corner < self.end}
        return tuple(sorted(within.union(self.switches)))

    @property
    def switches(self) -> tuple[float, ...]:
        """The levels between 0 and 1 at which it begins or ceases to act [-]."""
        return tuple(level for level in (self.begin, self.end) if 0 < level < 1)

    @property
    def dissipates(self) -> bool:
        """Whether there is friction while it acts."""
        return self.action.dissipates

    def acts(self, level: float) -> bool:
        """Return whether it acts at a level."""
        return self.begin + _SAME < level <= self.end + _SAME

    def brought(self, positions: Floats, before: float, level: float) -> float:
        """Return the energy that it brings, or minus that which it takes along, in a step between two levels [J]."""
        change = int(self.acts(level)) - int(self.acts(before))
        if not change:
            return 0.0
        # The mean of both places: it acts on the whole step or not at all, and its work in a step is that of the mean
        # of its forces at the begin and at the end, one of which is zero.
        return change * (self.action.stored(positions, before) + self.action.stored(positions, level)) / 2

    def energy(self, positions: Floats, level: float) -> float:
        """Return the stored energy plus the dissipation since the begin of the step [J]."""
        return self.action.energy(positions, level) if self.acts(level) else 0.0

    def stored(self, positions: Floats, level: float) -> float:
        """Return the stored energy alone [J]."""
        return self.action.stored(positions, level) if self.acts(level) else 0.0

    def gradient(self, positions: Floats, level: float) -> Floats:
        """Return minus the force on the nodes [N], shape (n_nodes, dim)."""
        return self.action.gradient(positions, level) if self.acts(level) else np.zeros_like(positions)

    def blocks(self, positions: Floats, level: float) -> tuple[Ints, Floats]:
        """Return nodes, shape (n,), and their second derivatives [N/m], shape (n, dim, dim), symmetric."""
        if self.acts(level):
            return self.action.blocks(positions, level)
        dim = positions.shape[1]
        return np.zeros(0, dtype=np.int64), np.zeros((0, dim, dim))

    def since(self, positions: Floats, level: float, creep: float) -> "During":
        """Return the action in a step that begins at a state."""
        return replace(self, action=self.action.since(positions, level, creep))

    def lagged(self, positions: Floats, level: float) -> "During":
        """Return the action with the normal forces of a state, for friction; unchanged where it does not act."""
        return replace(self, action=self.action.lagged(positions, level)) if self.acts(level) else self

    def rubbed(self, force: Floats) -> "During":
        """Return the action with friction on the nodes that a scheme has found [N], shape (n_nodes, dim)."""
        return replace(self, action=self.action.rubbed(force))

    def slide(self, positions: Floats, level: float) -> Slide:
        """Return the largest friction at a state; without nodes where it does not act."""
        found, acting = self.action.slide(positions, level), slice(None if self.acts(level) else 0)
        return Slide(found.nodes[acting], found.normals[acting], found.limit[acting], found.velocity)

    def cleared(self, positions: Floats, level: float) -> Floats:
        """Return positions of finite energy near others [m], shape (n_nodes, dim)."""
        return self.action.cleared(positions, level) if self.acts(level) else positions

    def touch(self, positions: Floats, level: float) -> Touch:
        """Return place, force and depth at a state: no force where it does not act."""
        found = self.action.touch(positions, level)
        return found if self.acts(level) else Touch(found.place, np.zeros_like(found.force), 0.0, acts=False)

    def largest_stiffness(self) -> Floats:
        """Return an upper bound of the stiffness of each node while it acts [N/m], shape (n_nodes,)."""
        return self.action.largest_stiffness()
