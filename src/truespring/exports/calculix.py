"""CalculiX: its decks of a problem, as finite elements and as a network of SPRINGA elements.

CalculiX is a finite element program of its own (Dhondt and Wittig, https://www.calculix.de). Its *ELASTIC is St.
Venant-Kirchhoff's law under NLGEOM.
"""

from collections.abc import Sequence

from truespring.errors import ExportError
from truespring.exports.decks import (
    LAST_ONLY,
    Dialect,
    Step,
    comments,
    deck,
    deck_files,
    fem_twin,
    real,
    spring_twin,
)
from truespring.exports.exported import Exported
from truespring.models.spring_data import PlainSprings
from truespring.problem import Problem

#: The laws that CalculiX has in common with Fem.
LAWS = ("linear", "saint-venant-kirchhoff")

#: Of forces in decks and results [N]: ccx takes any residual below 1e-6 for zero, whatever the unit.
FORCE_UNIT = 1e-6

# By default it stops at a residual of 0.5 % of the mean force, from the ninth iteration on 2 %, and a correction of
# 1 % of the displacement; these are less than it prints.
_CONTROLS = ["*CONTROLS, PARAMETERS=FIELD", "1.E-7, 1.E-7, , , 1.E-7"]


def fem_deck(
    problem: Problem, levels: Sequence[float], law: str, element: str = "linear", header: Sequence[str] = ()
) -> str:
    """Write a problem as finite elements: CPS4, CPE4, CPS3, CPE3, C3D8 or C3D4, or "quadratic" CPS6, CPE6 or C3D10.

    Args:
        problem: what is asked; its regions are sets of elements of their own material.
        levels: load factors in (0, 1], ascending: a step each.
        law: "linear", or "saint-venant-kirchhoff", which is NLGEOM.
        element: "linear", or "quadratic" for triangles and tetrahedra.
        header: comment lines.

    Each step prints to the .dat file the displacement of all nodes [m], the forces on held ones [uN] and the strain
    energy [uJ], right where the step took one increment; the .frd file has displacement, force, stress and strain.
    Raises ExportError for what CalculiX cannot express.
    """
    if law not in LAWS:
        raise ExportError(f"law = '{law}': CalculiX has {' and '.join(LAWS)} in common with truespring")
    twin = fem_twin(problem, law, FORCE_UNIT, element)
    return deck(_DIALECT, twin, levels, nonlinear=law != "linear", continuum=True, header=header)


def spring_deck(problem: Problem, network: PlainSprings, levels: Sequence[float], header: Sequence[str] = ()) -> str:
    """Write a network as SPRINGA elements; arguments and output as of `fem_deck`, without energy.

    Raises ExportError where springs are not at rest in the reference positions, or a load follows a face.
    """
    twin = spring_twin(problem, network, FORCE_UNIT)
    return deck(_DIALECT, twin, levels, nonlinear=True, continuum=False, header=header)


def calculix(exported: Exported) -> dict[str, str]:
    """Return `springs.inp`, and `fem.inp` where the problem has a continuum that CalculiX can express."""
    return deck_files(_DIALECT, exported)


def _explained(name: str) -> tuple[str, ...]:
    return (
        f"Run it by: ccx {name}",
        "Units: metres, and micronewtons (uN) for forces, for ccx takes any residual below 1e-6 for zero, whatever the "
        "unit: stiffness is in uN/m, Young's modulus and pressure in uN/m^2, density in 1e-6 kg/m^3, energy in uJ.",
        "Node i of truespring, counted from 0, is node i + 1 here. A step is a load level, time the load factor; it "
        f"gives loads and motions in full. {name}.dat gets the displacement of all nodes after each, {name}.frd "
        "fields.",
    )


_FEM = (
    "*ELASTIC under NLGEOM is St. Venant-Kirchhoff's law. Gravity and pressure are CalculiX's own *DLOAD; pressure "
    "follows the faces, other loads are forces on nodes. CPS4 and CPS6 are a layer of bricks or wedges with free "
    "faces: plane stress in the mean, and a pressure acts on the thickness as it becomes.",
)


def _start(step: Step, nonlinear: bool) -> list[str]:
    if not nonlinear:
        return ["*STEP", "*STATIC", f"{real(step.period)}, {real(step.period)}"]
    first, period = real(step.first_increment), real(step.period)
    return [
        "*STEP, NLGEOM, INC=1000000",
        *_CONTROLS,
        "*STATIC",
        f"{first}, {period}, {real(1e-5 * step.period)}, {first}",
    ]


def _output(continuum: bool) -> list[str]:
    return [
        f"*NODE PRINT, NSET=NALL, {LAST_ONLY}",
        "U",
        f"*NODE PRINT, NSET=HELD, {LAST_ONLY}",
        "RF",
        *([f"*EL PRINT, ELSET=BODY, TOTALS=ONLY, {LAST_ONLY}", "ELSE"] if continuum else []),
        f"*NODE FILE, OUTPUT=2D, {LAST_ONLY}",  # results of plane elements at the nodes that were given
        "U, RF",
        *([f"*EL FILE, OUTPUT=2D, {LAST_ONLY}", "S, E"] if continuum else []),
    ]


_DIALECT = Dialect("CalculiX", "NLGEOM", FORCE_UNIT, comments, _start, _output, _explained, _FEM)
