"""Contact against CalculiX: a rigid sphere pressed into a block of the same elements, node to surface."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.calculix import needs_ccx
from tests.test_tools import MATERIAL, POISSON, YOUNG, graded
from truespring.arrays import Floats, Ints
from truespring.reference.ccx import run_ccx

RADIUS, LENGTH, DEPTH, STIFFNESS = 0.03, 0.12, 0.002, 5e8
# CalculiX treats residuals below 1e-6 as zero: forces are in micronewtons.
UNIT = 1e-6


def cap(step: float, n: int) -> tuple[Floats, Ints]:
    """The lower part of a sphere about the origin as a layer of n x n bricks, the first face of each outside."""
    along = step * (np.arange(n + 1) - n // 5)
    x, z = (one.ravel() for one in np.meshgrid(along, along, indexing="ij"))
    outside = np.stack([x, -np.sqrt(RADIUS**2 - x**2 - z**2), z], axis=1)
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    faces = np.stack([corner, corner + 1, corner + n + 2, corner + n + 1], axis=1)
    return np.concatenate([outside, 0.9 * outside]), np.concatenate([faces, faces + len(outside)], axis=1)


def rows(numbers: Ints) -> Iterator[str]:
    for first in range(0, len(numbers), 10):
        yield ", ".join(map(str, numbers[first : first + 10] + 1))


def deck(mesh: ts.Mesh) -> str:
    """The block held as in the test of truespring, and the cap that moves down by DEPTH in one step."""
    nodes, bricks = cap(1e-3, 20)
    n_nodes, n_elements = mesh.n_nodes, len(mesh.elements)
    places = np.concatenate([mesh.nodes, nodes + np.array([0, LENGTH + RADIUS, 0])])
    lines = ["*NODE", *(f"{i}, {x:.12e}, {y:.12e}, {z:.12e}" for i, (x, y, z) in enumerate(places, 1))]
    for name, first, elements in (("BODY", 1, mesh.elements), ("BALL", n_elements + 1, bricks + n_nodes)):
        lines.append(f"*ELEMENT, TYPE=C3D8, ELSET={name}")
        lines += [f"{i}, {', '.join(map(str, one + 1))}" for i, one in enumerate(elements, first)]
    lines += ["*NSET, NSET=NBALL, GENERATE", f"{n_nodes + 1}, {len(places)}"]
    for axis, name in enumerate(("LEFT", "BOTTOM", "BACK")):
        lines += [f"*NSET, NSET={name}", *rows(np.flatnonzero(mesh.nodes[:, axis] < 1e-9 * LENGTH))]
    top = np.flatnonzero((mesh.nodes[mesh.elements][:, [2, 3, 6, 7], 1] > (1 - 1e-9) * LENGTH).all(axis=1))
    lines += ["*SURFACE, NAME=TOP", *(f"{one + 1}, S5" for one in top)]
    lines += ["*SURFACE, NAME=SPHERE", *(f"{n_elements + 1 + one}, S1" for one in range(len(bricks)))]
    lines += ["*MATERIAL, NAME=M", "*ELASTIC", f"{YOUNG / UNIT:.9e}, {POISSON}"]
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=M" for name in ("BODY", "BALL")]
    lines += ["*SURFACE INTERACTION, NAME=I", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR"]
    lines += [f"{STIFFNESS / UNIT:.6e}, {1e-6 * YOUNG / UNIT:.6e}"]
    lines += ["*CONTACT PAIR, INTERACTION=I, TYPE=NODE TO SURFACE", "TOP, SPHERE"]
    lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", "0.05, 1., 1e-6, 0.25", "*BOUNDARY"]
    lines += ["BOTTOM, 1, 3, 0", "LEFT, 1, 1, 0", "BACK, 3, 3, 0", "NBALL, 1, 1, 0", "NBALL, 3, 3, 0"]
    lines += [f"NBALL, 2, 2, {-DEPTH}", "*NODE PRINT, NSET=NBALL, TOTALS=ONLY", "RF", "*END STEP"]
    return "\n".join(lines) + "\n"


@needs_ccx
@pytest.mark.verification
def test_a_sphere_pushes_as_in_calculix(tmp_path: Path) -> None:
    mesh = graded(8, 1.5, LENGTH)
    ball = ts.Sphere(
        "ball", RADIUS, [[0, 0, LENGTH + RADIUS, 0], [1, 0, LENGTH + RADIUS - DEPTH, 0]], on="top", stiffness=STIFFNESS
    )
    supports = [ts.Fixed("bottom"), ts.Fixed("left", fix=["x"]), ts.Fixed("back", fix=["z"])]
    problem = ts.Problem(mesh, MATERIAL, supports=supports, tools=[ball])
    solution = ts.solve(problem, ts.Fem("saint-venant-kirchhoff", "linear"), ts.Newton(4))
    assert solution.status == ts.Status.CONVERGED

    file = tmp_path / "ball.inp"
    file.write_text(deck(mesh))
    finished = run_ccx(file, threads=1)
    assert finished.code == 0, finished.errors
    printed = file.with_suffix(".dat").read_text().split()
    assert float(printed[-4]) == 1  # the time of the last total
    force = UNIT * np.array([float(one) for one in printed[-3:]])
    assert solution.applied_force(solution.states[-1]) == pytest.approx(force, abs=0.01 * np.abs(force).max())
