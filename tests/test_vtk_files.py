"""VTK's files of every kind: pieces of one body, faces, lattices, parts of vectors, and files that name others."""

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from truespring.arrays import Floats, in_space
from truespring.errors import MeshError, ReferenceFileError, TruespringError
from truespring.mesh import CELL_SHAPES
from truespring.mesh.files import read_mesh
from truespring.mesh.files.vtk_file import VTK_FORMATS, read_vtk_grid
from truespring.mesh.files.vtk_grid import contents
from truespring.mesh.files.vtu_writing import write_vtu
from truespring.reference.result import read_record
from truespring.reference.vtk_cells import named

GRADIENT = np.array([[0.01, 0.002, 0.0], [-0.001, -0.003, 0.0], [0.0, 0.0, -0.003]])
SHAPE = (4, 2, 1)  # cells of the bar


def moved(points: Floats) -> Floats:
    """A displacement that is linear in the places."""
    return np.asarray(points @ GRADIENT.T)


def bar(x: tuple[int, int] = (0, 4)) -> Any:
    """Cubes of edge 1 from one x to another, as VTK's unstructured grid, with the displacement."""
    import pyvista as pv

    grid = pv.RectilinearGrid(np.arange(x[0], x[1] + 1.0), np.arange(3.0), np.arange(2.0)).cast_to_unstructured_grid()
    grid.point_data["displacement"] = moved(np.asarray(grid.points))
    grid.cell_data["part"] = np.asarray(grid.cell_centers().points[:, 0] < 2).astype(np.int32)
    return grid


def one_file(folder: Path, *pieces: Any) -> Path:
    """Grids as the pieces of one .vtu file, with no compression."""
    texts = []
    for number, piece in enumerate(pieces):
        piece.save(folder / f"piece{number}.vtu", binary=False)
        texts.append((folder / f"piece{number}.vtu").read_text())
    begin, end = texts[0].index("<Piece"), texts[0].rindex("</Piece>") + 8
    inside = "".join(text[text.index("<Piece") : text.rindex("</Piece>") + 8] for text in texts)
    (folder / "whole.vtu").write_text(texts[0][:begin] + inside + texts[0][end:])
    return folder / "whole.vtu"


def parallel(folder: Path, *pieces: Any) -> Path:
    """Grids as files that a .pvtu names."""
    names = []
    for number, piece in enumerate(pieces):
        piece.save(folder / f"piece{number}.vtu")
        names.append(f'<Piece Source="piece{number}.vtu"/>')
    text = f'<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid>{"".join(names)}</PUnstructuredGrid></VTKFile>'
    (folder / "whole.pvtu").write_text(text)
    return folder / "whole.pvtu"


def series(folder: Path, *pieces: Any) -> Path:
    """Grids as the parts that a .pvd names at one time."""
    entries = []
    for number, piece in enumerate(pieces):
        piece.save(folder / f"piece{number}.vtu")
        entries.append(f'<DataSet timestep="1" part="{number}" file="piece{number}.vtu"/>')
    (folder / "whole.pvd").write_text(
        f'<VTKFile type="Collection"><Collection>{"".join(entries)}</Collection></VTKFile>'
    )
    return folder / "whole.pvd"


@pytest.mark.parametrize("write", [one_file, parallel, series])
def test_pieces_are_one_body(write: Callable[..., Path], tmp_path: Path) -> None:
    record = read_record(write(tmp_path, bar((0, 1)), bar((1, 3)), bar((3, 4))))
    assert len(record.points) == len(np.unique(record.points, axis=0)) == 5 * 3 * 2
    assert len(record.cells["hexahedron"]) == 8
    assert record.levels[0].displacement == pytest.approx(moved(record.points), abs=1e-15)
    assert any("3 pieces were joined at the 12 points that they share" in note for note in record.notes)


