"""The errors of a session, each from a running measurement, at the time that it belongs to.

All are root-mean-square distances of nodes over the root-mean-square displacement of what counts as right, both from
the undeformed body, without nodes that are held in all directions, as in `comparison`.
"""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.live.ghost import Ghost
from truespring.live.session import Live
from truespring.richardson import remaining_error


class Frames(Protocol):
    """The last frames of a session."""

    def at(self, time: float) -> Floats | None:
        """Return the positions [m], shape (n_nodes, dim), at a time [s]; None if it is not kept."""
        ...


# Errors below this are shown as smaller than it.
_SMALLEST = 1e-5
# An error of the last moments is that of now [s].
_NOW = 0.05
# A body is where it was if it has moved by less than this share of its displacement.
_SAME_PLACE = 0.01


class Ending(Protocol):
    """What finds the ghosts.

    Attributes:
        ended: why it has ended, empty while it works.
    """

    ended: str


@dataclass(frozen=True, eq=False)
class Measured:
    """An error of a session.

    Attributes:
        error: [-].
        time: time of the session that it belongs to [s].
        says: how it was measured, in a few words.
        distances: distance of each node [m], shape (n_nodes,).
        frame: the session at that time [m], shape (n_nodes, dim); None if it is not kept.
        unrest: of a body held still, the distance of that frame from its own equilibrium [-]; None if not known.
    """

    error: float
    time: float
    says: str
    distances: Floats
    frame: Floats | None = None
    unrest: float | None = None

    def words(self, now: float, lasts: bool = False) -> str:
        """Return the error as text for a page at a time [s]; `lasts` if it is that of all the time since."""
        behind = max(0.0, now - self.time)
        late = f", {behind:.1f} s behind" if behind > _NOW and not lasts else ""
        restless = self.unrest is not None and self.unrest > _SAME_PLACE
        still_moves = f", from which it is {percent(self.unrest or 0.0)} away" if restless else ""
        return f"{percent(self.error)} {self.says}{still_moves}{late}"


def percent(error: float) -> str:
    """Return an error in percent with two digits: "2.3 %"; the smallest is "under 0.001 %"."""
    if not np.isfinite(error):
        return "not known"
    return f"{100 * error:.2g} %" if error >= _SMALLEST or not error else f"under {100 * _SMALLEST:g} %"


def relative(positions: Floats, right: Floats, undeformed: Floats, compared: Bools) -> float:
    """Return the rms distance over the rms displacement of what is right [-]; NaN without displacement.

    Positions have shape (n_nodes, dim) [m], `compared` (n_nodes,).
    """
    moved = (right - undeformed)[compared]
    size = float((moved**2).sum())
    return float(np.sqrt(((positions - right)[compared] ** 2).sum() / size)) if size else np.nan


