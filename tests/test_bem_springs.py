"""Boundary elements beside springs: Kelvin's solution, the block alone, the coupling, and what is refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.studies import changed, written
from truespring.arrays import Floats
from truespring.errors import StudyError
from truespring.models.bem_springs import BlockSprings
from truespring.models.block import Block, make_block
from truespring.models.boundary import Influence, Kelvin
from truespring.models.elasticity import hooke
from truespring.models.frames import Turning
from truespring.models.panels import Panels
from truespring.report.bodies import path_lines
from truespring.rigid_modes import rigid_body_modes
from truespring.study import read_study, run
from truespring.study.plan import plan
from truespring.study.writing import write

YOUNG, POISSON, THICKNESS = 7.0, 0.3, 0.4
SECTIONS: dict[str, ts.PlaneStress | ts.PlaneStrain] = {
    "plane stress": ts.PlaneStress(THICKNESS),
    "plane strain": ts.PlaneStrain(THICKNESS),
}


def body(
    mesh: ts.Mesh, load: float = 1e-3, section: ts.PlaneStress | ts.PlaneStrain = SECTIONS["plane stress"]
) -> ts.Problem:
    """Held on the left, pulled up on the right."""
    return ts.Problem(
        mesh,
        ts.Material(YOUNG, POISSON),
        section if mesh.dim == 2 else None,
        [ts.Fixed("left")],
        [ts.Force("right", [0.0, load, 0.0][: mesh.dim])],
    )


def whole(problem: ts.Problem) -> Block:
    return make_block(problem, np.arange(len(problem.mesh.elements)))


def distorted(mesh: ts.Mesh) -> ts.Mesh:
    """All nodes moved, those on the left along it."""
    jitter = np.random.default_rng(5813).uniform(-0.1, 0.1, mesh.nodes.shape)
    jitter[mesh.nodes[:, 0] == 0, 0] = 0.0
    return ts.Mesh(mesh.nodes + jitter, mesh.elements, mesh.element)


def ring() -> ts.Mesh:
    """Squares about a hole."""
    mesh = ts.rectangle((5.0, 3.0), (5, 3))
    return ts.Mesh(mesh.nodes, np.delete(mesh.elements, 7, axis=0), mesh.element)


PLANE = {
    "ring": ring(),
    "squares": ts.rectangle((8.0, 4.0), (8, 4)),
    "distorted": distorted(ts.rectangle((5.0, 3.0), (5, 3))),
    "triangles": ts.rectangle((4.0, 3.0), (4, 3), "triangle", "alternating"),
}
SPACE = {"cubes": ts.box((2.0, 1.0, 1.0), (2, 1, 1)), "tetrahedra": ts.box((1.0, 1.0, 1.0), (1, 1, 1), "tetrahedron")}
BODIES = {**PLANE, **SPACE}
CASES = [(name, section) for name in PLANE for section in SECTIONS] + [(name, "plane stress") for name in SPACE]
GRADIENT = np.array([[0.3, 0.25, 0.1], [-0.1, -0.2, -0.2], [0.05, 0.15, 0.1]])


def uniform(problem: ts.Problem) -> tuple[Floats, Floats]:
    """The gradient of a uniform displacement, and its stress by Hooke's law within the section."""
    dim, material = problem.mesh.dim, problem.material
    assert problem.section is not None and material is not None
    gradient = GRADIENT[:dim, :dim]
    strain = (gradient + gradient.T) / 2
    lam, mu = problem.section.lame_within(material)
    return gradient, lam * np.trace(strain) * np.eye(dim) + 2 * mu * strain


@pytest.mark.parametrize("unit", [1e-24, 1e24])
def test_a_block_is_as_stiff_as_its_material_in_any_unit(unit: float) -> None:
    problem = body(PLANE["squares"])
    other = replace(problem, material=ts.Material(unit * YOUNG, POISSON))
    assert whole(other).stiffness == pytest.approx(unit * whole(problem).stiffness, rel=1e-9, abs=1e-9 * unit)


