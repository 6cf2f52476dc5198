"""Pictures of solutions in axes of matplotlib."""

from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.report.axis import axis_of
from truespring.report.bodies import magnification
from truespring.report.quantity import percent, times
from truespring.report.result import Result
from truespring.report.style import BLUE, FAINT, INK
from truespring.showing.levels import numbered
from truespring.showing.paints import Paint, paint_of
from truespring.showing.pairs import result_of, states_of_both
from truespring.showing.plane import draw_plane
from truespring.showing.scenes import Scene
from truespring.showing.space import draw_space
from truespring.solution import Solution, State

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Width of a figure, least and largest height [inch]: as wide as the text of a notebook.
_WIDTH, _LEAST, _MOST = 6.4, 2.4, 5.6
# Room above the body for the legend, below for numbers [inch].
_HEAD = 1.3


def plot_solution(
    solution: Solution,
    over: Solution | None,
    color: str | None,
    level: int,
    magnify: float | None,
    axes: "Axes | None",
) -> "Axes":
    """Draw a state of a solution into axes, see `Solution.plot`."""
    result = result_of(solution, over)
    state = numbered(states_of_both(solution, over), level, solution)
    paint = None if color is None else paint_of(color, solution, state, over)
    scene = _scene(result, solution, over, state, magnify, paint)
    axes = _new_axes(scene) if axes is None else axes
    draw = draw_plane if solution.problem.mesh.dim == 2 else draw_space
    draw(axes, scene)
    _legend(axes, scene)
    return axes


def _scene(
    result: Result,
    solution: Solution,
    over: Solution | None,
    state: State,
    magnify: float | None,
    paint: Paint | None,
) -> Scene:
    factor = magnification(result) if magnify is None else float(magnify)
    rest = solution.problem.mesh.nodes
    theirs = None if over is None else over.at(state.level)
    return Scene(
        solution=solution,
        over=over,
        state=state,
        mine=rest + factor * state.displacement,
        theirs=None if over is None or theirs is None else over.problem.mesh.nodes + factor * theirs.displacement,
        factor=factor,
        paint=paint,
        title=_title(result, state, factor),
    )


def _title(result: Result, state: State, factor: float) -> str:
    level = state.load_factor if state.level is None else state.level
    words = [axis_of(result).words(level).capitalize()]
    for comparison in result.comparisons.values():
        known = np.flatnonzero(np.abs(comparison.load_factors - level) < 1e-9)
        if known.size and np.isfinite(comparison.rms_errors[known[0]]):
            words.append(f"{percent(float(comparison.rms_errors[known[0]]))} apart (root mean square)")
    words += [f"displacements {times(factor)}"] if factor != 1 else []
    return " · ".join(words)


def _new_axes(scene: Scene) -> "Axes":
    from matplotlib import pyplot

    low, high = scene.box
    wide, tall = high - low
    height = float(np.clip(_WIDTH * tall / wide + _HEAD, _LEAST, _MOST))
    _, axes = pyplot.subplots(figsize=(_WIDTH, height), layout="constrained")
    return axes


def _legend(axes: "Axes", scene: Scene) -> None:
    """Write title and names of the bodies above the axes."""
    from matplotlib.lines import Line2D

    entries = [] if scene.paint is not None else [Line2D([], [], color=BLUE, label=scene.solution.label)]
    entries += [Line2D([], [], color=INK, label=scene.over.label)] if scene.over is not None else []
    entries += [Line2D([], [], color=FAINT, ls=(0, (3, 2)), label="undeformed")]
    legend: Any = axes.legend(
        handles=entries,
        title=scene.title,
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=len(entries),
        frameon=False,
        fontsize="small",
        alignment="left",
        borderaxespad=0.2,
    )
    legend.set_title(scene.title, prop={"weight": "bold", "size": "medium"})