def test_a_mesh_of_pieces_is_whole_and_keeps_its_groups(tmp_path: Path) -> None:
    mesh = read_mesh(parallel(tmp_path, bar((0, 2)), bar((2, 4))))
    assert mesh.measures.sum() == pytest.approx(8.0) and mesh.n_nodes == 30
    assert {name: len(members) for name, members in mesh.element_groups.items()} == {"part-0": 4, "part-1": 4}
    assert not any("torn" in note for note in mesh.notes)


def test_ghost_cells_are_left_out(tmp_path: Path) -> None:
    left, right = bar((0, 3)), bar((2, 4))
    left.cell_data["vtkGhostType"] = np.asarray(left.cell_centers().points[:, 0] > 2).astype(np.uint8)
    right.cell_data["vtkGhostType"] = np.zeros(right.n_cells, dtype=np.uint8)
    mesh = read_mesh(one_file(tmp_path, left, right))
    assert len(mesh.elements) == 8 and mesh.n_nodes == 30
    assert not any("two pieces" in note or "unreferenced" in note for note in mesh.notes)


def test_pieces_are_not_joined_where_one_has_several_points(tmp_path: Path) -> None:
    left, right = bar((0, 2)), bar((2, 4))
    torn = right.separate_cells()  # each cell has points of its own
    torn.point_data["displacement"] = moved(np.asarray(torn.points))
    grid = read_vtk_grid(one_file(tmp_path, left, torn).read_bytes(), tmp_path)
    assert len(grid.points) == left.n_points + torn.n_points - 4  # at the four corners each piece has one
    assert any("at 2 positions a piece has several points" in note for note in grid.notes)


def test_values_that_differ_between_pieces_are_told(tmp_path: Path) -> None:
    left, right = bar((0, 2)), bar((2, 4))
    right.point_data["displacement"] = 1.5 * moved(np.asarray(right.points))
    record = read_record(one_file(tmp_path, left, right))
    assert any("pieces differ in displacement by up to 0.1" in note for note in record.notes)


# --- other data sets ----------------------------------------------------------------------------------------------


def structured() -> Any:
    import pyvista as pv

    x, y, z = np.meshgrid(np.arange(5.0), np.arange(3.0), np.arange(2.0), indexing="ij")
    grid = pv.StructuredGrid(x + 0.1 * y, y, z)
    grid.point_data["displacement"] = moved(np.asarray(grid.points))
    grid.cell_data["part"] = np.arange(grid.n_cells) // 4
    return grid


def rectilinear() -> Any:
    import pyvista as pv

    grid = pv.RectilinearGrid(np.array([0.0, 1, 2, 3, 4]), np.array([0.0, 0.5, 2]), np.array([0.0, 1.0]))
    grid.point_data["displacement"] = moved(np.asarray(grid.points))
    grid.cell_data["part"] = np.arange(grid.n_cells) // 4
    return grid


@pytest.mark.parametrize("make", [structured, rectilinear])
@pytest.mark.parametrize("suffix", ["own", ".vtk"])
@pytest.mark.parametrize("binary", [True, False])
def test_lattices_are_hexahedra(make: Callable[[], Any], suffix: str, binary: bool, tmp_path: Path) -> None:
    grid = make()
    own = {structured: ".vts", rectilinear: ".vtr"}[make]
    file = tmp_path / f"grid{own if suffix == 'own' else suffix}"
    grid.save(file, binary=binary)
    mesh, record = read_mesh(file), read_record(file)
    assert mesh.element == "hexahedron" and mesh.measures.sum() == pytest.approx(8.0)
    assert mesh.centres[mesh.element_groups["part-1"]] == pytest.approx(np.asarray(grid.cell_centers().points)[4:])
    assert record.levels[0].displacement == pytest.approx(moved(record.points), abs=1e-12)