@pytest.mark.parametrize(("name", "section"), CASES)
def test_uniform_strain_makes_uniform_traction(name: str, section: str) -> None:
    """The patch test of tractions: stress times normal on every panel, in the plane to rounding."""
    problem = body(BODIES[name], section=SECTIONS[section])
    mesh, material = problem.mesh, problem.material
    assert material is not None
    plane_stress = mesh.dim == 2 and section == "plane stress"
    kelvin = Kelvin(material.lame.mu, POISSON / (1 + POISSON) if plane_stress else POISSON, mesh.diameter)
    surface = np.unique(mesh.boundary)
    panels = Panels(mesh.nodes[surface], np.searchsorted(surface, mesh.boundary))
    G, H = Influence(panels, kelvin).equations()
    gradient, stress = uniform(problem)
    traction = np.linalg.solve(G, H @ (panels.nodes @ gradient.T).ravel()).reshape(-1, mesh.dim)
    expected = panels.middles.normals[:, 0] @ stress
    error = np.abs(traction - expected).max() / np.abs(stress).max()
    assert error < (1e-12 if mesh.dim == 2 else 1e-6)
    assert np.abs(expected).max() > 0.1


@pytest.mark.parametrize(("name", "section"), CASES)
def test_the_block_stores_the_energy_of_uniform_strain(name: str, section: str) -> None:
    """Its stiffness is symmetric and positive but for rigid motions, its inside follows a uniform strain."""
    problem = body(BODIES[name], section=SECTIONS[section])
    mesh = problem.mesh
    block = whole(problem)
    gradient, stress = uniform(problem)
    moved = block.nodes @ gradient.T
    energy = float((moved * block.forces(moved)).sum()) / 2
    depth = THICKNESS if mesh.dim == 2 else 1.0
    expected = float((stress * gradient).sum()) / 2 * mesh.measures.sum() * depth
    assert energy == pytest.approx(expected, rel=1e-12 if mesh.dim == 2 else 1e-6)
    S = block.stiffness
    assert np.abs(S - S.T).max() == 0
    values = np.linalg.eigvalsh(S)
    n_rigid = 3 if mesh.dim == 2 else 6
    assert (np.abs(values) < 1e-12 * values[-1]).sum() == n_rigid
    assert values[0] > -1e-12 * values[-1] and values[n_rigid] > 1e-3 * values[-1]
    n = len(block.surface)
    if len(block.inside):
        following = block.following @ moved[:n].ravel()
        assert following == pytest.approx(moved[n:].ravel(), abs=1e-12 if mesh.dim == 2 else 1e-6)
    for mode in rigid_body_modes(block.nodes).T:
        assert np.abs(block.forces(mode.reshape(block.nodes.shape))).max() < 1e-12 * values[-1]


def test_only_panels_finer_than_the_facets_see_a_sawtooth(monkeypatch: pytest.MonkeyPatch) -> None:
    """One panel a facet, with the integral equation at its middle, leaves the stiffness indefinite; two do not."""
    problem = body(ts.rectangle((8.0, 4.0), (8, 4)))
    whole(problem)
    monkeypatch.setattr(Panels, "_pieces", np.array([[[0.0], [1.0]]]))
    with pytest.raises(ts.TruespringError, match=r"block .*(unstable|not stable)"):
        whole(problem)


def tip(problem: ts.Problem, displacement: Floats) -> float:
    """The mean displacement of the end by the load's own weights, along the load."""
    force = problem.loading.external_force
    return float((force * displacement).sum() / force.sum())


def block_alone(problem: ts.Problem) -> Floats:
    """The displacement of a body that is all block."""
    block, loading = whole(problem), problem.loading
    free = ~loading.held[block.surface].ravel()
    moved = np.zeros(free.size)
    force = loading.external_force[block.surface].ravel()
    moved[free] = np.linalg.solve(block.stiffness[np.ix_(free, free)], force[free])
    displacement = np.zeros(problem.mesh.nodes.shape)
    displacement[block.surface] = moved.reshape(-1, problem.mesh.dim)
    displacement[block.inside] = (block.following @ moved).reshape(-1, problem.mesh.dim)
    return displacement


def linear_fem(problem: ts.Problem) -> Floats:
    path = ts.solve(problem, ts.Fem("linear", "linear"), ts.Newton(load_steps=1))
    return path.states[-1].displacement


def shape(depth: int, dim: int) -> ts.Mesh:
    return (
        ts.rectangle((2.0, 1.0), (2 * depth, depth)) if dim == 2 else ts.box((2.0, 1.0, 1.0), (2 * depth, depth, depth))
    )


def converged_tip(depths: tuple[int, int], dim: int) -> float:
    """Finite elements on two meshes, carried on by their second order."""
    (coarse, fine), (first, second) = depths, [body(shape(depth, dim)) for depth in depths]
    ends = tip(first, linear_fem(first)), tip(second, linear_fem(second))
    return ends[1] + (ends[1] - ends[0]) / ((fine / coarse) ** 2 - 1)


