"""Sphinx extension: parts of pages that are made from the program.

A fenced block ```` ```{generated} NAME ```` of a page is replaced by the text of an entry of PARTS.
"""

import re
from pathlib import Path
from typing import Any

from commands import commands
from public_names import public_names, write_pages
from sources import rule_sources
from study_keys import study_keys

#: The parts by their names.
PARTS = {"commands": commands, "public-names": public_names, "sources": rule_sources, "study-keys": study_keys}

_BLOCK = re.compile(r"^```\{generated\} ([a-z-]+)\n```$", re.MULTILINE)


def _read(app: Any, name: str, source: list[str]) -> None:
    if _BLOCK.search(source[0]):
        app.env.note_reread()  # the program may have changed
        source[0] = _BLOCK.sub(lambda block: PARTS[block[1]](), source[0])


def _pages(app: Any) -> None:
    write_pages(Path(app.srcdir) / "reference" / "api")


def setup(app: Any) -> dict[str, Any]:
    """Connect to the events of a build."""
    app.connect("builder-inited", _pages)
    app.connect("source-read", _read)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
