"""Mesh files: what other programs wrote is read as they meant it, what is damaged is refused in words.

tests/data holds what gmsh 4.15.2 made of plate.geo and block.geo, what VTK 9.7.2 made of gmsh's block.vtk (block.vtu
and block_51_binary.vtk, with an array region, 1 and 2 in the halves, and an array clamped) and of two quadrilaterals
with arrays of every sort, and a deck for CalculiX.
"""

import base64
import contextlib
import io
import re
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import meshio
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import truespring as ts
from tests.calculix import needs_ccx
from truespring.arrays import Floats, Ints
from truespring.errors import MeshError
from truespring.mesh.files import read_mesh
from truespring.mesh.kinds import ELEMENT_KINDS

DATA = Path(__file__).parent / "data"
TISSUE = Path(__file__).parent.parent / "examples" / "tissue.msh"
WRITTEN = sorted(file for file in DATA.iterdir() if file.suffix != ".geo")


def same(one: ts.Mesh, other: ts.Mesh) -> bool:
    """Tell whether two meshes agree to the last bit, groups included."""
    return (
        one.element == other.element
        and np.array_equal(one.nodes, other.nodes)
        and np.array_equal(one.elements, other.elements)
        and same_groups(one, other)
    )


def same_groups(one: ts.Mesh, other: ts.Mesh) -> bool:
    pairs = ((one.node_groups, other.node_groups), (one.element_groups, other.element_groups))
    return all(a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a) for a, b in pairs)


def sizes(mesh: ts.Mesh) -> dict[str, tuple[int, int]]:
    """The numbers of nodes and elements in each group."""
    return {
        name: (len(nodes), len(mesh.element_groups.get(name, ()))) for name, nodes in sorted(mesh.node_groups.items())
    }


# --- what other programs wrote --------------------------------------------------------------------

# As gmsh counts them: getNodesForPhysicalGroup, getElements and, for the area or volume, getElementQualities.
TRIANGLES = {"clamped": (6, 0), "pulled": (6, 0), "tissue": (78, 118)}
PLATE = {"clamped": (7, 0), "pulled": (7, 0), "tissue": (92, 72)}
BLOCK = {"13": (60, 130), "clamped": (36, 0), "pulled": (13, 0), "soft": (60, 130), "tissue": (107, 260)}
GMSH = {
    "plate_triangles_22.msh": (78, TRIANGLES),
    "plate_parametric_41.msh": (78, TRIANGLES),
    "plate_quads_41.msh": (92, PLATE),
    "plate_quads_41_binary.msh": (92, PLATE),
    "plate_quads_22_binary.msh": (92, PLATE),
    "block_22.msh": (107, BLOCK),
    "block_41.msh": (107, BLOCK),
    "block_41_binary.msh": (107, BLOCK),
    "block_second_order_41.msh": (107, BLOCK),
}


@pytest.mark.parametrize("name", GMSH)
def test_gmsh_counts_the_same(name: str) -> None:
    mesh = read_mesh(DATA / name, unit="mm")
    n_nodes, groups = GMSH[name]
    assert mesh.n_nodes == n_nodes and sizes(mesh) == groups
    assert mesh.notes == () or "second_order" in name
    if mesh.dim == 2:
        assert mesh.measures.sum() == pytest.approx(729.2893218813454e-6, rel=1e-12)  # the hole as a polygon
        assert (mesh.nodes[mesh.node_groups["clamped"], 0] == 0).all()
        assert mesh.nodes[mesh.node_groups["pulled"], 0] == pytest.approx(0.04)
    else:
        assert mesh.measures.sum() == pytest.approx(6000e-9, rel=1e-12)
        assert (mesh.nodes[mesh.node_groups["clamped"], 2] == 0).all()
        assert mesh.nodes[mesh.node_groups["pulled"], 0] == pytest.approx(0.03)
        assert (mesh.nodes[mesh.elements[mesh.element_groups["13"]]].mean(axis=1)[:, 0] > 0.015).all()


def test_every_format_holds_the_same_block() -> None:
    block = read_mesh(DATA / "block_41.msh")
    others = [file for file in WRITTEN if file.stem.startswith("block") and file.name != "block_41.msh"]
    assert len(others) == 7
    for file in others:
        mesh = read_mesh(file)
        assert mesh.nodes == pytest.approx(block.nodes, abs=1e-12), file
        assert (mesh.elements == block.elements).all(), file
        if file.suffix == ".msh":
            assert same_groups(mesh, block), file


def test_gmsh_exports_its_groups_to_inp_and_its_entities_to_vtk() -> None:
    block = read_mesh(DATA / "block_41.msh")
    deck, grid = read_mesh(DATA / "block.inp"), read_mesh(DATA / "block.vtk")
    assert deck.notes == ("66 triangles are not part of the body and only carry sets",)
    for name, nodes in block.node_groups.items():
        assert (deck.node_groups[name if name != "13" else "PhysicalVolume13"] == nodes).all()
    entities = {"clamped": 7, "pulled": 8, "soft": 11, "13": 12}  # written instead of the numbers of the entities
    for name, number in entities.items():
        assert (grid.node_groups[f"CellEntityIds-{number}"] == block.node_groups[name]).all()
    assert (grid.element_groups["CellEntityIds-11"] == block.element_groups["soft"]).all()


@pytest.mark.parametrize("name", ["block.vtu", "block_51_binary.vtk"])
def test_vtk_writes_its_arrays(name: str) -> None:
    block, grid = read_mesh(DATA / "block_41.msh"), read_mesh(DATA / name)
    assert (grid.element_groups["region-1"] == block.element_groups["soft"]).all()
    assert (grid.element_groups["region-2"] == block.element_groups["13"]).all()
    assert (grid.node_groups["clamped"] == block.node_groups["clamped"]).all()
    assert sizes(grid) == {"clamped": (36, 0), "region-0": (45, 0), "region-1": (60, 130), "region-2": (60, 130)}


