"""Pictures of bodies: as asked for, and a model over a reference."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.compare import Comparison
from truespring.equilibrium import Path
from truespring.mesh.selections import select
from truespring.models import SpringNetwork
from truespring.report.quantity import Scale, given, natural_scale, percent, quantity
from truespring.report.result import Result
from truespring.report.style import BLUE, FAINT, INK, LOAD, MOTION, POINT, RED, full_name
from truespring.report.verdict import level_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def path_lines(path: Path) -> Ints:
    """Return the pairs of nodes that a path is drawn by: its springs, else the edges of its elements, shape (n, 2)."""
    if isinstance(path.potential, SpringNetwork):
        return path.potential.springs
    return path.problem.mesh.edges


@dataclass(frozen=True, slots=True)
class _Entry:
    """A line of a legend: what it stands for, its colour and its mark."""

    text: str
    color: str
    marker: str = ""
    linestyle: Any = "-"


def _body_figure(title: str, lower: Floats, upper: Floats, legend: Sequence[_Entry]) -> "tuple[Figure, Axes, Scale]":
    """A figure whose one pair of axes shows the box from `lower` to `upper` [m] at equal scales, legend on top."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    scale = natural_scale(float(np.abs([lower, upper]).max()), "m")
    extent = np.maximum(upper - lower, 1e-3 * float((upper - lower).max()))
    rows = 1 if sum(len(one.text) * 4.7 + 32 for one in legend) * POINT < 4.7 else 2
    left, right, bottom, top = 0.62, 0.12, 0.48, 0.44 + 0.18 * rows
    width = min(5.4 - left - right, 4.4 * extent[0] / extent[1])
    height = width * extent[1] / extent[0]
    # A narrow body leaves room for the legend: the box grows sideways, the scales stay equal.
    broad = max(width, 3.3)
    margin = (broad / width - 1) / 2 * extent[0]
    figure = Figure(figsize=(left + broad + right, bottom + height + top), label=title)
    total = figure.get_size_inches()
    axes = figure.add_axes((left / total[0], bottom / total[1], broad / total[0], height / total[1]))
    axes.set_xlim((lower[0] - margin) / scale.size, (upper[0] + margin) / scale.size)
    axes.set_ylim(lower[1] / scale.size, upper[1] / scale.size)
    axes.set_aspect("equal", adjustable="box")
    axes.locator_params(nbins=7)
    axes.set_xlabel(f"x [{scale.unit}]")
    axes.set_ylabel(f"y [{scale.unit}]")
    handles = [
        Line2D([], [], color=one.color, marker=one.marker, linestyle=one.linestyle, markersize=5, lw=1.4)
        for one in legend
    ]
    figure.text(left / total[0], 1 - 0.17 / total[1], title, weight="bold", size=9, va="center")
    figure.legend(
        handles,
        [one.text for one in legend],
        loc="upper left",
        bbox_to_anchor=(left / total[0], 1 - 0.32 / total[1]),
        ncols=-(-len(legend) // rows),
        borderpad=0,
        borderaxespad=0,
        columnspacing=1.2,
        handletextpad=0.5,
        fontsize=8,
    )
    return figure, axes, scale


def _lines(axes: "Axes", points: Floats, lines: Ints, color: str, width: float, name: str, **more: Any) -> None:
    """Draw many segments as one path: fast, and one element of an SVG however fine the mesh."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Outline

    width *= min(1.0, max(0.25, (500 / max(len(lines), 1)) ** 0.5))  # fine meshes in fine lines
    codes = np.tile(np.array([Outline.MOVETO, Outline.LINETO], dtype=np.uint8), len(lines))
    outline = Outline(points[lines].reshape(-1, 2), codes)
    # Not add_patch, which measures every segment to find limits that are already set.
    axes.add_artist(PathPatch(outline, fill=False, edgecolor=color, lw=width, gid=name, **more))


def _dot(axes: "Axes", point: Floats) -> None:
    axes.plot(*point, "o", color=RED, ms=5.5, mec="white", mew=0.6, zorder=10, gid="probe", clip_on=False)


def over_figure(result: Result, name: str, comparison: Comparison) -> "Figure | None":
    """The model in blue over a reference in black, at the last load level that both have."""
    model, reference = comparison.model, comparison.reference
    inside = None
    if reference.surface is not None:
        level = reference.surface.load_factor
        points, lines = reference.surface.points, reference.surface.outline
        triangles = reference.surface.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
        inside = np.unique(np.sort(triangles, axis=1), axis=0)
    else:
        level = float(comparison.load_factors[-1]) if comparison.load_factors.size else 0.0
        theirs = reference.at(level)
        if theirs is None or not level:
            return None
        points, lines = theirs.positions, path_lines(reference)
    mine = model.at(level)
    if mine is None:
        return None
    mesh = model.problem.mesh
    rest = mesh.nodes
    everything = np.concatenate([rest, points, mine.positions])
    lower, upper = _box(everything)
    legend = [
        _Entry(full_name(result, result.model or ""), BLUE),
        _Entry(full_name(result, name), INK),
        _Entry("at rest", FAINT, linestyle=(0, (3, 2))),
        _Entry("probe", RED, "o", ""),
    ]
    figure, axes, scale = _body_figure(_over_title(result, level, comparison), lower, upper, legend)
    outline = mesh.boundary if mesh.element != "line" else path_lines(model)
    _lines(axes, rest / scale.size, outline, FAINT, 0.8, "rest", linestyle=(0, (3, 2)), zorder=1)
    if inside is not None:
        _lines(axes, points / scale.size, inside, "#8b9299", 0.4, "triangles", zorder=2)
    _lines(axes, points / scale.size, lines, INK, 1.3, "reference", zorder=3)
    _lines(axes, mine.positions / scale.size, path_lines(model), BLUE, 0.75, "model", zorder=4)
    _dot(axes, mine.positions[comparison.probe] / scale.size)
    return figure


def _over_title(result: Result, level: float, comparison: Comparison) -> str:
    at = level_name(result, level).capitalize()
    if comparison.load_factors.size:
        return f"{at}: {percent(float(comparison.rms_errors[-1]))} apart (root mean square)"
    if comparison.surface is not None:
        return f"{at}: outlines {quantity(comparison.surface.outline_rms, 'm', 2)} apart (root mean square)"
    return at


def _box(points: Floats) -> tuple[Floats, Floats]:
    lower, upper = points.min(axis=0), points.max(axis=0)
    margin = 0.04 * float((upper - lower).max())
    return lower - margin, upper + margin


def undeformed_figure(result: Result) -> "Figure":
    """The body as it is asked for: mesh, springs, supports, loads and the probe."""
    mesh = result.problem.mesh
    model = result.paths.get(result.model or "") or next(iter(result.paths.values()))
    size = float((mesh.upper - mesh.lower).max())
    arrows = _arrows(result, size)
    ends = np.array([end for arrow in arrows for end in (*arrow.ends, arrow.room)] + [mesh.lower, mesh.upper])
    lower, upper = ends.min(axis=0) - 0.06 * size, ends.max(axis=0) + 0.06 * size
    springs = isinstance(model.potential, SpringNetwork)
    legend = [_Entry("elements", INK)] if mesh.element != "line" else []
    legend += [_Entry("springs", BLUE)] if springs else []
    legend += [_Entry("probe", RED, "o", "")]
    title = f"As asked: {mesh.n_nodes} nodes, {len(mesh.elements)} elements"
    title += f", {len(path_lines(model))} springs" if springs else ""
    figure, axes, scale = _body_figure(title, lower, upper, legend)
    if mesh.element != "line":
        _lines(axes, mesh.nodes / scale.size, mesh.edges, INK, 1.3, "elements", zorder=2)
    if springs:
        _lines(axes, mesh.nodes / scale.size, path_lines(model), BLUE, 0.6, "springs", zorder=3)
    _supports(axes, result, scale, 0.028 * size)
    for arrow in arrows:
        _arrow(axes, arrow, scale)
    _dot(axes, mesh.nodes[result.probe] / scale.size)
    return figure


@dataclass(frozen=True, slots=True)
class _Arrow:
    """A load or a prescribed motion: from tail to head [m], the nodes it acts on, what is written beside it.

    `side` is 1 where the text stands to the right, -1 where to the left; it ends before `room`.
    """

    ends: tuple[Floats, Floats]
    side: int
    room: Floats
    nodes: Floats
    text: str
    color: str


def _arrows(result: Result, size: float) -> list[_Arrow]:
    mesh = result.problem.mesh
    acting = [(load.on, np.array(load.total, dtype=float), "N", LOAD) for load in result.problem.loads]
    acting += [
        (support.on, np.array(support.displacement, dtype=float), "m", MOTION)
        for support in result.problem.supports
        if support.displacement is not None
    ]
    found = []
    for on, vector, unit, color in acting:
        if not vector.any():
            continue
        nodes = mesh.nodes[select(mesh, on)]
        direction = vector / np.linalg.norm(vector)
        centre = nodes.mean(axis=0)
        outward = centre - (mesh.lower + mesh.upper) / 2
        along = float(direction @ outward)
        length = 0.13 * size * direction
        gap = 0.025 * size
        if abs(along) > 0.5 * float(np.linalg.norm(outward)) > 0:  # it pulls or presses: off the body's face
            tail = centre + gap * direction if along > 0 else centre - gap * direction - length
        else:  # it shears: beside the face
            beside = outward / max(float(np.linalg.norm(outward)), 1e-300)
            tail = centre + 2 * gap * beside - length / 2
        symbol = "F" if unit == "N" else "u"
        text = f"{symbol} = {given(float(np.linalg.norm(vector)), unit)}"
        side = 1 if centre[0] + 1e-9 * size >= (mesh.lower + mesh.upper)[0] / 2 else -1
        near = tail if (side > 0) == (length[0] >= 0) else tail + length
        room = near + np.array([side * 0.24 * size, 0.0])
        found.append(_Arrow((tail, tail + length), side, room, nodes, text, color))
    return found


def _arrow(axes: "Axes", arrow: _Arrow, scale: Scale) -> None:
    (x, y), (to_x, to_y) = (end / scale.size for end in arrow.ends)
    axes.plot(*(arrow.nodes / scale.size).T, "o", color=arrow.color, ms=3, zorder=8, ls="", gid="loaded")
    style = {"arrowstyle": "-|>,head_width=0.28,head_length=0.5", "color": arrow.color, "lw": 1.8}
    axes.annotate("", (to_x, to_y), (x, y), arrowprops={**style, "shrinkA": 0, "shrinkB": 0}, zorder=9)
    upright = abs(to_y - y) > abs(to_x - x)
    axes.annotate(
        arrow.text,
        (min(x, to_x) if arrow.side > 0 else max(x, to_x), (y + to_y) / 2),
        xytext=(7 * arrow.side if upright else 0, 0 if upright else 7),
        textcoords="offset points",
        ha="left" if arrow.side > 0 else "right",
        va="center" if upright else "bottom",
        color=arrow.color,
        zorder=11,
        bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.8},
    )


def _supports(axes: "Axes", result: Result, scale: Scale, size: float) -> None:
    """Clamped edges hatched, single held nodes on a pin, directions held alone on a roller; the usual symbols."""
    mesh, loading = result.problem.mesh, result.problem.loading
    still = loading.held & (loading.displacement == 0)
    clamped = loading.held.all(axis=1) & still.all(axis=1)
    hatched = np.zeros(mesh.n_nodes, dtype=bool)
    if mesh.boundary.shape[1] == 2:
        edges = mesh.boundary[clamped[mesh.boundary].all(axis=1)]
        hatched[edges] = True
        _hatch(axes, mesh.nodes[edges] / scale.size, size / scale.size)
    centre = (mesh.lower + mesh.upper) / 2
    for node in np.flatnonzero(still.any(axis=1) & ~hatched):
        at = mesh.nodes[node]
        if clamped[node]:
            _pin(axes, at / scale.size, np.array([0.0, -1.0]), roller=False)
            continue
        for axis in np.flatnonzero(still[node]):
            away = np.eye(2)[axis] * (1.0 if at[axis] > centre[axis] else -1.0)
            _pin(axes, at / scale.size, away, roller=True)


def _hatch(axes: "Axes", edges: Floats, size: float) -> None:
    """Short strokes outside clamped edges; edges of shape (n, 2, dim) run anticlockwise round the body."""
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
    _lines(axes, strokes.reshape(-1, 2), pairs, "#3d4248", 0.9, "support", zorder=1, clip_on=False)
    sides = np.arange(2 * len(edges)).reshape(-1, 2)
    _lines(axes, edges.reshape(-1, 2), sides, "#3d4248", 2.2, "clamped", zorder=5)


def _pin(axes: "Axes", point: Floats, away: Floats, roller: bool) -> None:
    """A triangle whose tip touches the node; under a roller a line, set off. Sized in points, as text is."""
    from matplotlib.path import Path as Outline

    across = np.array([-away[1], away[0]])
    corners = [np.zeros(2), away + 0.55 * across, away - 0.55 * across, np.zeros(2)]
    codes = [Outline.MOVETO, Outline.LINETO, Outline.LINETO, Outline.CLOSEPOLY]
    if roller:
        corners += [1.35 * away + 0.7 * across, 1.35 * away - 0.7 * across]
        codes += [Outline.MOVETO, Outline.LINETO]
    symbol = Outline(np.array(corners), codes)
    size = 11 * float(np.abs(corners).max())  # markers are scaled to one extent, the triangle is to stay the same
    axes.plot(*point, marker=symbol, ms=size, color="white", mec="#3d4248", mew=0.9, zorder=6, ls="", gid="support")
