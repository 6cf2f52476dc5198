"""Words in figures as outlines, laid out once for all figures and files; matplotlib's own take most of the time."""

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from truespring.report.sheet import Sheet
from truespring.report.style import INK, POINT

if TYPE_CHECKING:
    from matplotlib.font_manager import FontProperties
    from matplotlib.path import Path

# The height of DejaVu's capital letters and digits, over its size.
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
    """Draw words whose capital letters have their middle at height y, and the share `align` of their width left of x.

    Places are in inches, the `size` in points. `upright` words run upwards; a `halo` keeps them legible on
    lines. The artist's label is the text.
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
    """Return the width of a text in figures [inch]; `size` in points."""
    from matplotlib.textpath import text_to_path

    width, _, _ = text_to_path.get_text_width_height_descent(text, _font(bold), ismath=False)
    return float(width) * size * POINT


@cache
def _outline(text: str, bold: bool) -> "Path":
    """The outline of a text of size 1, its baseline from (0, 0) on."""
    from matplotlib.path import Path
    from matplotlib.textpath import text_to_path

    places, codes = text_to_path.get_text_path(_font(bold), text)
    return Path(np.reshape(places, (-1, 2)) / text_to_path.FONT_SCALE, codes)


@cache
def _font(bold: bool) -> "FontProperties":
    from matplotlib.font_manager import FontProperties

    return FontProperties(family="DejaVu Sans", size=1, weight="bold" if bold else "normal")
