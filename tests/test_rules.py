"""Stiffness rules, element by element: their published numbers, what they fit, and what they are not made for."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from tests.names import words
from truespring.arrays import Floats
from truespring.mesh.cells import CELL_SHAPES
from truespring.mesh.kinds import ELEMENT_KINDS
from truespring.models import RULES
from truespring.models.lattices import LATTICES
from truespring.models.rules import ANY_MESH, LatticeModuli, Rule

THIRD = 1 / 3


def one_element(nodes: Floats, element: str, poisson: float, section: object = None, young: float = 1.0) -> ts.Problem:
    """A single element, held and loaded only because a problem must be."""
    nodes = np.asarray(nodes, dtype=float)
    last, dim = nodes.shape[0] - 1, nodes.shape[1]
    return ts.Problem(
        ts.Mesh(nodes, np.arange(last + 1)[None], element),
        ts.Material(young, poisson),
        section or (ts.PlaneStress(1.0) if dim == 2 else None),
        [ts.Fixed(on=range(last))],
        [ts.Force(on=[last], total=[1.0] * dim)],
    )


def brick(*sides: float, poisson: float, section: object = None, young: float = 1.0) -> ts.Problem:
    """One rectangle or brick of these sides [m]."""
    one = (ts.rectangle if len(sides) == 2 else ts.box)(sides, (1,) * len(sides))
    return one_element(one.nodes[one.elements[0]], one.element, poisson, section, young)


def tetrahedron(edge: float, poisson: float) -> ts.Problem:
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])[[0, 2, 1, 3]] * edge / math.sqrt(8)
    return one_element(
        corners if np.linalg.det(corners[1:] - corners[0]) > 0 else corners[[1, 0, 2, 3]], "tetrahedron", poisson
    )


def given_by(rule: str, problem: ts.Problem, **parameters: float) -> Floats:
    return ts.Springs(rule, **parameters).element_stiffness(problem)[0]


# --- squares and rectangles -----------------------------------------------------------------------


@settings(max_examples=30, deadline=None, derandomize=True)
@given(poisson=st.floats(-0.5, 0.49), young=st.floats(1.0, 1e9), thickness=st.floats(1e-3, 1e3))
def test_fits_of_squares_over_poisson(poisson: float, young: float, thickness: float) -> None:
    """Closed forms of both fits to the four-node element in plane stress, in t E."""
    problem = brick(0.7, 0.7, poisson=poisson, young=young, section=ts.PlaneStress(thickness))
    scale = thickness * young / (1 - poisson**2)
    fits = {
        "projected": ((3 + poisson) / 12, (9 + poisson) / 24),
        "least-squares": ((6 - poisson) / 21, (15 + poisson) / 42),
    }
    for rule, (edge, diagonal) in fits.items():
        assert given_by(rule, problem) == pytest.approx([scale * edge] * 4 + [scale * diagonal] * 2, rel=1e-12)


@pytest.mark.parametrize(
    ("rule", "edge", "diagonal"),
    [
        ("lloyd", 5 / 16, 7 / 16),
        ("projected", 5 / 16, 7 / 16),  # the off-diagonal fit is Lloyd's pair of numbers
        ("least-squares", 17 / 56, 23 / 56),
        ("isotropic", 3 / 8, 3 / 8),
        ("biquadratic", 1 / 4, 3 / 8),
    ],
)
def test_squares_at_one_third(rule: str, edge: float, diagonal: float) -> None:
    assert given_by(rule, brick(2.0, 2.0, poisson=THIRD)) == pytest.approx([edge] * 4 + [diagonal] * 2, rel=1e-12)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(a=st.floats(0.5, 2.0), b=st.floats(0.5, 2.0))
def test_rectangles_at_one_third(a: float, b: float) -> None:
    """Projected: k_a = 3 b / 8 a - a / 16 b, k_d = (a^4 + 12 a^2 b^2 + b^4) / (16 a b (a^2 + b^2)).

    Isotropic: k_a = 3 (3 b^2 - a^2) / 16 a b, k_d = 3 (a^2 + b^2) / 16 a b (Baudet et al. 2009).
    """
    problem, aspect = brick(a, b, poisson=THIRD), max(a / b, b / a)
    diagonal = (a**4 + 12 * a**2 * b**2 + b**4) / (16 * a * b * (a**2 + b**2))
    expected = [3 * b / (8 * a) - a / (16 * b), 3 * a / (8 * b) - b / (16 * a)] * 2 + [diagonal] * 2
    projected, isotropic = given_by("projected", problem), given_by("isotropic", problem)
    assert projected == pytest.approx(expected, rel=1e-10, abs=1e-12)
    assert (projected.min() < 0) == (aspect > math.sqrt(6))
    edges = [3 * (3 * b * b - a * a) / (16 * a * b), 3 * (3 * a * a - b * b) / (16 * a * b)]
    diagonals = [3 * (a * a + b * b) / (16 * a * b)]
    assert isotropic == pytest.approx(edges * 2 + diagonals * 2, rel=1e-10, abs=1e-12)
    assert (isotropic.min() < 0) == (aspect > math.sqrt(3))


def test_projected_edge_turns_negative_at_the_square_root_of_six() -> None:
    for aspect, negative in ((2.44, False), (2.46, True)):
        assert (given_by("projected", brick(aspect, 1.0, poisson=THIRD)).min() < 0) == negative


@pytest.mark.parametrize(("rule", "pair"), [("projected", (1 / 3, 7 / 15)), ("least-squares", (34 / 105, 46 / 105))])
def test_plane_strain_at_one_quarter_is_plane_stress_at_one_third(rule: str, pair: tuple[float, float]) -> None:
    """E / (1 - 1/16) and 1/4 / (1 - 1/4): all springs times 16/15."""
    problem = brick(1.0, 1.0, poisson=0.25, section=ts.PlaneStrain(1.0))
    assert given_by(rule, problem) == pytest.approx([pair[0]] * 4 + [pair[1]] * 2)


# --- triangles ------------------------------------------------------------------------------------

triangles = given(
    x=st.floats(-0.5, 1.5), y=st.floats(0.3, 2.0), size=st.floats(1e-3, 1e3), thickness=st.floats(1e-3, 1e2)
)


@settings(max_examples=30, deadline=None, derandomize=True)
@triangles
def test_triangles(x: float, y: float, size: float, thickness: float) -> None:
    """With lengths a, b, c, area A and nu = 1/3: Lloyd's constant and both formulas of Van Gelder (1998)."""
    corners = size * np.array([[0.0, 0.0], [1.0, 0.0], [x, y]])
    problem = one_element(corners, "triangle", THIRD, ts.PlaneStress(thickness), young=3.0)
    scale = 3.0 * thickness
    squares = ((np.roll(corners, -1, axis=0) - corners) ** 2).sum(axis=1)  # of the edges 01, 12, 20
    area = size**2 * y / 2
    assert given_by("lloyd", problem) == pytest.approx([scale * math.sqrt(3) / 4] * 3, rel=1e-12)
    assert given_by("van-gelder", problem) == pytest.approx(scale * area / squares, rel=1e-10)
    others = squares.sum() - 2 * squares
    longer = scale * (area / squares / (1 + THIRD) + THIRD / (1 - THIRD**2) * others / (8 * area))
    assert given_by("projected", problem) == pytest.approx(longer, rel=1e-9, abs=1e-10 * scale)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(poisson=st.floats(-0.4, 0.49), edge=st.floats(1e-3, 1e3))
