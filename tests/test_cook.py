"""Cook's membrane: where springs on triangles converge to a wrong answer, which is known before anything is solved."""

import numpy as np
import pytest

import truespring as ts
from truespring.models import findings

# The converged deflection at the middle of the loaded side, in plane stress, nu = 1/3 and E = t = F = 1.
CONVERGED = 23.97
LIGHT = 1e-5  # the share of the unit load that is solved: deflections are linear in it


def cook(n: int, element: str = "quadrilateral", diagonal: str = "right") -> ts.Problem:
    """48 wide, 44 high on the left and 16 on the right, pulled up there; n by n elements or halves of them.

    `diagonal` "right" goes from the first to the third node of each quadrilateral.
    """
    share = np.linspace(0, 1, n + 1)
    along, up = np.meshgrid(share, share)
    bottom, top = 44 * along, 44 + 16 * along
    nodes = np.stack([48 * along, bottom + up * (top - bottom)], axis=-1).reshape(-1, 2)
    return ts.Problem(
        ts.Mesh(nodes, ts.rectangle((1.0, 1.0), (n, n), element, diagonal).elements, element),
        ts.Material(young=1.0, poisson=1 / 3),
        ts.PlaneStress(1.0),
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(0.0, LIGHT))],
    )


def deflection(problem: ts.Problem, model: ts.Springs | ts.Fem) -> float:
    """Upward at (48, 52) for the unit load."""
    path = ts.solve(problem, model, ts.Newton(load_steps=1))
    assert path.status is ts.Status.CONVERGED
    watched = ts.nearest_node(problem.mesh, (48.0, 52.0))
    assert problem.mesh.nodes[watched] == pytest.approx([48, 52])
    return float(path.states[-1].displacement[watched, 1] / LIGHT)


def test_quadrilaterals() -> None:
    """Four nodes with full integration."""
    deflections = [deflection(cook(n), ts.Fem("linear")) for n in (8, 16, 32, 64)]
    assert deflections == pytest.approx([22.0792, 23.4304, 23.8176, 23.9245], abs=6e-5)
    assert deflections[-1] < CONVERGED < deflections[-1] + 0.06


WRONG = {
    ("van-gelder", "right"): 45.338,
    ("lloyd", "right"): 18.088,
    ("van-gelder", "left"): 33.341,
    ("lloyd", "left"): 15.938,
}


@pytest.mark.parametrize(("rule", "diagonal"), WRONG)
def test_springs_on_triangles_are_wrong_and_flagged(rule: str, diagonal: str) -> None:
    problem, springs = cook(64, "triangle", diagonal), ts.Springs(rule)
    assert deflection(problem, springs) == pytest.approx(WRONG[rule, diagonal], abs=1e-3)
    assert abs(WRONG[rule, diagonal] / CONVERGED - 1) > 0.2
    told = ts.moduli(problem, springs)
    assert told.patch_score > 1e-3 and not told.lattice
    assert {"young", "patch-score"} <= {one.code for one in findings(problem, springs)}
    assert len(springs.warnings(problem)) >= 2


def test_the_longer_formula_of_van_gelder_is_refused() -> None:
    """Its negative springs leave no definite matrix."""
    for diagonal in ("right", "left"):
        problem = cook(8, "triangle", diagonal)
        with pytest.raises(ts.TruespringError, match="springs have a negative stiffness"):
            ts.Springs("projected").potential(problem)


@pytest.mark.parametrize("diagonal", ["right", "left", "alternating"])
def test_coupled_springs_are_the_finite_elements(diagonal: str) -> None:
    problem, springs = cook(16, "triangle", diagonal), ts.Springs("biquadratic")
    linear = deflection(problem, ts.Fem("linear", "linear"))
    assert deflection(problem, springs) == pytest.approx(linear, rel=1e-5)
    assert springs.warnings(problem) == ()


def test_coupled_springs_converge() -> None:
    found = [deflection(cook(n, "triangle"), ts.Springs("biquadratic")) for n in (16, 32, 64)]
    gaps = CONVERGED - np.array(found)
    assert gaps[-1] < 0.01 * CONVERGED
    assert (gaps[:-1] / gaps[1:] > 2.5).all()


def test_quadratic_triangles() -> None:
    for diagonal in ("right", "left"):
        assert deflection(cook(16, "triangle", diagonal), ts.Fem("linear", "quadratic")) == pytest.approx(
            CONVERGED, rel=5e-3
        )
