"""Figures and animations of modes: one column per model, one row per shape."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.potential import Visible
from truespring.report.bodies3d import one_color, solid
from truespring.report.lines import draw_lines
from truespring.report.render import Image, Shot, render
from truespring.report.sheet import Area, Sheet
from truespring.report.style import BLUE, FAINT, INK, figure_style
from truespring.report.surfaces import edges_of, facets_of, outline, seen
from truespring.report.undeformed import spring_lines
from truespring.report.words import draw_words, text_width
from truespring.vibration.result import Modes

# Largest displacement of a shape over the diameter of the body.
_AMPLITUDE = 0.1
# Width of all columns, smallest and largest width of one, largest height of a picture, height of a line of text [inch].
_WIDTH, _NARROW, _BROAD, _HIGH, _ROW, _SIDE = 7.0, 1.5, 3.2, 2.0, 0.19, 0.12
# Resolution of images of bodies in 3D, and of films [pixels/inch]; frames of a period, and time of each [ms].
_FINE, _COARSE, _FRAMES, _PAUSE = 200, 90, 24, 50
_SURFACE = "#f7f8f9"


@dataclass(frozen=True, eq=False)
class Column:
    """What figures show of a model.

    Attributes:
        modes: its modes.
        shapes: the shape in each row [-], shape (n_nodes, dim), None for an empty one.
        words: the text above each picture.
    """

    modes: Modes
    shapes: Sequence[Floats | None]
    words: Sequence[str]

    @property
    def head(self) -> str:
        """The text above the column."""
        n_rigid = self.modes.n_rigid
        return self.modes.label + (f", beside {n_rigid} rigid-body motions" if n_rigid else "")

    @property
    def color(self) -> str:
        """The colour of its lines."""
        return BLUE if self.modes.has_springs else INK

    def places(self, row: int, phase: float) -> Floats | None:
        """Return the nodes in the shape of a row at a phase -1 to 1 [m], shape (n_nodes, dim); None without a shape."""
        shape, mesh = self.shapes[row], self.modes.problem.mesh
        if shape is None:
            return None
        return np.asarray(mesh.nodes + phase * _AMPLITUDE * mesh.diameter * shape)


def mode_figures(title: str, columns: Sequence[Column], most: int) -> Iterator[tuple[str, Sheet]]:
    """Yield the figure of the first `most` rows."""
    rows = range(min(most, len(columns[0].shapes)))
    left = len(columns[0].shapes) - len(rows)
    yield "modes", _sheets(title + (f", the lowest {len(rows)}" if left else ""), columns, [rows], [1.0])[0]


def write_films(columns: Sequence[Column], folder: Path) -> None:
    """Write a period of each row as mode_1.gif, mode_2.gif and so on."""
    from PIL import Image as Pictures

    half = _FRAMES // 2 + 1
    phases = np.cos(2 * np.pi * np.arange(half) / _FRAMES).tolist()
    n_rows = len(columns[0].shapes)
    with figure_style():
        sheets = _sheets("", columns, [range(row, row + 1) for row in range(n_rows) for _ in phases], phases * n_rows)
        for row in range(n_rows):
            found = [sheet.pixels(_COARSE)[..., :3] for sheet in sheets[row * half : (row + 1) * half]]
            frames = [Pictures.fromarray(one) for one in (*found, *found[-2:0:-1])]
            first = frames[0].quantize(64, dither=Pictures.Dither.NONE)
            others = [one.quantize(palette=first, dither=Pictures.Dither.NONE) for one in frames[1:]]
            file = folder / f"mode_{row + 1}.gif"
            first.save(file, save_all=True, append_images=others, duration=_PAUSE, loop=0)


class _Layout(NamedTuple):
    """Corners of the box that every picture shows [m], and sizes on paper [inch]."""

    lower: Floats
    upper: Floats
    scale: float
    column: float
    height: float


def _layout(columns: Sequence[Column]) -> _Layout:
    """Return the layout of pictures that hold all shapes."""
    corners = np.concatenate(
        [
            _seen(places)
            for column in columns
            for row in range(len(column.shapes))
            for phase in (-1.0, 1.0)
            if (places := column.places(row, phase)) is not None
        ]
    )
    margin = 0.02 * float(np.ptp(corners, axis=0).max())
    lower, upper = corners.min(axis=0) - margin, corners.max(axis=0) + margin
    texts = [text_width(text, 8) for column in columns for text in (column.head, *column.words)]
    broad = max(_NARROW, min(_BROAD, _WIDTH / len(columns)))
    scale = float(min(broad / (upper - lower)[0], _HIGH / (upper - lower)[1]))
    return _Layout(lower, upper, scale, max(*texts, scale * float((upper - lower)[0])), scale * (upper - lower)[1])


def _sheets(
    title: str, columns: Sequence[Column], several: Sequence[Sequence[int]], phases: Sequence[float]
) -> list[Sheet]:
    """Return sheets of the rows `several`, each at its phase."""
    at = _layout(columns)
    shots = [
        shot
        for rows, phase in zip(several, phases, strict=True)
        for row in rows
        for column in columns
        if (shot := _shot(column, row, phase, at)) is not None
    ]
    images = iter(render(shots)()[0]) if shots else iter(())
    return [_sheet(title, columns, rows, phase, at, images) for rows, phase in zip(several, phases, strict=True)]


def _sheet(
    title: str, columns: Sequence[Column], rows: Sequence[int], phase: float, at: _Layout, images: Iterator[Image]
) -> Sheet:
    head = _ROW * (2 if title else 1) + 0.1
    step = at.height + 1.5 * _ROW
    width = 2 * _SIDE + len(columns) * at.column + (len(columns) - 1) * 2 * _SIDE
    sheet = Sheet(max(width, 2 * _SIDE + text_width(title, 9, bold=True)), head + step * len(rows) + 0.05, title)
    draw_words(sheet, _SIDE, sheet.height - 0.14, title, 9, bold=True)
    picture = at.scale * float((at.upper - at.lower)[0])
    lefts = [_SIDE + place * (at.column + 2 * _SIDE) for place in range(len(columns))]
    for left, column in zip(lefts, columns, strict=True):
        draw_words(sheet, left, sheet.height - head + 0.06, column.head, color=column.color, bold=True)
    for number, row in enumerate(rows):  # in the order of the images
        top = sheet.height - head - number * step
        for left, column in zip(lefts, columns, strict=True):
            draw_words(sheet, left, top - _ROW / 2, column.words[row] or "no mode of this shape")
            corner = left, top - _ROW - at.height
            area = Area(sheet, *corner, picture, at.height, (at.lower[0], at.upper[0]), (at.lower[1], at.upper[1]))
            _draw(area, column, row, phase, images)
    return sheet


def _draw(area: Area, column: Column, row: int, phase: float, images: Iterator[Image]) -> None:
    """Draw the undeformed outline and a shape into an area."""
    places, mesh = column.places(row, phase), column.modes.problem.mesh
    if places is None:
        return
    rest, facets = _seen(mesh.nodes), facets_of(mesh)
    if mesh.dim == 2:
        edges = mesh.boundary if mesh.element != "line" else mesh.edges
    else:
        edges = outline(seen(mesh.nodes), facets, silhouette=True) if len(facets) else mesh.edges
    draw_lines(area, rest[edges], FAINT, 0.8, 1, "rest", linestyle=(0, (3, 2)))
    if len(facets):
        area.sheet.add_image(next(images), area.left, area.bottom, area.width, area.height, 3, "shape")
        return
    lines = lines_of(column.modes)
    width = 0.9 * min(1.0, max(0.3, (500 / max(len(lines), 1)) ** 0.5))
    draw_lines(area, _seen(places)[lines], column.color, width, 4, "shape")


def _shot(column: Column, row: int, phase: float, at: _Layout) -> Shot | None:
    """Return the job to draw the surface of a shape in space; None in the plane, and without a shape."""
    places, facets = column.places(row, phase), facets_of(column.modes.problem.mesh)
    if places is None or not len(facets):
        return None
    lines = lines_of(column.modes) if column.modes.has_springs else edges_of(facets)
    layer = solid(seen(places), facets, one_color(facets, _SURFACE), lines, column.color, 0.6)
    width, height = at.scale * (at.upper - at.lower)
    return Shot((layer,), at.lower, at.upper, (round(width * _FINE), round(height * _FINE)), _FINE / 72)


def lines_of(modes: Modes) -> Ints:
    """Return the pairs of nodes that are joined by lines: springs, else edges of elements, shape (n, 2)."""
    potential = modes.potential
    if spring_lines(potential) is None or not isinstance(potential, Visible):
        return modes.problem.mesh.edges
    return potential.cells["line"]


def _seen(points: Floats) -> Floats:
    """Return points in the picture plane [m], shape (n, 2)."""
    return points if points.shape[1] == 2 else seen(points)[:, :2]