def test_full_fit_of_equilateral_triangles(poisson: float, edge: float) -> None:
    """2 sqrt(3) / 9 (1 - nu^2), whatever the size; at 1/3 sqrt(3)/4 without any error."""
    corners = edge * np.array([[0.0, 0.0], [1.0, 0.0], [0.5, math.sqrt(3) / 2]])
    fitted = given_by("least-squares", one_element(corners, "triangle", poisson))
    assert fitted == pytest.approx([2 * math.sqrt(3) / (9 * (1 - poisson**2))] * 3, rel=1e-10)


# --- in space -------------------------------------------------------------------------------------


@settings(max_examples=20, deadline=None, derandomize=True)
@given(poisson=st.floats(-0.4, 0.49), edge=st.floats(1e-3, 1e3))
def test_full_fit_of_regular_tetrahedra(poisson: float, edge: float) -> None:
    """sqrt(2) l (1 - nu) / (15 (1 + nu) (1 - 2 nu)): at 1/4 Lloyd's 2 sqrt(2)/25 E l."""
    fitted = given_by("least-squares", tetrahedron(edge, poisson))
    expected = math.sqrt(2) * edge * (1 - poisson) / (15 * (1 + poisson) * (1 - 2 * poisson))
    assert fitted == pytest.approx([expected] * 6, rel=1e-9)


