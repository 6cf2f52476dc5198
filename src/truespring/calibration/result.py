"""The result of `calibrate`: springs and their errors, as table, figures and files."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from truespring.calibration.figures import calibration_figures
from truespring.calibration.files import write_fitted
from truespring.calibration.fitted import Fitted
from truespring.calibration.page import calibration_values, case_rows
from truespring.outputs import Output
from truespring.report.drawing import Figures, sheets
from truespring.report.rows import table_of
from truespring.showing.cards import Card, png_of_sheet

if TYPE_CHECKING:
    import polars


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(Fitted):
    """Springs fitted to references; the attributes are those of `Fitted`.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> reference = ts.solve(problem, ts.Fem("neo-hookean"))
        >>> case = ts.LoadCase("pulled", problem, reference)
        >>> found = ts.calibrate(case, ts.Springs("isotropic"), evaluations=1)
        >>> found.held_out, found.unknowns.kind
        ((), 'class')
    """

    def __repr__(self) -> str:
        return f"Calibration({self.headline})"

    def _repr_html_(self) -> str:
        """Return the errors as HTML for a notebook: a table and the first figure."""
        figure = next(iter(self.figures().values()))
        columns = ("load", "", "of the", "rule", "calibrated")
        return Card("Calibration", (), self.headline, columns, case_rows(self), partial(png_of_sheet, figure)).html()

    def table(self) -> "polars.DataFrame":
        """Return `rows` as a table of polars."""
        return table_of(self.rows)

    def figures(self) -> Figures:
        """Return the figures by the stem of their files; `png()` and `svg()` return the bytes of a file."""
        return sheets((f"calibration_{name}", sheet) for name, sheet in calibration_figures(self))

    def write(self, out: str | Path, command: str | None = None) -> dict[str, Path]:
        """Write calibrate.json, calibrated.csv, figures and report.html into `out`; return the paths by file name.

        `command` is the command line that repeats the run, for the report.
        """
        what = f"{self.rule.label} with {self.unknowns.counted} by {self.unknowns.kind}."
        with Output(Path(out), "calibrate.json") as output:
            files = write_fitted(self, output.staging, calibration_values(self), ("Calibration", what), (), command)
            output.publish()
        return {file.name: output.folder / file.name for file in files}
