"""How far a reference is itself off: against closed forms, and against solutions on meshes two levels finer."""

import json
import math
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np
import pytest

import truespring as ts
from tests.meshes import plane_of_two, solid_of_four
from tests.studies import changed, written
from tests.wording import in_order
from truespring.arrays import Ints
from truespring.cli import main
from truespring.comparison import compare
from truespring.mesh import in_simplices, refined
from truespring.refining import coarser_problem, own_error, refined_problem, work_of
from truespring.report.summary import summary
from truespring.report.verdict import verdict
from truespring.study import read_study, run


def cantilever(
    elements: tuple[int, int] = (8, 2), element: str = "quadrilateral", poisson: float = 1 / 3, strain: bool = False
) -> ts.Problem:
    section = ts.PlaneStrain(0.01) if strain else ts.PlaneStress(0.01)
    mesh = ts.rectangle((0.16, 0.04), elements, element)
    load = ts.Force("right", (0.0, -0.03))
    return ts.Problem(mesh, ts.Material(10e3, poisson), section, [ts.Fixed("left")], [load])


def limit_of(problem: ts.Problem, law: str, halvings: int = 2) -> ts.Solution:
    """The same law by second-order triangles on a mesh so many times halved."""
    mesh, _ = in_simplices(problem.mesh)
    for _ in range(halvings):
        mesh = refined(mesh)
    return ts.solve(replace(problem, mesh=mesh), ts.Fem(law), ts.Newton(load_steps=2))


@pytest.mark.parametrize(
    ("problem", "model", "most"),
    [
        (cantilever(), ts.Fem("neo-hookean"), 1.15),
        (cantilever(), ts.Fem("linear"), 1.15),
        (cantilever((4, 1), "triangle"), ts.Fem("linear", "linear"), 1.15),
        (cantilever((4, 1), "triangle"), ts.Fem("linear"), 2.0),
        (cantilever(poisson=0.45, strain=True), ts.Fem("neo-hookean"), 2.0),
        (cantilever(poisson=0.49, strain=True), ts.Fem("linear", "linear"), 1.15),
        (cantilever((4, 1)), ts.Heml("saint-venant-kirchhoff"), 1.15),
        (cantilever((4, 1)), ts.MassTensor("linear"), 1.15),
    ],
)
def test_a_reference_is_no_further_off_than_is_said_and_not_much_less(
    problem: ts.Problem, model: ts.Fem, most: float
) -> None:
    found = ts.reference_error(problem, model, ts.Newton(load_steps=3))
    truth = compare(ts.solve(problem, model, ts.Newton(load_steps=3)), limit_of(problem, model.law)).error
    assert truth is not None and found.value is not None
    assert truth > 0.005
    assert truth <= found.value <= most * truth


def test_a_uniform_stretch_is_exact_on_any_mesh() -> None:
    for element, model in (("quadrilateral", "linear"), ("triangle", "linear"), ("triangle", "quadratic")):
        mesh = ts.rectangle((0.16, 0.04), (4, 2), element)
        supports = [ts.Fixed("left", fix=["x"]), ts.Fixed([0], fix=["y"])]  # by a number: it is refined with the mesh
        pull = ts.Force("right", (0.5, 0.0))
        problem = ts.Problem(mesh, ts.Material(10e3, 0.3), ts.PlaneStress(0.01), supports, [pull])
        found = ts.reference_error(problem, ts.Fem("neo-hookean", model))
        assert found.value is not None and found.value < 1e-9, (element, model)


def tube(poisson: float) -> ts.Problem:
    """A quarter of a tube, 10 to 20 mm, under 1 kPa inside, in plane strain."""
    flat = ts.rectangle((1.0, 1.0), (2, 20))
    radius, angle = 0.01 * (1 + flat.nodes[:, 0]), math.pi / 2 * flat.nodes[:, 1]
    nodes = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    at = flat.nodes
    groups = {"inner": at[:, 0] == 0, "along x": at[:, 1] == 0, "along y": at[:, 1] == 1}
    mesh = ts.Mesh(nodes, flat.elements, node_groups={name: np.flatnonzero(of) for name, of in groups.items()})
    supports = [ts.Fixed("along x", fix=["y"]), ts.Fixed("along y", fix=["x"])]
    return ts.Problem(mesh, ts.Material(100e3, poisson), ts.PlaneStrain(0.001), supports, [ts.Pressure("inner", 1e3)])


