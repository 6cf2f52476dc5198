"""Young's modulus by direction: a polar curve in 2D, a surface in 3D."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.models import Moduli
from truespring.report.frame import GRID, SIZE, draw_bar, round_numbers, written
from truespring.report.legend import ROW, Entry, draw_legend, legend_columns
from truespring.report.lines import draw_lines
from truespring.report.quantity import natural_scale, quantity
from truespring.report.sheet import DPI, Area, Sheet, polygons
from truespring.report.style import BLUE, INK, LOAD, POINT, SPRING_STYLES, figure_style
from truespring.report.surfaces import VIEW, seen
from truespring.report.words import draw_words

if TYPE_CHECKING:
    from matplotlib.colors import Colormap, Normalize

_TITLE = "Young's modulus by direction"
_DASHES = (0, (5, 2))
_MOST_COLUMNS = 3

# Size of a panel in 3D, height of its caption, of the title above and the colour bar below all panels [inch].
_PANEL, _CAPTION, _TOP, _FOOT = 2.5, 0.42, 0.36, 0.62

# Direction of the light, from above, left of the viewer; smallest brightness of a facet.
_LIGHT, _DIMMEST = np.array([-0.35, 0.55, 0.76]), 0.62


@dataclass(frozen=True, eq=False, slots=True)
class Known:
    """Moduli to draw, with label, colour and dashes of their curve."""

    label: str
    moduli: Moduli
    color: str
    dashes: Any


def save_young(several: Mapping[str, Moduli], material: str, folder: FilePath) -> FilePath:
    """Write the figure of several springs, by label, as moduli.png and moduli.svg into `folder`; return the first."""
    looks = itertools.cycle(SPRING_STYLES)
    known = [Known(label, moduli, *look[:2]) for (label, moduli), look in zip(several.items(), looks, strict=False)]
    folder.mkdir(parents=True, exist_ok=True)
    with figure_style():
        sheet = young_figure(known, material)
        (folder / "moduli.png").write_bytes(sheet.png())
        (folder / "moduli.svg").write_bytes(sheet.svg())
    return folder / "moduli.png"


def young_figure(several: Sequence[Known], material: str) -> Sheet:
    """Return Young's modulus in a tensile test along every direction, of springs and of the `material` (its name)."""
    return (_surfaces if several[0].moduli.dim == 3 else _polar)(several, material)


def _polar(several: Sequence[Known], material: str) -> Sheet:
    """Return polar curves of springs, and the circle of the material."""
    from matplotlib.lines import Line2D

    young = several[0].moduli.material_young
    angles = np.radians(np.arange(0.0, 361.0))
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    largest = max(young, *(known.moduli.young_range[1] for known in several))
    scale = natural_scale(largest, "Pa")
    legend = [Entry(f"{material}: {quantity(young, 'Pa')}", INK, linestyle=_DASHES)]
    for known in several:
        extremes = dict.fromkeys(quantity(value, "Pa") for value in known.moduli.young_range)
        legend.append(Entry(f"{known.label}: {' to '.join(extremes)}", known.color, linestyle=known.dashes))
    columns, words = legend_columns(legend, 0.0)
    width, height = 3.9, 4.25 + ROW * len(several)
    sheet = Sheet(width, height, _TITLE)
    end = 1.12 * largest / scale.size
    place = (0.12 * width, 0.65 + ROW * len(several), 0.76 * width, 0.76 * width)
    area = Area(sheet, *place, (-end, end), (-end, end))
    _draw_compass(area)
    area.add(Line2D(*(young / scale.size * directions.T), color=INK, lw=1.3, ls=_DASHES))
    for known in several:
        values = known.moduli.young_along(directions)[:, None] / scale.size
        area.add(Line2D(*(values * directions).T, color=known.color, lw=2, ls=known.dashes))
    draw_words(sheet, width / 2, height - 0.19, f"{_TITLE} [{scale.unit}]", 9, bold=True, align=0.5)
    draw_legend(sheet, columns, (width - words) / 2, 0.1 + ROW * len(legend))
    return sheet


