"""Figures as the bytes of PNG and SVG files, drawn in one style."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from truespring.report.sheet import Sheet
from truespring.report.style import figure_style

#: Figures by the stem of their file names.
Figures = dict[str, Sheet]


@dataclass(frozen=True, slots=True)
class Drawing:
    """A figure as the bytes of its two files, with its title (the alternative text) and its width [inch].

    `note` is a remark on how it was drawn, mostly empty.
    """

    png: bytes
    svg: bytes
    title: str
    width: float
    note: str = ""


def sheets(named: Iterable[tuple[str, Sheet]]) -> Figures:
    """Return figures by name, drawn in the common style."""
    with figure_style():
        return dict(named)


def drawings(named: Iterable[tuple[str, Sheet]]) -> dict[str, Drawing]:
    """Return figures as the bytes of their files, by name, drawn in the common style."""
    with figure_style():
        return {name: drawing_of(sheet) for name, sheet in named}


def drawing_of(sheet: Sheet, note: str = "") -> Drawing:
    """Return a sheet as the bytes of its files."""
    return Drawing(sheet.png(), sheet.svg(), sheet.title, sheet.width, note)


def save_drawings(several: Mapping[str, Drawing], folder: Path) -> None:
    """Write figures as PNG and SVG into a folder; create it if it does not exist."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, drawing in several.items():
        (folder / f"{name}.png").write_bytes(drawing.png)
        (folder / f"{name}.svg").write_bytes(drawing.svg)