@pytest.mark.parametrize("suffix", [".vtp", ".vtk"])
@pytest.mark.parametrize("binary", [True, False])
def test_faces_are_a_plane_body(suffix: str, binary: bool, tmp_path: Path) -> None:
    import pyvista as pv

    plane = pv.Plane(i_size=4, j_size=2, i_resolution=4, j_resolution=2)
    plane.point_data.clear()
    for faces, element, count in ((plane, "quadrilateral", 8), (plane.triangulate(), "triangle", 16)):
        faces.point_data["u"] = moved(np.asarray(faces.points, dtype=float))
        faces.save(tmp_path / f"plane{suffix}", binary=binary)
        mesh = read_mesh(tmp_path / f"plane{suffix}")
        assert (mesh.element, len(mesh.elements), mesh.dim) == (element, count, 2)
        assert mesh.measures.sum() == pytest.approx(8.0)
        assert len(ts.read_result(tmp_path / f"plane{suffix}").problem.mesh.elements) == count


def test_strips_and_lines_become_triangles_and_segments(tmp_path: Path) -> None:
    points = "0 0 0 0 1 0 1 0 0 1 1 0 2 0 0 2 1 0"
    strip = "# vtk DataFile Version 3.0\nstrip\nASCII\nDATASET POLYDATA\nPOINTS 6 float\n" + points + "\n"
    (tmp_path / "strip.vtk").write_text(strip + "LINES 1 4\n3 0 2 4\nTRIANGLE_STRIPS 1 7\n6 0 1 2 3 4 5\n")
    mesh = read_mesh(tmp_path / "strip.vtk")
    assert len(mesh.elements) == 4 and mesh.measures == pytest.approx(np.full(4, 0.5))
    grid = read_vtk_grid((tmp_path / "strip.vtk").read_bytes(), tmp_path)
    triangles = grid.points[grid.connectivity[4:].reshape(4, 3), :2]  # behind the two segments
    turns = np.linalg.det(triangles[:, 1:] - triangles[:, :1])
    assert grid.types.tolist() == [3, 3, 5, 5, 5, 5] and turns.tolist() == [-1, -1, -1, -1]  # one way round


def test_xml_under_the_suffix_of_the_legacy_format(tmp_path: Path) -> None:
    bar().save(tmp_path / "bar.vtu")
    (tmp_path / "bar.vtk").write_bytes((tmp_path / "bar.vtu").read_bytes())
    assert read_mesh(tmp_path / "bar.vtk").n_nodes == read_record(tmp_path / "bar.vtk").points.shape[0] == 30


# --- the displacement by its parts --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "names",
    [
        ("u", "v", "w"),
        ("displacement 1", "displacement 2", "displacement 3"),
        ("UX", "UY", "UZ"),
        ("disp:0", "disp:1", "disp:2"),
    ],
)
def test_the_displacement_may_stand_in_parts(names: tuple[str, ...], tmp_path: Path) -> None:
    grid = bar()
    told = np.asarray(grid.point_data.pop("displacement"))
    for name, values in zip(names, told.T, strict=True):
        grid.point_data[name] = values
    grid.point_data["temperature"] = told[:, 0]
    grid.save(tmp_path / "bar.vtu")
    record = read_record(tmp_path / "bar.vtu")
    assert record.levels[0].displacement == pytest.approx(told)
    assert record.notes == (f"the displacement was read from {', '.join(names)}",)


def test_a_single_number_called_u_is_no_displacement(tmp_path: Path) -> None:
    grid = bar()
    grid.point_data["u"] = np.asarray(grid.point_data.pop("displacement"))[:, 0]
    grid.save(tmp_path / "bar.vtu")
    with pytest.raises(ReferenceFileError, match="its points have no vectors"):
        read_record(tmp_path / "bar.vtu")


# --- series -------------------------------------------------------------------------------------------------------


def collection(folder: Path, *entries: tuple[str, str]) -> Path:
    text = "".join(f'<DataSet timestep="{time}" file="{name}"/>' for time, name in entries)
    (folder / "body.pvd").write_text(f'<VTKFile type="Collection"><Collection>{text}</Collection></VTKFile>')
    return folder / "body.pvd"


