"""The deformed body of a load case by the rule and calibrated, over the reference that the springs are fitted to."""

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.calibration.fitted import CaseResult
from truespring.equilibrium import Solution
from truespring.mesh import Mesh
from truespring.report.legend import ROW, Entry, draw_legend, legend_columns
from truespring.report.lines import draw_lines
from truespring.report.sheet import Area, Sheet
from truespring.report.style import BLUE, FAINT, INK, LOAD
from truespring.report.surfaces import edges_of, facets_of, normals, outline
from truespring.report.touching import view
from truespring.report.words import draw_words, text_width

_WIDTH, _HIGHEST, _SIDE = 5.6, 4.4, 0.15
_DASHES = (0, (3, 2))


def shape_figure(one: CaseResult) -> Sheet | None:
    """Return the body at the last level that both paths reached; None if they have none in common."""
    levels = [state.level for state in one.before.states if state.level]
    shared = [level for level in levels if one.after.at(level) is not None]
    if not shared:
        return None
    level, mesh = shared[-1], one.case.problem.mesh
    known = _reference(one, level)
    drawn = [("undeformed", FAINT, 0.7, view(mesh.nodes)[..., :2], _outline(mesh))]
    if known is not None and known[1] is not None:
        drawn.append((one.case.against, INK, 1.5, known[0][:, :2], _edges(mesh, known[0])))
    for name, color, path in (("by the rule", LOAD, one.before), ("calibrated", BLUE, one.after)):
        places = _places(path, level)
        drawn.append((name, color, 1.0, places[:, :2], _edges(mesh, places)))
    markers = known[0][:, :2] if known is not None and known[1] is None else None
    role = "held out" if one.held_out else "fitted"
    title = f"{one.case.name} ({role}): the body before and after, at load factor {level:.4g}"
    return _sheet(title, drawn, markers, one.case.against)


_Drawn = tuple[str, str, float, Floats, Ints]


def _sheet(title: str, drawn: list[_Drawn], markers: Floats | None, against: str) -> Sheet:
    points = np.concatenate([places for _, _, _, places, _ in drawn])
    lower, upper = points.min(axis=0), points.max(axis=0)
    extent = np.maximum(upper - lower, 1e-3 * float((upper - lower).max()))
    size = extent * min((_WIDTH - 2 * _SIDE) / extent[0], _HIGHEST / extent[1])
    legend = [Entry(name, color, linestyle=_DASHES if color == FAINT else "-") for name, color, *_ in drawn]
    legend += [Entry(f"markers of {against}", INK, "o", "")] if markers is not None else []
    columns, wide = legend_columns(legend, _WIDTH)
    top = 0.4 + ROW * len(columns[0])
    widest = max(_WIDTH, wide + 2 * _SIDE, text_width(title, 9, bold=True) + 2 * _SIDE)
    sheet = Sheet(widest, size[1] + 2 * _SIDE + top, title)
    draw_words(sheet, _SIDE, sheet.height - 0.17, title, 9, bold=True)
    draw_legend(sheet, columns, _SIDE, sheet.height - 0.32)
    x, y = zip(lower, lower + extent, strict=True)
    area = Area(sheet, _SIDE, _SIDE, float(size[0]), float(size[1]), (x[0], x[1]), (y[0], y[1]))
    for order, (name, color, width, places, lines) in enumerate(drawn):
        thin = width * min(1.0, max(0.3, (400 / max(len(lines), 1)) ** 0.5))
        style = {"linestyle": _DASHES} if color == FAINT else {}
        draw_lines(area, places[lines], color, thin, 1 + order, name.replace(" ", "_"), **style)
    if markers is not None:
        _draw_markers(area, markers)
    return sheet


def _draw_markers(area: Area, points: Floats) -> None:
    from matplotlib.lines import Line2D

    area.add(Line2D(*points.T, ls="", marker="o", ms=3.5, mfc="white", mec=INK, mew=1.0, zorder=9, clip_on=False))


def _outline(mesh: Mesh) -> Ints:
    """Return the lines of the undeformed body: its boundary, in space its outline."""
    facets = facets_of(mesh)
    if len(facets):
        return outline(view(mesh.nodes), facets, silhouette=True)
    return mesh.boundary if mesh.dim == 2 and mesh.boundary.shape[1] == 2 else mesh.edges


def _edges(mesh: Mesh, places: Floats) -> Ints:
    """Return the edges of a body at `places` in the coordinates of the view, in space those that face the eye."""
    facets = facets_of(mesh)
    if not len(facets):
        return mesh.edges
    return edges_of(facets[normals(places, facets)[:, 2] > 0])


def _places(path: Solution, level: float) -> Floats:
    """Return the deformed nodes in the coordinates of the view [m], shape (n_nodes, dim)."""
    state = path.at(level)
    assert state is not None  # shape_figure
    return view(state.positions)


def _reference(one: CaseResult, level: float) -> tuple[Floats, Ints | None] | None:
    """Return the places of the reference at a level and its nodes, without nodes those of markers; None if unknown."""
    case = one.case
    if case.field is not None:
        path, nodes = case.field
        state = path.at(level)
        return None if state is None else (view(state.positions), nodes)
    state = None if case.reference is None or not case.reference.states else case.reference.at(level)
    dim = case.problem.mesh.dim
    return None if state is None else (view(state.all_positions[:, :dim]), None)