@pytest.mark.parametrize("name", ["quads_51.vtk", "quads_51_binary.vtk", "quads_raw.vtu", "quads_ascii.vtu"])
def test_vtk_writes_arrays_of_every_sort(name: str) -> None:
    mesh = read_mesh(DATA / name)
    assert mesh.nodes.tolist() == [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]
    assert mesh.elements.tolist() == [[0, 1, 4, 3], [1, 2, 5, 4]]
    wanted = {"my layer-3": [0, 1], "part-1": [0], "part-2": [1], "soft-0": [0], "soft-1": [1]}
    wanted |= {"owner-7": [0], "owner-8": [1]}
    if name.endswith(".vtk"):  # bits are none of the types of a .vtu
        wanted |= {"bits-0": [1], "bits-1": [0]}
    assert {group: elements.tolist() for group, elements in mesh.element_groups.items()} == wanted
    assert mesh.node_groups["clamped"].tolist() == [0, 3] and "level" not in mesh.node_groups


def test_a_deck_for_calculix() -> None:
    mesh = read_mesh(DATA / "beam.inp")
    assert repr(mesh.element) == "'hexahedron'" and len(mesh.elements) == 4 and mesh.notes == ()
    assert sizes(mesh) == {
        **{"Nall": (20, 0), "FIX": (4, 0), "Tip": (6, 0), "ends": (10, 0)},
        **{"Eall": (20, 4), "upper": (12, 2)},
    }
    assert mesh.nodes[15] == pytest.approx([-0.1, 1, 6])  # its x is written -1.D-1


@needs_ccx
def test_calculix_sees_the_same_deck(tmp_path: Path) -> None:
    shutil.copy(DATA / "beam.inp", tmp_path)
    subprocess.run(["ccx", "beam"], cwd=tmp_path, capture_output=True, timeout=60, check=True)
    tables: dict[str, Floats] = {}
    for block in re.split(r"\n\s*\n(?=\s*[a-z])", (tmp_path / "beam.dat").read_text().strip()):
        title, *rows = block.strip().splitlines()
        name = re.search(r"set (\w+)", title)
        assert name
        tables[name[1]] = np.array([row.split() for row in rows if row.strip()], dtype=float)
    assert set(tables) == {"NALL", "ENDS", "UPPER", "EALL"}
    mesh = read_mesh(DATA / "beam.inp")
    numbers = tables["NALL"][:, 0]
    assert sorted(tables["ENDS"][:, 0]) == numbers[mesh.node_groups["ends"]].tolist()
    assert tables["EALL"][:, 1] == pytest.approx(mesh.measures, rel=1e-6)
    assert tables["UPPER"][:, 1] == pytest.approx(mesh.measures[mesh.element_groups["upper"]], rel=1e-6)


def test_the_shipped_tissue_is_a_good_mesh() -> None:
    mesh = read_mesh(TISSUE, unit="mm")
    assert mesh.notes == () and mesh.element == "tetrahedron" and (mesh.parts == 0).all()
    assert sizes(mesh) == {"clamped": (242, 0), "grasped": (16, 0), "tissue": (1086, 4142)}
    assert mesh.measures.sum() == pytest.approx(52.26e-6, rel=1e-3)
    assert mesh.upper - mesh.lower == pytest.approx([0.0805, 0.05, 0.03], rel=1e-2)
    at = mesh.nodes[mesh.elements]
    edges = np.array(mesh.kind.edges)
    squared = ((at[:, edges[:, 1]] - at[:, edges[:, 0]]) ** 2).sum(axis=2).sum(axis=1)
    mean_ratio = 12 * (3 * mesh.measures) ** (2 / 3) / squared  # 1 of a regular tetrahedron (Liu and Joe 1994)
    assert mean_ratio.min() > 0.4 and np.median(mean_ratio) > 0.85
    grasped = mesh.nodes[mesh.node_groups["grasped"]]
    assert np.linalg.norm(grasped - [0.0405, -0.003, 0.0145], axis=1).max() < 0.0061


@pytest.mark.parametrize("file", [*WRITTEN, TISSUE], ids=lambda file: file.name)
def test_reading_prints_nothing(file: Path, capfd: pytest.CaptureFixture[str]) -> None:
    read_mesh(file)
    assert capfd.readouterr() == ("", "")


# --- what was written comes back ------------------------------------------------------------------


def bodies(element: str, seed: int) -> ts.Mesh:
    """A small lattice of one kind, its nodes moved and numbered at random."""
    rng = np.random.default_rng(seed)
    kind = ELEMENT_KINDS[element]
    counts = rng.integers(1, 4, kind.dim)
    grid = np.stack(np.meshgrid(*(np.arange(n + 1) for n in counts), indexing="ij"), axis=-1).reshape(-1, kind.dim)
    number = {tuple(place): row for row, place in enumerate(grid.tolist())}
    corner = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    corner = corner[: 2**kind.dim, : kind.dim]
    cells = np.array(
        [[number[tuple(p)] for p in (at + corner).tolist()] for at in grid if (at < counts).all()], dtype=np.int64
    )
    if element == "triangle":
        cells = cells[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    elif element == "tetrahedron":  # two halves of three each, along the diagonal 0-6
        six = [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]]
        cells = cells[:, six].reshape(-1, 4)
    elif element == "wedge":
        cells = cells[:, [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]]].reshape(-1, 6)
    elif element == "pyramid":  # six about the middle of each cell
        tips = len(grid) + np.repeat(np.arange(len(cells)), 6)
        faces = [[0, 1, 2, 3], [4, 7, 6, 5], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]]
        grid = np.concatenate([grid, grid[cells].mean(axis=1)])
        cells = np.column_stack([cells[:, faces].reshape(-1, 4), tips])
    positions = grid + rng.uniform(-0.1, 0.1, grid.shape)
    new = rng.permutation(len(positions))
    return ts.Mesh(positions[np.argsort(new)], new[cells], element)


