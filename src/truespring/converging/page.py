"""A refinement as rows, as a table for a terminal and as a page."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from truespring.converging.settling import Refinement, Settling
from truespring.report.drawing import drawings
from truespring.report.plots import Curve, plot
from truespring.report.sheet import Sheet
from truespring.report.shell import pictures, render
from truespring.report.style import SPRING_STYLES
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


def render_settling(title: str, file: Path, found: Refinement, command: str | None) -> str:
    """Return the page as HTML; `command` is the command line that repeats the run."""
    return render(
        "converging/page.html.j2",
        command,
        title=title,
        file=str(file),
        sentence=found.sentence,
        settled=found.settled,
        n_nodes=", ".join(f"{count:,}" for count in found.n_nodes),
        troubles=[
            f"{one.model} on {one.n_nodes:,} nodes: {one.status}, up to load factor {one.load_factor:.4g}; {one.advice}"
            for one in found.attempts
            if not one.sound
        ],
        pictures=pictures(drawings(settling_figures(found)), file.stem),
        rows=list(settling_rows(found)),
    )


def settling_figures(found: Refinement) -> Iterator[tuple[str, Sheet]]:
    """Yield the figure of each quantity over its limit by mesh; none with fewer than two meshes."""
    several = [one for one in found.nonzero if len(one.values) > 1]
    if not several:
        return
    curves = []
    for place, one in enumerate(several):
        meshes = np.array([found.n_nodes.index(count) + 1.0 for count in one.n_nodes])
        shares = 100 * np.array(one.values) / _limit(one)
        style = SPRING_STYLES[place % len(SPRING_STYLES)]
        curves.append(Curve(meshes, shares, *style, label=f"{one.quantity}\n{one.model}", strong=False))
    yield "converge", plot("Watched quantities over their limits", "mesh", "share [%]", curves, far=True).sheet


def _limit(one: Settling) -> float:
    """Return the extrapolated value of a quantity, else its last value."""
    return one.values[-1] if one.extrapolated is None else one.extrapolated
