"""Abaqus input decks, in SI units.

Source: Abaqus Keywords Reference. Abaqus was not run on these decks; CalculiX, which reads the same keywords, was.
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
    """Return `springs.inp`, and `fem.inp` if the problem has a continuum that Abaqus supports."""
    return deck_files(_DIALECT, exported)


def _explained(name: str) -> tuple[str, ...]:
    return (
        f"Run it by: abaqus job={name} interactive (Abaqus/Standard)",
        "Units are SI: m, N, N/m, Pa, kg/m^3, J.",
        "Node i of truespring, counted from 0, is node i + 1. Each step is a load level, time is the load factor; each "
        f"step gives the total loads and displacements. {name}.dat has the displacement of all nodes at the end of "
        f"each step, {name}.odb the fields.",
        "Abaqus was not run on this file; its syntax was checked by reading it back and by running it in CalculiX.",
    )


_FEM = (
    "In Abaqus, *ELASTIC with NLGEOM=YES relates true stress to logarithmic strain, which differs from St. "
    "Venant-Kirchhoff at large strain. Gravity and pressure are *DLOAD; pressure follows the faces, other loads are "
    "nodal forces.",
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
        "*CONTROLS, PARAMETERS=FIELD",  # the default tolerance is 0.5 % of the mean force
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
