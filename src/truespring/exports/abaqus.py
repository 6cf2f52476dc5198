"""Abaqus input decks, in SI units.

Source: Abaqus Keywords Reference. Abaqus was not run on these decks; CalculiX, which reads the same keywords, was.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from truespring.exports.decks import LAST_ONLY, Dialect, Solids, Step, comments, real
from truespring.exports.exported import Exported
from truespring.exports.keyword_files import deck_files, deck_values


def abaqus(exported: Exported) -> dict[str, str]:
    """Return `springs.inp` or `twin.inp`, and `fem.inp` if the problem has a continuum that Abaqus supports."""
    return deck_files(_DIALECT, exported)


def abaqus_values(exported: Exported) -> Mapping[str, Any]:
    """Return what exported.json states of a twin."""
    return deck_values(_DIALECT, exported)


def _explained(name: str, _: float) -> tuple[str, ...]:
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


_SOLIDS = Solids(
    names=MappingProxyType({"C3D8": "C3D8H", "C3D10": "C3D10H", "CPE4": "CPE4H", "CPE6": "CPE6H"}),
    overlaid=frozenset(),
    control=None,
    least_shear=1e-6,  # a material without shear stiffness is an error
    of_overlaid=(),
    of_others=(
        "Elements are hyperelastic, with a pressure of their own (H) where the volume change would lock them; SPRING2 "
        "elements have the rest of the springs' stiffness against hourglass modes. On triangles and tetrahedra of "
        "first order the twin equals the springs at small strain; on others, both have one volume change an element, "
        "and differ by about 1 % on coarse meshes.",
    ),
    of_volume=(
        "The volume term kappa/2 (V / V0 - 1)^2 V0 is *HYPERELASTIC, NEO HOOKE with D1 = 2 / kappa and a C10 of 1e-6 "
        "kappa: C3D4 and CPE3, which equal it, and C3D8R and CPE4R, which equal it at small strain.",
    ),
)

_ELASTIC = (
    "TWIN at small strain only: biquadratic springs are St. Venant-Kirchhoff finite elements of first order, and in "
    "Abaqus *ELASTIC with NLGEOM=YES is another law, of true stress and logarithmic strain. C3D8 and CPE4 in Abaqus "
    "have one volume change an element, so that they are softer where the springs lock.",
)

_DIALECT = Dialect(
    "Abaqus",
    "NLGEOM=YES",
    1.0,
    _opening,
    _start,
    _output,
    _explained,
    _FEM,
    lambda modulus: 1.0,
    _SOLIDS,
    _ELASTIC,
)
