"""A colour bar of distances between two bodies, from 0 to the largest."""

from dataclasses import dataclass

import numpy as np

from truespring.report.frame import draw_bar, round_numbers, written
from truespring.report.quantity import natural_scale, percent, quantity
from truespring.report.sheet import Sheet
from truespring.report.style import error_colors
from truespring.report.words import draw_words

#: Height of a bar with its label and numbers [inch].
BAR = 0.44


@dataclass(frozen=True, slots=True)
class Bar:
    """A colour bar from 0 to `largest`, in the unit that `label` names; `most` is the largest value as text."""

    label: str
    largest: float
    most: str


def bar_of(farthest: float, size: float) -> Bar:
    """Return the bar of distances up to `farthest`, relative to `size`, the reference's largest displacement [m]."""
    if size:
        most = f"{percent(farthest / size)}, {quantity(farthest, 'm', 2)}"
        return Bar("distance [% of the reference's largest displacement]", 100 * farthest / size, most)
    scale = natural_scale(farthest, "m")
    return Bar(f"distance [{scale.unit}]", farthest / scale.size, quantity(farthest, "m", 2))


def draw_error_bar(sheet: Sheet, bar: Bar, left: float, top: float) -> None:
    """Draw a bar with its label above; (left, top) is its upper left corner [inch]."""
    draw_words(sheet, left, top - 0.07, bar.label)
    largest = bar.largest or 1.0
    values = round_numbers(0.0, largest, 5)
    draw_bar(sheet, left, top - 0.17, 2.6, error_colors(np.linspace(0, 1, 256)), values / largest, written(values))
