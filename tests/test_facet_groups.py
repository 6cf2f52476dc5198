"""Groups of facets: a load acts on the facets that a file names, and on nothing else."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.arrays import Floats, Ints
from truespring.errors import MeshError, TruespringError
from truespring.mesh import ELEMENT_KINDS, read_mesh, refined
from truespring.mesh.facets import mirrored_facets
from truespring.mesh.files.contents import Cells, Contents
from truespring.mesh.kinds import MIRRORED

MESHES = {
    "triangles": ts.rectangle((3.0, 2.0), (3, 1), "triangle"),
    "quadrilaterals": ts.rectangle((3.0, 2.0), (3, 1)),
    "tetrahedra": ts.box((3.0, 1.0, 2.0), (3, 1, 2), "tetrahedron"),
    "hexahedra": ts.box((3.0, 1.0, 2.0), (3, 1, 2)),
}
CELLS = {1: "vertex", 2: "line", 3: "triangle", 4: "quadrilateral"}
every_mesh = pytest.mark.parametrize("name", MESHES)


def normals(corners: Floats) -> Floats:
    """Length or area times the normal of plane facets, to the right of edges; shape (n, dim)."""
    if corners.shape[1] == 2:
        along = corners[:, 1] - corners[:, 0]
        return np.stack([along[:, 1], -along[:, 0]], axis=1)
    one, other = (corners[:, 2] - corners[:, 0], corners[:, -1] - corners[:, 1 if corners.shape[1] == 4 else 0])
    return np.cross(one, other) / 2 if corners.shape[1] == 4 else np.cross(corners[:, 1] - corners[:, 0], one) / 2


def at_ends(mesh: ts.Mesh, axis: int = 1) -> Ints:
    """The facets of the boundary at both ends of an axis: of bodies one element thick their nodes are all nodes."""
    places = mesh.nodes[mesh.boundary][:, :, axis]
    return np.asarray(mesh.boundary[(places == places[:, :1]).all(axis=1)])


def contents(mesh: ts.Mesh, facets: Ints, **data: object) -> Contents:
    """A file of the mesh, cells numbered from 100, and of cells "caps" that are these facets, each turned around."""
    points = np.pad(mesh.nodes, ((0, 0), (0, 3 - mesh.dim)))
    numbers = np.arange(len(facets)) + 1000
    cells = [
        Cells(CELLS[facets.shape[1]], np.roll(facets[:, ::-1], 1, axis=1), numbers),
        Cells(mesh.element, mesh.elements, np.arange(len(mesh.elements)) + 100),
    ]
    given = {"cell_groups": {"caps": numbers}, **data}
    return Contents(np.arange(len(points)), points, cells, **given)  # type: ignore[arg-type]


def total(mesh: ts.Mesh, *loads: object) -> Floats:
    """The force of dead loads on a body of which one element is held."""
    section = ts.PlaneStress(thickness=1.0) if mesh.dim == 2 else None
    held = [ts.Fixed(on=mesh.elements[-1].tolist())]
    problem = ts.Problem(mesh, ts.Material(1e3, 0.3), section, held, loads)  # type: ignore[arg-type]
    return np.asarray(problem.loading.force(mesh.nodes).sum(axis=0))


@every_mesh
def test_a_traction_acts_on_the_facets_named_and_on_nothing_else(name: str) -> None:
    """The two ends of a body one element thick have all its nodes, as its sides do; they have an area of 3 x 2 each."""
    body = MESHES[name]
    mesh = contents(body, at_ends(body)).mesh(1.0)
    area = 2 * np.linalg.norm(normals(body.nodes[at_ends(body)]), axis=1).sum() / 2
    assert area == pytest.approx(2 * 3.0 * (2.0 if mesh.dim == 3 else 1.0)) and not mesh.notes
    pull = np.arange(1.0, mesh.dim + 1)
    assert total(mesh, ts.Traction("caps", pull)) == pytest.approx(area * pull)
    by_nodes = replace(mesh, facet_groups={})
    assert np.linalg.norm(total(by_nodes, ts.Traction("caps", pull))) > 1.2 * area * np.linalg.norm(pull)


@every_mesh
def test_a_pressure_acts_from_outside_on_the_facets_named(name: str) -> None:
    """However the file turns them: on one end with the normal -y it pushes along y."""
    body = MESHES[name]
    facets = at_ends(body)
    bottom = facets[(body.nodes[facets][:, :, 1] == 0).all(axis=1)]
    mesh = contents(body, bottom).mesh(1.0)
    size = 3.0 * (2.0 if mesh.dim == 3 else 1.0)
    section = ts.PlaneStress(thickness=1.0) if mesh.dim == 2 else None
    held = [ts.Fixed(on="left"), ts.Fixed(on="right"), ts.Fixed(on=ts.Plane("y", 0.0), fix=["x"])]
    if mesh.dim == 3:
        held += [ts.Fixed(on=side) for side in ("back", "front")]
    problem = ts.Problem(mesh, ts.Material(1e3, 0.3), section, held, [ts.Pressure("caps", 7.0)])
    force = problem.loading.force(mesh.nodes).sum(axis=0)
    assert force == pytest.approx(np.eye(mesh.dim)[1] * 7.0 * size)


@every_mesh
def test_a_force_and_a_support_take_the_facets_nodes(name: str) -> None:
    body = MESHES[name]
    facets = at_ends(body, axis=0)
    right = facets[(body.nodes[facets][:, :, 0] == 3).all(axis=1)]
    mesh = contents(body, right).mesh(1.0)
    assert mesh.node_groups["caps"].tolist() == np.unique(right).tolist()
    pull = np.arange(1.0, mesh.dim + 1)
    loads = [ts.Force(on, pull) for on in ("caps", "right")]
    section = ts.PlaneStress(thickness=1.0) if mesh.dim == 2 else None
    named, side = (
        ts.Problem(mesh, ts.Material(1e3, 0.3), section, [ts.Fixed(on="left")], [load]).loading.external_force
        for load in loads
    )
    assert named == pytest.approx(side) and named.sum(axis=0) == pytest.approx(pull)


@pytest.mark.parametrize("name", ["triangles", "quadrilaterals"])
def test_a_moment_turns_the_facets_named(name: str) -> None:
    """Of a group with further nodes, the facets alone: the moment has its arms about their middle."""
    body = MESHES[name]
    facets = at_ends(body, axis=0)
    right = facets[(body.nodes[facets][:, :, 0] == 3).all(axis=1)]
    mesh = contents(body, right, node_groups={"caps": np.arange(3)}).mesh(1.0)
    named, side = (
        ts.Problem(
            mesh, ts.Material(1e3, 0.3), ts.PlaneStress(thickness=1.0), [ts.Fixed(on="left")], [ts.Moment(on, 5.0)]
        ).loading.force(mesh.nodes)
        for on in ("caps", "right")
    )
    assert named == pytest.approx(side)
    x, y = (mesh.nodes - mesh.nodes[np.unique(right)].mean(axis=0)).T
    assert (x * named[:, 1] - y * named[:, 0]).sum() == pytest.approx(5.0)


@every_mesh
def test_a_group_of_elements_and_facets_is_told(name: str) -> None:
    body = MESHES[name]
    facets = at_ends(body)
    both = np.concatenate([np.arange(len(facets)) + 1000, [100]])
    mesh = contents(body, facets, cell_groups={"caps": both}).mesh(1.0)
    assert mesh.notes == (
        "group 'caps' has elements and facets: loads act on its facets, supports hold the nodes of both",
    )
    assert mesh.element_groups["caps"].tolist() == [0] and len(mesh.facet_groups["caps"]) == len(facets)


@pytest.mark.parametrize("name", ["triangles", "tetrahedra"])
def test_elements_of_second_order_are_loaded_likewise(name: str) -> None:
    body = MESHES[name]
    mesh = contents(body, at_ends(body)).mesh(1.0)
    section = ts.PlaneStress(thickness=1.0) if mesh.dim == 2 else None
    pull = np.eye(mesh.dim)[1] * 5.0
    area = 6.0 if mesh.dim == 2 else 12.0
    held = [ts.Fixed(on=mesh.elements[-1].tolist())]
    problem = ts.Problem(mesh, ts.Material(1e3, 0.3), section, held, [ts.Traction("caps", pull)])
    loading = ts.Fem(law="linear", element="quadratic").potential(problem).loading
    assert loading.external_force.sum(axis=0) == pytest.approx(area * pull)


@every_mesh
def test_facets_inside_the_body_carry_a_traction_and_no_pressure(name: str) -> None:
    body = MESHES[name]
    inner = body.facets[(body.nodes[body.facets][:, :, 0] == 1).all(axis=1)]
    mesh = contents(body, inner).mesh(1.0)
    assert len(mesh.facet_groups["caps"]) == len(inner)
    pull = np.eye(mesh.dim)[0] * 2.0
    assert total(mesh, ts.Traction("caps", pull)) == pytest.approx(pull * (1.0 * 2.0))
    with pytest.raises(TruespringError, match=rf"{len(inner)} of {len(inner)} facets of 'caps' lie inside.*a traction"):
        total(mesh, ts.Pressure("caps", 1.0))


@every_mesh
def test_both_ways_to_name_facets_say_the_same_of_turned_elements(name: str) -> None:
    """A cell with the corners, and the element with the number of its facet, where every second element is inverted."""
    body = MESHES[name]
    facets = at_ends(body)
    plain = contents(body, facets).mesh(1.0)
    elements, pairs = body.elements.copy(), plain.facet_groups["caps"].copy()
    elements[::2] = elements[::2][:, MIRRORED[body.element]]
    turned = pairs[:, 0] % 2 == 0
    pairs[turned, 1] = mirrored_facets(body.element)[pairs[turned, 1]]
    given = contents(replace(plain, facet_groups={}), facets)
    blocks = [given.cells[0], replace(given.cells[1], nodes=elements)]
    named = {"direct": np.stack([pairs[:, 0] + 100, pairs[:, 1]], axis=1)}
    mesh = replace(given, cells=blocks, facet_groups=named).mesh(1.0)
    assert mesh.notes == (
        f"{len(elements[::2])} of {len(elements)} elements are inverted in the file and were mirrored",
    )
    assert mesh.facet_groups["direct"].tolist() == mesh.facet_groups["caps"].tolist()
    corners = mesh.nodes[mesh.facet_nodes(mesh.facet_groups["direct"])]
    outside = np.where(corners[:, :1, 1] > 0, 1.0, -1.0)[:, 0]
    assert (normals(corners)[:, 1] * outside > 0).all()


@every_mesh
def test_a_mesh_that_is_folded_is_refused(name: str) -> None:
    """An element pulled through a neighbour is inverted as well, and turning it would lay one over the other."""
    body = ts.box((3.0, 3.0, 3.0), (3, 3, 3), MESHES[name].element) if MESHES[name].dim == 3 else None
    body = body or ts.rectangle((3.0, 3.0), (3, 3), MESHES[name].element)
    nodes = body.nodes.copy()
    inner = int(np.linalg.norm(nodes - 1.0, axis=1).argmin())
    nodes[inner] += 4.0  # out of the elements around it, whose other corners stay
    file = contents(body, at_ends(body))
    with pytest.raises(MeshError, match=r"elements are inverted.*: correct the mesh|folded there; correct the mesh"):
        replace(file, points=np.pad(nodes, ((0, 0), (0, 3 - body.dim)))).mesh(1.0)


@pytest.mark.parametrize("kind", MIRRORED)
def test_a_mirrored_element_has_its_facets_elsewhere(kind: str) -> None:
    """Facet f of an element has the nodes of facet mirrored_facets[f] of its mirror image."""
    facets, nodes = ELEMENT_KINDS[kind].facets, np.array(MIRRORED[kind])
    for before, after in zip(facets, mirrored_facets(kind), strict=True):
        assert set(nodes[list(facets[after])]) == set(before)


@every_mesh
def test_cells_that_bound_no_element_are_counted(name: str) -> None:
    body = MESHES[name]
    facets = at_ends(body)
    askew = facets.copy()
    askew[0] = np.sort(body.elements[0])[: facets.shape[1]] if facets.shape[1] > 2 else [0, body.n_nodes - 1]
    if askew.shape[1] > 2:
        askew[0] = [0, *range(body.n_nodes - facets.shape[1] + 1, body.n_nodes)]
    mesh = contents(body, askew).mesh(1.0)
    counts = f"1 of {len(facets)} facets of group 'caps' bound no element"
    assert mesh.notes == (f"{counts} of the body: no load acts on them",)
    assert len(mesh.facet_groups["caps"]) == len(facets) - 1
    none = contents(body, askew[:1]).mesh(1.0)
    assert "caps" in none.node_groups and not none.facet_groups and "only their nodes" in none.notes[0]


@every_mesh
def test_a_refined_group_has_the_parts_of_its_facets(name: str) -> None:
    body = MESHES[name]
    mesh = contents(body, at_ends(body)).mesh(1.0)
    fine = refined(refined(mesh))
    facets = fine.facet_groups["caps"]
    assert len(facets) == 4 ** (mesh.dim - 1) * len(mesh.facet_groups["caps"])
    coarse_corners, corners = (one.nodes[one.facet_nodes(one.facet_groups["caps"])] for one in (mesh, fine))
    assert np.isin(corners[:, :, 1], (0.0, mesh.upper[1])).all()
    assert np.abs(normals(corners)).sum(axis=0) == pytest.approx(np.abs(normals(coarse_corners)).sum(axis=0))
    assert fine.node_groups["caps"].tolist() == np.unique(fine.facet_nodes(facets)).tolist()
    pull = np.arange(1.0, mesh.dim + 1)
    assert total(fine, ts.Traction("caps", pull)) == pytest.approx(total(mesh, ts.Traction("caps", pull)))


def test_groups_that_do_not_exist_are_refused() -> None:
    mesh = MESHES["quadrilaterals"]
    for bad in ([[0, 4]], [[3, 0]], [[-1, 0]], np.zeros((0, 2), dtype=int), [0, 1], [[0.5, 1]]):
        with pytest.raises(MeshError, match="facet group 'a'"):
            replace(mesh, facet_groups={"a": bad})
    named = replace(mesh, facet_groups={"a": [[2, 0], [0, 0], [2, 0]]})
    assert named.facet_groups["a"].tolist() == [[0, 0], [2, 0]] and named.node_groups["a"].tolist() == [0, 1, 2, 3]


def test_the_plate_of_gmsh(tmp_path: Path) -> None:
    """A plate one element thick in version 2.2, whose physical surface is its top and bottom."""
    body = ts.box((0.04, 0.001, 0.04), (4, 1, 4), "tetrahedron")
    facets = at_ends(body)
    nodes = [f"{row} " + " ".join(map(repr, at)) for row, at in enumerate(body.nodes.tolist(), 1)]
    cells = [f"{row} 2 2 7 1 " + " ".join(map(str, at)) for row, at in enumerate((facets + 1).tolist(), 1)]
    cells += [f"{row} 4 2 8 1 " + " ".join(map(str, at)) for row, at in enumerate((body.elements + 1).tolist(), 1000)]
    text = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", "2", '2 7 "caps"', '3 8 "tissue"']
    text += ["$EndPhysicalNames", "$Nodes", str(len(nodes)), *nodes, "$EndNodes"]
    text += ["$Elements", str(len(cells)), *cells, "$EndElements", ""]
    (tmp_path / "plate.msh").write_text("\n".join(text))
    mesh = read_mesh(tmp_path / "plate.msh")
    assert total(mesh, ts.Traction("caps", (0.0, 10.0, 0.0))) == pytest.approx([0, 0.032, 0], abs=1e-12)
