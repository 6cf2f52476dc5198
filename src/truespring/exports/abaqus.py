"""Abaqus: the same bodies in its own form, in newtons.

Source of the form: its keywords reference. Abaqus was not run on these; CalculiX reads the same keywords, and was.
"""

from collections.abc import Sequence

from truespring.exports.decks import (
    LAST_ONLY,
    Dialect,
    Step,
    comments,
    deck_files,
    real,
)
from truespring.exports.exported import Exported


def abaqus(exported: Exported) -> dict[str, str]:
    """Return `springs.inp`, and `fem.inp` where the problem has a continuum that Abaqus can express."""
    return deck_files(_DIALECT, exported)


def _explained(name: str) -> tuple[str, ...]:
    return (
        f"Run it by: abaqus job={name} interactive (Abaqus/Standard)",
        "Units are SI: m, N, N/m, Pa, kg/m^3, J.",
        "Node i of truespring, counted from 0, is node i + 1 here. A step is a load level, time the load factor; it "
        f"gives loads and motions in full. {name}.dat gets the displacement of all nodes after each, {name}.odb "
        "fields.",
        "Abaqus was not run on this file: its form was checked by reading it back and by running it in CalculiX.",
    )


_FEM = (
    "*ELASTIC with NLGEOM=YES is in Abaqus a law of true stress and logarithmic strain, which at large strain is not "
    "St. Venant-Kirchhoff's. Gravity and pressure are *DLOAD; pressure follows the faces, other loads are forces on "
    "nodes.",
)


def _opening(header: Sequence[str]) -> list[str]:
    title = next(iter(header), "").lstrip("* ") or "truespring"
    return ["*HEADING", title[:80], *comments(header)]


def _start(step: Step, nonlinear: bool) -> list[str]:
    first, period = real(step.first_increment), real(step.period)
    return [
        f"*STEP, NAME=LEVEL-{step.number}, NLGEOM={'YES' if nonlinear else 'NO'}, INC=1000000",
        "*STATIC",
        f"{first}, {period}, {real(1e-5 * step.period)}, {first}",
        "*CONTROLS, PARAMETERS=FIELD",  # by default a residual of 0.5 % of the mean force is taken for balance
        "1.E-6, 1.E-6",
    ]


def _output(continuum: bool) -> list[str]:
    return [
        f"*OUTPUT, FIELD, {LAST_ONLY}",
        "*NODE OUTPUT",
        "U, RF",
        *(["*ELEMENT OUTPUT", "S, LE"] if continuum else []),
        f"*OUTPUT, HISTORY, {LAST_ONLY}",
        "*ENERGY OUTPUT",
        "ALLSE",
        f"*NODE PRINT, NSET=NALL, {LAST_ONLY}, SUMMARY=NO",
        "U",
        f"*NODE PRINT, NSET=HELD, {LAST_ONLY}, SUMMARY=NO, TOTALS=YES",
        "RF",
    ]


_DIALECT = Dialect("Abaqus", "NLGEOM=YES", 1.0, _opening, _start, _output, _explained, _FEM)
