"""Text in figures as outlines, laid out once for all figures; matplotlib's text would take most of the drawing time."""

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from truespring.report.sheet import Sheet
from truespring.report.style import INK, POINT

if TYPE_CHECKING:
    from matplotlib.font_manager import FontProperties
    from matplotlib.path import Path

# Height of DejaVu's capital letters and digits over the font size.
_CAPITAL = 0.729


def draw_words(
    sheet: Sheet,
    x: float,
    y: float,
    text: str,
    size: float = 8,
    color: str = INK,
    *,
    bold: bool = False,
    align: float = 0.0,
    upright: bool = False,
    halo: bool = False,
) -> None:
    """Draw a text, its capital letters centred at height y, with the share `align` of its width left of x.

    x and y are in inches, `size` is in points. `upright` text runs upwards; a `halo` keeps it legible on lines. The
    label of the artist is the text.
    """
    from matplotlib.patches import PathPatch
    from matplotlib.transforms import Affine2D

    if not text.strip():
        return
    outline = _outline(text, bold)
    shape = Affine2D().translate(-align * np.max(outline.vertices, axis=0)[0], -_CAPITAL / 2).scale(size * POINT)
    turned = shape.rotate_deg(90) if upright else shape
    place = turned.translate(x, y)
    if halo:
        under = PathPatch(outline, fc="white", ec="white", lw=3, joinstyle="round", alpha=0.8, zorder=11)
        sheet.add(under, place)
    sheet.add(PathPatch(outline, fc=color, lw=0, label=text, zorder=11), place)


@cache
def text_width(text: str, size: float, bold: bool = False) -> float:
    """Return the width of a text [inch]; `size` is in points."""
    from matplotlib.textpath import text_to_path

    width, _, _ = text_to_path.get_text_width_height_descent(text, _font(bold), ismath=False)
    return float(width) * size * POINT


@cache
def _outline(text: str, bold: bool) -> "Path":
    """Return the outline of a text of size 1, with its baseline starting at (0, 0)."""
    from matplotlib.path import Path
    from matplotlib.textpath import text_to_path

    places, codes = text_to_path.get_text_path(_font(bold), text)
    return Path(np.reshape(places, (-1, 2)) / text_to_path.FONT_SCALE, codes)


@cache
def _font(bold: bool) -> "FontProperties":
    from matplotlib.font_manager import FontProperties

    return FontProperties(family="DejaVu Sans", size=1, weight="bold" if bold else "normal")
