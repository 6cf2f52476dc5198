"""Figures of bodies in 3D: undeformed, a model over a reference, and their distance.

Bodies are an image (render.py), for hidden lines and faces; text, marks, arrows and scales are drawn over it as in 2D.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.comparison import Comparison
from truespring.equilibrium import Solution
from truespring.problem import Problem
from truespring.report.bar import Bar, bar_of
from truespring.report.bodies import (
    magnification,
    over_title,
    path_lines,
    picture_box,
)
from truespring.report.frame3d import Picture
from truespring.report.legend import Entry
from truespring.report.lines import draw_lines
from truespring.report.quantity import ROUNDING, Scale, times
from truespring.report.render import Layer, rgb
from truespring.report.result import Result
from truespring.report.shades import draw_shaded_dots
from truespring.report.sheet import Area
from truespring.report.style import BLUE, FAINT, INK, LOAD, RED, error_colors, full_name
from truespring.report.supports3d import clamped_nodes, draw_supports
from truespring.report.surfaces import VIEW, edges_of, facets_of, lines_on, normals, outline, seen
from truespring.report.symbols import Arrow, draw_dot, draw_drive, draw_loaded, draw_outside, find_arrows
from truespring.report.touching import drawn_tools, entries, near, with_tools
from truespring.report.undeformed import Undeformed
from truespring.report.verdict import display_name, level_name

#: Colours of surfaces: undeformed body, reference, supports; the light comes from above, left of the viewer.
BODY, REFERENCE, _HELD = "#f7f8f9", "#e6e9ec", "#bcc2c8"
_LIGHT = np.array([-0.3, 0.6, 0.74]) / np.linalg.norm([-0.3, 0.6, 0.74])
_DASHES = (0, (3, 2))


def undeformed_picture(body: Undeformed) -> Picture:
    """Return the undeformed body: mesh, springs, supports, loads and the probe."""
    problem, springs = body.problem, body.springs
    mesh = problem.mesh
    size = float((mesh.upper - mesh.lower).max())
    points, facets = seen(mesh.nodes), facets_of(mesh)
    arrows = find_arrows(problem, size, lambda places: seen(places)[:, :2], VIEW[2])
    layers = []
    if len(facets):
        layers.append(solid(points, facets, _tinted(problem, facets, arrows), edges_of(facets), INK, 1.0))
    if springs is not None:
        layers.append(wires(points, facets, springs, 0.6))
    elif body.has_elements and not len(facets):
        layers.append(wires(points, facets, mesh.edges, 0.6, INK))
    tools = drawn_tools(problem, None)
    corners = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    taken = np.concatenate(
        [
            _spots(points, facets, mesh.edges),
            near(tools, *corners),
            *(np.stack([*one.ends, one.room]) for one in arrows),
        ]
    )

    def marks(area: Area, scale: Scale) -> None:
        draw_supports(area, problem, scale, 0.028 * size)
        for arrow in arrows:
            if not _within(facets, arrow.nodes, mesh.n_nodes).any():
                draw_loaded(area, points[arrow.nodes, :2] / scale.size, arrow.color)
            draw_drive(area, arrow, scale)
        if body.probe is not None:
            draw_dot(area, points[body.probe, :2] / scale.size)

    lower, upper = taken.min(axis=0) - 0.03 * size, taken.max(axis=0) + 0.03 * size
    legend = (*body.legend, *entries(problem))
    return Picture(body.title, "", legend, lower, upper, taken, with_tools(layers, tools), marks)


@dataclass(frozen=True, eq=False, slots=True)
class _Pair:
    """A model and a reference at the last level that both have, in the coordinates of `seen` [m].

    Attributes:
        level: load factor.
        factor: magnification of displacements.
        rest, mine, theirs: undeformed nodes, nodes of the model, of the reference, shape (n_nodes, 3).
        distance: of nodes of the model from the reference, shape (n_nodes,); 0 outside of it.
        largest: displacement of the reference.
    """

    level: float
    factor: float
    rest: Floats
    mine: Floats
    theirs: Floats
    distance: Floats
    largest: float


def _pair(result: Result, comparison: Comparison) -> _Pair | None:
    level = float(comparison.load_factors[-1]) if comparison.load_factors.size else 0.0
    mine, theirs = comparison.model.at(level), comparison.reference.at(level)
    if mine is None or theirs is None or not level:
        return None
    rest, factor = comparison.model.problem.mesh.nodes, magnification(result)
    return _Pair(
        level=level,
        factor=factor,
        rest=seen(rest),
        mine=seen(rest + factor * mine.displacement),
        theirs=seen(rest + factor * theirs.displacement),
        distance=np.where(comparison.outside, 0.0, np.linalg.norm(mine.displacement - theirs.displacement, axis=1)),
        largest=float(np.linalg.norm(theirs.displacement[~comparison.outside], axis=1).max()),
    )


def over_picture(result: Result, name: str, comparison: Comparison) -> Picture | None:
    """Return the model in blue over a reference in black, at the last load level that both have; None without one."""
    pair = _pair(result, comparison)
    if pair is None:
        return None
    layers = over_layers(comparison.model, pair.mine, comparison.reference, pair.theirs)
    legend = (
        Entry(full_name(result, result.model or ""), BLUE),
        Entry(full_name(result, name), INK),
        Entry("undeformed", FAINT, linestyle=_DASHES),
        Entry("probe", RED, "o", ""),
    )
    return _pair_picture(result, name, comparison, pair, over_title(result, pair.level, comparison), legend, layers)


def over_layers(model: Solution, mine: Floats, reference: Solution | None, theirs: Floats | None) -> tuple[Layer, ...]:
    """Return a model in blue over a reference in black, alone a white body with blue lines.

    `mine` and `theirs` are the nodes in the coordinates of `seen` [m], shape (n_nodes, 3).
    """
    facets = facets_of(model.problem.mesh)
    if reference is None or theirs is None:
        if not len(facets):
            return (wires(mine, facets, path_lines(model), 0.8),)
        body = solid(mine, facets, one_color(facets, BODY), path_lines(model), BLUE, 0.8)
        return body, wires(mine, facets, outline(mine, facets, silhouette=True), 0.8)
    others, lines = facets_of(reference.problem.mesh), path_lines(reference)
    if len(others):
        black = solid(theirs, others, one_color(others, REFERENCE), lines, INK, 1.2)
    else:
        black = wires(theirs, others, lines, 1.3, INK)
    return black, wires(mine, facets, path_lines(model), 0.8)


def distance_picture(result: Result, name: str, comparison: Comparison) -> Picture | None:
    """Return the model's surface coloured by its distance from the reference, whose outline is black.

    Nodes without a surface, such as markers, are dots in front of the body that they were compared with. None if the
    two differ by rounding only.
    """
    pair = _pair(result, comparison)
    mesh = comparison.model.problem.mesh
    facets = facets_of(mesh)
    if pair is None or not np.isfinite(pair.distance).all():
        return None
    farthest = float(pair.distance.max())
    if farthest <= ROUNDING * pair.largest:
        return None
    if not len(facets):
        return _dots_picture(result, name, comparison, pair) if result.in_detail else None
    colors = error_colors(pair.distance / (farthest or 1.0))[facets]
    surface = solid(pair.mine, facets, colors, edges_of(facets), INK, 0.35)
    black = wires(pair.theirs, facets, outline(pair.theirs, facets, silhouette=True), 1.1, INK)
    reference = display_name(result, name)
    bar = bar_of(farthest, pair.largest)
    title = f"{level_name(result, pair.level).capitalize()}: at most {bar.most} from {reference}"
    legend = (
        Entry(f"outline of {full_name(result, name)}", INK),
        Entry("undeformed", FAINT, linestyle=_DASHES),
        Entry("probe", RED, "o", ""),
    )
    return _pair_picture(result, name, comparison, pair, title, legend, (surface, black), bar)


def _dots_picture(result: Result, name: str, comparison: Comparison, pair: _Pair) -> Picture:
    """Return nodes as dots coloured by their distance, in front of the bodies that have a surface."""
    farthest = float(pair.distance.max())
    bar = bar_of(farthest, pair.largest)
    title = f"{level_name(result, pair.level).capitalize()}: at most {bar.most} from {display_name(result, name)}"
    layers, corners = [], [pair.rest, pair.mine]
    for path in comparison.known_on:
        facets, state = facets_of(path.problem.mesh), path.at(pair.level)
        if len(facets) and state is not None:
            points = seen(path.problem.mesh.nodes + pair.factor * state.displacement)
            corners.append(points)
            layers.append(solid(points, facets, one_color(facets, BODY), edges_of(facets), INK, 0.35))
    if not layers:
        layers.append(wires(pair.mine, facets_of(comparison.model.problem.mesh), path_lines(comparison.model), 0.6))
    legend = (Entry("undeformed", FAINT, linestyle=_DASHES), Entry("probe", RED, "o", ""))
    picture = _pair_picture(result, name, comparison, pair, title, legend, tuple(layers), bar)
    ends = np.concatenate(corners)[:, :2]
    margin = 0.03 * float(np.ptp(ends, axis=0).max())
    lower, upper = ends.min(axis=0) - margin, ends.max(axis=0) + margin

    def marks(area: Area, scale: Scale) -> None:
        picture.marks(area, scale)
        inside = ~comparison.outside
        draw_shaded_dots(area, pair.mine[inside, :2] / scale.size, pair.distance[inside] / farthest)

    return replace(picture, lower=lower, upper=upper, taken=ends, marks=marks)


def _pair_picture(
    result: Result,
    name: str,
    comparison: Comparison,
    pair: _Pair,
    title: str,
    legend: tuple[Entry, ...],
    layers: tuple[Layer, ...],
    bar: Bar | None = None,
) -> Picture:
    mesh = comparison.model.problem.mesh
    facets = facets_of(mesh)
    spots = [_spots(points, facets, mesh.edges) for points in (pair.rest, pair.mine, pair.theirs)]
    tools = drawn_tools(result.problem, pair.level)
    spots[1] = np.concatenate([spots[1], near(tools, spots[1].min(axis=0), spots[1].max(axis=0))])
    legend = (*legend, *entries(result.problem))
    lower, upper, (leaves,) = picture_box(np.concatenate(spots[:2]), spots[2:])
    margin = 0.03 * float((upper - lower).max())
    remarks = [f"displacements {times(pair.factor)}"] if pair.factor != 1 else []
    remarks += [f"{display_name(result, name)} leaves the picture"] if leaves else []
    at_rest = outline(pair.rest, facets, silhouette=True) if len(facets) else mesh.edges

    def marks(area: Area, scale: Scale) -> None:
        draw_lines(
            area, pair.rest[at_rest][:, :, :2] / scale.size, FAINT, 0.8, 1, "rest", linestyle=_DASHES, clip_on=False
        )
        if comparison.n_outside:
            draw_outside(area, pair.mine[comparison.outside, :2] / scale.size)
        draw_dot(area, pair.mine[comparison.probe, :2] / scale.size)

    if comparison.n_outside:
        legend = (*legend, Entry("outside", LOAD, "x", ""))
    return Picture(
        title,
        " · ".join(remarks),
        legend,
        lower - margin,
        upper + margin,
        np.concatenate(spots),
        with_tools(layers, tools),
        marks,
        bar,
    )


# --- layers ---------------------------------------------------------------------------------------


def solid(points: Floats, facets: Ints, colors: Floats, lines: Ints, ink: str, width: float) -> Layer:
    """Return a lit surface with lines on it; colours of shape (n_facets, corners, 3)."""
    on, owners = lines_on(facets, lines)
    facing = normals(points, facets) @ _LIGHT
    lit = colors * (0.8 + 0.2 * facing.clip(0, 1))[:, None, None]
    return Layer(points[facets], lit, points[lines[on]], owners, ink, _thin(width, int(on.sum())))


def wires(points: Floats, facets: Ints, lines: Ints, width: float, ink: str = BLUE) -> Layer:
    """Return lines on a surface, hidden behind nearer parts of it; of a body without a surface, all lines."""
    if not len(facets):
        return Layer(np.zeros((0, 3, 3)), None, points[lines], np.zeros((0, 2), int), ink, _thin(width, len(lines)))
    on, owners = lines_on(facets, lines)
    return Layer(points[facets], None, points[lines[on]], owners, ink, _thin(width, int(on.sum())))


def _thin(width: float, count: int) -> float:
    """Return a line width [points], smaller the more lines there are."""
    return width * min(1.0, max(0.3, float(np.sqrt(1200 / max(count, 1)))))


def one_color(facets: Ints, color: str) -> Floats:
    """Return one colour for all corners of facets, shape (n_facets, corners, 3)."""
    return np.broadcast_to(rgb(color), (*facets.shape, 3))


def _tinted(problem: Problem, facets: Ints, arrows: Sequence[Arrow]) -> Floats:
    """Return the colours of the undeformed body: darker where it is clamped, tinted where arrows act."""
    mesh = problem.mesh
    colors = one_color(facets, BODY).copy()
    clamped = clamped_nodes(problem)[facets].all(axis=1)
    colors[clamped] = one_color(facets[clamped], _HELD)
    for arrow in arrows:
        acted = _within(facets, arrow.nodes, mesh.n_nodes)
        colors[acted] = 0.7 * one_color(facets[acted], BODY) + 0.3 * one_color(facets[acted], arrow.color)
    return colors


def _within(facets: Ints, nodes: Ints, n_nodes: int) -> Bools:
    inside = np.zeros(n_nodes, dtype=bool)
    inside[nodes] = True
    return np.asarray(inside[facets].all(axis=1))


def _spots(points: Floats, facets: Ints, lines: Ints) -> Floats:
    """Return points of the picture plane that a body covers [m], dense enough to find free corners, shape (n, 2)."""
    share = np.linspace(0, 1, 5 if len(facets) < 5000 else 2)
    if not len(facets):
        ends = points[lines, :2]
        return (ends[:, :1] * (1 - share)[:, None] + ends[:, 1:] * share[:, None]).reshape(-1, 2)
    corners = points[facets][:, [0, 1, 2, -1], :2]
    u, v = (grid.ravel() for grid in np.meshgrid(share, share))
    weights = np.stack([(1 - u) * (1 - v), u * (1 - v), u * v, (1 - u) * v], axis=1)
    return np.asarray(np.einsum("sc,fcd->fsd", weights, corners).reshape(-1, 2))
