"""Wedges, pyramids and meshes of several kinds of elements: bodies as all others are."""

import itertools
import json
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

import truespring as ts
from tests.meshes import plane_of_two, shaken, solid_of_four
from truespring.arrays import Floats
from truespring.cli import main
from truespring.errors import MeshError, ModelError
from truespring.mesh import CELL_SHAPES, corner_measures, element_corner_measures, refined
from truespring.mesh.facets import facet_keys, find_facets
from truespring.models.reference_element import FEM_KINDS, reference_element
from truespring.models.strain import uniform_strain, voigt_pairs

PLANE: Callable[[], ts.Mesh] = lambda: plane_of_two((6.0, 4.0), (6, 4))  # noqa: E731
BODIES: dict[str, Callable[[], ts.Mesh]] = {
    "wedges": lambda: ts.box((3.0, 3.0, 3.0), (3, 3, 3), "wedge"),
    "pyramids": lambda: ts.box((2.0, 2.0, 2.0), (2, 2, 2), "pyramid"),
    "plane of two kinds": PLANE,
    "solid of four kinds": solid_of_four,
}
every_body = pytest.mark.parametrize("name", BODIES)


def body(mesh: ts.Mesh, poisson: float = 0.3, **more: object) -> ts.Problem:
    """Held at its left third, pulled and bent at its right one."""
    x = mesh.nodes[:, 0]
    left, right = (np.flatnonzero(there) for there in (x < x.max() / 6, x > x.max() * 5 / 6))
    return ts.Problem(
        mesh,
        ts.Material(young=7.0, poisson=poisson, density=3.0),
        ts.PlaneStrain(0.5) if mesh.dim == 2 else None,
        [ts.Fixed(left)],
        [ts.Force(right, (0.02, 0.01, 0.0)[: mesh.dim])],
        **more,  # type: ignore[arg-type]
    )


# --- geometry -------------------------------------------------------------------------------------


def into_cell(kind: str, at: Floats) -> tuple[Floats, float]:
    """A point of the unit square or cube, squeezed into the cell, and by how much."""
    match kind:
        case "triangle":
            return np.array([at[0] * (1 - at[1]), at[1]]), 1 - at[1]
        case "wedge":
            return np.array([at[0] * (1 - at[1]), at[1], at[2]]), 1 - at[1]
        case "tetrahedron":
            r, s, t = at
            return np.array([r * (1 - s) * (1 - t), s * (1 - t), t]), (1 - s) * (1 - t) ** 2
        case "pyramid":
            r, s, t = at
            return np.array([(2 * r - 1) * (1 - t), (2 * s - 1) * (1 - t), t]), 4 * (1 - t) ** 2
        case _:
            return at, 1.0


def integrated(mesh: ts.Mesh) -> tuple[Floats, Floats]:
    """Volume of each element and the integral of each node's shape function, by shape functions and many points."""
    along, weights = np.polynomial.legendre.leggauss(4)
    along, weights = (along + 1) / 2, weights / 2
    volumes, shares = np.zeros(len(mesh.elements)), np.zeros(mesh.n_nodes)
    for numbers, part in mesh.blocks:
        shape = CELL_SHAPES[part.kind.vtk]
        for place in np.ndindex(*(4,) * mesh.dim):
            at, weight = along[list(place)], float(np.prod(weights[list(place)]))
            at, squeezed = into_cell(part.element, at)
            weight *= squeezed
            corners = mesh.nodes[part.elements]
            jacobian = np.linalg.det(np.einsum("nci,cj->nij", corners, shape.slopes(at[None])[0]))
            volumes[numbers] += weight * jacobian
            np.add.at(shares, part.elements, weight * jacobian[:, None] * shape.shapes(at[None]))
    return volumes, shares


@pytest.mark.parametrize("kind", FEM_KINDS)
def test_gauss_points_are_as_good_as_many_on_undistorted_elements(kind: str) -> None:
    """Products of the derivatives of two shape functions, which the stiffness of an element is the integral of."""
    shape, reference = CELL_SHAPES[ts.mesh.ELEMENT_KINDS[kind].vtk], reference_element(kind)
    along, weights = np.polynomial.legendre.leggauss(4)
    found = 0.0
    for place in np.ndindex(*(4,) * shape.dim):
        at, weight = into_cell(kind, (along[list(place)] + 1) / 2)
        slopes = shape.slopes(at[None])[0]
        found = found + np.prod(weights[list(place)] / 2) * weight * np.einsum("ai,bj->abij", slopes, slopes)
    ours = np.einsum("p,pai,pbj->abij", reference.weights, reference.slopes, reference.slopes)
    assert ours == pytest.approx(found, abs=1e-12)


