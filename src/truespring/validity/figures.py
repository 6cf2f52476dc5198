"""Figures of a map: areas between the 1, 2, 5 and 10 % lines, labels of lines, marks of solved points."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.arrays import Floats
from truespring.models import Fem
from truespring.report.frame import EDGE, SIZE, round_numbers, written
from truespring.report.lines import draw_lines
from truespring.report.quantity import tolerance_percent
from truespring.report.sheet import Area, Sheet
from truespring.report.style import INK, POINT
from truespring.report.words import draw_words, text_width
from truespring.validity.lines import contours, spans
from truespring.validity.maps import Map, Maps
from truespring.validity.refine import LINES
from truespring.validity.sentences import headline, row_words

if TYPE_CHECKING:
    from matplotlib.path import Path

# From below the smallest line to above the largest; dark is a small error, also in grey and for colour-blind readers.
COLORS = ("#0b4f7d", "#3f87b8", "#8fbddb", "#d3e5f2", "#f7e6d8")
_HATCH, _BEYOND = "#b4bac0", 1e9

# Sizes [inch]: margins, area, legend on the right, strip, smallest distance of two labels of lines.
_LEFT, _BOTTOM, _TOP, _LEGEND = 0.62, 0.5, 0.62, 1.5
_WIDTH, _HEIGHT, _STRIP, _APART = 3.6, 2.6, 0.34, 0.42


def figures(validity: Maps) -> Iterator[tuple[str, Sheet]]:
    """Yield figures with the stem of their files: one per map, or one for all rows if y has names."""
    shown = [one for one in validity.maps if not one.unavailable]
    if validity.y in ("rule", "load-type"):
        kept = "load" if validity.y == "rule" else "rule"
        for name, group in itertools.groupby(
            sorted(shown, key=lambda one: _name(one, kept)), lambda one: _name(one, kept)
        ):
            yield f"validity_{_safe(name)}", strips_figure(validity, list(group))
        return
    for one in shown:
        drawn = map_figure(validity, one) if len(one.y) > 1 else strips_figure(validity, [one])
        yield f"validity_{one.load.name}_{_safe(one.rule.name)}", drawn


def _name(one: Map, kept: str) -> str:
    return one.load.name if kept == "load" else one.rule.name


def _safe(name: str) -> str:
    return name.replace("+", "_")


def map_figure(validity: Maps, one: Map) -> Sheet:
    """Return a map over two axes of numbers."""
    title = f"{one.load.did}: {one.rule.words}"
    sheet = Sheet(_LEFT + _WIDTH + _LEGEND, _BOTTOM + _HEIGHT + _TOP, f"{title}. {headline(validity, one)}")
    scale = one.load.scale if validity.x == "load" else 1.0
    x, (y, errors) = scale * one.x, _rows(validity, one)
    area = Area(sheet, _LEFT, _BOTTOM, _WIDTH, _HEIGHT, (x[0], x[-1]), (y[0], y[-1]))
    _draw_title(validity, one, sheet, title)
    missing = bool(np.isnan(errors).any())
    if missing:
        _draw_background(area)
    for low, high, color in _bands():
        for path in _filled(x, y, errors, low, high):
            _add_filled(area, path, color)
    _draw_solved(area, validity, one)
    whole = one.y if validity.y == "depth" else None
    _draw_axes(area, _x_label(validity, one), validity.axes[str(validity.y)].label, whole)
    _draw_lines(area, contours(x, y, errors))
    _draw_legend(sheet, validity, one, _LEFT + _WIDTH + 0.16, _BOTTOM + _HEIGHT, missing)
    return sheet


def strips_figure(validity: Maps, maps: Sequence[Map]) -> Sheet:
    """Return one strip per map, for an axis of names or a single axis; sizes of several loads are shares of each."""
    first = maps[0]
    shared = validity.x == "load" and len({one.load.name for one in maps}) > 1
    names = [row_words(validity, one, shared) for one in maps]
    left = max(text_width(name, SIZE) for name in names) + 0.25
    height = _STRIP * len(maps)
    title = {"rule": first.load.did, "load-type": first.rule.words[0].upper() + first.rule.words[1:]}.get(
        str(validity.y), f"{first.load.did}: {first.rule.words}"
    )
    top = _TOP if len(maps) == 1 else _TOP - 0.2
    room = max(height, 1.3)
    sheet = Sheet(left + _WIDTH + _LEGEND, _BOTTOM + room + top, title)
    if len(maps) == 1:
        _draw_title(validity, first, sheet, title)
    else:
        draw_words(sheet, 0.1, sheet.height - 0.17, f"{title}: error against {Fem(validity.law).label}", 9, bold=True)
    scale = 100.0 / first.x[-1] if shared else first.load.scale if validity.x == "load" else 1.0
    end = scale * first.x[-1]
    bottom = _BOTTOM + room - height
    area = Area(sheet, left, bottom, _WIDTH, height, (scale * first.x[0], end), (0.0, float(len(maps))))
    missing = any(bool(np.isnan(one.errors).any()) for one in maps)
    if missing:
        _draw_background(area)
    for row, one in enumerate(reversed(maps)):
        x = one.x * (100.0 / one.x[-1] if shared else scale)
        _draw_strip(area, x, one, float(row))
        draw_words(sheet, left - 0.1, bottom + _STRIP * (row + 0.5), names[::-1][row], SIZE, align=1.0)
    _draw_axes(area, "size of the load [% of each range]" if shared else _x_label(validity, first))
    _draw_legend(sheet, validity, first, left + _WIDTH + 0.16, _BOTTOM + room, missing)
    return sheet


def _rows(validity: Maps, one: Map) -> tuple[Floats, Floats]:
    """Return values along y and errors there, (n_y,) and (n_y, n_x); each depth becomes a row of constant error."""
    if validity.y != "depth":
        return one.smooth
    middles = (one.y[:-1] + one.y[1:]) / 2
    lower = np.concatenate([[one.y[0] - 0.5], middles])
    upper = np.concatenate([middles, [one.y[-1] + 0.5]])
    hair = 1e-6
    return np.column_stack([lower + hair, upper - hair]).ravel(), np.repeat(one.errors, 2, axis=0)


def _draw_title(validity: Maps, one: Map, sheet: Sheet, title: str) -> None:
    draw_words(sheet, 0.1, sheet.height - 0.17, title, 9, bold=True)
    words, lines = headline(validity, one).split(), [""]
    for word in words:
        longer = f"{lines[-1]} {word}".strip()
        if text_width(longer, 7.5) > sheet.width - 0.2 and len(lines) < 2:
            lines.append(word)
        else:
            lines[-1] = longer
    for place, line in enumerate(lines):
        draw_words(sheet, 0.1, sheet.height - 0.34 - 0.14 * place, line, 7.5, EDGE)


def _x_label(validity: Maps, one: Map) -> str:
    return one.load.axis if validity.x == "load" else validity.axes[validity.x].label


def _bands() -> Iterator[tuple[float, float, str]]:
    yield from zip((-1.0, *LINES), (*LINES, _BEYOND), COLORS, strict=True)


def _filled(x: Floats, y: Floats, errors: Floats, low: float, high: float) -> "Iterator[Path]":
    from contourpy import FillType, contour_generator
    from matplotlib.path import Path

    made = contour_generator(x, y, np.ma.masked_invalid(np.minimum(errors, _BEYOND / 2)), fill_type=FillType.OuterCode)
    points, codes = made.filled(low, high)[:2]
    for corners, code in zip(points, codes, strict=True):
        yield Path(np.asarray(corners), np.asarray(code))


def _add_filled(area: Area, path: "Path", color: str) -> None:
    from matplotlib.patches import PathPatch

    area.add(PathPatch(path, fc=color, ec=color, lw=0.3, zorder=1))


def _draw_background(area: Area) -> None:
    """Draw the hatching of areas without an error."""
    from matplotlib.patches import Rectangle

    (x, right), (y, top) = area.x, area.y
    look: dict[str, Any] = {"fc": "#f3f4f5", "ec": _HATCH, "lw": 0, "hatch": "////", "zorder": 0.4, "gid": "no result"}
    area.add(Rectangle((x, y), right - x, top - y, **look))


def _draw_strip(area: Area, x: Floats, one: Map, bottom: float) -> None:
    from matplotlib.patches import Rectangle

    for low, high, color in _bands():
        for begin, end in spans(x, np.where(one.errors[0] > low, one.errors[0], np.nan), high):
            area.add(Rectangle((begin, bottom + 0.08), end - begin, 0.84, fc=color, ec="none", lw=0, zorder=1))
    edges = [edge for line in LINES for stretch in spans(x, one.errors[0], line) for edge in stretch]
    _draw_marks(area, [edge for edge in edges if x[0] < edge < x[-1]], bottom)


def _draw_marks(area: Area, at: Sequence[float], bottom: float) -> None:
    from matplotlib.lines import Line2D

    for place in at:
        area.add(Line2D([place, place], [bottom + 0.08, bottom + 0.92], color="white", lw=0.8, zorder=2))


def _draw_axes(area: Area, x_label: str, y_label: str = "", whole: Floats | None = None) -> None:
    """Draw axes, ticks, numbers and labels; no y axis without a label; `whole` are integers to label along y."""
    sheet, tick = area.sheet, 3.5 * POINT
    left, bottom, right, top = area.left, area.bottom, area.left + area.width, area.bottom + area.height
    values = round_numbers(*area.x)
    places = [float(area.place(np.array([at, area.y[0]]))[0]) for at in values]
    edges = [((left, bottom), (right, bottom)), *(((at, bottom), (at, bottom - tick)) for at in places)]
    for at, number in zip(places, written(values), strict=True):
        draw_words(sheet, at, bottom - tick - 7 * POINT, number, SIZE, align=0.5)
    draw_words(sheet, left + area.width / 2, bottom - tick - 21 * POINT, x_label, SIZE, align=0.5)
    if y_label:
        values = round_numbers(*area.y) if whole is None else whole[:: 1 + len(whole) // 12]
        heights = [float(area.place(np.array([area.x[0], at]))[1]) for at in values]
        edges += [((left, bottom), (left, top)), *(((left, at), (left - tick, at)) for at in heights)]
        numbers = written(values) if whole is None else [f"{value:g}" for value in values]
        for at, number in zip(heights, numbers, strict=True):
            draw_words(sheet, left - 2 * tick, at, number, SIZE, align=1.0)
        beside = left - 2 * tick - max(text_width(number, SIZE) for number in numbers) - 7 * POINT
        draw_words(sheet, beside, (bottom + top) / 2, y_label, SIZE, align=0.5, upright=True)
    draw_lines(sheet, np.array(edges), EDGE, 0.7, 2.5, "axes")


def _draw_solved(area: Area, validity: Maps, one: Map) -> None:
    """Draw marks at solved rows, at the left side, or at solved points."""
    from matplotlib.lines import Line2D

    look: dict[str, Any] = {
        "ls": "",
        "marker": "o",
        "mfc": "white",
        "mec": INK,
        "mew": 0.7,
        "zorder": 6,
        "gid": "solved",
    }
    y = [getattr(spot, str(validity.y)) for spot in one.deviations]
    if validity.x == "load":
        drawn = Line2D([area.x[0]] * len(y), y, ms=3.6, clip_on=False, **look)
        area.add(drawn)
        drawn.set_clip_on(False)
        return
    area.add(Line2D([getattr(spot, validity.x) for spot in one.deviations], y, ms=2.4, **look))


def _draw_lines(area: Area, lines: Mapping[float, Sequence[Floats]]) -> None:
    """Draw lines with labels at their longest parts, away from other labels."""
    from matplotlib.lines import Line2D

    taken: list[Floats] = []
    low = np.array([area.left, area.bottom]) + 0.2
    high = np.array([area.left + area.width, area.bottom + area.height]) - 0.2
    for line, places in lines.items():
        for part in places:
            area.add(Line2D(*part.T, color=INK, lw=1.1, zorder=4, gid=f"line {tolerance_percent(line)}"))
        on_paper = [area.place(part) for part in places]
        for part in sorted(on_paper, key=_length, reverse=True):
            if _length(part) < 0.3:
                continue
            candidates = [_along(part, share) for share in (0.5, 0.35, 0.65, 0.2, 0.8, 0.1, 0.9)]
            free = [at for at in candidates if (at > low).all() and (at < high).all()]
            best = max(
                free, key=lambda at: min((float(np.linalg.norm(at - one)) for one in taken), default=9.0), default=None
            )
            if best is None or min((float(np.linalg.norm(best - one)) for one in taken), default=9.0) < _APART:
                continue
            taken.append(best)
            draw_words(area.sheet, best[0], best[1], tolerance_percent(line), 7.5, bold=True, align=0.5, halo=True)


def _length(part: Floats) -> float:
    return float(np.linalg.norm(np.diff(part, axis=0), axis=1).sum())


def _along(part: Floats, share: float) -> Floats:
    """Return the point at a share of the length of a polyline, shape (2,)."""
    way = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(part, axis=0), axis=1))])
    return np.array([np.interp(share * way[-1], way, part[:, axis]) for axis in (0, 1)])


def _draw_legend(sheet: Sheet, validity: Maps, one: Map, left: float, top: float, missing: bool) -> None:
    from matplotlib.patches import Rectangle

    draw_words(sheet, left, top - 0.06, "error against", 7.5, EDGE)
    draw_words(sheet, left, top - 0.2, Fem(validity.law).label, 7.5, bold=True)
    bounds = [tolerance_percent(line) for line in LINES]
    words = [
        f"within {bounds[0]}",
        *(f"{a[:-2]} to {b}" for a, b in itertools.pairwise(bounds)),
        f"more than {bounds[-1]}",
    ]
    looks: list[tuple[str, dict[str, Any]]] = [
        (word, {"fc": color, "ec": EDGE, "lw": 0.5}) for word, color in zip(words, COLORS, strict=True)
    ]
    if missing:
        looks.append(("no result", {"fc": "#f3f4f5", "ec": _HATCH, "lw": 0.5, "hatch": "////"}))
    y = top - 0.46
    if len(one.y) > 1:
        from matplotlib.lines import Line2D

        below = y - 0.17 * len(looks) - 0.05
        mark = Line2D([left + 0.1], [below], ls="", marker="o", mfc="white", mec=INK, mew=0.7, ms=3.6)
        sheet.add(mark)
        draw_words(sheet, left + 0.28, below, "solved", 7.5)
    for word, look in looks:
        drawn = Rectangle((left, y - 0.055), 0.2, 0.11, zorder=3, **look)
        sheet.add(drawn)
        draw_words(sheet, left + 0.28, y, word, 7.5)
        y -= 0.17
