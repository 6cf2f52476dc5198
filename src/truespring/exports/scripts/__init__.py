"""Scripts that are written beside exported files, as templates: NAME.py.in with the header of the study."""

import textwrap
from collections.abc import Iterable
from importlib.resources import files

from truespring.exports.exported import Exported

_HEADER = "HEADER"


def script(name: str, exported: Exported) -> str:
    """Return the script NAME.py.in, the header of the study in its docstring."""
    text = (files("truespring.exports.scripts") / f"{name}.py.in").read_text(encoding="utf-8")
    return text.replace(_HEADER, "\n".join(docstring(exported.header)), 1)


def docstring(sentences: Iterable[str]) -> list[str]:
    """Return sentences as lines for a docstring."""
    lines: list[str] = []
    for sentence in sentences:
        safe = sentence.replace("\\", "/").replace('"', "'")
        lines += textwrap.wrap(safe, 110, subsequent_indent="    ", break_long_words=False) or [""]
    return lines