class Measures:
    """The errors of a session beside its twin: model, time and solver."""

    def __init__(self, live: Live, twin: Ending | None = None) -> None:
        """Begin without errors; `twin` is what finds the ghosts, to say so if it has ended."""
        self._live, self._twin = live, twin
        self._known: dict[str, Measured] = {}
        self._mesh: object = None
        self._compared: Bools = np.zeros(0, dtype=bool)

    @property
    def model(self) -> Measured | None:
        """The error of the model: at rest while the body is where it was then, else the latest one."""
        rest, moving = self._known.get("rest"), self._known.get("moving")
        if rest is None or moving is None or self._lasts(rest) or rest.time > moving.time:
            return rest or moving
        return moving

    @property
    def time(self) -> Measured | None:
        """The error of the time step, by Richardson extrapolation from steps of half the length."""
        return self._known.get("finer")

    @property
    def solver(self) -> Measured | None:
        """The error of steps that are not solved to the end; None for explicit schemes, which solve nothing."""
        return self._known.get("solved")

    def take(self, ghost: Ghost, frames: Frames) -> None:
        """Compare a ghost with the session at the same time; leave it out if that frame is not kept.

        At rest, the equilibrium of the session's own model takes the place of the frame, if it is known.
        """
        own = frames.at(ghost.time)
        problem = self._live.problem
        right, nodes = ghost.positions, problem.mesh.nodes
        if right.shape != nodes.shape or any(one is not None and one.shape != nodes.shape for one in (own, ghost.own)):
            return  # the body was cut since
        of = {"rest": self._at_rest, "moving": self._moving, "finer": self._finer, "solved": self._solved}
        found = of[ghost.kind](ghost, own)
        if found is not None:
            self._known[ghost.kind] = found

    def restart(self) -> None:
        """Forget all errors: the session begins again."""
        self._known.clear()

    def words(self) -> dict[str, str]:
        """Return the errors that are known, as text by "model", "time" and "solver"."""
        now = self._live.time
        if any(one.time > now for one in self._known.values()):  # it has begun again
            self.restart()
        several = {"model": self.model, "time": self.time, "solver": self.solver}
        known = {name: one.words(now, self._lasts(one)) for name, one in several.items() if one is not None}
        if self._twin is not None and self._twin.ended:
            known["model"] = self._twin.ended
        if self._live.scheme.startswith("leapfrog"):
            known["solver"] = "none: explicit steps solve nothing"
        elif not self._live.settings.iterations:
            known["solver"] = "none: each step is solved to the tolerance"
        return known

    def _lasts(self, one: Measured) -> bool:
        """Return whether an error at rest is that of the present, too."""
        if one is not self._known.get("rest") or one.frame is None:
            return False
        positions = self._live.positions
        return positions.shape == one.frame.shape and self._relative(positions, one.frame) < _SAME_PLACE

    def _relative(self, positions: Floats, right: Floats) -> float:
        problem = self._live.problem
        if self._mesh is not problem.mesh:
            self._mesh, self._compared = problem.mesh, ~np.asarray(problem.loading.held.all(axis=1))
        return relative(positions, right, problem.mesh.nodes, self._compared)

    def _at_rest(self, ghost: Ghost, frame: Floats | None) -> Measured | None:
        """Return the model's error at rest."""
        mine = frame if ghost.own is None else ghost.own
        if mine is None:
            return None
        unrest = None if ghost.own is None or frame is None else self._relative(frame, ghost.own)
        says = "at rest" if ghost.own is not None else "held still"
        if ghost.coarse:
            says += f", by the difference of both models on {ghost.coarse} nodes"
        return replace(self._between(mine, ghost, says), frame=frame, unrest=unrest)

    def _moving(self, ghost: Ghost, frame: Floats | None) -> Measured | None:
        """Return the model's error in motion."""
        says = f"in motion since {ghost.since:.2f} s" if ghost.since else "in motion"
        return None if frame is None else self._between(frame, ghost, says)

    def _finer(self, ghost: Ghost, frame: Floats | None) -> Measured | None:
        """Return the error of time: of steps h, (x_h - x_h/2) 2^p / (2^p - 1), p the order of the scheme."""
        if frame is None:
            return None
        factor = 1 + remaining_error(1.0, ghost.order)
        right = replace(ghost, positions=frame - factor * (frame - ghost.positions))
        return self._between(frame, right, f"since {ghost.since:.2f} s, {factor:.3g} times the change by half the step")

    def _solved(self, ghost: Ghost, frame: Floats | None) -> Measured | None:
        """Return the error of a step that was not solved to the end."""
        return None if ghost.own is None else self._between(ghost.own, ghost, ghost.says)

    def _between(self, mine: Floats, ghost: Ghost, says: str) -> Measured:
        """Return the error of positions [m], shape (n_nodes, dim), where a ghost is right."""
        apart = np.linalg.norm(mine - ghost.positions, axis=1)
        return Measured(self._relative(mine, ghost.positions), ghost.time, says, apart)
