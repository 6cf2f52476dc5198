"""Decks of Abaqus and CalculiX: scopes, instances, surfaces, includes, and what the body does not need."""

import random
import re
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.arrays import Floats
from truespring.errors import MeshError
from truespring.mesh import ELEMENT_KINDS
from truespring.mesh.files import read_mesh
from truespring.mesh.files.inp import read_inp
from truespring.mesh.files.inp_elements import element_type

# A bar of four cubes along x.
PLACES = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in range(5)]
NODES = "*Node\n" + "".join(f"{n}, {x}., {y}., {z}.\n" for n, (x, y, z) in enumerate(PLACES, 1))
CUBES = "".join(f"{n}, {', '.join(map(str, np.array([0, 1, 6, 5, 10, 11, 16, 15]) + n))}\n" for n in range(1, 5))
BAR = f"{NODES}*Element, type=C3D8R\n{CUBES}"
LEFT, RIGHT = "\n 1, 16, 5\n", "\n 5, 20, 5\n"  # generated


def part(name: str = "Bar", more: str = "") -> str:
    return f"*Part, name={name}\n{BAR}{more}*End Part\n"


def assembly(more: str, instances: str = "*Instance, name=Bar-1, part=Bar\n*End Instance\n") -> str:
    return f"*Assembly, name=Assembly\n{instances}{more}*End Assembly\n*Material, name=M\n*Elastic\n1e4, 0.\n"


def deck(folder: Path, text: str, name: str = "deck.inp") -> ts.Mesh:
    (folder / name).write_text(text)
    return read_mesh(folder / name)


def sizes(mesh: ts.Mesh) -> dict[str, int]:
    return {name: len(nodes) for name, nodes in mesh.node_groups.items()}


def x_of(mesh: ts.Mesh, group: str) -> list[float]:
    return sorted(set(mesh.nodes[mesh.node_groups[group], 0].tolist()))


# --- scopes ---------------------------------------------------------------------------------------


def test_a_set_of_the_assembly_and_one_of_the_part_are_two(tmp_path: Path) -> None:
    """Held at the assembly's set, a bar of E A = 1e4 N pulled by 1 N is longer by F L / (E A) = 4e-4."""
    of_part = "*Nset, nset=Set-1\n 1, 2, 3, 6, 7, 8, 11, 12, 13, 16, 17, 18\n*Nset, nset=Own\n1,\n"
    of_assembly = f"*Nset, nset=Set-1, instance=Bar-1, generate{LEFT}*Nset, nset=Tip, instance=Bar-1, generate{RIGHT}"
    mesh = deck(tmp_path, part(more=of_part) + assembly(of_assembly))
    assert sizes(mesh) == {"Set-1": 4, "Tip": 4, "Bar-1.Set-1": 12, "Bar-1.Own": 1, "Own": 1}
    assert x_of(mesh, "Set-1") == [0] and x_of(mesh, "Bar-1.Set-1") == [0, 1, 2]
    assert mesh.notes == ("names used in several scopes are qualified by their instance: Bar-1.Set-1",)
    pull = ts.Force(on="Tip", total=(1.0, 0.0, 0.0))
    problem = ts.Problem(mesh, ts.Material(1e4, 0.0), None, [ts.Fixed(on="Set-1")], [pull])
    moved = ts.solve(problem, ts.Fem(law="linear")).states[-1].displacement
    assert moved[mesh.node_groups["Tip"], 0] == pytest.approx(4e-4, rel=1e-9)


def test_a_node_set_and_an_element_set_of_one_name_are_two(tmp_path: Path) -> None:
    fix = f"*Nset, nset=Fix, instance=Bar-1, generate{LEFT}*Elset, elset=Fix, instance=Bar-1\n 1, 2\n"
    mesh = deck(tmp_path, part() + assembly(fix))
    assert x_of(mesh, "Fix") == [0] and mesh.element_groups["Fix"].tolist() == [0, 1]


