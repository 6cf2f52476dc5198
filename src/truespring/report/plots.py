"""Plots: displacement against force, errors by load level, Young's modulus by direction."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.equilibrium import Solution, State
from truespring.reactions import SupportForce, leading_support
from truespring.report.axis import axis_of, driven_by_motion
from truespring.report.frame import EDGE, draw_frame
from truespring.report.quantity import natural_scale, tolerance_percent
from truespring.report.result import Result
from truespring.report.sheet import Area, Sheet
from truespring.report.style import BLUE, FAINT, POINT, RED, is_strong, label_and_name, path_styles
from truespring.report.verdict import display_name, drive, material_name
from truespring.report.words import draw_words, text_width
from truespring.report.young import Known, young_figure


@dataclass(frozen=True, slots=True)
class Curve:
    """A line of a plot, shape (n,) each; text after a line break in its label is fainter."""

    x: Floats
    y: Floats
    color: str
    dashes: Any
    marker: str
    label: str
    strong: bool
    unstable: Bools | None = None
    critical: Ints | None = None


def curves_figure(result: Result) -> Sheet:
    """Return the displacement of the probe against the force, both along the main direction of the loads or motion.

    Against time in a motion; against the load factor if the loads have no total, such as a moment.
    """
    to, axis = drive(result), axis_of(result)
    by_level = axis.moves or _is_balanced(result)
    styles = path_styles(result)
    forces, moves = {}, {}
    for name, path in result.solutions.items():
        if path.states:
            forces[name] = to.sign * np.array([path.applied_force(state)[to.axis] for state in path.states])
            forces[name] = axis.value(path.load_factors) if by_level else forces[name]
            moves[name] = to.sign * np.array([state.displacement[result.probe, to.axis] for state in path.states])
    x_scale = natural_scale(max(float(np.abs(values).max()) for values in forces.values()), "N")
    y_scale = natural_scale(max(float(np.abs(values).max()) for values in moves.values()), "m")
    name_of_x = axis.label if by_level else f"total force along {to.name} [{x_scale.unit}]"
    curves = [
        Curve(
            forces[name] / (1.0 if by_level else x_scale.size),
            moves[name] / y_scale.size,
            *styles[name],
            label=_two_lines(result, name),
            strong=is_strong(result, name),
            unstable=np.array([bool(state.negative_eigenvalues) for state in result.solutions[name].states]),
            critical=np.flatnonzero([bool(state.critical) for state in result.solutions[name].states]),
        )
        for name in forces
    ]
    return plot(
        f"Displacement of the probe against {axis.name if by_level else 'force'}",
        name_of_x,
        f"displacement along {to.name} [{y_scale.unit}]",
        curves,
    ).sheet


def _is_balanced(result: Result) -> bool:
    """Return whether the force has no total: loads or reactions cancel, or are unknown for a path."""
    forces = np.array([path.applied_force(path.states[-1]) for path in result.solutions.values() if path.states])
    if not np.isfinite(forces).all() or (not result.problem.stated and not forces.any()):
        return True
    if not result.problem.stated:
        return False
    if driven_by_motion(result):
        leading = [_of_leading(path, path.states[-1]) for path in result.solutions.values() if path.states]
        return not any(one is not None and one.has_force for one in leading)
    force = result.problem.loading.full.force(result.problem.mesh.nodes)
    return float(np.abs(force.sum(axis=0)).max()) <= 1e-9 * float(np.abs(force).sum())


def _of_leading(path: Solution, state: State) -> SupportForce | None:
    """Return force and torque of the support that moves most; None if unknown."""
    number = leading_support(path.problem) if path.problem.stated else None
    return next((one for one in path.support_forces(state) if one.support == number), None)


def error_figure(result: Result) -> Sheet:
    """Return the error, of displacement or of force if larger, against every reference by level."""
    from matplotlib.patches import Rectangle

    styles, axis = path_styles(result), axis_of(result)
    forced = any(np.isfinite(one.force_errors).any() for one in result.comparisons.values())
    name_of_y = "rms error or error of a force, the larger [%]" if forced else "rms error [%]"
    if any(one.over_the_way for one in result.comparisons.values()):
        what = "distance or difference of force" if forced else "distance"
        name_of_y = f"rms {what} [% over the way]"
    curves = [
        Curve(
            axis.value(one.load_factors),
            100 * one.errors,
            *styles[name],
            label=_two_lines(result, name),
            strong=False,
        )
        for name, one in result.comparisons.items()
        if one.load_factors.size
    ]
    tolerance, end = 100 * result.tolerance, 1.02 * axis.span
    within = f"within {tolerance_percent(result.tolerance)}"
    curves.append(Curve(np.array([0, end]), np.full(2, tolerance), BLUE, (0, (4, 2)), "", within, strong=False))
    who = result.solutions[result.model].label if result.model else "the model"
    area = plot(f"Error of {who} against each reference", axis.label, name_of_y, curves, to_right=end)
    area.add(Rectangle((0, 0), end, tolerance, color=BLUE, alpha=0.09, lw=0, zorder=0.5, gid="tolerance"))
    return area.sheet


def _two_lines(result: Result, name: str) -> str:
    return "\n".join(label_and_name(result, name))


# Widths in the margin with the names of curves [inch]: leader, sample of the line, gap, free space.
_LEADER, _SAMPLE, _GAP, _FREE = 0.12, 0.27, 0.07, 0.1


def plot(
    title: str,
    x_label: str,
    y_label: str,
    curves: Sequence[Curve],
    to_right: float | None = None,
    far: bool = False,
) -> Area:
    """Return a plot of lines with their names at their ends, shifted so that they do not overlap.

    Axes start at 0 or below, unless values are `far` from 0; with `to_right` the x axis spans 0 to that value.
    """
    from matplotlib.lines import Line2D

    names = [(curve.label.partition("\n"), curve.strong) for curve in curves]
    longest = max(max(text_width(one, 8, strong), text_width(two, 7)) for (one, _, two), strong in names)
    left, bottom, top = 0.62, 0.5, 0.38
    right = _LEADER + _SAMPLE + _GAP + longest + _FREE
    height = max(3.0, 0.34 * len(curves))
    sheet = Sheet(max(5.9, left + 3.2 + right), bottom + height + top, title)
    low, high = _span([curve.y for curve in curves])
    x = _span([curve.x for curve in curves]) if to_right is None else (0.0, to_right)
    y = (low if far else min(low, 0.0) if to_right is None else 0.0, high)
    area = Area(sheet, left, bottom, sheet.width - left - right, height, x, y)
    draw_frame(area, x_label, y_label)
    draw_words(sheet, left, sheet.height - 0.19, title, 9, bold=True)
    for curve in curves:
        label, look = curve.label.replace("\n", ", "), _look(curve)
        for part, dashed in _stretches(curve):
            area.add(
                Line2D(curve.x[part], curve.y[part], label=label, **look | ({"ls": (0, (3, 2))} if dashed else {}))
            )
        if curve.critical is not None and curve.critical.size:
            at: dict[str, Any] = {
                "ls": "",
                "marker": "D",
                "ms": 6,
                "mfc": "white",
                "mec": RED,
                "mew": 1.4,
                "zorder": 6,
                "gid": "critical",
            }
            area.add(Line2D(curve.x[curve.critical], curve.y[curve.critical], **at))
    _name_ends(area, curves)
    return area


def _stretches(curve: Curve) -> Iterator[tuple[slice, bool]]:
    """Yield the stable and unstable parts of a curve, and whether unstable; a step is stable if both its ends are."""
    if curve.unstable is None or not curve.unstable.any() or len(curve.unstable) == 1:
        yield slice(None), False
        return
    steps = curve.unstable[:-1] | curve.unstable[1:]
    ends = np.concatenate([[0], np.flatnonzero(np.diff(steps)) + 1, [len(steps)]])
    for begin, end in itertools.pairwise(ends.tolist()):
        yield slice(begin, end + 1), bool(steps[begin])


def _span(several: Sequence[Floats]) -> tuple[float, float]:
    """Return the range of all finite numbers, extended by 5 % at both ends."""
    values = np.concatenate(several)
    values = values[np.isfinite(values)]
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 0.0)
    room = 0.05 * (high - low) or 0.05 * abs(high) or 0.05
    return low - room, high + room


# About so many points of a curve have markers.
_MARKERS = 20


def _look(curve: Curve) -> dict[str, Any]:
    return {
        "color": curve.color,
        "ls": curve.dashes,
        "lw": 2.2 if curve.strong else 1.3 if curve.marker else 1,
        "marker": curve.marker,
        "ms": 4.2 if curve.strong else 3.6,
        "markevery": max(1, len(curve.x) // _MARKERS),
        "mfc": curve.color if curve.strong else "white",
        "mew": 0.9,
        "zorder": 4 if curve.strong else 3,
    }


def _name_ends(area: Area, curves: Sequence[Curve]) -> None:
    """Write the names of curves right of the area, in the order of their ends, each with a sample of its line.

    Curves that end near the right side get a leader to their name.
    """
    from matplotlib.lines import Line2D

    corner, size = np.array([area.left, area.bottom]), np.array([area.width, area.height])
    ends = (area.place(np.array([(curve.x[-1], curve.y[-1]) for curve in curves])) - corner).clip(0, size)
    gap = (27 if any("\n" in curve.label for curve in curves) else 17) * POINT
    places = size[1] * _apart(ends[:, 1] / size[1], gap / size[1], ends[:, 0])
    led = np.flatnonzero(ends[:, 0] > 0.9 * size[0])
    places[led] = _uncrossed(ends[led], size[0] + _LEADER, places[led])
    at = area.left + area.width + _LEADER
    for index, (curve, (x, y), place) in enumerate(zip(curves, ends + corner, places + area.bottom, strict=True)):
        if index in led:
            area.sheet.add(Line2D([x, at], [y, place], color=FAINT, lw=0.7, zorder=2))
        sample = [at, at + _SAMPLE / 2, at + _SAMPLE]
        area.sheet.add(Line2D(sample, [place] * 3, **_look(curve) | {"markevery": [1]}))
        first, _, second = curve.label.partition("\n")
        beside, up = sample[-1] + _GAP, 5 * POINT if second else 0.0
        draw_words(area.sheet, beside, place + up, first, color=curve.color, bold=curve.strong)
        draw_words(area.sheet, beside, place - up, second, 7, EDGE)


def _uncrossed(ends: Floats, to_right: float, places: Floats) -> Floats:
    """Return `places`, shape (n,), permuted until no two lines from `ends`, shape (n, 2), to (to_right, place) cross.

    It terminates: exchanging two places whose lines cross makes the total length shorter.
    """
    places = places.copy()

    def crossing() -> tuple[int, int] | None:
        for i, j in itertools.combinations(range(len(places)), 2):
            start = max(ends[i, 0], ends[j, 0])
            share = (start - ends[[i, j], 0]) / (to_right - ends[[i, j], 0])
            above = ends[[i, j], 1] + share * (places[[i, j]] - ends[[i, j], 1])
            if (above[0] - above[1]) * (places[i] - places[j]) < -1e-12:
                return i, j
        return None

    while (pair := crossing()) is not None:
        places[list(pair)] = places[list(pair[::-1])]
    return places


def _apart(places: Floats, gap: float, ties: Floats) -> Floats:
    """Return places on a line, shape (n,), moved as little as possible so that neighbours are at least `gap` apart.

    Of equal places the one with the smaller of `ties` is first. Overlapping neighbours are merged into a block about
    their mean, until no blocks overlap; then all are shifted into 0 ... 1 as far as they fit.
    """
    order = np.lexsort((ties, places.round(3)))
    blocks: list[list[float]] = []  # [sum of preferred starts, count]
    for rank, index in enumerate(order):
        blocks.append([float(places[index]) - rank * gap, 1.0])
        while len(blocks) > 1 and blocks[-2][0] / blocks[-2][1] >= blocks[-1][0] / blocks[-1][1]:
            total, count = blocks.pop()
            blocks[-1][0] += total
            blocks[-1][1] += count
    starts = np.concatenate([np.full(int(count), total / count) for total, count in blocks])
    starts = np.clip(starts, min(0.0, 1 - gap * len(places)), max(1 - (len(places) - 1) * gap, 0.0))
    moved = np.empty(len(places))
    moved[order] = starts + gap * np.arange(len(places))
    return moved


def moduli_figure(result: Result) -> Sheet:
    """Return the effective Young's modulus along every direction of a study's springs, and that of the material."""
    styles = path_styles(result)
    several = [
        Known(display_name(result, name), path.moduli, *styles[name][:2])
        for name, path in result.solutions.items()
        if path.moduli is not None
    ]
    return young_figure(several, material_name(result))
