"""Bodies of several materials: in series and in parallel they agree with closed forms; what regions are."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import truespring as ts
from tests.closed_forms import cube_tension, lame, lattice_tension, material_of, principal_state
from truespring.arrays import Floats
from truespring.models import LAWS

TIGHT = ts.Newton(load_steps=2, tolerance=1e-13)
SOFT, HARD = 1.0, 5.0
KINDS = {
    "quadrilateral": ("linear", "mean-dilatation"),
    "triangle": ("linear", "quadratic"),
    "hexahedron": ("linear", "mean-dilatation"),
    "tetrahedron": ("linear", "quadratic"),
}


def bar(kind: str, cells: tuple[int, ...] = (4, 2, 2)) -> ts.Mesh:
    """Cubes or squares of size 1, or what they are divided into."""
    plane = kind in ("triangle", "quadrilateral")
    counts = cells[:2] if plane else cells
    return (ts.rectangle if plane else ts.box)([float(count) for count in counts], counts, kind)


def body(
    mesh: ts.Mesh,
    supports: list[ts.Fixed],
    hard: ts.Box | str | list[int] | Floats,
    poisson: tuple[float, float],
    loads: tuple[ts.Force, ...] = (),
    law: str = "linear",
) -> ts.Problem:
    """The material SOFT with a region of HARD."""
    return ts.Problem(
        mesh,
        material_of(law, SOFT, poisson[0]),
        ts.PlaneStress(1.0) if mesh.dim == 2 else None,
        supports,
        loads,
        [ts.Region(hard, material_of(law, HARD, poisson[1]))],
    )


def half(mesh: ts.Mesh, axis: int) -> ts.Box:
    """A box that holds the upper half along an axis."""
    lower = mesh.lower.copy()
    lower[axis] = mesh.upper[axis] / 2
    return ts.Box(tuple(lower), tuple(mesh.upper))


def in_series(mesh: ts.Mesh, stress: float, poisson: tuple[float, float], law: str = "linear") -> ts.Problem:
    """Pulled along x, every node held across it: no part hinders another's contraction."""
    across = "yz"[: mesh.dim - 1]
    area = float(mesh.upper[1:].prod())
    load = ts.Force("right", [stress * area] + [0.0] * (mesh.dim - 1))
    supports = [ts.Fixed("left", fix="x"), ts.Fixed(range(mesh.n_nodes), fix=across)]
    return body(mesh, supports, half(mesh, 0), poisson, (load,), law)


def stretches_in_series(path: ts.Solution) -> tuple[float, float]:
    """The stretches of both halves, in which plane sections stay plane."""
    mesh, displacement = path.problem.mesh, path.states[-1].displacement
    assert path.load_factor == 1.0
    moved = []
    for place in (mesh.upper[0] / 2, mesh.upper[0]):
        at = displacement[np.isclose(mesh.nodes[:, 0], place), 0]
        assert np.ptp(at) <= 1e-10 * np.abs(at).max()
        moved.append(float(at.mean()))
    length = mesh.upper[0] / 2
    return 1 + moved[0] / length, 1 + (moved[1] - moved[0]) / length


@pytest.mark.parametrize("stress", [-0.05, 1e-3, 0.3])
def test_squares_in_series(stress: float) -> None:
    """P = 2 k (l - 1) + 2 k (1 - sqrt(2) / sqrt(1 + l^2)) l a cell, k = 3/8 E, at Poisson's ratio 1/3."""
    path = ts.solve(in_series(bar("quadrilateral"), stress, (1 / 3, 1 / 3)), ts.Springs("isotropic"), TIGHT)

    def stretch(young: float) -> float:
        k = 3 / 8 * young

        def excess(x: float) -> float:
            return 2 * k * (x - 1) + 2 * k * (1 - math.sqrt(2) / math.hypot(1, x)) * x - stress

        return brentq(excess, 0.5, 3, xtol=1e-15)

    assert stretches_in_series(path) == pytest.approx((stretch(SOFT), stretch(HARD)), rel=1e-10)


@pytest.mark.parametrize("k_body", [0.0, 0.15])
@pytest.mark.parametrize("stress", [-0.05, 1e-3, 0.3])
def test_cubes_in_series(stress: float, k_body: float) -> None:
    edge, face = 1 / 10 + k_body / 3, 1 / 5 - 2 * k_body / 3
    path = ts.solve(in_series(bar("hexahedron"), stress, (0.25, 0.25)), ts.Springs("isotropic", k_body=k_body), TIGHT)

    def pull(x: float) -> float:
        tilted, through = 1 - math.sqrt(2) / math.hypot(1, x), 1 - math.sqrt(3) / math.sqrt(2 + x * x)
        return 4 * edge * (x - 1) + 8 * face * tilted * x + 4 * k_body * through * x

    expected = [brentq(lambda x, young=young: young * pull(x) - stress, 0.5, 3, xtol=1e-15) for young in (SOFT, HARD)]
    assert stretches_in_series(path) == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("kind", "element"), [(kind, element) for kind, both in KINDS.items() for element in both])
