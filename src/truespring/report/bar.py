"""A bar of colours: how far two bodies are apart, from nothing to the largest distance."""

from dataclasses import dataclass

import numpy as np

from truespring.report.frame import draw_bar, round_numbers, written
from truespring.report.quantity import natural_scale, percent, quantity
from truespring.report.sheet import Sheet
from truespring.report.style import error_colors
from truespring.report.words import draw_words

#: The height of a bar with its words [inch].
BAR = 0.44


@dataclass(frozen=True, slots=True)
class Bar:
    """A bar of colours from 0 to `largest`, in the unit that `label` names; `most` tells the largest in words."""

    label: str
    largest: float
    most: str


def bar_of(farthest: float, size: float) -> Bar:
    """Return the bar of distances up to `farthest` beside a reference that moves by `size` at most [m]."""
    if size:
        most = f"{percent(farthest / size)}, {quantity(farthest, 'm', 2)}"
        return Bar("distance [% of the reference's largest displacement]", 100 * farthest / size, most)
    scale = natural_scale(farthest, "m")
    return Bar(f"distance [{scale.unit}]", farthest / scale.size, quantity(farthest, "m", 2))


def draw_error_bar(sheet: Sheet, bar: Bar, left: float, top: float) -> None:
    """Draw a bar with its label above, from its upper left corner on [inch]."""
    draw_words(sheet, left, top - 0.07, bar.label)
    largest = bar.largest or 1.0
    values = round_numbers(0.0, largest, 5)
    draw_bar(sheet, left, top - 0.17, 2.6, error_colors(np.linspace(0, 1, 256)), values / largest, written(values))
