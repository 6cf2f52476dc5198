"""HEML, biquadratic springs, the mass-tensor method and finite elements: where they are one function, they agree."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

import truespring as ts
from tests.closed_forms import material_of, principal_state
from tests.meshes import random_mesh
from tests.studies import changed, written
from tests.test_biquadratic import PLANE, ROUNDING, apart, body
from tests.test_fem import GRADIENTS, TIGHT, distorted, in_section, patch
from tests.test_report import words
from truespring.arrays import Floats
from truespring.models import Model
from truespring.models.heml import HEML_LAWS
from truespring.models.mass_tensor import TENSOR_LAWS
from truespring.report.figures import draw_figures
from truespring.study import plan, read_study, run, write

SIMPLICES, OTHERS = ("triangle", "tetrahedron"), ("quadrilateral", "hexahedron")
BODIES = [
    (element, section)
    for element in (*SIMPLICES, *OTHERS)
    for section in (PLANE if element in ("triangle", "quadrilateral") else ("solid",))
]
SAME = "saint-venant-kirchhoff"


def some_body(
    element: str, section: str, generator: np.random.Generator, poisson: float = 0.3, law: str = SAME
) -> ts.Problem:
    """Elements of random shape, the first of another material."""
    mesh = random_mesh(element, generator)
    whole = body(mesh, section, poisson, regions=[ts.Region([0], material_of(law, 5e4, 0.1))])
    return replace(whole, material=material_of(law, 3e3, poisson))


def upright(mesh: ts.Mesh, generator: np.random.Generator, strain: float) -> Floats:
    """Turned and strained positions in which no element is turned inside out."""
    gradient = np.eye(mesh.dim) + strain * generator.uniform(-1, 1, (mesh.dim, mesh.dim))
    turn = np.linalg.qr(generator.normal(size=(mesh.dim, mesh.dim)))[0]
    turn[0] *= np.sign(np.linalg.det(turn))
    positions = mesh.nodes @ (turn @ gradient).T
    shortest = np.linalg.norm(np.diff(mesh.nodes[mesh.edges], axis=1), axis=2).min()
    shaken = positions + 0.03 * shortest * generator.uniform(-1, 1, positions.shape)
    assert mesh.smallest_area_ratio(shaken) > 0
    return np.asarray(shaken)


def check_same(problem: ts.Problem, one: Model, other: Model, positions: Floats) -> None:
    """Two models are one function: energy, force and tangent."""
    first, second = one.potential(problem), other.potential(problem)
    assert type(first) is not type(second), "a model beside itself tells nothing"
    assert first.energy(positions) == pytest.approx(second.energy(positions), rel=ROUNDING)
    assert apart(first.gradient(positions), second.gradient(positions)) < ROUNDING
    assert apart(first.hessian(positions).toarray(), second.hessian(positions).toarray()) < ROUNDING


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    body_of=st.sampled_from(BODIES),
    law=st.sampled_from(HEML_LAWS),
    poisson=st.floats(-0.3, 0.49),
    strain=st.floats(0.05, 0.25),
)
def test_heml_is_the_finite_element(
    seed: int, body_of: tuple[str, str], law: str, poisson: float, strain: float
) -> None:
    """Of any law on simplices, of St. Venant-Kirchhoff's on squares and cubes too, full integration."""
    element, section = body_of
    if element in OTHERS:
        law = SAME
    generator = np.random.default_rng(seed)
    problem = some_body(element, section, generator, poisson, law)
    positions = upright(problem.mesh, generator, strain)
    check_same(problem, ts.Heml(law), ts.Fem(law, "linear"), positions)


@pytest.mark.parametrize(("element", "section"), [one for one in BODIES if one[0] in SIMPLICES])
def test_four_names_for_one_function(element: str, section: str) -> None:
    """On simplices HEML, biquadratic springs, nonlinear mass-tensor and St. Venant-Kirchhoff FEM are the same."""
    generator = np.random.default_rng(1848)
    problem = some_body(element, section, generator)
    positions = upright(problem.mesh, generator, 0.25)
    assert type(ts.Heml(SAME).potential(problem)) is type(ts.Springs("biquadratic").potential(problem))
    tensors = ts.MassTensor(SAME)
    for other in (ts.Fem(SAME, "linear"), ts.Heml(SAME), ts.Springs("biquadratic")):
        check_same(problem, tensors, other, positions)