@every_body
def test_volumes_and_shares_are_exact_on_distorted_meshes(name: str) -> None:
    mesh = shaken(BODIES[name](), 0.12)
    volumes, shares = integrated(mesh)
    assert mesh.measures == pytest.approx(volumes, rel=1e-12)
    at_nodes = np.zeros(mesh.n_nodes)
    np.add.at(at_nodes, mesh.elements, element_corner_measures(mesh))
    assert at_nodes == pytest.approx(shares, rel=1e-12)
    affine = np.array([[1.3, 0.2, -0.1], [0.1, 0.8, 0.3], [0.0, -0.2, 1.1]])[: mesh.dim, : mesh.dim]
    grown = mesh.measures_at(mesh.nodes @ affine.T)
    assert grown == pytest.approx(np.linalg.det(affine) * volumes, rel=1e-12)


@pytest.mark.parametrize("name", ["wedges", "pyramids", "solid of four kinds"])
def test_the_boundary_closes_and_holds_the_volume(name: str) -> None:
    """The flux of x through the surface is three times the volume; forces of a pressure on all of it are in balance."""
    mesh = shaken(BODIES[name](), 0.1)
    faces = mesh.nodes[mesh.boundary]
    halves = [faces[:, list(half)] for half in ((0, 1, 2), (0, 2, 3), (0, 1, 3), (1, 2, 3))]
    assert sum(np.linalg.det(half).sum() for half in halves) / 12 == pytest.approx(mesh.measures.sum(), rel=1e-12)
    problem = body(mesh)
    pressed = replace(problem, loads=[ts.Pressure(np.arange(mesh.n_nodes), 2.0)])
    (load,) = pressed.loading.following
    force = load.gradient(mesh.nodes)
    assert np.abs(force).max() > 0.1 and np.abs(force.sum(axis=0)).max() < 1e-12
    grown = 1e-3 * np.random.default_rng(1).normal(size=mesh.nodes.shape)
    volumes = [mesh.measures_at(mesh.nodes + side * grown).sum() for side in (-1, 1)]
    assert (force * grown).sum() == pytest.approx(2.0 * (volumes[1] - volumes[0]) / 2, rel=1e-5)


def test_faces_of_bricks_on_two_triangles_do_not_bound_the_body() -> None:
    brick, six = ts.box((1.0, 1.0, 1.0), (1, 1, 1)), ts.box((1.0, 1.0, 1.0), (1, 1, 1), "tetrahedron")
    nodes = np.concatenate([brick.nodes, brick.nodes + np.array([1.0, 0.0, 0.0])])
    _, first, number = np.unique(nodes, axis=0, return_index=True, return_inverse=True)
    cells = {"hexahedron": number.ravel()[brick.elements], "tetrahedron": number.ravel()[six.elements + 8]}
    mesh = ts.Mesh.of_kinds(nodes[first], cells)
    faces = mesh.nodes[mesh.boundary]
    assert corner_measures(faces).sum() == pytest.approx(10.0) and len(faces) == 5 + 10
    with pytest.raises(MeshError, match="faces lie on two triangles"):
        refined(mesh)


@every_body
def test_a_refined_mesh_is_the_same_body(name: str) -> None:
    plain = shaken(BODIES[name](), 0.05)
    skin = find_facets(plain.elements, plain.element, plain.boundary)
    mesh = replace(plain, element_groups={"some": np.arange(0, len(plain.elements), 3)}, facet_groups={"skin": skin})
    finer = refined(mesh)
    assert finer.measures.sum() == pytest.approx(mesh.measures.sum(), rel=1e-13)
    some = mesh.measures[mesh.element_groups["some"]].sum()
    assert finer.measures[finer.element_groups["some"]].sum() == pytest.approx(some, rel=1e-13)
    rows = [finer.boundary, finer.facet_nodes(finer.facet_groups["skin"])]
    mine, theirs = ({tuple(row) for row in np.stack(facet_keys(one.T), axis=1).tolist()} for one in rows)
    assert mine == theirs and len(mine) == (2 if mesh.dim == 2 else 4) * len(mesh.boundary)


