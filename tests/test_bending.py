"""Bending: the factor of a strip's stiffness by a pure-bending test, and with it the elastica at large deflection."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.sparse.linalg import spsolve

import truespring as ts
from tests.closed_forms import bending_factor, elastica_tip, square_moduli

LLOYD, BULK = (5 / 16, 7 / 16), (3 / 8, 3 / 8)
RULES = {"lloyd": LLOYD, "isotropic": BULK}
DEPTHS = (1, 2, 3, 4, 8)


def strip(length: int, depth: int, side: float = 1.0, aspect: float = 1.0) -> ts.Problem:
    """A strip of `length` depths, `depth` elements high, each `aspect` times wider than its height `side` [m]."""
    columns = round(length * depth / aspect)
    return ts.Problem(
        mesh=ts.rectangle((columns * aspect * side, depth * side), (columns, depth)),
        material=ts.Material(young=1.0, poisson=1 / 3),
        section=ts.PlaneStress(1.0),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -1.0))],
    )


def bent_factor(problem: ts.Problem, potential: ts.SpringNetwork, length: int) -> float:
    """EI over E t H^3 / 12 by linear pure bending: couples on both ends, curvature two depths from them."""
    mesh = problem.mesh
    x, y = mesh.nodes.T
    depth = float(mesh.upper[1])
    ends = np.where(x == 0, -1.0, 0.0) + np.where(x == x.max(), 1.0, 0.0)
    force = np.zeros_like(mesh.nodes)
    force[:, 0] = ends * (y - depth / 2)
    couple = float((force[ends > 0, 0] * (y[ends > 0] - depth / 2)).sum())
    # Three directions hold the strip as a rigid body; the couples are in balance without them.
    first, last = int(np.flatnonzero((x == 0) & (y == 0))[0]), int(np.flatnonzero((x == x.max()) & (y == 0))[0])
    free = np.setdiff1d(np.arange(2 * mesh.n_nodes), [2 * first, 2 * first + 1, 2 * last + 1])
    K = sparse.csc_array(potential.hessian(mesh.nodes))[free][:, free]
    displacement = np.zeros(2 * mesh.n_nodes)
    displacement[free] = spsolve(K.tocsc(), force.ravel()[free])
    along = displacement.reshape(-1, 2)[:, 0]

    def turned(column: float) -> float:
        on = np.abs(x - column) < 1e-9 * depth
        return float(-np.polyfit(y[on], along[on], 1)[0])

    columns = np.unique(np.round(x / depth, 9)) * depth
    left = float(columns[columns >= 2 * depth * (1 - 1e-9)][0])
    right = float(columns[columns <= (length - 2) * depth * (1 + 1e-9)][-1])
    curvature = (turned(right) - turned(left)) / (left - right)
    return couple / curvature / (depth**3 / 12)


@pytest.mark.parametrize("sharing", ["summed", "single"])
@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("rule", RULES)
def test_bending_factor(rule: str, depth: int, sharing: str) -> None:
    problem, springs = strip(8, depth), ts.Springs(rule=rule, sharing=sharing)
    bent = bent_factor(problem, springs.potential(problem), 8)
    assert bent == pytest.approx(bending_factor(*RULES[rule], depth, single=sharing == "single"), rel=1e-4)
    told = ts.moduli(problem, springs)
    assert told.depth == depth
    assert told.bending[depth] == pytest.approx(bent, rel=1e-4)


# EI(n) / EI for n = 1, 2, 3, 4, 6, 8 elements, to the digits tabulated.
TABLE = {
    ("lloyd", "summed"): (1.8750, 1.1305, 0.9926, 0.9444, 0.9099, 0.8979),
    ("isotropic", "summed"): (2.2500, 1.3125, 1.1389, 1.0781, 1.0347, 1.0195),
    ("lloyd", "single"): (1.875, 1.074, 0.856, 0.757, 0.663, 0.619),
}


@pytest.mark.parametrize(("rule", "sharing"), TABLE)
def test_told_bending_factors(rule: str, sharing: str) -> None:
    told = ts.moduli(strip(4, 2), ts.Springs(rule=rule, sharing=sharing)).bending
    assert set(told) == {1, 2, 3, 4, 6, 8}
    digits = 5e-4 if sharing == "single" else 5e-5
    assert [told[n] for n in sorted(told)] == pytest.approx(TABLE[rule, sharing], abs=digits)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(edge=st.floats(0.05, 3), diagonal=st.floats(0.05, 3), depth=st.integers(1, 12), single=st.booleans())
def test_told_bending_factor_of_the_users_own_numbers(edge: float, diagonal: float, depth: int, single: bool) -> None:
    springs = ts.Springs(stiffness=ts.UserStiffness(edge, diagonal), sharing="single" if single else "summed")
    told = ts.moduli(strip(2, depth), springs).bending[depth]
    assert told == pytest.approx(bending_factor(edge, diagonal, depth, single), rel=1e-9)
    if not single:
        modulus = square_moduli(edge, diagonal)["young_0"]
        assert told == pytest.approx(modulus * (1 - 1 / depth**2) + 6 * edge / depth**2, rel=1e-9)


@pytest.mark.parametrize("aspect", [2 / 3, 1.5])
def test_bending_factor_of_rectangles(aspect: float) -> None:
    problem, springs = strip(9, 4, aspect=aspect), ts.Springs(rule="isotropic")
    bent = bent_factor(problem, springs.potential(problem), 9)
    assert ts.moduli(problem, springs).bending[4] == pytest.approx(bent, rel=1e-4)


def test_the_formula_of_pure_bending_is_the_one_of_both_sharings() -> None:
    """Summed it is e_0 (1 - 1/n^2) + 6 a / n^2; a single spring an edge tends to half the edge stiffness."""
    for a, b in RULES.values():
        e_0 = square_moduli(a, b)["young_0"]
        assert bending_factor(a, b, 3) == pytest.approx(e_0 * 8 / 9 + 6 * a / 9, rel=1e-14)
        far = square_moduli(a / 2, b)["young_0"]
        assert bending_factor(a, b, 4000, single=True) == pytest.approx(far, rel=2e-3)


# Bisshopp and Drucker (1945) as tabulated by Mattiasson (1981): deflection, shortening, slope.
MATTIASSON = {
    1: (0.30172, 0.05643, 0.46135),
    2: (0.49346, 0.16064, 0.78175),
    5: (0.71379, 0.38763, 1.21537),
    10: (0.81061, 0.55500, 1.43029),
}


@pytest.mark.parametrize("alpha", MATTIASSON)
def test_elastica_is_that_of_the_literature(alpha: int) -> None:
    slope, deflection, shortening = elastica_tip(alpha)
    assert (deflection, shortening, slope) == pytest.approx(MATTIASSON[alpha], abs=6e-6)


@pytest.mark.parametrize("rule", RULES)
def test_cantilever_follows_the_elastica(rule: str) -> None:
    """L/H = 20, four elements deep: the elastica at alpha over the bending factor, within 0.3 %."""
    body = strip(20, 4, side=0.01)
    height, length = body.mesh.upper[1], body.mesh.upper[0]
    full = 3.0 * height**3 / 12 / length**2
    problem = ts.Problem(
        body.mesh, body.material, body.section, body.supports, [ts.Force(on="right", total=(0.0, -full))]
    )
    path = ts.solve(problem, ts.Springs(rule=rule), ts.Newton(load_steps=3))
    assert path.status is ts.Status.CONVERGED
    tip = ts.named_point(problem.mesh, "right-middle")
    factor = bending_factor(*RULES[rule], 4)
    for alpha in (1, 2, 3):
        state = path.at(alpha / 3)
        assert state is not None
        _, deflection, shortening = elastica_tip(alpha / factor)
        assert -state.displacement[tip, 1] / length == pytest.approx(deflection, rel=3e-3)
        assert -state.displacement[tip, 0] / length == pytest.approx(shortening, rel=4e-3)
        # Without the factor the elastica is missed: the test can tell the lattices apart.
        assert abs(-state.displacement[tip, 1] / length / elastica_tip(alpha)[1] - 1) > 6e-3
