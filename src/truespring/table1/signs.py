"""What the measured figures say in the signs of the printed table, and where they contradict it."""

from collections.abc import Mapping
from typing import Any

from truespring.table1.entries import CRITERIA, METHODS, PRINTED

Row = Mapping[str, Any]

#: What a sign stands for here, by criterion; what is neither + nor - is +/-.
MEANING = {
    "computational speed": (
        "+ where an equilibrium takes at most half as long as FEM on the same mesh, - where more than twice "
        "as long or where no stable one is found; FEM itself is +/-"
    ),
    "material properties": (
        "+ where the moduli are within 5 % of the material's at every Poisson's ratio from 0 to 0.45, - where at none"
    ),
    "results accuracy": (
        "+ where the small-load error is below 5 % on 4 elements through the depth and below 1 % on a fine "
        "mesh, - where neither holds"
    ),
    "large deflection": (
        "+ where the end is within 5 % of converged neo-Hookean FEM up to a deflection of half the length, "
        "- where not up to a fifth"
    ),
}


def sign(criterion: str, row: Row, finite: Row) -> str:
    """Return +, +/- or - for what was measured of an entry; `finite` is the row of FEM in the same dimension."""
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
    """Return criterion, method, printed and measured sign where the chief entry of a method has another sign."""
    chief = {row["method"]: row for row in rows if row["dim"] == dim and row["chief"]}
    found = []
    for criterion in CRITERIA:
        for method, printed in zip(METHODS, PRINTED[criterion], strict=True):
            if method in chief and "FEM" in chief:
                measured = sign(criterion, chief[method], chief["FEM"])
                if measured != printed:
                    found.append((criterion, method, printed, measured))
    return found


#: What would have to be true for a printed sign that was not found.
IF = {
    ("computational speed", "FEM"): ("FEM would have to be coded as loops over Gauss points that an interpreter runs."),
    ("computational speed", "Terzopoulos"): (
        "the force would have to be all that counts, as where time is stepped explicitly: one is cheap. An "
        "equilibrium is not, and in the plane a fine grid with his boundary has many that are unstable."
    ),
    ("computational speed", "MSM"): (
        "the force evaluation alone would have to be compared, which is many times cheaper; in an "
        "equilibrium the linear solver, which is the same for all, takes most of the time."
    ),
    ("computational speed", "HEML"): ("HEML would have to be compared with finite elements coded plainly."),
    ("computational speed", "BEM + MSM"): (
        "the boundary elements would have to be set up once and loaded many times, and their dense block be small."
    ),
    ("computational speed", "mass-tensor"): (
        "its nonlinear form would have to be meant: its linear form takes one linear solve, as linear FEM "
        "does, and is the fastest of all."
    ),
    ("material properties", "Terzopoulos"): (
        "one weight for each component of the metric would have to be all it may have; then it has no "
        "Poisson's ratio along its axes."
    ),
    ("material properties", "MSM"): (
        "the isotropic rule would have to be meant, which realises one Poisson's ratio; with a volume term "
        "springs realise all of them."
    ),
    ("material properties", "HEML"): ("the law of the links would have to be fitted, not derived."),
    ("material properties", "BEM + MSM"): (
        "the boundary elements would have to be the whole body: its springs realise one Poisson's ratio."
    ),
    ("material properties", "mass-tensor"): ("its tensors would have to be others than those of linear elasticity."),
    ("results accuracy", "FEM"): (
        "finer or better elements would have to be taken: four through the depth are 3.6 % off."
    ),
    ("results accuracy", "Terzopoulos"): (
        "it would have to be judged with his own boundary rule, which is too stiff by (n + 1) / n for each "
        "direction across."
    ),
    ("results accuracy", "MSM"): (
        "springs would have to be judged in the plane on one mesh only: Lloyd's error at four elements through the "
        "depth is two errors that cancel there. On fine meshes none vanishes, and on cubes nothing cancels."
    ),
    ("results accuracy", "HEML"): (
        "HEML would have to be something else than finite elements: with the same law on the same elements "
        "it is the same function, to rounding."
    ),
    ("results accuracy", "BEM + MSM"): ("the springs would have to be few beside the boundary elements."),
    ("results accuracy", "mass-tensor"): (
        "finer meshes would have to be taken: triangles and tetrahedra of first order lock in bending."
    ),
    ("large deflection", "FEM"): (
        "a law would have to be taken that resists compression: St. Venant-Kirchhoff loses its solution, "
        "neo-Hookean does not."
    ),
    ("large deflection", "Terzopoulos"): (
        "it would have to be linear; the metric tensor is not, it follows any rotation."
    ),
    ("large deflection", "MSM"): (
        "squares three or four deep would have to be taken, where Lloyd's springs bend right. On finer ones, "
        "and on cubes, they are more than 5 % off from the start; the isotropic rule in the plane is not."
    ),
    ("large deflection", "HEML"): (
        "more would have to be asked than half the length: with St. Venant-Kirchhoff's law it ends between that and "
        "the whole length, as finite elements of that law do."
    ),
    ("large deflection", "BEM + MSM"): (
        "a little more would have to be asked: a block that may not turn is 5 % off at about a quarter of the "
        "length. Let to turn as a whole, it follows."
    ),
    ("large deflection", "mass-tensor"): ("its linear form would have to be meant."),
}
