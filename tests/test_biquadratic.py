"""Biquadratic springs are St. Venant-Kirchhoff finite elements: one function, whatever element and Poisson ratio."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from tests.meshes import random_mesh
from truespring.arrays import Floats
from truespring.models import RULES, BiquadraticSprings

PLANE = {"plane stress": ts.PlaneStress(0.3), "plane strain": ts.PlaneStrain(0.3)}
CASES = [
    (element, section)
    for element in RULES["biquadratic"].elements
    for section in (PLANE if element in ("triangle", "quadrilateral") else ("solid",))
]
ROUNDING = 1e-12


def body(mesh: ts.Mesh, section: str, poisson: float, young: float = 3e3, **more: object) -> ts.Problem:
    return ts.Problem(
        mesh,
        ts.Material(young, poisson),
        PLANE.get(section),
        [ts.Fixed(on=range(mesh.n_nodes - 1))],
        [ts.Force(on=[mesh.n_nodes - 1], total=[1.0] * mesh.dim)],
        **more,
    )


def apart(one: Floats, other: Floats) -> float:
    """The size of a difference over that of what is compared with."""
    size = float(np.linalg.norm(other))
    assert size > 0
    return float(np.linalg.norm(one - other)) / size


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    case=st.sampled_from(CASES),
    poisson=st.floats(-0.9, 0.49),
    strain=st.floats(0.05, 0.5),
)
def test_energy_force_and_tangent_are_those_of_the_finite_element(
    seed: int, case: tuple[str, str], poisson: float, strain: float
) -> None:
    generator = np.random.default_rng(seed)
    mesh = random_mesh(case[0], generator)
    problem = body(mesh, case[1], poisson)
    springs = ts.Springs("biquadratic").potential(problem)
    fem = ts.Fem("saint-venant-kirchhoff", "linear").potential(problem)
    assert isinstance(springs, BiquadraticSprings)
    size = np.ptp(mesh.nodes, axis=0).max()
    positions = mesh.nodes + strain * size * generator.uniform(-1, 1, mesh.nodes.shape)  # turned inside out or not
    assert springs.energy(positions) == pytest.approx(fem.energy(positions), rel=ROUNDING)
    assert apart(springs.gradient(positions), fem.gradient(positions)) < ROUNDING
    assert apart(springs.hessian(positions).toarray(), fem.hessian(positions).toarray()) < ROUNDING
    at_rest = springs.hessian(mesh.nodes).toarray()
    assert apart(at_rest, ts.Fem("linear", "linear").potential(problem).hessian(mesh.nodes).toarray()) < ROUNDING


def test_every_kind_of_element_is_tried() -> None:
    assert len(CASES) == 8 and {element for element, _ in CASES} == set(RULES["biquadratic"].elements)


def test_another_poisson_ratio_is_noticed() -> None:
    mesh = random_mesh("hexahedron", np.random.default_rng(3))
    positions = mesh.nodes * 1.1
    energies = [ts.Springs("biquadratic").potential(body(mesh, "solid", nu)).energy(positions) for nu in (0.3, 0.3001)]
    assert abs(energies[1] / energies[0] - 1) > 1e-5


@settings(max_examples=20, deadline=None, derandomize=True)
@given(x=st.floats(-0.6, 1.6), y=st.floats(0.2, 2.0), poisson=st.floats(-0.5, 0.49))
def test_triangles_as_delingette_writes_them(x: float, y: float, poisson: float) -> None:
    """W = sum k_i/4 q_i^2 + sum c_ij/2 q_i q_j by the angles a_i opposite the edges (Delingette 2008).

    k_i = E t (2 cot^2 a_i + 1 - nu) / (16 (1 - nu^2) A), c_ij = E t (2 cot a_i cot a_j + nu - 1) / (16 (1 - nu^2) A).
    """
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [x, y]])
    springs = ts.Springs("biquadratic").potential(
        body(ts.Mesh(corners, [[0, 1, 2]], "triangle"), "plane stress", poisson)
    )
    assert isinstance(springs, BiquadraticSprings)
    cotangents = []
    for opposite in (2, 0, 1):  # of the edges 01, 12, 20
        a, b = corners[(opposite + 1) % 3] - corners[opposite], corners[(opposite + 2) % 3] - corners[opposite]
        cotangents.append(float(a @ b) / abs(a[0] * b[1] - a[1] * b[0]))
    area = y / 2
    scale = 3e3 * 0.3 / (16 * (1 - poisson**2) * area)
    cot = np.array(cotangents)
    expected = scale * (2 * np.outer(cot, cot) + poisson - 1)
    np.fill_diagonal(expected, scale * (2 * cot**2 + 1 - poisson))
    assert springs.coupling[0] == pytest.approx(expected / 4, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_a_regular_tetrahedron_in_numbers() -> None:
    """4 L^2 of the stiffness of links at 1/4: 0.12964 by itself, -0.01179 adjacent, 0.03536 opposite, in E L."""
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])[[0, 2, 1, 3]] / np.sqrt(8)
    mesh = ts.Mesh(
        corners if np.linalg.det(corners[1:] - corners[0]) > 0 else corners[[1, 0, 2, 3]], [[0, 1, 2, 3]], "tetrahedron"
    )
    springs = ts.Springs("biquadratic").potential(body(mesh, "solid", 0.25, young=1.0))
    assert isinstance(springs, BiquadraticSprings)
    stiffness = 8 * springs.coupling[0]
    pairs = [set(link) for link in mesh.kind.links]
    for i, one in enumerate(pairs):
        for j, other in enumerate(pairs):
            expected = 0.12964 if i == j else -0.01179 if one & other else 0.03536
            assert stiffness[i, j] == pytest.approx(expected, abs=6e-6)


def test_two_materials() -> None:
    for element, section in CASES:
        mesh = random_mesh(element, np.random.default_rng(12))
        problem = body(mesh, section, 0.3, regions=[ts.Region([0], ts.Material(5e4, 0.1))])
        positions = mesh.nodes + 0.1 * np.random.default_rng(1).normal(size=mesh.nodes.shape) * np.ptp(mesh.nodes)
        springs, fem = (
            ts.Springs("biquadratic").potential(problem),
            ts.Fem("saint-venant-kirchhoff", "linear").potential(problem),
        )
        assert springs.energy(positions) == pytest.approx(fem.energy(positions), rel=ROUNDING)
        assert apart(springs.gradient(positions), fem.gradient(positions)) < ROUNDING
        assert apart(springs.hessian(positions).toarray(), fem.hessian(positions).toarray()) < ROUNDING


@pytest.mark.parametrize("element", ["hexahedron", "tetrahedron", "bcc-tetrahedron"])
def test_a_bent_body_is_the_same_by_both(element: str) -> None:
    """A whole path at large deflection, and what the springs realise is the material."""
    problem = ts.Problem(
        ts.box((0.12, 0.03, 0.03), (6, 2, 2), element),
        ts.Material(1e4, 0.35),
        None,
        [ts.Fixed("left")],
        [ts.Force("right", (0.0, -0.06, 0.0))],
    )
    newton = ts.Newton(load_steps=3)
    springs = ts.solve(problem, ts.Springs("biquadratic"), newton)
    fem = ts.solve(problem, ts.Fem("saint-venant-kirchhoff", "linear"), newton)
    assert springs.status is fem.status is ts.Status.CONVERGED
    for one, other in zip(springs.states[1:], fem.states[1:], strict=True):
        assert apart(one.displacement, other.displacement) < 1e-8
        assert apart(one.reaction, other.reaction) < 1e-8
    assert np.abs(fem.states[-1].displacement).max() > 0.02
    assert springs.moduli is not None
    assert springs.moduli.deviation < 1e-12
    assert not any("modulus" in warning for warning in springs.warnings)
