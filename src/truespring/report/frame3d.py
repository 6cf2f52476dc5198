"""The frame of a picture in 3D: an image with title, legend, colour bar, and a triad of axes that shows the scale."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats
from truespring.report.bar import BAR, Bar, draw_error_bar
from truespring.report.legend import ROW, Entry, draw_legend, legend_columns
from truespring.report.lines import draw_arrow
from truespring.report.quantity import Scale, natural_scale, quantity
from truespring.report.render import Image, Layer, Shot
from truespring.report.sheet import Area, Sheet
from truespring.report.style import LOAD, POINT
from truespring.report.surfaces import VIEW
from truespring.report.words import draw_words, text_width

# Resolution of images [pixels/inch], finer than the PNG that holds them.
_DPI = 200

_TRIAD = "#3d4248"

#: Draws marks into an area in units of a scale.
Marks = Callable[[Area, Scale], None]


@dataclass(frozen=True, eq=False, slots=True)
class Picture:
    """A picture of a body in 3D, without its image.

    Attributes:
        title, remark: the text above; the remark may be empty.
        legend: entries for the lines.
        lower, upper: the corners of the box shown, right and up [m], shape (2,).
        taken: points of the picture plane where something is drawn [m], shape (n, 2).
        layers: the content of the image.
        marks: draws over the image and, with a low zorder, behind it.
        bar: the colour bar, if colours stand for numbers.
    """

    title: str
    remark: str
    legend: tuple[Entry, ...]
    lower: Floats
    upper: Floats
    taken: Floats
    layers: tuple[Layer, ...]
    marks: Marks
    bar: Bar | None = None


# Margins of the image, and room for the labels of the triad [inch].
_SIDE, _BOTTOM, _TOP, _WORDS = 0.12, 0.06, 0.32, 0.17


@dataclass(frozen=True, eq=False, slots=True)
class _Layout:
    """Places and sizes on paper.

    Attributes:
        width, height: of the image [inch].
        top: height of the text above it [inch].
        lower, upper: the corners of the box shown, right and up [m], shape (2,).
        columns: of the legend.
        arm, origin: length of the arms of the triad and their common start, right and up [m].
    """

    width: float
    height: float
    top: float
    lower: Floats
    upper: Floats
    columns: list[Sequence[Entry]]
    arm: float
    origin: Floats


def _layout(picture: Picture) -> _Layout:
    columns, words = legend_columns(picture.legend, 5.0)
    words = max(words, text_width(picture.title, 9, bold=True), text_width(picture.remark, 8))
    words = max(words, text_width(picture.bar.label, 8)) if picture.bar else words
    top = _TOP + ROW * max(map(len, columns), default=0) + ROW * bool(picture.remark) + BAR * bool(picture.bar)
    extent = picture.upper - picture.lower
    inch = float(max(extent[0] / 5.4, extent[1] / 4.4))  # [m] on paper
    arm = _round_length(0.15 * float(extent.max()))
    lower, upper, origin = _triad_place(picture, arm, _WORDS * inch)
    # If the text is wider than the body, widen the box.
    broad = max(float(upper[0] - lower[0]) / inch, 3.3, words + 0.05)
    wider = (broad * inch - (upper[0] - lower[0])) / 2 * np.array([1.0, 0.0])
    lower, upper = lower - wider, upper + wider
    return _Layout(broad, float(upper[1] - lower[1]) / inch, top, lower, upper, columns, arm, origin)


def _round_length(most: float) -> float:
    """Return the largest of 1, 2, 5, 10, 20, ... times a power of ten that is not above `most`."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= most * (1 + 1e-9)))


def _triad_place(picture: Picture, arm: float, words: float) -> tuple[Floats, Floats, Floats]:
    """Return lower and upper corner of the box and the origin of the triad [m], in a free corner or a strip below."""
    tips = np.concatenate([arm * VIEW[:2].T, np.zeros((1, 2))])
    low, high = tips.min(axis=0) - words * np.array([1.2, 2.0]), tips.max(axis=0) + words * np.array([1.2, 1.0])
    lower, upper = picture.lower, picture.upper
    for right, up in ((0, 0), (1, 0), (0, 1), (1, 1)):
        origin = np.where([right, up], upper - high, lower - low)
        inside = (picture.taken >= origin + low) & (picture.taken <= origin + high)
        if not inside.all(axis=1).any():
            return lower, upper, origin
    strip = np.array([0.0, float((high - low)[1])])
    return lower - strip, upper, lower - strip - low


def shot(picture: Picture) -> Shot:
    """Return the job to render the image of a picture."""
    at = _layout(picture)
    pixels = (round(at.width * _DPI), round(at.height * _DPI))
    return Shot(picture.layers, at.lower, at.upper, pixels, _DPI / 72)


def figure_of(picture: Picture, image: Image) -> Sheet:
    """Return the figure of a picture and its image."""
    at = _layout(picture)
    scale = natural_scale(float(np.abs(picture.upper - picture.lower).max()), "m")
    description = f"{picture.title}; {picture.remark}" if picture.remark else picture.title
    sheet = Sheet(_SIDE + at.width + _SIDE, _BOTTOM + at.height + at.top, description)
    (left, bottom), (right, top) = at.lower / scale.size, at.upper / scale.size
    area = Area(sheet, _SIDE, _BOTTOM, at.width, at.height, (left, right), (bottom, top))
    sheet.add_image(image, _SIDE, _BOTTOM, at.width, at.height, 3, "image")
    picture.marks(area, scale)
    _draw_triad(area, at, scale)
    draw_words(sheet, _SIDE, sheet.height - 0.17, picture.title, 9, bold=True)
    draw_words(sheet, _SIDE, sheet.height - 0.37, picture.remark, color=LOAD)
    below = sheet.height - 0.30 - ROW * bool(picture.remark)
    draw_legend(sheet, at.columns, _SIDE, below)
    if picture.bar:
        draw_error_bar(sheet, picture.bar, _SIDE, below - ROW * len(at.columns[0]) - 0.08)
    return sheet


def _draw_triad(area: Area, at: _Layout, scale: Scale) -> None:
    """Draw arms along x, y and z with their common length."""
    origin = area.place(at.origin / scale.size)
    tips = area.place((at.origin + at.arm * VIEW[:2].T) / scale.size)
    for tip, name in zip(tips, "xyz", strict=True):
        draw_arrow(area.sheet, origin, tip, _TRIAD, 1.0, 2.5)
        x, y = tip + 6 * POINT * (tip - origin) / np.linalg.norm(tip - origin)
        draw_words(area.sheet, x, y, name, align=0.5)
    lowest = float(min(origin[1], *tips[:, 1]))
    length = f"each {quantity(at.arm, 'm', 1)}"
    draw_words(area.sheet, origin[0], lowest - 11 * POINT, length, 7.5, _TRIAD, align=0.5)
