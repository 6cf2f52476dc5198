"""Instants of a path: film strips and frames of animations, a model in blue over a reference in black."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.equilibrium import Solution
from truespring.mesh import Mesh
from truespring.report.axis import axis_of
from truespring.report.bodies import magnification, path_lines, picture_box
from truespring.report.bodies3d import over_layers
from truespring.report.frame import EDGE, round_numbers, written
from truespring.report.legend import ROW, Entry, draw_legend, legend_columns
from truespring.report.lines import draw_lines
from truespring.report.quantity import Scale, natural_scale, percent, times
from truespring.report.render import Image, Shot
from truespring.report.result import Result
from truespring.report.sheet import Area, Sheet
from truespring.report.style import BLUE, FAINT, INK, LOAD, RED, full_name
from truespring.report.surfaces import facets_of, outline
from truespring.report.symbols import draw_dot
from truespring.report.touching import draw_tools, drawn_tools, entries, near, view, with_tools
from truespring.report.words import draw_words

_DASHES = (0, (3, 2))
# Instants of a strip; smallest width of a sheet, largest width and height, largest height of a picture, margin, height
# of a line of text [inch].
INSTANTS = 6
_NARROW, _WIDTH, _HEIGHT, _HIGHEST, _SIDE, _ROW = 4.6, 7.0, 6.4, 4.4, 0.12, 0.19
# Resolution of images in space [pixels/inch].
_DPI = 150


@dataclass(frozen=True, eq=False, slots=True)
class Reel:
    """Instants of a model over a reference in one box.

    Attributes:
        result: the result.
        model, reference: names of paths; reference None if the model is alone.
        levels: the instants, ascending.
        lower, upper: corners of the box in the picture plane [m], shape (2,).
        factor: magnification of displacements.
        leaves: whether the reference leaves the box.
    """

    result: Result
    model: str
    reference: str | None
    levels: tuple[float, ...]
    lower: Floats
    upper: Floats
    factor: float
    leaves: bool

    @property
    def mesh(self) -> Mesh:
        """The mesh of the model."""
        return self.result.solutions[self.model].problem.mesh

    def places(self, name: str, level: float) -> Floats | None:
        """Return the nodes of a path at a level in the coordinates of `view` [m]; None if the level is not known."""
        return _places(self.result.solutions[name], level, self.factor)


def _places(path: Solution, level: float, factor: float) -> Floats | None:
    state = path.at(level)
    return None if state is None else view(path.problem.mesh.nodes + factor * state.displacement)


def shown_reference(result: Result) -> str | None:
    """Return the name of the path to draw with the model: the nearest reference, else another path that moves."""
    others = [name for name, path in result.solutions.items() if name != result.model and len(path.states) > 1]
    preferred = [name for name in (result.closest, *result.comparisons) if name in others]
    return next(iter((*preferred, *others)), None)


def reel_of(result: Result, reference: str | None, most: int, from_rest: bool) -> Reel | None:
    """Return a reel of at most `most` instants, evenly spaced; None if fewer than two levels are known.

    `from_rest`: whether the first level, that of the undeformed body, is one of them.
    """
    model = result.model or next(iter(result.solutions))
    path, other = result.solutions[model], None if reference is None else result.solutions[reference]
    if other is not None and other.problem.mesh.dim != path.problem.mesh.dim:
        reference = other = None
    known = [
        state.level
        for state in path.states
        if state.level is not None and (other is None or other.at(state.level) is not None)
    ]
    if len(known) < 2:
        return None
    usable = known if from_rest else known[1:]
    last = len(usable) - 1
    first = 0 if from_rest else last / min(most, len(usable))  # the first interval is as long as the others
    chosen = np.unique(np.rint(np.linspace(first if last else 0, last, min(most, len(usable)))).astype(int))
    levels = tuple(usable[number] for number in chosen)
    factor = magnification(result)
    mine = [view(path.problem.mesh.nodes), *_clouds(path, factor)]
    theirs = [] if other is None else [np.concatenate(_clouds(other, factor))[:, :2]]
    lower, upper, leaves = picture_box(np.concatenate(mine)[:, :2], theirs)
    tools = [one for level in levels for one in drawn_tools(path.problem, level)]
    corners = np.concatenate([near(tools, lower, upper), lower[None], upper[None]])
    margin = 0.03 * float(np.ptp(corners, axis=0).max())
    box = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    return Reel(result, model, reference, levels, *box, factor, any(leaves))


def _clouds(path: Solution, factor: float) -> list[Floats]:
    return [view(path.problem.mesh.nodes + factor * state.displacement) for state in path.states]


# --- layout ---------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Layout:
    """Columns and rows of pictures, width and height of a picture [inch]."""

    columns: int
    rows: int
    width: float
    height: float


def _layout(reel: Reel, n_pictures: int) -> _Layout:
    """Return the layout with the largest pictures that fit on a sheet."""
    wide, high = reel.upper - reel.lower
    found = []
    for columns in range(1, n_pictures + 1):
        rows = -(-n_pictures // columns)
        room = (_WIDTH - (columns + 1) * _SIDE) / columns, min(_HEIGHT / rows, _HIGHEST) - _ROW
        scale = min(room[0] / wide, room[1] / high)
        found.append(_Layout(columns, rows, scale * wide, scale * high))
    return max(found, key=lambda one: one.width)


def shots(reel: Reel, n_pictures: int, levels: Sequence[float], dpi: float = _DPI) -> list[Shot]:
    """Return the jobs to draw the images of levels, `n_pictures` on a sheet; none in the plane."""
    if reel.mesh.dim == 2:
        return []
    at = _layout(reel, n_pictures)
    size = round(at.width * dpi), round(at.height * dpi)
    return [_shot(reel, level, size, dpi) for level in levels]


def _shot(reel: Reel, level: float, size: tuple[int, int], dpi: float) -> Shot:
    mine = reel.places(reel.model, level)
    assert mine is not None  # reel_of
    path = reel.result.solutions[reel.model]
    other = None if reel.reference is None else reel.result.solutions[reel.reference]
    theirs = None if reel.reference is None else reel.places(reel.reference, level)
    layers = over_layers(path, mine, other, theirs)
    return Shot(with_tools(layers, drawn_tools(path.problem, level)), reel.lower, reel.upper, size, dpi / 72)


def sheet_of(reel: Reel, levels: Sequence[float], images: Sequence[Image], title: str) -> Sheet:
    """Return a sheet with a picture of each level; `images` from `shots`, none in the plane."""
    at = _layout(reel, len(levels))
    legend = _legend(reel)
    width = at.columns * (at.width + _SIDE) + _SIDE
    columns, wide = legend_columns(legend, max(width, _NARROW) - 2 * _SIDE)
    remarks = [f"displacements {times(reel.factor)}"] if reel.factor != 1 else []
    remarks += ["the reference leaves the picture"] if reel.leaves else []
    words = [(title, INK, True)] * bool(title) + [(" · ".join(remarks), LOAD, False)] * bool(remarks)
    head = 0.1 + ROW * (len(words) + len(columns[0]))
    sheet = Sheet(max(width, _NARROW, wide + 2 * _SIDE), head + at.rows * (at.height + _ROW) + 0.3, title)
    for row, (text, color, bold) in enumerate(words):
        draw_words(sheet, _SIDE, sheet.height - 0.14 - ROW * row, text, 9 if bold else 8, color, bold=bold)
    draw_legend(sheet, columns, _SIDE, sheet.height - head + ROW * len(columns[0]))
    scale = natural_scale(float(np.abs([reel.lower, reel.upper]).max()), "m")
    (left, bottom), (right, top) = reel.lower / scale.size, reel.upper / scale.size
    for number, level in enumerate(levels):
        x = _SIDE + number % at.columns * (at.width + _SIDE)
        y = sheet.height - head - (number // at.columns + 1) * (at.height + _ROW)
        area = Area(sheet, x, y, at.width, at.height, (left, right), (bottom, top))
        draw_words(sheet, x, y + at.height + _ROW / 2, _caption(reel, level), bold=True)
        if images:
            sheet.add_image(images[number], x, y, at.width, at.height, 3, "image")
        _draw(area, reel, level, scale)
    _draw_scale(sheet, at.width / float(reel.upper[0] - reel.lower[0]), scale)
    return sheet


def _caption(reel: Reel, level: float) -> str:
    """Return the level in words, and how far the two paths are apart there, if that is known."""
    at = axis_of(reel.result).exact(level)
    one = reel.result.comparisons.get(reel.reference or "")
    if one is None:
        return at
    known = np.flatnonzero(np.abs(one.load_factors - level) < 1e-9)
    apart = float(one.rms_errors[known[0]]) if known.size else np.nan
    return f"{at}: {percent(apart)} apart" if np.isfinite(apart) else at


def _legend(reel: Reel) -> list[Entry]:
    found = [Entry(full_name(reel.result, reel.model), BLUE)]
    found += [Entry(full_name(reel.result, reel.reference), INK)] if reel.reference else []
    found += [Entry("undeformed", FAINT, linestyle=_DASHES), Entry("probe", RED, "o", "")]
    return [*found, *entries(reel.result.problem)]


def _draw(area: Area, reel: Reel, level: float, scale: Scale) -> None:
    """Draw the bodies at a level; in space what is drawn over their image."""
    mesh, size = reel.mesh, scale.size
    rest, facets = view(mesh.nodes), facets_of(mesh)
    if mesh.dim == 2:
        edges = mesh.boundary if mesh.element != "line" else mesh.edges
    else:
        edges = outline(rest, facets, silhouette=True) if len(facets) else mesh.edges
    draw_lines(area, rest[edges][..., :2] / size, FAINT, 0.8, 1, "rest", linestyle=_DASHES)
    mine = reel.places(reel.model, level)
    theirs = None if reel.reference is None else reel.places(reel.reference, level)
    if mesh.dim == 2:
        if theirs is not None and reel.reference is not None:
            _wires(area, theirs / size, path_lines(reel.result.solutions[reel.reference]), INK, 1.2, "reference")
        if mine is not None:
            _wires(area, mine / size, path_lines(reel.result.solutions[reel.model]), BLUE, 0.75, "model")
        draw_tools(area, drawn_tools(reel.result.problem, level), scale)
    if mine is not None and reel.result.solutions[reel.model].problem.mesh is reel.result.problem.mesh:
        draw_dot(area, mine[reel.result.probe, :2] / size)


def _wires(area: Area, points: Floats, lines: Ints, color: str, width: float, name: str) -> None:
    width *= min(1.0, max(0.25, (300 / max(len(lines), 1)) ** 0.5))
    draw_lines(area, points[lines], color, width, 3 if color == INK else 4, name)


def _draw_scale(sheet: Sheet, inches: float, scale: Scale) -> None:
    """Draw a scale bar of a round length at the lower left; `inches` is the size of a metre."""
    longest = 1.1 / (inches * scale.size)
    length = float(round_numbers(0.0, longest, 2)[-1])
    end = _SIDE + length * inches * scale.size
    bar = [((_SIDE, 0.12), (end, 0.12))] + [((x, 0.09), (x, 0.15)) for x in (_SIDE, end)]
    draw_lines(sheet, np.array(bar), EDGE, 1.2, 4, "scale")
    draw_words(sheet, end + 0.07, 0.12, f"{written(np.array([0.0, length]))[-1]} {scale.unit}", 7.5, EDGE)