@pytest.mark.parametrize("time", ["inf", "-inf", "nan", "NaN", "1e999", "", "soon"])
def test_a_time_that_is_no_finite_number_is_refused(time: str, tmp_path: Path) -> None:
    bar().save(tmp_path / "bar.vtu")
    with pytest.raises(ReferenceFileError, match=r"body\.pvd: DataSet 2 has timestep=.*not a finite number"):
        read_record(collection(tmp_path, ("0.5", "bar.vtu"), (time, "bar.vtu")))


def test_levels_stand_in_the_order_of_their_times(tmp_path: Path) -> None:
    grid = bar()
    for step in (1, 2, 3):
        grid.point_data["displacement"] = step * moved(np.asarray(grid.points))
        grid.save(tmp_path / f"step{step}.vtu")
    times = (("1.0", "step3.vtu"), ("0.3", "step1.vtu"), ("0.6", "step2.vtu"))
    record = read_record(collection(tmp_path, *times))
    assert [level.time for level in record.levels] == [0.3, 0.6, 1.0]
    largest = [np.abs(level.displacement).max() for level in record.levels]
    assert largest == pytest.approx(largest[0] * np.array([1, 2, 3]))
    assert record.notes == ("the times of body.pvd do not ascend and were sorted",)


# --- files that name others ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["../other.vtu", "/etc/hostname.vtu", "sub/../../other.vtu", "link.vtu", "C:/other.vtu", ""]
)
@pytest.mark.parametrize("form", ["pvd", "pvtu"])
def test_files_elsewhere_are_not_read(name: str, form: str, tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "sub").mkdir()
    bar().save(tmp_path / "other.vtu")
    (folder / "link.vtu").symlink_to(tmp_path / "other.vtu")
    if form == "pvd":
        file = collection(folder, ("1", name))
    else:
        file = folder / "body.pvtu"
        piece = f'<Piece Source="{name}"/>'
        file.write_text(f'<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid>{piece}</PUnstructuredGrid></VTKFile>')
    with pytest.raises(ReferenceFileError, match=r"body\.pvt?[du].* '.*(same folder or below|is not supported)"):
        read_record(file)


def test_files_below_are_read(tmp_path: Path) -> None:
    (tmp_path / "sub").mkdir()
    bar().save(tmp_path / "sub" / "bar.vtu")
    assert len(read_record(collection(tmp_path, ("1", "sub/bar.vtu"))).points) == 30


# --- what is damaged ----------------------------------------------------------------------------------------------


def test_a_block_that_is_larger_than_the_counts_need_is_refused_before_it_is_inflated(tmp_path: Path) -> None:
    """16 MiB of zeros in place of the points: neither the header's lie nor the block's size is believed."""
    bomb = zlib.compress(bytes(2**24))
    for told in (2**24, 24):
        header = np.array([1, told, 0, len(bomb)], dtype="<u8").tobytes()
        text = (
            '<VTKFile type="UnstructuredGrid" byte_order="LittleEndian" header_type="UInt64" '
            'compressor="vtkZLibDataCompressor"><UnstructuredGrid><Piece NumberOfPoints="1" NumberOfCells="0"><Points>'
            '<DataArray type="Float64" NumberOfComponents="3" format="appended" offset="0"/></Points><Cells/></Piece>'
            '</UnstructuredGrid><AppendedData encoding="raw">_'
        )
        (tmp_path / "bomb.vtu").write_bytes(text.encode() + header + bomb + b"</AppendedData></VTKFile>")
        with pytest.raises(MeshError, match=r"states 16777216 bytes, expected 24|more than the expected 24 bytes"):
            read_mesh(tmp_path / "bomb.vtu")


