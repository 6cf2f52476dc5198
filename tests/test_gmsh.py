"""Files of gmsh: every version and form holds the same mesh, what is not needed is passed over, what lacks is told."""

import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.errors import MeshError
from truespring.mesh.files import read_mesh

DATA = Path(__file__).parent / "data"
needs_gmsh = pytest.mark.skipif(shutil.which("gmsh") is None, reason="gmsh is not installed")

POINTS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
FORMAT_1 = (
    "$NOD\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$ENDNOD\n$ELM\n2\n1 2 7 1 3 1 2 3\n2 4 1 1 4 1 2 3 4\n$ENDELM\n"
)


def text(version: str, names: str = '2 7 "base"\n3 1 "body"') -> str:
    """One tetrahedron and its base in a version of the second format."""
    nodes = FORMAT_1[5 : FORMAT_1.index("$END")]
    named = f"$PhysicalNames\n{len(names.splitlines())}\n{names}\n$EndPhysicalNames\n" if names else ""
    elements = "$Elements\n2\n1 2 2 7 1 1 2 3\n2 4 2 1 1 1 2 3 4\n$EndElements\n"
    return f"$MeshFormat\n{version} 0 8\n$EndMeshFormat\n{named}$Nodes\n{nodes}$EndNodes\n{elements}"


def binary(rest: bytes, order: str = "<") -> bytes:
    """The same tetrahedron in binary 2.2, without its base, and what follows."""
    nodes = b"".join(struct.pack(f"{order}i3d", number, *at) for number, at in enumerate(POINTS, 1))
    cell = struct.pack(f"{order}3i7i", 4, 1, 2, 1, 3, 1, 1, 2, 3, 4)
    one = struct.pack(f"{order}i", 1)
    return (
        b"$MeshFormat\n2.2 1 8\n" + one + b"\n$EndMeshFormat\n"
        b"$Nodes\n4\n" + nodes + b"$EndNodes\n$Elements\n1\n" + cell + b"$EndElements\n" + rest
    )


def read(tmp_path: Path, content: str | bytes) -> ts.Mesh:
    (tmp_path / "mesh.msh").write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_mesh(tmp_path / "mesh.msh")


def described(mesh: ts.Mesh) -> dict[str, object]:
    """A mesh by places, whatever the order of nodes and elements."""
    centres = mesh.centres.round(9)
    facets = {
        name: sorted(map(tuple, mesh.nodes[mesh.facet_nodes(of)].mean(axis=1).round(9).tolist()))
        for name, of in mesh.facet_groups.items()
    }
    return {
        "nodes": sorted(map(tuple, mesh.nodes.round(9).tolist())),
        "centres": sorted(map(tuple, centres.tolist())),
        "element groups": {n: sorted(map(tuple, centres[of].tolist())) for n, of in mesh.element_groups.items()},
        "node groups": {n: sorted(map(tuple, mesh.nodes[of].round(9).tolist())) for n, of in mesh.node_groups.items()},
        "facet groups": facets,
    }


@pytest.mark.parametrize("version", ["2", "2.0", "2.1", "2.2", "2.20"])
def test_versions_are_numbers(tmp_path: Path, version: str) -> None:
    mesh = read(tmp_path, text(version))
    assert mesh.measures.sum() == pytest.approx(1 / 6) and not mesh.notes
    assert {name: len(of) for name, of in mesh.node_groups.items()} == {"base": 3, "body": 4}
    assert mesh.facet_groups["base"].tolist() == [[0, 0]]


def test_the_first_format_and_names_without_a_dimension(tmp_path: Path) -> None:
    mesh = read(tmp_path, FORMAT_1)
    assert described(mesh) == described(read(tmp_path, text("2.2", names="")))
    assert described(read(tmp_path, text("2", '7 "base"\n1 "body"'))) == described(read(tmp_path, text("2.2")))
    with_parameters = FORMAT_1.replace("2 1 0 0", "2 1 0 0 1 12 0.5").replace("1 0 0 0", "1 0 0 0 0 3")
    assert described(read(tmp_path, with_parameters)) == described(mesh)
    for old, new, why in (
        ("4 1 1 4 1 2 3 4", "4 1 1 5 1 2 3 4", "line 11: an element has 5 nodes"),
        ("$ENDNOD", "$ENDNOT", "line 7: expected .EndNOD"),
        ("2 1 0 0\n", "2 1 0\n", "line 4: .NOD needs 4 numbers"),
    ):
        with pytest.raises(MeshError, match=why):
            read(tmp_path, FORMAT_1.replace(old, new))


@pytest.mark.parametrize("version", ["3", "4.2", "1.0", "x"])
def test_other_versions_are_refused_with_the_way_out(tmp_path: Path, version: str) -> None:
    with pytest.raises(
        MeshError,
        match=rf"version {version} of \.msh .* 1, 2 to 2.2, 4 and 4.1; .*gmsh FILE -0 -format msh41",
    ):
        read(tmp_path, text(version))
    with pytest.raises(MeshError, match=r"version 4 of \.msh .* as text only.* binary; .*-format msh41"):
        read(tmp_path, text("4").replace("4 0 8", "4 1 8"))


