"""What solutions write: files read back by other libraries, tables and arrays."""

import csv
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest

import truespring as ts
from truespring.errors import MeshError, OutputError
from truespring.report.series import write_series


def solved(*, size: tuple[float, ...] = (0.04, 0.01), model: ts.Springs | ts.Fem | None = None) -> ts.Solution:
    flat = len(size) == 2
    mesh = ts.rectangle(size, (8, 2)) if flat else ts.box(size, (4, 1, 1))
    problem = ts.Problem(
        mesh,
        ts.Material(10e3, 0.3),
        ts.PlaneStress(0.01) if flat else None,
        [ts.Fixed("left")],
        [ts.Force("right", (0.0, -0.01) if flat else (0.0, -0.01, 0.0))],
    )
    return ts.solve(problem, model or ts.Springs("lloyd"), ts.Newton(2))


@pytest.fixture(scope="module")
def strip() -> ts.Solution:
    return solved()


@pytest.fixture(scope="module")
def block() -> ts.Solution:
    return solved(size=(0.04, 0.01, 0.01), model=ts.Fem("saint-venant-kirchhoff"))


def test_pvd_and_vtu_are_the_files_of_verify(strip: ts.Solution, tmp_path: Path) -> None:
    write_series(strip, tmp_path, "springs")
    assert strip.write(tmp_path / "new" / "springs.pvd") == tmp_path / "new" / "springs.pvd"
    for file in tmp_path.glob("springs*/*"):
        assert (tmp_path / "new" / "springs" / file.name).read_bytes() == file.read_bytes()
    assert (tmp_path / "new" / "springs.pvd").read_bytes() == (tmp_path / "springs.pvd").read_bytes()
    strip.write(tmp_path / "one.vtu", level=1)
    read = meshio.read(tmp_path / "one.vtu")
    assert read.point_data["displacement"][:, :2] == pytest.approx(strip.states[1].displacement)


