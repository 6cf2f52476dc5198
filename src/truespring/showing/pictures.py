"""Pictures of the states of a solution: what is drawn, with title and legend."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from truespring.errors import OutputError, shown
from truespring.report.axis import axis_of
from truespring.report.bodies import magnification, over_title
from truespring.report.quantity import times
from truespring.report.style import BLUE, FAINT, INK, MOTION
from truespring.report.surfaces import facets_of
from truespring.report.touching import drawn_tools, entries
from truespring.showing.frames import Entry, draw_legend
from truespring.showing.paints import Paint, paint_of
from truespring.showing.pairs import Pair
from truespring.showing.plane import draw_plane
from truespring.showing.scenes import Scene
from truespring.showing.shapes import rest_shape, shape_of
from truespring.showing.space import draw_space
from truespring.solution import State

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(frozen=True, eq=False)
class Picture:
    """A scene with the words of its title and the entries of its legend."""

    scene: Scene
    title: Sequence[str]
    names: Sequence[Entry]

    def draw(self, axes: "Axes") -> None:
        """Draw it into axes."""
        (draw_plane if self.scene.is_plane else draw_space)(axes, self.scene)
        draw_legend(axes, self.title, self.names)


def pictures_of(pair: Pair, states: Sequence[State], color: str | None, magnify: float | None) -> list[Picture]:
    """Return pictures of some states, all in one frame and with the same colours for the same values."""
    factor = _factor(pair, magnify)
    paints = [None if color is None else _paint(pair, state, color) for state in states]
    scenes = [_scene(pair, state, factor, paint) for state, paint in zip(states, _alike(paints), strict=True)]
    boxes = [scene.box for scene in scenes]
    frame = np.min([low for low, _ in boxes], axis=0), np.max([high for _, high in boxes], axis=0)
    return [
        Picture(replace(scene, frame=frame), _title(pair, state, factor, scene.paint), _names(pair, scene.paint))
        for scene, state in zip(scenes, states, strict=True)
    ]


def surface_picture(pair: Pair) -> Picture:
    """Return the picture of a surface that was read, which has no displacement."""
    solution = pair.solution
    scene = Scene(mesh=solution.problem.mesh, rest=None, mine=shape_of(solution, None, 1.0))
    return Picture(scene, [solution.label], [Entry(solution.label, BLUE)])


def _paint(pair: Pair, state: State, color: str) -> Paint:
    """Return the values of a quantity; of springs in a body in space, whose surface is coloured, means at nodes."""
    mesh, paint = pair.solution.problem.mesh, paint_of(color, pair, state)
    return paint.at_nodes(mesh.n_nodes) if len(facets_of(mesh)) else paint


def _alike(paints: Sequence[Paint | None]) -> list[Paint | None]:
    """Return paints with the same colours for the same values: the limits that hold all."""
    known = [paint for paint in paints if paint is not None]
    span = replace(known[0], values=np.concatenate([paint.values for paint in known])).limits if known else None
    return [None if paint is None else replace(paint, span=span) for paint in paints]


def _scene(pair: Pair, state: State, factor: float, paint: Paint | None) -> Scene:
    solution, over = pair.solution, pair.over
    return Scene(
        mesh=solution.problem.mesh,
        rest=rest_shape(solution),
        mine=shape_of(solution, state, factor),
        theirs=None if over is None else shape_of(over, over.at(state.level), factor),
        paint=paint,
        tools=drawn_tools(solution.problem, state.level or 0.0),
    )


def _names(pair: Pair, paint: Paint | None) -> list[Entry]:
    """Return the legend: a body in colours is named in the title."""
    solution, over = pair.solution, pair.over
    names = [Entry(solution.label, BLUE)] if paint is None else []
    if over is not None:
        names.append(Entry(over.label if paint is None else f"outline of {over.label}", INK))
    names.append(Entry("undeformed", FAINT, "--"))
    return [*names, *(Entry(entry.text, MOTION) for entry in entries(solution.problem))]


def _title(pair: Pair, state: State, factor: float, paint: Paint | None) -> list[str]:
    words = [] if paint is None else [pair.solution.label]
    words.append(_level_words(pair, state))
    return words if factor == 1 else [*words, f"displacements {times(factor)}"]


def _level_words(pair: Pair, state: State) -> str:
    """Return the level of a state in words, and its distance from a reference."""
    if state.level is None:
        return f"{(state.critical or '').capitalize()} at load factor {state.load_factor:.4g}"
    comparison = pair.comparison
    if comparison is not None:
        known = np.flatnonzero(np.abs(comparison.load_factors - state.level) < 1e-9)
        if known.size or comparison.surface is not None:
            return over_title(pair.result, state.level, comparison, int(known[0]) if known.size else 0)
    return axis_of(pair.result).words(state.level).capitalize()


def _factor(pair: Pair, magnify: float | None) -> float:
    """Return the magnification; a surface alone has no displacement to magnify."""
    over = pair.over
    if over is not None and not over.states:
        if magnify not in (None, 1):
            raise OutputError(f"magnify = {shown(magnify)}: {over.label} is a surface, whose displacement is not known")
        return 1.0
    if magnify is None:
        return magnification(pair.result)
    if not isinstance(magnify, int | float | np.number) or not (np.isfinite(magnify) and magnify > 0):
        raise OutputError(f"magnify = {shown(magnify)}: a factor above 0 is expected, such as 10")
    return float(magnify)