def test_regular_tetrahedra_at_one_quarter() -> None:
    problem = tetrahedron(2.0, 0.25)
    for rule, coefficient in (
        ("lloyd", 2 * math.sqrt(2) / 25),
        ("least-squares", 2 * math.sqrt(2) / 25),
        ("projected", math.sqrt(2) / 12),
        ("van-gelder", math.sqrt(2) / 12),  # E V / l^2 with V = sqrt(2)/12 l^3: here the same
    ):
        assert given_by(rule, problem) == pytest.approx([coefficient * 2.0] * 6, rel=1e-10), rule
    assert given_by("biquadratic", problem) == pytest.approx([0.12964 * 2.0] * 6, rel=1e-4)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
def test_tetrahedra_of_any_shape(seed: int) -> None:
    """Lloyd's l is the edge of a regular tetrahedron of the same volume; Van Gelder: E V / L^2."""
    corners = np.random.default_rng(seed).normal(size=(4, 3))
    volume = np.linalg.det(corners[1:] - corners[0]) / 6
    if volume < 0:
        corners, volume = corners[[1, 0, 2, 3]], -volume
    problem = one_element(corners, "tetrahedron", 0.25)
    regular = (12 * volume / math.sqrt(2)) ** (1 / 3)
    assert given_by("lloyd", problem) == pytest.approx([2 * math.sqrt(2) / 25 * regular] * 6, rel=1e-9)
    lengths = [np.linalg.norm(corners[b] - corners[a]) for a, b in problem.mesh.kind.edges]
    assert given_by("van-gelder", problem) == pytest.approx(volume / np.square(lengths), rel=1e-9)


# Edge, diagonal of a face, diagonal through the body of a cube at Poisson's ratio 1/4, in E h.
CUBES = {
    "least-squares": (29 / 350, 188 / 1575, 41 / 525),
    "projected": (4 / 45, 13 / 90, 11 / 90),
    "isotropic": (23 / 180, 13 / 90, 1 / 12),
}


@pytest.mark.parametrize("rule", CUBES)
def test_cubes_at_one_quarter(rule: str) -> None:
    edge, face, body = CUBES[rule]
    for side in (1.0, 0.02):
        stiffness = given_by(rule, brick(side, side, side, poisson=0.25, young=5.0))
        assert stiffness == pytest.approx(5 * side * np.repeat([edge, face, body], [12, 12, 4]), rel=1e-10)


