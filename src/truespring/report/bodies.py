"""Figures of plane bodies: undeformed, and a model over a reference."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from truespring.arrays import Bools, Floats, Ints
from truespring.comparison import Comparison
from truespring.equilibrium import Solution, State
from truespring.mesh import Mesh
from truespring.potential import Visible
from truespring.problem import Problem
from truespring.report.bar import BAR, Bar, bar_of, draw_error_bar
from truespring.report.frame import draw_frame
from truespring.report.legend import ROW, Entry, draw_legend, legend_columns
from truespring.report.lines import draw_lines
from truespring.report.quantity import ROUNDING, Scale, natural_scale, percent, quantity, round_factor, times
from truespring.report.result import Result
from truespring.report.shades import draw_shaded, draw_shaded_dots
from truespring.report.sheet import Area, Sheet
from truespring.report.style import BLUE, FAINT, INK, LOAD, RED, full_name
from truespring.report.symbols import ROLLER, draw_dot, draw_drive, draw_loaded, draw_outside, draw_pin, find_arrows
from truespring.report.touching import draw_tools, drawn_tools, entries, near
from truespring.report.undeformed import Undeformed, spring_lines
from truespring.report.verdict import display_name, level_name
from truespring.report.words import draw_words, text_width


def path_lines(path: Solution) -> Ints:
    """Return the pairs of nodes that are joined by lines in figures of a path, shape (n, 2).

    These are springs, and edges of elements without springs; without springs, the edges of all elements; of points
    without elements, none.
    """
    if path.is_cloud:
        return np.zeros((0, 2), dtype=np.int64)
    if spring_lines(path.potential) is None:
        return path.problem.mesh.edges
    assert isinstance(path.potential, Visible)  # every potential with springs is
    return path.potential.cells["line"]


def magnification(result: Result) -> float:
    """Return the round factor by which displacements are magnified in figures; 1 unless they are too small to see."""
    mesh = result.problem.mesh
    if result.problem.touching:  # tools are not magnified
        return 1.0
    moved = [
        float(np.linalg.norm(state.displacement, axis=1).max())
        for path in result.solutions.values()
        for state in path.states
    ]
    return round_factor(max(moved, default=0.0) / float((mesh.upper - mesh.lower).max()))


def picture_box(points: Floats, others: Sequence[Floats]) -> tuple[Floats, Floats, list[bool]]:
    """Return lower and upper corner [m] of the box shown, and for each of `others` whether it leaves that box.

    The box holds `points` [m], shape (n, dim), and all `others` that do not make it more than three times as wide.
    """
    lower, upper = points.min(axis=0), points.max(axis=0)
    widest = _WIDEST * float((upper - lower).max())
    low, high = lower, upper
    leaves = []
    for other in others:
        wide_low, wide_high = np.minimum(lower, other.min(axis=0)), np.maximum(upper, other.max(axis=0))
        leaves.append(not float((wide_high - wide_low).max()) <= widest)
        if not leaves[-1]:
            low, high = np.minimum(low, wide_low), np.maximum(high, wide_high)
    return low, high, leaves


# Largest width of a picture, in widths of the model's body; a reference beyond that leaves the picture.
_WIDEST = 3.0


def _body_figure(
    title: str, lower: Floats, upper: Floats, legend: Sequence[Entry], remark: str = "", bar: Bar | None = None
) -> tuple[Area, Scale]:
    """Return an area that shows a box [m] at equal scales, on a sheet with title, legend and bar; and its scale."""
    scale = natural_scale(float(np.abs([lower, upper]).max()), "m")
    extent = np.maximum(upper - lower, 1e-3 * float((upper - lower).max()))
    columns, words = legend_columns(legend, 4.7)
    rows = max(map(len, columns), default=0)
    words = max(words, text_width(title, 9, bold=True), text_width(remark, 8))
    words = max(words, text_width(bar.label, 8)) if bar else words
    left, right, bottom, top = 0.72, 0.12, 0.48, 0.44 + ROW * rows + ROW * bool(remark) + BAR * bool(bar)
    width = min(5.4 - left - right, 4.4 * extent[0] / extent[1])
    height = width * extent[1] / extent[0]
    # A narrow body leaves room for the legend: the box grows sideways, the scales stay equal.
    broad = max(width, 3.3, words + 0.05)
    margin = (broad / width - 1) / 2 * extent[0]
    description = f"{title}; {remark}" if remark else title
    sheet = Sheet(left + broad + right, bottom + height + top, description)
    x = ((lower[0] - margin) / scale.size, (upper[0] + margin) / scale.size)
    area = Area(sheet, left, bottom, broad, height, x, (lower[1] / scale.size, upper[1] / scale.size))
    draw_frame(area, f"x [{scale.unit}]", f"y [{scale.unit}]")
    draw_words(sheet, left, sheet.height - 0.17, title, 9, bold=True)
    draw_words(sheet, left, sheet.height - 0.37, remark, color=LOAD)
    below = sheet.height - top + 0.14 + ROW * rows + BAR * bool(bar)
    draw_legend(sheet, columns, left, below)
    if bar:
        draw_error_bar(sheet, bar, left, below - ROW * rows - 0.08)
    return area, scale


def _lines(
    area: Area, points: Floats, lines: Ints, color: str, width: float, zorder: float, name: str, **more: Any
) -> None:
    """Draw lines between points, thinner the more there are."""
    width *= min(1.0, max(0.25, (500 / max(len(lines), 1)) ** 0.5))
    draw_lines(area, points[lines], color, width, zorder, name, **more)


def over_figure(result: Result, name: str, comparison: Comparison) -> Sheet | None:
    """Return the model in blue over a reference in black, at the last load level that both have; None without one."""
    model, reference = (_drawn_on(comparison, side) for side in (0, 1))
    rest = model.problem.mesh.nodes
    factor = magnification(result) if reference.states else 1.0  # a surface alone has no displacement
    inside = None
    if reference.surface is not None and factor == 1:
        level = reference.surface.load_factor
        points, lines = reference.surface.points, reference.surface.outline
        triangles = reference.surface.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        inside = np.unique(np.sort(triangles, axis=1), axis=0)
    else:
        level = float(comparison.load_factors[-1]) if comparison.load_factors.size else 0.0
        theirs = reference.at(level)
        if theirs is None or not level:
            return None
        points, lines = reference.problem.mesh.nodes + factor * theirs.displacement, path_lines(reference)
    mine = model.at(level)
    if mine is None:
        return None
    mesh = model.problem.mesh
    positions = rest + factor * mine.displacement
    tools = drawn_tools(result.problem, level)
    shown = near(tools, np.minimum(rest, positions).min(axis=0), np.maximum(rest, positions).max(axis=0))
    lower, upper, (leaves,) = picture_box(np.concatenate([rest, positions, shown]), [points])
    margin = 0.04 * float((upper - lower).max())
    remarks = [f"displacements {times(factor)}"] if factor != 1 else []
    remarks += [f"{display_name(result, name)} leaves the picture"] if leaves else []
    legend = [
        Entry(full_name(result, result.model or ""), BLUE),
        Entry(full_name(result, name), INK),
        Entry("undeformed", FAINT, linestyle=(0, (3, 2))),
        Entry("probe", RED, "o", ""),
        *entries(result.problem),
    ]
    title = over_title(result, level, comparison)
    area, scale = _body_figure(title, lower - margin, upper + margin, legend, " · ".join(remarks))
    outline = mesh.boundary if mesh.element != "line" else path_lines(model)
    _lines(area, rest / scale.size, outline, FAINT, 0.8, 1, "rest", linestyle=(0, (3, 2)))
    if inside is not None:
        _lines(area, points / scale.size, inside, "#8b9299", 0.4, 2, "triangles")
    _lines(area, points / scale.size, lines, INK, 1.3, 3, "reference")
    _lines(area, positions / scale.size, path_lines(model), BLUE, 0.75, 4, "model")
    draw_tools(area, tools, scale)
    for path, places, color in ((reference, points, INK), (model, positions, BLUE)):
        if path.is_cloud:
            draw_loaded(area, places / scale.size, color)
    watched = comparison.model.at(level)
    if watched is not None:
        draw_dot(area, _magnified(comparison.model, watched, factor)[comparison.probe] / scale.size)
    return area.sheet


def _drawn_on(comparison: Comparison, side: int) -> Solution:
    """Return the model (0) or the reference (1) to draw: on the mesh it was solved on, if that is plane."""
    known = comparison.known_on[side]
    carried = (comparison.model, comparison.reference)[side]
    return known if known.problem.mesh.dim == 2 and not comparison.node_by_node else carried


def _magnified(path: Solution, state: State, factor: float) -> Floats:
    return np.asarray(path.problem.mesh.nodes + factor * state.displacement)


def distance_figure(result: Result, name: str, comparison: Comparison) -> Sheet | None:
    """Return the model coloured by its distance from a reference, whose outline is black; crosses mark nodes outside.

    The colour of an element is the mean over its corners; without elements, nodes are dots. None if the two differ by
    rounding only.
    """
    level = float(comparison.load_factors[-1]) if comparison.load_factors.size else 0.0
    mine, theirs = comparison.model.at(level), comparison.reference.at(level)
    if mine is None or theirs is None or not level:
        return None
    inside = ~comparison.outside
    apart = np.where(inside, np.linalg.norm(mine.displacement - theirs.displacement, axis=1), 0.0)
    farthest = float(apart.max())
    size = float(np.linalg.norm(theirs.displacement[inside], axis=1).max())
    if not np.isfinite(farthest) or farthest <= ROUNDING * size:
        return None
    factor = magnification(result)
    framed = name if not comparison.known_on[1].is_cloud else result.model or ""  # markers have no outline
    reference = _drawn_on(comparison, 1 if framed == name else 0)
    own = reference.at(level)
    positions = _magnified(comparison.model, mine, factor)
    others = positions if own is None else _magnified(reference, own, factor)
    bar = bar_of(farthest, size)
    lower, upper, (leaves,) = picture_box(positions, [others])
    margin = 0.04 * float((upper - lower).max())
    remarks = [f"displacements {times(factor)}"] if factor != 1 else []
    remarks += [f"{display_name(result, name)} leaves the picture"] if leaves else []
    legend = [Entry(f"outline of {full_name(result, framed)}", INK), Entry("probe", RED, "o", "")]
    legend += [Entry("outside", LOAD, "x", "")] if comparison.n_outside else []
    title = f"{level_name(result, level).capitalize()}: at most {bar.most} from {display_name(result, name)}"
    area, scale = _body_figure(title, lower - margin, upper + margin, legend, " · ".join(remarks), bar)
    mesh = comparison.model.problem.mesh
    if mesh.element == "line":
        draw_shaded_dots(area, positions / scale.size, apart / farthest)
    else:
        draw_shaded(area, positions[mesh.elements] / scale.size, mesh.means(apart) / farthest)
    outline = reference.problem.mesh.boundary if reference.problem.mesh.element != "line" else path_lines(reference)
    _lines(area, others / scale.size, outline, INK, 1.0, 4, "reference")
    if comparison.n_outside:
        draw_outside(area, positions[comparison.outside] / scale.size)
    draw_dot(area, positions[comparison.probe] / scale.size)
    return area.sheet


def over_title(result: Result, level: float, comparison: Comparison, number: int = -1) -> str:
    """Return a title: the load level, and the distance between the two paths of a comparison.

    `number` is that of the level among the levels of the comparison.
    """
    at = level_name(result, level).capitalize()
    if comparison.load_factors.size and np.isfinite(comparison.rms_errors[number]):
        return f"{at}: {percent(float(comparison.rms_errors[number]))} apart (root mean square)"
    if comparison.surface is not None:
        return f"{at}: outlines {quantity(comparison.surface.outline_rms, 'm', 2)} apart (root mean square)"
    return at


def undeformed_figure(body: Undeformed) -> Sheet:
    """Return the undeformed body: mesh, springs, supports, loads and the probe."""
    problem, springs = body.problem, body.springs
    mesh = problem.mesh
    size = float((mesh.upper - mesh.lower).max())
    arrows, tools = find_arrows(problem, size), drawn_tools(problem, None)
    ends = np.array([end for arrow in arrows for end in (*arrow.ends, arrow.room)] + [mesh.lower, mesh.upper])
    ends = np.concatenate([ends, near(tools, mesh.lower, mesh.upper)])
    lower, upper = ends.min(axis=0) - 0.06 * size, ends.max(axis=0) + 0.06 * size
    legend = (*body.legend, *entries(problem))
    area, scale = _body_figure(body.title, lower, upper, legend)
    if body.has_elements:
        _lines(area, mesh.nodes / scale.size, mesh.edges, INK, 1.3, 2, "elements")
    if springs is not None:
        _lines(area, mesh.nodes / scale.size, springs, BLUE, 0.6, 3, "springs")
    _supports(area, problem, scale, 0.028 * size)
    draw_tools(area, tools, scale)
    for arrow in arrows:
        draw_loaded(area, mesh.nodes[arrow.nodes] / scale.size, arrow.color)
        draw_drive(area, arrow, scale)
    if body.probe is not None:
        draw_dot(area, mesh.nodes[body.probe] / scale.size)
    return area.sheet


def _supports(area: Area, problem: Problem, scale: Scale, size: float) -> None:
    """Draw supports: hatching at clamped edges, rollers at edges held in one direction, pins at single nodes."""
    mesh, loading = problem.mesh, problem.loading.full
    still = loading.held & (loading.motion() == 0)
    clamped = loading.held.all(axis=1) & still.all(axis=1)
    hatched = np.zeros(mesh.n_nodes, dtype=bool)
    if mesh.boundary.shape[1] == 2:
        edges = mesh.boundary[clamped[mesh.boundary].all(axis=1)]
        hatched[edges] = True
        _hatch(area, mesh.nodes[edges] / scale.size, size / scale.size)
    single = still & ~hatched[:, None]
    for run in _rolling_runs(mesh, still):
        single[run.nodes, run.axis] = False
        for node in run.thinned(mesh.nodes, 1.5 * ROLLER * area.inch * scale.size):
            if not hatched[node]:
                draw_pin(area, mesh.nodes[node] / scale.size, run.away, run.beside)
    centre = (mesh.lower + mesh.upper) / 2
    for node in np.flatnonzero(single.any(axis=1)):
        at = mesh.nodes[node]
        if single[node].all():
            draw_pin(area, at / scale.size, np.array([0.0, -1.0]), roller=False)
            continue
        for axis in np.flatnonzero(single[node]):
            draw_pin(area, at / scale.size, np.eye(2)[axis] * (1.0 if at[axis] > centre[axis] else -1.0))


@dataclass(frozen=True, slots=True)
class _Run:
    """Consecutive nodes on boundary edges that face one direction and are held along `axis`.

    Attributes:
        nodes: node numbers along the edges, shape (n,).
        axis: the held direction.
        away: unit vector from a node to its roller.
        beside: outward unit vector if rollers stand along the edge, else zero.
    """

    nodes: Ints
    axis: int
    away: Floats
    beside: Floats

    def thinned(self, nodes: Floats, spacing: float) -> Ints:
        """Return every n-th node such that neighbours are at least about `spacing` [m] apart."""
        length = float(np.linalg.norm(np.diff(nodes[self.nodes], axis=0), axis=1).sum())
        n_gaps = len(self.nodes) - 1
        every = max(1, -int(-spacing * n_gaps // length)) if n_gaps else 1
        return self.nodes[n_gaps % every // 2 :: every]


def _rolling_runs(mesh: Mesh, still: Bools) -> Iterator[_Run]:
    """Yield runs of boundary edges whose two nodes are held in one direction, but not both clamped."""
    if mesh.boundary.shape[1] != 2:
        return
    along = np.diff(mesh.nodes[mesh.boundary], axis=1)[:, 0]
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
    clamped = still[mesh.boundary].all(axis=(1, 2))
    for axis in (0, 1):
        held = still[mesh.boundary, axis].all(axis=1) & ~clamped
        facing = np.abs(outward[:, axis]) > 0.5
        unit, other = np.eye(2)[axis], np.eye(2)[1 - axis]
        for sign in (-1.0, 1.0):
            for chosen, order, away, beside in (
                (facing & (sign * outward[:, axis] > 0), 1 - axis, sign * unit, 0 * other),
                (~facing & (sign * outward[:, 1 - axis] > 0), axis, -unit, sign * other),
            ):
                nodes = np.unique(mesh.boundary[held & chosen])
                if nodes.size:
                    nodes = nodes[np.argsort(mesh.nodes[nodes, order], kind="stable")]
                    yield _Run(nodes, axis, away, beside)


def _hatch(area: Area, edges: Floats, size: float) -> None:
    """Draw short strokes outside clamped edges, shape (n, 2, dim), which run anticlockwise round the body."""
    if not len(edges):
        return
    along = edges[:, 1] - edges[:, 0]
    length = np.linalg.norm(along, axis=1)
    unit = along / length[:, None]
    outward = np.stack([unit[:, 1], -unit[:, 0]], axis=1)
    starts, ends = [], []
    for edge, direction, normal, extent in zip(edges, unit, outward, length, strict=True):
        count = max(1, round(float(extent) / (0.6 * size)))
        foot = edge[0] + direction * (np.arange(count)[:, None] + 0.5) / count * extent
        starts.append(foot)
        ends.append(foot + size * (normal - 0.7 * direction))
    strokes = np.stack([np.concatenate(starts), np.concatenate(ends)], axis=1)
    pairs = np.arange(2 * len(strokes)).reshape(-1, 2)
    _lines(area, strokes.reshape(-1, 2), pairs, "#3d4248", 0.9, 1, "support", clip_on=False)
    sides = np.arange(2 * len(edges)).reshape(-1, 2)
    _lines(area, edges.reshape(-1, 2), sides, "#3d4248", 2.2, 5, "clamped")