def as_meshio(mesh: ts.Mesh) -> meshio.Mesh:
    return meshio.Mesh(np.pad(mesh.nodes, ((0, 0), (0, 3 - mesh.dim))), [(mesh.kind.vtk, mesh.elements.copy())])


def write_inp(file: Path, mesh: ts.Mesh) -> None:
    kind = {"triangle": "CPS3", "quadrilateral": "CPE4", "tetrahedron": "C3D4", "hexahedron": "C3D8R"}[mesh.element]
    lines = ["*NODE", *(f"{row + 1}, " + ", ".join(map(repr, at)) for row, at in enumerate(mesh.nodes.tolist()))]
    lines += [f"*ELEMENT, TYPE={kind}"]
    lines += [f"{row + 1}, " + ", ".join(map(str, nodes)) for row, nodes in enumerate((mesh.elements + 1).tolist())]
    file.write_text("\n".join([*lines, ""]))


def through_meshio(suffix: str, **options: object) -> tuple[str, Callable[[Path, ts.Mesh], None]]:
    def write(file: Path, mesh: ts.Mesh) -> None:
        with contextlib.redirect_stderr(io.StringIO()):  # meshio's advice
            as_meshio(mesh).write(file, **options)

    return suffix, write


FORMATS = {
    "msh 2.2": through_meshio(".msh", file_format="gmsh22", binary=False),
    "msh 2.2 binary": through_meshio(".msh", file_format="gmsh22", binary=True),
    "msh 4.1": through_meshio(".msh", file_format="gmsh", binary=False),
    "msh 4.1 binary": through_meshio(".msh", file_format="gmsh", binary=True),
    "vtu": through_meshio(".vtu", binary=False),
    "vtu plain": through_meshio(".vtu", compression=None),
    "vtu zlib": through_meshio(".vtu", compression="zlib", header_type="UInt64"),
    "vtu lzma": through_meshio(".vtu", compression="lzma"),
    "vtk 4.2": through_meshio(".vtk", file_format="vtk42", binary=False),
    "vtk 4.2 binary": through_meshio(".vtk", file_format="vtk42", binary=True),
    "vtk 5.1": through_meshio(".vtk", file_format="vtk", binary=False),
    "vtk 5.1 binary": through_meshio(".vtk", file_format="vtk", binary=True),
    "inp": (".inp", write_inp),
}
elements = pytest.mark.parametrize("element", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])