def test_reference_points_are_told_and_left_out(tmp_path: Path) -> None:
    points = "*Node\n 1, 5., 0.5, 0.5\n 2, 6., 0., 0.\n*Nset, nset=RP\n 1,\n*Nset, nset=One, instance=Bar-1\n 1,\n"
    mesh = deck(tmp_path, part() + assembly(points))
    assert (mesh.n_nodes, len(mesh.elements), mesh.measures.sum()) == (20, 4, 4.0)
    assert sizes(mesh) == {"One": 1} and x_of(mesh, "One") == [0]
    assert mesh.notes == (
        "2 reference points of the assembly, in no element, left out; the first is its node 1 at (5, 0.5, 0.5) in the "
        "file's unit",
        "group 'RP' has no node of the body and was left out",
    )


def test_instances_are_moved_then_turned(tmp_path: Path) -> None:
    """Moved by (10, 0, 0) and turned by 90 degrees about the upright axis through (10, 0, 0): the bar lies along y."""
    moved = "*Instance, name=Bar-1, part=Bar\n 10., 0., 0.\n{}*End Instance\n"
    mesh = deck(tmp_path, part() + assembly("", moved.format("")))
    assert mesh.nodes == pytest.approx(np.array([(10 + x, y, z) for x, y, z in PLACES]))
    mesh = deck(tmp_path, part() + assembly("", moved.format("10., 0., -1., 10., 0., 5., 90.\n")))
    assert mesh.nodes == pytest.approx(np.array([(10 - y, x, z) for x, y, z in PLACES]))
    half = "*Instance, name=Bar-1, part=Bar\n1., 1., 0., 2., 2., 0., 180.\n*End Instance\n"  # x and y change places
    mesh = deck(tmp_path, part() + assembly("", half))
    assert mesh.nodes == pytest.approx(np.array([(y, x, -z) for x, y, z in PLACES]))
    with pytest.raises(MeshError, match=r"line 31: \*INSTANCE: the two points of the axis coincide"):
        deck(tmp_path, part() + assembly("", half.replace("2., 2., 0., 180.", "1., 1., 0., 180.")))


def test_several_instances_have_numbers_and_sets_of_their_own(tmp_path: Path) -> None:
    ends = f"*Nset, nset=Left, generate{LEFT}*Elset, elset=First\n1,\n"
    instances = "".join(
        f"*Instance, name={name}, part=Bar\n{x}., 0., 0.\n*End Instance\n" for name, x in (("One", 0), ("Two", 9))
    )
    more = f"*Nset, nset=Tips, instance=One, generate{RIGHT}*Nset, nset=Tips, instance=Two, generate{RIGHT}"
    mesh = deck(tmp_path, part(more=ends) + part("Other") + assembly(more, instances))
    assert (mesh.n_nodes, len(mesh.elements), mesh.measures.sum()) == (40, 8, 8.0)
    assert x_of(mesh, "Tips") == [4, 13] and x_of(mesh, "One.Left") == [0] and x_of(mesh, "Two.Left") == [9]
    assert "Left" not in mesh.node_groups and mesh.element_groups["Two.First"].tolist() == [4]
    assert mesh.notes[:2] == (
        "parts without an instance are left out: Other",
        "20 is added to the numbers of nodes of instance Two, and 4 to those of its elements",
    )


def test_bodies_that_touch_stay_apart_unless_asked(tmp_path: Path) -> None:
    """Two cubes without a common node: parts of an assembly, or in contact; else torn."""
    nodes = "".join(f"{n}, {x}, {y}, {z}\n" for n, (x, y, z) in enumerate(SOLID, 1))
    cube = f"*Part, name=Cube\n*Node\n{nodes}*Element, type=C3D8\n1, 1, 2, 3, 4, 5, 6, 7, 8\n*End Part\n"
    two = "".join(f"*Instance, name=I{x}, part=Cube\n{x}., 0., 0.\n*End Instance\n" for x in range(2))
    mesh = deck(tmp_path, cube + assembly("", two))
    assert mesh.n_nodes == 16 and "8 of 16 nodes coincide with another node" in " ".join(mesh.notes)
    assert read_mesh(tmp_path / "deck.inp", join=True).n_nodes == 12
    moved = "".join(f"{n + 8}, {x + 1}, {y}, {z}\n" for n, (x, y, z) in enumerate(SOLID, 1))
    elements = "1, 1, 2, 3, 4, 5, 6, 7, 8\n2, 9, 10, 11, 12, 13, 14, 15, 16\n"
    flat = f"*NODE\n{nodes}{moved}*ELEMENT, TYPE=C3D8\n{elements}"
    assert deck(tmp_path, flat).n_nodes == 12
    assert deck(tmp_path, f"{flat}*CONTACT PAIR, INTERACTION=I\nA, B\n").n_nodes == 16