def test_finite_elements_in_series(kind: str, element: str, law: str) -> None:
    stress, poisson = 0.2, (0.3, 0.1)
    mesh = bar(kind)
    path = ts.solve(in_series(mesh, stress, poisson, law), ts.Fem(law, element), TIGHT)

    def stretch(young: float, ratio: float) -> float:
        across = [1.0, None] if mesh.dim == 2 else [1.0, 1.0]

        def excess(along: float) -> float:
            return float(principal_state(law, young, ratio, [along, *across])[1][0]) - stress

        return brentq(excess, 0.9, 1.5, xtol=1e-15)

    expected = (stretch(SOFT, poisson[0]), stretch(HARD, poisson[1]))
    assert stretches_in_series(path) == pytest.approx(expected, rel=1e-10)


def in_parallel(mesh: ts.Mesh, stretch: float, poisson: float, law: str = "linear") -> ts.Problem:
    """Pulled to a stretch along x, the upper half hard, all free across: both halves contract alike."""
    rollers = [ts.Fixed(side, fix=axis) for side, axis in zip(("left", "bottom", "back"), "xyz", strict=True)]
    motion = [(stretch - 1) * mesh.upper[0]] + [0.0] * (mesh.dim - 1)
    supports = [*rollers[: mesh.dim], ts.Fixed("right", fix="x", displacement=motion)]
    return body(mesh, supports, half(mesh, 1), (poisson, poisson), law=law)


def check_parallel(problem: ts.Problem, model: object, stretches: Floats, stress: float) -> None:
    """Uniform stretches, and the force of both halves, `stress` being that of E = 1."""
    mesh = problem.mesh
    path = ts.solve(problem, model, TIGHT)
    state = path.states[-1]
    exact = mesh.nodes * (np.asarray(stretches)[: mesh.dim] - 1)
    assert np.abs(state.displacement - exact).max() <= 1e-10 * np.abs(exact).max()
    area = float(mesh.upper[1:].prod())
    assert path.applied_force(state)[0] == pytest.approx((SOFT + HARD) / 2 * area * stress, rel=1e-10)


@settings(max_examples=4, deadline=None, derandomize=True)
@given(stress=st.floats(-0.1, 0.5).filter(lambda stress: abs(stress) > 1e-3))
def test_springs_in_parallel(stress: float) -> None:
    along, across = lattice_tension(stress, (1.0, 1.0), (3 / 8, 3 / 8), 3 / 8)
    squares = in_parallel(bar("quadrilateral", (3, 2)), along, 1 / 3)
    check_parallel(squares, ts.Springs("isotropic"), np.array([along, across]), stress)
    along, across = cube_tension(stress, (23 / 180, 13 / 90, 1 / 12), 0.0)
    cubes = in_parallel(bar("hexahedron", (2, 2, 2)), along, 0.25)
    check_parallel(cubes, ts.Springs("isotropic"), np.array([along, across, across]), stress)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("kind", "element"), [(kind, element) for kind, both in KINDS.items() for element in both])
def test_finite_elements_in_parallel(kind: str, element: str, law: str) -> None:
    stretches, nominal = principal_state(law, 1.0, 0.3, [1.2, None, None])
    check_parallel(in_parallel(bar(kind), 1.2, 0.3, law), ts.Fem(law, element), stretches, float(nominal[0]))


@pytest.mark.parametrize("springs", [ts.Springs("isotropic", volume=True), ts.Springs("biquadratic")])
def test_springs_of_any_poisson_ratio_in_parallel(springs: ts.Springs) -> None:
    """To first order E1 A1 + E2 A2."""
    problem = in_parallel(bar("hexahedron"), 1 + 1e-7, 0.42)
    path = ts.solve(problem, springs, TIGHT)
    assert path.applied_force(path.states[-1])[0] == pytest.approx((SOFT + HARD) / 2 * 4 * 1e-7, rel=1e-6)


# --- what a region is -----------------------------------------------------------------------------

FIRST, SECOND, THIRD = ts.Material(2.0, 0.1), ts.Material(3.0, 0.2), ts.Material(4.0, 0.4)


def with_regions(*regions: ts.Region, mesh: ts.Mesh | None = None, material: ts.Material | None = FIRST) -> ts.Problem:
    return ts.Problem(
        mesh or ts.rectangle((4.0, 2.0), (4, 2)),
        material,
        ts.PlaneStress(1.0),
        [ts.Fixed("left")],
        [ts.Force("right", (1e-3, 0.0))],
        regions,
    )


def test_where_regions_overlap_the_last_one_counts() -> None:
    left, all_of_it = ts.Box((0.0, 0.0), (2.0, 2.0)), ts.Box((0.0, 0.0), (4.0, 2.0))
    problem = with_regions(ts.Region(left, SECOND), ts.Region([1, 2], THIRD))
    assert problem.materials == (FIRST, SECOND, THIRD)
    assert problem.material_numbers.tolist() == [1, 2, 2, 0, 1, 1, 0, 0]
    turned = with_regions(ts.Region([1, 2], THIRD), ts.Region(left, SECOND))
    assert turned.of_elements(lambda material: material.young).tolist() == [3, 3, 4, 2, 3, 3, 2, 2]
    covered = with_regions(ts.Region(left, SECOND), ts.Region(all_of_it, FIRST))
    one = with_regions()
    for model in (ts.Springs("isotropic"), ts.Fem("neo-hookean")):
        same = [model.potential(problem).energy(problem.mesh.nodes * 1.1) for problem in (covered, one)]
        assert same[0] == pytest.approx(same[1], rel=1e-14)
        assert model.potential(problem).energy(problem.mesh.nodes * 1.1) > 1.1 * same[0]


