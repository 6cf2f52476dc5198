"""Spring bodies in uniform tension, where the lattice has a closed form at any size and load."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from tests.closed_forms import lattice_tension, square_moduli

LLOYD, BULK = (5 / 16, 7 / 16), (3 / 8, 3 / 8)
TIGHT = ts.Newton(load_steps=2, tolerance=1e-12)


def pulled(
    elements: tuple[int, int],
    stress: float,
    side: tuple[float, float] = (1.0, 1.0),
    young: float = 1.0,
    thickness: float = 1.0,
) -> ts.Problem:
    """A block of elements of `side` [m] under nominal `stress` [Pa] on its right side, free to contract."""
    size = (elements[0] * side[0], elements[1] * side[1])
    return ts.Problem(
        mesh=ts.rectangle(size, elements),
        material=ts.Material(young=young, poisson=1 / 3),
        section=ts.PlaneStress(thickness),
        supports=[ts.Fixed(on="left", fix="x"), ts.Fixed(on="left-bottom", fix="y")],
        loads=[ts.Force(on="right", total=(stress * thickness * size[1], 0.0))],
    )


def stretched(problem: ts.Problem, stretch: float, across: float) -> np.ndarray:
    """The displacement of uniform stretches along x and y [m]."""
    return problem.mesh.nodes * (np.array([stretch, across]) - 1)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    columns=st.integers(1, 7),
    rows=st.integers(1, 5),
    stress=st.floats(-0.03, 1.2).filter(lambda stress: abs(stress) > 1e-3),
    young=st.floats(1e2, 1e11),
    thickness=st.floats(1e-4, 1e2),
    side=st.floats(1e-3, 1e1),
    rule=st.sampled_from(["lloyd", "isotropic"]),
)
def test_uniform_tension_of_squares(
    columns: int, rows: int, stress: float, young: float, thickness: float, side: float, rule: str
) -> None:
    problem = pulled((columns, rows), stress * young, (side, side), young, thickness)
    state = ts.solve(problem, ts.Springs(rule=rule), TIGHT).states[-1]
    edge, diagonal = LLOYD if rule == "lloyd" else BULK
    stretch, across = lattice_tension(stress, (1.0, 1.0), (edge, edge), diagonal)
    expected = stretched(problem, stretch, across)
    assert state.load_factor == 1.0
    assert np.abs(state.displacement - expected).max() <= 1e-10 * np.abs(expected).max()
    assert state.reaction.sum(axis=0)[0] == pytest.approx(-problem.loading.external_force.sum(), rel=1e-9)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(
    columns=st.integers(1, 5),
    rows=st.integers(1, 4),
    stress=st.floats(0.05, 0.8),
    # Towards the sqrt(3) where an edge loses its stiffness the block buckles into hourglasses under tension.
    aspect=st.floats(1 / 1.45, 1.45),
)
def test_uniform_tension_of_rectangles(columns: int, rows: int, stress: float, aspect: float) -> None:
    a, b = math.sqrt(aspect), 1 / math.sqrt(aspect)
    problem = pulled((columns, rows), stress, (a, b))
    state = ts.solve(problem, ts.Springs(rule="isotropic"), TIGHT).states[-1]
    # Baudet et al. (2009) at Poisson's ratio 1/3, by element: the closed form knows edges and diagonals only.
    edges = 3 * (3 * b * b - a * a) / 16, 3 * (3 * a * a - b * b) / 16
    stretch, across = lattice_tension(stress * b, (a, b), edges, 3 * (a * a + b * b) / 16)
    expected = stretched(problem, stretch, across)
    assert np.abs(state.displacement - expected).max() <= 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize(
    ("rule", "pair", "second_order"), [("isotropic", BULK, 1 / 3), ("lloyd", LLOYD, 126 / 289)], ids=["bulk", "lloyd"]
)
def test_tension_starts_with_the_modulus_and_stiffens(
    rule: str, pair: tuple[float, float], second_order: float
) -> None:
    """P = E_0 (e + c e^2 + ...), c = 3/2 b (a + b) / (2 a + b)^2: the lattice stiffens in tension."""
    a, b = pair
    assert 1.5 * b * (a + b) / (2 * a + b) ** 2 == pytest.approx(second_order, rel=1e-14)
    young = square_moduli(a, b)["young_0"]
    strains = []
    for stress in (1e-3, 2e-3):
        path = ts.solve(pulled((2, 2), stress), ts.Springs(rule=rule), ts.Newton(load_steps=1))
        strains.append((stress, path.states[-1].displacement[-1, 0] / 2))
    quadratic = [(stress / young - strain) / strain**2 for stress, strain in strains]
    # The third order leaves an error linear in the strain: extrapolate it away.
    assert 2 * quadratic[0] - quadratic[1] == pytest.approx(second_order, abs=1e-5)


@pytest.mark.parametrize(
    ("elements", "rule", "sharing", "young"),
    [
        ((12, 4), "lloyd", "single", 0.580),
        ((24, 8), "lloyd", "single", 0.538),
        ((12, 4), "lloyd", "summed", 15 / 17),
        ((24, 8), "lloyd", "summed", 15 / 17),
        ((1, 1), "lloyd", "single", 15 / 17),
        ((12, 4), "isotropic", "summed", 1.0),
    ],
)
def test_sharing_decides_the_modulus_of_a_block(
    elements: tuple[int, int], rule: str, sharing: str, young: float
) -> None:
    """Stress over the plain mean strain of the end nodes: summed springs keep it, single ones lose half of it."""
    stress = 1e-6
    problem = pulled(elements, stress)
    state = ts.solve(problem, ts.Springs(rule=rule, sharing=sharing), ts.Newton(load_steps=1)).states[-1]
    end = problem.mesh.nodes[:, 0] == elements[0]
    assert stress * elements[0] / state.displacement[end, 0].mean() == pytest.approx(young, abs=5e-4)
    if sharing == "summed":
        assert stress * elements[0] / state.displacement[end, 0].mean() == pytest.approx(young, rel=1e-5)


def test_single_sharing_takes_the_mean_of_the_elements() -> None:
    problem = pulled((3, 2), 0.1)
    summed = ts.Springs(rule="lloyd").potential(problem)
    single = ts.Springs(rule="lloyd", sharing="single").potential(problem)
    assert np.array_equal(summed.springs, single.springs)
    elements_of = np.zeros(len(summed.springs))
    for element in problem.mesh.elements:
        elements_of += np.isin(summed.springs, element).all(axis=1)
    assert set(elements_of) == {1.0, 2.0}
    assert summed.stiffness == pytest.approx(single.stiffness * elements_of)
    length = np.ptp(problem.mesh.nodes[single.springs], axis=1).sum(axis=1)
    assert single.stiffness == pytest.approx(np.where(length == 1, 5 / 16, 7 / 16))


@settings(max_examples=15, deadline=None, derandomize=True)
@given(edge=st.floats(0.05, 5.0), ratio=st.floats(0.5, 2.0), strain=st.floats(0.02, 0.3))
def test_numbers_of_the_users_own_pull_as_their_closed_form(edge: float, ratio: float, strain: float) -> None:
    diagonal = ratio * edge
    stress = strain * square_moduli(edge, diagonal)["young_0"]
    problem = pulled((3, 2), stress)
    state = ts.solve(problem, ts.Springs(stiffness=ts.UserStiffness(edge, diagonal)), TIGHT).states[-1]
    expected = stretched(problem, *lattice_tension(stress, (1.0, 1.0), (edge, edge), diagonal))
    assert np.abs(state.displacement - expected).max() <= 1e-10 * np.abs(expected).max()


def test_range_of_stretch_is_that_of_the_closed_form() -> None:
    stretch, across = lattice_tension(0.5, (1.0, 1.0), BULK[:1] * 2, BULK[1])
    path = ts.solve(pulled((4, 2), 0.5), ts.Springs(rule="isotropic"))
    assert path.states[-1].stretch == pytest.approx((across, stretch), rel=1e-10)
    assert path.states[-1].area_ratio == pytest.approx(stretch * across, rel=1e-10)
    # The closed form itself: stress 0.576671 E stretches to 1.5 and 0.847987.
    assert lattice_tension(0.576671, (1.0, 1.0), BULK[:1] * 2, BULK[1]) == pytest.approx((1.5, 0.847987), abs=1e-6)


def test_negative_springs_are_refused_unless_allowed() -> None:
    problem = pulled((2, 2), 0.1, side=(2.0, 1.0))
    with pytest.raises(ts.TruespringError, match="negative stiffness"):
        ts.Springs(rule="isotropic").potential(problem)
    allowed = ts.Springs(rule="isotropic", allow_negative=True).potential(problem)
    assert allowed.stiffness.min() == pytest.approx(2 * 3 * (3 - 4) / 32)


def test_the_label_says_what_springs_have() -> None:
    assert "volume" in ts.Springs("isotropic", volume=True).label and "volume" not in ts.Springs("isotropic").label