def test_kinds_that_do_not_go_together_are_refused() -> None:
    square = ts.rectangle((1.0, 1.0), (1, 1))
    with pytest.raises(MeshError, match="are all plane or all solid"):
        ts.Mesh.of_kinds(np.zeros((8, 3)), {"quadrilateral": square.elements, "tetrahedron": [[0, 1, 2, 4]]})
    with pytest.raises(MeshError, match="'line' elements cannot be mixed with others"):
        ts.Mesh.of_kinds(square.nodes, {"quadrilateral": square.elements, "line": [[0, 1]]})
    with pytest.raises(MeshError, match="1 of 1 elements are degenerate: their coinciding corners match no kind"):
        ts.Mesh(square.nodes[:3], [[0, 1, 0, 2]], "mixed")
    alone = ts.Mesh.of_kinds(square.nodes, {"quadrilateral": square.elements, "triangle": np.zeros((0, 3), int)})
    assert alone.element == "quadrilateral"


# --- models ---------------------------------------------------------------------------------------


@every_body
@pytest.mark.parametrize("element", ["linear", "mean-dilatation"])
def test_a_uniform_strain_is_exact(name: str, element: str) -> None:
    """The patch test, at finite strain: inner nodes are in balance, and each element has the stress of the law."""
    mesh = shaken(BODIES[name](), 0.12)
    potential = ts.Fem("saint-venant-kirchhoff", element).potential(body(mesh))
    gradient = np.array([[1.1, 0.2, -0.1], [0.05, 0.9, 0.15], [0.1, 0.0, 1.2]])[: mesh.dim, : mesh.dim]
    force = potential.gradient(mesh.nodes @ gradient.T)
    inner = np.ones(mesh.n_nodes, dtype=bool)
    inner[mesh.boundary] = False
    assert inner.any() and np.abs(force[inner]).max() < 1e-12 * np.abs(force).max()
    stress = potential.cell_fields(mesh.nodes @ gradient.T)["stress"]
    strain = np.zeros((3, 3))
    strain[: mesh.dim, : mesh.dim] = (gradient.T @ gradient - np.eye(mesh.dim)) / 2
    mu, lam = 7.0 / 2.6, 7.0 * 0.3 / (1.3 * 0.4)
    piola, whole = 2 * mu * strain + lam * np.trace(strain) * np.eye(3), np.eye(3)
    whole[: mesh.dim, : mesh.dim] = gradient
    expected = whole @ piola @ whole.T / np.linalg.det(whole)
    assert stress == pytest.approx(np.tile(expected.ravel(), (len(mesh.elements), 1)), abs=1e-11)


@every_body
def test_biquadratic_springs_are_finite_elements(name: str) -> None:
    problem = body(shaken(BODIES[name](), 0.1))
    springs = ts.Springs("biquadratic").potential(problem)
    elements = ts.Fem("saint-venant-kirchhoff", "linear").potential(problem)
    positions = problem.mesh.nodes + np.random.default_rng(3).uniform(-0.1, 0.1, problem.mesh.nodes.shape)
    assert springs.energy(positions) == pytest.approx(elements.energy(positions), rel=1e-12)
    force = elements.gradient(positions)
    assert springs.gradient(positions) == pytest.approx(force, abs=1e-12 * np.abs(force).max())
    apart = springs.hessian(positions).toarray() - elements.hessian(positions).toarray()
    assert np.abs(apart).max() < 1e-12 * np.abs(elements.hessian(positions).toarray()).max()


