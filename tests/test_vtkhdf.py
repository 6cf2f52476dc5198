"""Results as .vtkhdf: written by us and read by VTK and h5py, and the other way round."""

import sys
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import pyvista as pv
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOHDF import vtkHDFReader

import truespring as ts
from truespring.errors import OutputError, ReferenceFileError
from truespring.reference import read_record


def _problem(mesh: ts.Mesh) -> ts.Problem:
    return ts.Problem(mesh, ts.Material(10e3, 0.3), None, [ts.Fixed("left")], [ts.Force("right", (0.0, -0.01, 0.0))])


@pytest.fixture(scope="module")
def wedges() -> ts.Solution:
    mesh = ts.box((0.04, 0.01, 0.01), (4, 1, 1), element="wedge")
    return ts.solve(_problem(mesh), ts.Fem("saint-venant-kirchhoff"), ts.Newton(3))


def test_vtk_reads_each_level(wedges: ts.Solution, tmp_path: Path) -> None:
    """The same as of the .vtu files, which it reads, too."""
    file = wedges.write(tmp_path / "body.vtkhdf")
    reader: Any = vtkHDFReader()
    reader.SetFileName(str(file))
    reader.UpdateInformation()
    times = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
    assert times == pytest.approx([0, 1 / 3, 2 / 3, 1], abs=1e-15)
    volume = wedges.problem.mesh.measures.sum()
    for number, state in enumerate(wedges.states):
        reader.UpdateTimeStep(times[number])
        grid: Any = pv.wrap(reader.GetOutputDataObject(0))
        other = pv.read(wedges.write(tmp_path / "one.vtu", level=number))
        assert np.array_equal(grid.points, other.points) and np.array_equal(grid.cells, other.cells)
        assert np.array_equal(grid.celltypes, other.celltypes)
        assert abs(grid.compute_cell_sizes()["Volume"].sum()) == pytest.approx(volume)
        assert np.array_equal(grid["displacement"], state.displacement)
        assert {*grid.array_names} - {"Time"} == {*other.array_names}  # the reader adds the time to the field data
        for name in other.array_names:
            assert np.array_equal(grid[name], other[name]), name


def test_the_body_is_stored_once(wedges: ts.Solution, tmp_path: Path) -> None:
    springs = ts.solve(_problem(wedges.problem.mesh), ts.Springs("gaussian"), ts.Newton(2))
    mesh = springs.problem.mesh
    with h5py.File(springs.write(tmp_path / "body.vtkhdf")) as root:
        grid = root["VTKHDF"]
        assert grid.attrs["Type"] == b"UnstructuredGrid" and grid.attrs["Version"].tolist() == [2, 0]
        assert h5py.check_string_dtype(grid.attrs.get_id("Type").dtype).length == 16  # of fixed length
        n_points, n_cells, n_ids = (
            grid[f"NumberOf{what}"][:].tolist() for what in ("Points", "Cells", "ConnectivityIds")
        )
        assert n_points == [mesh.n_nodes] == [len(grid["Points"])]
        assert n_cells == [len(grid["Types"])] == [len(grid["Offsets"]) - 1]
        assert n_ids == [len(grid["Connectivity"])] and grid["Offsets"][-1] == n_ids[0]
        steps = grid["Steps"]
        assert steps.attrs["NSteps"] == 3 and steps["NumberOfParts"][:].tolist() == [1, 1, 1]
        for name in ("PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"):
            assert steps[name].shape[0] == 3 and not steps[name][:].any(), name
        moved = steps["PointDataOffsets/displacement"][:].tolist()
        assert moved == [0, mesh.n_nodes, 2 * mesh.n_nodes]
        assert np.array_equal(grid["PointData/displacement"][moved[2] :], springs.states[2].displacement)
        assert len(grid["CellData/stiffness"]) == n_cells[0]  # does not change from level to level
        assert steps["CellDataOffsets/stiffness"][:].tolist() == [0, 0, 0]
        stretch = steps["CellDataOffsets/strain_energy"][:].tolist()
        assert stretch == [0, n_cells[0], 2 * n_cells[0]]