def lame(problem: ts.Problem, pressure: float = 1e3, inner: float = 0.01, outer: float = 0.02) -> ts.arrays.Floats:
    """Lame's displacement of a tube under pressure inside, in plane strain [m]."""
    material = problem.material
    assert material is not None
    radius = np.linalg.norm(problem.mesh.nodes, axis=1)
    share = pressure * inner**2 / (outer**2 - inner**2)
    along = (1 + material.poisson) / material.young * share
    moved = along * ((1 - 2 * material.poisson) * radius + outer**2 / radius)
    return np.asarray(problem.mesh.nodes / radius[:, None] * moved[:, None])


@pytest.mark.parametrize(("poisson", "least"), [(0.3, 0.01), (0.4999, 0.8)])
def test_locking_is_seen_as_far_as_lame_tells(poisson: float, least: float) -> None:
    problem = tube(poisson)
    path = ts.solve(problem, ts.Fem("linear", "linear"))
    wanted = lame(problem)
    off = np.linalg.norm(path.states[-1].displacement - wanted) / np.linalg.norm(wanted)
    found = own_error(path, ts.Fem("linear", "linear"), ts.Newton(), math.inf)
    assert off > least and found.value is not None
    assert off <= found.value <= 1.35 * off  # the arcs are polygons to both, not to Lame


def test_the_force_of_a_moved_support_counts() -> None:
    grips = [ts.Fixed("left"), ts.Fixed("right", displacement=(0.0, 0.01))]
    problem = ts.Problem(ts.rectangle((0.04, 0.02), (4, 2)), ts.Material(10e3, 0.3), ts.PlaneStress(0.01), grips)
    path, fine = (ts.solve(one, ts.Fem("neo-hookean")) for one in (problem, replace(problem, mesh=_fine(problem))))
    (mine,), (theirs,) = (one.support_forces(one.states[-1]) for one in (path, fine))
    off = np.linalg.norm(mine.force - theirs.force) / np.linalg.norm(theirs.force)
    found = ts.reference_error(problem, ts.Fem("neo-hookean"))
    assert found.comparison is not None and found.comparison.rms_error is not None
    assert off > 2 * found.comparison.rms_error
    assert found.value is not None and off * 0.95 <= found.value <= 1.3 * off


def _fine(problem: ts.Problem) -> ts.Mesh:
    return refined(refined(in_simplices(problem.mesh)[0]))


def test_regions_and_groups_go_with_the_mesh() -> None:
    mesh = replace(cantilever().mesh, element_groups={"tip": np.array([6, 7, 14, 15])})
    soft = ts.Material(5e3, 0.2)
    by_name = replace(cantilever(), mesh=mesh, regions=[ts.Region("tip", soft)])
    by_number = replace(by_name, regions=[ts.Region(np.array([6, 7, 14, 15]), soft)])  # type: ignore[arg-type]
    finer = refined_problem(by_number)
    assert finer.of_elements(lambda one: one.young) @ finer.mesh.measures == pytest.approx(
        by_name.of_elements(lambda one: one.young) @ mesh.measures
    )
    values = [ts.reference_error(one, ts.Fem("linear")).value for one in (by_name, by_number)]
    assert values[0] == pytest.approx(values[1]) and values[0] is not None and values[0] > 0.05


BODIES = [
    ts.rectangle((3.0, 2.0), (3, 2)),
    ts.box((3.0, 2.0, 1.0), (3, 2, 2)),
    plane_of_two((6.0, 4.0), (6, 4)),
    ts.box((3.0, 3.0, 3.0), (3, 3, 3), "wedge"),
    solid_of_four(),
]


def with_numbers(mesh: ts.Mesh, numbers: Ints) -> ts.Mesh:
    """The mesh with its nodes in another order, and a group of one element."""
    nodes = np.empty_like(mesh.nodes)
    nodes[numbers] = mesh.nodes
    return ts.Mesh(nodes, numbers[mesh.elements], mesh.element, element_groups={"one": [1]})  # type: ignore[dict-item]


@pytest.mark.parametrize("mesh", BODIES)
def test_division_into_simplices_keeps_the_body(mesh: ts.Mesh) -> None:
    rng = np.random.default_rng(1)
    numbers = rng.permutation(mesh.n_nodes)  # no order of the numbers is taken for granted
    found, parents = in_simplices(with_numbers(mesh, numbers))
    assert np.bincount(parents, found.measures) == pytest.approx(mesh.measures, rel=1e-12)
    assert np.array_equal(found.element_groups["one"], np.flatnonzero(parents == 1))
    # Every facet inside has two elements: neighbours divide what they share alike.
    triangles = sum(len(np.unique(facet)) - 2 for facet in mesh.boundary) if mesh.dim == 3 else len(mesh.boundary)
    assert len(found.boundary) == triangles
    assert len(found.facets) == (len(found.elements) * (mesh.dim + 1) + len(found.boundary)) // 2


