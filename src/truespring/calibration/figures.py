"""Figures of a calibration: stiffness relative to the rule, errors before and after."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.calibration.fitted import CaseResult, Fitted
from truespring.calibration.shapes import shape_figure
from truespring.report.frame import EDGE, GRID, draw_bar, draw_frame, round_numbers, written
from truespring.report.lines import draw_lines
from truespring.report.plots import Curve, plot
from truespring.report.quantity import percent
from truespring.report.sheet import Area, Sheet
from truespring.report.style import BLUE, FAINT, INK, POINT
from truespring.report.words import draw_words, text_width

# Up to so many unknowns are drawn as bars, more as a histogram; lattices with more springs are not drawn.
_MOST_BARS, _MOST_SPRINGS = 60, 4000
# Distance of rows of bars, and height of a bar [inch].
_ROW, _BAR = 0.2, 0.11
# Range of the colours for stiffness over that of the rule: 1/3 to 3.
_WIDEST = 3.0


def calibration_figures(found: Fitted) -> Iterator[tuple[str, Sheet]]:
    """Yield the figures with the stem of their file names."""
    yield "errors", errors_figure(found)
    if len(found.unknowns) <= _MOST_BARS:
        yield "unknowns", unknowns_figure(found)
    else:
        yield "unknowns", counted_figure(found)
    lattice = found.unknowns.lattice(found.values)
    if lattice is not None and found.unknowns.problem.mesh.dim == 2 and len(lattice[0]) <= _MOST_SPRINGS:
        yield "lattice", lattice_figure(found.unknowns.problem.mesh.nodes, *lattice)
    for number, one in enumerate(found.cases, 1):
        shape = shape_figure(one)
        if shape is not None:
            yield f"shape_{number}", shape
        if len(one.deciding(one.before)) > 1:
            yield f"case_{number}", case_figure(one)


def errors_figure(found: Fitted) -> Sheet:
    """Return the error of each case at its last level, by the rule and calibrated."""
    rows = [
        _Row(
            f"{one.case.name} ({'held out' if one.held_out else 'fitted'})",
            [None if value is None else 100 * value for value in one.pair],
            ["no equilibrium" if value is None else percent(value) for value in one.pair],
        )
        for one in found.cases
    ]
    return _bars("Error at full load: grey by the rule, blue calibrated", "relative error [%]", rows)


def unknowns_figure(found: Fitted) -> Sheet:
    """Return the value of each unknown; 1 is the rule."""
    rows = [
        _Row(name, [None, float(value)], ["", f"{value:.3g}"])
        for name, value in zip(found.unknowns.names, found.values, strict=True)
    ]
    return _bars("Calibrated unknowns; the line is the rule", f"factor on {found.unknowns.of_what}", rows, mark=1.0)


@dataclass(frozen=True)
class _Row:
    """A row of bars: its name, one value in grey, one in blue, and the text after each."""

    name: str
    values: Sequence[float | None]
    words: Sequence[str]


def _bars(title: str, label: str, rows: Sequence[_Row], mark: float | None = None) -> Sheet:
    """Return bars from zero, row by row from the top."""
    known = [value for row in rows for value in row.values if value is not None]
    several = any(sum(value is not None for value in row.values) > 1 for row in rows)
    step = _ROW + _BAR if several else _ROW
    left = 0.15 + max(text_width(row.name, 8) for row in rows)
    wide = 0.2 + max(text_width(word, 7.5) for row in rows for word in row.words)
    height = step * len(rows) + 0.1
    sheet = Sheet(left + 3.6 + wide, height + 0.5 + 0.38, title)
    largest = max([*known, mark or 0.0]) or 1.0
    area = Area(sheet, left, 0.5, 3.6, height, (0.0, 1.02 * largest), (0.0, height))
    _draw_axis(area, label)
    draw_words(sheet, 0.05, sheet.height - 0.19, title, 9, bold=True)
    for number, row in enumerate(rows):
        middle = height - step * (number + 0.5) - 0.05
        draw_words(sheet, left - 0.08, area.bottom + middle, row.name, 8, align=1.0)
        there = [(value, word, color) for value, word, color in zip(row.values, row.words, _PAIR, strict=True) if word]
        for place, (value, word, color) in enumerate(there):
            at = middle + (len(there) - 1) / 2 * _BAR - place * _BAR
            size = value or 0.0
            draw_shape(
                area, np.array([(0, at - 0.045), (size, at - 0.045), (size, at + 0.045), (0, at + 0.045)]), color
            )
            draw_words(sheet, float(area.place(np.array([size, at]))[0]) + 0.05, area.bottom + at, word, 7.5, halo=True)
    if mark is not None:
        draw_lines(area, np.array([[(mark, 0.0), (mark, height)]]), INK, 0.9, 4, "rule")
    return sheet


_PAIR = (FAINT, BLUE)


def _draw_axis(area: Area, label: str) -> None:
    """Draw the x axis with its numbers."""
    sheet, bottom = area.sheet, area.bottom
    values = round_numbers(*area.x)
    places = area.place(np.stack([values, np.zeros(len(values))], axis=1))[:, 0]
    grid = np.array([((at, bottom), (at, bottom + area.height)) for at in places])
    draw_lines(sheet, grid, GRID, 0.6, 0.5, "grid")
    edges = [
        ((area.left, bottom), (area.left + area.width, bottom)),
        ((area.left, bottom), (area.left, bottom + area.height)),
    ]
    draw_lines(sheet, np.array(edges), EDGE, 0.7, 2.5, "axes")
    for at, number in zip(places, written(values), strict=True):
        draw_words(sheet, float(at), bottom - 10 * POINT, number, 8.5, align=0.5)
    draw_words(sheet, area.left + area.width / 2, bottom - 24 * POINT, label, 8.5, align=0.5)


def draw_shape(area: Area, corners: Floats, color: str) -> None:
    """Fill a polygon, shape (n, 2) in units of the area."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    closed = np.concatenate([corners, corners[:1]])
    area.add(PathPatch(Path(closed, closed=True), fc=color, lw=0, zorder=3, gid="bar"))


