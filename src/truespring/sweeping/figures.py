"""Plots of a sweep: lines over one number, maps over two numbers, dots by value otherwise."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.report.frame import EDGE, draw_bar, draw_frame, round_numbers, written
from truespring.report.lines import draw_lines
from truespring.report.plots import Curve, plot
from truespring.report.quantity import natural_scale
from truespring.report.shades import draw_shaded, draw_shaded_dots
from truespring.report.sheet import Area, Sheet
from truespring.report.style import EQUAL_STYLES, FAINT, POINT, error_colors
from truespring.report.words import draw_words, text_width

Row = Mapping[str, Any]

# Largest number of lines in a plot, and of plots on a page.
_MOST_CURVES, _MOST_PLOTS = 8, 12
# Values that differ by less than this share are the same.
_SAME = 1e-6

_UNITS = {
    **dict.fromkeys(("young", "pressure", "traction"), "Pa"),
    **dict.fromkeys(("size", "thickness", "edge", "displacement", "to"), "m"),
    **dict.fromkeys(("force",), "N"),
    **dict.fromkeys(("moment",), "N m"),
}


@dataclass(frozen=True)
class Measured:
    """A quantity that is drawn.

    Attributes:
        title: its name.
        label: label of an axis, with its unit.
        values: one value per row, None if unknown, by the name of the reference or model.
    """

    title: str
    label: str
    values: Mapping[str, Sequence[float | None]]


def measured(rows: Sequence[Row]) -> Iterator[Measured]:
    """Yield the probe's displacement and the force of each model, then the rms error against each reference [%].

    Where displacements may return to zero, as in a motion, it is the largest on the way. What is the same at all
    points, such as a force that is not varied, is left out. Values of failed points are None.
    """
    moves = {name: [moved(row, f"models.{name}.") for row in rows] for name in models_of(rows)}
    forces = {name: [_length(row, f"models.{name}.force.") for row in rows] for name in models_of(rows)}
    yield from _varied("Displacement of the probe", "displacement", "m", moves)
    yield from _varied("Force", "force", "N", forces)
    errors = [column for column in rows[0] if column.startswith("comparison.") and column.endswith(".rms_error")]
    names = {column.split(".")[1]: [_times(_known(row, column), 100) for row in rows] for column in errors}
    if any(value is not None for values in names.values() for value in values):
        yield Measured("Rms error", "rms error [%]", names)


def models_of(rows: Sequence[Row]) -> list[str]:
    """Return the names of the models whose displacement at the probe the rows have."""
    columns = [column for column in rows[0] if column.startswith("models.") and ".probe_displacement." in column]
    return list(dict.fromkeys(column.split(".")[1] for column in columns))


def _varied(title: str, label: str, unit: str, values: Mapping[str, Sequence[float | None]]) -> Iterator[Measured]:
    """Yield a quantity in SI with a unit prefix, unless it is the same, or unknown, at all points."""
    known = [value for column in values.values() for value in column if value is not None]
    largest = max(known, default=0.0)
    if len(known) > 1 and largest - min(known) <= _SAME * largest:
        return
    if largest > 0:
        scale = natural_scale(largest, unit)
        scaled = {name: [_times(value, 1 / scale.size) for value in column] for name, column in values.items()}
        yield Measured(title, f"{label} [{scale.unit}]", scaled)


def _times(value: float | None, factor: float) -> float | None:
    return None if value is None else factor * value


def _known(row: Row, column: str) -> float | None:
    return row[column] if row["status"] == "converged" else None


def moved(row: Row, prefix: str) -> float | None:
    """Return the largest displacement of the probe on the way if the row has it, else that at the last level [m]."""
    largest = f"{prefix}largest_probe_displacement"
    return _known(row, largest) if row.get(largest) is not None else _length(row, f"{prefix}probe_displacement.")


def _length(row: Row, prefix: str) -> float | None:
    parts = [value for column in row if column.startswith(prefix) and (value := _known(row, column)) is not None]
    return float(np.linalg.norm(parts)) if parts else None


def sweep_figures(keys: Sequence[str], rows: Sequence[Row]) -> Iterator[Sheet]:
    """Yield the figures of a sweep; their kind depends on how many keys are numbers with several values."""
    several = [key for key in keys if len({str(row[key]) for row in rows}) > 1]
    numbers = [key for key in several if all(_is_number(row[key]) for row in rows)]
    groups = _groups(rows, [key for key in several if key not in numbers])
    for what in measured(rows):
        if len(numbers) == 1 and len(groups) <= _MOST_CURVES:
            yield from _curves(numbers[0], rows, what, groups)
        elif len(numbers) == 2 and len(groups) * len(what.values) <= _MOST_PLOTS:
            yield from _maps((numbers[0], numbers[1]), rows, what, groups)
        else:
            for key in several[:_MOST_PLOTS]:
                yield _strips(key, rows, what)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _groups(rows: Sequence[Row], others: Sequence[str]) -> dict[str, list[int]]:
    """Return the indices of rows with the same values of `others`, by those values as text."""
    groups: dict[str, list[int]] = {}
    for place, row in enumerate(rows):
        groups.setdefault(", ".join(_words(row[key]) for key in others), []).append(place)
    return groups


def _words(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _axis(key: str, values: Sequence[Any]) -> tuple[Floats, str]:
    """Return the values of a key with a unit prefix, shape (n,), and the label of the axis."""
    name = next((part for part in reversed(key.split(".")) if not part.isdigit()), key)
    numbers = np.array(values, dtype=np.float64)
    if name not in _UNITS:
        return numbers, key
    scale = natural_scale(float(np.abs(numbers).max()), _UNITS[name])
    return numbers / scale.size, f"{key} [{scale.unit}]"


# --- lines over one number ------------------------------------------------------------------------


def _curves(key: str, rows: Sequence[Row], what: Measured, groups: Mapping[str, list[int]]) -> Iterator[Sheet]:
    """Yield one plot with a line per reference; if other keys vary too, one plot per reference and a line per group."""
    x, label = _axis(key, [row[key] for row in rows])
    alone = len(groups) == 1
    names = list(what.values)
    plots = [(f"{what.title} against {key}", names, list(groups))] if alone else []
    plots += [] if alone else [(f"{what.title}: {name}", [name], list(groups)) for name in names]
    for title, columns, labels in plots:
        curves = []
        for place, (name, group) in enumerate(itertools.product(columns, labels)):
            known = [at for at in groups[group] if what.values[name][at] is not None]
            if known:
                y = np.array([what.values[name][at] for at in known], dtype=np.float64)
                color, dashes, marker = EQUAL_STYLES[place % len(EQUAL_STYLES)]
                label_of_line = name if alone else group
                curves.append(Curve(x[known], y, color, dashes, marker, label_of_line, strong=False))
        if curves:
            yield plot(title, label, what.label, curves).sheet


# --- a map over two numbers -----------------------------------------------------------------------


def _maps(
    keys: tuple[str, str], rows: Sequence[Row], what: Measured, groups: Mapping[str, list[int]]
) -> Iterator[Sheet]:
    """Yield one map per reference and group, each with its own colour range: cells if points fill a grid, else dots."""
    (x, x_label), (y, y_label) = (_axis(key, [row[key] for row in rows]) for key in keys)
    for name, (group, places) in itertools.product(what.values, groups.items()):
        values = np.array([np.nan if what.values[name][at] is None else what.values[name][at] for at in places])
        title = f"{what.title}: {name}{f', {group}' if group else ''}"
        if np.isfinite(values).any():
            largest = float(np.nanmax(values)) or 1.0
            yield _map(title, (x[places], y[places]), (x_label, y_label), values, largest, what.label)


def _map(
    title: str, places: tuple[Floats, Floats], labels: tuple[str, str], values: Floats, largest: float, label: str
) -> Sheet:
    x, y = places
    filled = len(np.unique(x)) * len(np.unique(y)) == len(values)
    edges = [_cell_edges(one) if filled else _about(one) for one in places]
    left, bottom, top, wide, high = 0.82, 1.05, 0.38, 4.6, 3.1
    sheet = Sheet(left + wide + 0.3, bottom + high + top, title)
    area = Area(sheet, left, bottom, wide, high, *((float(one[0]), float(one[-1])) for one in edges))
    draw_frame(area, *labels)
    draw_words(sheet, left, sheet.height - 0.19, title, 9, bold=True)
    known = np.isfinite(values)
    if filled:
        corners = _cells(edges, places)
        _hatched(area, corners[~known])
        draw_shaded(area, corners[known], values[known] / largest)
    else:
        points = np.stack(places, axis=1)
        _crosses(area, points[~known])
        _dots(area, points[known], values[known] / largest)
    draw_words(sheet, left, 0.42, label, 8)
    numbers = round_numbers(0.0, largest, 5)
    draw_bar(sheet, left, 0.32, 2.6, error_colors(np.linspace(0, 1, 256)), numbers / largest, written(numbers))
    return sheet


def _cell_edges(values: Floats) -> Floats:
    """Return the edges of cells around the distinct values, half way between them."""
    at = np.unique(values)
    if len(at) == 1:
        return _about(values)
    middle = (at[:-1] + at[1:]) / 2
    return np.concatenate([[1.5 * at[0] - 0.5 * at[1]], middle, [1.5 * at[-1] - 0.5 * at[-2]]])


def _about(values: Floats) -> Floats:
    low, high = float(values.min()), float(values.max())
    room = 0.08 * (high - low) or 0.5 * abs(low) or 0.5
    return np.array([low - room, high + room])


def _cells(edges: Sequence[Floats], places: tuple[Floats, Floats]) -> Floats:
    """Return the corners of the cell around each place, shape (n, 4, 2)."""
    (left, right), (low, high) = (
        (cut[number], cut[number + 1])
        for cut, at in zip(edges, places, strict=True)
        for number in [np.searchsorted(np.unique(at), at)]
    )
    corners = [(left, low), (right, low), (right, high), (left, high)]
    return np.stack([np.stack(corner, axis=1) for corner in corners], axis=1)


def _hatched(area: Area, corners: Floats) -> None:
    """Cross out cells without a value."""
    if len(corners):
        draw_lines(area, corners[:, [[0, 2], [1, 3]]].reshape(-1, 2, 2), FAINT, 0.8, 2, "failed")


def _crosses(area: Area, points: Floats) -> None:
    if not len(points):
        return
    arm = 0.05 * np.array([area.inch, (area.y[1] - area.y[0]) / area.height])
    signs = np.array([[(-1, -1), (1, 1)], [(-1, 1), (1, -1)]])
    draw_lines(area, (points[:, None, None] + arm * signs).reshape(-1, 2, 2), EDGE, 1.0, 4, "failed")


def _dots(area: Area, points: Floats, shares: Floats) -> None:
    """Draw round dots in an area with different scales along its sides."""
    if len(points):
        inches = Area(area.sheet, area.left, area.bottom, area.width, area.height, (0, area.width), (0, area.height))
        draw_shaded_dots(inches, area.place(points) - (area.left, area.bottom), shares)


# --- dots by value --------------------------------------------------------------------------------


def _strips(key: str, rows: Sequence[Row], what: Measured) -> Sheet:
    """Return all points by the value of one key, with one marker per reference."""
    values = [row[key] for row in rows]
    if all(map(_is_number, values)):
        x, label = _axis(key, values)
        names: list[str] = []
    else:
        names = list(dict.fromkeys(map(_words, values)))
        x, label = np.array([names.index(_words(value)) for value in values], dtype=np.float64), key
    title = f"{what.title} by {key}"
    known = [value for column in what.values.values() for value in column if value is not None]
    across = 0.5 if names else None
    limits = (float(x.min()) - 0.5, float(x.max()) + 0.5) if across else tuple(_about(x).tolist())
    margin = 0.35 + max(text_width(name, 8) for name in what.values)
    left, bottom, top = 0.72, 0.5, 0.38
    wide = max(4.2, *(1.3 * text_width(name, 8) * len(names) for name in names)) if names else 4.6
    sheet = Sheet(left + wide + margin + 0.1, bottom + 3.0 + top, title)
    area = Area(sheet, left, bottom, wide, 3.0, (limits[0], limits[1]), (min(0.0, *known), 1.08 * max(known) or 1.0))
    _strip_frame(area, label, what.label, names)
    draw_words(sheet, left, sheet.height - 0.19, title, 9, bold=True)
    for place, (name, column) in enumerate(what.values.items()):
        color, _, marker = EQUAL_STYLES[place % len(EQUAL_STYLES)]
        # Points of the same value are shifted sideways by reference.
        aside = (place + 1) / (len(what.values) + 1) - 0.5 if names else 0.0
        at = [number for number, value in enumerate(column) if value is not None]
        _marks(area, x[at] + 0.7 * aside, np.array([column[number] for number in at], dtype=float), color, marker)
        height = bottom + 3.0 - 0.2 * (place + 0.5)
        _mark_beside(sheet, left + wide + 0.15, height, color, marker)
        draw_words(sheet, left + wide + 0.27, height, name, 8, color)
    return sheet


def _strip_frame(area: Area, x_label: str, y_label: str, names: Sequence[str]) -> None:
    if not names:
        draw_frame(area, x_label, y_label)
        return
    sheet, right = area.sheet, area.left + area.width
    numbers = round_numbers(*area.y)
    heights = [area.bottom + (value - area.y[0]) / (area.y[1] - area.y[0]) * area.height for value in numbers]
    draw_lines(sheet, np.array([((area.left, at), (right, at)) for at in heights]), "#e3e6e9", 0.6, 0.5, "grid")
    edges = [((area.left, area.bottom), (right, area.bottom))]
    edges += [((area.left, area.bottom), (area.left, area.bottom + area.height))]
    draw_lines(sheet, np.array(edges), EDGE, 0.7, 2.5, "axes")
    for at, number in zip(heights, written(numbers), strict=True):
        draw_words(sheet, area.left - 7 * POINT, at, number, 8.5, align=1.0)
    for place, name in enumerate(names):
        draw_words(sheet, float(area.place(np.array([place, 0.0]))[0]), area.bottom - 0.14, name, 8, align=0.5)
    draw_words(sheet, (area.left + right) / 2, area.bottom - 0.34, x_label, 8.5, align=0.5)
    draw_words(sheet, 0.14, area.bottom + area.height / 2, y_label, 8.5, align=0.5, upright=True)


def _marks(area: Area, x: Floats, y: Floats, color: str, marker: str) -> None:
    from matplotlib.lines import Line2D

    area.add(Line2D(x, y, ls="", marker=marker, ms=4, mfc="white", mec=color, mew=1.0, zorder=4, gid="points"))


def _mark_beside(sheet: Sheet, x: float, y: float, color: str, marker: str) -> None:
    from matplotlib.lines import Line2D

    sheet.add(Line2D([x], [y], ls="", marker=marker, ms=4, mfc="white", mec=color, mew=1.0, zorder=4))