@pytest.mark.parametrize(
    ("dim", "errors", "depths"), [(2, {2: 0.02, 4: 0.004, 8: 0.001}, (16, 48)), (3, {1: 0.04, 2: 0.015}, (4, 8))]
)
def test_the_block_alone_meets_finite_elements(dim: int, errors: dict[int, float], depths: tuple[int, int]) -> None:
    converged = converged_tip(depths, dim)
    found = []
    for depth, bound in errors.items():
        problem = body(shape(depth, dim))
        found.append(abs(tip(problem, block_alone(problem)) / converged - 1))
        assert found[-1] < bound
        # Linear finite elements on the same mesh are much further off.
        assert abs(tip(problem, linear_fem(problem)) / converged - 1) > 3 * found[-1]
    assert found == sorted(found, reverse=True)


def test_the_inside_moves_as_in_finite_elements() -> None:
    problem = body(shape(12, 2))
    middle = np.abs(problem.mesh.nodes[:, 0] - 1) < 1e-9
    ours, theirs = block_alone(problem), linear_fem(problem)
    assert ours[middle] == pytest.approx(theirs[middle], abs=0.003 * np.abs(theirs).max())


def cantilever(counts: tuple[int, ...], load: float, scale: float = 1.0) -> ts.Problem:
    """4 by 1 of E = t = 1, or as much larger as `scale`, pulled up at the end."""
    size = np.array([4.0, 1.0, 1.0])[: len(counts)] * scale
    mesh = ts.rectangle(size.tolist(), counts) if len(counts) == 2 else ts.box(size.tolist(), counts)
    return ts.Problem(
        mesh,
        ts.Material(1.0, 1 / 3 if len(counts) == 2 else 1 / 4),
        ts.PlaneStress(scale) if len(counts) == 2 else None,
        [ts.Fixed("left")],
        [ts.Force("right", [0.0, load * scale**2, 0.0][: len(counts)])],
    )


def left_part(share: float, dim: int, scale: float = 1.0) -> ts.Box:
    return ts.Box((0.0,) * dim, (4 * share * scale, *(scale,) * (dim - 1)))


def end(path: ts.Solution, dim: int) -> Floats:
    """The displacement of the end over the length, by the load's own weights."""
    problem = path.problem
    weight = problem.loading.external_force[:, 1] / problem.loading.external_force[:, 1].sum()
    return np.asarray(weight @ path.states[-1].displacement / problem.mesh.upper[0])[:dim]


#: At small load, and at 53 % deflection: St. Venant-Kirchhoff finite elements, converged.
SMALL, LARGE = 0.00668281, np.array([-0.1842, 0.5314])


@pytest.mark.parametrize(("rule", "expected"), [("lloyd", 0.005), ("isotropic", -0.007)])
def test_half_a_block_at_small_load(rule: str, expected: float) -> None:
    """The figures of an independent implementation, as the share that the end is off by."""
    problem = cantilever((16, 4), 1e-4)
    path = ts.solve(problem, ts.BemSprings(left_part(0.5, 2), rule), ts.Newton(load_steps=1))
    assert path.status == "converged"
    assert end(path, 2)[1] / SMALL - 1 == pytest.approx(expected, abs=0.001)


@pytest.mark.parametrize(
    ("counts", "share", "rule", "corotated", "expected"),
    [
        ((16, 4), 0.5, "lloyd", False, 0.161),
        ((16, 4), 0.5, "isotropic", False, 0.170),
        ((16, 4), 0.5, "isotropic", True, 0.039),
        ((32, 8), 0.25, "isotropic", False, 0.045),
        ((32, 8), 0.25, "isotropic", True, 0.025),
        ((32, 8), 0.5, "isotropic", False, 0.156),
        ((32, 8), 0.5, "isotropic", True, 0.034),
    ],
)
def test_half_a_block_at_large_load(
    counts: tuple[int, int], share: float, rule: str, corotated: bool, expected: float
) -> None:
    """The figures of an independent implementation; a block that turns errs by a fifth of one that does not."""
    path = ts.solve(
        cantilever(counts, 0.0107), ts.BemSprings(left_part(share, 2), rule, corotated), ts.Newton(load_steps=2)
    )
    assert path.status == "converged"
    error = float(np.linalg.norm(end(path, 2) - LARGE) / np.linalg.norm(LARGE))
    assert error == pytest.approx(expected, abs=0.001)


