"""Sentences on the forces and torques of moved supports."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.comparison import Comparison
from truespring.reactions import SupportForce, moved_supports
from truespring.report.quantity import percent, quantity
from truespring.report.result import Result
from truespring.report.verdict.drive import axis_name
from truespring.report.verdict.naming import display_name, level_name, subject
from truespring.support_errors import SupportError


def force_sentence(result: Result) -> str | None:
    """Return force and torque of each moved support in each model; None if no support moves or they are unknown.

    A force is positive along the displacement of its support, a torque about the axis of its rotation; a negative one
    holds the body back. Those at the last level; where displacements may return to zero, where they are largest.
    """
    if result.model is None or not result.solutions[result.model].states:
        return None
    model = result.solutions[result.model]
    state = model.states[-1]
    if result.problem.stated and result.problem.returns and moved_supports(result.problem):
        state = max(model.states, key=lambda one: sum(float(of.force @ of.force) for of in model.support_forces(one)))
    level = state.load_factor
    found = [
        sentence
        for one in (model.support_forces(state) if level else ())
        for sentence in _sentences(result, level, one)
    ]
    return " ".join(found) or None


@dataclass(frozen=True, slots=True)
class _Component:
    """A component of the force or torque of a support.

    Attributes:
        what: "force" or "torque".
        direction: unit vector, shape (dim,); of a torque the axis, shape (1,) in the plane.
        unit: N or N m.
        words: the direction in words.
    """

    what: str
    direction: Floats
    unit: str
    words: str

    def of(self, one: SupportForce) -> str:
        """Return the component of a support's force or torque as text."""
        vector = one.force if self.what == "force" else one.torque
        return quantity(float(vector @ self.direction), self.unit)

    def error(self, one: SupportError) -> float | None:
        """Return the error of the force or torque."""
        return one.force_error if self.what == "force" else one.torque_error


def _sentences(result: Result, level: float, own: SupportForce) -> Iterator[str]:
    """Yield a sentence on the force of a support along its displacement, one on the torque about its axis."""
    if not result.problem.stated or result.model is None:
        return
    to_move = f" to move {own.name}" if len(moved_supports(result.problem)) > 1 else ""
    for component in _components(result, own):
        parts = [
            f"The {component.what} it takes{to_move} at {level_name(result, level)}{component.words}: "
            f"{subject(result)[0]} {component.of(own)}"
        ]
        for name, one in result.comparisons.items():
            error = next((e for pairs in _at(one, level) for e in pairs if e.mine.support == own.support), None)
            if error is not None:
                off = component.error(error)
                shown = "" if off is None else f" ({percent(off)} off)"
                parts.append(f"{display_name(result, name)} {component.of(error.theirs)}{shown}")
        yield ", ".join(parts) + "."


def _components(result: Result, own: SupportForce) -> Iterator[_Component]:
    held = result.problem.held[own.support]
    if held.motion.any():
        yield _Component("force", held.motion / np.linalg.norm(held.motion), "N", f", along {axis_name(held.motion)}")
    if held.turn is not None:
        axis = held.turn.axis if result.problem.mesh.dim == 3 else np.ones(1)
        yield _Component("torque", axis * np.sign(held.turn.angle), "N m", ", about its axis of rotation")


def _at(one: Comparison, level: float) -> list[tuple[SupportError, ...]]:
    """Return the errors of supports at a level; empty if it is not compared."""
    return [one.support_errors[place] for place in np.flatnonzero(one.load_factors == level)]
