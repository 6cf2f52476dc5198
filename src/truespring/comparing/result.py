"""The result of `compare`: one or more results against a reference, as table, figures and files."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truespring.outputs import Output, write_whole
from truespring.report.curves import write_curves
from truespring.report.drawing import Figures
from truespring.report.result import Result
from truespring.report.rows import table_of
from truespring.report.series import write_difference
from truespring.report.summary import difference

if TYPE_CHECKING:
    import polars

_FILES = ("comparison.json", "curves.csv", "difference.vtu", "figures", "report.html")


@dataclass(frozen=True, eq=False, repr=False)
class Comparisons:
    """Results compared with the same reference; iterate over it for each.

    Attributes:
        results: one for each source but the first.
    """

    results: tuple[Result, ...]

    def __repr__(self) -> str:
        return f"Comparisons({[result.title for result in self.results]})"

    def __iter__(self) -> Iterator[Result]:
        """Iterate over the results."""
        return iter(self.results)

    def __len__(self) -> int:
        """Return the number of results."""
        return len(self.results)

    @property
    def converged(self) -> bool:
        """Whether every solved path reached full load through stable equilibria."""
        return all(result.converged for result in self.results)

    @property
    def values(self) -> dict[str, dict[str, Any]]:
        """The values of comparison.json of each result, by the name of its source."""
        return {one["model"]: one for one in map(difference, self.results)}

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The differences at each common load level, one row per result and level."""
        return [
            {"model": one["model"], "reference": one["reference"], **level}
            for one in self.values.values()
            for level in one["levels"]
        ]

    def table(self) -> "polars.DataFrame":
        """Return `rows` as a table of polars."""
        return table_of(self.rows)

    def figures(self) -> Figures:
        """Return the figures by the stem of their files, of several results with the folder of each in front."""
        from truespring.report.figures import draw_figures

        alone = len(self.results) == 1
        return {
            name if alone else f"{result.file}/{name}": sheet
            for result in self.results
            for name, sheet in draw_figures(result).items()
        }

    def write(self, out: str | Path, command: str | None = None) -> dict[str, Path]:
        """Write comparison.json, curves.csv, difference.vtu, figures and report.html into `out`; return their paths.

        The files of several results are written into a folder each, with a common report.html in `out`. `command` is
        the command line that repeats the run, for the report.
        """
        out = Path(out)
        if len(self.results) == 1:
            return _write(self.results[0], out, command)
        from truespring.report.page import render_page

        written = {
            f"{result.file}/{name}": file
            for result in self.results
            for name, file in _write(result, out / result.file, command).items()
        }
        write_whole(out / "report.html", render_page(self.results, command).encode())
        return {**written, "report.html": out / "report.html"}


def _write(result: Result, folder: Path, command: str | None) -> dict[str, Path]:
    """Write the files of one result into a folder; return those that exist."""
    from truespring.report.figures import save_figures
    from truespring.report.page import write_page

    with Output(folder, "comparison.json") as output:
        text = json.dumps(difference(result), indent=2, allow_nan=False)
        (output.staging / "comparison.json").write_text(text + "\n", encoding="utf-8")
        write_curves(result, output.staging / "curves.csv")
        write_difference(next(iter(result.comparisons.values())), output.staging / "difference.vtu")
        save_figures(result, output.staging / "figures")
        write_page([result], output.staging / "report.html", command)
        output.publish()
    return {name: folder / name for name in _FILES if (folder / name).exists()}