@pytest.mark.parametrize("make", [structured, rectilinear, bar])
def test_damage_of_any_kind_is_refused_or_changes_nothing_that_counts(make: Callable[[], Any], tmp_path: Path) -> None:
    """A flipped bit may change a name or a number of a text, and never more than raise the package's own error."""
    suffix = {structured: ".vts", rectilinear: ".vtr", bar: ".vtu"}[make]
    file, rng = tmp_path / f"grid{suffix}", np.random.default_rng(15)
    make().save(file)
    data, refused = file.read_bytes(), 0
    for end in rng.integers(0, len(data) - 12, 60).tolist():
        file.write_bytes(data[:end])
        with pytest.raises(TruespringError):
            read_mesh(file)
    for bit in rng.integers(0, 8 * len(data), 150).tolist():
        flipped = bytearray(data)
        flipped[bit // 8] ^= 1 << bit % 8
        file.write_bytes(flipped)
        try:
            read_mesh(file)
        except TruespringError:
            refused += 1
    assert refused > 50


def test_every_suffix_is_a_mesh_and_a_result() -> None:
    from truespring.mesh.files import FORMATS
    from truespring.reference.result import READERS

    assert VTK_FORMATS.keys() <= FORMATS.keys() and VTK_FORMATS.keys() <= READERS.keys()


# --- what we write -----------------------------------------------------------------------------------------------


def test_every_kind_of_cell_is_written_as_vtk_reads_it(tmp_path: Path) -> None:
    import pyvista as pv

    points, cells, first = [], {}, 0
    for number, (kind, shape) in enumerate(CELL_SHAPES.items()):
        for place in (0, 5):
            points.append(in_space(shape.places) + np.array([5.0 * number, place, 0.0]))
        n_nodes = len(shape.places)
        cells[kind] = first + np.arange(2 * n_nodes).reshape(2, n_nodes)
        first += 2 * n_nodes
    places = np.concatenate(points)
    point_arrays = {"moved": moved(places), 'a "<&> b': np.arange(first, dtype=np.uint8)}
    cell_arrays = {"stress": np.arange(18.0 * len(cells)).reshape(-1, 9), "part": np.arange(2 * len(cells))}
    file = tmp_path / "all.vtu"
    write_vtu(file, places, cells.items(), point_arrays, cell_arrays)

    by_vtk = pv.read(file)
    types = [shape.vtk_type for shape in CELL_SHAPES.values() for _ in (0, 1)]
    assert by_vtk.celltypes.tolist() == types and by_vtk.points.tolist() == places.tolist()
    for arrays, found in ((point_arrays, by_vtk.point_data), (cell_arrays, by_vtk.cell_data)):
        assert {name: found[name].tolist() for name in found} == {name: arrays[name].tolist() for name in arrays}
    sizes = by_vtk.compute_cell_sizes()
    assert np.abs(sizes["Length"] + sizes["Area"] + sizes["Volume"]).min() > 0.1
    for kind, nodes in cells.items():  # of a linear wedge VTK's first triangle goes round the other way
        order = [0, 2, 1, 3, 5, 4] if kind == "wedge" else slice(None)
        assert by_vtk.cells_dict[CELL_SHAPES[kind].vtk_type].tolist() == nodes[:, order].tolist()
    ours = named(contents(read_vtk_grid(file.read_bytes(), tmp_path)).cells, file)
    assert {kind: nodes.tolist() for kind, nodes in ours.items()} == {k: c.tolist() for k, c in cells.items()}


@pytest.mark.parametrize("n_points", [0, 1 << 17, (1 << 17) + 1, 300_000])
def test_arrays_of_any_length_are_written_in_blocks(n_points: int, tmp_path: Path) -> None:
    """A block holds 1 MiB: none, one that is full, and several, the last of which is not."""
    import pyvista as pv

    points, values = np.zeros((n_points, 1)), np.arange(n_points)
    write_vtu(tmp_path / "points.vtu", points, [], {"number": values})
    read = pv.read(tmp_path / "points.vtu")
    assert (read.n_points, read.n_cells) == (n_points, 0)
    assert n_points == 0 or (read.point_data["number"] == values).all()
    if n_points:
        assert (read_vtk_grid((tmp_path / "points.vtu").read_bytes(), tmp_path).point_arrays["number"] == values).all()
