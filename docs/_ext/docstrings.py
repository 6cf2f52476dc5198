"""Sphinx extension: docstrings as they are written, with the signs of their formulas."""

import re
from typing import Any

from docutils import nodes

# Signs that docstrings have in formulas and names, and that reStructuredText would read as marks.
_MARK = re.compile(r"(?<!\\)([*|]|(?<=\w)_(?!\w))")


def _one_name_each(lines: list[str]) -> list[str]:
    """Return the lines with an entry for each name of `first, second: text`, which napoleon takes for name and type."""
    found: list[str] = []
    number = 0
    while number < len(lines):
        entry = re.match(r"^(\s+)(\w+(?:, \w+)+)(: .*)$", lines[number])
        last = number + 1
        if entry:
            while last < len(lines) and lines[last].startswith(entry[1] + " "):
                last += 1
            for name in entry[2].split(", "):
                found += [entry[1] + name + entry[3], *lines[number + 1 : last]]
        else:
            found.append(lines[number])
        number = last
    return found


def _docstring(app: Any, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Keep formulas: outside code, a star, a bar or a final underscore is itself."""
    if what in ("attribute", "property", "data"):
        lines[:0] = ["..", ""]  # an empty comment: napoleon reads what is before a colon of the first line as a type
    lines[:] = _one_name_each(lines)
    code = False
    for number, line in enumerate(lines):
        # Examples and literal blocks are code already.
        code = line.lstrip().startswith((">>>", "...")) or (code and bool(line.strip()))
        if code or line.startswith((".. ", ":")):
            continue
        parts = re.split(r"(``[^`]*``|`[^`]*`|:[a-z]+:`[^`]*`)", line)
        lines[number] = "".join(part if k % 2 else _MARK.sub(r"\\\1", part) for k, part in enumerate(parts))


def _dashes(app: Any, page: nodes.document) -> None:
    """Write a dash between the name of a parameter and its text, where Sphinx has two signs."""
    for text in list(page.findall(nodes.Text)):
        if text.astext() == " -- ":
            text.parent.replace(text, nodes.Text(" \N{EN DASH} "))


def setup(app: Any) -> dict[str, Any]:
    """Connect to the events of a build."""
    app.connect("doctree-read", _dashes)
    # Before napoleon, whose own marks stay.
    app.connect("autodoc-process-docstring", _docstring, priority=100)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
