"""Results in VTK files: series that truespring wrote, grids that VTK wrote, and what is damaged."""

from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.errors import ReferenceFileError
from truespring.mesh.cells import CELL_SHAPES
from truespring.reference.result import read_record
from truespring.reference.vtk import read_vtk_result
from truespring.report.series import write_series


@pytest.fixture(scope="module")
def problem() -> ts.Problem:
    return ts.Problem(
        mesh=ts.rectangle((0.04, 0.02), (4, 2)),
        material=ts.Material(1e4, 1 / 3),
        section=ts.PlaneStress(0.01),
        supports=ts.Fixed("left"),
        loads=ts.Force("right", (0.0, -0.02)),
    )


@pytest.mark.parametrize("kind", ["fem", "springs"])
def test_our_own_series_is_the_path_again(kind: str, problem: ts.Problem, tmp_path: Path) -> None:
    model = ts.Fem("saint-venant-kirchhoff") if kind == "fem" else ts.Springs("lloyd")
    path = ts.solve(problem, model, ts.Newton(load_steps=3))
    write_series(path, tmp_path, "body")
    told: list[float] = []
    record = read_record(tmp_path / "body.pvd", reading=told.append)
    assert record.kind == "pvd" and [level.time for level in record.levels] == [one.load_factor for one in path.states]
    assert len(told) == len(path.states) and told == sorted(told) and told[-1] == 1.0
    np.testing.assert_array_equal(record.points[:, :2], problem.mesh.nodes)
    for level, state in zip(record.levels, path.states, strict=True):
        np.testing.assert_array_equal(level.displacement[:, :2], state.displacement)
        assert level.energy == (pytest.approx(state.energy, rel=1e-12) if kind == "fem" else None)
    name, cells = ("quad", problem.mesh.elements) if kind == "fem" else ("line", path.potential.springs)
    np.testing.assert_array_equal(record.cells[name], cells)
    alone = read_record(tmp_path / "body" / "body_0002.vtu")
    assert alone.kind == "vtu" and [level.time for level in alone.levels] == [1.0]


def write_grid(file: Path, name: str = "U", binary: bool = True, **more: np.ndarray) -> np.ndarray:
    """Write one cell of each of three kinds and a vertex by VTK; return the displacement."""
    import pyvista

    cells, types, points = [], [], []
    first = 0
    for kind, number in (("hexahedron20", 25), ("wedge15", 26), ("tetra10", 24)):
        places = CELL_SHAPES[kind].places + np.array([3.0 * len(types), 0.0, 0.0])
        points.append(places)
        cells += [len(places), *range(first, first + len(places))]
        types.append(number)
        first += len(places)
    cells += [1, 0]
    grid = pyvista.UnstructuredGrid(np.array(cells), np.array([*types, 1]), np.concatenate(points))
    moved = 0.01 * np.sin(np.arange(3.0 * first)).reshape(-1, 3)
    grid.point_data[name] = moved
    grid.point_data["temperature"] = np.arange(float(first))
    grid.cell_data["strain_energy"] = np.ones(4)
    for other, values in more.items():
        grid.point_data[other] = values
    grid.save(file, binary=binary)
    return moved


@pytest.mark.parametrize("binary", [True, False])
@pytest.mark.parametrize("suffix", [".vtu", ".vtk", ".VTU"])
def test_grids_that_vtk_wrote(suffix: str, binary: bool, tmp_path: Path) -> None:
    file = tmp_path / f"grid{suffix.lower()}"
    moved = write_grid(file, binary=binary)
    if suffix.isupper():
        file = file.rename(tmp_path / f"grid{suffix}")
    record = read_record(file)
    np.testing.assert_allclose(record.levels[0].displacement, moved, rtol=1e-6)
    assert {name: cells.shape for name, cells in record.cells.items()} == {
        "hexahedron20": (1, 20),
        "wedge15": (1, 15),
        "tetra10": (1, 10),
    }
    assert record.cells["tetra10"].tolist() == [list(range(35, 45))]
    assert record.levels[0].energy is None  # what others call so may be a density