def test_size_does_not_matter() -> None:
    """No unit of length hides in the logarithm of the plane's solution.

    Where it is one metre, the stiffness of a block of 3 m by 1 m is much in error: its size is near that at which a
    uniform displacement makes any traction. The independent implementation has 0.263 there.
    """
    ends = []
    for scale in (1e-3, 1.0, 40.0):
        model = ts.BemSprings(left_part(0.75, 2, scale))
        path = ts.solve(cantilever((32, 8), 0.0107, scale), model, ts.Newton(load_steps=2))
        ends.append(end(path, 2))
    assert ends[0] == pytest.approx(ends[1], rel=1e-7)
    assert ends[2] == pytest.approx(ends[1], rel=1e-7)
    assert float(np.linalg.norm(ends[1] - LARGE) / np.linalg.norm(LARGE)) == pytest.approx(0.2577, abs=1e-3)


@pytest.mark.parametrize("corotated", [False, True])
def test_nodes_inside_the_block_follow_and_bear_nothing(corotated: bool) -> None:
    problem = cantilever((16, 4), 0.0107)
    model = ts.BemSprings(left_part(0.5, 2), "isotropic", corotated)
    path = ts.solve(problem, model, ts.Newton(load_steps=2))
    potential, state = path.potential, path.states[-1]
    assert isinstance(potential, BlockSprings)
    block = potential.frame.block
    assert len(block.inside) == 7 * 3
    moved = potential.frame.displacement(state.positions[block.numbers])
    n = len(block.surface)
    assert moved[n:].ravel() == pytest.approx(block.following @ moved[:n].ravel(), abs=1e-9)
    # What ties them to the surface may be as stiff as one likes.
    stiffer = replace(block, kappa=100 * block.kappa)
    frame = type(potential.frame)(stiffer)  # type: ignore[call-arg]
    other = ts.solve(problem, replace(potential, frame=frame), ts.Newton(load_steps=2)).states[-1]
    assert other.displacement == pytest.approx(state.displacement, abs=1e-8)
    assert other.energy == pytest.approx(state.energy, rel=1e-8)


def test_springs_on_the_interface_count_their_own_elements_only() -> None:
    problem = cantilever((8, 2), 1e-4)
    potential = ts.BemSprings(left_part(0.5, 2)).potential(problem)
    everywhere = ts.Springs("isotropic").potential(problem)
    assert isinstance(everywhere, ts.SpringNetwork)
    known = {tuple(pair): k for pair, k in zip(everywhere.springs.tolist(), everywhere.stiffness, strict=True)}
    x = problem.mesh.nodes[:, 0]
    assert (x[potential.springs] >= 2).all()
    seen = 0
    for pair, stiffness in zip(potential.springs.tolist(), potential.network.stiffness, strict=True):
        on_interface = bool((x[pair] == 2).all())
        seen += on_interface
        assert stiffness == pytest.approx(known[tuple(pair)] / (2 if on_interface else 1), rel=1e-12)
    assert seen == 2
    lines = potential.cells["line"]
    assert set(lines.ravel().tolist()) == set(range(problem.mesh.n_nodes)), "the block is drawn too"


def test_small_turns_need_no_frame() -> None:
    problem = cantilever((8, 2), 1e-7)
    ends = [
        end(ts.solve(problem, ts.BemSprings(left_part(0.5, 2), "isotropic", turns), ts.Newton(load_steps=1)), 2)
        for turns in (False, True)
    ]
    assert ends[0][1] == pytest.approx(ends[1][1], rel=1e-5)


@pytest.mark.parametrize("name", ["squares", "cubes"])
def test_a_mirror_image_is_no_turn(name: str) -> None:
    """The frame turns; turned inside out the block is strained."""
    block = whole(body(BODIES[name]))
    frame = Turning(block)
    mirror = np.eye(block.nodes.shape[1])
    mirror[0, 0] = -1.0
    for positions in (block.nodes @ mirror, block.nodes @ (0.9 * mirror)):
        moved = frame.displacement(positions)
        assert np.linalg.norm(moved) > 0.1 * np.linalg.norm(block.nodes)
    assert np.linalg.norm(frame.displacement(block.nodes @ (mirror @ mirror).T)) < 1e-12


