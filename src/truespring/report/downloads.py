"""What a reader takes from a page without a network: tables as CSV, the animation, all inside the page."""

import base64
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from truespring.reactions import moved_supports
from truespring.report.curves import write_curves, write_reactions
from truespring.report.histories import write_histories
from truespring.report.result import Result

#: Bytes of the animation of a study by file name.
Films = Mapping[str, bytes]

# Files larger than this are not part of a page [bytes].
_LARGEST_TABLE, _LARGEST_FILM = 300_000, 3_000_000

_TYPES = {".csv": "text/csv", ".gif": "image/gif", ".mp4": "video/mp4"}
_CONTENTS = {
    "curves.csv": "displacement of the probe and force of each model at each level",
    "motion.csv": "displacement and velocity of the probe, and force, of each model over time",
    "energies.csv": "energies of each model over time",
    "tools.csv": "place, force and depth of each tool and grasp",
    "reactions.csv": "force and torque of each moved support",
    "animation.gif": "animation, for slides and web pages",
    "animation.mp4": "animation, for players and editors of films",
}


@dataclass(frozen=True, slots=True)
class Download:
    """A file that a page offers.

    Attributes:
        name: the name under which it is saved.
        address: a data URL; empty if the file is too large for the page.
        size: in words.
        contents: what the file holds.
    """

    name: str
    address: str
    size: str
    contents: str


def films_in(folder: Path) -> Films:
    """Return the animation in the output folder of a study, by file name; empty without one."""
    files = (folder / f"animation{ending}" for ending in (".gif", ".mp4"))
    return {file.name: file.read_bytes() for file in files if file.exists()}


def downloads(result: Result, films: Films) -> list[Download]:
    """Return the tables of a result, as its output folder has them, and its animation unless the page shows it."""
    with TemporaryDirectory(prefix="truespring-") as place:
        folder = Path(place)
        write_curves(result, folder / "curves.csv")
        write_histories(result, folder)
        if moved_supports(result.problem):
            write_reactions(result, folder / "reactions.csv")
        tables = {file.name: file.read_bytes() for file in sorted(folder.iterdir())}
    several = [_download(f"{result.stem}_{name}", content, _CONTENTS[name]) for name, content in tables.items()]
    shown = () if moving_picture(result, films) is None else ("animation.gif",)  # saved by its button
    for name, content in films.items():
        if name not in shown:
            one = _download(f"{result.stem}_{name}", content, _CONTENTS[name])
            several.append(one if one.address else replace(one, name=name))
    return several


def table_download(name: str, text: str, contents: str) -> Download:
    """Return a CSV file; `contents` says what it holds."""
    return _download(name, text.encode(), contents)


def moving_picture(result: Result, films: Films) -> dict[str, str] | None:
    """Return the attributes of an <img> with the animation; None without one, or if it is too large."""
    gif = films.get("animation.gif", b"")
    if not 0 < len(gif) <= _LARGEST_FILM:
        return None
    title = f"{result.title}: animation over all levels"
    return {"address": _address("animation.gif", gif), "title": title, "width": "", "name": f"{result.stem}_animation"}


def _download(name: str, content: bytes, contents: str) -> Download:
    most = _LARGEST_TABLE if name.endswith(".csv") else _LARGEST_FILM
    address = _address(name, content) if len(content) <= most else ""
    return Download(name, address, _size(len(content)), contents)


def _address(name: str, content: bytes) -> str:
    return f"data:{_TYPES[Path(name).suffix]};base64,{base64.b64encode(content).decode()}"


def _size(count: int) -> str:
    """Return a number of bytes in words."""
    return f"{count / 1e6:.1f} MB" if count >= 1e6 else f"{max(1, round(count / 1e3))} kB"
