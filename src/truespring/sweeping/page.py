"""A sweep as a table for a terminal and as a page."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truespring.report.downloads import table_download
from truespring.report.drawing import drawings
from truespring.report.quantity import percent, quantity
from truespring.report.rows import table_of
from truespring.report.shell import pictures, render
from truespring.sweeping.figures import models_of, moved, sweep_figures

if TYPE_CHECKING:
    from rich.table import Table

Row = Mapping[str, Any]

# Largest number of rows on a page; sweep.csv has all of them.
_MOST_ROWS = 300


def sweep_table(keys: Sequence[str], rows: Sequence[Row]) -> "Table":
    """Return a table of the smallest and largest rms error against each reference, with their points."""
    from rich.table import Table

    failed = sum(row["status"] != "converged" for row in rows)
    title = f"{len(rows)} points" + (f", {failed} failed" if failed else ", all converged")
    table = Table(title=title, title_justify="left")
    table.add_column("rms error against")
    table.add_column("")
    table.add_column("", justify="right")
    table.add_column("point")
    for reference, extremes in _extremes(rows).items():
        for which, row in extremes.items():
            value = f"{row[_error_of(reference)]:.2%}"
            table.add_row(reference, which, value, ", ".join(f"{key} = {_words(row[key])}" for key in keys))
    return table


def _error_of(reference: str) -> str:
    return f"comparison.{reference}.rms_error"


def _extremes(rows: Sequence[Row]) -> dict[str, dict[str, Row]]:
    """Return the rows with the smallest and the largest rms error of converged points, by reference."""
    references = [
        column.split(".")[1] for column in rows[0] if column.startswith("comparison.") and column.endswith(".rms_error")
    ]
    found = {}
    for reference in references:
        column = _error_of(reference)
        known = [row for row in rows if row["status"] == "converged" and row[column] is not None]
        if known:
            by_error = sorted(known, key=lambda row: float(row[column]))
            found[reference] = {"smallest": by_error[0], "largest": by_error[-1]}
    return found


def render_sweep(file: Path, title: str | None, keys: Sequence[str], rows: Sequence[Row], command: str | None) -> str:
    """Return the page as HTML.

    Args:
        file, title: of the study.
        keys: the varied keys.
        rows: one per point, as in the table.
        command: the command line that repeats the run, if there is one.
    """
    drawn = drawings((str(number), sheet) for number, sheet in enumerate(sweep_figures(keys, rows)))
    failed = [row for row in rows if row["status"] != "converged"]
    extremes = _extremes(rows)
    return render(
        "sweeping/page.html.j2",
        command,
        title=title or file.stem,
        file=str(file),
        keys=keys,
        n_points=len(rows),
        n_failed=len(failed),
        sentences=[_sentence(reference, two, keys) for reference, two in extremes.items()],
        failed=[([_words(row[key]) for key in keys], row["reason"]) for row in failed[:_MOST_ROWS]],
        pictures=pictures(drawn, f"{file.stem}_sweep"),
        references=list(extremes),
        models=models_of(rows),
        rows=[_shown(row, keys, list(extremes), models_of(rows)) for row in rows[:_MOST_ROWS]],
        downloads=[table_download(f"{file.stem}_sweep.csv", table_of(rows).write_csv(), "all values of all points")],
    )


def _sentence(reference: str, two: Mapping[str, Row], keys: Sequence[str]) -> str:
    least, most = (two[which] for which in ("smallest", "largest"))
    column = _error_of(reference)
    if least[column] == most[column]:
        return f"Against {reference} the rms error is {percent(least[column])} at every point."
    places = (", ".join(f"{key} = {_words(row[key])}" for key in keys) for row in (least, most))
    low, high = (f"{percent(row[column])} at {place}" for row, place in zip((least, most), places, strict=True))
    return f"Against {reference} the rms error is from {low} to {high}."


def _shown(row: Row, keys: Sequence[str], references: Sequence[str], models: Sequence[str]) -> dict[str, Any]:
    moves = (moved(row, f"models.{name}.") for name in models)
    errors = (row[_error_of(reference)] for reference in references)
    return {
        "values": [_words(row[key]) for key in keys],
        "status": row["status"],
        "moves": ["–" if move is None else quantity(move, "m") for move in moves],
        "errors": ["–" if error is None else percent(error) for error in errors],
        "closest": row["closest"] or "–",
    }


def _words(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