@elements
@pytest.mark.parametrize("form", FORMATS)
@settings(max_examples=3, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
def test_what_meshio_writes_comes_back(
    tmp_path_factory: pytest.TempPathFactory, form: str, element: str, seed: int
) -> None:
    suffix, write = FORMATS[form]
    file = tmp_path_factory.mktemp("mesh") / f"mesh{suffix}"
    mesh = bodies(element, seed)
    write(file, mesh)
    found = read_mesh(file)
    if form == "vtu":  # meshio writes twelve digits
        assert found.nodes == pytest.approx(mesh.nodes, abs=1e-11)
        found = replace(found, nodes=mesh.nodes)
    assert same(found, mesh) and not found.notes


def test_the_scale_is_the_unit(tmp_path: Path) -> None:
    mesh, file = bodies("tetrahedron", 7), tmp_path / "mesh.inp"
    write_inp(file, mesh)
    assert (read_mesh(str(file), unit="mm").nodes == mesh.nodes * 1e-3).all()
    for scale in (0.0, -1.0, float("nan"), float("inf")):
        with pytest.raises(MeshError, match=r"mesh\.inp: unit = "):
            read_mesh(file, scale)


# --- what a file may hold -------------------------------------------------------------------------

SQUARE = """*NODE
1, 0, 0
2, 1, 0
3, 1, 1
4, 0, 1
5, 2, 0
6, 2, 1
"""
TWO_QUADS = SQUARE + "*ELEMENT, TYPE=CPS4, ELSET=Body\n1, 1, 2, 3, 4\n2, 2, 5, 6, 3\n"


def deck(tmp_path: Path, text: str, unit: str | float = "m") -> ts.Mesh:
    file = tmp_path / "deck.inp"
    file.write_text(text)
    return read_mesh(file, unit)


def grid(tmp_path: Path, points: Floats | list[list[float]], cells: list[tuple[str, Ints]], **data: object) -> ts.Mesh:
    file = tmp_path / "grid.vtu"
    meshio.Mesh(np.array(points, dtype=float), cells, **data).write(file)  # type: ignore[arg-type]
    return read_mesh(file)


def test_nodes_without_an_element_are_left_out_and_named(tmp_path: Path) -> None:
    mesh = deck(tmp_path, TWO_QUADS.replace("*NODE\n", "*NODE, NSET=all\n17, 300, 400\n18, 9, 9\n"), unit="cm")
    assert mesh.n_nodes == 6 and sizes(mesh) == {"Body": (6, 2), "all": (6, 0)}
    assert mesh.notes == ("2 of 8 nodes belong to no element and were left out; the first is node 17 at (3, 4, 0) m",)


def test_nodes_at_one_place_are_named(tmp_path: Path) -> None:
    torn = TWO_QUADS.replace("*ELEMENT", "12, 1, 0\n13, 1, 1.0000000001\n7, 3, 0\n8, 3, 1\n*ELEMENT").replace(
        "2, 2, 5, 6, 3\n", "2, 12, 5, 6, 13\n3, 5, 7, 8, 6\n"
    )
    (note,) = deck(tmp_path, torn).notes
    assert note == (
        "4 of 10 nodes coincide with another node, the first are nodes 2 and 12 at (1, 0) m: "
        "the mesh may be torn there; join = true merges them"
    )
    assert not deck(tmp_path, torn.replace("1.0000000001", "1.0001").replace("12, 1, 0", "12, 1.01, 0")).notes


def test_groups_of_inp_know_no_case_and_nodes_are_those_of_the_node_set(tmp_path: Path) -> None:
    sets = """*NSET, NSET=Left
1, 4
*nset, nset=LEFT
2,
*ELSET, ELSET=left
2
*NSET, NSET=Many, GENERATE
1, 1000, 3
*NSET, NSET=Both
left, 6
"""
    mesh = deck(tmp_path, TWO_QUADS + sets)
    assert sizes(mesh) == {"Body": (6, 2), "Left": (3, 1), "Many": (2, 0), "Both": (4, 0)}
    assert mesh.node_groups["Many"].tolist() == [0, 3] and mesh.node_groups["Both"].tolist() == [0, 1, 3, 5]


def test_groups_without_a_node_of_the_body_are_left_out(tmp_path: Path) -> None:
    mesh = deck(tmp_path, TWO_QUADS.replace("*NODE\n", "*NODE\n9, 5, 5\n") + "*NSET, NSET=reference\n9\n")
    assert "reference" not in mesh.node_groups
    assert "group 'reference' has no node of the body and was left out" in mesh.notes


def test_a_name_in_several_dimensions_is_one_group_of_nodes(tmp_path: Path) -> None:
    text = (DATA / "plate_triangles_22.msh").read_text().replace('"pulled"', '"clamped"')
    (tmp_path / "plate.msh").write_text(text)
    assert sizes(read_mesh(tmp_path / "plate.msh")) == {"clamped": (12, 0), "tissue": (78, 118)}
    (tmp_path / "plate.msh").write_text(text.replace('"tissue"', '"clamped"'))
    assert sizes(read_mesh(tmp_path / "plate.msh")) == {"clamped": (78, 118)}


def test_the_sign_of_a_physical_group_is_its_orientation(tmp_path: Path) -> None:
    for name, line in (
        ("plate_quads_41.msh", r"(?m)(^7 .*) 1 1 2 "),
        ("plate_triangles_22.msh", r"(?m)(^\d+ 1 2) 1 7 "),
    ):
        group = r"\1 1 -1 2 " if name.endswith("41.msh") else r"\1 -1 7 "
        text, n_changed = re.subn(line, group, (DATA / name).read_text())
        (tmp_path / name).write_text(text)
        assert n_changed and same(read_mesh(tmp_path / name), read_mesh(DATA / name))


def test_sections_that_are_not_read_are_passed_over(tmp_path: Path) -> None:
    for name in ("plate_quads_41.msh", "plate_quads_41_binary.msh"):
        head, rest = (DATA / name).read_bytes().split(b"$PhysicalNames")
        (tmp_path / name).write_bytes(head + b"$Periodic\n$End?\n $EndPeriodic x\n$EndPeriodic\n$PhysicalNames" + rest)
        assert same(read_mesh(tmp_path / name), read_mesh(DATA / name))


def test_an_element_twice_in_one_group_is_a_duplicate(tmp_path: Path) -> None:
    text = (DATA / "block_22.msh").read_text().replace(" 4 2 12 1 ", " 4 2 11 1 ")
    (tmp_path / "block.msh").write_text(text)
    with pytest.raises(MeshError, match="elements are duplicate"):
        read_mesh(tmp_path / "block.msh")


def test_arrays_that_name_no_group(tmp_path: Path) -> None:
    points = [[x, y, 0.0] for y in (0, 1) for x in range(71)]
    quads = np.array([[i, i + 1, i + 72, i + 71] for i in range(70)])
    cell = {"region": np.arange(70) // 35, "id": np.arange(70), "offset": np.arange(70) // 35, "real": np.zeros(70)}
    point = {"held": np.arange(142) < 2, "level": np.arange(142) % 3, "two": np.zeros((142, 2), dtype=int)}
    point["vtkOriginalPointIds"] = point["held"] = point["held"].astype(int)
    mesh = grid(tmp_path, points, [("quad", quads)], cell_data={n: [v] for n, v in cell.items()}, point_data=point)
    assert sizes(mesh) == {"held": (2, 0), "region-0": (72, 35), "region-1": (72, 35)}


def test_of_cells_with_one_value_the_highest_dimension_counts(tmp_path: Path) -> None:
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    cells = [("line", np.array([[0, 1], [1, 2]])), ("quad", np.array([[0, 1, 2, 3]])), ("vertex", np.array([[3]]))]
    values = [np.array([5, 1]), np.array([1]), np.array([5])]
    assert sizes(grid(tmp_path, points, cells, cell_data={"entity": values})) == {
        "entity-1": (4, 1),
        "entity-5": (2, 0),
    }


@pytest.mark.parametrize("name", ["beam.inp", "block_41.msh", "block_22.msh", "quads_51.vtk", "quads_ascii.vtu"])
def test_line_ends_and_marks_of_other_systems(tmp_path: Path, name: str) -> None:
    file = (tmp_path / name).with_suffix(Path(name).suffix.upper())
    file.write_bytes(b"\xef\xbb\xbf" + (DATA / name).read_bytes().replace(b"\n", b"\r\n"))
    assert same(read_mesh(file), read_mesh(DATA / name))


def test_a_base64_header_may_stand_alone(tmp_path: Path) -> None:
    text = (DATA / "quads_ascii.vtu").read_text()
    for header in (np.array([16]).tobytes(), b""):
        alone = base64.b64encode(header) + base64.b64encode(np.array([4, 8]).tobytes())
        together = base64.b64encode(np.array([16, 4, 8]).tobytes())
        offsets = (alone if header else together).decode()
        coded, n_changed = re.subn(r'(Name="offsets" format=)"ascii"([^>]*>)[\s\d]*<', rf'\1"binary"\2{offsets}<', text)
        (tmp_path / "quads.vtu").write_text(coded.replace('header_type="UInt32"', 'header_type="UInt64"'))
        assert n_changed == 1 and same(read_mesh(tmp_path / "quads.vtu"), read_mesh(DATA / "quads_ascii.vtu"))


def test_pixels_and_voxels_have_an_order_of_their_own(tmp_path: Path) -> None:
    text = """# vtk DataFile Version 3.0
one voxel

ASCII
DATASET UNSTRUCTURED_GRID
POINTS 8 float
0 0 0 1 0 0 0 1 0 1 1 0
0 0 1 1 0 1 0 1 1 1 1 1
CELLS 1 9
8 0 1 2 3 4 5 6 7
CELL_TYPES 1
11
"""
    (tmp_path / "voxel.vtk").write_text(text.replace("one voxel\n\n", "one voxel\n"))
    mesh = read_mesh(tmp_path / "voxel.vtk")
    assert mesh.measures.tolist() == [1.0] and mesh.elements.tolist() == [[0, 1, 3, 2, 4, 5, 7, 6]]


@elements
def test_elements_of_either_orientation_are_turned_one_by_one(tmp_path: Path, element: str) -> None:
    mesh, file = bodies(element, 11), tmp_path / "mesh.vtu"
    flipped = as_meshio(mesh)
    flipped.points[:, 0] *= -1
    flipped.write(file)
    found = read_mesh(file)
    assert found.notes == (f"all {len(mesh.elements)} elements are inverted in the file and were mirrored",)
    assert found.measures == pytest.approx(mesh.measures)
    (block,) = flipped.cells
    block.data[0] = found.elements[0]
    flipped.write(file)
    again = read_mesh(file)
    n_turned = len(mesh.elements) - 1
    wanted = f"{n_turned} of {len(mesh.elements)} elements are inverted in the file and were mirrored"
    assert again.notes == ((wanted,) if n_turned else ())
    assert again.measures == pytest.approx(mesh.measures)


def test_second_order_becomes_its_corners(tmp_path: Path) -> None:
    middle = "11, .5, 0\n12, 1, .5\n13, .5, 1\n14, 0, .5\n15, 1.5, 0\n16, 2, .5\n17, 1.5, 1\n"
    text = TWO_QUADS.replace("CPS4", "CPS8R").replace("*ELEMENT", f"{middle}*ELEMENT")
    text = text.replace("3, 4\n2, 2", "3, 4,\n11, 12, 13, 14\n2, 2").replace("6, 3\n", "6, 3, 15, 16, 17,\n12\n")
    mesh = deck(tmp_path, text + "*NSET, NSET=top\n3, 4, 6, 13, 17\n")
    assert mesh.notes == (
        "2 elements of second order were reduced to their corners; 7 nodes between the corners were left out",
    )
    assert mesh.elements.tolist() == deck(tmp_path, TWO_QUADS).elements.tolist()
    assert sizes(mesh) == {"Body": (6, 2), "top": (3, 0)}


def test_missing_coordinates_are_zero_and_named(tmp_path: Path) -> None:
    mesh = deck(tmp_path, TWO_QUADS.replace("5, 2, 0", "5, 2"))
    assert (mesh.nodes == deck(tmp_path, TWO_QUADS).nodes).all()
    assert mesh.notes == (
        "1 of 6 nodes have fewer coordinates than others of their *NODE, the first is node 5 in line 6: "
        "missing coordinates are 0",
    )


def test_a_plane_body_may_lie_at_any_height(tmp_path: Path) -> None:
    points = [[0, 0, 3.0], [1, 0, 3.0], [1, 1, 3.0], [0, 1, 3.0]]
    assert grid(tmp_path, points, [("quad", np.array([[0, 1, 2, 3]]))]).nodes.shape == (4, 2)
    points[2][2] = 3.1
    with pytest.raises(MeshError, match=r"surface in space \(z from 3 to 3\.1 m\): a shell is not supported"):
        grid(tmp_path, points, [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))])


