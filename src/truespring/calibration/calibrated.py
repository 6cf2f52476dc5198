"""The result of `calibrate` for a study: the study with its springs, as table, figures and files."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truespring.calibration.fitted_study import FittedStudy
from truespring.calibration.writing import calibrated_values, write_calibrated
from truespring.report.drawing import Figures

if TYPE_CHECKING:
    import polars


@dataclass(frozen=True, eq=False)
class Calibrated(FittedStudy):
    """A study with calibrated springs; the attributes are those of `FittedStudy`."""

    @property
    def values(self) -> dict[str, Any]:
        """The values of calibrate.json."""
        return calibrated_values(self)

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The errors before and after, one row per case, quantity and level."""
        return self.calibration.rows

    def table(self) -> "polars.DataFrame":
        """Return `rows` as a table of polars."""
        return self.calibration.table()

    def figures(self) -> Figures:
        """Return the figures by the stem of their files; `png()` and `svg()` return the bytes of a file."""
        return self.calibration.figures()

    def write(self, out: str | Path, command: str | None = None) -> dict[str, Path]:
        """Write calibrated.toml, its springs, calibrate.json, figures and report.html into out/STEM; return the paths.

        `command` is the command line that repeats the run, for the report.
        """
        return {file.name: file for file in write_calibrated(self, Path(out), command)}