def test_the_displacement_is_named_where_it_is_not_plain(tmp_path: Path) -> None:
    file = tmp_path / "grid.vtu"
    write_grid(file, "velocity")
    with pytest.raises(ReferenceFileError, match=r"vectors of the points are velocity, none .* displacement.*by field"):
        read_vtk_result(file)
    with pytest.raises(ReferenceFileError, match=r"no vector 'velocty' \(did you mean 'velocity'\?\)"):
        read_vtk_result(file, field="velocty")
    with pytest.raises(ReferenceFileError, match="no vector 'temperature'; vectors of the points are velocity"):
        read_vtk_result(file, field="temperature")
    moved = write_grid(file, "Displacement", DISP=np.ones((45, 3)))
    with pytest.raises(ReferenceFileError, match="Displacement and DISP may all be the displacement"):
        read_vtk_result(file)
    np.testing.assert_array_equal(read_vtk_result(file, field="Displacement").levels[0].displacement, moved)
    write_grid(file, "DISP")
    assert len(read_record(file).levels) == 1
    with pytest.raises(ReferenceFileError, match=r"field .* \.csv files, only to \.vtu, \.vtk, .*, \.pvd"):
        read_record(tmp_path / "markers.csv", field="DISP")


def test_cells_without_our_shape_functions_are_refused(tmp_path: Path) -> None:
    import pyvista

    file = tmp_path / "grid.vtu"
    places = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0.5, 1.5, 0], [0, 1, 0]])
    grid = pyvista.UnstructuredGrid(np.array([5, 0, 1, 2, 3, 4]), np.array([7]), places)
    grid.point_data["u"] = places
    grid.save(file)
    with pytest.raises(ReferenceFileError, match=r"grid.vtu: cells of VTK's type 7 are not supported; .*: line, "):
        read_vtk_result(file)


@pytest.mark.parametrize("suffix", [".vtu", ".vtk"])
def test_another_file_is_an_error(suffix: str, tmp_path: Path) -> None:
    file = tmp_path / f"grid{suffix}"
    write_grid(file)
    for other in (b"solid body\nendsolid\n", bytes(range(256)) * 10, file.read_bytes().replace(b"U", b"W")):
        file.write_bytes(other)
        with pytest.raises(ReferenceFileError, match=f"grid{suffix}"):
            read_vtk_result(file)


def test_a_series_has_one_mesh_at_rest(problem: ts.Problem, tmp_path: Path) -> None:
    import pyvista

    path = ts.solve(problem, ts.Fem("linear"), ts.Newton(load_steps=2))
    write_series(path, tmp_path, "body")
    file, last = tmp_path / "body.pvd", sorted((tmp_path / "body").iterdir())[-1]
    text, grid = file.read_text(), pyvista.read(last)
    wrong = {
        "no .pvd file": text[:90],
        "refers to no file": "<VTKFile><Collection/></VTKFile>",
        'has timestep="soon"': text.replace('timestep="1.0"', 'timestep="soon"'),
        "names 'body/body_0009.vtu'": text.replace("body_0002", "body_0009"),
        r"refers to 'body/body_0002.vti', .* supported: .vtu, .vtk": text.replace("body_0002.vtu", "body_0002.vti"),
        "time 1 is defined twice: merge": text.replace('timestep="0.5"', 'timestep="1.0"'),
    }
    for message, damaged in wrong.items():
        assert damaged != text
        file.write_text(damaged)
        with pytest.raises(ReferenceFileError, match=message):
            read_vtk_result(file)
    file.write_text(text)
    warped = grid.copy()
    warped.points = grid.points + grid.point_data["displacement"]
    warped.save(last)
    with pytest.raises(ReferenceFileError, match=r"differ from those of body_0000.vtu.*before it is warped"):
        read_vtk_result(file)
    shuffled = pyvista.UnstructuredGrid({9: grid.cells_dict[9][::-1]}, grid.points)
    shuffled.point_data["displacement"] = grid.point_data["displacement"]
    shuffled.save(last)
    with pytest.raises(ReferenceFileError, match="cells differ from those of body_0000"):
        read_vtk_result(file)
    last.write_bytes(b"")
    with pytest.raises(ReferenceFileError, match=r"body_0002.vtu is empty"):
        read_vtk_result(file)