@every_body
def test_springs_are_summed_over_the_elements_that_share_them(name: str) -> None:
    """Edges of all kinds once, and both diagonals of each face of four corners once, whatever elements share it."""
    mesh = BODIES[name]()
    springs = ts.Springs(stiffness=ts.UserStiffness(edge=0.3, diagonal=0.2)).potential(body(mesh))
    expected: Counter[tuple[int, int]] = Counter()
    for _, part in mesh.blocks:
        for nodes, volume in zip(part.elements.tolist(), part.measures.tolist(), strict=True):
            unit = 7.0 * (0.5 if mesh.dim == 2 else volume ** (1 / 3))
            rims = [face + face[:1] for face in (tuple(dict.fromkeys(one)) for one in part.kind.facets)]
            rims = rims if mesh.dim == 3 else [(*range(len(nodes)), 0)]
            edges = {frozenset(pair) for rim in rims for pair in itertools.pairwise(rim)}
            across = {frozenset(rim[place:4:2]) for rim in rims if len(rim) == 5 for place in (0, 1)}
            for share, pairs in ((0.3, edges), (0.2, across)):
                for one, other in map(sorted, pairs):
                    expected[tuple(sorted((nodes[one], nodes[other])))] += share * unit  # type: ignore[index]
    if name == "solid of four kinds":  # diagonals through the one brick have none
        expected.update({(0, 13): 0.0, (1, 12): 0.0, (4, 9): 0.0, (5, 8): 0.0})
    found = dict(zip(map(tuple, np.sort(springs.springs, axis=1).tolist()), springs.stiffness.tolist(), strict=True))
    assert {pair for pair, value in found.items() if value} == {pair for pair, value in expected.items() if value}
    assert all(found[pair] == pytest.approx(expected[pair], rel=1e-12) for pair in found if found[pair])


@every_body
def test_moduli_are_those_of_the_body_relaxed(name: str) -> None:
    """Boundary strained uniformly, nodes inside where they balance: the energy by a dense solve of the same springs."""
    mesh = shaken(BODIES[name](), 0.05) if name != "solid of four kinds" else BODIES[name]()
    problem, springs = body(mesh), ts.Springs("projected", allow_negative=True)
    moduli = ts.moduli(problem, springs)
    stiffness = springs.potential(problem).hessian(mesh.nodes).toarray()
    inner = np.ones(mesh.n_nodes, dtype=bool)
    inner[mesh.boundary] = False
    free = np.repeat(inner, mesh.dim)
    strains = np.stack([uniform_strain(mesh.nodes, i, j).ravel() for i, j in voigt_pairs(mesh.dim)], axis=1)
    strains[free] = -np.linalg.solve(stiffness[np.ix_(free, free)], stiffness[np.ix_(free, ~free)] @ strains[~free])
    assert problem.section is not None
    expected = strains.T @ stiffness @ strains / (mesh.measures.sum() * problem.section.thickness)
    assert moduli.elasticity == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())


def test_triangles_beside_quadrilaterals_converge_to_the_same_limit() -> None:
    """A cantilever: the error of its linear deflection falls as that of either kind, with order two."""

    def deflection(mesh: ts.Mesh, element: str | None = None) -> float:
        problem = ts.Problem(
            mesh,
            ts.Material(young=7.0, poisson=0.0),
            ts.PlaneStress(0.5),
            [ts.Fixed("left", fix=["x"]), ts.Fixed(ts.Near((0.0, 0.0)), fix=["y"])],
            [ts.Traction("right", (0.0, 1e-4))],
        )
        path = ts.solve(problem, ts.Fem("linear", element), ts.Newton(load_steps=1))
        return float(path.states[-1].displacement[ts.named_point(mesh, "right-bottom"), 1])

    limit = deflection(ts.rectangle((6.0, 1.0), (24, 8), "triangle"), "quadratic")
    errors = [deflection(plane_of_two((6.0, 1.0), (12 * n, 2 * n))) / limit - 1 for n in (1, 2, 4)]
    assert errors[0] < -0.05 and np.log2(errors[0] / errors[1]) > 1.5
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.3)


def test_regions_and_single_springs_go_over_kinds() -> None:
    mesh = plane_of_two((3.0, 2.0), (3, 2))
    soft = replace(body(mesh), regions=[ts.Region([1, 5], ts.Material(2.0, 0.1))])
    per_element = ts.Springs("least-squares").element_stiffness(soft)
    alone = [ts.Springs("least-squares").element_stiffness(one) for one in soft.homogeneous]
    which = soft.material_numbers
    assert sorted(which.tolist()) == [0] * 6 + [1] * 2
    assert per_element == pytest.approx(np.where(which[:, None] == 0, *alone), rel=1e-12)
    both = [ts.Springs("projected", sharing=one).potential(body(mesh)) for one in ("summed", "single")]
    pairs = [pair for _, part in mesh.blocks for e in part.elements for pair in e[np.array(part.kind.links)].tolist()]
    shared = Counter(tuple(sorted(pair)) for pair in pairs)
    count = np.array([shared[tuple(sorted(pair))] for pair in both[0].springs.tolist()])
    assert both[1].stiffness * count == pytest.approx(both[0].stiffness, rel=1e-12) and count.max() == 2


