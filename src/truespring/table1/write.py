"""Write the results of `truespring table1`: values as JSON, the page and its figures."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from truespring.outputs import Output
from truespring.table1.figure import files
from truespring.table1.page import page


def write_table(table: Mapping[str, Any], folder: Path) -> Path:
    """Write table1.json, table1.md and a figure for each dimension as PNG and SVG into a folder; return the page."""
    with Output(folder, "table1.json") as output:
        _write(table, output.staging)
        output.publish()
    return folder / "table1.md"


def _write(table: Mapping[str, Any], folder: Path) -> None:
    (folder / "table1.json").write_text(json.dumps(table, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    figures = {}
    for dim in sorted({row["dim"] for row in table["rows"]}):
        png, svg = files(table, dim)
        figures[dim] = f"table1_{dim}d.svg"
        (folder / figures[dim]).write_bytes(svg)
        (folder / f"table1_{dim}d.png").write_bytes(png)
    (folder / "table1.md").write_text(page(table, figures), encoding="utf-8")