# What stands before the data of a section: texts, reals and integers (time step, components, rows).
TAGS = b'1\n"color"\n1\n0.0\n3\n0\n%d\n%d\n'
HIDDEN = b"\n$EndNodeData\n$EndElementData\n$EndElementNodeData\n".ljust(56)


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("end", [b"", b"\n", b"\r\n"])
@pytest.mark.parametrize("name", [b"NodeData", b"ElementData", b"ElementNodeData"])
def test_binary_data_is_passed_over_by_its_length(tmp_path: Path, name: bytes, end: bytes, order: str) -> None:
    """The end mark may follow without a line end, and the data may hold what looks like one."""
    head = struct.pack(f"{order}i", 1) if name != b"ElementNodeData" else struct.pack(f"{order}2i", 1, 1)
    section = b"$%s\n" % name + TAGS % (7, 1) + head + HIDDEN + end + b"$End%s\n" % name
    mesh = read(tmp_path, binary(section + b"$Periodic\n0\n$EndPeriodic\n", order))
    assert mesh.measures.tolist() == pytest.approx([1 / 6]) and mesh.node_groups["3"].size == 4
    cut = binary(section, order)[: -len(name) - 5]
    with pytest.raises(MeshError, match=rf"\$End{name.decode()} is missing: the file is truncated"):
        read(tmp_path, cut)


def test_what_was_not_saved_is_told(tmp_path: Path) -> None:
    """A physical group for surfaces, and none for the volume, saves the surfaces only."""
    corners = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    sides = [(0, 1, 3), (0, 3, 2), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4)]
    nodes = "\n".join(f"{row} {x} {y} {z}" for row, (x, y, z) in enumerate(corners, 1))

    def surface(chosen: slice, group: int, names: str = "") -> str:
        cells = [" ".join(map(str, (row, 2, 2, group, 1, *(c + 1 for c in side)))) for row, side in enumerate(sides, 1)]
        body = "\n".join(cells[chosen])
        head = f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n{names}$Nodes\n8\n{nodes}\n$EndNodes\n"
        return f"{head}$Elements\n{len(cells[chosen])}\n{body}\n$EndElements\n"

    hint = r"add the body \(a volume, or a plane surface\) to one, or set Mesh.SaveAll = 1"
    with pytest.raises(MeshError, match=f"surface in space.*{hint}"):
        read(tmp_path, surface(slice(None), 7))
    with pytest.raises(MeshError, match=f"plane of constant y: .*{hint}"):
        read(tmp_path, surface(slice(4, 6), 7))
    with pytest.raises(MeshError, match=r"surface in space.*mesh the volume too: gmsh -3"):
        read(tmp_path, surface(slice(None), 0))
    lines = "$Elements\n1\n1 1 2 7 1 1 2\n$EndElements\n"
    with pytest.raises(MeshError, match=f"there are only 1 line: .*{hint}"):
        read(tmp_path, text("2.2").partition("$Elements")[0] + lines)
    names = '$PhysicalNames\n2\n2 7 "side"\n3 8 "tissue"\n$EndPhysicalNames\n'
    flat = read(tmp_path, surface(slice(0, 2), 7, names))
    assert "physical group 'tissue' of dimension 3 has no element in the file" in flat.notes


def test_sections_that_are_there_twice(tmp_path: Path) -> None:
    both = text("2.2") + text("2.2").partition("$EndPhysicalNames\n")[2]
    with pytest.raises(MeshError, match=r"line 21: \$Nodes is defined twice: .*-format msh41"):
        read(tmp_path, both)


SCRIPT = """
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 15, 20, 10};
Box(2) = {15, 0, 0, 15, 20, 10};
Coherence;
Physical Surface("clamped", 7) = Surface In BoundingBox{-1, -1, -1, 31, 21, 1};
Physical Volume("soft", 11) = {1};
Physical Volume("tissue", 12) = {1, 2};
Periodic Surface {7} = {1} Translate {30, 0, 0};
Mesh.MeshSizeMin = 9;
Mesh.MeshSizeMax = 9;
Mesh 3;
Mesh.MshFileVersion = 4.1; Save "41.msh";
Mesh.MshFileVersion = 4.0; Save "40.msh";
Mesh.MshFileVersion = 2.2; Save "22.msh";
Mesh.MshFileVersion = 1; Save "1.msh";
Mesh.SaveParametric = 1;
Save "1p.msh";
Mesh.MshFileVersion = 2.2; Save "22p.msh";
Mesh.Binary = 1; Save "22pb.msh";
Mesh.MshFileVersion = 4.1; Save "41pb.msh";
Mesh.SaveParametric = 0; Save "41b.msh";
Mesh.PartitionCreateTopology = 1;
Mesh.PartitionCreateGhostCells = 1;
PartitionMesh 3;
Save "41parts_b.msh";
Mesh.MshFileVersion = 2.2; Save "22parts_b.msh";
Mesh.Binary = 0; Save "22parts.msh";
Mesh.MshFileVersion = 4.0; Save "40parts.msh";
Mesh.MshFileVersion = 4.1; Save "41parts.msh";
"""


@needs_gmsh
def test_gmsh_writes_the_same_mesh_in_every_form(tmp_path: Path) -> None:
    (tmp_path / "block.geo").write_text(SCRIPT)
    subprocess.run(["gmsh", "block.geo", "-", "-v", "0"], cwd=tmp_path, check=True, timeout=60)
    files = sorted(tmp_path.glob("*.msh"))
    assert len(files) == SCRIPT.count("Save ") == 14
    wanted = read_mesh(tmp_path / "41.msh")
    assert wanted.measures.sum() == pytest.approx(30 * 20 * 10)
    corners = wanted.nodes[wanted.facet_nodes(wanted.facet_groups["clamped"])]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert areas.sum() == pytest.approx(30 * 20)
    for file in files:
        mesh = read_mesh(file)
        assert not mesh.notes
        found, same = described(mesh), described(wanted)
        if file.stem.startswith("1"):  # has numbers for names
            assert mesh.node_groups.keys() == {"7", "11", "12"}
            numbers = {"clamped": "7", "soft": "11", "tissue": "12"}
            for kind in ("element groups", "node groups", "facet groups"):
                same[kind] = {numbers[name]: of for name, of in same[kind].items()}  # type: ignore[attr-defined]
        assert found == same, file.name
