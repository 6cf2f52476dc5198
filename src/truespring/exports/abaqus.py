"""Abaqus: the same bodies in its own form, in newtons.

Source of the form: its keywords reference. Abaqus was not run on these; CalculiX reads the same keywords, and was.
"""

from collections.abc import Sequence

from truespring.errors import ExportError
from truespring.exports.decks import (
    LAST_ONLY,
    Dialect,
    Step,
    check_fem,
    comments,
    deck,
    described,
    fem_element,
    fem_twin,
    levels_of,
    real,
    spring_twin,
    usual_element,
)
from truespring.exports.exported import Exported


def abaqus(exported: Exported) -> dict[str, str]:
    """Return `springs.inp`, and `fem.inp` where the problem has a continuum that Abaqus can express."""
    network, levels, problem, files = exported.network, levels_of(exported), exported.problem, {}
    notes = [
        "Prestress, volume terms, coupled springs and loads that follow a face have no place among SPRINGA elements."
    ]
    try:
        check_fem(problem, "saint-venant-kirchhoff")
        element = usual_element(problem)
        twin = fem_twin(problem, "saint-venant-kirchhoff", _DIALECT.force_unit, element)
        what = f"Abaqus {fem_element(problem, element)} elements, NLGEOM=YES"
        header = [*described(exported, what, springs=False), *_explained("fem"), *_FEM]
        files["fem.inp"] = deck(_DIALECT, twin, levels, nonlinear=True, continuum=True, header=header)
    except ExportError as error:
        notes.append(f"There is no fem.inp beside this file: {error}.")
    header = [*described(exported, "Abaqus SPRINGA elements", springs=True), *_explained("springs"), *notes]
    twin = spring_twin(problem, network, _DIALECT.force_unit)
    return {"springs.inp": deck(_DIALECT, twin, levels, nonlinear=True, continuum=False, header=header), **files}


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


_DIALECT = Dialect(1.0, _opening, _start, _output)