@pytest.mark.parametrize("k_body", [0.0, 0.1, 0.2, 0.3])
def test_isotropic_family_of_cubes(k_body: float) -> None:
    """1/10 + k/3, 1/5 - 2 k/3, k; as totals 0.4 (8 + 3 A) / (4 + 3 A), 1.2 / (4 + 3 A), A = k_f / k_c (Golec 2020)."""
    stiffness = given_by("isotropic", brick(1.0, 1.0, 1.0, poisson=0.25), k_body=k_body)
    family = (0.1 + k_body / 3, 0.2 - 2 * k_body / 3, k_body)
    assert stiffness == pytest.approx(np.repeat(family, [12, 12, 4]), rel=1e-12, abs=1e-15)
    if k_body:
        ratio = 2 * family[1] / k_body
        assert k_body == pytest.approx(1.2 / (4 + 3 * ratio), rel=1e-12)
        assert 4 * family[0] == pytest.approx(0.4 * (8 + 3 * ratio) / (4 + 3 * ratio), rel=1e-12)


def element_distance(problem: ts.Problem, stiffness: Floats) -> float:
    """Size of the difference of the springs' matrix and the element's, over that of the element's."""
    nodes = problem.mesh.nodes
    target = ts.Fem("linear", "linear").potential(problem).hessian(nodes).toarray()
    springs = ts.SpringNetwork(nodes, problem.mesh.kind.links, stiffness).hessian(nodes).toarray()
    return float(np.linalg.norm(springs - target) / np.linalg.norm(target))


def test_how_near_springs_come_to_the_element() -> None:
    """Relative errors of the matrices, as tabulated; k_body = 1/12 is the nearest of the isotropic family."""
    square, cube, regular = brick(1.0, 1.0, poisson=THIRD), brick(1.0, 1.0, 1.0, poisson=0.25), tetrahedron(1.0, 0.25)
    near = {
        (rule, one.mesh.element): element_distance(one, given_by(rule, one))
        for one in (square, cube, regular)
        for rule in ("least-squares", "projected", "isotropic")
        if one.mesh.element in RULES[rule].elements
    }
    assert [near[rule, "quadrilateral"] for rule in ("least-squares", "projected", "isotropic")] == pytest.approx(
        [0.1176, 0.1270, 0.1796], abs=6e-5
    )
    assert [near[rule, "hexahedron"] for rule in ("least-squares", "projected", "isotropic")] == pytest.approx(
        [0.299, 0.373, 0.415], abs=6e-4
    )
    assert near["least-squares", "tetrahedron"] == pytest.approx(0.2, abs=1e-6)
    family = {k: element_distance(cube, given_by("isotropic", cube, k_body=k)) for k in (0.0, 0.08, 0.0866, 0.3)}
    assert min(family.values()) > near["isotropic", "hexahedron"]
    assert (family[0.0], family[0.3]) == pytest.approx((0.485, 0.77), abs=6e-3)


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), element=st.sampled_from(RULES["least-squares"].elements))
def test_least_squares_is_the_smallest_distance_to_any_element(seed: int, element: str) -> None:
    problem = random_element(element, seed)
    fitted = given_by("least-squares", problem)
    least = element_distance(problem, fitted)
    size = np.abs(fitted).max()
    for change in np.vstack([np.eye(len(fitted)), -np.eye(len(fitted))]) * 1e-3 * size:
        assert element_distance(problem, fitted + change) >= least * (1 - 1e-12)
    assert element_distance(problem, given_by("projected", problem)) > least


@settings(max_examples=15, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), element=st.sampled_from(RULES["projected"].elements))
def test_projected_is_nearest_to_each_block_beside_the_diagonal(seed: int, element: str) -> None:
    problem = random_element(element, seed)
    nodes, dim = problem.mesh.nodes, problem.mesh.dim
    K = ts.Fem("linear", "linear").potential(problem).hessian(nodes).toarray()
    for (a, b), k in zip(problem.mesh.kind.links, given_by("projected", problem), strict=True):
        block = K[dim * a : dim * a + dim, dim * b : dim * b + dim]
        n = (nodes[b] - nodes[a]) / np.linalg.norm(nodes[b] - nodes[a])
        distance = [np.linalg.norm(block + one * np.outer(n, n)) for one in (k, k + 1e-3, k - 1e-3)]
        assert distance[0] <= min(distance[1:])


