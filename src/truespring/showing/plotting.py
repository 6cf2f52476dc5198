"""Pictures of solutions in axes of matplotlib."""

from typing import TYPE_CHECKING

import numpy as np

from truespring.errors import OutputError
from truespring.report.axis import axis_of
from truespring.report.bodies import magnification, over_title
from truespring.report.quantity import times
from truespring.report.result import Result
from truespring.report.style import BLUE, FAINT, INK, MOTION
from truespring.report.touching import drawn_tools, entries
from truespring.showing.frames import Entry, draw_legend, new_axes
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


def plot_solution(
    solution: Solution,
    over: Solution | None,
    color: str | None,
    level: int,
    magnify: float | None,
    axes: "Axes | None",
) -> "Axes":
    """Draw a state of a solution into axes, see `Solution.plot`."""
    if hasattr(axes, "get_zlim"):
        raise OutputError(
            "ax has three axes: bodies in space are drawn as an image in plane ones: leave projection out"
        )
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
    names = [] if color else [Entry(solution.label, BLUE)]
    names += [] if over is None else [Entry(f"outline of {over.label}" if color else over.label, INK)]
    names += [Entry("undeformed", FAINT, "--")]
    names += [Entry(entry.text, MOTION) for entry in entries(solution.problem)]
    head = [solution.label] if color else []
    head += [_level_words(result, state)]
    head += [f"displacements {times(factor)}"] if factor != 1 else []
    return _draw(scene, head, names, axes)


def _plot_surface(solution: Solution, over: Solution | None, color: str | None, axes: "Axes | None") -> "Axes":
    """Draw a surface that was read, which has no displacement."""
    if over is not None or color is not None:
        raise OutputError(
            f"{solution.label} is a surface without displacements: draw it alone, or as the reference: plot(over=...)"
        )
    scene = Scene(mesh=solution.problem.mesh, rest=None, mine=shape_of(solution, None, 1.0))
    return _draw(scene, [solution.label], [Entry(solution.label, BLUE)], axes)


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


def _draw(scene: Scene, title: list[str], names: list[Entry], axes: "Axes | None") -> "Axes":
    axes = new_axes(*scene.box, has_bar=scene.paint is not None) if axes is None else axes
    (draw_plane if scene.is_plane else draw_space)(axes, scene)
    draw_legend(axes, title, names)
    return axes
