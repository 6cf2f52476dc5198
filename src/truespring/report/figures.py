"""The figures of a study: springs over FEM, curves, errors and moduli, as PNG and SVG.

Matplotlib is imported where it is needed, and only through its objects: no window, no global state.
"""

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.compare import Comparison
from truespring.equilibrium import Path
from truespring.mesh import Mesh
from truespring.mesh.selections import AXES, select
from truespring.models import SpringNetwork
from truespring.report.quantity import Scale, given, natural_scale, percent, quantity, tolerance_percent
from truespring.report.result import Result
from truespring.report.verdict import display_name, drive, level_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Colours that stay apart for colour-blind eyes and on grey paper (blue, vermillion, green: Okabe and Ito).
INK, BLUE, RED, LOAD, MOTION, FAINT = "#16191d", "#0072b2", "#d3222a", "#b84a00", "#00795a", "#a9b0b7"

_SPRING_STYLES = ((BLUE, "-", "o"), ("#3a9bdc", "--", "s"), ("#00476f", "-.", "^"), ("#5c7fb8", ":", "D"))
_REFERENCE_STYLES = (
    ("#000000", (0, ()), "s"),
    ("#3d4248", (0, (6, 2)), "^"),
    ("#5b6168", (0, (3, 1.5, 1, 1.5)), "D"),
    ("#70777e", (0, (1.2, 1.6)), "v"),
    ("#3d4248", (0, (8, 2, 1, 2, 1, 2)), "P"),
    ("#5b6168", (0, (2, 2)), "X"),
)

_RC: Any = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.5,
    "text.color": INK,
    "axes.edgecolor": "#5b6168",
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#e3e6e9",
    "grid.linewidth": 0.6,
    "xtick.color": "#5b6168",
    "ytick.color": "#5b6168",
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.direction": "out",
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "svg.fonttype": "path",
    "svg.hashsalt": "truespring",
    "savefig.facecolor": "white",
}
_DPI = 150

