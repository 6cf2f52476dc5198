"""The shell of all pages: one environment, one base template, one style sheet. Pages load nothing from the network."""

import base64
import io
import platform
import re
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from truespring.report.drawing import Drawing

if TYPE_CHECKING:
    from jinja2 import Environment

# Pictures larger than this as SVG [bytes] are embedded as PNG.
_LARGEST_SVG = 180_000


def render(template: str, command: str | None, scripts: tuple[str, ...] = (), **values: Any) -> str:
    """Return a page as HTML.

    Args:
        template: file in the package, such as "validity/page.html.j2"; it extends "report/base.html.j2".
        command: the command line that repeats the run; None if the run had none.
        scripts: JavaScript files in the package, embedded in this order after that of all pages.
        **values: variables of the template, among them `title`.
    """
    return (
        _environment()
        .get_template(template)
        .render(
            command=command,
            versions=versions(),
            scripts=[_text(script) for script in ("report/page.js", *scripts)],
            **values,
        )
    )


@cache
def _environment() -> "Environment":
    """Return the environment of all templates; it caches compiled templates."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, loader=FunctionLoader(_text)
    )
    environment.filters["close"] = close
    return environment


def _text(name: str) -> str:
    """Return the text of a file in the package, named with slashes."""
    return files("truespring").joinpath(name).read_text(encoding="utf-8")


def close(text: str) -> str:
    """Return a text with no-break spaces between numbers and units."""
    return re.sub(r"(?<=\d) (?=(?:%|[kMGmµn]?(?:Pa|N|m|s|J))(?:\W|$))", "\N{NO-BREAK SPACE}", text)


def versions() -> list[tuple[str, str]]:
    """Return names and versions of the packages that results depend on, truespring first."""
    found = [("python", platform.python_version())]
    for package in ("truespring", "numpy", "scipy", "scikit-fem"):
        try:
            found.append((package, version(package)))
        except PackageNotFoundError:
            found.append((package, "not installed as a package"))
    return sorted(found, key=lambda one: one[0] != "truespring")


def picture(drawing: Drawing, name: str) -> dict[str, str]:
    """Return the attributes of an <img>: address (a data URL), width [CSS px], title, and the stem of its file."""
    if len(drawing.svg) <= _LARGEST_SVG:
        address = "data:image/svg+xml," + quote(
            drawing.svg.decode().replace("\n", " ").replace('"', "'"), safe=" =:/;,'()!*?"
        )
    else:
        address = "data:image/png;base64," + base64.b64encode(_smaller(drawing.png)).decode()
    return {"address": address, "width": f"{96 * drawing.width:.0f}", "title": drawing.title, "name": name}


def pictures(drawings: Mapping[str, Drawing], stem: str) -> list[dict[str, str]]:
    """Return the attributes of the <img> of each of several figures; `stem` begins the names of their files."""
    return [picture(drawing, f"{stem}_{name}") for name, drawing in drawings.items()]


def _smaller(png: bytes) -> bytes:
    """Return a PNG file with 256 colours, a quarter as large."""
    from PIL import Image

    if not png:
        return png
    file = io.BytesIO()
    with Image.open(io.BytesIO(png)) as image:
        few = image.convert("RGB").quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    few.save(file, format="png", compress_level=9)
    return file.getvalue()