def test_what_is_for_one_kind_says_so() -> None:
    wedges, plane = body(BODIES["wedges"]()), body(PLANE())
    with pytest.raises(ModelError, match=r"rule = 'lloyd' .* wedge elements.* least-squares"):
        ts.Springs("lloyd").potential(wedges)
    with pytest.raises(ModelError, match=r"16 triangle and 16 quadrilateral elements.* lloyd, least"):
        ts.Springs("van-gelder").potential(plane)
    with pytest.raises(ModelError, match=r"element = 'quadratic' .*16 triangle.*: linear, mean"):
        ts.Fem("linear", "quadratic").potential(plane)
    with pytest.raises(ModelError, match=r"wedge .*springs.* fem"):
        ts.BemSprings([0, 1], "projected").potential(wedges)
    with pytest.raises(ts.TruespringError, match="mixed elements"):
        ts.Terzopoulos().potential(plane)
    with pytest.raises(MeshError, match="needs elements of one kind, the mesh has 16 triangle and 16 quadrilateral"):
        _ = plane.mesh.kind
    assert any("16 triangles" in text for text in ts.Fem("linear").warnings(plane))
    assert ts.Fem("linear").chosen_element(body(PLANE(), 0.45)) == "mean-dilatation"


# --- files ----------------------------------------------------------------------------------------

QUAD_AND_TRIANGLE = """*NODE
1,0,0
2,1,0
3,1,1
4,0,1
5,2,0
*ELEMENT, TYPE=CPS4, ELSET=square
1,1,2,3,4
*ELEMENT, TYPE=CPS3, ELSET=corner
2,2,5,3
"""


def test_quadrilaterals_and_triangles_of_a_deck(tmp_path: Path) -> None:
    (tmp_path / "two.inp").write_text(QUAD_AND_TRIANGLE)
    mesh = ts.read_mesh(tmp_path / "two.inp")
    assert mesh.element_kinds == ("triangle", "quadrilateral") and mesh.notes == ()
    assert mesh.measures.tolist() == [1.0, 0.5], "in the file's order"
    assert {name: group.tolist() for name, group in mesh.element_groups.items()} == {"square": [0], "corner": [1]}
    assert str(mesh) == "Mesh(5 nodes, 2 elements: 1 triangle and 1 quadrilateral)"


def test_bricks_with_a_wedge_behind_them(tmp_path: Path) -> None:
    bricks = ts.box((4.0, 1.0, 1.0), (4, 1, 1))
    tip = np.concatenate([bricks.nodes, [[5.0, 0.0, 0.0], [5.0, 0.0, 1.0]]])
    wedge = [4, 20, 9, 14, 21, 19]
    rows = [f"{n}, {', '.join(map(str, place))}" for n, place in enumerate(tip.tolist(), 1)]
    cells = [f"{n}, {', '.join(map(str, nodes))}" for n, nodes in enumerate((bricks.elements + 1).tolist(), 1)]
    last = f"5, {', '.join(str(node + 1) for node in wedge)}"
    deck = ["*NODE", *rows, "*ELEMENT, TYPE=C3D8", *cells, "*ELEMENT, TYPE=C3D6", last, ""]
    (tmp_path / "wedge.inp").write_text("\n".join(deck))
    mesh = ts.read_mesh(tmp_path / "wedge.inp")
    assert mesh.element_kinds == ("wedge", "hexahedron") and mesh.measures.tolist() == [1.0] * 4 + [0.5]
    assert len(mesh.boundary) == 4 * 4 + 1 + 4 and mesh.notes == ()


@every_body
def test_vtk_cells_of_several_kinds_come_back(name: str, tmp_path: Path) -> None:
    """VTK's wedge goes round the other way, as meshio writes it: read, it is no inverted element."""
    mesh = shaken(BODIES[name](), 0.1)
    points = np.pad(mesh.nodes, ((0, 0), (0, 3 - mesh.dim)))
    for suffix in ("vtu", "vtk"):
        file = tmp_path / f"body.{suffix}"
        meshio.Mesh(points, list(mesh.cells.items())).write(file)
        found = ts.read_mesh(file)
        assert found.element == mesh.element and found.notes == ()
        assert np.sort(found.measures) == pytest.approx(np.sort(mesh.measures), rel=1e-12)
        assert len(found.boundary) == len(mesh.boundary)


