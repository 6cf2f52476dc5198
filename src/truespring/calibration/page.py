"""A calibration as a table for a terminal, as JSON values, and as a page."""

import csv
import io
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.calibration.figures import calibration_figures
from truespring.calibration.fitted import CaseResult, Fitted
from truespring.report.downloads import table_download
from truespring.report.drawing import Drawing, drawings
from truespring.report.quantity import percent
from truespring.report.shell import picture, render

if TYPE_CHECKING:
    from rich.table import Table

# More unknowns than this are not listed.
_MOST = 2000
# Number of singular values on a page.
_SHOWN = 40


def calibration_table(title: str, found: Fitted) -> "Table":
    """Return a table of the error of each load case at its last level, by the rule and calibrated."""
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for name, justify in (
        ("load", "left"),
        ("", "left"),
        ("of the", "left"),
        ("rule", "right"),
        ("calibrated", "right"),
    ):
        table.add_column(name, justify="right" if justify == "right" else "left")
    for row in case_rows(found):
        table.add_row(*row)
    return table


def case_rows(found: Fitted) -> list[tuple[str, ...]]:
    """Return for each load case and quantity its name, whether it was fitted, the quantity, and both errors."""
    return [
        (row["name"], "held out" if row["held_out"] else "fitted", row["quantity"], row["before"], row["after"])
        for row in _rows(found)
    ]


def _rows(found: Fitted) -> list[dict[str, Any]]:
    return [
        {
            "name": one.case.name,
            "held_out": one.held_out,
            "quantity": quantity,
            "before": _percent(one.error(one.before, quantity)),
            "after": _percent(one.error(one.after, quantity)),
        }
        for one in sorted(found.cases, key=lambda one: not one.held_out)
        for quantity in dict.fromkeys(seen.quantity for seen in one.case.observations)
    ]


def _percent(share: float | None) -> str:
    return "no equilibrium" if share is None else percent(share)


def calibration_values(found: Fitted) -> dict[str, Any]:
    """Return a calibration as JSON values."""
    identified = found.identifiability
    each = len(found.unknowns) <= _MOST
    return {
        "headline": found.headline,
        "held_out_error": found.error,
        "rule": found.rule.label,
        "unknowns": found.unknowns.kind,
        "n_unknowns": len(found.unknowns),
        "regularisation": found.regularisation,
        "method": found.method,
        "solves": found.solves,
        "objective": {name: _finite(value) for name, value in found.objectives.items()},
        "force_residual": dict(found.residuals),
        "cases": [_case_values(one) for one in found.cases],
        "values": [
            {"name": name, "value": float(value), "undetermined": float(loose), "resolution": float(share)}
            for name, value, loose, share in zip(
                found.unknowns.names, found.values, identified.undetermined, identified.resolution, strict=True
            )
        ]
        if each
        else None,
        "identifiability": {
            "rank": identified.rank,
            "n_unknowns": identified.n_unknowns,
            "determined": identified.determined,
            "singular_values": identified.singular_values.tolist(),
            "not_determined": list(identified.loose),
            "held_by_regularisation": list(identified.weak),
            "of": identified.of,
            "sentence": identified.sentence,
        },
        "warnings": list(found.warnings),
    }


def _case_values(one: CaseResult) -> dict[str, Any]:
    quantities = dict.fromkeys(seen.quantity for seen in one.case.observations)
    return {
        "name": one.case.name,
        "held_out": one.held_out,
        "quantity": one.quantity,
        "error_before": one.pair[0],
        "error_after": one.pair[1],
        "status_before": str(one.before.status),
        "status_after": str(one.after.status),
        "levels": {
            quantity: [
                {"load_factor": level, "before": before.get(level), "after": after.get(level)}
                for level in sorted({*before, *after})
            ]
            for quantity in quantities
            for before, after in [(one.errors(one.before, quantity), one.errors(one.after, quantity))]
        },
    }


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None


def draw_calibration(found: Fitted) -> dict[str, Drawing]:
    """Return the figures of a calibration as PNG and SVG; deprecated, use `Calibration.figures`.

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
        >>> found.figures()["calibration_errors"].title
        'Error at full load: grey by the rule, blue calibrated'
    """
    warnings.warn("draw_calibration is deprecated, use Calibration.figures()", DeprecationWarning, stacklevel=2)
    return drawings(calibration_figures(found))


def render_calibration(
    title: str, what: str, found: Fitted, drawings: Mapping[str, Drawing], names: Sequence[str], command: str | None
) -> str:
    """Return the page as HTML.

    Args:
        title: of the study.
        what: a sentence on what was fitted to what.
        found: the calibration.
        drawings: its pictures.
        names: of the files in the folder of the page.
        command: the command line that repeats the run.
    """
    identified = found.identifiability
    shown = [f"{value:.2e}" for value in identified.singular_values[:_SHOWN]]
    return render(
        "calibration/page.html.j2",
        command,
        title=title,
        what=what,
        headline=found.headline,
        fitted=fitted_sentence(found),
        parameters=found.unknowns.sentence(found.values),
        identifiability=identified.sentence,
        trouble=not found.held_out or found.error is None,
        warnings=found.warnings,
        shapes=_pictures(drawings, "shape_"),
        errors=_pictures(drawings, "errors", "case_"),
        unknowns=_pictures(drawings, "unknowns", "lattice"),
        downloads=[table_download("calibration_errors.csv", _errors_text(found), "errors before and after")],
        rows=_rows(found),
        method=_method(found),
        of=identified.of,
        singular_values=", ".join(shown) + (", …" if len(identified.singular_values) > _SHOWN else ""),
        steps=[
            (name, f"{value:.3e}", f"{found.residuals[name]:.3e}" if name in found.residuals else "–")
            for name, value in found.objectives.items()
        ],
        files=f"Files in this folder: {', '.join(names)}.",
    )


def _pictures(drawings: Mapping[str, Drawing], *begins: str) -> list[dict[str, str]]:
    """Return the pictures whose names begin with one of `begins`."""
    return [picture(drawing, f"calibration_{name}") for name, drawing in drawings.items() if name.startswith(begins)]


def _errors_text(found: Fitted) -> str:
    """Return `Fitted.rows` as the text of a CSV file."""
    stream = io.StringIO()
    table = csv.DictWriter(stream, list(found.rows[0]))
    table.writeheader()
    table.writerows(found.rows)
    return stream.getvalue()


def fitted_sentence(found: Fitted) -> str:
    """Return the errors on the fitted loads, before and after, in a sentence."""
    errors = [
        f"{one.case.name} from {_percent(one.pair[0])} to {_percent(one.pair[1])}"
        for one in found.cases
        if not one.held_out
    ]
    return f"Error on the fitted loads: {'; '.join(errors)}."


def _method(found: Fitted) -> str:
    return (
        f"{found.unknowns.counted} ({found.unknowns.kind}), each a non-negative factor on {found.unknowns.of_what} of "
        f"{found.rule.label}. Method: {found.method}; {found.solves} paths solved; regularisation "
        f"{found.regularisation:g} toward the rule."
    )
