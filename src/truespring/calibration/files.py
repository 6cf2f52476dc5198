"""The files of a calibration: springs as CSV, values as JSON, figures and a page."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from truespring.calibration.figures import calibration_figures
from truespring.calibration.fitted import Fitted
from truespring.calibration.page import render_calibration
from truespring.report.drawing import drawings, save_drawings

#: The name of the calibrated springs in files.
NAME = "calibrated"


def write_fitted(
    found: Fitted,
    folder: Path,
    values: Mapping[str, Any],
    words: tuple[str, str],
    more: Sequence[str],
    command: str | None,
) -> tuple[Path, ...]:
    """Write springs, values, figures and page into a folder; return the files, the page last.

    Args:
        found: the calibration.
        folder: an existing folder.
        values: those of calibrate.json.
        words: the title of the page, and a sentence on what was fitted to what.
        more: names of further files that the page lists.
        command: the command line that repeats the run.
    """
    tables = found.unknowns.write(found.values, folder / f"{NAME}.csv", folder / f"{NAME}_volume.csv")
    file, page = folder / "calibrate.json", folder / "report.html"
    file.write_text(json.dumps(values, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    drawn = drawings(calibration_figures(found))
    save_drawings({f"calibration_{name}": drawing for name, drawing in drawn.items()}, folder / "figures")
    names = [*more, *(table.name for table in tables), file.name]
    page.write_text(render_calibration(*words, found, drawn, names, command), encoding="utf-8")
    return *tables, file, page
