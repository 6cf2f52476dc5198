"""A refinement as rows, as a table for a terminal and as a page."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from truespring.converging.figures import settling_figures
from truespring.converging.settling import Refinement
from truespring.report.downloads import table_download
from truespring.report.drawing import drawings
from truespring.report.shell import pictures, render
from truespring.report.tables import new_table

if TYPE_CHECKING:
    from rich.table import Table


def settling_rows(found: Refinement) -> Iterator[tuple[str, ...]]:
    """Yield model, quantity, value, order, extrapolated value, error, and settled, zero or the status, as text."""
    statuses = {one.model: one.status for one in found.last if not one.sound}
    for one in found.quantities:
        order = "-" if one.order is None else f"{one.order:.2f}"
        limit = "-" if one.extrapolated is None else f"{one.extrapolated:.6g}"
        error = "-" if one.error is None else f"{one.error:.2%}"
        value = f"{one.values[-1]:.6g} {one.unit}"
        state = "zero" if one.zero else "settled" if one.settled else statuses.get(one.model, "")
        yield one.model, one.quantity, value, order, limit, error, state


def settling_table(title: str, found: Refinement) -> "Table":
    """Return a table of the watched quantities: value, order, extrapolated value, error and state."""
    table = new_table(title, "model", "", "value", "order", "at h = 0", "error", "")
    for row in settling_rows(found):
        table.add_row(*row)
    return table


def _mesh_rows(found: Refinement) -> Iterator[tuple[str, str, Sequence[str]]]:
    """Yield model, quantity with its unit, and the value on each mesh as text."""
    for one in found.nonzero:
        known = dict(zip(one.n_nodes, one.values, strict=True))
        yield one.model, f"{one.quantity} [{one.unit}]", [_known(known.get(count)) for count in found.n_nodes]


def _known(value: float | None) -> str:
    return "–" if value is None else f"{value:.6g}"


def render_settling(title: str, file: Path, found: Refinement, command: str | None, table: str) -> str:
    """Return the page as HTML.

    Args:
        title, file: of the study.
        found: the refinement.
        command: the command line that repeats the run.
        table: the text of converge.csv.
    """
    return render(
        "converging/page.html.j2",
        command,
        title=title,
        file=str(file),
        sentence=found.sentence,
        settled=found.settled,
        n_nodes=", ".join(f"{count:,}" for count in found.n_nodes),
        meshes=[f"{count:,}" for count in found.n_nodes],
        mesh_rows=list(_mesh_rows(found)),
        downloads=[table_download(f"{file.stem}_converge.csv", table, "value of each watched quantity on each mesh")],
        troubles=[
            f"{one.model} on {one.n_nodes:,} nodes: {one.status}, up to load factor {one.load_factor:.4g}; {one.advice}"
            for one in found.attempts
            if not one.sound
        ],
        pictures=pictures(drawings(settling_figures(found)), file.stem),
        rows=list(settling_rows(found)),
    )
