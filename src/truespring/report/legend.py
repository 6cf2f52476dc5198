"""Legends above a picture, in as few rows as the width allows; many times faster than matplotlib's."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from truespring.report.sheet import Sheet
from truespring.report.words import draw_words, text_width

# Widths [inch]: the sample of a line, the gap to its text, the gap to the next column.
_SAMPLE, _GAP, _COLUMNS_APART = 0.18, 0.06, 0.13

#: The height of a row [inch].
ROW = 0.18


@dataclass(frozen=True, slots=True)
class Entry:
    """An entry of a legend: its text, colour, marker and line style."""

    text: str
    color: str
    marker: str = ""
    linestyle: Any = "-"


def legend_columns(entries: Sequence[Entry], room: float) -> tuple[list[Sequence[Entry]], float]:
    """Return a legend in columns, with as few rows as a width of `room` [inch] allows, and its width [inch]."""
    columns: list[Sequence[Entry]] = []
    width = 0.0
    for rows in range(1, len(entries) + 1):
        columns = [entries[start : start + rows] for start in range(0, len(entries), rows)]
        width = sum(_column_width(column) for column in columns) - _COLUMNS_APART
        if width <= room:
            break
    return columns, width


def _column_width(column: Sequence[Entry]) -> float:
    return _SAMPLE + _GAP + max(text_width(one.text, 8) for one in column) + _COLUMNS_APART


def draw_legend(sheet: Sheet, columns: Sequence[Sequence[Entry]], left: float, top: float) -> None:
    """Draw a legend whose upper left corner is at (left, top) [inch]."""
    from matplotlib.lines import Line2D

    for column in columns:
        for row, one in enumerate(column):
            y = top - ROW * (row + 0.5)
            sample = Line2D(
                [left, left + _SAMPLE / 2, left + _SAMPLE],
                [y, y, y],
                color=one.color,
                ls=one.linestyle,
                lw=1.4,
                marker=one.marker,
                ms=5,
                markevery=[1],
            )
            sheet.add(sample)
            at = left + _SAMPLE + _GAP
            draw_words(sheet, at, y, one.text)
        left += _column_width(column)
