"""The command line and what it leaves behind: the contract that other programs rely on."""

import csv
import html
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
import trimesh

from tests.studies import changed, written
from tests.wording import in_order
from truespring.cli import main
from truespring.outputs import UNFINISHED, Lock
from truespring.study import read_study

MODELS = ["springs", "linear"]
MOVED = (
    '[[load]]\non = "right"\nforce = ["0 N", "-0.01 N"]\n',
    '[[support]]\non = "right"\nfix = ["x"]\ndisplacement = ["4 mm", "0 mm"]\n',
)


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The outputs of verify on one small study."""
    folder = tmp_path_factory.mktemp("verified")
    assert main(["verify", str(written(folder)), "--out", str(folder / "out"), "--quiet"]) == 0
    return folder / "out"


def rows(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_verify_writes_every_file_of_the_contract(out: Path) -> None:
    assert {path.name for path in out.iterdir()} == {"study", "report.html"}
    expected = {"curves.csv", "summary.json", "mesh.vtu", "open_in_paraview.py", "figures", "report.html"}
    for model in MODELS:
        expected |= {f"{model}.pvd", model, f"deformed_{model}.stl"}
    # A hidden list of them all is for the next run.
    assert {path.name for path in (out / "study").iterdir()} == {*expected, ".truespring.json"}
    page = (out / "report.html").read_bytes()
    assert page == (out / "study" / "report.html").read_bytes()
    problem = read_study(out.parent / "study.toml").problem
    for words in (problem.loads[0].words(), problem.supports[0].words(2)):
        assert words in html.unescape(page.decode())
    figures = {path.name for path in (out / "study" / "figures").iterdir()}
    for name in ("undeformed", "curves", "springs_over_linear"):
        assert {f"{name}.png", f"{name}.svg"} <= figures


def test_curves(out: Path) -> None:
    table = rows(out / "study" / "curves.csv")
    assert list(table[0]) == ["model", "load_factor", "ux", "uy", "fx", "fy"]
    for model in MODELS:
        mine = [row for row in table if row["model"] == model]
        assert [float(row["load_factor"]) for row in mine] == [0.0, 0.5, 1.0]
        assert [float(row["fy"]) for row in mine] == pytest.approx([0.0, -0.005, -0.01])
        deflections = [float(row["uy"]) for row in mine]
        assert deflections[0] == 0.0
        assert deflections[2] < deflections[1] < 0
    linear = [float(row["uy"]) for row in table if row["model"] == "linear"]
    assert linear[2] == pytest.approx(2 * linear[1], rel=1e-9)


def test_summary(out: Path) -> None:
    summary = json.loads((out / "study" / "summary.json").read_text(encoding="utf-8"))
    assert list(summary) == ["title", "truespring", "model", "models", "probe", "comparison", "closest"]
    springs, linear = summary["models"]["springs"], summary["models"]["linear"]
    assert springs["status"] == linear["status"] == "converged"
    assert (springs["kind"], linear["kind"]) == ("springs", "fem")
    assert springs["load_factor"] == 1.0
    assert springs["n_nodes"] == 27 and springs["n_unknowns"] == 48
    assert springs["newton_iterations"] > 0 and springs["seconds"] > 0
    assert springs["moduli"]["young"] == pytest.approx(15 / 17 * 10e3)
    assert springs["moduli"]["poisson"] == pytest.approx(7 / 17)
    assert springs["moduli"]["anisotropy"] == pytest.approx(7 / 5)
    # What the springs realise differs from the material (nu 0.3): both numbers are named.
    assert "0.882 to 1.105" in springs["warnings"][0]
    assert "0.412" in springs["warnings"][1] and "0.300" in springs["warnings"][1]
    assert springs["moduli"]["young_max"] == pytest.approx(21 / 19 * 10e3)
    assert "moduli" not in linear and linear["warnings"] == []
    assert summary["closest"] == "linear"
    errors = summary["comparison"]["linear"]
    wanted = ["probe_error", "rms_error", "max_error", "agrees_up_to_load_factor", "reference_error", "refined_error"]
    assert list(errors) == wanted
    table = {(row["model"], row["load_factor"]): row for row in rows(out / "study" / "curves.csv")}
    mine, theirs = (np.array([float(table[m, "1.0"][u]) for u in ("ux", "uy")]) for m in MODELS)
    assert errors["probe_error"] == pytest.approx(np.linalg.norm(mine - theirs) / np.linalg.norm(theirs), rel=1e-9)


def test_vtu_series(out: Path) -> None:
    for model, kind, fields in (
        ("springs", "line", {"tension", "stretch", "stiffness", "strain_energy"}),
        ("linear", "quad", {"stress", "strain_energy"}),
    ):
        collection = ElementTree.parse(out / "study" / f"{model}.pvd").getroot()
        sets = collection.findall("./Collection/DataSet")
        assert [float(one.attrib["timestep"]) for one in sets] == [0.0, 0.5, 1.0]
        last = meshio.read(out / "study" / sets[-1].attrib["file"])
        assert [block.type for block in last.cells] == [kind]
        assert set(last.cell_data) == fields
        assert set(last.point_data) == {"displacement", "reaction"}
        reaction = last.point_data["reaction"].sum(axis=0)
        assert reaction == pytest.approx([0, 0.01, 0], abs=1e-10)
        curve = [row for row in rows(out / "study" / "curves.csv") if row["model"] == model][-1]
        probe = np.flatnonzero(np.abs(last.points - [0.04, 0.005, 0]).max(axis=1) < 1e-9)
        assert last.point_data["displacement"][probe[0], 1] == pytest.approx(float(curve["uy"]), rel=1e-12)


def test_stress_of_the_elements_balances_the_load(out: Path) -> None:
    """The shear force through any column of elements is the load: mean stress times area [N]."""
    mesh = meshio.read(out / "study" / "linear" / "linear_0002.vtu")
    middle = mesh.points[mesh.cells[0].data].mean(axis=1)
    column = np.isclose(middle[:, 0], 0.0225)
    assert column.sum() == 2
    shear = mesh.cell_data["stress"][0].reshape(-1, 3, 3)[column, 0, 1]
    assert shear.mean() * 0.01 * 0.01 == pytest.approx(-0.01, rel=1e-9)


def test_deformed_stl(out: Path) -> None:
    for model in MODELS:
        surface = trimesh.load_mesh(out / "study" / f"deformed_{model}.stl")
        assert len(surface.faces) == 2 * 16
        last = meshio.read(out / "study" / model / f"{model}_0002.vtu")
        deformed = last.points + last.point_data["displacement"]
        distance = np.linalg.norm(surface.vertices[:, None] - deformed, axis=2)
        assert len(surface.vertices) == len(deformed)
        # STL holds single precision of a body of 40 mm.
        assert distance.min(axis=0).max() < 1e-8 and distance.min(axis=1).max() < 1e-8


def test_json_is_all_that_stands_on_standard_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = written(tmp_path, name="first.toml"), written(tmp_path, name="second.toml")
    assert main(["solve", str(first), "--out", str(tmp_path / "out"), "--json", "--threads", "1"]) == 0
    assert list(json.loads(capsys.readouterr().out)["models"]) == MODELS
    assert main(["solve", str(first), str(second), "--out", str(tmp_path / "out"), "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)) == ["first", "second"]


def test_quiet_prints_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solve", str(written(tmp_path)), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    printed = capsys.readouterr()
    assert printed.out == "" and printed.err == ""


def test_solve_writes_no_comparison(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["solve", str(written(tmp_path)), "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    assert "springs (lloyd)" in shown and "Zener" not in shown
    names = {path.name for path in (tmp_path / "out" / "study").iterdir()}
    assert "curves.csv" in names and not names & {"report.html", "figures"}
    assert json.loads((tmp_path / "out" / "study" / "summary.json").read_text("utf-8"))["comparison"] == {}


def test_check_solves_nothing_and_shows_the_moduli(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path)
    out = tmp_path / "out"
    assert main(["check", str(file), "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    for text in ("8.824 to 11.05 kPa", "0.263 to 0.412"):
        assert text in " ".join(shown.split())
    assert "Zener" not in shown
    brief = " ".join(shown.split())
    assert in_order(brief, "8.824", "(material 10 kPa, 0.300)", "'springs'", "not fit", 'rule = "gaussian"', "-v")
    assert shown.splitlines()[-1] == f"picture: {out / 'study' / 'check.png'}"
    assert {one.name for one in (out / "study").iterdir()} == {"check.png", ".truespring.json"}
    assert (out / "study" / "check.png").read_bytes().startswith(b"\x89PNG")
    assert main(["check", str(file), "-v", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    for text in ("27 nodes", "16 elements", "48 unknowns", "Zener", "1.4000", "bending factor EI, 2 elements deep"):
        assert text in shown
    assert main(["check", str(file), "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert not plan["models"]["springs"]["fit"] and 'rule = "gaussian"' in plan["models"]["springs"]["sentence"]
    reasons = plan["models"]["springs"]["sentence"].split(". ")[0]
    assert in_order(reasons, "0.882", "1.105", "0.263", "0.412", "0.300")
    assert reasons in " ".join(shown.split()) and reasons not in brief
    assert plan["total_force"] == pytest.approx([0, -0.01])
    problem = read_study(file).problem
    stated = {"supports": [one.words(2) for one in problem.supports], "loads": [one.words() for one in problem.loads]}
    assert {key: plan[key] for key in stated} == stated
    assert all(words in shown for several in stated.values() for words in several)
    assert plan["models"]["springs"]["n_springs"] == 8 * 3 + 2 * 9 + 2 * 16
    assert {path.name for path in tmp_path.iterdir()} == {"study.toml", "out"}


def test_check_needs_no_picture_unless_out_is_given(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    written(tmp_path)

    def require_no_picture() -> None:
        assert main(["check", "study.toml"]) == 0
        printed = capsys.readouterr()
        assert "27 nodes" in printed.out and "check.png" not in printed.out
        assert len(printed.err.splitlines()) == 1
        assert main(["check", "study.toml", "--out", "out"]) == 2
        capsys.readouterr()
        assert main(["check", "study.toml", "--quiet"]) == 0
        assert capsys.readouterr() == ("", "")

    Path("out").touch()
    require_no_picture()
    Path("out").unlink()
    with Lock(Path("out/study")):
        require_no_picture()
        Path("out/study", UNFINISHED).touch()
    require_no_picture()
    Path("out/study", UNFINISHED).unlink()
    assert main(["check", "study.toml"]) == 0
    assert Path("out/study/check.png").is_file() and capsys.readouterr().err == ""


def test_plane_strain_says_which_moduli_it_compares(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path, changed(('"plane-stress"', '"plane-strain"')))
    for option in ([], ["-v"]):
        assert main(["check", str(file), "--out", str(tmp_path), *option]) == 0
        shown = capsys.readouterr().out
        assert "E / (1 - nu^2) and nu / (1 - nu)" in shown
        assert ("0.4286" if option else "0.429") in shown  # 3 / 7


def test_schema_describes_the_study(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    # A body in 3D has no section, a network no material, a body that moves or that a grasp holds no support.
    assert set(schema["required"]) == {"mesh", "models"}
    assert schema["$defs"]["SpringsKeys"]["properties"]["rule"]["anyOf"][0]["enum"][0] == "lloyd"


def test_prescribed_motion_without_loads(tmp_path: Path) -> None:
    """The force of the curves is the reaction, and it does the work that the springs store."""
    assert main(["solve", str(written(tmp_path, changed(MOVED))), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    table = rows(tmp_path / "out" / "study" / "curves.csv")
    linear = [row for row in table if row["model"] == "linear"]
    assert float(linear[-1]["ux"]) == pytest.approx(0.004)
    energy = meshio.read(tmp_path / "out" / "study" / "linear" / "linear_0002.vtu").cell_data["strain_energy"][0].sum()
    assert float(linear[-1]["fx"]) * 0.004 / 2 == pytest.approx(energy, rel=1e-9)


def test_the_reaction_counts_every_held_direction_of_what_moves(tmp_path: Path) -> None:
    """Both directions of the right side are held, one of them at rest: the curves tell the force on all of it."""
    text = changed((MOVED[0], MOVED[1].replace('fix = ["x"]\n', "").replace('["4 mm", "0 mm"]', '["0 mm", "-8 mm"]')))
    assert main(["solve", str(written(tmp_path, text)), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    table = [row for row in rows(tmp_path / "out" / "study" / "curves.csv") if row["model"] == "springs"]
    last = meshio.read(tmp_path / "out" / "study" / "springs" / "springs_0002.vtu")
    right = np.isclose(last.points[:, 0], 0.04)
    force = last.point_data["reaction"][right].sum(axis=0)
    assert force[0] > 0.1 * abs(force[1])
    assert [float(table[-1]["fx"]), float(table[-1]["fy"])] == pytest.approx(force[:2], rel=1e-12)


def test_results_of_a_former_run_are_cleared(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["verify", str(written(tmp_path)), "--out", str(out), "--quiet"]) == 0
    (out / "study" / "notes.txt").write_text("mine", encoding="utf-8")
    renamed = changed(("[models.linear]", "[models.hooke]"))
    assert main(["solve", str(written(tmp_path, renamed)), "--out", str(out), "--quiet"]) == 0
    names = {path.name for path in (out / "study").iterdir()}
    assert "notes.txt" in names and "hooke.pvd" in names
    assert not names & {"linear", "linear.pvd", "deformed_linear.stl", "figures", "report.html"}


def test_a_byte_order_mark_is_no_fault(tmp_path: Path) -> None:
    file = written(tmp_path, "\ufeff" + changed(("[material]", "[ material ]")))
    assert main(["check", str(file), "--quiet"]) == 0


def test_a_failure_keeps_what_was_reached(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """St. Venant-Kirchhoff bears no nominal stress below -E sqrt(3) / 9 in uniaxial compression; springs go on."""
    pressed = changed(
        ('on = "left"', 'on = "left"\nfix = ["x"]\n\n[[support]]\non = "bottom"\nfix = ["y"]'),
        ('["0 N", "-0.01 N"]', '["-0.25 N", "0 N"]'),
        ("load_steps = 2", "load_steps = 5"),
        ("elements = [8, 2]", "elements = [4, 1]"),
        ('law = "linear"', 'law = "saint-venant-kirchhoff"'),
    )
    out = tmp_path / "out"
    assert main(["verify", str(written(tmp_path, pressed)), "--out", str(out), "--json"]) == 1
    printed = capsys.readouterr()
    summary = json.loads(printed.out)
    failed = summary["models"]["linear"]
    assert failed["status"] != "converged"
    assert summary["models"]["springs"]["status"] == "converged"
    assert f"{failed['load_factor']:.6g}" in printed.err
    assert failed["warnings"]
    # The level that was reached is in the curves, and at most what the law bears.
    levels = [float(row["load_factor"]) for row in rows(out / "study" / "curves.csv") if row["model"] == "linear"]
    assert levels[-1] == failed["load_factor"] == pytest.approx(3**0.5 / 9 / 0.25, rel=0.01)
    assert (out / "report.html").exists()


def deformed_by_another_program(folder: Path, out: Path) -> Iterator[str]:
    """The STL of a former run as the result of another program, and the undeformed body, as text for the study."""
    springs = meshio.read(out / "study" / "linear" / "linear_0000.vtu")
    faces = np.concatenate([springs.cells[0].data[:, [0, 1, 2]], springs.cells[0].data[:, [0, 2, 3]]])
    trimesh.Trimesh(springs.points, faces, process=False).export(folder / "rest.stl")
    (folder / "deformed.stl").write_bytes((out / "study" / "deformed_linear.stl").read_bytes())
    yield '[models.other]\nkind = "stl"\nfile = "deformed.stl"\n\n[compare]'
    yield '[models.other]\nkind = "stl"\nfile = "deformed.stl"\nundeformed = "rest.stl"\n\n[compare]'


def test_a_deformed_mesh_of_another_program(tmp_path: Path, out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    surface, displaced = deformed_by_another_program(tmp_path, out)

    def verified(text: str) -> dict[str, Any]:
        file = written(tmp_path, changed(("[compare]", text)))
        assert main(["verify", str(file), "--out", str(tmp_path / "out"), "--json"]) == 0
        return dict(json.loads(capsys.readouterr().out)["comparison"])

    comparison = verified(surface)
    assert comparison["other"]["rms_error"] is None
    # The file is the linear path's own: the springs' outline differs from it by about their tip's error.
    assert 1e-4 < comparison["other"]["outline_distance"]["max"] < 1e-2
    comparison = verified(displaced)
    # STL holds single precision: the errors against the file and against the path itself agree to that.
    assert comparison["other"]["rms_error"] == pytest.approx(comparison["linear"]["rms_error"], rel=1e-5)
    assert comparison["other"]["agrees_up_to_load_factor"] is None


def test_the_command_is_installed_and_answers() -> None:
    shown = subprocess.run(
        [sys.executable, "-m", "truespring", "--help"],
        capture_output=True,
        text=True,
        check=True,
    )
    for verb in ("verify", "solve", "moduli", "rules", "check", "schema"):
        assert verb in shown.stdout


def test_the_garbage_collector_works_on_and_passes_over_what_was_imported() -> None:
    asked = "import gc; from truespring.cli import main; main(['schema']); print(gc.isenabled(), gc.get_freeze_count())"
    shown = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True).stdout
    enabled, frozen = shown.split()[-2:]
    assert enabled == "True" and int(frozen) > 10_000


def test_a_network_is_checked_and_solved_as_any_study(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truss = str(Path(__file__).parent.parent / "examples" / "truss.toml")
    assert main(["check", truss, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["models"]["truss"] == {
        "kind": "network",
        "label": "springs",
        "law": "straight",
        "n_springs": 2,
        "warnings": [],
    }
    assert told["material"] is None and told["load_steps"] == 18
    assert main(["check", truss, "--out", str(tmp_path)]) == 0 and "total force (0, -4) N" in capsys.readouterr().out
    assert main(["verify", truss, "--out", str(tmp_path)]) == 0
    assert "limit points at load factors 0.7401 and -0.7401" in " ".join(capsys.readouterr().out.split())
    rows = (tmp_path / "truss" / "curves.csv").read_text().splitlines()
    assert rows[0] == "model,load_factor,ux,uy,fx,fy,state"
    assert sum(row.endswith("limit point") for row in rows) == 2 and sum(row.endswith("unstable") for row in rows) == 9
    assert (tmp_path / "truss" / "report.html").is_file() and (tmp_path / "truss" / "truss.pvd").is_file()