CUBE = [[x, y, z] for z in (0.0, 1.0) for y, x in ((0.0, 0.0), (0.0, 1.0), (1.0, 1.0), (1.0, 0.0))]


@pytest.mark.parametrize(
    ("cells", "message"),
    [
        ({"quad": [[0, 1, 2, 3]], "polygon": [[4, 5, 6, 7]]}, "not supported: 1 polygon; a body consists of .* divide"),
        ({"polygon": [[0, 1, 2, 3]]}, "not supported: 1 polygon; a body consists of"),
        ({"line": [[0, 1], [1, 2]], "vertex": [[0]]}, "there are only 1 vertex and 2 lines: a body consists of"),
    ],
)
def test_bodies_of_other_kinds_are_refused_with_counts(
    tmp_path: Path, cells: dict[str, list[list[int]]], message: str
) -> None:
    with pytest.raises(MeshError, match=rf"grid\.vtu: {message}"):
        grid(tmp_path, CUBE, [(kind, np.array(nodes)) for kind, nodes in cells.items()])


def test_a_piece_that_is_there_twice_is_taken_once(tmp_path: Path) -> None:
    """Else it would be twice as stiff; meshio keeps the last one only."""
    grid(tmp_path, CUBE, [("hexahedron", np.array([range(8)]))])
    file = tmp_path / "grid.vtu"
    text = file.read_bytes()
    piece = re.search(rb"<Piece.*</Piece>", text, re.DOTALL)
    assert piece
    file.write_bytes(text.replace(piece[0], piece[0] * 2))
    mesh = read_mesh(file)
    assert mesh.n_nodes == 8 and len(mesh.elements) == 1
    assert "1 cells are in two pieces and were read once" in mesh.notes


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("4, 0, 1\n", "4, 0, 1x\n", "line 5: a coordinate: '1x' is not a number"),
        ("4, 0, 1\n", "4, 0, nan\n", "line 5: 1 of 6 nodes have a coordinate that is not finite .* node 4"),
        ("4, 0, 1\n", "4, 0, 1e99\n", "line 5: 1 of 6 nodes have a coordinate that is not finite or beyond 1e\\+30"),
        ("4, 0, 1\n", "2, 0, 1\n", "line 5: node 2 is defined twice"),
        ("4, 0, 1\n", "4.5, 0, 1\n", "line 5: the number of a node: '4.5' is not an integer"),
        ("5, 6, 3", "5, 66, 3", r"line 10: element 2 \(quadrilateral\) names node 66, which is not in the file"),
        ("5, 6, 3", "5, 6", "line 10: an element of CPS4 needs 5 numbers, found 4"),
        ("5, 6, 3", "5, 6, 3, 1", "line 10: an element of CPS4 needs 5 numbers, found 6"),
        ("2, 2, 5", "1, 2, 5", "line 10: element 1 is defined twice"),
        ("2, 2, 5, 6, 3", "2, 1, 2, 3, 4", "1 of 2 elements are duplicate"),
        ("2, 2, 5, 6, 3", "2, 2, 5, 3, 6", "1 of 2 elements are inverted.*element 1 at"),
        ("2, 2, 5, 6, 3", "2, 2, 5, 2, 3", "1 of 2 elements are degenerate"),
        ("CPS4", "C3D6", r"line 9: an element of C3D6 needs 7 numbers, found 10"),
        ("*NODE", "*NODE, SYSTEM=C", r"line 1: \*NODE: only rectangular coordinates"),
        ("*ELEMENT", "*NGEN, NSET=a\n1, 4, 1\n*ELEMENT", r"line 8: \*NGEN: this keyword is not supported"),
        ("*NODE", "*NODE\n*NODE", r"line 1: \*NODE: there are no lines of data below"),
        ("*NODE", "NODE", r"line 1: this is no \.inp file: .*\*NODE.*'NODE'"),
        ("*NODE", "*NOD", r"line 9: element 1 \(quadrilateral\) names node 1, which is not in the file"),
        ("*ELEMENT", "*ELEMEN", r"there is no \*ELEMENT"),
        ("5, 6, 3\n", "5, 6, 3\n*ELSET, ELSET=a, GENERATE\n9, 7\n", "line 12: .ELSET: GENERATE needs"),
        ("5, 6, 3\n", "5, 6, 3\n*NSET, NSET=a\n1, b\n", "line 12: 'b' is neither a number nor a set"),
        ("5, 6, 3\n", "5, 6, 3\n*NSET\n1\n", r"line 11: \*NSET: expected NSET=NAME"),
        ("5, 6, 3\n", "5, 6, 30000000000000000000000\n", "line 9 or later: an element: a number has too many digits"),
        ("5, 6, 3\n", "5, 6, 3\0\n", r"this is no \.inp file: it is binary"),
    ],
)
def test_a_damaged_deck_is_refused_by_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    assert old in TWO_QUADS
    with pytest.raises(MeshError, match=rf"deck\.inp: ({message})"):
        deck(tmp_path, TWO_QUADS.replace(old, new, 1))