def _draw_compass(area: Area) -> None:
    """Draw rings at round numbers and rays at every 45 degrees around the centre of an area."""
    from matplotlib.patches import Circle

    end = area.x[1]
    numbers = round_numbers(0.0, end, 5)[1:]
    for number, label in zip(numbers, written(numbers), strict=True):
        area.add(Circle((0, 0), number, fill=False, ec=GRID, lw=0.6, zorder=0.5))
        x, y = area.place(number * np.array([np.cos(np.pi / 8), np.sin(np.pi / 8)]))
        draw_words(area.sheet, x, y + 3 * POINT, label, SIZE)
    angles = np.arange(0, 360, 45)
    rays = end * np.stack([np.cos(np.radians(angles)), np.sin(np.radians(angles))], axis=1)
    draw_lines(area, np.stack([0 * rays, rays], axis=1), GRID, 0.6, 0.5, "rays")
    for angle, (x, y) in zip(angles, area.place(1.12 * rays), strict=True):
        draw_words(area.sheet, x, y, f"{angle}°", SIZE, align=0.5)


# --- 3D ---------------------------------------------------------------------------------------------


def _surfaces(several: Sequence[Known], material: str) -> Sheet:
    """Return a surface for each springs model, with radius and colour E over that of the material (the sphere)."""
    columns = min(len(several), _MOST_COLUMNS)
    rows = math.ceil(len(several) / columns)
    width = max(columns * _PANEL, 3.6)
    height = _TOP + rows * (_PANEL + _CAPTION) + _FOOT
    sheet = Sheet(width, height, _TITLE)
    draw_words(sheet, width / 2, height - 0.19, _TITLE, 9, bold=True, align=0.5)
    shares = np.array([known.moduli.young_range for known in several]) / several[0].moduli.material_young
    facets = [_facets(known.moduli) for known in several]
    extent = max(1.0, *(float(np.abs(corners[..., :2]).max()) for corners, _ in facets))
    farthest = max(1.1, float(np.exp(np.abs(np.log(shares)).max())))
    colors, norm = _colors(farthest)
    left = (width - columns * _PANEL) / 2
    for place, known in enumerate(several):
        row, column = divmod(place, columns)
        bottom = height - _TOP - (row + 1) * (_PANEL + _CAPTION)
        limits = (-1.3 * extent, 1.3 * extent)
        area = Area(sheet, left + column * _PANEL, bottom + _CAPTION, _PANEL, _PANEL, limits, limits)
        _draw_surface(area, *facets[place], lambda share: colors(norm(share)))
        _draw_sphere(area, known.moduli)
        _draw_axes(area, known.moduli, extent)
        middle = area.left + _PANEL / 2
        extremes = " to ".join(dict.fromkeys(f"{value:.2f}" for value in shares[place]))
        draw_words(sheet, middle, bottom + 0.3, known.label, bold=True, align=0.5)
        draw_words(sheet, middle, bottom + 0.13, extremes, align=0.5)
    marks = np.array(_marks(farthest))
    shown = colors(np.linspace(0, 1, 256))[:, :3]
    draw_bar(sheet, width / 2 - 1.2, 0.49, 2.4, shown, np.asarray(norm(marks)), [f"{mark:g}" for mark in marks])
    young = quantity(several[0].moduli.material_young, "Pa")
    caption = f"times that of the {material}, {young} (the sphere)"
    draw_words(sheet, width / 2, 0.11, caption, 7.5, align=0.5)
    return sheet


def _colors(farthest: float) -> "tuple[Colormap, Normalize]":
    """Return colours and a logarithmic scale: orange for springs softer than the material, blue for stiffer ones."""
    from matplotlib.colors import LinearSegmentedColormap, LogNorm

    middle = "#eef0f2"
    return LinearSegmentedColormap.from_list("young", [LOAD, middle, BLUE]), LogNorm(1 / farthest, farthest)


def _marks(farthest: float) -> list[float]:
    """Return round factors below, at and above 1, as labels of the colour bar."""
    above = [factor for factor in (1.05, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0) if factor <= farthest]
    below = [factor for factor in (0.95, 0.9, 0.8, 0.7, 0.5, 0.3, 0.2, 0.1, 0.05, 0.02) if factor >= 1 / farthest]
    return [*below[-2:][::-1], 1.0, *above[-2:]]


