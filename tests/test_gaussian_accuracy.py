"""Accuracy of Gaussian springs: against finite elements refined and extrapolated, and on an organ of voxels."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial import KDTree

import truespring as ts
from truespring.arrays import Floats
from truespring.study import read_study

pytestmark = pytest.mark.verification

EXAMPLES = Path(__file__).parent.parent / "examples"
NEWTON = ts.Newton(load_steps=2)
NEO_HOOKEAN = ts.Fem("neo-hookean")


def strip(force: tuple[float, float]) -> Callable[[int], ts.Problem]:
    """A strip of 16 n by 4 n squares in plane stress, held on the left."""

    def problem(n: int) -> ts.Problem:
        mesh = ts.rectangle((0.16, 0.04), (16 * n, 4 * n))
        supports, load = [ts.Fixed("left")], [ts.Force("right", force)]
        return ts.Problem(mesh, ts.Material(1e4, 1 / 3), ts.PlaneStress(0.01), supports, load)

    return problem


def block(poisson: float) -> Callable[[int], ts.Problem]:
    """A block of 16 n by 4 n by 4 n cubes, held on the left and bent by half its length."""

    def problem(n: int) -> ts.Problem:
        mesh = ts.box((0.16, 0.04, 0.04), (16 * n, 4 * n, 4 * n))
        supports, load = [ts.Fixed("left")], [ts.Force("right", (0.0, -0.17, 0.0))]
        return ts.Problem(mesh, ts.Material(1e4, poisson), None, supports, load)

    return problem


def displacement(problem: ts.Problem, model: ts.Springs | ts.Fem, at: Floats) -> Floats:
    """Displacement at full load of the nodes at positions [m], shape (n, dim)."""
    path = ts.solve(problem, model, NEWTON)
    assert path.status is ts.Status.CONVERGED
    distance, nodes = KDTree(problem.mesh.nodes).query(at)
    assert distance.max() < 1e-9
    return np.asarray(path.states[-1].displacement[nodes])


def truth(problem: Callable[[int], ts.Problem], refinements: tuple[int, int, int], at: Floats) -> Floats:
    """Displacement of finite elements on three meshes, extrapolated with the order that they show [m]."""
    a, b, c = (displacement(problem(n), NEO_HOOKEAN, at) for n in refinements)
    ratio = np.linalg.norm(b - a) / np.linalg.norm(c - b)

    def sizes(order: float) -> Floats:
        return np.array(refinements, dtype=float) ** -order

    def gap(order: float) -> float:
        coarse, middle, fine = sizes(order)
        return float((coarse - middle) / (middle - fine) - ratio)

    _, middle, fine = sizes(brentq(gap, 0.8, 3.0))
    return np.asarray(c + (c - b) * fine / (middle - fine))


def rms(found: Floats, expected: Floats) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.mark.parametrize(
    ("name", "problem", "refinements", "most"),
    [
        ("bending", strip((0.0, -0.0428)), (2, 4, 8), 0.006),
        ("stretching", strip((1.2, 0.0)), (2, 4, 8), 0.001),
        ("block, nu 0.45", block(0.45), (1, 2, 3), 0.008),
        ("block, nu 0.49", block(0.49), (1, 2, 3), 0.010),
    ],
)
def test_error_against_the_truth(
    name: str, problem: Callable[[int], ts.Problem], refinements: tuple[int, int, int], most: float
) -> None:
    coarse = problem(1)
    at = coarse.mesh.nodes
    expected = truth(problem, refinements, at)
    assert name == "stretching" or 0.4 * 0.16 < np.abs(expected[:, 1]).max() < 0.6 * 0.16
    error = rms(displacement(coarse, ts.Springs("gaussian"), at), expected)
    print(
        f"{name}: Gaussian {100 * error:.3f} %, FEM {100 * rms(displacement(coarse, NEO_HOOKEAN, at), expected):.3f} %"
    )
    assert error <= most


@pytest.mark.parametrize("poisson", [0.45, 0.49])
def test_organ_of_voxels(poisson: float) -> None:
    """By the default of `hourglass` for voxels: displacements, and the force on the grasped nodes, a vector."""
    study = read_study(EXAMPLES / "organ.toml")
    whole = study.problem
    assert whole.material is not None
    problem = replace(whole, material=replace(whole.material, poisson=poisson))
    grasped = np.flatnonzero(problem.loading.motion().any(axis=1))
    springs, fem = (ts.solve(problem, model, study.solver) for model in (ts.Springs("gaussian"), NEO_HOOKEAN))
    assert springs.status is fem.status is ts.Status.CONVERGED
    error = ts.compare(springs, fem).rms_error
    assert error is not None
    forces = [path.states[-1].reaction[grasped].sum(axis=0) for path in (springs, fem)]
    corner = problem.mesh.smallest_area_ratio(springs.states[-1].positions)
    apart = float(np.linalg.norm(forces[0] - forces[1]))
    print(f"organ, nu {poisson}: rms {100 * error:.3f} %, force off by {1e3 * apart:.3f} mN of", end=" ")
    print(f"{1e3 * np.linalg.norm(forces[1]):.3f}, smallest corner {corner:.3f}, {springs.cost.linear}")
    assert error <= 0.0035
    assert apart <= 1e-4
    assert corner > 0
