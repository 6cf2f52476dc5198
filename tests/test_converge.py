"""Studies on finer and finer meshes."""

import itertools
import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.lines import Line2D

import truespring as ts
from tests.studies import changed, written
from truespring.calibration.study import calibrate_study
from truespring.cli import main
from truespring.converging import converge
from truespring.converging.converge import _watched
from truespring.converging.figures import settling_figures
from truespring.converging.settling import Attempt, refinement, settle
from truespring.errors import TruespringError
from truespring.mesh import refined
from truespring.study import Study, read_study
from truespring.validity import map_validity

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


INVERTED = """
[mesh]
shape = "rectangle"
size = ["100 mm", "10 mm"]
elements = [20, 2]
[material]
young = "50 kPa"
poisson = 0.2
[section]
kind = "plane-strain"
thickness = "10 mm"
[[support]]
on = "left"
[[support]]
on = "right"
[[load]]
on = "bottom"
pressure = "2 kPa"
[solver]
load_steps = 4
[models.springs]
kind = "springs"
rule = "isotropic"
volume = true
[compare]
references = []
probe = "bottom-middle"
"""


@pytest.mark.verification
def test_a_mesh_that_is_inverted_settles_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "inverted.toml"
    file.write_text(INVERTED)
    assert main(["converge", str(file), "--out", str(tmp_path / "out"), "--meshes", "3", "--tolerance", "0.3"]) == 1
    said = capsys.readouterr().out
    assert "settled" not in said and "The study does not settle: springs is inverted on 729 nodes" in said
    assert "inverted on 729 nodes" in (tmp_path / "out" / "inverted" / "converge.html").read_text()


def attempts(*statuses: str, model: str = "a") -> list[Attempt]:
    return [
        Attempt(
            model,
            10 * 4**place,
            status,
            1.0 if status != "not-converged" else 0.4,
            "load less",
            status != "not-converged",
        )
        for place, status in enumerate(statuses)
    ]


def values(*several: float) -> list[tuple[int, float]]:
    return [(10 * 4**place, value) for place, value in enumerate(several)]


def test_only_sound_meshes_settle() -> None:
    """Of the three that tell the order none may be inverted, unstable, or short of full load."""
    known = {("a", "energy", "J"): values(1.0, 1.0, 1.0)}
    sound = refinement(attempts(*["converged"] * 3), known, 0.01)
    assert (
        sound.settled and sound.ended and "have settled to 1 % on 3 meshes, the finest of 160 nodes" in sound.sentence
    )
    for place, bad in itertools.product(range(3), ("inverted", "unstable")):
        found = refinement(attempts(*[bad if place == other else "converged" for other in range(3)]), known, 0.01)
        assert not found.settled and not found.ended and f"a is {bad} on {10 * 4**place} nodes" in found.sentence
        assert not any(one.settled for one in found.quantities)
    short = refinement(attempts("converged", "not-converged"), {("a", "energy", "J"): values(1.0)}, 0.01)
    assert short.ended and not short.settled
    assert "a is not-converged beyond load factor 0.4 on 40 nodes" in short.sentence
    nothing = refinement(attempts("not-converged"), {}, 0.01)
    assert nothing.ended and not nothing.settled


def test_what_is_not_known_is_left_out() -> None:
    """As the energy that another program does not tell: it settles nothing, and no table has a NaN."""
    known = {("a", "uy", "m"): values(1.0, 1.001, 1.0015), ("a", "energy", "J"): values(math.nan, 1.0, 1.0)}
    found = refinement(attempts(*["converged"] * 3), known, 0.01)
    assert [one.quantity for one in found.quantities] == ["uy"] and found.settled


def test_what_is_zero_neither_hinders_nor_settles() -> None:
    """Of a quantity that is zero by symmetry there is only rounding, which settles nowhere and hinders nothing."""
    rounding = {("a", "ux", "m"): values(3e-17, -1e-17, 2e-17), ("a", "uz", "m"): values(0.0, 0.0, 0.0)}
    tip = {("a", "uy", "m"): values(1.0, 1.001, 1.0015)}
    found = refinement(attempts(*["converged"] * 3), {**rounding, **tip}, 0.01)
    assert [one.quantity for one in found.quantities if one.zero] == ["ux", "uz"]
    assert found.settled and [one.settled for one in found.quantities] == [False, False, True]
    coarse = refinement(attempts(*["converged"] * 3), {**rounding, ("a", "uy", "m"): values(1.0, 1.2, 1.3)}, 0.01)
    assert not coarse.settled and not any(one.settled for one in coarse.quantities)
    assert "uy of a is 7.1 % off" in coarse.sentence  # 1.4 at h = 0
    alone = refinement(attempts(*["converged"] * 3), rounding, 0.01)
    assert not alone.settled


MOVED = STUDY.replace(
    '[[load]]\non = "right"\nforce = [0.0, -1.0]', '[[support]]\non = "right"\nrotation = 0.1'
).replace('[models.springs]\nkind = "springs"\nrule = "isotropic"\n', "")


