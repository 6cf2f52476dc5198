"""Meshes and solutions as grids of PyVista and meshio, and back."""

from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest

import truespring as ts
from tests.meshes import plane_of_two, solid_of_four
from truespring.arrays import Floats, Ints
from truespring.errors import MeshError, OutputError

pv = pytest.importorskip("pyvista")

DATA = Path(__file__).parent / "data"


@pytest.fixture(scope="module")
def bent() -> ts.Solution:
    """A strip of Gaussian springs under its own bending load."""
    problem = ts.Problem(
        ts.rectangle((0.04, 0.01), (8, 2)),
        ts.Material(10e3, 0.3),
        ts.PlaneStress(0.01),
        [ts.Fixed("left")],
        [ts.Force("right", (0.0, -0.01))],
    )
    return ts.solve(problem, ts.Springs("gaussian"), ts.Newton(2))


def grouped(mesh: ts.Mesh) -> ts.Mesh:
    """The mesh with groups of all kinds and a direction in each element."""
    facets = np.array([[0, 0], [0, 1], [len(mesh.elements) - 1, 2]])
    return replace(
        mesh,
        node_groups={"two nodes": np.array([0, 3])},
        element_groups={"first": np.array([0]), "ends": np.array([0, len(mesh.elements) - 1])},
        facet_groups={"wall": facets},
        element_vectors={"along": np.tile(np.eye(3)[0], (len(mesh.elements), 1))},
    )


def places(mesh: ts.Mesh, groups: dict[str, Ints]) -> dict[str, set[tuple[float, ...]]]:
    """The centres of the elements, or facets, of each group."""
    found = {}
    for name, members in groups.items():
        nodes = mesh.facet_nodes(members) if members.ndim == 2 else None
        centres = mesh.centres[members] if nodes is None else corner_means(mesh.nodes, nodes)
        found[name] = {tuple(np.round(centre, 9)) for centre in centres}
    return found


def corner_means(points: Floats, facets: Ints) -> Floats:
    return np.array([points[np.unique(facet)].mean(axis=0) for facet in facets])


@pytest.mark.parametrize(
    "mesh",
    [
        ts.rectangle((2.0, 1.0), (2, 1), "triangle"),
        ts.box((2.0, 1.0, 1.0), (2, 1, 1)),
        ts.box((1.0, 1.0, 1.0), (1, 1, 1), "tetrahedron"),
        plane_of_two((3.0, 1.0), (3, 1)),
        solid_of_four(),
    ],
    ids=lambda mesh: mesh.kinds,
)
def test_a_mesh_as_a_grid_keeps_its_groups(mesh: ts.Mesh) -> None:
    mesh = grouped(mesh)
    grid = mesh.to_pyvista()
    volume = grid.compute_cell_sizes().cell_data["Volume" if mesh.dim == 3 else "Area"]
    assert np.abs(volume).sum() == pytest.approx(mesh.measures.sum())  # VTK has a sign for some kinds
    again = ts.Mesh.from_pyvista(grid)
    assert again.nodes == pytest.approx(mesh.nodes) and sorted(again.element_kinds) == sorted(mesh.element_kinds)
    assert again.node_groups["two nodes"].tolist() == [0, 3]
    assert places(again, dict(again.element_groups)) == places(mesh, dict(mesh.element_groups))
    assert places(again, dict(again.facet_groups)) == places(mesh, dict(mesh.facet_groups))
    assert (again.element_vectors["along"] == np.eye(3)[0]).all()
    assert not [note for note in again.notes if "inverted" in note]


def test_a_part_of_a_grid_keeps_its_facets() -> None:
    mesh = ts.box((3.0, 1.0, 1.0), (3, 1, 1))
    mesh = replace(mesh, facet_groups={"end": np.array([[2, facet] for facet in range(6)])})
    part = ts.Mesh.from_pyvista(mesh.to_pyvista().extract_cells([1, 2]))
    assert len(part.elements) == 2
    assert places(part, dict(part.facet_groups)) == places(mesh, dict(mesh.facet_groups))


def test_a_mesh_of_second_order_keeps_its_middle_nodes() -> None:
    mesh = ts.read_mesh(DATA / "block_second_order_41.msh")
    if mesh.middles is None:  # the sample has straight edges
        middles = mesh.nodes[mesh.edges].mean(axis=1)
        middles[0] *= 1.0 + 1e-3
        mesh = replace(mesh, middles=middles)
    grid = mesh.to_pyvista()
    assert set(grid.celltypes) <= {22, 24} and grid.n_points == mesh.n_nodes + len(mesh.edges)
    again = ts.Mesh.from_pyvista(grid)
    assert again.n_nodes == mesh.n_nodes and again.middles == pytest.approx(mesh.middles)