def _draw_surface(area: Area, corners: Floats, share: Floats, color: Callable[[Floats], Any]) -> None:
    """Draw the facets that face the viewer, far ones first, as an image: as SVG they would be thousands of elements."""
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    towards = np.flatnonzero(across[:, 2] > 0)
    order = towards[np.argsort(corners[towards, :, 2].mean(axis=1))]
    light = across[order] @ (_LIGHT / np.linalg.norm(_LIGHT)) / np.linalg.norm(across[order], axis=1)
    shade = _DIMMEST + (1 - _DIMMEST) * np.clip(light, 0, 1)
    shown = np.asarray(color(share[order]))[:, :3] * shade[:, None]
    shown = np.column_stack([shown, np.ones(len(shown))])
    places = (area.place(corners[order, :, :2]) - (area.left, area.bottom)) * 2 * DPI
    size = round(area.width * 2 * DPI), round(area.height * 2 * DPI)
    image = polygons(size, 2 * DPI, None, places, shown, shown, np.full(len(shown), 0.4))
    area.sheet.add_image(image, area.left, area.bottom, area.width, area.height, 1, "surface")


def _draw_axes(area: Area, moduli: Moduli, extent: float) -> None:
    from matplotlib.lines import Line2D

    for axis, name in zip(np.eye(3), "xyz", strict=True):
        start = max(1.0, float(_share(moduli, axis[None])[0]))
        end = max(1.06 * start, 1.12 * extent)
        line = np.linspace(start, end, 40)[:, None] * axis
        for piece in _visible_pieces(line, moduli):
            area.add(Line2D(*piece.T, color=INK, lw=0.9))
        x, y = area.place(seen((end + 0.1 * extent) * axis)[:2])
        draw_words(area.sheet, x, y, name, align=0.5)


def _share(moduli: Moduli, directions: Floats) -> Floats:
    return moduli.young_along(directions) / moduli.material_young


def _facets(moduli: Moduli) -> tuple[Floats, Floats]:
    """Return the corners of the surface's facets in the view, (n, 4, 3), and E over the material's, (n,)."""
    polar, around = np.meshgrid(np.linspace(0, np.pi, 91), np.linspace(0, 2 * np.pi, 181), indexing="ij")
    n = _on_sphere(polar, around)
    share = _share(moduli, n.reshape(-1, 3)).reshape(polar.shape)
    points = seen(share[..., None] * n)
    corners = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2)
    middle = (share[:-1, :-1] + share[1:, :-1] + share[1:, 1:] + share[:-1, 1:]) / 4
    return corners.reshape(-1, 4, 3), middle.ravel()


def _on_sphere(polar: Floats, around: Floats) -> Floats:
    """Return unit vectors, shape (..., 3), by the polar angle from y and the azimuth about y from z [rad]."""
    polar, around = np.broadcast_arrays(polar, around)
    return np.stack([np.sin(polar) * np.sin(around), np.cos(polar), np.sin(polar) * np.cos(around)], axis=-1)


def _draw_sphere(area: Area, moduli: Moduli) -> None:
    """Draw outline, meridians and parallels of the material's sphere where neither it nor the surface hides them."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    turn, every = np.linspace(0, 2 * np.pi, 241), np.radians(np.arange(0, 180, 30))
    lines = [np.cos(turn)[:, None] * VIEW[0] + np.sin(turn)[:, None] * VIEW[1]]
    lines += [_on_sphere(turn, angle) for angle in every]
    lines += [_on_sphere(angle, turn) for angle in every[1:]]
    pieces = Path.make_compound_path(*(Path(piece) for line in lines for piece in _visible_pieces(line, moduli)))
    area.add(PathPatch(pieces, fill=False, ec=INK, lw=0.5, alpha=0.55, zorder=2))


def _visible_pieces(line: Floats, moduli: Moduli) -> list[Floats]:
    """Return the visible pieces of a line, shape (n, 3), each projected to the picture plane, shape (m, 2)."""
    visible = _visible(line, moduli)
    cuts = np.flatnonzero(visible[1:] != visible[:-1]) + 1
    runs = zip(np.split(line, cuts), np.split(visible, cuts), strict=True)
    return [seen(run)[:, :2] for run, shown in runs if shown[0]]


def _visible(points: Floats, moduli: Moduli) -> Bools:
    """Return which points on or outside the sphere are visible: on the near side of it and not behind the surface."""
    far = 1 + moduli.young_range[1] / moduli.material_young
    ray = points[:, None] + np.linspace(0, far, 100)[:, None] * VIEW[2]
    distance = np.linalg.norm(ray, axis=2)
    share = _share(moduli, (ray / distance[..., None]).reshape(-1, 3)).reshape(distance.shape)
    return np.asarray((distance > 0.995 * share).all(axis=1) & (points @ VIEW[2] > -1e-9))