def test_compare_reads_it_back(wedges: ts.Solution, tmp_path: Path) -> None:
    file = wedges.write(tmp_path / "body.vtkhdf")
    again = ts.read_result(file)
    assert again.load_factors == pytest.approx(wedges.load_factors)
    comparison = ts.compare(wedges, again)
    assert len(comparison.load_factors) == 3 and comparison.rms_errors.max() < 1e-14
    energies = [level.energy for level in read_record(file).levels]
    assert energies == pytest.approx([state.energy for state in wedges.states], rel=1e-9, abs=1e-12 * energies[-1])


def test_a_surface_and_a_motion_are_written(tmp_path: Path) -> None:
    problem = ts.Problem(
        ts.rectangle((0.02, 0.01), (2, 1)),
        ts.Material(10e3, 0.3, density=1000.0),
        ts.PlaneStress(0.01),
        loads=[ts.Gravity((0.0, -9.81))],
        dynamics=ts.Dynamics(duration=0.02, step=0.01, record=0.01, scheme="midpoint"),
    )
    fall = ts.solve(problem, ts.Springs("gaussian"))
    record = read_record(fall.write(tmp_path / "fall.vtkhdf"))
    assert [level.time for level in record.levels] == pytest.approx([0.0, 0.01, 0.02])
    assert record.levels[-1].displacement[:, 1] == pytest.approx(-9.81 / 2 * 0.02**2, rel=1e-6)
    surface = ts.read_stl(problem, fall.write(tmp_path / "fall.stl"))
    grid = pv.read(surface.write(tmp_path / "surface.vtkhdf"))
    assert isinstance(grid, pv.UnstructuredGrid) and grid.area == pytest.approx(2e-4)


def test_parts_of_other_programs_are_joined(tmp_path: Path) -> None:
    """Two tetrahedra that share a face, in two parts, the second step in arrays behind those of the first."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    steps = np.arange(2)
    with h5py.File(tmp_path / "parts.vtkhdf", "w") as root:
        grid = root.create_group("VTKHDF")
        grid.attrs["Version"], grid.attrs["Type"] = [2, 0], np.bytes_("UnstructuredGrid")
        grid["NumberOfPoints"], grid["NumberOfCells"], grid["NumberOfConnectivityIds"] = [4] * 4, [1] * 4, [4] * 4
        grid["Points"], grid["Types"] = np.tile(points, (2, 1)), np.full(4, 10, dtype=np.uint8)
        grid["Connectivity"], grid["Offsets"] = np.tile(np.arange(4), 4), np.tile([0, 4], 4)
        grid["PointData/displacement"] = np.concatenate([0 * points, 0.1 * points])
        for name, size in (("Part", 2), ("Point", 8), ("Cell", 2), ("ConnectivityId", 8)):
            grid[f"Steps/{name}Offsets"] = size * steps
        grid["Steps"].attrs["NSteps"] = 2
        grid["Steps/NumberOfParts"], grid["Steps/Values"] = [2, 2], [0.5, 1.0]
        grid["Steps/PointDataOffsets/displacement"] = 8 * steps
    record = read_record(tmp_path / "parts.vtkhdf")
    assert [level.time for level in record.levels] == [0.5, 1.0] and record.points.shape == (5, 3)
    assert record.cells["tetra"].shape == (2, 4) and not record.levels[0].displacement.any()
    assert record.levels[1].displacement == pytest.approx(0.1 * record.points)


def test_other_files_are_errors(wedges: ts.Solution, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "body.vtkhdf"
    with h5py.File(file, "w") as root:
        root["other"] = [1]
    with pytest.raises(ReferenceFileError, match=r"body\.vtkhdf is an HDF5 file, but not of VTK"):
        read_record(file)
    pv.Sphere().save(tmp_path / "ball.vtkhdf")
    with pytest.raises(ReferenceFileError, match=r"type 'PolyData', supported is UnstructuredGrid: in ParaView"):
        read_record(tmp_path / "ball.vtkhdf")
    wedges.write(file)
    with h5py.File(file, "r+") as root:
        root["VTKHDF/Connectivity"].resize(3, axis=0)
    with pytest.raises(ReferenceFileError, match=r"or a damaged one: /VTKHDF/Connectivity has 3 rows, 48 are needed"):
        read_record(file)
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(ReferenceFileError, match=r"pip install 'truespring\[vtkhdf\]'"):
        read_record(file)
    with pytest.raises(OutputError, match=r"pip install 'truespring\[vtkhdf\]'"):
        wedges.write(file)
