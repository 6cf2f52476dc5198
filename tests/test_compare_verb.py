"""truespring compare: studies, folders and files against each other, and what is refused."""

import json
import subprocess
from pathlib import Path

import meshio
import numpy as np
import pytest

import truespring as ts
from tests.calculix import needs_ccx
from tests.studies import changed, written
from tests.test_examples import EXAMPLES
from truespring.cli import main
from truespring.comparing.sources import find_sources, open_source
from truespring.study import read_study

BENDING = EXAMPLES / "bending.toml"


def values(capsys: pytest.CaptureFixture[str], *arguments: object, drawn: bool = False) -> dict:
    """Compare, and return what is printed as JSON; figures and page are only written where `drawn`."""
    with pytest.MonkeyPatch.context() as patch:
        if not drawn:
            patch.setattr("truespring.report.figures.save_figures", lambda *_: None)
            patch.setattr("truespring.report.page.write_page", lambda results, file, command: file.write_text(""))
            patch.setattr("truespring.report.page.render_page", lambda *_: "")
        assert main(["compare", *map(str, arguments), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Compare what cannot be compared, and return the error."""
    assert main(["compare", *map(str, arguments)]) == 2
    return capsys.readouterr().err


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `truespring verify` leaves of the bending study."""
    out = tmp_path_factory.mktemp("verified")
    assert main(["verify", str(BENDING), "--out", str(out), "--quiet"]) == 0
    return out / "bending"


@pytest.fixture(scope="module")
def deck() -> str:
    """The bending study as someone writes it for CalculiX by hand: millimetres, newtons, megapascals, z upwards."""
    nodes = [(i, j, 10.0 * i, 10.0 * j) for j in range(5) for i in range(17)]
    number = {(i, j): count for count, (i, j, _, _) in enumerate(nodes, 1)}
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{number[i, j]}, {x}, {y}, 0." for i, j, x, y in nodes]
    lines += ["*ELEMENT, TYPE=CPS4, ELSET=BODY"]
    lines += [
        f"{1 + i + 16 * j}, {number[i, j]}, {number[i + 1, j]}, {number[i + 1, j + 1]}, {number[i, j + 1]}"
        for j in range(4)
        for i in range(16)
    ]
    lines += [
        "*MATERIAL, NAME=SOFT",
        "*ELASTIC",
        "0.01, 0.3333333333",
        "*SOLID SECTION, ELSET=BODY, MATERIAL=SOFT",
        "10.",
    ]
    lines += ["*BOUNDARY", *(f"{number[0, j]}, 1, 2, 0." for j in range(5))]
    shares = (0.125, 0.25, 0.25, 0.25, 0.125)
    lines += ["*STEP, NLGEOM, INC=100", "*STATIC, DIRECT", "0.1, 1.", "*CONTROLS, PARAMETERS=FIELD", "1.E-6, 1.E-6"]
    lines += ["*CLOAD", *(f"{number[16, j]}, 2, {-0.0428 * share}" for j, share in enumerate(shares))]
    lines += ["*NODE FILE, OUTPUT=2D", "U", "*NODE PRINT, NSET=ALL", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


@pytest.fixture(scope="module")
def frd(deck: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("ccx")
    (place / "bending.inp").write_text(deck)
    subprocess.run(["ccx", "bending"], cwd=place, capture_output=True, check=True, timeout=120)
    return place / "bending.frd"


# --- what truespring wrote --------------------------------------------------------------------


def test_a_folder_compared_with_itself_is_not_apart(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for one in (folder, f"{folder}:neo-hookean", folder / "hencky.pvd"):
        found = values(capsys, one, one, "--out", tmp_path)
        assert found["rms_error"] == found["max_error"] == found["hausdorff"] == found["n_outside"] == 0
        assert found["energy_error"] in (0, None) and found["node_by_node"] and found["n_nodes"] == 85
        assert len(found["levels"]) == 10 and found["load_factor"] == 1


def test_a_study_and_the_folder_it_wrote_are_the_same(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = values(capsys, BENDING, folder, "--out", tmp_path)
    assert found["model"].endswith("/bending:springs") and found["reference"].endswith("/bending:springs")
    assert found["rms_error"] < 1e-14 and found["hausdorff"] < 1e-14
    assert found["probe"] == pytest.approx([0.16, 0.02])


def test_errors_are_those_of_the_study_itself(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    summary = json.loads((folder / "summary.json").read_text())
    for name, wanted in summary["comparison"].items():
        found = values(capsys, f"{folder}:{name}", f"{folder}:springs", "--out", tmp_path)
        for error in ("rms_error", "max_error", "probe_error", "agrees_up_to_load_factor"):
            assert found[error] == pytest.approx(wanted[error], rel=1e-9)


def test_what_is_written_can_be_read_and_the_report_stands_alone(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["compare", f"{folder}:nonlinear", str(BENDING), "--out", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "bending:springs against bending:nonlinear" in told and "root-mean-square error" in told
    found = json.loads((tmp_path / "comparison.json").read_text())
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert f"{100 * found['rms_error']:.1f} %" in page and "compared node by node" in page
    assert "truespring compare" in page and "http-equiv" in page and "(Hausdorff)" in page
    assert {file.stem for file in (tmp_path / "figures").glob("*.png")} >= {
        "curves",
        "error",
        "bending-springs_over_bending-nonlinear",
        "bending-springs_error_bending-nonlinear",
    }
    written = meshio.read(tmp_path / "difference.vtu")
    apart = np.linalg.norm(written.point_data["displacement"] - written.point_data["reference_displacement"], axis=1)
    assert written.point_data["distance"] == pytest.approx(apart)
    assert apart.max() == pytest.approx(found["max_distance"])


def test_several_are_compared_with_the_first(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, *others = (f"{folder}:{name}" for name in ("nonlinear", "springs", "linear"))
    found = values(capsys, first, *others, "--out", tmp_path, drawn=True)
    assert list(found) == ["bending:springs", "bending:linear"]
    assert found["bending:linear"]["rms_error"] > 5 * found["bending:springs"]["rms_error"]
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert all(f"{name} against bending:nonlinear" in page for name in found)
    assert (tmp_path / "bending-linear" / "report.html").is_file()


# --- what others wrote ------------------------------------------------------------------------


@needs_ccx
def test_a_hand_made_result_of_calculix_in_millimetres(
    frd: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    study = f"{BENDING}:nonlinear"
    error = refused(capsys, study, frd, "--out", tmp_path)
    assert "bending.frd lies between (0, 0) and (160, 40) m" in error and "--unit bending.frd=mm" in error
    for told in ("mm", "bending.frd=mm", "bending=mm"):
        found = values(capsys, study, frd, "--unit", told, "--out", tmp_path)
        assert found["rms_error"] < 0.007 and found["n_outside"] == 0 and found["node_by_node"]
        assert len(found["levels"]) == 10
    # The law is its own: of others it is further off than its discretisation of plane stress.
    assert (
        found["rms_error"]
        < 0.2 * values(capsys, f"{BENDING}:hencky", frd, "--unit", "mm", "--out", tmp_path)["rms_error"]
    )
    # Either may be the reference; distances are the same.
    turned = values(capsys, frd, study, "--unit", "mm", "--out", tmp_path)
    assert turned["rms_distance"] == pytest.approx(found["rms_distance"], rel=1e-9)
    assert turned["hausdorff"] == pytest.approx(found["hausdorff"], rel=1e-9)
    # The printed numbers of the same run have one digit more.
    printed = values(capsys, frd, frd.with_suffix(".dat"), "--unit", "mm", "--out", tmp_path)
    assert printed["rms_error"] < 1e-5 and printed["node_by_node"]


@needs_ccx
def test_axes_that_do_not_fit_are_named(
    frd: Path, deck: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    solid = tmp_path / "solid.vtu"
    problem = ts.Problem(
        ts.box((0.16, 0.04, 0.02), (8, 2, 1)),
        ts.Material(10e3, 0.3),
        None,
        [ts.Fixed("left")],
        [ts.Force("right", (0.0, -0.02, 0.0))],
    )
    path = ts.solve(problem, ts.Fem("saint-venant-kirchhoff"))
    moved, nodes = path.states[-1].displacement, problem.mesh.nodes
    cells = [("hexahedron", problem.mesh.elements)]
    meshio.Mesh(nodes, cells, point_data={"U": moved}).write(solid)
    upwards = tmp_path / "upwards.vtu"  # z up, in inches
    turn = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    meshio.Mesh(nodes @ turn.T / 0.0254, cells, point_data={"U": moved @ turn.T / 0.0254}).write(upwards)
    error = refused(capsys, solid, upwards, "--out", tmp_path)
    assert "--unit upwards.vtu=inch --axes upwards.vtu=x,z,-y" in error
    error = refused(capsys, solid, upwards, "--unit", "upwards=inch", "--out", tmp_path)
    assert "--axes upwards.vtu=x,z,-y" in error and "--unit upwards.vtu=inch" not in error
    given = ("--unit", "upwards=inch", "--axes", "upwards=x,z,-y", "--out", tmp_path)
    assert values(capsys, solid, upwards, *given)["rms_error"] < 1e-12
    # Who insists is listened to: then nothing of one lies in the other, which is said.
    meant = ("--unit", "upwards=m", "--axes", "upwards=x,y,z", "--shift", "upwards=1,0,0 mm", "--out", tmp_path)
    assert "no node" in refused(capsys, solid, upwards, *meant)


def test_stl_in_stl_out(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The paper's way: a deformed body as STL under the springs, with and without the body at rest."""
    deformed = folder / "deformed_nonlinear.stl"
    summary = json.loads((folder / "summary.json").read_text())["comparison"]["nonlinear"]
    alone = values(capsys, deformed, BENDING, "--out", tmp_path)
    assert alone["rms_error"] is None and alone["reference"] == "deformed_nonlinear.stl"
    both = values(capsys, f"{folder}:nonlinear", BENDING, "--out", tmp_path)
    assert alone["hausdorff"] == pytest.approx(both["hausdorff"], rel=1e-4)
    rest = tmp_path / "rest.stl"
    mesh = read_study(BENDING).problem.mesh
    triangles = np.concatenate([mesh.elements[:, [0, 1, 2]], mesh.elements[:, [0, 2, 3]]])
    meshio.Mesh(np.pad(mesh.nodes, ((0, 0), (0, 1))), [("triangle", triangles)]).write(rest, binary=True)
    pair = values(capsys, deformed, BENDING, "--undeformed", f"{deformed.name}={rest}", "--out", tmp_path, drawn=True)
    assert pair["rms_error"] == pytest.approx(summary["rms_error"], rel=1e-3)
    assert "outlines" in (tmp_path / "report.html").read_text(encoding="utf-8")
    # Two surfaces alone, both in space as far as the program is concerned.
    surfaces = values(capsys, deformed, folder / "deformed_springs.stl", "--out", tmp_path)
    assert surfaces["rms_error"] is None and surfaces["hausdorff"] > 0.9 * alone["hausdorff"]


@pytest.mark.verification
def test_surfaces_of_solids(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    study = tmp_path / "block.toml"
    study.write_text(
        """
        [mesh]
        shape = "box"
        size = ["80 mm", "20 mm", "20 mm"]
        elements = [8, 2, 2]
        [material]
        young = "10 kPa"
        poisson = 0.3
        [[support]]
        on = "left"
        [[load]]
        on = "right"
        force = ["0 N", "-0.03 N", "0.02 N"]
        [solver]
        load_steps = 2
        [models.springs]
        kind = "springs"
        rule = "isotropic"
        [models.finite]
        kind = "fem"
        law = "saint-venant-kirchhoff"
        """
    )
    assert main(["solve", str(study), "--out", str(tmp_path), "--quiet"]) == 0
    capsys.readouterr()
    deformed = tmp_path / "block" / "deformed_finite.stl"
    both = values(capsys, f"{tmp_path / 'block'}:finite", study, "--out", tmp_path / "a")
    alone = values(capsys, deformed, study, "--out", tmp_path / "b", drawn=True)
    assert alone["hausdorff"] == pytest.approx(both["hausdorff"], rel=1e-4) and alone["rms_error"] is None
    assert "Hausdorff" in (tmp_path / "b" / "report.html").read_text(encoding="utf-8")


def test_markers_in_the_body(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Measured markers: one is a millimetre off in one direction, one lies beside the body."""
    mesh = read_study(BENDING).problem.mesh
    places = [f"{node}" for node in (3, 20, 41, 60, 80)]
    state = meshio.read(folder / "nonlinear" / "nonlinear_0010.vtu")
    moved = 1e3 * state.point_data["displacement"]
    rows = []
    for name in places:
        x, y = 1e3 * mesh.nodes[int(name)]
        rows.append(f"{name},{x},{y},{moved[int(name), 0]},{moved[int(name), 1]}")
    rows[-1] = rows[-1].rsplit(",", 1)[0] + f",{moved[80, 1] + 1}"
    rows.append("beside,80,60,0,0")
    table = tmp_path / "markers.csv"
    table.write_text("\n".join(["marker,x [mm],y [mm],ux [mm],uy [mm]", *rows]) + "\n")
    found = values(capsys, table, f"{folder}:nonlinear", "--out", tmp_path, drawn=True)
    assert found["n_nodes"] == 6 and found["n_outside"] == 1 and found["hausdorff"] is None
    assert found["max_distance"] == pytest.approx(1e-3, rel=1e-6)
    assert found["rms_distance"] == pytest.approx(1e-3 / np.sqrt(5), rel=1e-6)
    assert "outside" in (tmp_path / "report.html").read_text(encoding="utf-8")


# --- what is refused --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((BENDING,), "at least two results"),
        ((BENDING, "nowhere.frd"), "nowhere.frd does not exist"),
        ((f"{BENDING}:spring", BENDING), "did you mean 'springs'"),
        ((BENDING, EXAMPLES), "no summary.json"),
        ((BENDING, EXAMPLES / "tissue.geo"), ".frd, .dat, .vtu"),
        ((BENDING, BENDING, "--unit", "kg"), "unit = 'kg'"),
        ((BENDING, BENDING, "--unit", "other.frd=mm"), "'other.frd' matches none of"),
        ((BENDING, BENDING, "--axes", "x,y"), "x, y and z"),
        ((BENDING, BENDING, "--shift", "1,2,3,4"), "two or three lengths"),
        ((BENDING, BENDING, "--load-factor", "2"), "above 0 and at most 1"),
        ((BENDING, BENDING, "--probe", "left-middle-of"), "left-middle-of"),
        ((BENDING, BENDING, "--probe", "1 mm, 2 kg"), "--probe"),
        ((BENDING, BENDING, "--tolerance", "5"), "between 0 and 1"),
    ],
)
def test_bad_input_is_named(
    arguments: tuple[object, ...], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert words in refused(capsys, *arguments, "--out", tmp_path)


def test_all_faults_are_told_before_anything_is_solved(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    error = refused(capsys, BENDING, "a.frd", "b.frd", "--out", tmp_path)
    assert "a.frd does not exist" in error and "b.frd does not exist" in error


def test_levels_that_do_not_meet_are_told(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    last = folder / "springs" / "springs_0010.vtu"
    found = values(capsys, BENDING, last, "--load-factor", f"{last.name}=0.55", "--out", tmp_path)
    assert found["rms_error"] is None and found["load_factor"] is None
    assert any("none in common" in warning for warning in found["warnings"])


# --- what must not pass in silence ------------------------------------------------------------


@needs_ccx
def test_a_run_that_stopped_is_no_full_load(frd: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Cut before its end mark, after the level of time 0.3: what there is stands at its own load factors."""
    head, *levels = frd.read_text().split("    1PSTEP")
    assert len(levels) == 10
    stopped = tmp_path / "stopped.frd"
    stopped.write_text("    1PSTEP".join([head, *levels[:3]]))
    arguments = ["compare", f"{BENDING}:nonlinear", str(stopped), "--unit", "mm", "--out", str(tmp_path), "--json"]
    assert main(arguments) == 1
    captured = capsys.readouterr()
    found = json.loads(captured.out)
    assert found["load_factor"] == pytest.approx(0.3) and found["rms_error"] < 0.01
    assert any("no end mark" in warning for warning in found["warnings"])
    assert "'stopped.frd' is not-converged" in captured.err
    # In a file whose times are seconds, who knows better says so.
    whole = values(capsys, f"{BENDING}:nonlinear", frd, "--unit", "mm", "--full-time", "2", "--out", tmp_path)
    assert whole["load_factor"] == pytest.approx(0.5) and whole["rms_error"] > 0.3


def test_bodies_of_other_size_are_told_both_ways(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    taller = tmp_path / "taller.vtu"
    mesh = ts.rectangle((0.16, 0.06), (16, 6))
    moved = np.pad(-0.1 * mesh.nodes**2, ((0, 0), (0, 1)))
    meshio.Mesh(np.pad(mesh.nodes, ((0, 0), (0, 1))), [("quad", mesh.elements)], point_data={"U": moved}).write(taller)
    one = values(capsys, f"{folder}:linear", taller, "--out", tmp_path)
    two = values(capsys, taller, f"{folder}:linear", "--out", tmp_path)
    assert (one["n_outside"], one["n_reference_outside"]) == (34, 0)
    assert (two["n_outside"], two["n_reference_outside"]) == (0, 34)
    for found in (one, two):
        assert any("the bodies differ" in warning for warning in found["warnings"])
    assert not any(
        "the bodies differ" in text for text in values(capsys, folder, folder, "--out", tmp_path)["warnings"]
    )


def test_what_a_folder_warns_of_is_told_again(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = values(capsys, f"{folder}:springs", f"{folder}:springs", "--out", tmp_path)
    assert any("0.882" in warning for warning in found["warnings"]) and found["energy_error"] == 0
    summary = json.loads((folder / "summary.json").read_text())
    del summary["models"]["springs"]["label"]
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "summary.json").write_text(json.dumps(summary))
    assert "models.springs.label is missing" in refused(capsys, broken, folder, "--out", tmp_path)


def test_a_folder_keeps_what_its_models_consist_of(tmp_path: Path) -> None:
    """Springs and the lines of figures are read as the models reported them; folders of 0.1 by the kind alone."""
    links = '[models.links]\nkind = "heml"\nlaw = "saint-venant-kirchhoff"\n\n[compare]'
    file = written(tmp_path, changed(("[compare]", links)))
    assert main(["solve", str(file), "--out", str(tmp_path), "--quiet"]) == 0

    def read() -> dict[str, tuple[bool, str]]:
        texts = [f"{tmp_path / 'study'}:{name}" for name in ("springs", "linear", "links")]
        paths = [open_source(one, None, None) for one in find_sources(texts, [])]
        return {one.kind: (one.has_springs, one.lines) for one in paths}

    assert read() == {"springs": (True, "springs"), "fem": (False, "springs"), "heml": (False, "links")}
    summary = json.loads((tmp_path / "study" / "summary.json").read_text())
    for model in summary["models"].values():
        del model["has_springs"], model["lines"]
    (tmp_path / "study" / "summary.json").write_text(json.dumps(summary))
    assert {kind: springs for kind, (springs, _) in read().items()} == {"springs": True, "fem": False, "heml": False}


def test_options_go_to_the_files_that_can_take_them(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rest, deformed = tmp_path / "rest.csv", tmp_path / "deformed.csv"
    rest.write_text("marker,x [mm],y [mm]\na,40,10\nb,80,20\n")
    deformed.write_text("marker,x [mm],y [mm]\nb,80,20\na,40,11\n")
    found = values(capsys, folder / "linear.pvd", deformed, "--undeformed", rest, "--out", tmp_path)
    assert found["n_nodes"] == 2
    error = refused(capsys, folder / "linear.pvd", folder / "springs.pvd", "--undeformed", rest, "--out", tmp_path)
    assert ".csv, .stl files" in error
    twins = [tmp_path / name / "one.vtu" for name in "ab"]
    for twin in twins:
        twin.parent.mkdir()
        twin.write_bytes((folder / "linear" / "linear_0010.vtu").read_bytes())
    assert "'one' matches" in refused(capsys, *twins, "--unit", "one=mm", "--out", tmp_path)
    found = values(capsys, *twins, "--out", tmp_path)
    assert (found["reference"], found["model"]) == ("a/one.vtu", "b/one.vtu") and found["rms_error"] == 0


def test_a_probe_off_the_body_is_refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    error = refused(capsys, folder, folder, "--probe", "5, 5", "--out", tmp_path)
    assert "from the nearest node" in error and "(0.16, 0.04)" in error


def test_a_motion_is_compared_at_equal_times(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its folder and its series, whose times are seconds, are the motion itself; so is a series that ends early."""
    dynamics = '[dynamics]\nduration = "40 ms"\nstep = "10 ms"\nscheme = "bdf2"\nrecord = "10 ms"\n\n[solver]'
    text = changed(("poisson = 0.3", "poisson = 0.3\ndensity = 1e3"), ("[solver]", dynamics))
    study = written(tmp_path, text)
    assert main(["solve", str(study), "--out", str(tmp_path), "--quiet"]) == 0
    capsys.readouterr()
    folder = tmp_path / "study"
    series = folder / "springs.pvd"
    lines = series.read_text().splitlines(keepends=True)
    early = folder / "early.pvd"
    early.write_text("".join(line for line in lines if "springs_0004" not in line))
    for result, last in ((f"{folder}:springs", 1.0), (series, 1.0), (early, 0.75)):
        found = values(capsys, f"{study}:springs", result, "--out", tmp_path / "compared")
        assert [level["load_factor"] for level in found["levels"]] == pytest.approx(np.arange(0.25, last + 0.1, 0.25))
        assert found["load_factor"] == pytest.approx(last)
        assert found["max_error"] < 1e-5  # the digits of the series
    assert json.loads((folder / "summary.json").read_text())["duration"] == pytest.approx(0.04)
    assert "after the duration of the motion, 0.02" in refused(
        capsys, written(tmp_path, text.replace("40 ms", "20 ms"), "short.toml"), series, "--out", tmp_path / "compared"
    )
