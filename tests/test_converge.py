"""Studies on finer and finer meshes."""

import itertools
import json
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.cli import main
from truespring.errors import TruespringError
from truespring.mesh import refined
from truespring.settling import settle

MESHES = {
    "squares": ts.rectangle((4.0, 3.0), (3, 2)),
    "triangles": ts.rectangle((4.0, 3.0), (3, 2), "triangle", "alternating"),
    "cubes": ts.box((3.0, 2.0, 4.0), (2, 1, 2)),
    "tetrahedra": ts.box((3.0, 2.0, 4.0), (2, 1, 2), "tetrahedron"),
}


@pytest.mark.parametrize("name", MESHES)
def test_a_refined_mesh_is_the_same_body(name: str) -> None:
    """As large, of elements half as large, and no edge of it has a node that only one side knows."""
    mesh = MESHES[name]
    groups = ts.Mesh(
        mesh.nodes, mesh.elements, mesh.element, {"left": np.flatnonzero(mesh.nodes[:, 0] == 0)}, {"first": [0]}
    )
    fine = refined(groups)
    assert len(fine.elements) == 2**mesh.dim * len(mesh.elements)
    assert (fine.measures > 0).all() and fine.measures.sum() == pytest.approx(mesh.measures.sum())
    assert fine.measures.max() == pytest.approx(mesh.measures.max() / 2**mesh.dim)
    assert sorted(fine.node_groups["left"]) == np.flatnonzero(np.abs(fine.nodes[:, 0]) < 1e-12).tolist()
    assert fine.measures[fine.element_groups["first"]].sum() == pytest.approx(mesh.measures[0])
    assert len(np.unique(fine.nodes.round(9), axis=0)) == fine.n_nodes
    assert len(fine.boundary) == 2 ** (mesh.dim - 1) * len(mesh.boundary)


def test_a_known_order_is_found() -> None:
    values = [2.0 + 0.3 * h**1.7 for h in (1.0, 0.5, 0.25, 0.125)]
    found = settle("a", "b", "m", [1, 2, 3, 4], values, 0.01)
    assert found.order == pytest.approx(1.7) and found.extrapolated == pytest.approx(2.0)
    assert found.error == pytest.approx(abs(values[-1] - 2) / 2) and found.settled


@pytest.mark.parametrize("values", [[1.0, 2.0, 1.0], [1.0, 2.0, 4.0], [1.0, 1.0, 1.0], [3.0, 2.0]])
def test_where_there_is_no_order_none_is_told(values: list[float]) -> None:
    found = settle("a", "b", "m", [1, 2, 3][: len(values)], values, 1e-3)
    assert found.order is None and found.extrapolated is None
    assert found.settled == (values == [1.0, 1.0, 1.0])


STUDY = """
[mesh]
shape = "rectangle"
size = [2.0, 1.0]
elements = [4, 2]
[material]
young = 1000.0
poisson = 0.3
[section]
kind = "plane-stress"
thickness = 1.0
[[support]]
on = "left"
[[load]]
on = "right"
force = [0.0, -1.0]
[solver]
load_steps = 1
[models.springs]
kind = "springs"
rule = "isotropic"
[models.linear]
kind = "fem"
law = "linear"
"""


def test_the_command_settles_a_study(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "study.toml"
    file.write_text(STUDY)
    assert main(["converge", str(file), "--out", str(tmp_path / "out"), "--json", "--tolerance", "0.02"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert {one["model"] for one in told} == {"springs", "linear"}
    tip = next(one for one in told if one["model"] == "linear" and one["quantity"].startswith("uy"))
    # Near Timoshenko's beam: P L^3 / (3 E I) + P L / (5/6 G A), a little stiffer as the clamp holds its height.
    beam = 8 / (3 * 1000 / 12) + 2 * 6 / 5 * 2 * 1.3 / 1000
    assert -tip["extrapolated"] == pytest.approx(beam, rel=0.03)
    assert 1.0 < tip["order"] < 2.2  # the corners of the clamp cost some of the second order
    assert json.loads((tmp_path / "out" / "study" / "converge.json").read_text()) == told
    rows = (tmp_path / "out" / "study" / "converge.csv").read_text().splitlines()
    assert len(rows) == 1 + sum(len(one["values"]) for one in told)
    errors = [abs(value / tip["extrapolated"] - 1) for value in tip["values"]]
    assert all(later < earlier for earlier, later in itertools.pairwise(errors))


def test_what_does_not_settle_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "study.toml"
    file.write_text(STUDY)
    arguments = ["converge", str(file), "--out", str(tmp_path / "out"), "--meshes", "2"]
    assert main(arguments) == 1
    assert "settled" not in capsys.readouterr().out
    assert main([*arguments, "--tolerance", "2"]) == 2


def test_a_network_is_as_fine_as_it_is() -> None:
    examples = Path(__file__).parent.parent / "examples"
    with pytest.raises(TruespringError, match="cannot be refined"):
        list(ts.converge(examples / "truss.toml"))
    assert len(list(ts.converge(examples / "bending.toml", most=1))) == 1