@pytest.mark.verification
def test_a_block_in_space() -> None:
    """16 by 4 by 4 cubes, half of them a block: the linear end within 1 %, and what turning takes of the error."""
    problem = cantilever((16, 4, 4), 1e-4)
    ends = []
    for depth in (4, 8):
        fine = cantilever((4 * depth, depth, depth), 1e-4)
        ends.append(tip(fine, linear_fem(fine)))
    converged = (ends[1] + (ends[1] - ends[0]) / 3) / 4
    path = ts.solve(problem, ts.BemSprings(left_part(0.5, 3)), ts.Newton(load_steps=1))
    assert abs(end(path, 3)[1] / converged - 1) < 0.01
    reference = ts.solve(cantilever((32, 8, 8), 0.0107), ts.Fem("saint-venant-kirchhoff"), ts.Newton(load_steps=4))
    errors = []
    for corotated in (False, True):
        model = ts.BemSprings(left_part(0.5, 3), "isotropic", corotated)
        large = ts.solve(cantilever((16, 4, 4), 0.0107), model, ts.Newton(load_steps=4))
        assert large.status == "converged"
        errors.append(float(np.linalg.norm(end(large, 3) - end(reference, 3)) / np.linalg.norm(end(reference, 3))))
    assert errors[0] > 0.12
    assert errors[1] < errors[0] / 3


HALF = ts.Box((0.0, 0.0), (2.0, 1.0))


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (lambda: ts.BemSprings(ts.Box((5.0, 0.0), (6.0, 1.0))), "no element with its centre in the box"),
        (lambda: ts.BemSprings("liver"), "'liver' is no group of elements"),
        (
            lambda: ts.BemSprings(ts.Box((0.0, 0.0), (4.0, 1.0))),
            "block: .*all elements",
        ),
        (lambda: ts.BemSprings([0, 15]), "block: .* 2 .*parts"),
        (lambda: ts.BemSprings(HALF, "lloid"), r"rule = 'lloid' is unknown \(did you mean 'lloyd'\?\)"),
        (lambda: ts.BemSprings(HALF, "biquadratic"), "'biquadratic' .*allowed: lloyd"),
        (lambda: ts.BemSprings(HALF, "van-gelder"), "rule = 'van-gelder' .*triangle, tetrahedron"),
        (lambda: ts.BemSprings("left"), "'left' is no group of elements"),
    ],
)
def test_what_does_not_go_together_is_refused(model: object, said: str) -> None:
    problem = cantilever((8, 2), 1e-4)
    with pytest.raises(ts.TruespringError, match=said):
        model().check(problem)  # type: ignore[operator]


def test_a_block_that_nothing_is_joined_to_is_refused() -> None:
    """Two squares that meet in a corner, and two that do not meet."""
    nodes = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [2, 1], [1, 2], [2, 2]], dtype=float)
    corner = ts.Mesh(nodes, np.array([[0, 1, 3, 2], [3, 4, 6, 5]]), "quadrilateral")
    square = nodes[:4]
    apart = ts.Mesh(np.concatenate([square, square + 2]), np.array([[0, 1, 3, 2], [4, 5, 7, 6]]), "quadrilateral")
    for mesh in (corner, apart):
        problem = ts.Problem(
            mesh,
            ts.Material(1.0, 0.3),
            ts.PlaneStress(1.0),
            [ts.Fixed([0, 2, 4, 6])],
            [ts.Force([5], (0.0, 1.0))],
        )
        with pytest.raises(ts.TruespringError, match=r"block: .*no facet"):
            ts.BemSprings([0]).potential(problem)


def test_what_acts_inside_a_block_is_refused() -> None:
    problem = cantilever((16, 4), 1e-4)
    inner = int(np.flatnonzero((problem.mesh.nodes == [1.0, 0.5]).all(axis=1))[0])
    model = ts.BemSprings(HALF)
    model.check(problem)
    loaded = replace(problem, loads=[ts.Force([inner], (0.0, 1e-4))])
    with pytest.raises(ts.TruespringError, match=f"block: a load .* 1 nodes.* {inner}"):
        model.check(loaded)
    heavy = replace(problem, material=ts.Material(1.0, 0.3, 1000.0), loads=[ts.Gravity((0.0, -1e-6))])
    with pytest.raises(ts.TruespringError, match=r"block: gravity .* acts"):
        model.check(heavy)
    held = replace(problem, supports=[ts.Fixed("left"), ts.Fixed([inner], ["y"])])
    with pytest.raises(ts.TruespringError, match=f"block: a support .* 1 .*nodes.* {inner}"):
        model.check(held)


