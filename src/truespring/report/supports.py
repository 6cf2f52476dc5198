"""What moved supports take, in words: force and torque of a model beside those of its references."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.report.quantity import natural_scale, percent, significant
from truespring.report.result import Result
from truespring.report.verdict import display_name


@dataclass(frozen=True, slots=True)
class SupportRow:
    """A force or a torque, of the model and of one reference, as text; empty where there is nothing to tell.

    Attributes:
        support: what the support is on.
        quantity: "force" or "torque".
        name, label: of the reference.
        mine, theirs: along each axis, of model and reference.
        error: length of the difference over that of the reference's.
        share_of_load: the reference's force over the total load.
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
    """Yield force and torque of each moved support beside each reference, at the last level that both have.

    What vanishes in both is left out.
    """
    for name, one in result.comparisons.items():
        called = (name, display_name(result, name))
        for found in one.support_errors[-1] if one.support_errors else ():
            mine, theirs = found.mine, found.theirs
            if mine.has_force or theirs.has_force:
                both = _vector(mine.force, "N"), _vector(theirs.force, "N")
                yield SupportRow(
                    mine.name, "force", *called, *both, _share(found.force_error), _share(found.share_of_load)
                )
            if mine.has_torque or theirs.has_torque:
                both = _vector(mine.torque, "N m"), _vector(theirs.torque, "N m")
                yield SupportRow(mine.name, "torque", *called, *both, _share(found.torque_error), "")


def _vector(vector: Floats, unit: str) -> str:
    """A vector as text, in the unit of its largest component; components that are rounding beside that are zero."""
    largest = float(np.abs(vector).max())
    scale = natural_scale(largest, unit)
    parts = [0.0 if abs(part) <= 1e-9 * largest else part / scale.size for part in vector.tolist()]
    text = ", ".join(significant(part, 3) for part in parts).replace("-", "\N{MINUS SIGN}")
    return f"{text} {scale.unit}" if len(parts) == 1 else f"({text}) {scale.unit}"


def _share(share: float | None) -> str:
    return "" if share is None else percent(share)
