"""The moduli that spring lattices realise: solved on a periodic cell, beside closed forms and `truespring.moduli`."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from tests.closed_forms import square_moduli

THIRD = 1 / 3
LLOYD, BULK, FULL = (5 / 16, 7 / 16), (3 / 8, 3 / 8), (17 / 56, 23 / 56)


def block(
    side: tuple[float, float] = (1.0, 1.0),
    poisson: float = THIRD,
    section: ts.PlaneStress | ts.PlaneStrain | None = None,
    elements: tuple[int, int] = (3, 2),
    young: float = 1.0,
) -> ts.Problem:
    """A block of `elements` of `side` [m]; loaded only because a problem must be."""
    return ts.Problem(
        mesh=ts.rectangle((side[0] * elements[0], side[1] * elements[1]), elements),
        material=ts.Material(young=young, poisson=poisson),
        section=section or ts.PlaneStress(1.0),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(1.0, 0.0))],
    )


def solved_elasticity(problem: ts.Problem, springs: ts.Springs) -> np.ndarray:
    """Voigt elasticity [N/m], shape (3, 3), of the periodic cell that the block is, from its Hessian at rest.

    Opposite sides are one node up to the macroscopic strain: x = A q + B e, and the energy
    1/2 x K x left when q has settled is that of the strain e = (xx, yy, 2 xy) on the cell.
    """
    mesh = problem.mesh
    network = springs.potential(problem)
    middle = mesh.nodes[network.springs].mean(axis=1)
    if springs.sharing == "single":  # a spring on the right or top side is the one on the left or bottom
        kept = (middle < mesh.upper * (1 - 1e-9)).all(axis=1)
        network = ts.SpringNetwork(mesh.nodes, network.springs[kept], network.stiffness[kept])
    K = network.hessian(mesh.nodes).toarray()
    lattice = np.round(mesh.nodes / (mesh.nodes[mesh.elements[0, 2]])).astype(int)
    _, image = np.unique(lattice % lattice.max(axis=0), axis=0, return_inverse=True)
    A = np.kron(np.eye(image.max() + 1)[image.ravel()], np.eye(2))
    x, y = mesh.nodes.T
    zero = np.zeros_like(x)
    B = np.stack([np.stack(u, axis=1).ravel() for u in ((x, zero), (zero, y), (y / 2, x / 2))], axis=1)
    settled = -np.linalg.pinv(A.T @ K @ A, rcond=1e-10, hermitian=True) @ (A.T @ K @ B)
    strained = A @ settled + B
    assert np.abs(A.T @ K @ strained).max() < 1e-12 * np.abs(K).max(), "the cell is not in balance"
    return strained.T @ K @ strained / np.prod(mesh.upper)


def tensile_test(elasticity: np.ndarray, degrees: float) -> tuple[float, float]:
    """Young's modulus and Poisson's ratio of a tensile test along a direction, by turning the stress."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    strain = np.linalg.solve(elasticity, [c * c, s * s, c * s])
    tensor = np.array([[strain[0], strain[2] / 2], [strain[2] / 2, strain[1]]])
    along, across = np.array([c, s]) @ tensor @ [c, s], np.array([-s, c]) @ tensor @ [-s, c]
    return 1 / along, -across / along


TABLE = {
    # rule: E and nu at 0 degrees, E and nu at 45 degrees
    "lloyd": (15 / 17, 7 / 17, 21 / 19, 5 / 19),
    "isotropic": (1.0, THIRD, 1.0, THIRD),
    "projected": (15 / 17, 7 / 17, 21 / 19, 5 / 19),
    "least-squares": (340 / 399, 23 / 57, 460 / 441, 17 / 63),
}


@pytest.mark.parametrize("rule", TABLE)
def test_solved_moduli_of_squares(rule: str) -> None:
    problem, springs = block(young=3e4), ts.Springs(rule=rule)
    told = ts.moduli(problem, springs)
    for elements in ((1, 1), (3, 2)):
        solved = solved_elasticity(block(elements=elements, young=3e4), springs)
        assert told.elasticity == pytest.approx(solved, rel=1e-12, abs=1e-12 * 3e4)
    young_0, poisson_0, young_45, poisson_45 = TABLE[rule]
    for degrees, young, poisson in ((0, young_0, poisson_0), (45, young_45, poisson_45), (90, young_0, poisson_0)):
        assert tensile_test(solved, degrees) == pytest.approx((3e4 * young, poisson), rel=1e-12)
        assert told.young(degrees) == pytest.approx(3e4 * young, rel=1e-12)
        assert told.poisson(degrees) == pytest.approx(poisson, rel=1e-12)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(edge=st.floats(0.01, 10), diagonal=st.floats(0.01, 10), degrees=st.floats(0, 180), single=st.booleans())
