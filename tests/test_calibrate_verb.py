"""truespring calibrate: what it writes runs, exports and tells its error; what does not go together is refused."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.studies import STUDY, changed, written
from tests.test_examples import EXAMPLES
from truespring.calibration import turned
from truespring.calibration.study import calibrate_study
from truespring.calibration.writing import write_calibrated
from truespring.cli import main
from truespring.comparison import compare
from truespring.equilibrium import solve
from truespring.errors import MeshError, StudyError
from truespring.loading import Fixed, Force, Moment
from truespring.material import Material
from truespring.mesh import box, in_simplices, rectangle, refined
from truespring.models import Fem, PrescribedSprings, Springs
from truespring.problem import Problem
from truespring.report.result import head_note
from truespring.report.series import write_mesh
from truespring.study import export_study, read_study, run
from truespring.study.spring_files import read_spring_files, write_spring_files
from truespring.study.toml import toml_text

NEO = '[models.linear]\nkind = "fem"\nlaw = "linear"\n'
REFERENCE = (NEO, NEO + '\n[models.neo]\nkind = "fem"\nlaw = "neo-hookean"\n')
UP = changed(REFERENCE, ('["0 N", "-0.01 N"]', '["0.002 N", "0.008 N"]'))


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the verb wrote for a small study, with another load held out."""
    folder = tmp_path_factory.mktemp("calibrate")
    study, held = written(folder, changed(REFERENCE, ("refine = false", ""))), written(folder, UP, "up.toml")
    assert main(["calibrate", str(study), "--held-out", str(held), "--out", str(folder / "out"), "--quiet"]) == 0
    return folder / "out" / "study"


def test_what_is_written(out: Path) -> None:
    assert {file.name for file in out.iterdir()} == {
        *("calibrated.toml", "calibrated.csv", "calibrate.json", "report.html", "figures", ".truespring.json")
    }
    values = json.loads((out / "calibrate.json").read_text(encoding="utf-8"))
    held = next(one for one in values["cases"] if one["held_out"])
    assert held["name"] == "up" and values["held_out_error"] == held["error_after"] < held["error_before"]
    assert values["reference"] == "neo" and values["unknowns"] == "class"
    assert [one["name"] for one in values["values"]] == ["diagonal", "edge along x", "edge along y"]
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "loads held out" in page and 'src="http' not in page and page.count("<img") >= 4


def test_the_calibrated_study_runs_and_gives_the_errors_that_it_tells(out: Path) -> None:
    study = read_study(out / "calibrated.toml")
    values = json.loads((out / "calibrate.json").read_text(encoding="utf-8"))
    assert isinstance(study.entries["calibrated"], PrescribedSprings) and study.model == "calibrated"
    result = run(study)
    fitted = next(one for one in values["cases"] if not one["held_out"])
    assert result.converged
    # The study's own reference is of first order; what was fitted to is that refined.
    assert result.standings["neo"].refined_error == pytest.approx(fitted["error_after"], rel=1e-6)
    assert "neo-Hookean FEM of second order on the same nodes, itself about" in values["headline"]
    rule = result.solutions["springs"]
    assert (
        rule.moduli is not None and result.solutions["calibrated"].moduli is None
    )  # none are told that are the rule's
    head = result.note
    assert values["headline"] in head and "springs (lloyd)" in head.lower()


def test_what_springs_are_fitted_to_is_the_truth_and_not_the_elements_of_their_own_mesh(out: Path) -> None:
    """Four-node elements two deep are 9 % too stiff; the truth is of second order, on a mesh twice halved."""
    study = read_study(out / "calibrated.toml")
    mesh = refined(refined(in_simplices(study.problem.mesh)[0]))
    truth = solve(replace(study.problem, mesh=mesh), Fem("neo-hookean"), study.solver)
    springs, four_node = (
        solve(study.problem, one, study.solver) for one in (study.entries["calibrated"], Fem("neo-hookean"))
    )  # type: ignore[arg-type]
    values = json.loads((out / "calibrate.json").read_text(encoding="utf-8"))
    fitted = next(one for one in values["cases"] if not one["held_out"])
    told = compare(springs, truth).error
    assert told is not None and compare(four_node, truth).error > 0.08  # type: ignore[operator]
    assert told == pytest.approx(fitted["error_after"], abs=0.006) and told < 0.03


