"""The embedded finite elements against closed forms: patch tests, uniaxial tension, bending, Cook's membrane."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm, logm

import truespring as ts
from tests.closed_forms import lame, principal_state

LAWS = ("linear", "saint-venant-kirchhoff", "neo-hookean", "hencky")
SECTIONS = {"plane-stress": ts.PlaneStress, "plane-strain": ts.PlaneStrain}
TIGHT = ts.Newton(load_steps=2, tolerance=1e-13)


def distorted(elements: tuple[int, int] = (4, 3), share: float = 0.25) -> ts.Mesh:
    """A block whose inner nodes are moved by up to `share` of an element."""
    regular = ts.rectangle((float(elements[0]), float(elements[1])), elements)
    inner = ((regular.nodes > 0) & (regular.nodes < regular.upper)).all(axis=1)
    jitter = np.random.default_rng(1721).uniform(-share, share, regular.nodes.shape)
    return ts.Mesh(regular.nodes + jitter * inner[:, None], regular.elements)


def patch(gradient: np.ndarray, section: ts.PlaneStress | ts.PlaneStrain, poisson: float) -> ts.Problem:
    """A distorted block whose boundary moves by a uniform displacement gradient, shape (2, 2)."""
    mesh = distorted()
    rim = np.unique(mesh.boundary)
    assert mesh.n_nodes - len(rim) == 6, "there must be nodes left to follow"
    motion = mesh.nodes @ gradient.T
    return ts.Problem(
        mesh=mesh,
        material=ts.Material(young=3e3, poisson=poisson),
        section=section,
        supports=[ts.Fixed(on=[int(node)], displacement=motion[node]) for node in rim],
    )


def true_stress(law: str, gradient: np.ndarray, poisson: float, plane_stress: bool) -> np.ndarray:
    """Cauchy stress [Pa] of a uniform displacement gradient; in principal axes, of the linear law the stress."""
    young = 3e3
    if law == "linear":
        strain = (gradient + gradient.T) / 2
        lam, mu = lame(young, poisson)
        lam = 2 * lam * mu / (lam + 2 * mu) if plane_stress else lam
        return lam * np.trace(strain) * np.eye(2) + 2 * mu * strain
    F = np.eye(2) + gradient
    squared, axes = np.linalg.eigh(F @ F.T)
    stretch, nominal = principal_state(law, young, poisson, [*np.sqrt(squared), None if plane_stress else 1.0])
    cauchy = (nominal * stretch / stretch.prod())[:2]
    return (axes * cauchy) @ axes.T


GRADIENTS = {
    "small": np.array([[1e-3, 4e-4], [-2e-4, -7e-4]]),
    "large": np.array([[0.35, 0.25], [-0.15, -0.2]]),
    "turned": expm(np.array([[0.0, -0.9], [0.9, 0.0]])) @ np.diag([1.2, 0.9]) - np.eye(2),
}


@pytest.mark.parametrize("gradient", GRADIENTS)
@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("law", LAWS)
def test_patch(law: str, section: str, gradient: str) -> None:
    displacement_gradient = GRADIENTS[gradient]
    problem = patch(displacement_gradient, SECTIONS[section](0.5), poisson=0.3)
    path = ts.solve(problem, ts.Fem(law=law), TIGHT)
    assert path.load_factor == 1.0
    state = path.states[-1]
    exact = problem.mesh.nodes @ displacement_gradient.T
    assert np.abs(state.displacement - exact).max() <= 1e-12 * problem.mesh.diameter
    expected = true_stress(law, displacement_gradient, 0.3, section == "plane-stress")
    stress = ts.Fem(law=law).potential(problem).cauchy_stress(state.positions)[:, :2, :2]
    assert stress == pytest.approx(np.tile(expected, (12, 1, 1)), rel=1e-10, abs=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("section", SECTIONS)
def test_second_piola_kirchhoff_stress_of_the_patch(section: str) -> None:
    """Each law's own formula in C = F^T F and its inverse, with the Green strain, with ln J, with ln U."""
    problem = patch(GRADIENTS["large"], SECTIONS[section](0.5), poisson=0.3)
    F = np.eye(2) + GRADIENTS["large"]
    positions = problem.mesh.nodes @ F.T
    lam, mu = lame(3e3, 0.3)
    C = F.T @ F
    stretches = np.sqrt(np.linalg.eigvalsh(C))
    free = section == "plane-stress"
    reduced = 2 * lam * mu / (lam + 2 * mu) if free else lam
    third = principal_state("neo-hookean", 3e3, 0.3, [*stretches, None if free else 1.0])[0][2]
    inverse, logarithm = np.linalg.inv(C), logm(C).real / 2
    green = (C - np.eye(2)) / 2
    expected = {
        "saint-venant-kirchhoff": reduced * np.trace(green) * np.eye(2) + 2 * mu * green,
        "neo-hookean": mu * (np.eye(2) - inverse) + lam * math.log(np.linalg.det(F) * third) * inverse,
        "hencky": (reduced * np.trace(logarithm) * np.eye(2) + 2 * mu * logarithm) @ inverse,
    }
    for law, stress in expected.items():
        found = ts.Fem(law=law).potential(problem).stress(positions)
        assert found == pytest.approx(np.broadcast_to(stress[:, :, None, None], found.shape), rel=1e-10)