def test_names_may_stand_behind_their_instance_and_within_each_other(tmp_path: Path) -> None:
    of_part = "*Nset, nset=All, generate\n 1, 20, 1\n*Elset, elset=Half\n1, 2\n"
    more = """*Nset, nset=Both
 Bar-1.All,
*Nset, nset=Tip2
 Bar-1.20, assembly.BAR-1.15
*Nset, nset=Mine
 tip2, Bar-1.1
*Nset, nset=OfHalf, elset=Bar-1.Half
*Nset, nset="Tip", instance=Bar-1
 5,
*Nset, nset=TIP, instance=Bar-1
 1,
*Nset, nset=Loop
 Loop, Bar-1.7
*Nset, nset=Of quoted
 "Tip"
"""
    mesh = deck(tmp_path, part(more=of_part) + assembly(more))
    assert {name: sizes(mesh)[name] for name in ("Both", "Tip2", "Mine", "OfHalf", "All", "Loop")} == {
        **{"Both": 20, "Tip2": 2, "Mine": 3, "OfHalf": 12, "All": 20, "Loop": 1},
    }
    assert x_of(mesh, "Tip2") == [4] and x_of(mesh, "Of quoted") == [4] and x_of(mesh, "TIP") == [0]
    for wrong in ("Bar-2.All", "Bar-1.Al", "b"):
        with pytest.raises(MeshError, match=f"'{wrong}' is neither a number nor a set that is in the file"):
            deck(tmp_path, part(more=of_part) + assembly(f"*Nset, nset=A\n 1, {wrong}\n"))
    with pytest.raises(MeshError, match=r"there is no instance 'Bar-2' \(did you mean 'Bar-1'\?\); there are Bar-1"):
        deck(tmp_path, part() + assembly("*Nset, nset=A, instance=Bar-2\n 1,\n"))
    with pytest.raises(MeshError, match=r"there is no part 'Baz' \(did you mean 'Bar'\?\); there are Bar"):
        deck(tmp_path, part() + assembly("", "*Instance, name=I, part=Baz\n*End Instance\n"))


def test_parts_without_an_assembly_stand_as_they_are(tmp_path: Path) -> None:
    mesh = deck(tmp_path, part(more=f"*Nset, nset=Left, generate{LEFT}") + f"*Nset, nset=Right, generate{RIGHT}")
    assert len(mesh.elements) == 4 and x_of(mesh, "Left") == [0] and x_of(mesh, "Right") == [4]


def test_numbers_that_are_not_there_are_told(tmp_path: Path) -> None:
    mesh = deck(tmp_path, f"{BAR}*Nset, nset=A\n1, 77\n78,\n*Elset, elset=B, generate\n7, 9\n*Nset, nset=C\n")
    assert sizes(mesh) == {"A": 1}
    assert mesh.notes[:2] == (
        "set 'A' names 2 that are not in the file and left out, the first is number 77 in line 28",
        "set 'B' names 1 that is not in the file and left out, the first is number 7 in line 31",
    )


# --- surfaces -------------------------------------------------------------------------------------


def area(mesh: ts.Mesh, group: str) -> Floats:
    """Length or area times the normal of the facets of a group, added up."""
    total = np.zeros(mesh.dim)
    for facet in mesh.facet_nodes(mesh.facet_groups[group]).tolist():
        at = mesh.nodes[list(dict.fromkeys(facet))]  # a triangle may have a corner twice
        if mesh.dim == 2:
            total += [at[1, 1] - at[0, 1], at[0, 0] - at[1, 0]]
        else:
            total += sum(np.cross(at[k] - at[0], at[k + 1] - at[0]) for k in range(1, len(at) - 1)) / 2
    return total