@pytest.mark.parametrize(
    ("name", "old", "new", "message"),
    [
        ("plate_triangles_22.msh", "$Nodes\n78", "$Nodes\n77", r"line 89: expected \$EndNodes, .*'78 .*counts"),
        ("plate_triangles_22.msh", "$Nodes\n78", "$Nodes\n79", r"line 90: \$Nodes ends here, 1 lines before its count"),
        ("plate_triangles_22.msh", "$Nodes\n78", "$Nodes\n-8", r"line 11: \$Nodes .* a count, not with '-8'"),
        ("plate_triangles_22.msh", "\n2 0 0 0\n", "\n2 0 0\n", r"line 13: \$Nodes needs 4 numbers, found 3"),
        ("plate_triangles_22.msh", "\n2 0 0 0\n", "\n2 0 0 z\n", "line 13: a coordinate: 'z' is not a number"),
        ("plate_triangles_22.msh", "\n2 0 0 0\n", "\n0 0 0 0\n", "line 97: .* names node 2, which is not in the file"),
        (
            "plate_triangles_22.msh",
            "\n1 1 2 1 7 ",
            "\n1 1 3 1 7 ",
            "line 93: an element of gmsh's type 1 with 3 tags needs 8",
        ),
        (
            "plate_triangles_22.msh",
            "\n1 1 2 1 7 ",
            "\n1 21 2 1 7 ",
            "line 93: an element of gmsh's type 21 is not supported.* mesh with Mesh.ElementOrder = 1 or 2",
        ),
        (
            "plate_triangles_22.msh",
            "2.2 0 8",
            "1.0 0 8",
            r"version 1.0 of \.msh is not supported; .*gmsh FILE -0 -format msh41",
        ),
        (
            "plate_triangles_22.msh",
            "$Nodes",
            "Nodes",
            r"line 10: .*\$Nodes.*'Nodes'",
        ),
        ("plate_triangles_22.msh", "$EndNodes", "$EndNode", r"line 90: expected \$EndNodes"),
        ("plate_triangles_22.msh", '1 1 "clamped"', "1 1 clamped", "line 6: a physical group must have"),
        ("plate_quads_41.msh", "$Entities", "$PartitionedEntities", "line 11: .PartitionedEntities needs 1 numbers"),
        ("plate_quads_41.msh", "$Elements", "$Other", r"line 311: \$EndOther is missing: the file is truncated"),
        ("plate_quads_41.msh", "$MeshFormat", "$Mesh", r"this is no \.msh file"),
        (
            "plate_quads_41.msh",
            "$Nodes\n11 92 ",
            "$Nodes\n11 93 ",
            r"line \d+: \$Nodes states 93 entries and has 92",
        ),
        (
            "plate_quads_41.msh",
            "$Elements\n3 84 ",
            "$Elements\n3 83 ",
            r"line 310: \$Elements states 83 entries and has 84",
        ),
        ("plate_quads_41.msh", "\n1 7 1 6\n", "\n1 7 1 -6\n", r"line 224: \$Elements: a count is negative"),
        ("block.vtk", "CELLS 326", "CELLS 325", "line 114: CELLS states 325 cells in 1564 numbers, these contain 326"),
        ("block.vtk", "CELL_TYPES 326", "CELL_TYPES 325", "line 768: '10' is not a supported keyword"),
        (
            "block.vtk",
            "CELL_TYPES 326",
            "CELL_TYPES 327",
            "line 770: 327 numbers are stated here, number 327 is 'CELL",
        ),
        ("block.vtk", "POINTS 107", "POINTS 108", "line 114: 324 numbers are stated here, number 322 is 'CELLS'"),
        ("block.vtk", "\n0 0 10\n", "\n0 zero 10\n", "line 6: 321 numbers are stated here, number 2 is 'zero'"),
        ("block.vtk", "\n3 ", "\n4 ", "line 114: CELLS states 326 cells"),
        (
            "block.vtk",
            "UNSTRUCTURED_GRID",
            "FIELD",
            "DATASET FIELD is not supported; .*UNST.* in ParaView, Append Dat",
        ),
        (
            "block.vtk",
            "CELL_DATA 326",
            "CELL_DATA 6",
            "line 779: '7' is not a supported keyword",
        ),
        ("quads_51.vtk", "\n0 4 8 ", "\n0 4 9 ", "the offsets give 9 nodes of cells, 8 are listed"),
        ("quads_51.vtk", "\n0 4 8 ", "\n0 5 8 ", "cell 1 is a quadrilateral by its type 9, but has 3 nodes"),
        ("quads_51.vtk", "\n0 4 8 ", "\n4 4 8 ", "3 offsets do not match 2 cells, or do not ascend from 0"),
        (
            "quads_51.vtk",
            "0 1 4 3 1",
            "0 1 4 3 9",
            r"element 1 \(quadrilateral\) names node 9, which is not in the file",
        ),
        ("quads_51.vtk", "\n9\n9\n", "\n9\n99\n", "cell 1: VTK's cell type 99 is not supported"),
        ("quads_51.vtk", " vtkIdType", " string", "line 32: an array of type 'string' is not supported"),
        ("quads_51.vtk", "LOOKUP_TABLE", "LOOKUP", "line 23: SCALARS part: .*LOOKUP_TABLE"),
        (
            "quads_51.vtk",
            "CONNECTIVITY vtktypeint64",
            "CONNECTIVITY",
            "line 15: expected CONNECTIVITY and an integer type",
        ),
        ("quads_ascii.vtu", "0 1 4 3 1", "0 1 4 3 1 1", "the offsets give 8 nodes of cells, 9 are listed"),
        ("quads_ascii.vtu", "0 1 4 3 1", "0 1 4 3 x", "array 'connectivity' of <Cells> is damaged: invalid literal"),
        ("quads_ascii.vtu", 'Name="types"', 'Name="type"', "<Cells> has no array 'types' of integers"),
        ("quads_ascii.vtu", 'NumberOfComponents="3" format', 'NumberOfComponents="7" format', "array .* is damaged"),
        ("quads_ascii.vtu", 'NumberOfCells="2"', 'NumberOfCells="two"', 'a Piece has NumberOfCells="two"'),
        ("block.vtu", "vtkZLibDataCompressor", "vtkLZ4DataCompressor", ".*vtkLZ4DataCompressor.* is not supported"),
        (
            "block.vtu",
            'NumberOfPoints="107"',
            'NumberOfPoints="106"',
            "array 'Points' of <Points> is damaged: its head",
        ),
        (
            "block.vtu",
            'NumberOfCells="326"',
            'NumberOfCells="327"',
            "327 cells .* 326 offsets|array",
        ),
        (
            "block.vtu",
            "UnstructuredGrid",
            "PolyData",
            "array 'region' of <CellData> is damaged: its header states 1304 bytes, expected 0",
        ),
    ],
)
def test_a_damaged_file_is_refused_in_words(tmp_path: Path, name: str, old: str, new: str, message: str) -> None:
    data = (DATA / name).read_bytes()
    assert old.encode() in data
    count = -1 if old == "UnstructuredGrid" else 1
    (tmp_path / name).write_bytes(data.replace(old.encode(), new.encode(), count))
    with pytest.raises(MeshError, match=rf"{re.escape(name)}: ({message})"):
        read_mesh(tmp_path / name)