def random_element(element: str, seed: int) -> ts.Problem:
    """One element of a random shape, not inverted."""
    kind = ELEMENT_KINDS[element]
    generator = np.random.default_rng(seed)
    regular = CELL_SHAPES[kind.vtk].places
    stretched = regular * generator.uniform(0.6, 1.6, kind.dim)
    return one_element(
        stretched + generator.uniform(-0.15, 0.15, regular.shape), element, float(generator.uniform(0.0, 0.4))
    )


# --- what rules are not made for ------------------------------------------------------------------


REGULAR = {
    element: one_element(CELL_SHAPES[kind.vtk].places, element, 0.3)
    for element, kind in ELEMENT_KINDS.items()
    if element != "line"
}
SHAPES = {
    "square": brick(1.3, 1.3, poisson=0.3),
    "rectangle": brick(1.0, 1.2, poisson=0.3),
    "brick": brick(1.0, 1.1, 0.9, poisson=0.3),
}


@pytest.mark.parametrize("element", sorted(ELEMENT_KINDS.keys() - {"line"}))
@pytest.mark.parametrize("rule", RULES)
def test_a_rule_takes_the_elements_that_it_declares(rule: str, element: str) -> None:
    """It works on elements of its shape, on any where it names none, and refuses other kinds and shapes."""
    entry, problem = RULES[rule], REGULAR[element]
    if element not in entry.elements:
        with pytest.raises(ts.TruespringError, match=f"rule = '{rule}' .*{element} elements") as error:
            ts.Springs(rule).element_stiffness(problem)
        named = words(str(error.value).partition("elements")[2]) & RULES.keys()
        assert named == {name for name, other in RULES.items() if element in other.elements}
        return
    shape = entry.shapes.get(element)
    taken = [problem, random_element(element, 5) if shape is None else SHAPES[shape]]
    for one in taken:
        stiffness = ts.Springs(rule).element_stiffness(one)
        assert stiffness.shape == (1, len(one.mesh.kind.links))
        assert np.isfinite(stiffness).all()
    if shape is not None:
        others = [random_element(element, 5), *([SHAPES["rectangle"]] if shape == "square" else [])]
        for other in others:
            with pytest.raises(ts.TruespringError, match=f"rule = '{rule}'") as error:
                ts.Springs(rule).element_stiffness(other)
            named = words(str(error.value)) & RULES.keys()
            assert named > {rule}, "the rules that take such elements are named"
            for one in named - {rule}:
                ts.Springs(one).element_stiffness(other)


def test_a_rule_declares_elements_and_shapes_that_there_are() -> None:
    for entry in RULES.values():
        assert entry.idea and entry.source
        assert set(entry.elements) <= set(ELEMENT_KINDS) - {"line"}
        assert entry.shapes.keys() <= set(entry.elements)


def realised(entry: Rule, element: str) -> list[tuple[str, LatticeModuli]]:
    """The lattices of a kind of element for which a rule states its moduli."""
    of_element = [name for name, make in LATTICES.items() if make().element == element]
    return [(name, one) for one in entry.moduli for name in of_element if one.lattice in (name, ANY_MESH)]


def check_moduli(rule: str, entry: Rule, element: str) -> None:
    """The stated moduli are those that `moduli` computes, on a lattice at least of each kind of element."""
    stated = realised(entry, element)
    assert stated, f"{rule} states no moduli on {element} elements"
    for lattice, one in stated:
        mesh = LATTICES[lattice]()
        for poisson in (0.1, 0.3) if one.at is None else (one.at,):
            problem = held(mesh, poisson)
            found = ts.moduli(problem, ts.Springs(rule, allow_negative=True))
            assert found.lattice, lattice
            expected = (poisson, poisson) if one.poisson is None else one.poisson
            assert found.young_range == pytest.approx(one.young, abs=6e-5), f"E of {rule} on {lattice}"
            assert found.poisson_range == pytest.approx(expected, abs=6e-5), f"Poisson's ratio of {rule} on {lattice}"