def test_told_moduli_are_the_solved_ones(edge: float, diagonal: float, degrees: float, single: bool) -> None:
    problem = block()
    springs = ts.Springs(stiffness=ts.UserStiffness(edge, diagonal), sharing="single" if single else "summed")
    told, solved = ts.moduli(problem, springs), solved_elasticity(problem, springs)
    assert (told.young(degrees), told.poisson(degrees)) == pytest.approx(
        tensile_test(solved, degrees), rel=1e-9, abs=1e-10
    )
    # A single spring an edge is half the sum: the lattice of half the edge stiffness.
    formula = square_moduli(edge / 2 if single else edge, diagonal)
    assert tensile_test(solved, 0) == pytest.approx((formula["young_0"], formula["poisson_0"]), rel=1e-10)
    assert tensile_test(solved, 45) == pytest.approx((formula["young_45"], formula["poisson_45"]), rel=1e-10)
    assert told.zener == pytest.approx(formula["zener"], rel=1e-12)


def test_single_sharing_of_lloyd_on_an_unbounded_mesh() -> None:
    solved = solved_elasticity(block(), ts.Springs(rule="lloyd", sharing="single"))
    assert tensile_test(solved, 0) == pytest.approx((0.495, 0.583), abs=5e-4)


def test_mean_modulus_over_all_directions() -> None:
    """1 / E is a constant and a cosine of four times the angle, whose inverse has the mean sqrt(E_0 E_45)."""
    directions = np.arange(0, 180, 0.5)
    for pair in (LLOYD, FULL, BULK):
        told = ts.moduli(block(), ts.Springs(stiffness=ts.UserStiffness(*pair)))
        formula = square_moduli(*pair)
        mean = math.sqrt(formula["young_0"] * formula["young_45"])
        assert np.mean([told.young(degrees) for degrees in directions]) == pytest.approx(mean, rel=1e-10)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(aspect=st.floats(1 / 1.72, 1.72), length=st.floats(1e-3, 1e3), degrees=st.floats(0, 180))
def test_isotropic_rectangles_are_isotropic(aspect: float, length: float, degrees: float) -> None:
    problem, springs = block((length * aspect, length)), ts.Springs(rule="isotropic")
    solved = solved_elasticity(problem, springs)
    assert solved == pytest.approx(np.array([[9, 3, 0], [3, 9, 0], [0, 0, 3]]) / 8, rel=1e-10, abs=1e-10)
    assert tensile_test(solved, degrees) == pytest.approx((1.0, THIRD), rel=1e-10)
    told = ts.moduli(problem, springs)
    assert (told.young(degrees), told.poisson(degrees), told.zener) == pytest.approx((1.0, THIRD, 1.0), rel=1e-10)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(poisson=st.floats(-0.5, 0.49), young=st.floats(1.0, 1e9), thickness=st.floats(1e-3, 1e3))
def test_fitted_stiffness_of_squares_over_poisson(poisson: float, young: float, thickness: float) -> None:
    """Closed forms of both fits to the four-node element in plane stress, in t E."""
    problem = block(poisson=poisson, young=young, section=ts.PlaneStress(thickness))
    scale = thickness * young / (1 - poisson**2)
    fits = {
        "projected": ((3 + poisson) / 12, (9 + poisson) / 24),
        "least-squares": ((6 - poisson) / 21, (15 + poisson) / 42),
    }
    for rule, (edge, diagonal) in fits.items():
        stiffness = ts.Springs(rule=rule).element_stiffness(problem)
        assert stiffness == pytest.approx(np.tile([scale * edge] * 4 + [scale * diagonal] * 2, (6, 1)), rel=1e-12)


@pytest.mark.parametrize(("rule", "pair"), [("projected", LLOYD), ("least-squares", FULL), ("lloyd", LLOYD)])
def test_fitted_stiffness_at_one_third(rule: str, pair: tuple[float, float]) -> None:
    """The off-diagonal fit is Lloyd's pair of numbers."""
    assert ts.Springs(rule=rule).element_stiffness(block())[0] == pytest.approx([pair[0]] * 4 + [pair[1]] * 2)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(a=st.floats(0.5, 2.0), b=st.floats(0.5, 2.0))