def test_an_appended_array_that_is_longer_than_the_file(tmp_path: Path) -> None:
    data = (DATA / "quads_raw.vtu").read_bytes()
    offset = re.search(rb'Name="connectivity"[^>]* offset="(\d+)"', data)
    assert offset
    begin = data.index(b"_", data.index(b"<AppendedData")) + 1 + int(offset[1])
    assert data[begin : begin + 8] == (64).to_bytes(8, "little")
    (tmp_path / "quads.vtu").write_bytes(data[:begin] + (10**6).to_bytes(8, "little") + data[begin + 8 :])
    with pytest.raises(MeshError, match=r"'connectivity' of <Cells> is damaged: 1000000 bytes are stated, found \d+"):
        read_mesh(tmp_path / "quads.vtu")


def test_a_count_of_cells_that_does_not_match(tmp_path: Path) -> None:
    grid(tmp_path, CUBE, [("hexahedron", np.array([range(8)]))])
    file = tmp_path / "grid.vtu"
    file.write_bytes(file.read_bytes().replace(b'NumberOfCells="1"', b'NumberOfCells="2"'))
    with pytest.raises(MeshError, match=r"array 'offsets' of <Cells> is damaged: .* expected 16"):
        read_mesh(file)


def test_files_that_are_none(tmp_path: Path) -> None:
    (tmp_path / "mesh.stl").write_text("solid a\nfacet normal 0 0 1\n")
    with pytest.raises(
        MeshError, match=r"mesh\.stl: the suffix of a mesh file is \.msh, .*, not '\.stl', and .*by a mesher such as"
    ):
        read_mesh(tmp_path / "mesh.stl")
    with pytest.raises(MeshError, match=r"none\.msh does not exist"):
        read_mesh(tmp_path / "none.msh")
    (tmp_path / "folder.msh").mkdir()
    with pytest.raises(MeshError, match=r"folder\.msh is a folder"):
        read_mesh(tmp_path / "folder.msh")
    for suffix in (".msh", ".inp", ".vtu", ".vtk"):
        file = tmp_path / f"file{suffix}"
        file.write_bytes(b" \n")
        with pytest.raises(MeshError, match="is empty"):
            read_mesh(file)
        file.write_bytes(np.random.default_rng(3).bytes(4000))
        with pytest.raises(MeshError, match=r"file\.\w+: this is no"):
            read_mesh(file)


