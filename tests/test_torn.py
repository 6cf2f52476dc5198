"""Cells that have nodes of their own, as deal.II and discontinuous elements are written, are joined, or told."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.test_facet_groups import MESHES, at_ends, contents
from truespring.errors import StudyError
from truespring.mesh.files.contents import Contents
from truespring.reference import Level, Record
from truespring.reference.joining import joined
from truespring.study import read_study

meshio = pytest.importorskip("meshio")
every_mesh = pytest.mark.parametrize("name", MESHES)


def torn(whole: Contents, elements: slice = slice(None)) -> Contents:
    """Give every cell, or elements of the body chosen, nodes of its own, numbered on."""
    cells, numbers, points = list(whole.cells), [whole.node_numbers], [whole.points]
    for place, block in enumerate(cells):
        chosen = np.zeros(len(block.nodes), dtype=bool)
        chosen[elements if block.dim == max(one.dim for one in cells) else slice(None)] = True
        old = block.nodes[chosen]
        new = 1 + max(one.max() for one in numbers) + np.arange(old.size).reshape(old.shape)
        numbers.append(new.ravel())
        points.append(whole.points[old.ravel()])
        nodes = block.nodes.copy()
        nodes[chosen] = new
        cells[place] = replace(block, nodes=nodes)
    return replace(whole, cells=cells, node_numbers=np.concatenate(numbers), points=np.concatenate(points))


@every_mesh
def test_a_mesh_whose_cells_are_all_apart_is_joined(name: str) -> None:
    body = MESHES[name]
    whole = contents(body, at_ends(body), node_groups={"first": np.array([0, 3])})
    apart = torn(whole)
    mesh, wanted = apart.mesh(1.0), whole.mesh(1.0)
    n_before = body.elements.size
    told = f"{n_before} nodes at {body.n_nodes} places were merged, because no two elements share a node"
    assert mesh.notes == (told,)
    assert mesh.n_nodes == wanted.n_nodes and len(mesh.boundary) == len(wanted.boundary)
    assert (mesh.nodes[mesh.elements] == wanted.nodes[wanted.elements]).all()
    assert (mesh.facet_groups["caps"] == wanted.facet_groups["caps"]).all()
    for group in ("first", "caps"):
        places = (one.nodes[one.node_groups[group]].tolist() for one in (mesh, wanted))
        assert sorted(next(places)) == sorted(next(places))
    left = apart.mesh(1.0, join=False)
    assert left.n_nodes == n_before and "may be torn there; join = true" in " ".join(left.notes)


@every_mesh
def test_a_mesh_that_is_torn_somewhere_is_told_and_joined_if_asked(name: str) -> None:
    """It may be a crack, or two bodies that touch."""
    body = MESHES[name]
    whole = contents(body, at_ends(body)[:1])
    apart = torn(whole, slice(1))
    assert any("coincide with another" in note for note in apart.mesh(1.0).notes)
    assert apart.mesh(1.0).n_nodes == body.n_nodes + body.elements.shape[1] - _alone(body)
    mesh = apart.mesh(1.0, join=True)
    assert mesh.n_nodes == body.n_nodes and not any("torn" in note for note in mesh.notes)
    assert mesh.measures == pytest.approx(body.measures)


def _alone(body: ts.Mesh) -> int:
    """The nodes that only the first element has: when it is torn off, nothing else has them."""
    return len(np.setdiff1d(body.elements[0], body.elements[1:]))


def test_a_study_may_ask_to_join(tmp_path: Path) -> None:
    body = MESHES["hexahedra"]
    nodes = np.concatenate([body.nodes, body.nodes[body.elements[0]]])
    elements = body.elements.copy()
    elements[0] = body.n_nodes + np.arange(8)
    meshio.Mesh(nodes, [("hexahedron", elements)]).write(tmp_path / "body.vtu")
    study = (
        '[mesh]\nfile = "body.vtu"\njoin = true\n[material]\nyoung = 1e3\npoisson = 0.3\n[[support]]\non = "left"\n'
        '[[load]]\non = "right"\nforce = [0, 1, 0]\n[models.fem]\nkind = "fem"\nlaw = "linear"\n'
    )
    for join, n_nodes in (("true", body.n_nodes), ("false", body.n_nodes + 8 - _alone(body))):
        (tmp_path / "study.toml").write_text(study.replace("true", join))
        assert read_study(tmp_path / "study.toml").problem.mesh.n_nodes == n_nodes
    (tmp_path / "study.toml").write_text(study.replace("true", '"yes"'))
    with pytest.raises(StudyError, match="join"):
        read_study(tmp_path / "study.toml")


def record(points: np.ndarray, cells: np.ndarray, displacement: np.ndarray) -> Record:
    levels = tuple(Level(share, share * displacement) for share in (0.5, 1.0))
    names = tuple(map(str, range(len(points))))
    return Record(Path("torn.vtu"), "vtu", points, {"hexahedron": cells}, levels, names)


def apart_and_whole(dtype: str = "f8") -> tuple[Record, Record]:
    body = MESHES["hexahedra"]
    moved = (0.01 * np.stack([np.sin(body.nodes[:, i] + 2 * body.nodes[:, i - 1]) for i in range(3)], axis=1)).astype(
        dtype
    )
    points = body.nodes.astype(dtype)
    own = np.arange(body.elements.size).reshape(body.elements.shape)
    flat = body.elements.ravel()
    return record(points[flat].astype("f8"), own, moved[flat].astype("f8")), record(points, body.elements, moved)


@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_a_result_whose_cells_are_apart_is_joined(dtype: str) -> None:
    apart, whole = apart_and_whole(dtype)
    found = joined(apart)
    n_points, n_before = len(whole.points), len(apart.points)
    assert len(found.points) == n_points == len(found.names)
    (cells,) = found.cells.values()
    assert (found.points[cells] == whole.points[whole.cells["hexahedron"]]).all()
    for one, other in zip(found.levels, whole.levels, strict=True):
        assert one.displacement[cells] == pytest.approx(other.displacement[whole.cells["hexahedron"]], abs=1e-9)
    (note,) = found.notes
    assert note.startswith(f"{n_before - n_points} of {n_before} points") and "merged" in note
    assert joined(found) is found and joined(whole) is whole


def test_a_result_that_opens_is_left_as_it_is_and_told() -> None:
    apart, _ = apart_and_whole()
    last = apart.levels[-1].displacement.copy()
    last[apart.cells["hexahedron"][0]] += 1e-3
    opened = replace(apart, levels=(apart.levels[0], Level(1.0, last)))
    found = joined(opened)
    assert len(found.points) == len(opened.points)
    assert found.notes[0].endswith("they were not merged, and faces between them count as surface")


def test_inverted_cells_of_a_result_are_turned_and_told(tmp_path: Path) -> None:
    body = ts.box((2.0, 1.0, 1.0), (2, 1, 1), "tetrahedron")
    cells = body.elements.copy()
    cells[::3] = cells[::3][:, [0, 2, 1, 3]]
    data = {"displacement": 0.1 * body.nodes}
    meshio.Mesh(body.nodes, [("tetra", cells)], point_data=data).write(tmp_path / "mixed.vtu")
    path, mesh = ts.read_result(tmp_path / "mixed.vtu"), ts.read_mesh(tmp_path / "mixed.vtu")
    told = "4 of 12 elements are inverted"
    assert any(warning.startswith(told) for warning in path.warnings) and mesh.notes[0].startswith(told)
    assert path.problem.mesh.measures.tolist() == mesh.measures.tolist()


def test_points_alone_are_never_joined() -> None:
    apart, _ = apart_and_whole()
    markers = replace(apart, cells={})
    assert joined(markers) is markers


def test_the_surface_of_a_torn_result_is_that_of_the_whole(tmp_path: Path) -> None:
    files = []
    for name, one in zip(("apart", "whole"), apart_and_whole(), strict=True):
        files.append(tmp_path / f"{name}.vtu")
        data = {"displacement": one.levels[-1].displacement}
        meshio.Mesh(one.points, list(one.cells.items()), point_data=data).write(files[-1])
    apart, whole = (ts.read_result(file) for file in files)
    comparison = ts.compare(apart, whole)
    assert comparison.rms_error == pytest.approx(0.0, abs=1e-9)
    assert comparison.hausdorff is not None and comparison.hausdorff.max < 1e-12
    assert len(apart.problem.mesh.boundary) == len(whole.problem.mesh.boundary)
    assert any("they were merged" in warning for warning in apart.warnings)