def test_force_and_torque_of_supports_settle_and_the_loop_stops_at_what_it_shows(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "turned.toml"
    file.write_text(MOVED)
    found = list(ts.converge(file, 0.05, 5))
    assert [one.ended for one in found] == [False] * (len(found) - 1) + [True]
    assert found[-1].settled and 3 <= len(found) < 5
    watched = {one.quantity: one for one in found[-1].quantities}
    assert watched["torque of right"].settled and not watched["torque of right"].zero
    assert main(["converge", str(file), "--out", str(tmp_path / "out"), "--tolerance", "0.05"]) == 0
    out = capsys.readouterr().out
    assert out.count("turned: ") == len(found) and "All watched quantities have settled to 5 %" in " ".join(out.split())
    page = (tmp_path / "out" / "turned" / "converge.html").read_text(encoding="utf-8")
    assert (
        "torque of right" in page
        and "have settled" in page
        and "http" not in page.split("</style>")[1].split("data:")[0]
    )


def test_a_network_is_as_fine_as_it_is() -> None:
    examples = Path(__file__).parent.parent / "examples"
    with pytest.raises(TruespringError, match="cannot be refined"):
        list(ts.converge(examples / "truss.toml"))
    assert len(list(ts.converge(examples / "bending.toml", most=1))) == 1


def test_an_energy_that_another_program_does_not_tell_is_not_watched() -> None:
    problem = ts.Problem(
        ts.rectangle((2.0, 1.0), (2, 1)),
        ts.Material(1e3, 0.3),
        ts.PlaneStress(1.0),
        [ts.Fixed("left")],
        [ts.Force("right", (1.0, 0.0))],
    )
    path = ts.solve(problem, ts.Fem("linear"))
    told = [quantity for quantity, _, _ in _watched(path, 0)]
    lost = replace(path, states=(*path.states[:-1], replace(path.states[-1], energy=float("nan"))))
    assert "energy" in told
    assert [quantity for quantity, _, _ in _watched(lost, 0)] == [one for one in told if one != "energy"]


def test_a_model_whose_quantities_are_all_zero_is_told() -> None:
    """Also where all quantities of the others have settled."""
    attempts = [Attempt(name, 10 * 4**mesh, "converged", 1.0, "", True) for mesh in range(3) for name in ("a", "b")]
    values = {
        ("a", "energy", "J"): [(10 * 4**mesh, 1.0) for mesh in range(3)],
        ("b", "energy", "J"): [(10 * 4**mesh, 0.0) for mesh in range(3)],
    }
    found = refinement(attempts, values, 0.01)
    assert not found.settled and "all watched quantities of b are zero" in found.sentence


def test_the_figure_of_a_quantity_has_its_limit_at_size_zero() -> None:
    """Values 1 + h^2 for h = 1, 1/2, 1/4, whose limit is 1."""
    attempts = [Attempt("a", 10 * 4**mesh, "converged", 1.0, "", True) for mesh in range(3)]
    values = {("a", "energy", "J"): [(10 * 4**mesh, 1.0 + 0.25**mesh) for mesh in range(3)]}
    sheet = dict(settling_figures(refinement(attempts, values, 0.5)))["converge_energy"]
    (line,) = [one for one in sheet.artists if isinstance(one, Line2D) and one.get_label() == "a"]
    assert line.get_xdata() == pytest.approx([0, 0.25, 0.5, 1.0])
    assert line.get_ydata() == pytest.approx([1.0, 1.0625, 1.25, 2.0])


def test_the_result_is_a_table_figures_and_files(tmp_path: Path) -> None:
    *_, found = ts.converge(written(tmp_path), most=2)
    assert found.table().height == len(found.rows) == sum(len(one.values) for one in found.quantities) > 4
    figures = found.figures()
    assert {"converge", "converge_energy", "converge_ux_of_the_probe"} <= figures.keys()
    assert {sheet.svg()[:5] for sheet in figures.values()} == {b"<?xml"}
    files = found.write(tmp_path / "out")
    assert all(file.is_file() and file.parent == tmp_path / "out" / "study" for file in files.values())


# --- studies without a last level to compare ----------------------------------------------------------------------

_MOVES = ("poisson = 0.3", "poisson = 0.3\ndensity = 1000\n[dynamics]\nduration = 0.1")
_BACK = ('on = "right"', 'on = "right"\nover = [[0, 0], [0.5, 1], [1, 0]]')
_TOOL = (
    '[[tool]]\nshape = "plane"\nnormal = [0, -1]\npath = [[0, 0, 0.011], [0.5, 0, 0.009], [1, 0, 0.011]]\n\n[solver]'
)
_RETRACTS = ("[solver]", _TOOL)
_PRESSES = ("[solver]", _TOOL.replace(", [1, 0, 0.011]", "").replace("0.5", "1"))


@pytest.mark.parametrize("verb", [map_validity, lambda study: next(converge(study)), calibrate_study])
@pytest.mark.parametrize(
    ("change", "key"),
    [(_MOVES, "dynamics"), (_BACK, "load.1.over"), (_RETRACTS, "tool.1.path")],
    ids=["motion", "history", "tool"],
)
def test_verbs_that_compare_the_last_level_need_one(
    verb: Callable[[Study], object], change: tuple[str, str], key: str, tmp_path: Path
) -> None:
    study = read_study(written(tmp_path, changed(change)))
    with pytest.raises(TruespringError, match=rf"study\.toml:\d+: {key}: .*(leave|end|give)"):
        verb(study)


def test_the_force_on_a_tool_settles_too(tmp_path: Path) -> None:
    found = next(converge(read_study(written(tmp_path, changed(_PRESSES))), most=1))
    forces = {one.model: one.values[0] for one in found.quantities if one.quantity == "force of tool 1"}
    assert set(forces) == {"springs", "linear"} and all(force > 0 for force in forces.values())