def mesh_name(cut: bytes) -> str:
    """The name behind the last = of a deck, which may be cut."""
    return cut.rpartition(b"=")[2].splitlines()[0].decode().strip() if b"=" in cut else ""


@pytest.mark.parametrize("file", WRITTEN, ids=lambda file: file.name)
def test_a_file_that_is_cut_off_is_refused_or_whole(file: Path, tmp_path: Path) -> None:
    """But for what has no end mark: .vtk may lose its last arrays, .inp its end, and says so of a cut within a line."""
    whole, data = read_mesh(file), file.read_bytes()
    cut = tmp_path / file.name
    n_refused = 0
    for end in {*range(len(data) - 20, len(data)), *np.linspace(1, len(data) - 1, 60).astype(int).tolist()}:
        cut.write_bytes(data[:end])
        try:
            mesh = read_mesh(cut)
        except MeshError as error:
            n_refused += 1
            assert str(error).startswith(str(cut))
            continue
        if not same(mesh, whole):
            assert file.suffix in (".vtk", ".inp")
            there = len(mesh.elements) if file.suffix == ".inp" else None
            in_a_line = file.suffix == ".inp" and data[end - 1 : end] != b"\n"
            assert not in_a_line or "no line end: it may be truncated" in " ".join(mesh.notes)
            same_elements = (mesh.nodes[mesh.elements] == whole.nodes[whole.elements][:there]).all(axis=(1, 2))
            assert same_elements[: -1 if in_a_line else None].all()
            assert mesh.node_groups.keys() <= {*whole.node_groups} | {mesh_name(data[:end])}
    assert n_refused > 30


def test_a_deck_cut_off_between_two_elements_has_nodes_without_one(tmp_path: Path) -> None:
    text = (DATA / "block.inp").read_text()
    middle = text.index("\n", text.index("type=C3D4") + 2500) + 1
    mesh = deck(tmp_path, text[:middle])
    assert len(mesh.elements) < 260 and "nodes belong to no element" in " ".join(mesh.notes)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    file=st.sampled_from(WRITTEN),
    place=st.floats(0, 1),
    length=st.integers(0, 40),
    instead=st.binary(max_size=8)
    | st.sampled_from([b"-1", b"1e308", b"nan", b"99999999999999999999", b"\n", b",", b"$"]),
)
@example(file=DATA / "block.vtk", place=0.5, length=0, instead=b"\xff")
def test_damage_of_any_kind_ends_in_a_mesh_or_a_meshes_error(
    tmp_path_factory: pytest.TempPathFactory, file: Path, place: float, length: int, instead: bytes
) -> None:
    data = file.read_bytes()
    begin = int(place * len(data))
    damaged = tmp_path_factory.getbasetemp() / f"damaged{file.suffix}"
    damaged.write_bytes(data[:begin] + instead + data[begin + length :])
    with contextlib.suppress(MeshError):
        read_mesh(damaged)


def test_the_unit_of_a_file_is_named_or_a_number_of_metres() -> None:
    expected = read_mesh(TISSUE).nodes * 1e-3
    for unit in ("mm", "1 mm", 1e-3):
        assert np.allclose(read_mesh(TISSUE, unit).nodes, expected, rtol=1e-15, atol=0)
    with pytest.warns(DeprecationWarning, match="unit="):
        assert np.allclose(read_mesh(TISSUE, scale=1e-3).nodes, expected, rtol=1e-15, atol=0)  # type: ignore[call-arg]
    with pytest.raises(TypeError, match="scale"):
        read_mesh(TISSUE, unit="mm", scale=1e-3)  # type: ignore[call-arg]
    for wrong in ("s", "0 mm", float("nan"), -1.0):
        with pytest.raises(MeshError, match="unit"):
            read_mesh(TISSUE, wrong)
