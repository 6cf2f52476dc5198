"""Forces and torques of moved supports, tools and grasps as text, of a model and its references."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.report.axis import axis_of
from truespring.report.quantity import natural_scale, percent, significant
from truespring.report.result import Result
from truespring.report.verdict import display_name


@dataclass(frozen=True, slots=True)
class SupportRow:
    """A force or torque of a support, tool or grasp, of the model and of one reference, as text; empty where unknown.

    Attributes:
        support: the selection of the support, or the name of the tool or grasp.
        quantity: "force" or "torque".
        name, label: of the reference.
        mine, theirs: the vector of the model, of the reference.
        error: norm of the difference over the norm of the reference; over the way that of their root mean squares.
        share_of_load: force of the reference over the total load.
    """

    support: str
    quantity: str
    name: str
    label: str
    mine: str
    theirs: str
    error: str
    share_of_load: str


def support_rows(result: Result) -> Iterator[SupportRow]:
    """Yield force and torque of each moved support, tool and grasp for each reference, at the last level of both.

    If errors are those over the way, the level is that of the largest force. Those that vanish in both are left out.
    """
    for name, one in result.comparisons.items():
        called = (name, display_name(result, name))
        for found in one.last_supports:
            mine, theirs = found.mine, found.theirs
            if mine.has_force or theirs.has_force:
                both = _vector(mine.force, "N"), _vector(theirs.force, "N")
                yield SupportRow(
                    mine.name, "force", *called, *both, _share(found.force_error), _share(found.share_of_load)
                )
            if mine.has_torque or theirs.has_torque:
                both = _vector(mine.torque, "N m"), _vector(theirs.torque, "N m")
                yield SupportRow(mine.name, "torque", *called, *both, _share(found.torque_error), "")


def support_title(result: Result) -> str:
    """Return what `support_rows` are, and of which level."""
    one = "moved supports, tools and grasps" if result.problem.touching else "moved supports"
    over = any(one.over_the_way for one in result.comparisons.values())
    where = "where they are largest" if over else f"at the last {axis_of(result).level} that both have"
    return f"Forces and torques of {one} {where}"


def _vector(vector: Floats, unit: str) -> str:
    """Return a vector as text, in the unit of its largest component; rounding errors are zero."""
    largest = float(np.abs(vector).max())
    scale = natural_scale(largest, unit)
    parts = [0.0 if abs(part) <= 1e-9 * largest else part / scale.size for part in vector.tolist()]
    text = ", ".join(significant(part, 3) for part in parts).replace("-", "\N{MINUS SIGN}")
    return f"{text} {scale.unit}" if len(parts) == 1 else f"({text}) {scale.unit}"


def _share(share: float | None) -> str:
    return "" if share is None else percent(share)