def test_a_block_is_of_one_material_and_springs_of_any() -> None:
    problem = replace(cantilever((8, 2), 1e-4), regions=[ts.Region([0], ts.Material(2.0, 0.3))])
    with pytest.raises(ts.TruespringError, match=r"block: .* 2 materials"):
        ts.BemSprings(HALF).check(problem)
    stiff = replace(problem, regions=[ts.Region([7, 15], ts.Material(2.0, 0.3))])
    soft = cantilever((8, 2), 1e-4)
    ends = [end(ts.solve(one, ts.BemSprings(HALF), ts.Newton(load_steps=1)), 2)[1] for one in (soft, stiff)]
    assert ends[1] < 0.999 * ends[0]
    own = replace(soft, regions=[ts.Region(HALF, ts.Material(2.0, 0.3))])
    assert end(ts.solve(own, ts.BemSprings(HALF), ts.Newton(load_steps=1)), 2)[1] < 0.7 * ends[0]


def test_dense_matrices_that_do_not_fit_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("truespring.models.block.available_memory", lambda: 1e4)
    with pytest.raises(ts.TruespringError, match=r"block.* 12 facets.* GiB"):
        ts.BemSprings(HALF).potential(cantilever((8, 2), 1e-4))


STUDY = changed(
    ("-0.01 N", "-0.0001 N"),
    (
        'kind = "springs"\nrule = "lloyd"',
        'kind = "bem-springs"\nblock = { box = [["0 mm", "0 mm"], ["20 mm", "10 mm"]] }\ncorotated = true',
    ),
)


def test_a_study_takes_it(tmp_path: Path) -> None:
    study = read_study(written(tmp_path, STUDY))
    assert study.entries["springs"] == ts.BemSprings(ts.Box((0.0, 0.0), (0.02, 0.01)), "isotropic", True)
    told = plan(study)["models"]["springs"]
    assert told["kind"] == "bem-springs" and told["label"] == "BEM + springs (isotropic, corotated)"
    assert any("block: " in text and "0.333" in text for text in told["warnings"])
    result = run(study)
    assert result.converged
    assert 0 < result.comparisons["linear"].rms_error < 0.15  # of which FEM on so coarse a mesh has most
    write(result, tmp_path / "out", report=False)
    springs = result.solutions["springs"].potential
    assert isinstance(springs, BlockSprings)
    drawn = path_lines(result.solutions["springs"])
    assert len(drawn) > len(springs.springs) and set(drawn.ravel().tolist()) == set(range(27))
    kinds = json.loads((tmp_path / "out" / "study" / "summary.json").read_text("utf-8"))["models"]
    assert kinds["springs"]["kind"] == "bem-springs"
    assert (tmp_path / "out" / "study" / "springs.pvd").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("corotated = true", 'corotated = "yes"'), "corotated = 'yes'"),
        (("corotated = true", "turning = true"), "turning = True: unknown key; allowed: kind, block, rule, corotated"),
        (("corotated = true", 'rule = "biquadratic"'), "'biquadratic' is unknown; allowed: lloyd"),
        (('["20 mm"', '["1 mm"'), "models.springs: no element with its centre in the box"),
        (('["20 mm"', '["40 mm"'), "block: .*all elements"),
        (('block = { box = [["0 mm", "0 mm"], ["20 mm", "10 mm"]] }\n', ""), "block: is required and missing"),
        (("poisson = 0.3", "poisson = 0.5"), "between -1 and 0.5, both excluded"),
    ],
)
def test_a_faulty_study_is_refused(change: tuple[str, str], said: str, tmp_path: Path) -> None:
    assert STUDY.count(change[0]) == 1
    with pytest.raises(StudyError, match=said):
        read_study(written(tmp_path, STUDY.replace(*change)))


def test_its_springs_are_judged_before_the_solve() -> None:
    problem = cantilever((8, 2), 1e-4)
    assert any("0.882 to 1.105" in text for text in ts.BemSprings(HALF, "lloyd").warnings(problem))


def test_hooke_is_what_uniform_strain_is_compared_with() -> None:
    """The stress that the patch tests expect, by another way."""
    problem = body(PLANE["squares"])
    gradient, stress = uniform(problem)
    assert problem.section is not None and problem.material is not None
    C = hooke(*problem.section.lame_within(problem.material), 2)
    strain = np.array([gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]])
    assert C @ strain == pytest.approx([stress[0, 0], stress[1, 1], stress[0, 1]])
