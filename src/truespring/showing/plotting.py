"""Pictures of solutions in axes of matplotlib."""

from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.errors import OutputError
from truespring.report.axis import axis_of
from truespring.report.bodies import magnification, over_title
from truespring.report.quantity import times
from truespring.report.result import Result
from truespring.report.style import BLUE, FAINT, INK, MOTION
from truespring.report.touching import drawn_tools, entries
from truespring.showing.levels import numbered
from truespring.showing.paints import paint_of
from truespring.showing.pairs import result_of, states_of_both
from truespring.showing.plane import draw_plane
from truespring.showing.scenes import Scene
from truespring.showing.shapes import rest_shape, shape_of
from truespring.showing.space import draw_space
from truespring.solution import Solution, State

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Width of a figure, least and largest height [inch]: as wide as the text of a notebook.
_WIDTH, _LEAST, _MOST = 6.4, 2.2, 5.6
# Room above and below the body, beside it, and for a colour bar; least height with the label of a bar [inch].
_HEAD, _SIDE, _BAR, _LEAST_BAR = 1.1, 0.7, 0.9, 3.0
# Characters of a line of the title.
_LINE = 64


def plot_solution(
    solution: Solution,
    over: Solution | None,
    color: str | None,
    level: int,
    magnify: float | None,
    axes: "Axes | None",
) -> "Axes":
    """Draw a state of a solution into axes, see `Solution.plot`."""
    if not solution.states:
        return _plot_surface(solution, over, color, axes)
    state = numbered(states_of_both(solution, over), level, solution)
    result = result_of(solution, over)
    factor = _factor(result, over, magnify)
    scene = Scene(
        mesh=solution.problem.mesh,
        rest=rest_shape(solution),
        mine=shape_of(solution, state, factor),
        theirs=None if over is None else shape_of(over, over.at(state.level), factor),
        paint=None if color is None else paint_of(color, solution, state, over),
        tools=drawn_tools(solution.problem, state.level or 0.0),
    )
    names = [] if color else [(solution.label, BLUE, "-")]
    names += [] if over is None else [(f"outline of {over.label}" if color else over.label, INK, "-")]
    names += [("undeformed", FAINT, "--")]
    names += [(entry.text, MOTION, "-") for entry in entries(solution.problem)]
    head = [solution.label] if color else []
    head += [_level_words(result, state)]
    head += [f"displacements {times(factor)}"] if factor != 1 else []
    return draw(scene, _wrapped(head), names, axes)


def _plot_surface(solution: Solution, over: Solution | None, color: str | None, axes: "Axes | None") -> "Axes":
    """Draw a surface that was read, which has no displacement."""
    if over is not None or color is not None:
        raise OutputError(
            f"{solution.label} is a surface without displacements: draw it alone, or as the reference: plot(over=...)"
        )
    scene = Scene(mesh=solution.problem.mesh, rest=None, mine=shape_of(solution, None, 1.0))
    return draw(scene, solution.label, [(solution.label, BLUE, "-")], axes)


def _factor(result: Result, over: Solution | None, magnify: float | None) -> float:
    """Return the magnification; a surface alone has no displacement to magnify."""
    if over is not None and not over.states:
        if magnify not in (None, 1):
            raise OutputError(f"magnify = {magnify:g}: {over.label} is a surface, whose displacement is not known")
        return 1.0
    if magnify is None:
        return magnification(result)
    if not (np.isfinite(magnify) and magnify > 0):
        raise OutputError(f"magnify = {magnify!r}: a factor above 0 is expected, such as 10")
    return float(magnify)


def _level_words(result: Result, state: State) -> str:
    """Return the level of a state in words, and its distance from a reference."""
    if state.level is None:
        return f"{(state.critical or '').capitalize()} at load factor {state.load_factor:.4g}"
    for comparison in result.comparisons.values():
        known = np.abs(comparison.load_factors - state.level) < 1e-9
        if known.any() or comparison.surface is not None:
            shown = int(np.flatnonzero(known)[0]) if known.any() else 0
            return over_title(result, state.level, comparison, shown)
    return axis_of(result).words(state.level).capitalize()


def _wrapped(words: list[str]) -> str:
    """Return words as one line, or several that fit in the width of a figure."""
    lines = [words[0]]
    for word in words[1:]:
        longer = f"{lines[-1]} · {word}"
        lines[-1:] = [longer] if len(longer) <= _LINE else [lines[-1], word]
    return "\n".join(lines)


def draw(scene: Scene, title: str, names: list[tuple[str, str, str]], axes: "Axes | None") -> "Axes":
    """Draw a scene into axes, those of a new figure for None, with a title and names of lines in a legend.

    `names` are text, colour and line style.
    """
    axes = _new_axes(scene) if axes is None else axes
    (draw_plane if scene.is_plane else draw_space)(axes, scene)
    _legend(axes, title, names)
    return axes


def _new_axes(scene: Scene) -> "Axes":
    """Return the axes of a new figure of pyplot, which notebooks show and `pyplot.show` opens."""
    from matplotlib import pyplot

    _, axes = pyplot.subplots(figsize=figure_size(scene), layout="constrained")
    return axes


def figure_size(scene: Scene) -> tuple[float, float]:
    """Return width and height of a figure [inch]."""
    low, high = scene.box
    wide, tall = high - low
    room = _WIDTH - _SIDE - _BAR * (scene.paint is not None)
    least = _LEAST if scene.paint is None else _LEAST_BAR
    return _WIDTH, float(np.clip(room * tall / wide + _HEAD, least, _MOST))


def _legend(axes: "Axes", title: str, names: list[tuple[str, str, str]]) -> None:
    """Write title and names above the axes."""
    from matplotlib.lines import Line2D

    legend: Any = axes.legend(
        handles=[Line2D([], [], color=color, ls=style, label=label) for label, color, style in names],
        title=title,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=2 if sum(len(label) for label, _, _ in names) > 60 else len(names),
        frameon=False,
        fontsize="small",
        alignment="left",
        borderpad=0.1,
        borderaxespad=0.3,
    )
    legend.set_title(title, prop={"weight": "bold", "size": "medium"})
