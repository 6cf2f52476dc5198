"""Sphinx extension: each MyST notebook can be downloaded as .ipynb from the top of its page."""

import re
from pathlib import Path
from typing import Any

# A link of markdown to a file of these pages, with its place in the file.
_LINK = re.compile(r"\]\((?!https?:|#)([^)#\s]+)(#[^)]*)?\)")

_BUTTON = """
```{{raw}} html
<p><a class="btn btn-outline-primary btn-sm" href="{name}.ipynb" download>Download as a notebook</a></p>
```
"""


def is_notebook(text: str) -> bool:
    """Return whether the header of a page names a kernel."""
    header = re.match(r"---\n(.*?)\n---\n", text, re.DOTALL)
    return header is not None and "kernelspec:" in header[1]


def with_button(text: str, name: str) -> str:
    """Return a page with a link to its notebook under the title."""
    return re.sub(r"^# .*\n", lambda title: title[0] + _BUTTON.format(name=name), text, count=1, flags=re.MULTILINE)


def with_addresses(text: str, folder: str, address: str) -> str:
    """Return a page whose links to other pages lead to the site; unchanged if the site has no address."""
    if not address:
        return text

    def absolute(link: re.Match[str]) -> str:
        parts: list[str] = []
        for part in f"{folder}/{link[1]}".split("/"):
            if part == "..":
                parts.pop()
            elif part not in ("", "."):
                parts.append(part)
        target = re.sub(r"\.md$", ".html", "/".join(parts))
        return f"]({address.rstrip('/')}/{target}{link[2] or ''})"

    return _LINK.sub(absolute, text)


def _read(app: Any, name: str, source: list[str]) -> None:
    if is_notebook(source[0]):
        source[0] = with_button(source[0], name.rsplit("/", 1)[-1])


def _write(app: Any, error: Exception | None) -> None:
    """Write the notebooks, without outputs, beside their pages."""
    if error is not None or app.builder.format != "html":
        return
    import jupytext

    for name in app.env.found_docs:
        page = Path(app.env.doc2path(name))
        if page.suffix != ".md":
            continue
        text = page.read_text(encoding="utf-8")
        if is_notebook(text):
            file = Path(app.outdir) / f"{name}.ipynb"
            file.parent.mkdir(parents=True, exist_ok=True)
            folder = name.rpartition("/")[0]
            content = jupytext.reads(with_addresses(text, folder, app.config.html_baseurl), fmt="md:myst")
            jupytext.write(content, file)


def setup(app: Any) -> dict[str, Any]:
    """Connect to the events of a build."""
    app.connect("source-read", _read)
    app.connect("build-finished", _write)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
