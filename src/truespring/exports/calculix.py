"""CalculiX input decks: finite elements, and spring networks as SPRINGA elements.

CalculiX is a finite element program by Dhondt and Wittig, https://www.calculix.de. Its *ELASTIC with NLGEOM is the
St. Venant-Kirchhoff law.
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

#: The laws that both CalculiX and Fem have.
LAWS = ("linear", "saint-venant-kirchhoff")

#: Unit of forces in decks and results [N]: ccx treats any residual below 1e-6 as zero, whatever the unit.
FORCE_UNIT = 1e-6

# Tolerances below the printed digits. The defaults are a residual of 0.5 % of the mean force, 2 % from the ninth
# iteration, and a correction of 1 % of the displacement.
_CONTROLS = ["*CONTROLS, PARAMETERS=FIELD", "1.E-7, 1.E-7, , , 1.E-7"]


def fem_deck(
    problem: Problem, levels: Sequence[float], law: str, element: str = "linear", header: Sequence[str] = ()
) -> str:
    """Return a deck of finite elements: CPS4, CPE4, CPS3, CPE3, C3D8 or C3D4, or "quadratic" CPS6, CPE6 or C3D10.

    Args:
        problem: the problem; each region is an element set with its material.
        levels: load factors in (0, 1], ascending; one step for each.
        law: "linear", or "saint-venant-kirchhoff" (NLGEOM).
        element: "linear", or "quadratic" for triangles and tetrahedra.
        header: comment lines.

    Each step prints to the .dat file the displacement of all nodes [m], the forces on held nodes [uN] and the strain
    energy [uJ], correct if the step took one increment; the .frd file has displacement, force, stress and strain.
    Raises ExportError if CalculiX does not support the problem.
    """
    if law not in LAWS:
        raise ExportError(f"law = '{law}' is not available in CalculiX; allowed: {', '.join(LAWS)}")
    twin = fem_twin(problem, law, FORCE_UNIT, element)
    return deck(_DIALECT, twin, levels, nonlinear=law != "linear", continuum=True, header=header)


def spring_deck(problem: Problem, network: PlainSprings, levels: Sequence[float], header: Sequence[str] = ()) -> str:
    """Return a deck of SPRINGA elements; arguments and output as for `fem_deck`, without energy.

    Raises ExportError if springs are prestressed in the undeformed body, or a load follows a face.
    """
    twin = spring_twin(problem, network, FORCE_UNIT)
    return deck(_DIALECT, twin, levels, nonlinear=True, continuum=False, header=header)


def calculix(exported: Exported) -> dict[str, str]:
    """Return `springs.inp`, and `fem.inp` if the problem has a continuum that CalculiX supports."""
    return deck_files(_DIALECT, exported)


def _explained(name: str) -> tuple[str, ...]:
    return (
        f"Run it by: ccx {name}",
        "Units: metres, and micronewtons (uN) for forces, because ccx treats any residual below 1e-6 as zero: "
        "stiffness is in uN/m, Young's modulus and pressure in uN/m^2, density in 1e-6 kg/m^3, energy in uJ.",
        "Node i of truespring, counted from 0, is node i + 1. Each step is a load level, time is the load factor; each "
        f"step gives the total loads and displacements. {name}.dat has the displacement of all nodes at the end of "
        f"each step, {name}.frd the fields.",
    )


_FEM = (
    "*ELASTIC with NLGEOM is the St. Venant-Kirchhoff law. Gravity and pressure are *DLOAD; pressure follows the "
    "faces, other loads are nodal forces. CalculiX expands CPS4 and CPS6 to a layer of bricks or wedges with free "
    "faces: the stress across vanishes only on average, and a pressure acts on the deformed thickness.",
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
        f"*NODE FILE, OUTPUT=2D, {LAST_ONLY}",  # at the nodes of plane elements, not of their expansion
        "U, RF",
        *([f"*EL FILE, OUTPUT=2D, {LAST_ONLY}", "S, E"] if continuum else []),
    ]


_DIALECT = Dialect("CalculiX", "NLGEOM", FORCE_UNIT, comments, _start, _output, _explained, _FEM)
