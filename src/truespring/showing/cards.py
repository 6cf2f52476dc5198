"""Cards: what a notebook shows of a value, as HTML with a table and a picture.

A card has no colours of its own, so that it fits a light and a dark notebook; pictures have a white ground.
"""

import base64
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from truespring.errors import TruespringError
from truespring.report.sheet import Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from PIL import Image

# Resolution of pictures [pixels/inch], the number of their colours, and their largest width [CSS px].
_DPI, _COLORS, _WIDTH = 110, 96, 480
# Number of rows of a table beyond which the rest is left out.
_MOST_ROWS = 24

_CARD = "max-width:46em;line-height:1.4"
_CELL = "text-align:left;vertical-align:top;padding:1px 12px 1px 0;border:0;white-space:normal"
_PICTURE = "display:block;margin-top:6px;background:#fff;border-radius:6px;max-width:100%;height:auto"


@dataclass(frozen=True)
class Card:
    """A value in a notebook. All texts are escaped.

    Attributes:
        title: what the value is, in bold.
        rows: name and text of its data.
        text: a sentence or several below the title.
        columns, table: a table with the names of its columns; empty without one.
        picture: makes the picture, an image as PNG; None without one.
    """

    title: str
    rows: Sequence[tuple[str, str]] = ()
    text: str = ""
    columns: Sequence[str] = ()
    table: Sequence[Sequence[str]] = ()
    picture: Callable[[], bytes] | None = None

    def html(self) -> str:
        """Return the card as HTML; without a picture if the value cannot be drawn."""
        parts = [f"<b>{escape(self.title)}</b>"]
        parts += [f"<div>{escape(self.text)}</div>"] if self.text else []
        parts += [_table((), self.rows)] if self.rows else []
        parts += [_table(self.columns, self.table)] if self.table else []
        parts += self._pictures()
        return f'<div class="truespring" style="{_CARD}">{"".join(parts)}</div>'

    def _pictures(self) -> list[str]:
        try:
            png = b"" if self.picture is None else self.picture()
        except (TruespringError, MemoryError):
            return []
        if not png:
            return []
        address = base64.b64encode(png).decode()
        return [f'<img alt="" width="{_wide(png)}" style="{_PICTURE}" src="data:image/png;base64,{address}">']


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [_line("th", columns)] if columns else []
    for name, *cells in rows[:_MOST_ROWS]:
        lines.append(f'<tr><th style="{_CELL};font-weight:600">{escape(name)}</th>{_cells("td", cells)}</tr>')
    lines += [_line("td", [f"and {len(rows) - _MOST_ROWS} more"])] if len(rows) > _MOST_ROWS else []
    return f'<table style="border:0;border-collapse:collapse;margin:4px 0 0;font-size:90%">{"".join(lines)}</table>'


def _line(tag: str, cells: Sequence[str]) -> str:
    return f"<tr>{_cells(tag, cells)}</tr>"


def _cells(tag: str, cells: Sequence[str]) -> str:
    return "".join(f'<{tag} style="{_CELL}">{escape(cell)}</{tag}>' for cell in cells)


def _wide(png: bytes) -> int:
    """Return the width of a picture [CSS px], from its pixels in the header of the file."""
    return min(round(int.from_bytes(png[16:20], "big") * 96 / _DPI), _WIDTH)


def png_of_axes(draw: Callable[[], "Axes"]) -> bytes:
    """Return the picture that `draw` makes in a new figure of pyplot, and close that figure.

    Not within `pyplot.ioff`: if pyplot is imported there, its end leaves a notebook without figures.
    """
    from matplotlib import pyplot
    from PIL import Image

    figure = draw().get_figure(root=True)
    assert figure is not None  # axes that were just made
    try:
        file = io.BytesIO()
        figure.savefig(file, format="png", dpi=_DPI, facecolor="white")
    finally:
        pyplot.close(figure)
    return _small(Image.open(file))


def png_of_sheet(sheet: Sheet) -> bytes:
    """Return the picture on a sheet."""
    from PIL import Image

    return _small(Image.fromarray(sheet.pixels(_DPI)))


def _small(image: "Image.Image") -> bytes:
    """Return an image of few colours as PNG, a quarter of the size."""
    file = io.BytesIO()
    image.convert("RGB").quantize(_COLORS).save(file, format="png", optimize=True)
    return file.getvalue()
