"""Bending: the factor of a strip's stiffness by a pure-bending test, and with it the elastica at large deflection."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse
from scipy.sparse.linalg import spsolve

import truespring as ts
from tests.closed_forms import bending_factor, elastica_tip, square_moduli
from truespring.potential import Potential

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


# --- finite elements, and bodies in space ---------------------------------------------------------


def prism(length: int, depth: int, width: int, poisson: float, side: float = 1.0) -> ts.Problem:
    """A prism of cubes, `length` times as long as deep."""
    counts = (length * depth, depth, width)
    return ts.Problem(
        ts.box([side * count for count in counts], counts),
        ts.Material(1.0, poisson),
        None,
        [ts.Fixed("left")],
        [ts.Force("right", (0.0, -1.0, 0.0))],
    )


def turned_ends_factor(problem: ts.Problem, potential: Potential, length: int) -> float:
    """EI over E w H^3 / 12 by linear pure bending: both ends turned as planes, curvature two depths from them."""
    nodes, upper = problem.mesh.nodes, problem.mesh.upper
    x, y = nodes[:, 0], nodes[:, 1] - upper[1] / 2
    depth, width = float(upper[1]), float(upper[2]) if problem.mesh.dim == 3 else 1.0
    held, displacement = np.zeros(nodes.shape, dtype=bool), np.zeros(nodes.shape)
    for end, sign in ((0.0, 1.0), (upper[0], -1.0)):
        at_end = np.isclose(x, end)
        held[at_end, 0], displacement[at_end, 0] = True, sign * y[at_end]
    held[0, 1:] = True  # as a rigid body along y, z and about x
    held[np.flatnonzero((x == 0) & (nodes[:, -1] == upper[-1]))[0], 1] |= problem.mesh.dim == 3
    K, free = potential.hessian(nodes).tocsr(), np.flatnonzero(~held.ravel())
    moved = displacement.ravel()
    moved[free] = spsolve(K[free][:, free].tocsc(), -(K @ moved)[free])
    force = (K @ moved).reshape(nodes.shape)
    at_left = np.isclose(x, 0)
    couple = float((force[at_left, 0] * y[at_left]).sum())

    def turned(column: float) -> float:
        on = np.isclose(x, column)
        return float(np.polyfit(y[on], moved.reshape(nodes.shape)[on, 0], 1)[0])

    curvature = (turned(2 * depth) - turned((length - 2) * depth)) / ((length - 4) * depth)
    return couple / curvature / (width * depth**3 / 12)


# EI(n) / EI of four-node quadrilaterals with full integration in plane stress at 1/3: 1 + 1 / 2 n^2.
SQUARE_ELEMENTS = {1: 1.5, 2: 1.125, 3: 1.0556, 4: 1.0313, 6: 1.0139, 8: 1.0078}


def test_bending_factor_of_finite_elements() -> None:
    told = ts.moduli(strip(4, 2), ts.Springs("lloyd")).fem_bending
    assert dict(told) == pytest.approx(SQUARE_ELEMENTS, abs=6e-5)
    for depth, factor in told.items():
        assert factor == pytest.approx(1 + 1 / (2 * depth**2), rel=1e-9)
    for depth in (1, 2, 3):
        problem = strip(8, depth)
        bent = turned_ends_factor(problem, ts.Fem("linear").potential(problem), 8)
        assert bent == pytest.approx(told[depth], rel=1e-4)


# EI(n) / EI of the isotropic family on n by n cubes, by the stiffness of diagonals through the body.
FAMILY = {0.0: (1.80, 1.22, 1.10), 0.15: (2.25, 1.31, 1.14), 0.3: (2.40, 1.37, 1.17)}


@pytest.mark.parametrize("k_body", FAMILY)
def test_bending_factor_of_cubes(k_body: float) -> None:
    springs = ts.Springs("isotropic", k_body=k_body)
    for depth in (1, 2, 3):
        problem = prism(6, depth, depth, 0.25)
        bent = turned_ends_factor(problem, springs.potential(problem), 6)
        assert bent == pytest.approx(FAMILY[k_body][depth - 1], abs=5.1e-3)
        if depth == 1:
            told = ts.moduli(problem, springs).bending
        assert told[depth] == pytest.approx(bent, rel=1e-5)


MODELS_IN_SPACE = {
    "linear elements": (ts.Fem("linear"), 0.3),
    "mean dilatation": (ts.Fem("linear"), 0.45),
    "projected": (ts.Springs("projected"), 0.25),
    "volume": (ts.Springs("isotropic", volume=True), 0.45),
    "biquadratic": (ts.Springs("biquadratic"), 0.1),
    "single": (ts.Springs("isotropic", sharing="single"), 0.25),
}


@pytest.mark.parametrize("name", MODELS_IN_SPACE)
def test_told_bending_factors_in_space(name: str) -> None:
    """Three elements deep and two wide, as this body is; and square sections."""
    model, poisson = MODELS_IN_SPACE[name]
    problem = prism(6, 3, 2, poisson, side=0.01)
    told = ts.moduli(problem, ts.Springs("isotropic") if isinstance(model, ts.Fem) else model)
    bending = told.fem_bending if isinstance(model, ts.Fem) else told.bending
    assert told.depth == 3
    bent = turned_ends_factor(problem, model.potential(problem), 6)
    assert bending[3] == pytest.approx(bent, rel=1e-4)
    square = prism(6, 2, 2, poisson, side=0.01)
    assert bending[2] == pytest.approx(turned_ends_factor(square, model.potential(square), 6), rel=1e-4)


def test_meshes_that_are_no_lattice_of_bricks_have_no_bending_factor() -> None:
    for mesh in (ts.rectangle((4.0, 2.0), (4, 2), "triangle"), ts.box((2.0, 1.0, 1.0), (2, 1, 1), "tetrahedron")):
        problem = ts.Problem(
            mesh,
            ts.Material(1.0, 0.25),
            ts.PlaneStress(1.0) if mesh.dim == 2 else None,
            [ts.Fixed("left")],
            [ts.Force("right", [1.0] * mesh.dim)],
        )
        told = ts.moduli(problem, ts.Springs("lloyd"))
        assert told.depth is None and not told.bending and not told.fem_bending


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