# A Result does not change, and its files and its pages show the same pictures: they are drawn once.
_DRAWN: "WeakKeyDictionary[Result, dict[str, Drawing]]" = WeakKeyDictionary()
_POINT = 1 / 72  # inch


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure as the bytes of its two files, its title for those who cannot see it, and its width [inch]."""

    png: bytes
    svg: bytes
    title: str
    width: float


def draw_figures(result: Result) -> "dict[str, Figure]":
    """Return the figures of a study by the stem of their file names."""
    with _style():
        return _draw(result)


def render_figures(result: Result) -> dict[str, Drawing]:
    """Return the figures of a study as PNG and SVG, by the stem of their file names."""
    if result not in _DRAWN:
        with _style():
            _DRAWN[result] = {name: _render(figure) for name, figure in _draw(result).items()}
    return _DRAWN[result]


def save_figures(result: Result, folder: FilePath) -> dict[str, Drawing]:
    """Write every figure as PNG and SVG into `folder`, made where it is not there; return what was written."""
    drawings = render_figures(result)
    folder.mkdir(parents=True, exist_ok=True)
    for name, drawing in drawings.items():
        (folder / f"{name}.png").write_bytes(drawing.png)
        (folder / f"{name}.svg").write_bytes(drawing.svg)
    return drawings


def over_name(result: Result, reference: str) -> str:
    """Return the stem of the figure of the model over a reference: path-safe, whatever the models are called."""
    return re.sub(r"[^\w.-]+", "-", f"{result.model}_over_{reference}")


def path_lines(path: Path) -> Ints:
    """Return the pairs of nodes that a path is drawn by: its springs, else the edges of its elements, shape (n, 2)."""
    if isinstance(path.potential, SpringNetwork):
        return path.potential.springs
    return mesh_edges(path.problem.mesh)


def mesh_edges(mesh: Mesh) -> Ints:
    """Return every edge of the elements once, shape (n_edges, 2)."""
    return np.unique(np.sort(mesh.elements[:, np.array(mesh.kind.edges)].reshape(-1, 2), axis=1), axis=0)


@contextmanager
def _style() -> Iterator[None]:
    import matplotlib

    with matplotlib.rc_context(_RC):
        yield


def _render(figure: "Figure") -> Drawing:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)
    png, svg = io.BytesIO(), io.BytesIO()
    figure.savefig(png, format="png", dpi=_DPI, pil_kwargs={"compress_level": 4})
    figure.savefig(svg, format="svg", metadata={"Date": None})
    return Drawing(png.getvalue(), _shorter(svg.getvalue()), str(figure.get_label()), float(figure.get_figwidth()))


def _shorter(svg: bytes) -> bytes:
    """The same picture in fewer bytes: coordinates to a hundredth of a point, no comments, no indents."""
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", svg.decode(), flags=re.DOTALL)
    text = re.sub(r"(?<=\d\d\.\d\d)\d+", "", text)  # not below 10: scales of glyphs need their digits
    return re.sub(r"\n\s*", "\n", text).encode()


def _draw(result: Result) -> "dict[str, Figure]":
    figures = {"undeformed": _undeformed(result)}
    for name, comparison in result.comparisons.items():
        drawn = _over(result, name, comparison)
        if drawn is not None:
            figures[over_name(result, name)] = drawn
    if any(len(path.states) > 1 for path in result.paths.values()):
        figures["curves"] = _curves(result)
    if any(one.load_factors.size for one in result.comparisons.values()):
        figures["error"] = _errors(result)
    if any(path.moduli is not None for path in result.paths.values()):
        figures["moduli"] = _moduli(result)
    return figures


# --- bodies ---------------------------------------------------------------------------------------


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
    rows = 1 if sum(len(one.text) * 4.7 + 32 for one in legend) * _POINT < 4.7 else 2
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


def _over(result: Result, name: str, comparison: Comparison) -> "Figure | None":
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
        _Entry(_name(result, result.model or ""), BLUE),
        _Entry(_name(result, name), INK),
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


def _name(result: Result, name: str) -> str:
    """The label of a path, and its name in the study where the label does not hold it."""
    return " · ".join(_label_and_name(result, name))


def _label_and_name(result: Result, name: str) -> tuple[str, ...]:
    label = result.paths[name].label
    return (label,) if name.casefold() in label.casefold() else (label, name)


def _undeformed(result: Result) -> "Figure":
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
        _lines(axes, mesh.nodes / scale.size, mesh_edges(mesh), INK, 1.3, "elements", zorder=2)
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


# --- curves ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Curve:
    x: Floats
    y: Floats
    color: str
    dashes: Any
    marker: str
    label: str
    strong: bool


def path_styles(result: Result) -> dict[str, tuple[str, Any, str]]:
    """Return colour, dashes and marker of each path: springs and what is compared in blues, others in black, greys."""
    springs = [name for name in result.paths if _strong(result, name)]
    others = [name for name in result.paths if name not in springs]
    return {
        **{name: _SPRING_STYLES[place % len(_SPRING_STYLES)] for place, name in enumerate(springs)},
        **{name: _REFERENCE_STYLES[place % len(_REFERENCE_STYLES)] for place, name in enumerate(others)},
    }


def _strong(result: Result, name: str) -> bool:
    return name == result.model or result.paths[name].kind == "springs"


def _curves(result: Result) -> "Figure":
    """Displacement of the probe against the force, both along the direction that drives the body."""
    to = drive(result)
    styles = path_styles(result)
    forces, moves = {}, {}
    for name, path in result.paths.items():
        if path.states:
            forces[name] = to.sign * np.array([path.applied_force(state)[to.axis] for state in path.states])
            moves[name] = to.sign * np.array([state.displacement[result.probe, to.axis] for state in path.states])
    x_scale = natural_scale(max(float(np.abs(values).max()) for values in forces.values()), "N")
    y_scale = natural_scale(max(float(np.abs(values).max()) for values in moves.values()), "m")
    curves = [
        _Curve(
            forces[name] / x_scale.size,
            moves[name] / y_scale.size,
            *styles[name],
            label=_two_lines(result, name),
            strong=_strong(result, name),
        )
        for name in forces
    ]
    direction = f"{'−' if to.sign < 0 else ''}{AXES[to.axis]}"
    figure, axes = _plot("Displacement of the probe against force", curves)
    axes.set_xlabel(f"total force along {direction} [{x_scale.unit}]")
    axes.set_ylabel(f"displacement along {direction} [{y_scale.unit}]")
    return figure


def _errors(result: Result) -> "Figure":
    """Rms error against every reference, level by level, beside the tolerance."""
    styles = path_styles(result)
    curves = [
        _Curve(
            one.load_factors,
            100 * np.asarray(one.rms_errors),
            *styles[name],
            label=_two_lines(result, name),
            strong=False,
        )
        for name, one in result.comparisons.items()
        if one.load_factors.size
    ]
    tolerance = 100 * result.tolerance
    within = f"within {tolerance_percent(result.tolerance)}"
    curves.append(_Curve(np.array([0, 1.02]), np.full(2, tolerance), BLUE, (0, (4, 2)), "", within, strong=False))
    who = result.paths[result.model].label if result.model else "the model"
    figure, axes = _plot(f"Error of {who} against each reference", curves)
    axes.axhspan(0, tolerance, color=BLUE, alpha=0.09, lw=0, zorder=0.5)
    axes.set_xlim(0, 1.02)
    axes.set_ylim(bottom=0)
    axes.set_xlabel("load factor")
    axes.set_ylabel("rms error [%]")
    return figure


def _two_lines(result: Result, name: str) -> str:
    return "\n".join(_label_and_name(result, name))


def _plot(title: str, curves: Sequence[_Curve]) -> "tuple[Figure, Axes]":
    """Curves with their names at their ends, moved apart where they would meet."""
    from matplotlib.figure import Figure

    left, right, bottom, top = 0.62, 1.95, 0.5, 0.38
    height = max(3.0, 0.34 * len(curves))
    figure = Figure(figsize=(5.9, bottom + height + top), label=title)
    total = figure.get_size_inches()
    box = (left / total[0], bottom / total[1], 1 - (left + right) / total[0], height / total[1])
    axes = figure.add_axes(box)
    figure.text(box[0], 1 - 0.19 / total[1], title, weight="bold", size=9, va="center")
    for curve in curves:
        axes.plot(
            curve.x,
            curve.y,
            color=curve.color,
            ls=curve.dashes,
            lw=2.2 if curve.strong else 1.3 if curve.marker else 1,
            marker=curve.marker,
            ms=4.2 if curve.strong else 3.6,
            mfc=curve.color if curve.strong else "white",
            mew=0.9,
            zorder=4 if curve.strong else 3,
            label=curve.label.replace("\n", ", "),
        )
    _name_ends(axes, curves, height)
    return figure, axes


def _name_ends(axes: "Axes", curves: Sequence[_Curve], height: float) -> None:
    """Write each curve's name right of the axes, level with its end or as near as the others allow."""
    axes.set_ylim(auto=True)
    axes.autoscale_view()
    bottom, top = axes.get_ylim()
    bottom = min(bottom, 0.0) if bottom > 0 else bottom
    axes.set_ylim(bottom, top)
    ends = np.array([(curve.y[-1] - bottom) / (top - bottom) for curve in curves])
    gap = (27 if any("\n" in curve.label for curve in curves) else 17) * _POINT / height
    for curve, place in zip(curves, _apart(ends, gap, np.array([curve.x[-1] for curve in curves])), strict=True):
        first, _, second = curve.label.partition("\n")
        at = (1.0, float(place))
        axes.annotate(
            "",
            (curve.x[-1], curve.y[-1]),
            xytext=(1.035, float(place)),
            textcoords="axes fraction",
            arrowprops={"arrowstyle": "-", "color": FAINT, "lw": 0.7, "shrinkA": 0, "shrinkB": 4},
            annotation_clip=False,
        )
        weight = "bold" if curve.strong else "normal"
        for text, offset, color, size in ((first, 0.5 if second else 0, curve.color, 8), (second, -0.5, "#5b6168", 7)):
            axes.annotate(
                text,
                at,
                xycoords="axes fraction",
                xytext=(10, 10 * offset),
                textcoords="offset points",
                color=color,
                size=size,
                weight=weight if text == first else "normal",
                va="center",
                annotation_clip=False,
            )