@pytest.mark.parametrize(("element", "section"), BODIES)
def test_linear_tensors_are_linear_elements(element: str, section: str) -> None:
    generator = np.random.default_rng(1999)
    problem = some_body(element, section, generator)
    check_same(problem, ts.MassTensor("linear"), ts.Fem("linear", "linear"), upright(problem.mesh, generator, 0.25))


@pytest.mark.parametrize("poisson", [-0.2, 0.3, 0.45])
def test_a_tetrahedron_as_goulette_and_chen_write_it(poisson: float) -> None:
    """C by the squared lengths through half-integer matrices D_l of the edges that leave a node, C_l = B^T D_l B."""
    generator = np.random.default_rng(2015)
    corners = np.array([[0.0, 0, 0], [1, 0.1, 0], [0.2, 1.1, 0.1], [0.1, 0.3, 0.9]])
    mesh = ts.Mesh(corners, [[0, 1, 2, 3]], "tetrahedron")
    moved = corners + 0.2 * generator.uniform(-1, 1, corners.shape)
    problem = body(mesh, "solid", poisson)
    young = 3e3
    lam, mu = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
    edges = (corners[1:] - corners[0]).T
    volume, B = np.linalg.det(edges) / 6, np.linalg.inv(edges)
    by_link = {}
    for i, j in mesh.kind.links:
        D = np.zeros((4, 4))
        D[i, j] = D[j, i] = -0.5
        if 0 in (i, j):
            a = max(i, j)
            D[a, :] = D[:, a] = 0.5
            D[a, a] = 1.0
        by_link[i, j] = B.T @ D[1:, 1:] @ B
    C = sum(((moved[i] - moved[j]) ** 2).sum() * by_link[i, j] for i, j in by_link)
    J = np.linalg.det(moved[1:] - moved[0]) / 6 / volume
    links = sum(((moved[i] - moved[j]) ** 2).sum() * np.trace(by_link[i, j]) for i, j in by_link)
    neo_hookean = volume * (mu / 2 * (links - 3) - mu * np.log(J) + lam / 2 * np.log(J) ** 2)
    assert ts.Heml("neo-hookean").potential(problem).energy(moved) == pytest.approx(neo_hookean, rel=1e-11)
    E = (C - np.eye(3)) / 2
    expected = volume * (lam / 2 * np.trace(E) ** 2 + mu * (E * E).sum())
    for model in (ts.Heml(SAME), ts.MassTensor(SAME)):
        assert model.potential(problem).energy(moved) == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("dim", [2, 3])
def test_tensors_lose_nothing_far_from_home(dim: int) -> None:
    """Cubes of absolute displacements would: (10^3)^3 times the rounding is more than what is looked at."""
    element = SIMPLICES[dim - 2]
    generator = np.random.default_rng(7)
    problem = some_body(element, "plane stress" if dim == 2 else "solid", generator)
    size = np.ptp(problem.mesh.nodes)
    positions = upright(problem.mesh, generator, 0.1)
    for law in ("linear", SAME):
        tensors, fem = ts.MassTensor(law).potential(problem), ts.Fem(law, "linear").potential(problem)
        force, energy = fem.gradient(positions), fem.energy(positions)
        assert apart(tensors.gradient(positions + 1e3 * size), force) < 1e-10
        assert tensors.energy(positions + 1e3 * size) == pytest.approx(energy, rel=1e-10)


ON_ANY = (ts.Heml(SAME), ts.MassTensor("linear"))
ON_SIMPLICES = (*map(ts.Heml, HEML_LAWS), *map(ts.MassTensor, TENSOR_LAWS))


@pytest.mark.parametrize(
    ("kind", "model"),
    [*((kind, model) for kind in SIMPLICES for model in ON_SIMPLICES)]
    + [(kind, model) for kind in OTHERS for model in ON_ANY],
)
def test_patch(kind: str, model: Model) -> None:
    """Within a rim that moves uniformly the nodes inside follow, whatever the shape of the elements."""
    mesh = distorted(kind)
    gradient = GRADIENTS["large"][: mesh.dim, : mesh.dim]
    problem = patch(mesh, gradient, in_section(mesh, "plane-strain", 0.5), poisson=0.3, law=model.law)
    path = ts.solve(problem, model, TIGHT)
    assert path.status is ts.Status.CONVERGED
    assert np.abs(path.states[-1].displacement - mesh.nodes @ gradient.T).max() <= 1e-12 * mesh.diameter


