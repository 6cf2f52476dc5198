"""The result of `converge`: a study on finer meshes, as table, figures and files."""

import csv
import json
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truespring.converging.figures import settling_figures
from truespring.converging.page import render_settling, settling_rows
from truespring.converging.settling import Refinement
from truespring.outputs import Output
from truespring.report.drawing import Figures, sheets
from truespring.report.rows import table_of
from truespring.showing.cards import Card, png_of_sheet

if TYPE_CHECKING:
    import polars


@dataclass(frozen=True)
class StudyRefinement(Refinement):
    """The refinement of a study; further attributes are those of `Refinement`.

    Attributes:
        title, file: of the study.
    """

    title: str
    file: Path

    def _repr_html_(self) -> str:
        """Return the watched quantities as HTML for a notebook: a table and the first figure."""
        figures = list(self.figures().values())
        columns = ("model", "", "value", "order", "at h = 0", "error", "")
        picture = partial(png_of_sheet, figures[0]) if figures else None
        return Card(f"Refinement: {self.title}", (), self.sentence, columns, list(settling_rows(self)), picture).html()

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One row per model, watched quantity and mesh, as in converge.csv."""
        return [
            {"model": one.model, "quantity": one.quantity, "unit": one.unit, "n_nodes": count, "value": value}
            for one in self.quantities
            for count, value in zip(one.n_nodes, one.values, strict=True)
        ]

    def table(self) -> "polars.DataFrame":
        """Return `rows` as a table of polars."""
        return table_of(self.rows)

    def figures(self) -> Figures:
        """Return the figures by the stem of their files; `png()` and `svg()` return the bytes of a file."""
        return sheets(settling_figures(self))

    def write(self, out: str | Path, command: str | None = None) -> dict[str, Path]:
        """Write converge.csv, converge.json and the page converge.html into out/STEM; return the paths by file name.

        `command` is the command line that repeats the run, for the page.
        """
        with Output(Path(out) / self.file.stem, "converge.json") as output:
            folder = output.staging
            with (folder / "converge.csv").open("w", newline="", encoding="utf-8") as stream:
                table = csv.writer(stream)
                table.writerow(["model", "quantity", "unit", "n_nodes", "value"])
                table.writerows([*list(row.values())[:-1], repr(row["value"])] for row in self.rows)
            text = (folder / "converge.csv").read_text(encoding="utf-8")
            page = render_settling(self.title, self.file, self, command, text)
            (folder / "converge.html").write_text(page, encoding="utf-8")
            text = json.dumps([asdict(one) for one in self.quantities], indent=1, allow_nan=False)
            (folder / "converge.json").write_text(text + "\n", encoding="utf-8")
            output.publish()
        return {name: output.folder / name for name in ("converge.csv", "converge.json", "converge.html")}


def refined_study(title: str, file: Path, found: Refinement) -> StudyRefinement:
    """Return a refinement with the title and the file of its study."""
    return StudyRefinement(**{one.name: getattr(found, one.name) for one in fields(found)}, title=title, file=file)