def test_wedges_of_the_other_orientation_are_turned(tmp_path: Path) -> None:
    mesh = ts.box((1.0, 1.0, 1.0), (1, 1, 1), "wedge")
    cells = mesh.elements.copy()
    cells[1] = cells[1, [0, 2, 1, 3, 5, 4]]
    meshio.Mesh(mesh.nodes, [("wedge", cells)]).write(tmp_path / "turned.vtu")
    found = ts.read_mesh(tmp_path / "turned.vtu")
    assert found.measures.tolist() == [0.5, 0.5]
    assert found.notes == ("1 of 2 elements are inverted in the file and were mirrored",)


def test_bricks_with_corners_that_are_one_are_what_they_are(tmp_path: Path) -> None:
    """However a program turns them: all kinds at once, as decks for CalculiX hold them."""
    from truespring.exports.calculix import fem_deck
    from truespring.mesh.merged import _turns

    mesh = shaken(solid_of_four(), 0.1)
    lines, turns = fem_deck(body(mesh), [1.0], "linear").split("\n"), _turns(8)
    assert len(turns) == 24 and len(_turns(4)) == 4
    inside, random = False, np.random.default_rng(2)
    for number, line in enumerate(lines):
        if line.startswith("*"):
            inside = line.startswith("*ELEMENT, TYPE=C3D8")
        elif inside:
            name, *nodes = line.split(", ")
            lines[number] = ", ".join([name, *(nodes[place] for place in turns[random.integers(24)])])
    (tmp_path / "bricks.inp").write_text("\n".join(lines))
    found = ts.read_mesh(tmp_path / "bricks.inp")
    assert Counter({part.element: len(of) for of, part in found.blocks}) == {
        **{"tetrahedron": 2, "pyramid": 5, "wedge": 2, "hexahedron": 1}
    }
    assert np.sort(found.measures) == pytest.approx(np.sort(mesh.measures), rel=1e-9)
    assert found.notes == ("7 hexahedron cells with coincident corners became wedges, pyramids or simplices",)


# --- all the way ----------------------------------------------------------------------------------

STUDY = """
[mesh]
file = "body.vtu"
[material]
young = "10 kPa"
poisson = 0.3
{section}
[[support]]
on = "left"
[[load]]
on = "right"
traction = {traction}
[solver]
load_steps = 1
[models.springs]
kind = "springs"
rule = "biquadratic"
[models.fem]
kind = "fem"
law = "saint-venant-kirchhoff"
element = "linear"
[compare]
model = "springs"
references = ["fem"]
"""


@pytest.mark.parametrize(
    "name", ["plane of two kinds", pytest.param("solid of four kinds", marks=pytest.mark.verification)]
)
def test_a_study_from_file_to_report(name: str, tmp_path: Path) -> None:
    mesh = BODIES[name]()
    meshio.Mesh(np.pad(mesh.nodes, ((0, 0), (0, 3 - mesh.dim))), list(mesh.cells.items())).write(tmp_path / "body.vtu")
    plane = mesh.dim == 2
    section = '[section]\nkind = "plane-stress"\nthickness = "10 mm"' if plane else ""
    traction = '["100 Pa", "30 Pa"]' if plane else '["100 Pa", "30 Pa", "0 Pa"]'
    (tmp_path / "body.toml").write_text(STUDY.format(section=section, traction=traction))
    assert main(["verify", str(tmp_path / "body.toml"), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    told = json.loads((tmp_path / "out/body/summary.json").read_text())
    assert {one["status"] for one in told["models"].values()} == {"converged"}
    assert told["comparison"]["fem"]["rms_error"] < 1e-9 and told["models"]["fem"]["element"] == "linear"
    assert f"{len(mesh.elements)} elements ({mesh.kinds})" in (tmp_path / "out/body/report.html").read_text()
    last = meshio.read(tmp_path / "out/body/fem/fem_0001.vtu")
    assert {block.type: len(block.data) for block in last.cells} == {kind: len(c) for kind, c in mesh.cells.items()}
    skin = meshio.read(tmp_path / "out/body/deformed_fem.stl")
    area = sum(corner_measures(skin.points[block.data]).sum() for block in skin.cells)
    positions = mesh.nodes + last.point_data["displacement"][:, : mesh.dim]
    expected = mesh.measures_at(positions).sum() if plane else None
    assert area > 0 and (expected is None or area == pytest.approx(expected, rel=1e-5))
