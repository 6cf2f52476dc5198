"""What the levels of a result are: load factors, shares of the way, or times; their names in labels and sentences."""

from dataclasses import dataclass
from typing import TypeVar

from truespring.arrays import Floats
from truespring.loading import History
from truespring.problem import Problem
from truespring.report.quantity import Scale
from truespring.report.result import Result

# Rows of a history that are listed.
_MOST_ROWS = 6

_Number = TypeVar("_Number", float, Floats)


@dataclass(frozen=True, slots=True)
class Axis:
    """The axis of the levels of a result.

    Attributes:
        name: name of the values: "load factor", "time".
        unit: unit of the values, empty without one.
        span: value at level 1.
        level: what a level is called: "load level", "time".
        full: name of level 1: "full load", "0.4 s".
        at_full: what errors of the whole result refer to: "at full load", "over the whole motion of 0.4 s".
        up_to_full: all levels: "up to full load", "over the whole motion of 0.4 s".
        written: a level in words, with its value in place of {}: "load factor {}", "{} s".
        between: two levels in words: "load factors {} and {}".
        stops: what a model does that stops before level 1: "found no equilibrium".
        moves: whether the levels are times of a motion.
    """

    name: str
    unit: str
    span: float
    level: str
    full: str
    at_full: str
    up_to_full: str
    written: str
    between: str
    stops: str = "found no equilibrium"
    moves: bool = False

    def value(self, level: _Number) -> _Number:
        """Return the value of levels, in `unit`."""
        return level * self.span

    def number(self, level: float, digits: int = 4) -> str:
        """Return the value of a level as text, without unit."""
        return f"{level * self.span:.{digits}g}"

    def exact(self, level: float) -> str:
        """Return a level in words by its value, also level 1."""
        return self.written.format(self.number(level))

    def words(self, level: float) -> str:
        """Return a level in words: level 1 by its name."""
        return self.full if level == 1 else self.exact(level)

    def both(self, first: float, second: float) -> str:
        """Return two levels in words."""
        return self.between.format(self.number(first), self.number(second))

    @property
    def label(self) -> str:
        """The label of an axis of a plot."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def axis_of(result: Result) -> Axis:
    """Return the axis of a result: times of a motion, shares of a way with histories or tools, else load factors."""
    problem = result.problem
    if problem.stated and problem.dynamics is not None:
        return _times(problem.dynamics.duration)
    if problem.stated and problem.returns:
        return _way("over the whole way", "over the whole way")
    if problem.stated and problem.touching:
        return _way("at the end of the way", "up to the end of the way")
    if _by_displacement(result):
        return _load("full displacement", "{} of the displacement", "{} and {} of the displacement")
    full = "full motion" if driven_by_motion(result) else "full load"
    return _load(full, "load factor {}", "load factors {} and {}")


def driven_by_motion(result: Result) -> bool:
    """Return whether supports move and no load acts."""
    return result.problem.stated and result.problem.loading.driven_by_motion


def history_words(problem: Problem, over: History | None) -> str:
    """Return the shares of a load or support along the way, as the end of a clause; empty without a history."""
    if over is None:
        return ""
    if problem.duration is None:
        rows = [f"{share:g} at {place:g}" for place, share in over]
        where = " of the way"
    else:
        scale = time_scale(problem.duration)
        rows = [f"{share:g} at {place / scale.size:g} {scale.unit}" for place, share in over]
        where = ""
    shown = rows if len(rows) <= _MOST_ROWS else [*rows[: _MOST_ROWS - 2], "...", rows[-1]]
    return f", times {', '.join(shown)}{where}"


def time_scale(duration: float) -> Scale:
    """Return the unit in which times up to `duration` [s] are written: seconds from 0.1 s on."""
    units = (Scale(1.0, "s"), Scale(1e-3, "ms"))
    return next((one for one in units if duration >= 0.1 * one.size * (1 - 1e-9)), Scale(1e-6, "µs"))


def _times(duration: float) -> Axis:
    scale = time_scale(duration)
    span = duration / scale.size
    full = f"{span:.4g} {scale.unit}"
    whole = f"over the whole motion of {full}"
    written, between = f"{{}} {scale.unit}", f"{{}} {scale.unit} and {{}} {scale.unit}"
    return Axis(
        "time", scale.unit, span, "time", full, whole, whole, written, between, "could not be followed", moves=True
    )


def _way(at_full: str, up_to_full: str) -> Axis:
    between = "{} and {} of the way"
    return Axis(
        "share of the way",
        "",
        1.0,
        "share of the way",
        "the end of the way",
        at_full,
        up_to_full,
        "{} of the way",
        between,
    )


def _load(full: str, written: str, between: str) -> Axis:
    return Axis("load factor", "", 1.0, "load level", full, f"at {full}", f"up to {full}", written, between)


def _by_displacement(result: Result) -> bool:
    """Return whether the displacement was controlled and the load factor is part of the solution."""
    states = [state for path in result.solutions.values() for state in path.states if not state.critical]
    return any(state.level is not None and abs(state.level - state.load_factor) > 1e-9 for state in states)