# By type: places of the nodes, and area times outward normal of the faces S1, S2, ...
SOLID = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
FACES = {
    "C3D8": (SOLID, [(0, 0, -1), (0, 0, 1), (0, -1, 0), (1, 0, 0), (0, 1, 0), (-1, 0, 0)]),
    "C3D4": (
        [SOLID[0], SOLID[1], SOLID[3], SOLID[4]],
        [(0, 0, -0.5), (0, -0.5, 0), (0.5, 0.5, 0.5), (-0.5, 0, 0)],
    ),
    "C3D6": (
        [SOLID[0], SOLID[1], SOLID[3], SOLID[4], SOLID[5], SOLID[7]],
        [(0, 0, -0.5), (0, 0, 0.5), (0, -1, 0), (1, 1, 0), (-1, 0, 0)],
    ),
    "C3D5": (
        [*SOLID[:4], (0.5, 0.5, 1.0)],
        [(0, 0, -1), (0, -0.5, 0.25), (0.5, 0, 0.25), (0, 0.5, 0.25), (-0.5, 0, 0.25)],
    ),
    "CPS4": (SOLID[:4], [(0, -1), (1, 0), (0, 1), (-1, 0)]),
    "CPE3": ([SOLID[0], SOLID[1], SOLID[3]], [(0, -1), (1, 1), (-1, 0)]),
}


def has_kind(type_: str) -> bool:
    known = element_type(type_)
    return known is not None and known.kind in ELEMENT_KINDS


@pytest.mark.parametrize("type_", list(filter(has_kind, FACES)))
def test_faces_are_those_of_the_element_library(type_: str, tmp_path: Path) -> None:
    """Of each face of one element the area and the normal, also where the file turns the element inside out."""
    places, normals = FACES[type_]
    surfaces = "".join(f"*SURFACE, NAME=F{face}\nALL, S{face}\n" for face in range(1, len(normals) + 1))
    for sign in (1, -1):
        nodes = "".join(f"{n}, {sign * x}, {y}, {z}\n" for n, (x, y, z) in enumerate(places, 1))
        numbers = ", ".join(map(str, range(1, len(places) + 1)))
        text = f"*NODE\n{nodes}*ELEMENT, TYPE={type_}, ELSET=ALL\n7, {numbers}\n{surfaces}*SURFACE, NAME=FREE\nALL,\n"
        mesh = deck(tmp_path, text)
        for face, normal in enumerate(normals, 1):
            assert area(mesh, f"F{face}") == pytest.approx([sign * normal[0], *normal[1:]]), (face, sign)
        assert len(mesh.facet_groups["FREE"]) == len(normals) and area(mesh, "FREE") == pytest.approx(0)


SURFACE = """*Elset, elset=_Surf-1_S5, internal, instance=Bar-1, generate
 1, 4, 1
*Surface, type=ELEMENT, name=Surf-1
_Surf-1_S5, S5
*Surface, name=Ends
Bar-1.1, S6
Bar-1.4, s4
*Surface, name=Skin
,
"""


def test_a_load_acts_on_the_faces_of_a_surface_alone(tmp_path: Path) -> None:
    """10 Pa on four faces of 1 m2, by the name of the surface and by that of the set made for it."""
    mesh = deck(tmp_path, part() + assembly(SURFACE + f"*Nset, nset=Fix, instance=Bar-1, generate{LEFT}"))
    for name, force in (("Surf-1", 40.0), ("_Surf-1_S5", 40.0), ("Ends", 20.0), ("Skin", 180.0)):
        pull = ts.Traction(on=name, traction=(0.0, 10.0, 0.0))
        problem = ts.Problem(mesh, ts.Material(1e4, 0.0), None, [ts.Fixed(on="Fix")], [pull])
        assert problem.loading.force(mesh.nodes).sum(axis=0) == pytest.approx([0, force, 0])
    assert "_Surf-1_S5" not in mesh.element_groups and mesh.notes == ()


