"""The results of a sweep, as rows, table, figures and files."""

import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truespring.outputs import Output
from truespring.report.drawing import Figures, sheets
from truespring.report.rows import table_of
from truespring.showing.cards import Card, png_of_sheet
from truespring.sweeping.figures import sweep_figures
from truespring.sweeping.plan import Plan
from truespring.sweeping.store import FAILED
from truespring.sweeping.table import rows_of, write_table

if TYPE_CHECKING:
    import polars


@dataclass(frozen=True, eq=False, repr=False)
class Sweep:
    """The results of a sweep.

    Attributes:
        plan: the study and its points.
        records: of each point, by name, in the order of the plan.
        n_before: number of points solved by earlier runs.
        notes: messages on duplicate points and existing records.

    Example:
        >>> import truespring as ts
        >>> study = ts.read_study(ts.new("strip", "strip.toml"), **{"mesh.elements": [4, 1], "solver.load_steps": 2})
        >>> vary = {"mesh.elements": [[2, 1], [4, 1]], "compare.refine": [False]}
        >>> found = ts.sweep("strip.toml", vary, workers=1)
        >>> [row["models.springs.n_nodes"] for row in found.rows]
        [6, 10]
    """

    plan: Plan
    records: Mapping[str, Mapping[str, Any]]
    n_before: int
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        counted = f"{len(self.records)} points, {self.n_failed} failed"
        return f"Sweep({str(self.plan.text.file)!r} over {', '.join(self.plan.keys)}: {counted})"

    def _repr_html_(self) -> str:
        """Return the varied values, status and errors as HTML for a notebook: a table and the first figure."""
        figures = list(self.figures().values())
        errors = sorted({key for row in self.rows for key in row if key.endswith(".rms_error")})
        columns = (*self.plan.keys, "status", *errors)
        table = [[_cell(row.get(key)) for key in columns] for row in self.rows]
        picture = partial(png_of_sheet, figures[0]) if figures else None
        return Card("Sweep", (), repr(self), columns, table, picture).html()

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """One row per point, sorted by the varied values."""
        return rows_of(self.plan.keys, self.records.values())

    @property
    def n_failed(self) -> int:
        """Number of points without a complete result."""
        return sum(record["status"] == FAILED for record in self.records.values())

    @property
    def converged(self) -> bool:
        """Whether every model of every point reached full load through stable equilibria."""
        return not self.n_failed

    def table(self) -> "polars.DataFrame":
        """Return `rows` as a table of polars."""
        return table_of(self.rows)

    def figures(self) -> Figures:
        """Return the figures by the stem of their files; `png()` and `svg()` return the bytes of a file."""
        drawn = sweep_figures(self.plan.keys, self.rows)
        return sheets((f"sweep_{number}", sheet) for number, sheet in enumerate(drawn, 1))

    def write(self, out: str | Path, command: str | None = None) -> dict[str, Path]:
        """Write sweep.csv, sweep.parquet and report.html into `out`; return the paths by file name.

        `command` is the command line that repeats the run, for the report.
        """
        folder = write_sweep(self, Path(out), command).parent
        return {name: folder / name for name in ("sweep.csv", "sweep.parquet", "report.html")}

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the table, which `ts.sweep` returned in 0.1, with a DeprecationWarning."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._as_table(f".{name}"), name)

    def __getitem__(self, key: Any) -> Any:
        return self._as_table(f"[{key!r}]")[key]

    def __len__(self) -> int:
        return len(self._as_table())

    def __iter__(self) -> Iterator[Any]:
        return iter(self._as_table())

    def __contains__(self, key: Any) -> bool:
        return key in self._as_table()

    def __bool__(self) -> bool:
        return True

    def _as_table(self, access: str = "") -> "polars.DataFrame":
        text = f"ts.sweep(...){access} as a table is deprecated, use ts.sweep(...).table(){access}"
        warnings.warn(text, DeprecationWarning, stacklevel=3)
        return self.table()


def _cell(value: Any) -> str:
    """Return a value of a row as text for a notebook."""
    return "–" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


def write_sweep(done: Sweep, out: Path, command: str | None = None) -> Path:
    """Write sweep.csv, sweep.parquet and report.html; return the first.

    `command` is the command line that repeats the run, for the report.
    """
    from truespring.sweeping.page import render_sweep

    page = render_sweep(done.plan.text.file, done.plan.text.document.get("title"), done.plan.keys, done.rows, command)
    with Output(out, "sweep.csv") as output:
        write_table(done.rows, output.staging)
        (output.staging / "report.html").write_text(page, encoding="utf-8")
        output.publish()
    return out / "sweep.csv"
