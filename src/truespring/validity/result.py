"""The result of `map_validity`: maps and their verdicts, as table, figures and files."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truespring.report.drawing import Figures, sheets
from truespring.report.rows import table_of
from truespring.showing.cards import Card, png_of_sheet
from truespring.validity.figures import figures
from truespring.validity.maps import Maps
from truespring.validity.sentences import verdict
from truespring.validity.writing import rows, write_validity

if TYPE_CHECKING:
    import polars


@dataclass(frozen=True, eq=False, repr=False)
class Validity(Maps):
    """Maps of a study; the attributes are those of `Maps`.

    Example:
        >>> import truespring as ts
        >>> study = ts.read_study(ts.new("strip", "strip.toml"), **{"mesh.elements": [4, 1], "solver.load_steps": 2})
        >>> options = {"law": "linear", "loads": ["stretch"], "rules": ["lloyd"], "y": None}
        >>> found = ts.map_validity(study, ranges={"load": (0, 0.1)}, **options)
        >>> found.converged, list(found.figures())
        (True, ['validity_stretch_lloyd'])
    """

    def __repr__(self) -> str:
        drawn = ", ".join(f"{one.load.name}: {one.rule.name}" for one in self.maps)
        return f"Validity({self.title!r}, {drawn}, against {self.law} FEM)"

    @property
    def verdicts(self) -> list[str]:
        """For each map, up to which load its springs agree with the reference, in sentences."""
        return [verdict(self, one) for one in self.maps]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """One row per load level of each path of springs, as in validity.csv."""
        return list(rows(self))

    def _repr_html_(self) -> str:
        """Return the verdicts and the first figure as HTML for a notebook."""
        figures = list(self.figures().values())
        rows = [(f"{one.load.name}, {one.rule.name}", text) for one, text in zip(self.maps, self.verdicts, strict=True)]
        picture = partial(png_of_sheet, figures[0]) if figures else None
        return Card(f"Validity: {self.title}", rows, picture=picture).html()

    def table(self) -> "polars.DataFrame":
        """Return `rows` as a table of polars."""
        return table_of(self.rows)

    def figures(self) -> Figures:
        """Return the figures by the stem of their files; `png()` and `svg()` return the bytes of a file."""
        return sheets(figures(self))

    def write(self, out: str | Path, command: str | None = None) -> dict[str, Path]:
        """Write validity.json, validity.csv, figures and report.html into out/STEM; return the paths by file name.

        `command` is the command line that repeats the run, for the report.
        """
        return write_validity(self, Path(out), command)