def uniaxial(section: ts.PlaneStress | ts.PlaneStrain, stretch: float, young: float, poisson: float) -> ts.Problem:
    """A distorted block pulled to a stretch along x, free to contract."""
    mesh = distorted()
    return ts.Problem(
        mesh=mesh,
        material=ts.Material(young=young, poisson=poisson),
        section=section,
        supports=[
            ts.Fixed(on="left", fix="x"),
            ts.Fixed(on="bottom", fix="y"),
            ts.Fixed(on="right", fix="x", displacement=((stretch - 1) * mesh.upper[0], 0.0)),
        ],
    )


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    law=st.sampled_from(LAWS),
    section=st.sampled_from(sorted(SECTIONS)),
    stretch=st.floats(0.75, 1.6).filter(lambda stretch: abs(stretch - 1) > 1e-2),
    young=st.floats(1e2, 1e11),
    poisson=st.floats(0.0, 0.45),
)
def test_uniaxial_tension(law: str, section: str, stretch: float, young: float, poisson: float) -> None:
    problem = uniaxial(SECTIONS[section](0.2), stretch, young, poisson)
    path = ts.solve(problem, ts.Fem(law=law), TIGHT)
    state = path.states[-1]
    assert state.load_factor == 1.0
    stretches, nominal = principal_state(
        law, young, poisson, [stretch, None, None if section == "plane-stress" else 1.0]
    )
    exact = problem.mesh.nodes * (stretches[:2] - 1)
    assert np.abs(state.displacement - exact).max() <= 1e-8 * np.abs(exact).max()
    assert path.applied_force(state)[0] == pytest.approx(nominal[0] * 0.2 * 3, rel=1e-8)


# P / E at Poisson's ratio 1/3: of the neo-Hookean law, and of Hencky's, which is ln(l) / l.
UNIAXIAL = {
    0.7: (-0.410664, -0.5095),
    0.9: (-0.109119, -0.1171),
    1.1: (0.092794, 0.0867),
    1.2: (0.173946, 0.1519),
    1.3: (0.246557, 0.2018),
    1.5: (0.374014, 0.2703),
    2.0: (0.635962, 0.3466),
}


@pytest.mark.parametrize("stretch", UNIAXIAL)
def test_uniaxial_plane_stress_in_closed_form(stretch: float) -> None:
    """Without root finding, at any Poisson's ratio: linear l - 1, StVK l (l^2 - 1) / 2, Hencky ln(l) / l."""
    closed = {
        "linear": stretch - 1,
        "saint-venant-kirchhoff": stretch * (stretch**2 - 1) / 2,
        "hencky": math.log(stretch) / stretch,
    }
    for law, stress in closed.items():
        path = ts.solve(uniaxial(ts.PlaneStress(0.2), stretch, 1.0, 0.2), ts.Fem(law=law), TIGHT)
        assert path.applied_force(path.states[-1])[0] / 0.6 == pytest.approx(stress, rel=1e-8)
    neo_hookean, hencky = UNIAXIAL[stretch]
    assert closed["hencky"] == pytest.approx(hencky, abs=6e-5)
    path = ts.solve(uniaxial(ts.PlaneStress(0.2), stretch, 1.0, 1 / 3), ts.Fem(law="neo-hookean"), TIGHT)
    assert path.applied_force(path.states[-1])[0] / 0.6 == pytest.approx(neo_hookean, abs=6e-7)


