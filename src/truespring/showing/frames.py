"""Axes of matplotlib: their size, limits, labels and legend, and lines, dots and images in them.

The data of axes are in metres: in the plane positions, in space places to the right and up in the picture plane.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.report.quantity import natural_scale, quantity
from truespring.report.render import Layer, Shot, draw, render
from truespring.report.surfaces import VIEW
from truespring.showing.scales import formatter

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Width of a figure, least and largest height [inch]: as wide as the text of a notebook.
_WIDTH, _LEAST, _MOST = 6.4, 2.2, 5.6
# Room above and below the body, beside it, and for a colour bar; least height with the label of a bar [inch].
_HEAD, _SIDE, _BAR, _LEAST_BAR = 1.1, 0.7, 0.9, 3.0
# Lines beyond this number are drawn thinner.
_MANY = 800
# Resolution [pixels/inch] and width of an image [inch].
_DPI, _IMAGE = 200, 6.0
# Faces beyond this number are drawn by PyVista, whose process takes seconds to start.
_MANY_FACES = 20_000
_TRIAD = "#3d4248"
# Width of a letter of a title [inch], and of the line of a name in letters.
_LETTER, _HANDLE = 0.078, 8


class Entry(NamedTuple):
    """A name in a legend, with the colour, style and width [points] of its line."""

    text: str
    color: str
    style: str = "-"
    width: float = 1.5


def new_axes(low: Floats, high: Floats, has_bar: bool = False) -> "Axes":
    """Return the axes of a new figure of pyplot, which notebooks show and `pyplot.show` opens, for a box [m]."""
    from matplotlib import pyplot

    _, axes = pyplot.subplots(figsize=figure_size(low, high, has_bar), layout="constrained")
    return axes


def figure_size(low: Floats, high: Floats, has_bar: bool) -> tuple[float, float]:
    """Return width and height of a figure of a box [inch]."""
    wide, tall = high - low
    room = _WIDTH - _SIDE - _BAR * has_bar
    return _WIDTH, float(np.clip(room * tall / wide + _HEAD, _LEAST_BAR if has_bar else _LEAST, _MOST))


def frame_plane(axes: "Axes", low: Floats, high: Floats) -> None:
    """Set equal scales, the limits of a box, and labels with a unit that fits."""
    scale = natural_scale(float(np.abs([low, high]).max()), "m")
    _show_box(axes, low, high)
    for axis, name in ((axes.xaxis, "x"), (axes.yaxis, "y")):
        axis.set_major_formatter(formatter(scale.size))
        axis.set_label_text(f"{name} [{scale.unit}]")
    axes.spines[["top", "right"]].set_visible(False)


def frame_space(axes: "Axes", low: Floats, high: Floats) -> Floats:
    """Set equal scales and limits, and draw the axes of space below the box; return the lower corner with them."""
    arm = _arm(float((high - low).max()))
    low = low - np.array([0.0, 1.6 * arm])
    _show_box(axes, low, high)
    axes.set_axis_off()
    tips = arm * VIEW[:2].T
    origin = low + 0.35 * arm - np.minimum(tips.min(axis=0), 0.0)
    for tip, name in zip(origin + tips, "xyz", strict=True):
        axes.annotate("", tip, origin, arrowprops={"arrowstyle": "->", "color": _TRIAD, "lw": 0.9})
        axes.annotate(name, origin + 1.25 * (tip - origin), ha="center", va="center", fontsize="small", color=_TRIAD)
    words = f"each {quantity(arm, 'm', 1)}"
    axes.annotate(words, origin + np.array([1.5 * arm, 0.0]), va="center", fontsize="x-small", color=_TRIAD)
    return low


def _show_box(axes: "Axes", low: Floats, high: Floats) -> None:
    axes.set_aspect("equal")
    axes.set_xlim(float(low[0]), float(high[0]))
    axes.set_ylim(float(low[1]), float(high[1]))


def _arm(size: float) -> float:
    """Return a round length for the arms of the triad [m]."""
    power = 10.0 ** np.floor(np.log10(0.12 * size))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= 0.12 * size * (1 + 1e-9)))


def draw_image(axes: "Axes", layers: Sequence[Layer], low: Floats, high: Floats, accurate: bool = False) -> None:
    """Draw layers as an image, see `image_of`."""
    pixels = round(_IMAGE * _DPI), round(_IMAGE * _DPI * float((high - low)[1] / (high - low)[0]))
    image = image_of(Shot(tuple(layers), low, high, pixels, _DPI / 72), accurate)
    axes.imshow(image, extent=(low[0], high[0], low[1], high[1]), zorder=2, gid="image", aspect="equal")
    _show_box(axes, low, high)


def image_of(shot: Shot, accurate: bool) -> Any:
    """Return the pixels of a shot: by matplotlib, which sorts faces by depth, or by PyVista if they are many.

    With `accurate`, PyVista draws in any case, as faces of very different size need it.
    """
    quick = not accurate and sum(len(layer.faces) for layer in shot.layers) <= _MANY_FACES
    return draw(shot) if quick else render([shot])()[0][0]


def draw_lines(
    axes: "Axes", points: Floats, pairs: Ints, color: str, width: float, zorder: float, name: str, **more: Any
) -> None:
    """Draw lines between points, of a width [points], thinner the more there are; `name` is their gid."""
    from matplotlib.collections import LineCollection

    ends = list(points[pairs][..., :2])
    width *= thinner(len(pairs))
    axes.add_collection(LineCollection(ends, colors=color, linewidths=width, zorder=zorder, gid=name, **more))


def draw_dashes(axes: "Axes", points: Floats, pairs: Ints, color: str, width: float, zorder: float, name: str) -> None:
    """Draw lines between points as dashed curves through several of them, as dashes restart in each curve."""
    from matplotlib.collections import LineCollection

    curves = [points[nodes][:, :2] for nodes in curves_of(pairs)]
    style: Any = {"linestyle": (0, (3, 2)), "zorder": zorder, "gid": name}
    axes.add_collection(LineCollection(curves, colors=color, linewidths=width, **style))


def curves_of(pairs: Ints) -> list[list[int]]:
    """Return curves through the ends of lines, shape (n, 2): each line is in one curve, once."""
    beside: dict[int, list[int]] = {}
    for one, other in pairs.tolist():
        beside.setdefault(one, []).append(other)
        beside.setdefault(other, []).append(one)
    curves = []
    for start in sorted(beside, key=lambda node: len(beside[node]) == 2):  # closed curves last
        while beside[start]:
            curve = [start]
            while beside[curve[-1]] and (len(curve) == 1 or len(beside[curve[-1]]) == 1):
                following = beside[curve[-1]].pop()
                beside[following].remove(curve[-1])
                curve.append(following)
            curves.append(curve)
    return curves


def thinner(n_lines: int) -> float:
    """Return the factor of the width of many lines."""
    return float(np.clip((_MANY / max(n_lines, 1)) ** 0.5, 0.3, 1.0))


def draw_dots(axes: "Axes", points: Floats, zorder: float, name: str, **style: Any) -> Any:
    """Draw points as dots with a rim."""
    rim: dict[str, Any] = {"linewidths": 0.4, "edgecolors": "#00000088"}
    return axes.scatter(points[:, 0], points[:, 1], s=16, zorder=zorder, gid=name, **rim, **style)


def _wrapped(words: Sequence[str], most: int) -> str:
    """Return words as one line, or as several of at most some letters."""
    lines = list(words[:1])
    for word in words[1:]:
        longer = f"{lines[-1]} · {word}"
        lines[-1:] = [longer] if len(longer) <= most else [lines[-1], word]
    return "\n".join(lines)


def draw_legend(axes: "Axes", words: Sequence[str], entries: Sequence[Entry]) -> None:
    """Write a title and names above the axes, in as many lines as their width needs."""
    from matplotlib.lines import Line2D

    figure: Any = axes.figure
    wide = axes.get_position().width * figure.bbox.width / figure.dpi  # [inch], before constraints of the layout
    title = _wrapped(words, int(wide / _LETTER))
    rows = -(-sum(len(entry.text) + _HANDLE for entry in entries) // int(1.5 * wide / _LETTER))
    legend: Any = axes.legend(
        handles=[Line2D([], [], color=one.color, ls=one.style, lw=one.width, label=one.text) for one in entries],
        title=title,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=max(1, -(-len(entries) // max(rows, 1))),
        frameon=False,
        fontsize="small",
        alignment="left",
        borderpad=0.1,
        borderaxespad=0.3,
    )
    legend.set_title(title, prop={"weight": "bold", "size": "medium"})