def counted_figure(found: Fitted) -> Sheet:
    """Return a histogram of the unknowns."""
    counts, edges = np.histogram(found.values, bins=40, range=(0.0, max(1.2, float(found.values.max()))))
    title = f"{len(found.values):,} calibrated unknowns; the line is the rule"
    sheet = Sheet(5.9, 3.2, title)
    area = Area(sheet, 0.7, 0.5, 5.0, 2.3, (0.0, float(edges[-1])), (0.0, 1.05 * float(counts.max())))
    draw_frame(area, f"factor on {found.unknowns.of_what}", "unknowns")
    draw_words(sheet, 0.7, sheet.height - 0.19, title, 9, bold=True)
    for low, high, count in zip(edges, edges[1:], counts, strict=False):
        draw_shape(area, np.array([(low, 0.0), (high, 0.0), (high, count), (low, count)]), BLUE)
    draw_lines(area, np.array([[(1.0, 0.0), (1.0, area.y[1])]]), INK, 0.9, 4, "rule")
    return sheet


def lattice_figure(nodes: Floats, springs: Ints, ratio: Floats) -> Sheet:
    """Return the springs of a plane body, coloured by their stiffness over that of the rule, `ratio` [-]."""
    widest = min(max(float(ratio.max()), 1 / max(float(ratio.min()), 1 / _WIDEST), 1.05), _WIDEST)
    shares = np.clip(np.log(np.maximum(ratio, 1 / _WIDEST)) / np.log(widest), -1, 1) / 2 + 0.5
    size = np.ptp(nodes, axis=0)
    width = 5.6
    height = min(width * float(size[1] / size[0]), 5.0)
    width = height * float(size[0] / size[1])
    title = "Springs by their stiffness over the rule's"
    sheet = Sheet(max(width + 0.4, 4.0), height + 1.15, title)
    lower = nodes.min(axis=0)
    area = Area(sheet, 0.2, 0.75, width, height, (lower[0], lower[0] + size[0]), (lower[1], lower[1] + size[1]))
    draw_words(sheet, 0.2, sheet.height - 0.19, title, 9, bold=True)
    ends = area.place(nodes[springs])
    shade = np.rint(shares * (_SHADES - 1)).astype(np.int64)
    for one in np.unique(shade):
        (color,) = _diverging(np.array([one / (_SHADES - 1)]))
        draw_lines(sheet, ends[shade == one], color, 1.6, 3, "springs")
    numbers = np.array([1 / widest, widest**-0.5, 1.0, widest**0.5, widest])
    colors = np.array([_rgb(one) for one in _diverging(np.linspace(0, 1, 256))])
    places = np.log(numbers) / np.log(widest) / 2 + 0.5
    written_as = [f"{number:.2g}" for number in numbers]
    draw_bar(sheet, 0.2, 0.5, 2.8, colors, places, written_as)
    return sheet


_SHADES = 33


def _diverging(shares: Floats) -> list[str]:
    """Return the colours of shares 0 to 1: orange for softer, grey in the middle, blue for stiffer."""
    from matplotlib.colors import LinearSegmentedColormap, to_hex

    scale = LinearSegmentedColormap.from_list("stiffness", ["#a33f00", "#f0a35e", "#c9ced3", "#62a8dc", "#00476f"])
    return [to_hex(color) for color in scale(shares)]


def _rgb(color: str) -> Floats:
    return np.array([int(color[place : place + 2], 16) / 255 for place in (1, 3, 5)])


def case_figure(one: CaseResult) -> Sheet:
    """Return the error of a case by load level, by the rule and calibrated."""
    curves = []
    for path, label, color, dashes, marker in (
        (one.before, "by the rule", "#5b6168", "--", "s"),
        (one.after, "calibrated", BLUE, "-", "o"),
    ):
        errors = one.deciding(path)
        x, y = np.array(list(errors)), 100 * np.array([found.error for found in errors.values()])
        if x.size:
            curves.append(Curve(x, y, color, dashes, marker, label, strong=path is one.after))
    role = "held out" if one.held_out else "fitted"
    what = "error" if one.quantity == "displacement" else f"error, at full load of the {one.quantity}"
    return plot(f"{one.case.name} ({role})", "load factor", f"{what} [%]", curves, to_right=1.0).sheet
