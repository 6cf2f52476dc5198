"""Sphinx extension: placeholders of thumbnails, left by a quick build, do not hide the films of the whole build."""

from pathlib import Path
from typing import Any

_BEFORE, _AFTER = "sphx_glr_", "_thumb.png"


def stale(gallery: Path) -> list[Path]:
    """Return the thumbnails of scripts that did not run: sphinx-gallery writes NAME.py.md5 when it has run NAME.py."""
    return [
        thumb
        for thumb in sorted(gallery.rglob(f"{_BEFORE}*{_AFTER}"))
        if not (thumb.parents[2] / f"{thumb.name.removeprefix(_BEFORE).removesuffix(_AFTER)}.py.md5").exists()
    ]


def _remove(app: Any, config: Any) -> None:
    if not app.tags.has("quick"):
        for thumb in stale(Path(app.srcdir) / "gallery"):
            thumb.unlink()


def setup(app: Any) -> dict[str, bool]:
    """Connect the events."""
    app.connect("config-inited", _remove)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