def _apart(places: Floats, gap: float, ties: Floats) -> Floats:
    """Move places along a line so that none is nearer than `gap` to the next, each as little as may be.

    Of equal places the one with the smaller of `ties` comes first.

    Neighbours that meet are joined to a block about their mean, until no block meets another;
    the whole is then kept within 0 and 1 as far as it fits.
    """
    order = np.lexsort((ties, places.round(3)))
    blocks: list[list[float]] = []  # [sum of wanted starts, count]
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


# --- moduli ---------------------------------------------------------------------------------------


def _moduli(result: Result) -> "Figure":
    """Young's modulus in a test along every direction: the springs against the material's circle."""
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    known = {name: path.moduli for name, path in result.paths.items() if path.moduli is not None}
    wanted = next(iter(known.values())).young_wanted
    angles = np.arange(0, 361, 3.0)
    young = {name: np.array([one.young(angle) for angle in angles]) for name, one in known.items()}
    largest = max(wanted, *(float(values.max()) for values in young.values()))
    scale = natural_scale(largest, "Pa")
    title = "Young's modulus by direction"
    figure = Figure(figsize=(3.9, 4.25 + 0.18 * len(known)), label=title)
    total = figure.get_size_inches()
    foot = (0.65 + 0.18 * len(known)) / total[1]
    axes = figure.add_axes((0.12, foot, 0.76, 0.76 * total[0] / total[1]), projection="polar")
    axes.plot(np.radians(angles), np.full(angles.shape, wanted / scale.size), color=INK, lw=1.3, ls=(0, (5, 2)))
    handles, labels = [Line2D([], [], color=INK, lw=1.3, ls=(0, (5, 2)))], [f"material: {given(wanted, 'Pa')}"]
    styles = path_styles(result)
    for name, values in young.items():
        color, dashes, _ = styles[name]
        axes.plot(np.radians(angles), values / scale.size, color=color, lw=2, ls=dashes)
        handles.append(Line2D([], [], color=color, lw=2, ls=dashes))
        extremes = dict.fromkeys(quantity(float(value), "Pa") for value in (values.min(), values.max()))
        labels.append(f"{display_name(result, name)}: {' to '.join(extremes)}")
    axes.set_ylim(0, 1.12 * largest / scale.size)
    axes.set_yticks(_ticks(largest / scale.size))
    axes.set_rlabel_position(22.5)  # type: ignore[attr-defined]
    axes.set_thetagrids(np.arange(0, 360, 45))  # type: ignore[attr-defined]
    axes.tick_params(pad=2)
    axes.spines["polar"].set_visible(False)
    figure.text(0.5, 1 - 0.19 / total[1], f"{title} [{scale.unit}]", weight="bold", size=9, va="center", ha="center")
    figure.legend(handles, labels, loc="lower center", bbox_to_anchor=(0.5, 0.02), borderpad=0, fontsize=8)
    return figure


def _ticks(largest: float) -> Floats:
    """Three or four round numbers from zero on."""
    from matplotlib.ticker import MaxNLocator

    ticks = np.asarray(MaxNLocator(4).tick_values(0, largest))
    return ticks[(ticks > 0) & (ticks <= 1.1 * largest)]