def test_surfaces_of_shells_and_of_nodes(tmp_path: Path) -> None:
    """Shells upon the body name its facets, by their set and by a surface; a surface of nodes is a group of nodes."""
    more = "*ELEMENT, TYPE=S4, ELSET=Skin\n11, 10, 5, 15, 20\n12, 1, 6, 16, 11\n"
    more += "*ELEMENT, TYPE=S4, ELSET=Wing\n13, 1, 2, 12, 6\n"
    more += "*SURFACE, NAME=Pressed\nSkin, SPOS\n*SURFACE, NAME=Whole\nSkin\n*SURFACE, NAME=Off\nWing, SPOS\n"
    more += "*SURFACE, TYPE=NODE, NAME=Points\nTip, 1.\n3,\n*NSET, NSET=Tip\n5, 10\n"
    more += "*SURFACE, NAME=Cut, COMBINE=UNION\nPressed, Whole\n"
    more += "*SURFACE, NAME=Wrong\n1, S7\n*SURFACE, NAME=Edge\nSkin, E1\n"
    mesh = deck(tmp_path, BAR + more)
    for name in ("Skin", "Pressed", "Whole"):
        assert len(mesh.facet_groups[name]) == 2 and x_of(mesh, name) == [0, 4], name
        assert area(mesh, name) == pytest.approx(0)
    assert sizes(mesh)["Points"] == 3 and "Points" not in mesh.facet_groups
    notes = " ".join(mesh.notes)
    for told in (
        "3 quadrilaterals are not part of the body and only carry sets",
        "surface 'Off' is left out: 1 of its S4 are on no facet of the body",
        "surface 'Cut' is left out: surfaces combined from others are not supported",
        "surface 'Wrong' is left out: S7 of C3D8R is no facet of the body",
        "surface 'Edge' is left out: E1 of S4 is no facet of the body",
    ):
        assert told in notes
    assert not {"Off", "Cut", "Wrong", "Edge"} & mesh.node_groups.keys()


def test_a_plane_body_of_shells_has_edges(tmp_path: Path) -> None:
    square = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*ELEMENT, TYPE=S4R\n1,1,2,3,4\n"
    mesh = deck(tmp_path, square + "*SURFACE, NAME=A\n1, E2\n*SURFACE, NAME=B\n1, S4\n*SURFACE, NAME=C\n1, SPOS\n")
    assert area(mesh, "A").tolist() == area(mesh, "B").tolist() == [1, 0]
    assert mesh.notes == ("surface 'C' is left out: SPOS of S4R is no facet of the body",)


# --- includes -------------------------------------------------------------------------------------


def test_files_are_included_where_the_deck_names_them(tmp_path: Path) -> None:
    """As cards, as data of the card above, and within each other; names are relative to the deck's folder."""
    (tmp_path / "sub").mkdir()
    (tmp_path / "nodes.txt").write_text(NODES.partition("\n")[2])
    (tmp_path / "sub" / "cubes.msh").write_text(f"*ELEMENT, TYPE=C3D8\n*INCLUDE, INPUT=sub/more.txt\n{CUBES[20:]}")
    first, rest = CUBES.split("\n", 1)
    (tmp_path / "sub" / "cubes.msh").write_text(f"*ELEMENT, TYPE=C3D8\n*INCLUDE, INPUT=sub/more.txt\n{rest}")
    (tmp_path / "sub" / "more.txt").write_text(first)
    job = "*INCLUDE,\nINPUT=sub\\cubes.msh\n*NSET, NSET=A\n1\n*MATERIAL, NAME=M\n"
    job += "*STEP\n*INCLUDE, INPUT=loads.dlo\n*END STEP\n"
    mesh = deck(tmp_path, "*NODE\n*INCLUDE, INPUT=nodes.txt\n" + job)
    assert mesh.measures.tolist() == [1, 1, 1, 1] and sizes(mesh) == {"A": 1}
    missing, cut = mesh.notes
    assert "line 9" in missing and "'loads.dlo'" in missing and "line 1 of sub/more.txt" in cut
    same = deck(tmp_path, '*NODE, INPUT="nodes.txt"\n' + job)
    assert (same.elements == mesh.elements).all() and (same.nodes == mesh.nodes).all()