def test_projected_stiffness_of_rectangles(a: float, b: float) -> None:
    """At Poisson's ratio 1/3: k_a = 3 b / 8 a - a / 16 b, k_d = (a^4 + 12 a^2 b^2 + b^4) / (16 a b (a^2 + b^2))."""
    stiffness = ts.Springs(rule="projected").element_stiffness(block((a, b)))
    along, upright = 3 * b / (8 * a) - a / (16 * b), 3 * a / (8 * b) - b / (16 * a)
    diagonal = (a**4 + 12 * a**2 * b**2 + b**4) / (16 * a * b * (a**2 + b**2))
    expected = [along, upright, along, upright, diagonal, diagonal]
    assert stiffness == pytest.approx(np.tile(expected, (6, 1)), rel=1e-10, abs=1e-12)
    aspect = a / b
    assert (stiffness.min() < 0) == (max(aspect, 1 / aspect) > math.sqrt(6))


def test_projected_edge_turns_negative_at_the_square_root_of_six() -> None:
    for aspect, negative in ((2.44, False), (2.46, True)):
        assert (ts.Springs(rule="projected").element_stiffness(block((aspect, 1.0))).min() < 0) == negative


def test_least_squares_is_the_smallest_distance_to_the_element_matrix() -> None:
    problem = block((1.3, 0.8), poisson=0.2)
    hold = ts.Fem(law="linear").potential(
        ts.Problem(
            ts.rectangle((1.3, 0.8), (1, 1)),
            problem.material,
            problem.section,
            [ts.Fixed("left")],
            [ts.Force("right", (1.0, 0.0))],
        )
    )
    nodes = hold.nodes
    target = hold.hessian(nodes).toarray()
    pairs = [(0, 1), (1, 3), (3, 2), (2, 0), (0, 3), (1, 2)]
    fitted = ts.Springs(rule="least-squares").element_stiffness(problem)[0]

    def distance(stiffness: np.ndarray) -> float:
        return float(np.linalg.norm(ts.SpringNetwork(nodes, pairs, stiffness).hessian(nodes).toarray() - target))

    least = distance(fitted)
    assert least > 0.01 * np.linalg.norm(target)
    for change in np.vstack([np.eye(6), -np.eye(6)]) * 1e-3:
        assert distance(fitted + change) > least


@pytest.mark.parametrize(("rule", "pair"), [("projected", (1 / 3, 7 / 15)), ("least-squares", (34 / 105, 46 / 105))])
def test_plane_strain_at_one_quarter_is_plane_stress_at_one_third(rule: str, pair: tuple[float, float]) -> None:
    """E / (1 - 1/16) and 1/4 / (1 - 1/4): all springs times 16/15."""
    problem = block(poisson=0.25, section=ts.PlaneStrain(1.0))
    assert ts.Springs(rule=rule).element_stiffness(problem)[0] == pytest.approx([pair[0]] * 4 + [pair[1]] * 2)


def test_plane_strain_wants_the_moduli_seen_within_the_plane() -> None:
    told = ts.moduli(block(poisson=0.25, section=ts.PlaneStrain(1.0), young=3.0), ts.Springs(rule="projected"))
    assert (told.young_wanted, told.poisson_wanted) == pytest.approx((3 * 16 / 15, THIRD))
    assert told.young() == pytest.approx(15 / 17 * 3 * 16 / 15)


def test_springs_with_other_moduli_than_the_material_say_so() -> None:
    small = ts.Newton(load_steps=1)
    for rule, said in (("lloyd", True), ("isotropic", False)):
        path = ts.solve(block(young=1e6), ts.Springs(rule=rule), small)
        assert any("Young's modulus" in warning for warning in path.warnings) == said
    other = ts.solve(block(poisson=0.45, young=1e6), ts.Springs(rule="isotropic"), small)
    assert any("0.3333" in warning and "0.45" in warning for warning in other.warnings)


def test_edges_without_diagonals_do_not_resist_shear() -> None:
    with pytest.raises(ts.TruespringError, match="every strain"):
        ts.moduli(block(), ts.Springs(stiffness=ts.UserStiffness(0.5, 0.0)))


def test_what_differs_in_another_direction_only_is_said_too() -> None:
    """These springs have the material's moduli along x (nu 0.2) and 0.625 E at 45 degrees."""
    problem = ts.Problem(
        ts.rectangle((4.0, 4.0), (4, 4)),
        ts.Material(1.0, 0.2),
        ts.PlaneStress(1.0),
        [ts.Fixed("left")],
        [ts.Force("right", (0.01, 0.0))],
    )
    path = ts.solve(problem, ts.Springs(stiffness=ts.UserStiffness(edge=5 / 12, diagonal=5 / 24)))
    assert path.moduli is not None
    assert path.moduli.young() == pytest.approx(1.0) and path.moduli.young(45) == pytest.approx(0.625)
    assert any("0.625 Pa" in warning and "45 degrees" in warning for warning in path.warnings)