@pytest.mark.parametrize("element", ["wedge", "pyramid"])
def test_wedges_and_pyramids_have_an_error_of_their_own(element: str) -> None:
    """No further off than is said, by the deflection of tetrahedra of second order on a mesh halved once more."""
    mesh = ts.box((0.16, 0.04, 0.04), (4, 1, 1), element)
    load = ts.Force("right", (0.0, -0.03, 0.0))
    problem = ts.Problem(mesh, ts.Material(10e3, 0.3), supports=[ts.Fixed("left")], loads=[load])
    found = ts.reference_error(problem, ts.Fem("linear"))
    truth = compare(ts.solve(problem, ts.Fem("linear")), limit_of(problem, "linear", 1)).error
    assert truth is not None and found.value is not None and truth > 0.05
    assert truth <= found.value <= 1.15 * truth


def of_several_kinds(name: str) -> ts.Mesh:
    """A brick of hexahedra whose last ones are wedges, pyramids or both, or quadrilaterals and triangles."""
    if name == "triangles":
        mesh = ts.rectangle((3.0, 1.0), (3, 1))
        last = mesh.elements[-1]
        cells = {"quadrilateral": mesh.elements[:-1], "triangle": np.array([last[[0, 1, 2]], last[[0, 2, 3]]])}
        return ts.Mesh.of_kinds(mesh.nodes, cells, facet_groups={"one": [[0, 0]], "three": [[2, 0], [3, 1]]})
    mesh = ts.box((3.0, 1.0, 1.0), (3, 1, 1))
    last = mesh.elements[-1]
    wedges = last[[[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]]
    if name == "wedges":
        wedges = np.concatenate([one[[[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]] for one in mesh.elements])
        return ts.Mesh(mesh.nodes, wedges, "wedge", facet_groups={"one": [[4, 0], [4, 3]], "three": [[5, 0]]})
    cells = {"hexahedron": mesh.elements[:-1], "wedge": wedges}
    if name == "pyramids":  # from the middle of the last brick
        of = np.array([[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]])
        middle = np.full((6, 1), mesh.n_nodes)
        cells["pyramid"] = np.concatenate([last[of[:, ::-1]], middle], axis=1)
        del cells["wedge"]
        nodes = np.concatenate([mesh.nodes, mesh.nodes[last].mean(axis=0, keepdims=True)])
        return ts.Mesh.of_kinds(nodes, cells, facet_groups={"one": [[2, 0]], "three": [[2, 0], [0, 1]]})
    return ts.Mesh.of_kinds(mesh.nodes, cells, facet_groups={"one": [[2, 0], [0, 1]], "three": [[3, 0]]})


@pytest.mark.parametrize("name", ["triangles", "wedges", "pyramids", "hexahedra and wedges"])
def test_bodies_of_several_kinds_are_divided_and_their_facets_with_them(name: str) -> None:
    mesh = of_several_kinds(name)
    found, parents = in_simplices(mesh)
    assert np.bincount(parents, found.measures) == pytest.approx(mesh.measures, rel=1e-12)
    assert len(found.facets) == (len(found.elements) * (mesh.dim + 1) + len(found.boundary)) // 2
    per_facet = {2: lambda nodes: 1, 3: lambda nodes: len(set(nodes)) - 2}[mesh.dim]
    for group, facets in mesh.facet_groups.items():
        nodes = mesh.facet_nodes(facets)
        assert len(found.facet_groups[group]) == sum(per_facet(one) for one in nodes.tolist())
        assert np.array_equal(np.unique(found.facet_nodes(found.facet_groups[group])), np.unique(nodes))


@pytest.mark.parametrize("name", ["triangles", "wedges", "hexahedra and wedges"])
def test_a_coarse_reference_of_several_kinds_is_called_so(name: str) -> None:
    """A cantilever one element deep is by far too stiff, whatever its elements are."""
    mesh = of_several_kinds(name)
    down = (0.0, -1.0, 0.0)[: mesh.dim]
    section = ts.PlaneStress(1.0) if mesh.dim == 2 else None
    loads, supports = [ts.Force("right", down)], [ts.Fixed("left")]
    problem = ts.Problem(mesh=mesh, material=ts.Material(1e5, 0.3), section=section, supports=supports, loads=loads)
    found = ts.reference_error(problem, ts.Fem("linear"))
    length, inertia = 3.0, 1 / 12
    stiff = ts.solve(problem, ts.Fem("linear")).states[-1].displacement[:, 1].min() / (-(length**3) / 3e5 / inertia)
    assert found.how == "second order" and found.value is not None and found.value > 0.7 * (1 - stiff) > 0.1


def test_a_coarser_mesh_tells_where_finer_ones_cost_too_much() -> None:
    problem, model, solver = cantilever((8, 2)), ts.Fem("neo-hookean"), ts.Newton(load_steps=3)
    path = ts.solve(problem, model, solver)
    truth = compare(path, limit_of(problem, model.law)).error
    found = own_error(path, model, solver, work_of(path))
    assert found.how == "coarser" and found.value is not None and truth is not None
    assert truth <= found.value <= 4 * truth
    assert coarser_problem(problem).mesh.n_nodes == 10
    nothing = own_error(path, model, solver, 0.0)
    assert nothing.value is None and "cost too much" in nothing.how


def test_a_path_that_was_not_solved_to_the_end_has_no_error_of_its_own() -> None:
    path = ts.solve(cantilever(), ts.Fem("linear"))
    assert own_error(replace(path, states=path.states[:-1]), ts.Fem("linear"), ts.Newton(), math.inf).value is None


TWINS = (
    ('law = "linear"', 'law = "linear"\nelement = "linear"'),
    ("elements = [8, 2]", 'elements = [4, 1]\nelement = "triangle"'),
    ('force = ["0 N", "-0.01 N"]', 'force = ["0 N", "-1 mN"]'),
    ('rule = "lloyd"', 'rule = "biquadratic"'),
    ("refine = false", ""),
)


def test_agreement_of_two_that_are_equally_wrong_is_called_that(tmp_path: FilePath, capsys) -> None:  # type: ignore[no-untyped-def]
    file = written(tmp_path, changed(*TWINS))
    assert main(["verify", str(file), "--out", str(tmp_path / "out")]) == 0
    told = " ".join(capsys.readouterr().out.split())
    found = json.loads((tmp_path / "out" / "study" / "summary.json").read_text(encoding="utf-8"))["comparison"]
    # Timoshenko: F L^3 / (3 E I) and, of the shear, F L / (5/6 G A).
    bar = 1e-3 * 0.04**3 / (3 * 10e3 * 0.01**4 / 12) + 1e-3 * 0.04 / (5 / 6 * 10e3 / 2.6 * 0.01**2)
    curves = (tmp_path / "out" / "study" / "curves.csv").read_text(encoding="utf-8").splitlines()
    off = 1 + float(curves[-1].split(",")[3]) / bar
    assert found["linear"]["rms_error"] < 0.05 < 0.5 < off
    assert found["linear"]["reference_error"] == pytest.approx(off, rel=0.15)
    assert found["linear"]["refined_error"] == pytest.approx(off, rel=0.15)
    assert in_order(told, "not evidence", "on this mesh linear FEM (linear) is itself about", "more than 5 %")
    page = (tmp_path / "out" / "study" / "report.html").read_text(encoding="utf-8")
    assert "reference’s own error" in page and "not evidence" in page


def test_refinement_is_left_out_where_the_study_says_so(tmp_path: FilePath) -> None:
    left_out = run(read_study(written(tmp_path)))
    assert summary(left_out)["comparison"]["linear"]["reference_error"] is None
    assert "itself" not in verdict(left_out)
    told = run(read_study(written(tmp_path, changed(("refine = false", "")))))
    assert summary(told)["comparison"]["linear"]["reference_error"] > 0.01
    assert "Linear FEM on this mesh is itself" in verdict(told) and "against refined references, linear FEM" in verdict(
        told
    )


def test_a_time_limit_ends_refinement() -> None:
    problem, model = cantilever((4, 1)), ts.Fem("linear")
    path = ts.solve(problem, model, ts.Newton(load_steps=1))
    late = own_error(path, model, ts.Newton(load_steps=1), math.inf, timeout=1e-9)
    assert late.value is None and "time limit of 1e-09 s" in late.how
    assert own_error(path, model, ts.Newton(load_steps=1), math.inf, timeout=1000).value is not None
