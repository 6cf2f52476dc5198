"""Springs with an area or volume term: the material's Young's modulus and Poisson's ratio, found by pulling a block."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from tests.closed_forms import cube_tension, lame, lattice_tension
from truespring.models import VolumeSprings
from truespring.models.volume import VolumeTerm

RATIOS = (0.0, 0.1, 0.25, 0.4, 0.49)
YOUNG = 3e4
TIGHT = ts.Newton(load_steps=2, tolerance=1e-12)

SQUARES = ts.rectangle((0.03, 0.02), (3, 2))
RECTANGLES = ts.rectangle((0.03, 0.03), (3, 2))
CUBES = ts.box((0.03, 0.02, 0.02), (3, 2, 2))
BRICKS = ts.box((0.03, 0.022, 0.018), (3, 2, 2))
BODY_CENTRED = ts.box((0.02, 0.02, 0.02), (2, 2, 2), "bcc-tetrahedron")


def pulled(mesh: ts.Mesh, poisson: float, section: ts.PlaneStress | ts.PlaneStrain | None, stress: float) -> ts.Problem:
    """A block on rollers under a nominal stress [Pa] along x, free to contract: its strain is uniform."""
    width = mesh.upper[1:].prod() * (section.thickness if section else 1.0)
    rollers = [ts.Fixed(side, fix=axis) for side, axis in zip(("left", "bottom", "back"), "xyz", strict=True)]
    return ts.Problem(
        mesh,
        ts.Material(YOUNG, poisson),
        section,
        rollers[: mesh.dim],
        [ts.Force("right", [stress * width] + [0.0] * (mesh.dim - 1))],
    )


def stretches(problem: ts.Problem, model: object, solver: ts.Newton = TIGHT) -> np.ndarray:
    """Stretch along each axis; the strain must be uniform."""
    state = ts.solve(problem, model, solver).states[-1]
    assert state.load_factor == 1.0
    mesh = problem.mesh
    found = np.array([state.displacement[mesh.nodes[:, i] == mesh.upper[i], i].mean() for i in range(mesh.dim)])
    uniform = mesh.nodes * (found / mesh.upper)
    assert np.abs(state.displacement - uniform).max() <= 1e-7 * np.abs(uniform).max()
    return 1 + found / mesh.upper


def realised(problem: ts.Problem, model: object) -> tuple[float, float]:
    """Young's modulus over that of the material, and Poisson's ratio, of a pull by a millionth."""
    strain = stretches(problem, model, ts.Newton(load_steps=1, tolerance=1e-12)) - 1
    assert problem.section is not None
    stress = problem.loading.external_force.sum() / (problem.mesh.upper[1:].prod() * problem.section.thickness)
    assert np.ptp(strain[1:]) <= 1e-6 * abs(strain[0])
    return float(stress / strain[0] / YOUNG), float(-strain[1] / strain[0])


LATTICES = {
    "squares, plane stress": (SQUARES, ts.PlaneStress(0.005), "isotropic", None),
    "squares, plane strain": (SQUARES, ts.PlaneStrain(0.005), "isotropic", None),
    "rectangles": (RECTANGLES, ts.PlaneStress(0.005), "isotropic", None),
    "cubes, k_body 1/12": (CUBES, None, "isotropic", None),
    "cubes, k_body 0.2": (CUBES, None, "isotropic", 0.2),
    "bricks": (BRICKS, None, "isotropic", 0.05),
}


@pytest.mark.parametrize("poisson", RATIOS)
@pytest.mark.parametrize("name", LATTICES)
def test_the_material_is_realised(name: str, poisson: float) -> None:
    """In plane strain E / (1 - nu^2) and nu / (1 - nu), as any test within the plane finds."""
    mesh, section, rule, k_body = LATTICES[name]
    problem = pulled(mesh, poisson, section, 1e-6 * YOUNG)
    springs = ts.Springs(rule, volume=True, k_body=k_body)
    expected = (1.0, poisson)
    if isinstance(section, ts.PlaneStrain):
        expected = (1 / (1 - poisson**2), poisson / (1 - poisson))
    assert realised(problem, springs) == pytest.approx(expected, rel=1e-4, abs=1e-4)
    told = ts.moduli(problem, springs)
    for along in (0.0, 45.0) if mesh.dim == 2 else ((1, 0, 0), (1, 1, 0), (1, 2, 3)):
        assert told.young(along) == pytest.approx(YOUNG * expected[0], rel=1e-9)
        assert told.poisson(along) == pytest.approx(expected[1], abs=1e-9)
    assert told.deviation < 1e-9


@pytest.mark.parametrize("poisson", RATIOS)
def test_body_centred_tetrahedra_are_taken(poisson: float) -> None:
    """The lattice is the material; at the boundary of a body, of halved tetrahedra, it is not."""
    problem = pulled(BODY_CENTRED, poisson, None, 1e-6 * YOUNG)
    told = ts.moduli(problem, ts.Springs("lloyd", volume=True))
    assert told.deviation < 1e-9
    assert told.young_range == pytest.approx((YOUNG, YOUNG), rel=1e-9)
    assert told.patch_score > 0.1
    if poisson < 0.25:  # the boundary gives way where the term is negative
        return
    errors = []
    for cells in (2, 4):
        block = ts.box((0.02, 0.02, 0.02), (cells,) * 3, "bcc-tetrahedron")
        state = ts.solve(pulled(block, poisson, None, 1e-6 * YOUNG), ts.Springs("lloyd", volume=True)).states[-1]
        at_end = block.nodes[:, 0] == block.upper[0]
        errors.append(abs(1e-6 / (state.displacement[at_end, 0].mean() / 0.02) - 1))
    assert errors[1] < 0.6 * errors[0] < 0.06


@pytest.mark.parametrize("name", ["squares, plane stress", "cubes, k_body 1/12"])
def test_springs_fitted_to_young_instead_of_shear_are_noticed(name: str) -> None:
    """With springs of the full E beside the right modulus of the volume term, shear is wrong, and so is the pull."""
    mesh, section, rule, _ = LATTICES[name]
    for poisson, at_least in ((0.0, 0.1), (0.49, 0.05)):
        problem = pulled(mesh, poisson, section, 1e-6 * YOUNG)
        right = ts.Springs(rule, volume=True)
        wrong = VolumeSprings(ts.Springs(rule).potential(problem), VolumeTerm(problem, right.kappa(problem)))
        young, _ = realised(problem, wrong)
        assert abs(young - 1) > at_least


@settings(max_examples=25, deadline=None, derandomize=True)
@given(poisson=st.floats(0.0, 0.499))
def test_scale_and_modulus_of_the_term_in_closed_form(poisson: float) -> None:
    """Springs by 4 / 3 (1 + nu) in the plane and 5 / 4 (1 + nu) in space; kappa = lam - mu."""
    lam, mu = lame(YOUNG, poisson)
    plain, springs = ts.Springs("isotropic"), ts.Springs("isotropic", volume=True)
    cases = (
        (pulled(SQUARES, poisson, ts.PlaneStress(0.005), 1.0), 4 / 3, 2 * lam * mu / (lam + 2 * mu) - mu),
        (pulled(SQUARES, poisson, ts.PlaneStrain(0.005), 1.0), 4 / 3, lam - mu),
        (pulled(CUBES, poisson, None, 1.0), 5 / 4, lam - mu),
    )
    for problem, scale, kappa in cases:
        ratio = springs.element_stiffness(problem) / plain.element_stiffness(problem)
        assert ratio == pytest.approx(np.full(ratio.shape, scale / (1 + poisson)), rel=1e-9)
        size = YOUNG / (1 - 2 * poisson)
        assert springs.kappa(problem) == pytest.approx(np.full(len(ratio), kappa), rel=1e-9, abs=1e-9 * size)
    plane_stress = YOUNG * (3 * poisson - 1) / (2 * (1 - poisson**2))
    assert cases[0][2] == pytest.approx(plane_stress, rel=1e-9, abs=1e-9 * YOUNG)
    space = YOUNG * (4 * poisson - 1) / (2 * (1 + poisson) * (1 - 2 * poisson))
    assert cases[2][2] == pytest.approx(space, rel=1e-9, abs=1e-9 * YOUNG)


@settings(max_examples=10, deadline=None, derandomize=True)
@given(poisson=st.floats(0.25, 0.49), stress=st.floats(-0.1, 0.4).filter(lambda stress: abs(stress) > 0.01))
def test_large_tension_of_squares(poisson: float, stress: float) -> None:
    problem = pulled(SQUARES, poisson, ts.PlaneStress(0.005), stress * YOUNG)
    edge, kappa = 1 / (2 * (1 + poisson)), (3 * poisson - 1) / (2 * (1 - poisson**2))
    expected = lattice_tension(stress, (1.0, 1.0), (edge, edge), edge, kappa)
    found = stretches(problem, ts.Springs("isotropic", volume=True))
    assert found == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("k_body", [0.0, 1 / 12, 0.2])
@pytest.mark.parametrize("poisson", [0.2, 0.45])
@pytest.mark.parametrize("stress", [-0.1, 0.4])
def test_large_tension_of_cubes(stress: float, poisson: float, k_body: float) -> None:
    problem = pulled(CUBES, poisson, None, stress * YOUNG)
    scale, kappa = 5 / (4 * (1 + poisson)), (4 * poisson - 1) / (2 * (1 + poisson) * (1 - 2 * poisson))
    links = (scale * (1 / 10 + k_body / 3), scale * (1 / 5 - 2 * k_body / 3), scale * k_body)
    along, across = cube_tension(stress, links, kappa)
    found = stretches(problem, ts.Springs("isotropic", volume=True, k_body=k_body))
    assert found == pytest.approx([along, across, across], rel=1e-9)


@settings(max_examples=10, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
def test_volume_of_deformed_elements(seed: int) -> None:
    """The energy of the term alone is kappa/2 V0 (V/V0 - 1)^2, V by Gauss points: exact for these elements."""
    generator = np.random.default_rng(seed)
    for mesh, section in ((SQUARES, ts.PlaneStress(0.005)), (CUBES, None), (BODY_CENTRED, None)):
        problem = pulled(mesh, 0.4, section, 1.0)
        rule = "lloyd" if mesh is BODY_CENTRED else "isotropic"
        potential = ts.Springs(rule, volume=True).potential(problem)
        assert isinstance(potential, VolumeSprings)
        positions = mesh.nodes + generator.uniform(-0.002, 0.002, mesh.nodes.shape)
        gradients, volumes = ts.Fem("linear", "linear").potential(problem).quadrature()
        F = np.einsum("eai,eqaj->eqij", positions[mesh.elements], gradients)
        ratio = (np.linalg.det(F) * volumes).sum(axis=1) / volumes.sum(axis=1)
        energies = potential.term.kappa / 2 * volumes.sum(axis=1) * (ratio - 1) ** 2
        assert potential.term.element_energies(positions) == pytest.approx(energies, rel=1e-9, abs=1e-18)
        assert mesh.measures_at(positions) / mesh.measures == pytest.approx(ratio, rel=1e-12)


def test_springs_and_term_are_on_the_same_elements() -> None:
    problem = pulled(SQUARES, 0.4, ts.PlaneStress(0.005), 1.0)
    right = ts.Springs("isotropic", volume=True)
    network = ts.Springs("isotropic").potential(problem)
    fewer = ts.SpringNetwork(SQUARES.nodes, network.springs[1:], network.stiffness[1:])
    wrong = VolumeSprings(fewer, VolumeTerm(problem, right.kappa(problem)))
    for hessian in (wrong.hessian, wrong.projected_hessian):
        with pytest.raises(ts.TruespringError, match="volume term"):
            hessian(SQUARES.nodes)


def test_two_materials_have_terms_of_their_own() -> None:
    soft, hard = ts.Material(YOUNG, 0.2), ts.Material(10 * YOUNG, 0.45)
    one = pulled(CUBES, 0.2, None, 1.0)
    problem = ts.Problem(CUBES, soft, None, one.supports, one.loads, [ts.Region([2, 5], hard)])
    kappa = ts.Springs("isotropic", volume=True).kappa(problem)
    expected = {material: lame(material.young, material.poisson) for material in (soft, hard)}
    for element in range(len(CUBES.elements)):
        lam, mu = expected[hard if element in (2, 5) else soft]
        assert kappa[element] == pytest.approx(lam - mu, rel=1e-9)
    stiffness = ts.Springs("isotropic", volume=True).element_stiffness(problem)
    assert stiffness[2] / stiffness[0] == pytest.approx(np.full(28, 10 * 1.2 / 1.45), rel=1e-9)


JITTERED = ts.Mesh(SQUARES.nodes + np.random.default_rng(1).uniform(-1e-3, 1e-3, SQUARES.nodes.shape), SQUARES.elements)


@pytest.mark.parametrize(
    ("mesh", "springs", "said"),
    [
        (SQUARES, ts.Springs("lloyd", volume=True), "anisotropic.*rule isotropic"),
        (SQUARES, ts.Springs("projected", volume=True), "anisotropic"),
        (SQUARES, ts.Springs(stiffness=ts.UserStiffness(0.4, 0.3), volume=True), "anisotropic"),
        (JITTERED, ts.Springs("projected", volume=True), "isotropic lattices, this .*irregular"),
        (CUBES, ts.Springs("least-squares", volume=True), "anisotropic"),
        (BODY_CENTRED, ts.Springs("van-gelder", volume=True), "anisotropic.*rule lloyd on body-centred"),
        (ts.box((2.0, 2.0, 2.0), (2, 2, 2), "tetrahedron"), ts.Springs("lloyd", volume=True), "anisotropic"),
    ],
)
def test_lattices_that_are_not_isotropic_are_refused(mesh: ts.Mesh, springs: ts.Springs, said: str) -> None:
    section = ts.PlaneStress(1.0) if mesh.dim == 2 else None
    side = np.flatnonzero(mesh.nodes[:, 0] < 0.1 * mesh.upper[0])
    problem = ts.Problem(
        mesh, ts.Material(1.0, 0.3), section, [ts.Fixed(side)], [ts.Force([mesh.n_nodes - 1], [1.0] * mesh.dim)]
    )
    with pytest.raises(ts.TruespringError, match=said):
        springs.potential(problem)
    with pytest.raises(ts.TruespringError, match=said):
        ts.solve(problem, springs)


def test_your_own_isotropic_numbers_are_welcome() -> None:
    springs = ts.Springs(stiffness=ts.UserStiffness(0.11, 0.11), volume=True)
    assert realised(pulled(SQUARES, 0.45, ts.PlaneStress(1.0), 1e-6 * YOUNG), springs) == pytest.approx(
        (1.0, 0.45), abs=1e-4
    )


def test_what_does_not_go_with_a_volume_term() -> None:
    with pytest.raises(ts.TruespringError, match=r"sharing = 'single'.* volume = true"):
        ts.Springs("isotropic", sharing="single", volume=True)
    with pytest.raises(ts.TruespringError, match=r"rule = 'biquadratic'.* volume"):
        ts.Springs("biquadratic", volume=True)
    with pytest.raises(ts.TruespringError, match=r"volume = true: poisson = -0\.1 "):
        ts.Springs("isotropic", volume=True).potential(pulled(SQUARES, -0.1, ts.PlaneStress(1.0), 1.0))


@pytest.mark.parametrize(("poisson", "said"), [(0.1, True), (0.3, False)])
def test_a_negative_modulus_of_the_term_is_said(poisson: float, said: bool) -> None:
    """Below Cauchy's ratio nothing bounds the energy from below: known before anything is solved."""
    path = ts.solve(pulled(CUBES, poisson, None, 1e-6 * YOUNG), ts.Springs("isotropic", volume=True), TIGHT)
    assert any("negative modulus" in warning for warning in path.warnings) == said
    assert not any("Young's modulus" in warning for warning in path.warnings)
