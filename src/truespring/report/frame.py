"""The frame of a plot: grid, ticks, numbers and labels in few artists, many times faster than matplotlib's axes."""

from collections.abc import Sequence

import numpy as np

from truespring.arrays import Floats
from truespring.report.lines import draw_lines
from truespring.report.sheet import Area, Sheet
from truespring.report.style import POINT
from truespring.report.words import draw_words, text_width

#: Colours of grids and axes, and font size of numbers [points].
GRID, EDGE, SIZE = "#e3e6e9", "#5b6168", 8.5

# Length of a tick, distance of text rows, height of a bar [inch].
_TICK, _ROW, _BAR = 3.5 * POINT, 14 * POINT, 0.09


def draw_frame(area: Area, x_label: str, y_label: str) -> None:
    """Draw grid, axes, ticks, numbers and labels of an area."""
    sheet, left, bottom = area.sheet, area.left, area.bottom
    right, top = left + area.width, bottom + area.height
    x, x_numbers = _places(area.x, left, right)
    y, y_numbers = _places(area.y, bottom, top)
    grid = [((at, bottom), (at, top)) for at in x] + [((left, at), (right, at)) for at in y]
    edges = [((left, bottom), (right, bottom)), ((left, bottom), (left, top))]
    edges += [((at, bottom), (at, bottom - _TICK)) for at in x] + [((left, at), (left - _TICK, at)) for at in y]
    draw_lines(sheet, np.array(grid), GRID, 0.6, 0.5, "grid")
    draw_lines(sheet, np.array(edges), EDGE, 0.7, 2.5, "axes")
    below, beside = bottom - _TICK - _ROW / 2, left - 2 * _TICK
    for at, number in zip(x, x_numbers, strict=True):
        draw_words(sheet, at, below, number, SIZE, align=0.5)
    for at, number in zip(y, y_numbers, strict=True):
        draw_words(sheet, beside, at, number, SIZE, align=1.0)
    draw_words(sheet, (left + right) / 2, below - _ROW, x_label, SIZE, align=0.5)
    widest = max(text_width(number, SIZE) for number in y_numbers)
    draw_words(sheet, beside - widest - _ROW / 2, (bottom + top) / 2, y_label, SIZE, align=0.5, upright=True)


def draw_bar(
    sheet: Sheet, left: float, top: float, width: float, colors: Floats, shares: Floats, numbers: Sequence[str]
) -> None:
    """Draw a colour bar, shape (n, 3), at its upper left corner [inch], with numbers below at `shares` of its width."""
    bottom = top - _BAR
    sheet.add_image(colors[None], left, bottom, width, _BAR, 3, "bar")
    corners = np.array([(left, bottom), (left + width, bottom), (left + width, top), (left, top)])
    edges = [*zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    edges += [((at, bottom), (at, bottom - 2.5 * POINT)) for at in left + width * shares]
    draw_lines(sheet, np.array(edges), EDGE, 0.7, 4, "axes")
    for at, number in zip(left + width * shares, numbers, strict=True):
        draw_words(sheet, at, bottom - 8 * POINT, number, 7.5, align=0.5)


def _places(limits: tuple[float, float], start: float, end: float) -> tuple[Floats, list[str]]:
    """Return the places of round numbers within `limits` between `start` and `end`, shape (n,), and their text."""
    low, high = limits
    values = round_numbers(low, high)
    return start + (values - low) / (high - low) * (end - start), written(values)


def round_numbers(low: float, high: float, intervals: int = 6) -> Floats:
    """Return evenly spaced round numbers from `low` to `high`, at most `intervals` + 1 of them, shape (n,)."""
    from matplotlib.ticker import MaxNLocator

    values = np.asarray(MaxNLocator(intervals, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
    hair = 1e-9 * (high - low)
    return values[(values >= low - hair) & (values <= high + hair)]


def written(values: Floats) -> list[str]:
    """Return evenly spaced numbers as text, all with as many decimals as distinguish them."""
    step = float(np.ptp(values)) / max(len(values) - 1, 1)
    largest = float(np.abs(values).max())
    decimals = next((n for n in range(7) if abs(round(step, n) - step) <= 1e-6 * step), None)
    form = "g" if decimals is None or largest >= 1e7 else f".{decimals}f"
    hair = 1e-9 * step  # rounding errors are written as 0, without sign
    return [f"{0.0 if abs(value) < hair else value:{form}}".replace("-", "\N{MINUS SIGN}") for value in values]
