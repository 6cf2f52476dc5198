"""CalculiX input decks: finite elements, and spring networks as SPRINGA elements.

CalculiX is a finite element program by Dhondt and Wittig, https://www.calculix.de. Its *ELASTIC with NLGEOM is the
St. Venant-Kirchhoff law.
"""

import math
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from truespring.errors import ExportError
from truespring.exports.continuum import fem_twin
from truespring.exports.decks import LAST_ONLY, Dialect, Solids, Step, comments, deck, real
from truespring.exports.exported import Exported
from truespring.exports.keyword_files import deck_files, deck_values
from truespring.exports.mean_strain import hourglass_control
from truespring.exports.spring_elements import spring_twin
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
    """Return `springs.inp` or `twin.inp`, and `fem.inp` if the problem has a continuum that CalculiX supports."""
    return deck_files(_DIALECT, exported)


def calculix_values(exported: Exported) -> Mapping[str, Any]:
    """Return what exported.json states of a twin."""
    return deck_values(_DIALECT, exported)


def _explained(name: str, force_unit: float) -> tuple[str, ...]:
    own = (
        f"Units: metres, and {force_unit:g} N for forces: stiffness is in {force_unit:g} N/m, moduli and pressure in "
        f"{force_unit:g} Pa, energy in {force_unit:g} J; ccx replaces a D1 below 1e-10, whatever the unit."
    )
    usual = (
        "Units: metres, and micronewtons (uN) for forces, because ccx treats any residual below 1e-6 as zero: "
        "stiffness is in uN/m, Young's modulus and pressure in uN/m^2, density in 1e-6 kg/m^3, energy in uJ."
    )
    return (
        f"Run it by: ccx {name}",
        usual if force_unit == FORCE_UNIT else own,
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


def _twin_unit(modulus: float) -> float:
    """Return a unit of force [N], a power of ten, in which D1 = 2 / modulus is above 1e-10."""
    return max(FORCE_UNIT, 10.0 ** math.ceil(math.log10(1e-10 * modulus))) if modulus else FORCE_UNIT


_HOURGLASS = (
    "C3D8R and CPE4R in CalculiX 2.20 have the mean strain of the element, and a control of hourglass modes, which "
    "SPRING2 elements take away again."
)

_SOLIDS = Solids(
    names=MappingProxyType({}),
    overlaid=frozenset({"C3D8", "CPE4"}),
    control=hourglass_control,
    least_shear=0.0,
    of_overlaid=(
        "Each element is two on the same nodes: C3D8 (CPE4) with C10 = mu/2 and the bulk modulus -mu/3, and C3D8R "
        "(CPE4R) with C10 = 0 and lam + mu; the stress of an element is the sum of both.",
        _HOURGLASS,
        "They also have the rest of the springs' stiffness against hourglass modes.",
    ),
    of_others=(
        "Elements are hyperelastic; those of Gaussian springs are equal on triangles and tetrahedra of first order. On "
        "others, the springs have one volume change an element and do not lock: the twin is stiffer.",
    ),
    of_volume=(
        "The volume term kappa/2 (V / V0 - 1)^2 V0 is *HYPERELASTIC, NEO HOOKE with C10 = 0 and D1 = 2 / kappa: C3D4 "
        "and CPE3, which equal it, and C3D8R and CPE4R, which equal it at small strain. " + _HOURGLASS,
    ),
)

_ELASTIC = (
    "Biquadratic springs are St. Venant-Kirchhoff finite elements of first order; *ELASTIC with NLGEOM is this law in "
    "CalculiX. The displacement is that of the springs at all loads; of CPS4 and CPS3, which CalculiX expands to "
    "bricks and wedges with free faces, within about 2 %.",
)

_DIALECT = Dialect(
    "CalculiX", "NLGEOM", FORCE_UNIT, comments, _start, _output, _explained, _FEM, _twin_unit, _SOLIDS, _ELASTIC
)
