"""The figure of the table: four measures, a bar for each entry."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from truespring.report.lines import draw_lines
from truespring.report.sheet import Sheet
from truespring.report.style import BLUE, INK, figure_style
from truespring.report.words import draw_words, text_width
from truespring.table1.signs import Row

# Sizes [inch]: height of a row, width of a panel, gap between panels, height of the head, margin.
_ROW, _PANEL, _GAP, _HEAD, _MARGIN = 0.21, 1.35, 0.75, 0.55, 0.12

# A panel: title, and functions that return the value of a row or None, the length of the bar as a share of the panel,
# and the text.
_Panel = tuple[str, Callable[[Row], float | None], Callable[[float], float], Callable[[float], str]]


def figure(table: Mapping[str, Any], dim: int) -> Sheet:
    """Return bars of speed, material, accuracy and large deflection for the entries of a dimension."""
    rows = [row for row in table["rows"] if row["dim"] == dim]
    names = [f"{row['method']}: {row['name']}" for row in rows]
    left = _MARGIN + max(text_width(name, 8, row["chief"]) for name, row in zip(names, rows, strict=True)) + 0.1
    panels = list(_panels(rows))
    width = left + len(panels) * (_PANEL + _GAP) + _MARGIN
    height = _HEAD + _ROW * len(rows) + _MARGIN
    where = "the plane" if dim == 2 else "space"
    sheet = Sheet(width, height, f"Six methods in {where}: speed, material, accuracy, large deflection")
    for number, (name, row) in enumerate(zip(names, rows, strict=True)):
        y = height - _HEAD - _ROW * (number + 0.5)
        draw_words(sheet, left - 0.1, y, name, bold=row["chief"], align=1.0)
    for place, (title, value, share, words) in enumerate(panels):
        at = left + place * (_PANEL + _GAP)
        first, _, second = title.partition("\n")
        draw_words(sheet, at, height - 0.17, first, 8.5, bold=True)
        draw_words(sheet, at, height - 0.34, second, 7.5)
        edge = np.array([[(at, height - _HEAD + 0.03), (at, _MARGIN)]])
        draw_lines(sheet, edge, "#5b6168", 0.7, 3, "axes")
        for number, row in enumerate(rows):
            y = height - _HEAD - _ROW * (number + 0.5)
            known = value(row)
            if known is None:
                draw_words(sheet, at + 0.06, y, "none", 7.5, "#5b6168")
                continue
            length = _PANEL * min(max(share(known), 0.0), 1.0)
            _bar(sheet, at, y, length, BLUE if row["chief"] else "#9fbfd6")
            draw_words(sheet, at + length + 0.06, y, words(known), 7.5, INK)
    return sheet


def files(table: Mapping[str, Any], dim: int) -> tuple[bytes, bytes]:
    """Return the figure of a dimension as the bytes of a PNG and an SVG file."""
    with figure_style():
        sheet = figure(table, dim)
        return sheet.png(), sheet.svg()


def _panels(rows: Sequence[Row]) -> Iterator[_Panel]:
    times = [row["solve_ms"] for row in rows if row.get("solve_ms")]
    low, high = math.log10(min(times, default=1.0)) - 0.3, math.log10(max(times, default=10.0))
    yield (
        "Solve [ms], log scale",
        lambda row: row.get("solve_ms"),
        lambda ms: (math.log10(ms) - low) / (high - low),
        lambda ms: f"{ms:.2g}" if ms < 100 else f"{ms:.0f}",
    )
    yield (
        "Moduli off\nat Poisson's ratio 0.45",
        lambda row: next((one["error"] for one in reversed(row.get("moduli_errors", []))), None),
        lambda error: error / 0.5,
        _percent,
    )
    yield (
        "Error at small load\non four elements deep",
        lambda row: row.get("small_error"),
        lambda error: error / 0.2,
        _percent,
    )
    yield (
        "Within 5 % up to\na deflection over length of",
        lambda row: row.get("deflection_within_5_percent"),
        lambda reach: reach,
        lambda reach: f"{reach:.2f}",
    )


def _percent(error: float) -> str:
    return "0" if error < 1e-9 else f"{100 * error:.2g} %"


def _bar(sheet: Sheet, left: float, y: float, length: float, color: str) -> None:
    from matplotlib.patches import Rectangle

    sheet.add(Rectangle((left, y - 0.32 * _ROW), max(length, 0.01), 0.64 * _ROW, fc=color, lw=0, zorder=2, gid="bar"))
