"""A file is read as what its content is, whatever it is called."""

import gzip
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.errors import MeshError, ReferenceFileError
from truespring.mesh.files import FORMATS, read_mesh
from truespring.reference import READERS, format_of, read_record

DATA = Path(__file__).parent / "data"
MESHES = {
    ".msh": ["block_41.msh", "block_41_binary.msh", "block_22.msh"],
    ".inp": ["beam.inp", "block.inp"],
    ".vtu": ["block.vtu", "quads_raw.vtu"],
    ".vtk": ["block.vtk", "block_51_binary.vtk"],
}


@pytest.mark.parametrize("suffix", [*MESHES, ".txt", "", ".VTK"])
@pytest.mark.parametrize("key", MESHES)
def test_a_mesh_is_read_by_its_content(tmp_path: Path, key: str, suffix: str) -> None:
    name = MESHES[key][0]
    shutil.copyfile(DATA / name, tmp_path / f"mesh{suffix}")
    found, wanted = read_mesh(tmp_path / f"mesh{suffix}"), read_mesh(DATA / name)
    assert (found.nodes == wanted.nodes).all() and (found.elements == wanted.elements).all()
    told = [note for note in found.notes if note.startswith(f"read as a {key} file")]
    assert len(told) == (suffix.lower() != key) and [*told, *wanted.notes] == list(found.notes)


def test_a_damaged_mesh_is_refused_as_what_its_content_is(tmp_path: Path) -> None:
    data = (DATA / "block_41.msh").read_bytes()
    (tmp_path / "mesh.vtk").write_bytes(data[: len(data) // 2])
    with pytest.raises(MeshError, match=r"mesh\.vtk: line \d+: \$"):
        read_mesh(tmp_path / "mesh.vtk")
    (tmp_path / "mesh.vtk").write_bytes(b"nothing of the kind\n")
    neither = (
        r"mesh\.vtk: this is no \.vtk file.*; its content does not match \.msh, \.inp, .* files either; if ParaView"
    )
    with pytest.raises(MeshError, match=neither):
        read_mesh(tmp_path / "mesh.vtk")
    (tmp_path / "mesh.obj").write_bytes(b"v 0 0 0\n")
    both = r"a mesh file .* \.msh, .*, not '\.obj', .* none of these"
    with pytest.raises(MeshError, match=both):
        read_mesh(tmp_path / "mesh.obj")


@pytest.mark.parametrize("name", ["mesh.vtk", "mesh.msh", "mesh.inp", "mesh.stl"])
def test_a_surface_or_a_packed_file_is_refused_with_the_way_to_a_mesh(name: str, tmp_path: Path) -> None:
    surfaces = (
        bytes(80) + (1).to_bytes(4, "little") + bytes(50),
        b"solid box\n facet normal 0 0 1\n  outer loop\n",
        b"ply\nformat ascii 1.0\n",
    )
    for data, way in (*((one, "mesher") for one in surfaces), (gzip.compress(b"$MeshFormat\n"), "gunzip")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(MeshError, match=way):
            read_mesh(tmp_path / name)


def test_comments_may_stand_before_what_tells_the_format(tmp_path: Path) -> None:
    for key, comment in ((".msh", "$Comments\n*NODE\n$EndComments\n"), (".inp", "** $MeshFormat\n\n** x\n" * 9000)):
        text = comment + (DATA / MESHES[key][0]).read_text()
        (tmp_path / "mesh.vtk").write_text(text)
        assert read_mesh(tmp_path / "mesh.vtk").notes[0].startswith(f"read as a {key} file")
    xml = '<?xml version="1.0"?>\n<!-- by\nsomeone -->\n' + (DATA / "quads_ascii.vtu").read_text()
    assert FORMATS[".vtu"].recognises(xml.encode())
    assert not FORMATS[".vtu"].recognises(b"<!-- -->" * 1000 + b"<html>")


@pytest.mark.parametrize("key", [key for key, form in READERS.items() if form.is_marked])
def test_a_result_of_neither_form_is_refused_by_both(tmp_path: Path, key: str) -> None:
    (tmp_path / f"result{key}").write_bytes(b"nothing of the kind\n")
    (tmp_path / "result.inp").write_text("*NODE\n1,0,0\n2,1,0\n3,1,1\n*ELEMENT,TYPE=CPS3\n1,1,2,3\n")
    others = [other for other in READERS if other != key]
    with pytest.raises(ReferenceFileError, match=rf"its content does not match {re.escape(others[0])}, .* either"):
        read_record(tmp_path / f"result{key}")


@pytest.mark.parametrize("key", READERS)
def test_a_suffix_stands_for_its_format_in_any_case_and_no_other_does(tmp_path: Path, key: str) -> None:
    """Of files that no format recognises."""
    for file in (tmp_path / f"result{key.upper()}", tmp_path / f"result{key}"):
        assert format_of(file) == key
        file.write_bytes(b"nothing of the kind\n")
        assert format_of(file) == key
    for name in ("none.out", f"none{key}s", "none"):
        assert format_of(tmp_path / name) is None
        (tmp_path / name).write_bytes(b"nothing of the kind\n")
        assert format_of(tmp_path / name) is None


@pytest.mark.parametrize("key", [".vtu", ".vtk", ".pvd"])
def test_a_result_is_read_by_its_content(tmp_path: Path, key: str) -> None:
    """SOFA's Bunny.vtk holds VTK's XML."""
    meshio = pytest.importorskip("meshio")
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    grid = meshio.Mesh(points, [("tetra", np.array([[0, 1, 2, 3]]))], point_data={"displacement": 0.1 * points})
    grid.write(tmp_path / "whole.vtu")
    grid.write(tmp_path / "whole.vtk", file_format="vtk42")
    (tmp_path / "whole.pvd").write_text(
        '<VTKFile type="Collection"><Collection><DataSet timestep="1" file="whole.vtu"/></Collection></VTKFile>'
    )
    for suffix in (".vtk", ".vtu", ".frd", ".out"):
        shutil.copyfile(tmp_path / f"whole{key}", tmp_path / f"result{suffix}")
        record = read_record(tmp_path / f"result{suffix}")
        assert record.kind == key[1:] and record.levels[0].displacement == pytest.approx(0.1 * points)
        assert [note[: len("read as a ....")] for note in record.notes] == [f"read as a {key}"] * (suffix != key)
    with pytest.raises(ReferenceFileError, match="undeformed .*" + re.escape(key)):
        read_record(tmp_path / "result.out", undeformed=tmp_path / "whole.vtu")
    path = ts.read_result(tmp_path / "result.out")
    assert path.states[-1].displacement == pytest.approx(0.1 * points)