def cantilever(element: str, force: tuple[float, float], cells: int = 4) -> ts.Problem:
    """A strip of 4 by 1 whose end is loaded, Poisson's ratio 1/3, triangles with alternating diagonals."""
    diagonal = ("alternating",) if element == "triangle" else ()
    return ts.Problem(
        ts.rectangle((4.0, 1.0), (4 * cells, cells), element, *diagonal),
        ts.Material(1.0, 1 / 3),
        ts.PlaneStress(1.0),
        [ts.Fixed("left")],
        [ts.Force("right", force)],
    )


def end(element: str, model: Model, force: tuple[float, float]) -> Floats:
    """The mean displacement of the loaded end over the length, half weight at its two corners."""
    problem = cantilever(element, force)
    path = ts.solve(problem, model, ts.Newton(load_steps=1))
    assert path.status is ts.Status.CONVERGED
    share = problem.loading.external_force.sum(axis=1) / sum(force)
    return np.asarray(share @ path.states[-1].displacement / 4)


# The end of 96 x 24 and 192 x 48 St. Venant-Kirchhoff quadrilaterals, extrapolated.
SMALL, LARGE = (1e-4, (-2.6548e-05, -6.68281e-03)), (0.0107, (-0.18417, -0.53139))


@pytest.mark.parametrize(
    ("model", "element", "small", "large"),
    [
        (ts.Heml(SAME), "quadrilateral", 0.035, 0.026),
        (ts.Heml(SAME), "triangle", 0.130, 0.091),
        (ts.MassTensor(SAME), "triangle", 0.130, 0.091),
        (ts.Heml("neo-hookean"), "triangle", 0.130, 0.106),
        (ts.MassTensor("linear"), "triangle", 0.130, 0.365),
        (ts.MassTensor("linear"), "quadrilateral", 0.036, 0.43),
    ],
)
def test_a_bent_strip(model: Model, element: str, small: float, large: float) -> None:
    """Distances from the converged end at small load and where it has moved by 53 % of the length, 16 x 4 elements.

    The numbers are those of another program: triangles and quadrilaterals in plain NumPy.
    """
    for (load, reference), expected in ((SMALL, small), (LARGE, large)):
        assert apart(end(element, model, (0.0, -load)), np.array(reference)) == pytest.approx(expected, abs=0.002)


def test_a_neo_hookean_strip_is_pulled_as_the_closed_form() -> None:
    """In plane stress the thickness is free at every point, as it is in the finite elements of the law."""
    problem = cantilever("triangle", (0.3, 0.0))
    loose = ts.Problem(
        problem.mesh,
        problem.material,
        problem.section,
        [ts.Fixed("left", fix=["x"]), ts.Fixed("left-bottom")],
        problem.loads,
    )

    def gap(stretch: float) -> float:
        return principal_state("neo-hookean", 1.0, 1 / 3, [stretch, None, None])[1][0] - 0.3

    expected = brentq(gap, 1.1, 2.0) - 1
    path = ts.solve(loose, ts.Heml("neo-hookean"), TIGHT)
    right = loose.mesh.nodes[:, 0] == 4.0
    assert path.states[-1].displacement[right, 0] / 4 == pytest.approx(np.full(right.sum(), expected), rel=1e-9)
    assert expected == pytest.approx(0.380, abs=5e-4)