def test_what_is_included_is_bounded_and_never_shown(tmp_path: Path) -> None:
    job = tmp_path / "job"
    job.mkdir()
    for secret in (tmp_path / "secret", job / "secret"):
        secret.write_text("hunter2\n")
    (job / "link").symlink_to(tmp_path / "secret")
    (job / "loop.inc").write_text("*INCLUDE, INPUT=loop.inc\n")
    (job / "wide.inc").write_text("*HEADING\n" + "*INCLUDE, INPUT=empty.inc\n" * 1001)
    (job / "empty.inc").write_text("**\n")
    (job / "bad.inc").write_text("*NODE\n1, 0, hunter2, 0\n")
    (job / "set.inc").write_text("*NSET, NSET=A\nhunter2\n")
    (job / "binary.inc").write_bytes(b"*NODE\n\0")
    for named, message in {
        "../secret": "line 1: .INCLUDE: .*same folder or below",
        str(tmp_path / "secret"): "same folder or below",
        "link": "a link to another folder",
        ".": "is a folder",
        "none.inc": "which does not exist",
        "loop.inc": "line 1 of loop.inc: .INCLUDE: this file includes itself",
        "deck.inp": "this file includes itself",
        "wide.inc": "1000 times at most: write them into one",
        "secret": "line 1 of secret: this is no .inp file: expected a keyword such as .NODE(;|$)",
        "bad.inc": "line 2 of bad.inc: a coordinate: expected numbers",
        "set.inc": "line 2 of set.inc: the entry is neither a number nor a set",
        "binary.inc": "this file is binary, not text",
    }.items():
        with pytest.raises(MeshError, match=message) as error:
            deck(job, f"*INCLUDE, INPUT={named}\n{BAR}")
        assert "hunter2" not in str(error.value)
    with pytest.raises(MeshError, match="a deck that is read from a file"):
        read_inp(b"*INCLUDE, INPUT=a\n")


# --- what the body does not need --------------------------------------------------------------------


def test_elements_that_no_body_is_made_of_are_counted_and_left_out(tmp_path: Path) -> None:
    more = """*ELEMENT, TYPE=MASS, ELSET=M
5, 20
*ELEMENT, TYPE=U7
100, 1, 2, 3,
4, 5
101, 1, 2, 3, 4, 5
*ELEMENT, TYPE=CONN3D2, ELSET=Joints
200, , 1
*ELEMENT, TYPE=DCOUP3D
*ELEMENT, TYPE=B31, ELSET=Rod
300, 1, 2, 3
301, 2, 3
*ELEMENT, TYPE=T3D2
302, 1, 999
*ELEMENT
400, 1
*ELSET, ELSET=All
M, Rod, 1
"""
    mesh = deck(tmp_path, BAR + more)
    assert (mesh.n_nodes, len(mesh.elements), mesh.measures.sum()) == (20, 4, 4.0)
    assert sizes(mesh) == {"Rod": 3, "All": 9} and mesh.element_groups["All"].tolist() == [0]
    assert mesh.notes[:3] == (
        "elements that the body does not need are left out: 1 CONN3D2, 1 MASS, 2 U7, 1 no type",
        "2 lines are not part of the body and only carry sets",
        "1 of 1 T3D2 refer to nodes that are not in the file and are left out",
    )


def test_all_elements_of_a_cad_program(tmp_path: Path) -> None:
    """One tetrahedron, two of its faces and two edges: they carry sets."""
    nodes = "*Node, NSET=Nall\n1, 0, 0, 0\n2, 10, 0, 0\n3, 0, 10, 0\n4, 0, 0, 10\n\n\n"
    faces = "** Face elements\n*Element, TYPE=S3, ELSET=Efaces\n7, 1, 2, 3\n8, 1, 2, 4\n"
    edges = "*Element, TYPE=B32, ELSET=Eedges\n1, 1, 5, 2\n*ELSET, ELSET=Eall\nEvolumes, Efaces, Eedges\n"
    text = nodes + "5, 5, 0, 0\n*Element, TYPE=C3D4, ELSET=Evolumes\n11, 1, 2, 3, 4\n" + faces + edges
    mesh = deck(tmp_path, text)
    assert mesh.measures.tolist() == pytest.approx([1000 / 6])
    assert mesh.node_groups["Eedges"].tolist() == [0, 1] and len(mesh.facet_groups["Efaces"]) == 2
    assert area(mesh, "Efaces") == pytest.approx([0, -50, -50])


