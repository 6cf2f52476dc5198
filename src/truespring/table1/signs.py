"""Signs from the measured values, and their differences from the printed table."""

from collections.abc import Mapping
from typing import Any

from truespring.table1.entries import CRITERIA, METHODS, PRINTED

Row = Mapping[str, Any]

#: Definition of the signs by criterion; +/- otherwise.
MEANING = {
    "computational speed": (
        "+ if a solve takes at most half the time of FEM on the same mesh, - if it takes more than twice the time or "
        "finds no stable equilibrium; FEM is +/-"
    ),
    "material properties": (
        "+ if the effective moduli are within 5 % of the material at every Poisson's ratio from 0 to 0.45, - if at none"
    ),
    "results accuracy": (
        "+ if the error at small load is below 5 % on 4 elements through the depth and below 1 % on a fine mesh, - if "
        "neither"
    ),
    "large deflection": (
        "+ if the end is within 5 % of converged neo-Hookean FEM up to a deflection of half the length, - if not even "
        "to a fifth"
    ),
}


def sign(criterion: str, row: Row, finite: Row) -> str:
    """Return the sign +, +/- or - of an entry by a criterion; `finite` is the row of FEM in the same dimension."""
    match criterion:
        case "computational speed":
            return _of(_faster(row, finite, 0.5), not _faster(row, finite, 2.0)) if row is not finite else "+/-"
        case "material properties":
            errors = [one["error"] for one in row.get("moduli_errors", [])]
            near = [error is not None and error < 0.05 for error in errors]
            return _of(all(near), not any(near))
        case "results accuracy":
            coarse, fine = (_below(row.get("small_error"), 0.05), _below(row.get("small_limit"), 0.01))
            return _of(coarse and fine, not (coarse or fine))
        case _:
            reach = row.get("deflection_within_5_percent") or 0.0
            return _of(reach >= 0.5, reach < 0.2)


def _of(good: bool, bad: bool) -> str:
    return "+" if good else "-" if bad else "+/-"


def _faster(row: Row, finite: Row, share: float) -> bool:
    mine, theirs = row.get("solve_ms"), finite.get("solve_ms")
    return mine is not None and theirs is not None and mine <= share * theirs


def _below(value: float | None, limit: float) -> bool:
    return value is not None and value < limit


def contradictions(rows: list[Row], dim: int) -> list[tuple[str, str, str, str]]:
    """Return criterion, method, printed and measured sign where the chief entry of a method has a different sign."""
    chief = {row["method"]: row for row in rows if row["dim"] == dim and row["chief"]}
    found = []
    for criterion in CRITERIA:
        for method, printed in zip(METHODS, PRINTED[criterion], strict=True):
            if method in chief and "FEM" in chief:
                measured = sign(criterion, chief[method], chief["FEM"])
                if measured != printed:
                    found.append((criterion, method, printed, measured))
    return found


#: Condition under which a printed sign would apply, by criterion and method, after the words "... would apply".
IF = {
    ("computational speed", "FEM"): ("if FEM were implemented as interpreted loops over Gauss points."),
    ("computational speed", "Terzopoulos"): (
        "if only force evaluations counted, which are cheap, as in explicit time integration. An equilibrium is "
        "expensive, and in 2D a fine grid with the boundary of the paper has many unstable ones."
    ),
    ("computational speed", "MSM"): (
        "if only force evaluations were compared, which are many times cheaper. In a solve, most of the time is spent "
        "in the linear solver, which is the same for all."
    ),
    ("computational speed", "HEML"): ("if HEML were compared with a plain implementation of finite elements."),
    ("computational speed", "BEM + MSM"): (
        "if the boundary elements were set up once for many loads, and the dense block were small."
    ),
    ("computational speed", "mass-tensor"): (
        "to its nonlinear form. Its linear form requires one linear solve, as linear FEM does, and is the fastest."
    ),
    ("material properties", "Terzopoulos"): (
        "if it had only one weight for each component of the metric; Poisson's ratio along the axes is then 0."
    ),
    ("material properties", "MSM"): (
        "to the isotropic rule, which has one Poisson's ratio. With a volume term, springs have that of the material."
    ),
    ("material properties", "HEML"): ("if the law of the links were fitted, not derived."),
    ("material properties", "BEM + MSM"): (
        "if the whole body were boundary elements. Its springs have one Poisson's ratio."
    ),
    ("material properties", "mass-tensor"): ("if its tensors were not those of linear elasticity."),
    ("results accuracy", "FEM"): ("to finer or better elements: four through the depth have an error of 3.6 %."),
    ("results accuracy", "Terzopoulos"): (
        "with the boundary of the paper, which is too stiff by a factor (n + 1) / n for each transverse direction."
    ),
    ("results accuracy", "MSM"): (
        "in 2D on one mesh: with Lloyd's rule, two errors cancel at four elements through the depth. They remain on "
        "fine meshes, and on cubes they do not cancel."
    ),
    ("results accuracy", "HEML"): (
        "if HEML differed from finite elements. With the same law on the same elements it is the same function, to "
        "rounding."
    ),
    ("results accuracy", "BEM + MSM"): ("if the springs were few compared with the boundary elements."),
    ("results accuracy", "mass-tensor"): (
        "on finer meshes: triangles and tetrahedra of first order are too stiff in bending."
    ),
    ("large deflection", "FEM"): (
        "to a law that resists compression: the solution ends with St. Venant-Kirchhoff, but not with neo-Hookean."
    ),
    ("large deflection", "Terzopoulos"): ("if it were linear. The metric tensor is not, it follows any rotation."),
    ("large deflection", "MSM"): (
        "on meshes of squares three or four deep, where the bending stiffness of Lloyd's springs is accurate. On "
        "finer meshes and on cubes their error is above 5 % at any load; that of the isotropic rule in 2D is not."
    ),
    ("large deflection", "HEML"): (
        "if the limit were above half the length: with the St. Venant-Kirchhoff law, stable solutions end at a "
        "deflection between half and all of the length, as do those of finite elements."
    ),
    ("large deflection", "BEM + MSM"): (
        "if the limit were slightly higher: with a block that cannot rotate, the error is 5 % at about a quarter of "
        "the length. A corotated block follows large rotations."
    ),
    ("large deflection", "mass-tensor"): ("to its linear form."),
}