def held(mesh: ts.Mesh, poisson: float) -> ts.Problem:
    """A body with E = 1, held and loaded only because a problem must be."""
    last = mesh.n_nodes - 1
    section = ts.PlaneStress(1.0) if mesh.dim == 2 else None
    supports, load = [ts.Fixed(on=range(last))], ts.Force(on=[last], total=[1.0] * mesh.dim)
    return ts.Problem(mesh, ts.Material(1.0, poisson), section, supports, load)


@pytest.mark.parametrize(("rule", "element"), [(rule, one) for rule in RULES for one in RULES[rule].elements])
def test_stated_moduli_are_the_computed_ones(rule: str, element: str) -> None:
    check_moduli(rule, RULES[rule], element)


def test_wrong_statements_fail() -> None:
    squares = LatticeModuli("squares", (0.9, 21 / 19), (5 / 19, 7 / 17))
    with pytest.raises(AssertionError, match="E of lloyd on squares"):
        check_moduli("lloyd", replace(RULES["lloyd"], moduli=(squares,)), "quadrilateral")
    with pytest.raises(AssertionError, match="states no moduli"):
        check_moduli("lloyd", replace(RULES["lloyd"], moduli=(squares,)), "triangle")


def test_stated_moduli_in_words() -> None:
    squares = LatticeModuli("squares", (15 / 17, 21 / 19), (5 / 19, 7 / 17))
    assert str(squares) == "squares: 0.882 to 1.105 E, Poisson's ratio 0.263 to 0.412"
    assert str(LatticeModuli("cubes", poisson=(0.25, 0.25), at=1 / 3)) == "cubes (nu = 1/3): E, Poisson's ratio 1/4"
    assert str(LatticeModuli(ANY_MESH)) == "any mesh: E, Poisson's ratio of the material"


@settings(max_examples=20, deadline=None, derandomize=True)
@given(factor=st.floats(1e-3, 1e3), size=st.floats(1e-3, 1e3), rule=st.sampled_from(sorted(RULES)))
def test_stiffness_scales_with_young_and_in_space_with_size(factor: float, size: float, rule: str) -> None:
    for element in RULES[rule].elements:
        shape = RULES[rule].shapes.get(element)
        one = random_element(element, 5) if shape is None else SHAPES[shape]
        assert one.material is not None
        grown = one_element(one.mesh.nodes * size, element, one.material.poisson, young=factor)
        expected = given_by(rule, one) * factor * (size if one.mesh.dim == 3 else 1.0)
        assert given_by(rule, grown) == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_rules_for_bricks_refuse_other_shapes() -> None:
    skewed = np.array([[0.0, 0.0], [1.0, 0.0], [1.2, 1.0], [0.2, 1.0]])
    open_shape = np.array([[0.0, 0.0], [1.0, 0.0], [1.1, 1.1], [0.0, 1.0]])
    for corners in (skewed, open_shape):
        problem = one_element(corners, "quadrilateral", THIRD)
        for rule in ("lloyd", "isotropic"):
            with pytest.raises(ts.TruespringError, match=r"rectangles.* 1 elements"):
                ts.Springs(rule).element_stiffness(problem)
    with pytest.raises(ts.TruespringError, match=r"squares.*1 m by 1\.1 m"):
        ts.Springs("lloyd").element_stiffness(brick(1.0, 1.1, poisson=THIRD))
    twisted = ts.box((1.0, 1.0, 1.0), (1, 1, 1)).nodes[[0, 1, 3, 2, 4, 5, 7, 6]] + np.eye(8)[:, 6:7] * 0.1
    with pytest.raises(ts.TruespringError, match="bricks"):
        ts.Springs("isotropic").element_stiffness(one_element(twisted, "hexahedron", 0.25))