@pytest.mark.parametrize(
    ("types", "message"),
    [
        ({"D": 3, "MASS": 1}, r"there is no \*ELEMENT of a body: 1 D, 1 MASS make none; a body consists of C3D4"),
        ({"T3D2": 2}, "there are only 1 line: a body consists of"),
        ({"CAX4": 4}, r"line 27: \*ELEMENT: TYPE=CAX4 \(1 lines\), axisymmetric, is not supported; supported: C3D4"),
        ({"C3D8": 8, "C3D7": 7}, r"TYPE=C3D7 \(1 lines\) is not supported; supported:"),
    ],
)
def test_without_a_body_the_way_out_is_told(types: dict[str, int], message: str, tmp_path: Path) -> None:
    cells = [
        f"*ELEMENT, TYPE={name}\n{n}, {', '.join(map(str, range(1, k + 1)))}\n"
        for n, (name, k) in enumerate(types.items())
    ]
    with pytest.raises(MeshError, match=message):
        deck(tmp_path, NODES + "*HEADING\na\nb\nc\nd\n" + "".join(cells))


# --- form -----------------------------------------------------------------------------------------

FLAT = f"{BAR}*NSET, NSET=Left, GENERATE\n1, 16, 5\n*ELSET, ELSET=Two\n1, 2\n"
FORMS = {
    "no line end": FLAT.rstrip(),
    "line ends of Windows": FLAT.replace("\n", "\r\n"),
    "line ends of old machines": FLAT.replace("\n", "\r"),
    "small letters": FLAT.replace("NSET", "nset").replace("GENERATE", "generate").replace("ELSET", "elset"),
    "tabs and blanks": FLAT.replace(", ", "\t,\t ").replace("\n", " \t\n\n"),
    "a comma at the end": FLAT.replace("\n", ",\n"),
    "comments": FLAT.replace("\n", "\n** 1, 2\n**\n"),
    "a comma, then a comment": FLAT
    + "*SOLID SECTION, ELSET=Two, MATERIAL=M, \n** a comment\n*MATERIAL, NAME=M\n1, 2\n",
    "a keyword in two lines": FLAT.replace(", type=C3D8R", ",\n** why not\n type=C3D8R").replace(", GEN", ",\n  GEN"),
    "blank parameters": FLAT.replace(", GENERATE", ", , GENERATE,").replace("*ELSET", "* E L S E T"),
    "odd cards": FLAT + "*HEADING\n=\n*FILM, 5\n*SOLID SECTION, 7=8, =\n*AMPLITUDE, NAME=\n'\n*STEP\n*STATIC\n",
    "an element in three lines": re.sub(r"(?m)^(\d, \d+, \d+,)( \d+, \d+,)( \d+, \d+, \d+, \d+)$", r"\1\n\2\n\3", FLAT),
    "twice the same nodes": FLAT + NODES,
    "no END STEP": FLAT + "*STEP\n*STATIC\n",
    "a comma at the end of all": FLAT + "*SOLID SECTION, ELSET=Two,\n",
}


@pytest.mark.parametrize("form", FORMS)
def test_however_it_is_written(form: str, tmp_path: Path) -> None:
    (tmp_path / "deck.inp").write_bytes(FORMS[form].encode())
    mesh = read_mesh(tmp_path / "deck.inp")
    assert mesh.nodes.tolist() == [list(map(float, place)) for place in PLACES] and mesh.measures.tolist() == [1] * 4
    assert sizes(mesh) == {"Left": 4, "Two": 12} and x_of(mesh, "Left") == [0]
    told = {"no line end": "it may be truncated there", "no END STEP": "no *END STEP", "odd cards": "no *END STEP"}
    told["twice the same nodes"] = "20 nodes are defined twice at the same position"
    assert len(mesh.notes) == (form in told) and told.get(form, "") in " ".join(mesh.notes)


def test_rows_that_are_cut_are_refused(tmp_path: Path) -> None:
    elements = f"*ELEMENT, TYPE=C3D8\n{CUBES}"
    with pytest.raises(
        MeshError, match=r"line \d+: .NODE: 2 coordinates in the last line, which has no line end: it is trunc"
    ):
        deck(tmp_path, elements + NODES.rstrip()[:-4])
    with pytest.raises(MeshError, match="line 26: an element of C3D8R needs 9 numbers, found 8"):
        deck(tmp_path, BAR.rstrip()[:-4])
    with pytest.raises(MeshError, match="line 23: node 20 is defined twice, at two positions"):
        deck(tmp_path, f"{NODES}*NODE\n20, 4, 1, 1.5\n{elements}")