@pytest.mark.parametrize("law", LAWS)
def test_dead_load_gives_the_stretch_of_the_closed_form(law: str) -> None:
    mesh = distorted()
    problem = ts.Problem(
        mesh,
        ts.Material(young=1.0, poisson=1 / 3),
        ts.PlaneStress(0.2),
        [ts.Fixed(on="left", fix="x"), ts.Fixed(on="bottom", fix="y")],
        [ts.Force(on="right", total=(0.3 * 0.6, 0.0))],
    )
    state = ts.solve(problem, ts.Fem(law=law), ts.Newton(load_steps=4, tolerance=1e-13)).states[-1]
    stretch = 1 + state.displacement[mesh.nodes[:, 0] == mesh.upper[0], 0] / mesh.upper[0]
    assert np.ptp(stretch) < 1e-11
    stretches, nominal = principal_state(law, 1.0, 1 / 3, [float(stretch[0]), None, None])
    assert nominal[0] == pytest.approx(0.3, rel=1e-10)
    assert state.displacement[:, 1] == pytest.approx(mesh.nodes[:, 1] * (stretches[1] - 1), abs=1e-10)


@pytest.mark.parametrize("law", LAWS)
def test_all_laws_are_one_at_small_strain(law: str) -> None:
    for section in SECTIONS.values():
        problem = patch(GRADIENTS["small"], section(0.5), poisson=0.3)
        nodes = problem.mesh.nodes
        linear = ts.Fem(law="linear").potential(problem).hessian(nodes).toarray()
        assert ts.Fem(law=law).potential(problem).hessian(nodes).toarray() == pytest.approx(
            linear, rel=1e-9, abs=1e-12 * np.abs(linear).max()
        )


@settings(max_examples=15, deadline=None, derandomize=True)
@given(aspect=st.floats(0.3, 3.0), poisson=st.floats(-0.3, 0.45))
def test_one_element_in_bending_is_as_stiff_as_published(aspect: float, poisson: float) -> None:
    """Cook, Malkus, Plesha, Witt: a quadrilateral a wide and b high locks by (1/(1-nu) + (a/b)^2/2) / (1+nu)."""
    mesh = ts.rectangle((aspect, 1.0), (1, 1))
    problem = ts.Problem(
        mesh,
        ts.Material(young=1.0, poisson=poisson),
        ts.PlaneStress(1.0),
        [ts.Fixed(on="left", fix="x"), ts.Fixed(on=[0], fix="y")],
        [ts.Force(on=[1], total=(-1e-3, 0.0)), ts.Force(on=[3], total=(1e-3, 0.0))],
    )
    state = ts.solve(problem, ts.Fem(law="linear"), ts.Newton(load_steps=1)).states[-1]
    curvature = (state.displacement[3, 0] - state.displacement[1, 0]) / aspect
    # The couple is 1e-3 N on an arm of 1 m, EI is 1/12.
    locked = (1 / (1 - poisson) + aspect**2 / 2) / (1 + poisson)
    assert 1e-3 / curvature / (1 / 12) == pytest.approx(locked, rel=1e-9)


def cook(n: int) -> ts.Problem:
    """Cook's membrane, plane stress, nu = 1/3, a unit shear force on its right side; n by n elements."""
    share = np.linspace(0, 1, n + 1)
    along, up = np.meshgrid(share, share)
    bottom, top = 44 * along, 44 + 16 * along
    nodes = np.stack([48 * along, bottom + up * (top - bottom)], axis=-1).reshape(-1, 2)
    return ts.Problem(
        ts.Mesh(nodes, ts.rectangle((1.0, 1.0), (n, n)).elements),
        ts.Material(young=1.0, poisson=1 / 3),
        ts.PlaneStress(1.0),
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(0.0, 1.0))],
    )


