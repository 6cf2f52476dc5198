"""Motion beside CalculiX: a cantilever of cubes that a force at its tip sets swinging.

CalculiX's *DYNAMIC, ALPHA=0 is the trapezoidal rule (Newmark, beta 1/4, gamma 1/2). On linear bodies it has the period
of the midpoint rule, so that errors of the step cancel. Loads of *DYNAMIC act in full from time 0, as in truespring.

CalculiX has the consistent mass, truespring the lumped one: of this body, with cubes of an edge of a fourth of its
height, the lowest frequency is lower by 0.048 % for that (0.19 % with cubes twice as large), the second by 0.31 %. Over
two periods this is a distance of 0.6 % and 2.4 % of the amplitude.
"""

from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.calculix import displacements, needs_ccx
from truespring.arrays import Floats
from truespring.exports.calculix import FORCE_UNIT
from truespring.exports.continuum import fem_twin
from truespring.exports.decks import joined, real

LENGTH, HEIGHT, FORCE = 0.4, 0.04, 0.01  # [m], [m], [N]
MATERIAL = ts.Material(100e3, 0.3, density=1000.0)
#: The first period of the beam by Bernoulli's theory, and a step of a fiftieth of it [s].
PERIOD = 2 * np.pi / 3.516 * LENGTH**2 * np.sqrt(12 * 1000.0 / 100e3) / HEIGHT
STEP = PERIOD / 50


def body(cubes: int, **further: object) -> ts.Problem:
    """Half of the cantilever, beside its plane of symmetry, with as many cubes over its height."""
    return ts.Problem(
        ts.box((LENGTH, HEIGHT, HEIGHT / 2), (10 * cubes, cubes, cubes // 2)),
        MATERIAL,
        supports=[ts.Fixed("left"), ts.Fixed("back", fix="z")],
        loads=[ts.Force("right", (0.0, -FORCE, 0.0))],
        **further,
    )


def ours(cubes: int, model: object) -> Floats:
    """The displacement of the tip after each step of two periods [m], shape (100, 3)."""
    problem = body(cubes, dynamics=ts.Dynamics(2 * PERIOD, step=STEP, scheme="midpoint", record=STEP))
    path = ts.solve(problem, model, ts.Newton(tolerance=1e-8))
    assert path.status is ts.Status.CONVERGED, path.warnings
    return tip(problem, [state.displacement for state in path.states[1:]])


def theirs(cubes: int, element: str, folder: Path) -> Floats:
    """The same by CalculiX."""
    problem = body(cubes)
    deck = fem_twin(problem, "saint-venant-kirchhoff", FORCE_UNIT)
    held, force = deck.loading.held, deck.loading.external_force
    lines = [
        "*NODE, NSET=NALL",
        *(f"{number}, {joined(map(real, node))}" for number, node in enumerate(deck.nodes.tolist(), 1)),
        *(line.replace("TYPE=C3D8,", f"TYPE={element},") for line in deck.model),
        "*STEP, NLGEOM, INC=1000",
        "*CONTROLS, PARAMETERS=FIELD",
        "1.E-5, 1.E-5, , , 1.E-5",
        "*DYNAMIC, ALPHA=0., DIRECT",
        f"{real(STEP)}, {real(2 * PERIOD)}",
        "*BOUNDARY",
        *(f"{node + 1}, {axis + 1}, {axis + 1}" for node, axis in np.argwhere(held).tolist()),
        "*CLOAD",
        *(f"{node + 1}, {axis + 1}, {real(force[node, axis] / FORCE_UNIT)}" for node, axis in np.argwhere(force)),
        "*NODE PRINT, NSET=NALL",
        "U",
        "*END STEP",
    ]
    return tip(problem, displacements("\n".join([*lines, ""]), folder))


def tip(problem: ts.Problem, moved: list[Floats]) -> Floats:
    """The mean displacement of the nodes at the free end [m], shape (n_times, 3)."""
    there = problem.mesh.nodes[:, 0] > (1 - 1e-9) * LENGTH
    return np.array([one[there].mean(axis=0) for one in moved])


def away(one: Floats, other: Floats) -> float:
    """The largest distance at any time, over the amplitude of the swing about its centre."""
    assert one.shape == other.shape == (100, 3)
    assert 0.08 * LENGTH < np.abs(other[:, 1]).max() < 0.12 * LENGTH
    return float(np.linalg.norm(one - other, axis=1).max() / (np.ptp(other[:, 1]) / 2))


@needs_ccx
@pytest.mark.verification
def test_finite_elements_swing_as_in_calculix(tmp_path: Path) -> None:
    """Within 1 % of the amplitude over two periods; the rest is that of the masses, of order 2 in the size of cubes."""
    fem = ts.Fem("saint-venant-kirchhoff", "linear")
    coarse, fine = (away(ours(cubes, fem), theirs(cubes, "C3D8", tmp_path)) for cubes in (2, 4))
    assert fine < 0.01
    assert 3.5 < coarse / fine < 5.5


@needs_ccx
@pytest.mark.verification
def test_springs_swing_as_elements_that_do_not_lock(tmp_path: Path) -> None:
    """Gaussian springs beside C3D8I, whose bending is not locked, within 5 % of the amplitude.

    Beside C3D8, which on this mesh is stiffer in bending, they are 28 % away after two periods: 2 % in frequency.
    """
    assert away(ours(4, ts.Springs("gaussian")), theirs(4, "C3D8I", tmp_path)) < 0.05
