"""Run the tutorials and write one picture of each, for the cards of docs/tutorials/index.md.

Run it with the documentation dependencies installed: python docs/build_thumbnails.py [NAME ...]
"""

import base64
import io
import sys
import tempfile
from pathlib import Path
from typing import Any

TUTORIALS = Path(__file__).parent / "tutorials"
PICTURES = Path(__file__).parent / "images" / "tutorials"

#: Which picture of a notebook, counted from 0; the first one unless stated.
CHOSEN = {"strip": 1, "organ": 1, "gaussian": 0, "live": 1}

# Width and height of a card's picture [pixels].
_SIZE = (480, 270)


def pictures(page: Path) -> list[bytes]:
    """Run a notebook and return its pictures."""
    import jupytext
    from nbclient import NotebookClient

    notebook = jupytext.read(page)
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        NotebookClient(notebook, timeout=300, kernel_name="python3", resources=resources).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", ())]
    return [base64.b64decode(one["data"]["image/png"]) for one in outputs if "image/png" in one.get("data", {})]


def card(picture: bytes) -> Any:
    """Return a picture without its margins, fitted into the size of a card on white."""
    from PIL import Image, ImageChops

    whole = Image.open(io.BytesIO(picture)).convert("RGB")
    ink = ImageChops.difference(whole, Image.new("RGB", whole.size, "white")).getbbox()
    inner = whole.crop(ink)
    inner.thumbnail((_SIZE[0] - 20, _SIZE[1] - 20), Image.Resampling.LANCZOS)
    shown = Image.new("RGB", _SIZE, "white")
    shown.paste(inner, ((_SIZE[0] - inner.width) // 2, (_SIZE[1] - inner.height) // 2))
    return shown.quantize(64)


def main(names: list[str]) -> None:
    PICTURES.mkdir(parents=True, exist_ok=True)
    for page in sorted(TUTORIALS.glob("*.md")):
        if page.name == "index.md" or (names and page.stem not in names):
            continue
        card(pictures(page)[CHOSEN.get(page.stem, 0)]).save(PICTURES / f"{page.stem}.png", optimize=True)


if __name__ == "__main__":
    main(sys.argv[1:])