def test_groups_of_elements_are_regions() -> None:
    plain = ts.rectangle((4.0, 2.0), (4, 2))
    mesh = ts.Mesh(plain.nodes, plain.elements, element_groups={"bone": [6, 0, 6], "nerve": [3]})
    problem = with_regions(ts.Region("bone", SECOND), ts.Region("nerve", THIRD), mesh=mesh)
    assert np.flatnonzero(problem.material_numbers == 1).tolist() == [0, 6]
    assert np.flatnonzero(problem.material_numbers == 2).tolist() == [3]
    with pytest.raises(ts.TruespringError, match=r"'bones' is no group of elements.*bone.*groups: bone, nerve"):
        with_regions(ts.Region("bones", SECOND), mesh=mesh).material_numbers  # noqa: B018


def test_one_material_named_twice_is_one() -> None:
    problem = with_regions(ts.Region([0], SECOND), ts.Region([5], SECOND), ts.Region([1], FIRST))
    assert problem.materials == (FIRST, SECOND)
    assert [twin.material for twin in problem.homogeneous] == [FIRST, SECOND]
    assert all(not twin.regions for twin in problem.homogeneous)
    plain = with_regions()
    assert plain.homogeneous == (plain,)


@pytest.mark.parametrize(
    ("on", "said"),
    [
        ("left", "no group of elements"),
        (ts.Plane("x", 0.0), "selects nodes"),
        (ts.Near((0.0, 0.0)), "selects nodes"),
        (ts.Box((1.9, 0.0), (2.1, 2.0)), "no element with its centre"),
        ([8], "element 8 does not exist: 0 to 7"),
        ([], "selects no element"),
    ],
)
def test_regions_without_elements_are_refused(on: object, said: str) -> None:
    with pytest.raises(ts.TruespringError, match=said):
        ts.solve(with_regions(ts.Region(on, SECOND)), ts.Fem("linear"))


def test_regions_need_a_material_for_the_rest() -> None:
    with pytest.raises(ts.TruespringError, match="regions need a material"):
        with_regions(ts.Region([0], SECOND), material=None)
    with pytest.raises(ts.TruespringError, match="a list of Region"):
        with_regions([0])


def test_what_is_told_of_springs_is_told_of_each_material() -> None:
    """Springs of Poisson's ratio 1/3 in materials of 1/3 and of 0.45: only the second is worth a word."""
    problem = ts.Problem(
        ts.rectangle((4.0, 2.0), (4, 2)),
        ts.Material(1e3, 1 / 3),
        ts.PlaneStress(1.0),
        [ts.Fixed("left")],
        [ts.Force("right", (1e-3, 0.0))],
        ts.Region([0, 1], ts.Material(2e3, 0.45)),
    )
    said = [text for text in ts.solve(problem, ts.Springs("isotropic")).warnings if "Poisson's ratio" in text]
    assert len(said) == 1
    assert said[0].startswith("where E is 2000 Pa and nu 0.45, ")


def test_lames_constants_of_a_region_are_its_own() -> None:
    problem = with_regions(ts.Region([2], THIRD))
    stress = ts.Fem("linear", "linear").potential(problem).stress(problem.mesh.nodes * np.array([1.0, 1.01]))
    for element, material in ((2, THIRD), (3, FIRST)):
        lam, mu = lame(material.young, material.poisson)
        reduced = 2 * lam * mu / (lam + 2 * mu)
        assert stress[1, :, element] == pytest.approx(np.full(4, 0.01 * (reduced + 2 * mu)), rel=1e-12)


def test_a_material_that_no_element_has_does_not_count() -> None:
    """Imported bodies often are regions from end to end."""
    mesh = ts.box((2.0, 1.0, 1.0), (2, 1, 1))
    everywhere = ts.Region([0, 1], ts.Material(2.0, 0.25))
    supports, loads = [ts.Fixed("left")], [ts.Force("right", (1e-3, 0.0, 0.0))]
    named = ts.Problem(mesh, ts.Material(1.0, 0.49), None, supports, loads, [everywhere])
    plain = ts.Problem(mesh, ts.Material(2.0, 0.25), None, supports, loads)
    assert named.materials == plain.materials
    for model in (ts.Springs("isotropic", volume=True), ts.Fem("linear")):
        mine, other = (ts.solve(problem, model, ts.Newton(load_steps=1)) for problem in (named, plain))
        assert mine.states[-1].displacement == pytest.approx(other.states[-1].displacement, rel=1e-12)
        assert mine.warnings == other.warnings
    assert ts.judge(named, ts.Springs("isotropic")).fit