def test_stl_has_the_area_and_volume_of_the_body(block: ts.Solution, tmp_path: Path) -> None:
    triangles = meshio.read(block.write(str(tmp_path / "block.stl")))
    corners = triangles.points[triangles.cells_dict["triangle"]]
    volume = np.einsum("ni,ni->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6  # divergence theorem
    mesh = block.problem.mesh
    assert volume == pytest.approx(mesh.measures_at(block.states[-1].positions).sum(), rel=1e-2)  # faces are not flat
    block.write(tmp_path / "rest.stl", level=0)
    assert np.ptp(meshio.read(tmp_path / "rest.stl").points, axis=0) == pytest.approx([0.04, 0.01, 0.01])


def test_csv_is_read_back_by_compare(strip: ts.Solution, tmp_path: Path) -> None:
    file = strip.write(tmp_path / "strip.csv")
    with file.open(encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    assert rows[0] == ["load_factor", "marker", "x [m]", "y [m]", "ux [m]", "uy [m]"]
    assert len(rows) == 1 + len(strip.states) * strip.problem.mesh.n_nodes
    assert [float(one) for one in rows[-1][4:]] == strip.states[-1].displacement[-1].tolist()
    again = ts.read_result(file)
    comparison = ts.compare(strip, again)
    assert again.load_factors.tolist() == strip.load_factors.tolist()
    assert comparison.load_factors.tolist() == [0.5, 1.0] and comparison.rms_errors.max() < 1e-14


def test_other_suffixes_and_bodies_are_errors(strip: ts.Solution, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"x\.vtk: the suffix is \.pvd, \.vtkhdf, \.vtu, .*did you mean '\.vtu'"):
        strip.write(tmp_path / "x.vtk")
    assert not list(tmp_path.iterdir())
    (tmp_path / "taken.csv").mkdir()
    for file in (tmp_path / "taken.csv", Path(__file__) / "x.vtu"):
        with pytest.raises(OutputError, match="cannot be written: "):
            strip.write(file)
    surface = ts.read_stl(strip.problem, strip.write(tmp_path / "strip.stl"))
    with pytest.raises(OutputError, match=r"strip\.stl is a surface without displacements: write \.stl or \.vtu"):
        surface.write(tmp_path / "x.csv")
    again = meshio.read(surface.write(tmp_path / "surface.vtu"))
    assert len(again.cells_dict["triangle"]) == 2 * len(strip.problem.mesh.elements)
    with pytest.raises(OutputError, match="without load levels"):
        surface.table()


def test_the_table_has_closed_forms(strip: ts.Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    table = strip.table(probe=0)
    assert table.attrs["units"]["energy"] == "J" and table["load_factor"].tolist() == [0.0, 0.5, 1.0]
    assert (table[["ux", "uy"]] == 0).all(axis=None)  # node 0 is clamped
    assert table["fy"].to_numpy() == pytest.approx([0.0, -0.005, -0.01]) and set(table["state"]) == {"stable"}
    tip, near = strip.table("right-middle"), strip.table((0.039, 0.0051))
    assert (tip == near).all(axis=None) and tip["uy"].iloc[-1] < -0.001
    with pytest.raises(MeshError, match=r"point \(nan, 0\): 2 coordinates are expected"):
        strip.table(probe=(float("nan"), 0))
    with pytest.raises(MeshError, match=r"probe = 27: nodes are 0 to 26; or a point such as 'right-middle'"):
        strip.table(27)
    moved = strip.table()  # of the node that moves most
    largest = np.linalg.norm(strip.states[-1].displacement, axis=1).max()
    assert np.hypot(*moved[["ux", "uy"]].iloc[-1]) == pytest.approx(largest)
    # The work of the load F: F u minus the integral of u over F, by Simpson's rule; u is that of the loaded side.
    side = np.flatnonzero(strip.problem.mesh.nodes[:, 0] == 0.04)
    half, full = (state.displacement[side, 1] @ [0.25, 0.5, 0.25] for state in strip.states[1:])
    assert table["energy"].iloc[-1] == pytest.approx(-0.01 * (full - (4 * half + full) / 6), rel=0.01)
    monkeypatch.setitem(sys.modules, "pandas", None)
    pytest.importorskip("polars")
    other = strip.table(probe=0)
    assert type(other).__module__.startswith("polars") and other["fy"].to_list() == table["fy"].tolist()
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(OutputError, match="neither pandas nor polars is installed: pip install"):
        strip.table()


def test_arrays_of_xarray_carry_units(block: ts.Solution) -> None:
    pytest.importorskip("xarray")
    arrays = block.to_xarray()
    assert dict(arrays.sizes) == {"node": 20, "component": 3, "level": 3}
    assert (np.stack([arrays.x, arrays.y, arrays.z], axis=1) == block.problem.mesh.nodes).all()
    right = arrays.displacement.where(arrays.x > 0.039, drop=True)
    assert float(right.sel(component="y").isel(level=-1).mean()) < 0
    total = arrays.reaction.sum("node").sel(component="y")
    assert total.values == pytest.approx([0, 0.005, 0.01], abs=1e-8)  # the supports carry the load
    assert arrays.displacement.attrs["units"] == "m" and arrays.reaction.attrs["units"] == "N"
    assert arrays.load_factor.values.tolist() == [0, 0.5, 1]


def test_a_motion_has_times() -> None:
    problem = ts.Problem(
        ts.rectangle((0.02, 0.01), (2, 1)),
        ts.Material(10e3, 0.3, density=1000.0),
        ts.PlaneStress(0.01),
        loads=[ts.Gravity((0.0, -9.81))],
        dynamics=ts.Dynamics(duration=0.02, step=0.01, record=0.01, scheme="midpoint"),
    )
    fall = ts.solve(problem, ts.Springs("gaussian"))
    assert fall.table()["time"].tolist() == pytest.approx([0.0, 0.01, 0.02])
    pytest.importorskip("xarray")
    arrays = fall.to_xarray()
    assert arrays.velocity.sel(component="y").values == pytest.approx(
        -9.81 * arrays.time.values[:, None] * np.ones(6), rel=1e-6
    )