REFUSED = {
    "links of the linear law": (lambda: ts.Heml("linear"), "law = 'linear'.*mass-tensor"),
    "an unknown law of links": (lambda: ts.Heml("neo-hokean"), "did you mean 'neo-hookean'"),
    "tensors of a logarithm": (lambda: ts.MassTensor("hencky"), "law = 'hencky'.*polynomial.*fem .*heml"),
    "an unknown law of tensors": (lambda: ts.MassTensor("liner"), "did you mean 'linear'"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_laws_that_do_not_go_are_refused(case: str) -> None:
    make, told = REFUSED[case]
    with pytest.raises(ts.TruespringError, match=told):
        make()


@pytest.mark.parametrize("element", OTHERS)
def test_elements_that_do_not_go_are_refused(element: str) -> None:
    section = "plane stress" if element == "quadrilateral" else "solid"
    problem = body(random_mesh(element, np.random.default_rng(3)), section, 0.3)
    simplex = SIMPLICES[problem.mesh.dim - 2]
    for law in ("neo-hookean", "hencky"):
        with pytest.raises(ts.TruespringError, match=f"{element} .*'{SAME}'.*kind = 'fem'.*{simplex}"):
            ts.Heml(law).potential(problem)
    with pytest.raises(ts.TruespringError, match=f"{element} .*kind = 'heml'.*{simplex}"):
        ts.MassTensor(SAME).potential(problem)


@pytest.mark.parametrize("model", [ts.Heml(SAME), ts.MassTensor("linear")])
def test_a_plain_network_is_refused(model: ts.Heml | ts.MassTensor) -> None:
    network = ts.SpringNetwork([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0, 1], [1, 2]], [1.0, 1.0])
    problem = ts.Problem(network.mesh, supports=[ts.Fixed([0, 2])], loads=[ts.Force([1], (0.0, -0.1))])
    with pytest.raises(ts.TruespringError, match=r"material, a section and elements of .*triangle"):
        model.potential(problem)


def test_locking_is_told() -> None:
    section = {"plane strain": True, "plane stress": False}
    for name, locks in section.items():
        tight, loose = (body(random_mesh("triangle", np.random.default_rng(3)), name, nu) for nu in (0.45, 0.3))
        for model in (ts.Heml("neo-hookean"), ts.MassTensor("linear")):
            assert not model.warnings(loose)
            assert any("0.45" in said and "lock" in said for said in model.warnings(tight)) == locks


@pytest.mark.parametrize("model", [ts.Heml("neo-hookean"), ts.MassTensor(SAME), ts.MassTensor("linear")])
def test_multigrid_finds_the_same(model: Model) -> None:
    problem = cantilever("triangle", (0.0, -0.005), cells=8)
    iterated, factorised = (
        ts.solve(problem, model, ts.Newton(load_steps=1, linear=linear)) for linear in ("multigrid", "direct")
    )
    assert iterated.status is factorised.status is ts.Status.CONVERGED
    assert iterated.cost is not None and iterated.cost.cg_iterations > 0
    assert apart(iterated.states[-1].displacement, factorised.states[-1].displacement) < 1e-7


def test_a_study_of_them(tmp_path: Path) -> None:
    """They are kinds of a study, drawn like others; for a linear one loads that follow the body act as at rest."""
    study = read_study(
        written(
            tmp_path,
            changed(
                ("elements = [8, 2]", 'elements = [8, 2]\nelement = "triangle"'),
                ('kind = "springs"\nrule = "lloyd"', f'kind = "heml"\nlaw = "{SAME}"'),
                (
                    'kind = "fem"\nlaw = "linear"',
                    'kind = "fem"\nlaw = "linear"\nelement = "linear"\n'
                    '[models.rubber]\nkind = "heml"\nlaw = "neo-hookean"\n'
                    f'[models.tensors]\nkind = "mass-tensor"\nlaw = "{SAME}"\n'
                    '[models.sums]\nkind = "mass-tensor"\nlaw = "linear"',
                ),
                ("[solver]", '[[load]]\non = "right"\nmoment = "0.05 N mm"\n[solver]'),
                ('probe = "right-middle"', 'probe = "right-middle"\nmodel = "springs"'),
            ),
        )
    )
    told = plan(study)["models"]
    assert {name: (one["kind"], one["law"]) for name, one in told.items()} == {
        "springs": ("heml", SAME),
        "linear": ("fem", "linear"),
        "rubber": ("heml", "neo-hookean"),
        "tensors": ("mass-tensor", SAME),
        "sums": ("mass-tensor", "linear"),
    }
    result = run(study)
    assert result.converged
    assert result.comparisons["tensors"].rms_error == pytest.approx(0, abs=1e-8)
    assert result.comparisons["rubber"].rms_error > 1e-4
    ends = {name: path.states[-1].displacement for name, path in result.solutions.items()}
    assert apart(ends["sums"], ends["linear"]) < 1e-10
    assert apart(ends["sums"], ends["tensors"]) > 1e-3
    write(result, tmp_path / "out")
    page = (tmp_path / "out" / "study" / "report.html").read_text(encoding="utf-8")
    drawn = words(draw_figures(result)["undeformed"])
    assert any(text.endswith(" 58 links") for text in drawn) and "links" in drawn and "springs" not in drawn
    for label in ("HEML (St. Venant-Kirchhoff)", "HEML (neo-Hookean)", "mass-tensor (linear)"):
        assert label in page
    assert (tmp_path / "out" / "study" / "rubber.pvd").exists()