def test_grids_of_pyvista_follow_the_rules_of_files(tmp_path: Path) -> None:
    sphere = pv.Sphere(radius=20.0, theta_resolution=8, phi_resolution=8).delaunay_3d()
    sphere.cell_data["tissue"] = np.arange(sphere.n_cells) % 2
    sphere.save(tmp_path / "sphere.vtu")
    file, grid = ts.read_mesh(tmp_path / "sphere.vtu", unit="mm"), ts.Mesh.from_pyvista(sphere, unit="mm")
    assert (grid.nodes == file.nodes).all() and (grid.elements == file.elements).all() and grid.notes == file.notes
    assert set(grid.element_groups) == {"tissue-0", "tissue-1"}
    image = pv.ImageData(dimensions=(3, 2, 2))
    assert ts.Mesh.from_pyvista(image).element == "hexahedron"
    flat = pv.Plane(i_resolution=2, j_resolution=1)
    assert ts.Mesh.from_pyvista(flat).dim == 2
    with pytest.raises(MeshError, match="there are only 1 line"):
        ts.Mesh.from_pyvista(pv.Line())
    with pytest.raises(MeshError, match="a data set of PyVista is expected"):
        ts.Mesh.from_pyvista("sphere.vtu")


@pytest.mark.parametrize("name", ["plate_quads_41.msh", "block_41.msh", "block_22.msh", "plate_triangles_22.msh"])
def test_a_mesh_of_meshio_is_that_of_the_file(name: str) -> None:
    file, other = ts.read_mesh(DATA / name), ts.Mesh.from_meshio(meshio.read(DATA / name))
    assert other.nodes == pytest.approx(file.nodes) and (other.elements == file.elements).all()
    lost = {"13"} if name == "block_41.msh" else set()  # meshio drops the second group of an entity if it has no name
    assert other.element_groups.keys() == file.element_groups.keys() - lost
    assert other.node_groups.keys() == file.node_groups.keys() - lost
    for found, read in ((other.node_groups, file.node_groups), (other.element_groups, file.element_groups)):
        for group, members in found.items():
            assert (read[group] == members).all(), group
    for group, facets in file.facet_groups.items():
        assert (other.facet_groups[group] == facets).all()


def test_sets_and_arrays_of_meshio_are_groups() -> None:
    box = ts.box((0.02, 0.01, 0.01), (2, 1, 1), "tetrahedron")
    turned = box.elements[:, [0, 2, 1, 3]]  # inverted, as some programs write them
    mesh = meshio.Mesh(
        1e3 * box.nodes,
        [("triangle", box.boundary[:2]), ("tetra", turned)],
        point_data={"mark": np.arange(box.n_nodes) % 2},
        cell_data={"part": [np.zeros(2, dtype=int), np.arange(len(turned)) // 6]},
        point_sets={"corner": np.array([0])},
        cell_sets={
            "skin": [np.array([1]), np.array([], dtype=int)],
            "ends": [np.array([], dtype=int), np.array([0, 3])],
        },
    )
    ours = ts.Mesh.from_meshio(mesh, unit="mm")
    assert ours.measures == pytest.approx(box.measures) and "inverted" in " ".join(ours.notes)
    assert ours.node_groups["corner"].tolist() == [0]
    assert ours.node_groups["mark"].tolist() == list(range(1, box.n_nodes, 2))
    assert ours.element_groups["ends"].tolist() == [0, 3] and ours.element_groups["part-1"].tolist() == [*range(6, 12)]
    assert set(ours.facet_nodes(ours.facet_groups["skin"]).ravel()) == set(box.boundary[1])
    with pytest.raises(MeshError, match="cells of type 'VTK_LAGRANGE_TETRAHEDRON' of meshio are not"):
        ts.Mesh.from_meshio(meshio.Mesh(box.nodes, [("VTK_LAGRANGE_TETRAHEDRON", turned)]))
    with pytest.raises(MeshError, match="a mesh of meshio is expected"):
        ts.Mesh.from_meshio(DATA / "beam.inp")


def test_a_solution_as_a_grid_has_the_fields_of_its_files(bent: ts.Solution, tmp_path: Path) -> None:
    warped, still = bent.to_pyvista(), bent.to_pyvista(level=1, warped=False)
    assert warped.points[:, :2] == pytest.approx(bent.states[-1].positions, abs=1e-8)
    assert still.points[:, :2] == pytest.approx(bent.problem.mesh.nodes, abs=1e-8)
    bent.write(tmp_path / "x.vtu", level=1)
    file = pv.read(tmp_path / "x.vtu")
    assert set(still.array_names) == set(file.array_names)
    for name in file.array_names:
        assert still[name] == pytest.approx(np.asarray(file[name]), nan_ok=True), name
    assert warped.warp_by_vector("displacement", factor=-1).points[:, :2] == pytest.approx(
        bent.problem.mesh.nodes, abs=1e-8
    )
    markers = ts.read_result(bent.write(tmp_path / "x.csv")).to_pyvista()
    assert set(markers.celltypes) == {1} and markers.n_cells == bent.problem.mesh.n_nodes
    with pytest.raises(OutputError, match=r"level = 7: springs \(gaussian\) has 3 states, 0 to 2, or -1"):
        bent.to_pyvista(level=7)
    with pytest.raises(OutputError, match=r"level = 0\.5: the number of a state is expected, 0 to 2"):
        bent.to_pyvista(level=0.5)  # type: ignore[arg-type]