def test_turned_bricks_are_bricks() -> None:
    """Rules do not care how elements stand in space."""
    turn = np.linalg.qr(np.random.default_rng(8).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    straight = brick(1.0, 1.2, 0.9, poisson=0.25)
    turned = one_element(straight.mesh.nodes @ turn.T, "hexahedron", 0.25)
    for rule in ("isotropic", "projected", "least-squares"):
        assert given_by(rule, turned) == pytest.approx(given_by(rule, straight), abs=1e-12)


def test_parameters_go_with_the_rule_that_has_them() -> None:
    cube = brick(1.0, 1.0, 1.0, poisson=0.25)
    with pytest.raises(ts.TruespringError, match=r"'projected' .*k_body.* isotropic"):
        ts.Springs("projected", k_body=0.1).element_stiffness(cube)
    with pytest.raises(ts.TruespringError, match="must be finite"):
        ts.Springs("isotropic", k_body=math.nan)
    with pytest.raises(ts.TruespringError, match="k_body"):
        ts.Springs(stiffness=ts.UserStiffness(0.1), k_body=0.1)
    with pytest.raises(ts.TruespringError, match=r"unknown.*lloyd"):
        ts.Springs("loyd")


def test_numbers_of_the_users_own_in_space() -> None:
    """In units of E times the edge of a cube of the element's volume."""
    own = ts.Springs(stiffness=ts.UserStiffness(edge=0.1, diagonal=0.2, body=0.3))
    stiffness = own.element_stiffness(brick(1.0, 2.0, 4.0, poisson=0.25, young=3.0))[0]
    assert stiffness == pytest.approx(3 * 2 * np.repeat([0.1, 0.2, 0.3], [12, 12, 4]), rel=1e-12)


def test_each_element_has_springs_of_its_own_material() -> None:
    """Sums over elements that differ: the spring between them has half of each."""
    mesh = ts.rectangle((2.0, 1.0), (2, 1))
    soft, hard = ts.Material(1.0, THIRD), ts.Material(9.0, THIRD)
    problem = ts.Problem(
        mesh, soft, ts.PlaneStress(1.0), [ts.Fixed("left")], [ts.Force("right", (1.0, 0.0))], [ts.Region([1], hard)]
    )
    for rule in RULES:
        if "quadrilateral" in RULES[rule].elements:
            stiffness = ts.Springs(rule).element_stiffness(problem)
            assert stiffness[1] == pytest.approx(9 * stiffness[0], rel=1e-12)
    network = ts.Springs("lloyd").potential(problem)
    between = np.flatnonzero((network.springs == [1, 4]).all(axis=1))
    assert network.stiffness[between] == pytest.approx([(1 + 9) * 5 / 16], rel=1e-12)


@pytest.mark.parametrize(
    ("mesh", "springs", "said"),
    [
        (ts.rectangle((2.0, 1.0), (2, 1)), ts.Springs("isotropic", k_body=0.2), "k_body .*bricks"),
        (ts.rectangle((2.0, 1.0), (2, 1)), ts.Springs(stiffness=ts.UserStiffness(0.4, 0.4, 0.1)), "body = 0.1"),
        (ts.rectangle((2.0, 1.0), (2, 1), "triangle"), ts.Springs(stiffness=ts.UserStiffness(0.4, 0.4)), "diagonal"),
        (ts.rectangle((2.0, 1.0), (2, 1)), ts.Springs("lloyd", k_body=0.2), "'lloyd' .*k_body.* isotropic"),
    ],
)
def test_what_a_mesh_has_no_use_for_is_refused(mesh: ts.Mesh, springs: ts.Springs, said: str) -> None:
    load = ts.Force("right", (1.0, 0.0))
    problem = ts.Problem(mesh, ts.Material(1.0, 0.3), ts.PlaneStress(1.0), [ts.Fixed("left")], load)
    with pytest.raises(ts.TruespringError, match=said):
        springs.potential(problem)
