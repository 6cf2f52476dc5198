"""The shell of all pages: one environment, one base template, one style sheet. A page loads nothing from a network."""

import base64
import platform
import re
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from truespring.report.drawing import Drawing

if TYPE_CHECKING:
    from jinja2 import Environment

#: A picture of more bytes as SVG than this is embedded as PNG.
_LARGEST_SVG = 180_000


def render(template: str, command: str | None, scripts: tuple[str, ...] = (), **values: Any) -> str:
    """Return a page as HTML.

    Args:
        template: its file below the package, such as "validity/page.html.j2"; it extends "report/base.html.j2".
        command: the command line that repeats the run, None where there was none.
        scripts: files of JavaScript below the package, embedded in this order.
        **values: what the template names; `title` among them.
    """
    return (
        _environment()
        .get_template(template)
        .render(command=command, versions=versions(), scripts=[_text(script) for script in scripts], **values)
    )


@cache
def _environment() -> "Environment":
    """Return the environment of all templates, which keeps those that it has compiled."""
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, loader=FunctionLoader(_text)
    )
    environment.filters["close"] = close
    return environment


def _text(name: str) -> str:
    """Return the text of a file below the package, named with slashes."""
    return files("truespring").joinpath(name).read_text(encoding="utf-8")


def close(text: str) -> str:
    """Keep a number and its unit on one line."""
    return re.sub(r"(?<=\d) (?=(?:%|[kMGmµn]?(?:Pa|N|m))(?:\W|$))", "\N{NO-BREAK SPACE}", text)


def versions() -> list[tuple[str, str]]:
    """Return the packages that a result depends on and their versions, truespring first."""
    found = [("python", platform.python_version())]
    for package in ("truespring", "numpy", "scipy", "scikit-fem"):
        try:
            found.append((package, version(package)))
        except PackageNotFoundError:
            found.append((package, "not installed as a package"))
    return sorted(found, key=lambda one: one[0] != "truespring")


def picture(drawing: Drawing) -> dict[str, str]:
    """Return what an <img> needs: address (a data URL), width [CSS px] and title of a picture."""
    if len(drawing.svg) <= _LARGEST_SVG:
        address = "data:image/svg+xml," + quote(
            drawing.svg.decode().replace("\n", " ").replace('"', "'"), safe=" =:/;,'()!*?"
        )
    else:
        address = "data:image/png;base64," + base64.b64encode(drawing.png).decode()
    return {"address": address, "width": f"{96 * drawing.width:.0f}", "title": drawing.title}