def test_cook_membrane() -> None:
    """Four-node quadrilaterals with full integration; the converged deflection at (48, 52) is 23.97."""
    deflections = []
    for n in (8, 16, 32, 64):
        problem = cook(n)
        state = ts.solve(problem, ts.Fem(law="linear"), ts.Newton(load_steps=1)).states[-1]
        watched = ts.nearest_node(problem.mesh, (48.0, 52.0))
        assert problem.mesh.nodes[watched] == pytest.approx([48, 52])
        deflections.append(state.displacement[watched, 1])
    assert deflections == pytest.approx([22.0792, 23.4304, 23.8176, 23.9245], abs=6e-5)
    assert deflections == sorted(deflections)
    assert deflections[-1] < 23.97 < deflections[-1] + 0.06


@pytest.mark.parametrize("law", LAWS)
def test_a_linear_path_is_linear_and_the_others_are_not(law: str) -> None:
    problem = ts.Problem(
        ts.rectangle((4.0, 1.0), (8, 2)),
        ts.Material(young=1.0, poisson=0.3),
        ts.PlaneStress(1.0),
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(0.0, -3e-3))],
    )
    path = ts.solve(problem, ts.Fem(law=law), ts.Newton(load_steps=4))
    assert path.status is ts.Status.CONVERGED
    first, last = path.states[1], path.states[-1]
    drift = np.abs(4 * first.displacement - last.displacement).max() / np.abs(last.displacement).max()
    assert drift < 1e-9 if law == "linear" else drift > 1e-3
    if law == "linear":
        assert max(state.iterations for state in path.states) <= 1


@pytest.mark.parametrize("poisson", [-0.9, -0.5, -0.2])
@pytest.mark.parametrize("squeeze", [0.3, 0.6, 0.9, 1.3])
def test_neo_hookean_plane_stress_has_a_thickness_or_no_energy(poisson: float, squeeze: float) -> None:
    """Below zero there is no free thickness under strong compression: infinite energy, never a wrong stress."""
    problem = ts.Problem(
        ts.rectangle((1.0, 1.0), (1, 1)),
        ts.Material(1.0, poisson),
        ts.PlaneStress(1.0),
        [ts.Fixed("left")],
        [ts.Force("right", (1.0, 0.0))],
    )
    potential = ts.Fem("neo-hookean").potential(problem)

    def energy(stretch: float) -> float:
        return potential.energy(problem.mesh.nodes * stretch)

    if not np.isfinite(energy(squeeze)):
        assert squeeze < 0.9
        return
    step = 1e-5
    slope = (energy(squeeze + step) - energy(squeeze - step)) / (2 * step)
    forces = potential.gradient(problem.mesh.nodes * squeeze)
    assert slope == pytest.approx((forces * problem.mesh.nodes).sum(), rel=1e-6)


@pytest.mark.parametrize("law", ["linear", "saint-venant-kirchhoff", "neo-hookean", "hencky"])
@pytest.mark.parametrize("section", [ts.PlaneStress, ts.PlaneStrain])
def test_stress_across_the_plane(law: str, section: type[ts.PlaneStress] | type[ts.PlaneStrain]) -> None:
    """In plane strain nu (s_xx + s_yy) at small strain and the closed form at large strain; in plane stress none."""
    poisson = 0.3
    problem = ts.Problem(
        ts.rectangle((2.0, 1.0), (2, 1)),
        ts.Material(1.0, poisson),
        section(1.0),
        [ts.Fixed("left")],
        [ts.Force("right", (1.0, 0.0))],
    )
    potential = ts.Fem(law).potential(problem)

    def stress(stretch_x: float, stretch_y: float) -> np.ndarray:
        return potential.cauchy_stress(problem.mesh.nodes * np.array([stretch_x, stretch_y]))[0]

    small = stress(1 + 1e-6, 1 - 3e-7)
    expected = 0.0 if section is ts.PlaneStress else poisson * (small[0, 0] + small[1, 1])
    assert small[2, 2] == pytest.approx(expected, rel=1e-5, abs=1e-16)
    if section is ts.PlaneStrain:
        stretches, nominal = principal_state(law, 1.0, poisson, (1.3, 0.9, 1.0))
        true = nominal if law == "linear" else nominal * stretches / stretches.prod()
        assert np.diag(stress(1.3, 0.9)) == pytest.approx(true, rel=1e-12)