def test_names_in_other_letters(tmp_path: Path) -> None:
    (tmp_path / "deck.inp").write_bytes(FLAT.replace("Left", "Fläche").encode("latin-1"))
    assert "Fläche" in read_mesh(tmp_path / "deck.inp").node_groups
    assert "Fläche" in deck(tmp_path, FLAT.replace("Left", "Fläche")).node_groups


def test_damage_of_a_deck_of_parts_ends_in_a_mesh_or_a_message(tmp_path: Path) -> None:
    """60 decks, of which a piece is lost, doubled or replaced."""
    of_part = (
        f"*Nset, nset=Left, generate{LEFT}*Elset, elset=E\n1, 2\n*Surface, name=S\nE, S1\n*Element, type=MASS\n9, 1\n"
    )
    moved = "*Instance, name=B-1, part=Bar\n1., 0., 0.\n0., 0., 0., 0., 0., 1., 90.\n*End Instance\n"
    more = "*Node\n1, 9., 9., 9.\n*Nset, nset=N\nB-1.Left, B-1.3, 1\n*Surface, name=T\nB-1.E, S2\n"
    text = part(more=of_part) + assembly(more, moved)
    assert len(deck(tmp_path, text).elements) == 4
    rng = random.Random(7)
    n_read = 0
    for _ in range(60):
        begin, length = rng.randrange(len(text)), rng.choice([0, 1, 3, 20])
        instead = rng.choice(
            [
                "",
                ",",
                "\n",
                "*",
                "=",
                '"',
                ".",
                "-1",
                "1e400",
                "nan",
                "9" * 30,
                "\n*Include, input=x\n",
                text[begin : begin + 30],
            ]
        )
        try:
            deck(tmp_path, text[:begin] + instead + text[begin + length :])
            n_read += 1
        except MeshError as error:
            assert str(error).startswith(f"{tmp_path / 'deck.inp'}: ")
    assert 5 < n_read < 55


def test_an_instance_may_hold_its_own_mesh_and_a_part_its_own_surface(tmp_path: Path) -> None:
    """As meshes that are not dependent are written; a tool, rigid and out of shells, is left out beside it."""
    own = f"*Instance, name=I-1, part=Empty\n0., 0., 7.\n{BAR}*Nset, nset=Set-1\n1,\n*End Instance\n"
    tool = "*Part, name=Tool\n*Node\n1, 9., 9., 9.\n2, 8., 9., 9.\n3, 8., 8., 9.\n4, 9., 8., 9.\n*Node\n5, 9., 9., 1.\n"
    tool += "*Element, type=R3D4\n1, 1, 2, 3, 4\n*Surface, type=CYLINDER, name=Round\nSTART, 0., 0.\n*End Part\n"
    of_part = "*Elset, elset=E\n1, 4\n*Surface, name=Top\nE, S5\n"
    instances = own + "*Instance, name=I-2, part=Bar\n*End Instance\n*Instance, name=T, part=Tool\n*End Instance\n"
    text = "*Part, name=Empty\n*End Part\n" + tool + part(more=of_part)
    mesh = deck(tmp_path, text + assembly("*Surface, name=All\nI-2.E, S5\nI-1.1, S6\n", instances))
    assert (mesh.n_nodes, len(mesh.elements)) == (40, 8) and sizes(mesh)["I-1.Set-1"] == 1
    assert mesh.nodes[mesh.node_groups["Set-1"]].tolist() == [[0, 0, 7]]
    assert area(mesh, "I-2.Top").tolist() == area(mesh, "Top").tolist() == [0, 2, 0]
    assert area(mesh, "All").tolist() == [-1, 2, 0]
    notes = " ".join(mesh.notes)
    assert "left out: 1 R3D4" in notes and "5 of 45 nodes belong to no element" in notes
    assert "surface 'T.Round' is left out: TYPE=CYLINDER is not supported" in notes