def test_what_it_is_exported_to_tells_the_error_in_its_header(out: Path, tmp_path: Path) -> None:
    (carried,) = export_study(read_study(out / "calibrated.toml"), ["calculix"], tmp_path)
    deck = " ".join((tmp_path / "calibrated" / "springs.inp").read_text(encoding="utf-8").replace("**", "").split())
    values = json.loads((out / "calibrate.json").read_text(encoding="utf-8"))
    assert carried.converged and values["headline"] in deck
    plain = written(tmp_path, STUDY)
    export_study(read_study(plain), ["json"], tmp_path)
    header = json.loads((tmp_path / "study" / "springs.json").read_text(encoding="utf-8"))["header"]
    assert head_note(STUDY) == "" and not any("calibrated" in line for line in header)


def test_json_is_all_that_stands_on_standard_output(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = written(tmp_path, changed(REFERENCE))
    assert main(["calibrate", str(study), "--to", "linear", "--out", str(tmp_path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["reference"] == "linear"
    (held,) = [one for one in told["cases"] if one["held_out"]]
    assert held["name"] == "study, its load turned by 45 degrees" and held["error_after"] is not None


def test_markers_are_fitted_and_nothing_is_held_out_which_is_said(tmp_path: Path) -> None:
    study = read_study(written(tmp_path, changed(REFERENCE)))
    path = run(study).solutions["neo"]
    places = np.array([[0.021, 0.004], [0.038, 0.0075]])
    moved = path.whole.locate(places).carry(path.states[-1].displacement)
    rows = [",".join(f"{1e3 * value:.12g}" for value in (*at, *u)) for at, u in zip(places, moved, strict=True)]
    markers = tmp_path / "markers.csv"
    markers.write_text("\n".join(["x [mm],y [mm],ux [mm],uy [mm]", *rows]), encoding="utf-8")
    out = tmp_path / "out"
    assert main(["calibrate", str(study.file), "--markers", str(markers), "--out", str(out), "--quiet"]) == 0
    told = json.loads((out / "study" / "calibrate.json").read_text(encoding="utf-8"))
    assert told["held_out_error"] is None and "No load was held out" in told["headline"]
    (fitted,) = told["cases"]
    assert fitted["error_after"] < 0.2 * fitted["error_before"]
    assert run(read_study(out / "study" / "calibrated.toml")).converged


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["{study}", "--to", "neos"], "did you mean 'neo'"),
        (["{study}", "{fine}"], "its mesh differs"),
        (["{study}", "--held-out", "{stiff}"], "its material differs"),
        (["{study}", "--unknowns", "row"], "'row' is unknown"),
        (["{study}", "--unknowns", "region"], "'region'"),
        (["{study}", "--regularisation", "-1"], "regularisation = -1"),
        (["{alone}"], "add a model of kind fem"),
        (["{none}"], "springs of a rule"),
        (["{arc}"], 'control = "load"'),
        (["{study}", "--markers", "{missing}"], "does not exist"),
    ],
)
def test_what_does_not_go_together_is_refused(
    arguments: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = changed(REFERENCE)
    springs = '[models.springs]\nkind = "springs"\nrule = "lloyd"\n'
    texts = {
        "study": own,
        "fine": own.replace("[8, 2]", "[16, 4]"),
        "stiff": own.replace("10 kPa", "20 kPa"),
        "alone": STUDY.replace(NEO, ""),
        "none": own.replace(springs, ""),
        "arc": own.replace("load_steps = 2", 'load_steps = 2\ncontrol = "arc-length"'),
    }
    files = {name: str(written(tmp_path, text, f"{name}.toml")) for name, text in texts.items()}
    files["missing"] = str(tmp_path / "missing.csv")
    assert main(["calibrate", *(one.format(**files) for one in arguments), "--out", str(tmp_path / "out")]) == 2
    assert said in capsys.readouterr().err


def test_a_volume_term_is_calibrated_and_read_again(tmp_path: Path) -> None:
    text = (
        changed(REFERENCE)
        .replace(
            'shape = "rectangle"\nsize = ["40 mm", "10 mm"]\nelements = [8, 2]',
            'shape = "box"\nsize = ["20 mm", "5 mm", "5 mm"]\nelements = [4, 1, 1]',
        )
        .replace('[section]\nkind = "plane-stress"\nthickness = "10 mm"\n\n', "")
        .replace('["0 N", "-0.01 N"]', '["0 N", "-0.01 N", "0 N"]')
        .replace("poisson = 0.3", "poisson = 0.4")
        .replace('rule = "lloyd"', 'rule = "isotropic"\nvolume = true')
    )
    found = calibrate_study(read_study(written(tmp_path, text)))
    files = write_calibrated(found, tmp_path / "out", "")
    assert {"calibrated.csv", "calibrated_volume.csv"} < {file.name for file in files}
    assert "volume term" in found.calibration.unknowns.names
    again = read_study(files[0]).entries["calibrated"]
    assert isinstance(again, PrescribedSprings)
    assert again.stiffness.tolist() == found.calibration.model.stiffness.tolist()
    assert again.kappa.tolist() == found.calibration.model.kappa.tolist() and again.kappa.any()


@pytest.mark.parametrize("kind", ["hourglass", "material"])
def test_parameters_are_calibrated_and_read_again(kind: str, tmp_path: Path) -> None:
    """The calibrated study contains the parameters; it has the error that the calibration states."""
    text = changed(REFERENCE, ('rule = "lloyd"', 'rule = "gaussian"')).replace('"10 kPa"', '"9 kPa"')
    text = text.replace('law = "neo-hookean"', 'law = "neo-hookean"\nelement = "linear"')
    study = written(tmp_path, text)
    assert main(["calibrate", str(study), "--unknowns", kind, "--out", str(tmp_path / "out"), "--quiet"]) == 0
    folder = tmp_path / "out" / "study"
    assert "calibrated.csv" not in {file.name for file in folder.iterdir()}
    (factor,) = [one["value"] for one in json.loads((folder / "calibrate.json").read_text(encoding="utf-8"))["values"]]
    assert abs(factor - 1) > 1e-3
    tables = tomllib.loads((folder / "calibrated.toml").read_text(encoding="utf-8"))
    found = read_study(folder / "calibrated.toml")
    springs = found.entries["calibrated"]
    assert isinstance(springs, Springs)
    if kind == "hourglass":
        assert tables["models"]["calibrated"] == {"kind": "springs", "rule": "gaussian", "hourglass": springs.hourglass}
        assert springs.hourglass == pytest.approx(factor, rel=1e-9)
    else:
        assert tables["material"]["young"] == pytest.approx(9e3 * factor, rel=1e-9)
        assert found.problem.material is not None and found.problem.material.poisson == 0.3


def test_files_of_a_study_are_found_from_where_the_calibrated_one_stands(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    write_mesh(rectangle((0.04, 0.01), (8, 2)), tmp_path / "there" / "body.vtu")
    shape = 'shape = "rectangle"\nsize = ["40 mm", "10 mm"]\nelements = [8, 2]'
    text = changed(REFERENCE, (shape, 'file = "body.vtu"'))
    study = read_study(written(tmp_path / "there", text))
    found = calibrate_study(study)
    files = write_calibrated(found, tmp_path / "elsewhere", "")
    assert tomllib.loads(files[0].read_text(encoding="utf-8"))["mesh"]["file"] == "../../there/body.vtu"
    assert len(read_study(files[0]).problem.mesh.nodes) == len(study.problem.mesh.nodes)


def test_springs_in_a_file_are_checked(tmp_path: Path) -> None:
    problem = read_study(written(tmp_path)).problem
    potential = Springs("lloyd").potential(problem)
    file, volume = tmp_path / "k.csv", tmp_path / "kappa.csv"
    write_spring_files(PrescribedSprings(potential.springs, potential.stiffness), file, volume)
    assert read_spring_files(problem, file).stiffness == pytest.approx(potential.stiffness, rel=1e-15)
    names, *rows = file.read_text(encoding="utf-8").splitlines()
    a, b, k = rows[0].split(",")
    for changed_rows, said in (
        ([*rows[1:]], "k.csv: 1 of 74 springs .*missing.* 0-1"),
        ([f"{b},{a},{k}", *rows], ":3: spring 0-1 .*twice"),
        ([f"{a},7,{k}", *rows[1:]], ":2: .* nodes 0 and 7 "),
        ([f"{a},99,{k}", *rows[1:]], ":2: b = 99: .* 0 to 26"),
        ([f"{a},{b},-1", *rows[1:]], ":2: stiffness = -1 N/m .*allow_negative"),
        ([f"{a},{b},x", *rows[1:]], ":2: stiffness = 'x' .*number"),
    ):
        file.write_text("\n".join([names, *changed_rows]), encoding="utf-8")
        with pytest.raises(MeshError, match=said):
            read_spring_files(problem, file)
    file.write_text("\n".join([names, *rows]), encoding="utf-8")
    for table, said in (
        ("", "edge .*missing.* file"),
        ('file = "k.csv", edge = 0.3', "leave edge, diagonal and body out"),
        ('edge = 0.3, volume = "kappa.csv"', "volume.* needs file"),
    ):
        text = STUDY.replace('rule = "lloyd"', f"stiffness = {{ {table} }}")
        with pytest.raises(StudyError, match=said):
            read_study(written(tmp_path, text))
    with pytest.raises(StudyError, match="leave rule out"):
        read_study(written(tmp_path, STUDY.replace('rule = "lloyd"', 'rule = "lloyd"\nstiffness = { file = "k.csv" }')))
    zeros = [",".join([*row.split(",")[:2], "0"]) for row in rows]
    for left, said in ((rows[:9], "mechanism"), ([], "positive stiffness")):
        file.write_text("\n".join([names, *left, *zeros[len(left) :]]), encoding="utf-8")
        with pytest.raises(StudyError, match=said):
            read_study(written(tmp_path, STUDY.replace('rule = "lloyd"', 'stiffness = { file = "k.csv" }')))


@pytest.mark.parametrize("file", sorted(EXAMPLES.rglob("*.toml")), ids=lambda file: file.stem)
def test_studies_survive_being_written_again(file: Path) -> None:
    tables = tomllib.loads(file.read_text(encoding="utf-8"))
    assert tomllib.loads(toml_text(tables)) == tables


def test_texts_and_tables_of_any_kind_are_written() -> None:
    tables = {"a": 'quoted "\\\n', "b": [True, 1.5e-9, [1, 2]], "t": {"x": {"y": {"z w": "é"}}}, "l": [{"q": {"r": 1}}]}
    assert tomllib.loads(toml_text(tables)) == tables


def test_loads_are_turned_and_those_that_follow_stay() -> None:
    problem = read_study(EXAMPLES / "bending.toml").problem
    other = turned(problem, np.pi / 2)
    assert other is not None
    assert other.loading.external_force.sum(axis=0) == pytest.approx([0.0428, 0.0], abs=1e-12)
    supports = [Fixed("left"), Fixed("right", displacement=(0.0, 0.003, -0.004))]
    solid = Problem(box((0.02, 0.01, 0.01), (2, 1, 1)), Material(1e3, 0.3), supports=supports)
    aside = turned(solid)  # about x, along which nothing moves
    assert aside is not None and aside.supports[0] == solid.supports[0]
    assert aside.supports[1].displacement == pytest.approx(np.array([0.0, 0.007, -0.001]) / np.sqrt(2))
    for axis in range(3):  # of both vectors this is the least, beside the length of each
        small, large = np.roll([0.001, 0.03, 0.04], axis), np.roll([0.2, -4.0, 3.0], axis)
        loads = [Force("top", tuple(large))]
        supports = [Fixed("left"), Fixed("right", displacement=tuple(small))]
        found = turned(replace(solid, supports=supports, loads=loads), 0.3)
        assert found is not None
        about = Rotation.from_rotvec(0.3 * np.eye(3)[axis])
        assert found.supports[1].displacement == pytest.approx(about.apply(small))
        assert found.loads[0].vector == pytest.approx(about.apply(large))
    bent = Problem(problem.mesh, problem.material, problem.section, Fixed("left"), Moment("right", 1e-3))
    assert turned(bent) is None


@pytest.mark.parametrize("name", sorted(file.stem for file in (EXAMPLES / "loads").glob("bending*.toml")))
def test_the_shipped_loads_are_those_of_the_shipped_body(name: str) -> None:
    mine, theirs = (read_study(EXAMPLES / file).problem for file in (f"loads/{name}.toml", "bending.toml"))
    assert np.array_equal(mine.mesh.nodes, theirs.mesh.nodes) and mine.material == theirs.material
    assert not np.array_equal(mine.loading.external_force, theirs.loading.external_force)


@pytest.mark.verification
def test_the_organ_is_nearer_to_its_reference_under_loads_that_were_held_out(tmp_path: Path) -> None:
    """Straight springs with a volume term on voxels of 2 mm, by the worst of displacement, force and torque."""
    straight = 'model = "gaussian"\nreferences = ["springs", ', 'model = "springs"\nreferences = ['
    (tmp_path / "loads").mkdir()
    studies = []
    for name in ("organ.toml", "loads/organ_pushed.toml", "loads/organ_aside.toml", "loads/organ_back.toml"):
        text = (EXAMPLES / name).read_text(encoding="utf-8").replace("0.626 mm", "2 mm").replace(*straight)
        (tmp_path / name).write_text(text, encoding="utf-8")
        studies.append(read_study(tmp_path / name))
    study, pushed, aside, back = studies
    assert study.model == "springs" and len(study.problem.mesh.elements) < 1000
    found = calibrate_study(study, [pushed], [aside, back])
    assert found.calibration.converged and found.calibration.warnings == ()
    for one in found.calibration.cases:
        before, after = one.pair
        assert before is not None and after is not None and after < 0.25 * before and after < 0.15
    files = write_calibrated(found, tmp_path, "")
    carried = export_study(read_study(files[0]), ["json"], tmp_path)
    header = json.loads((tmp_path / "calibrated" / "springs.json").read_text(encoding="utf-8"))["header"]
    assert carried[0].converged and any(found.calibration.headline in line for line in header)
