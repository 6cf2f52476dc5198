"""`ts.verify`, `ts.read_study`, `ts.new` and `ts.Report`: the command, one to one, in Python."""

import json
from importlib.metadata import version
from pathlib import Path

import pytest

import truespring as ts
from truespring.cli import main
from truespring.errors import TruespringError

SMALL = {"mesh.elements": [4, 1], "solver.load_steps": 2, "compare.refine": False}


@pytest.fixture
def strip(tmp_path: Path) -> Path:
    return ts.new("strip", tmp_path / "strip.toml")


@pytest.fixture
def problem() -> ts.Problem:
    return ts.Problem(
        mesh=ts.rectangle(size=(0.04, 0.01), elements=(4, 1)),
        material=ts.Material(young=10e3, poisson=0.3),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.1, 0.0))],
    )


MODELS = {"fem": ts.Fem(law="neo-hookean"), "springs": ts.Springs(rule="gaussian"), "linear": ts.Fem(law="linear")}


def files_of(folder: Path) -> set[str]:
    return {str(file.relative_to(folder)) for file in folder.rglob("*") if file.is_file()}


@pytest.mark.verification
def test_verify_writes_the_files_of_the_command(strip: Path, tmp_path: Path) -> None:
    text = strip.read_text("utf-8").replace("elements = [16, 4]", "elements = [4, 1]")
    strip.write_text(text.replace("[compare]", "[compare]\nrefine = false"), encoding="utf-8")
    assert main(["verify", str(strip), "--out", str(tmp_path / "command"), "--quiet"]) == 0
    result = ts.verify(strip, tmp_path / "here")
    assert files_of(tmp_path / "here") == files_of(tmp_path / "command")
    there, here = (json.loads((tmp_path / one / "strip/summary.json").read_text()) for one in ("command", "here"))
    for one in (there, here):
        for model in one["models"].values():
            del model["seconds"]
    assert here == there and result.closest == here["closest"] and result.problem.mesh.n_nodes == 10


def test_a_result_has_solutions_comparisons_and_a_verdict_by_name(strip: Path, tmp_path: Path) -> None:
    seen: list[tuple[str, str, float]] = []
    result = ts.verify(ts.read_study(strip, **SMALL), progress=lambda *one: seen.append(one))
    assert set(result.comparisons) < set(result.solutions) and result.converged
    errors = {name: one.rms_error for name, one in result.comparisons.items()}
    assert result.comparison is result.comparisons[min(errors, key=lambda name: errors[name] or 0.0)]
    assert {model for _, model, _ in seen} == set(result.solutions) and seen[-1][2] == 1.0
    page = result.report(tmp_path / "new" / "report.html").read_text("utf-8")
    assert result.verdict.split(".")[0].split("%")[0].strip() in page.replace("\N{NO-BREAK SPACE}", " ")
    assert not (tmp_path / "out").exists()


def test_a_problem_is_verified_with_models(problem: ts.Problem, tmp_path: Path) -> None:
    result = ts.verify(problem, tmp_path, models=MODELS, probe="right-middle", title="my body", refine=False)
    assert result.model == "springs" and list(result.comparisons) == ["fem", "linear"] and not result.standings
    assert result.problem.mesh.nodes[result.probe].tolist() == [0.04, 0.0]
    assert (tmp_path / "my-body" / "summary.json").exists()
    assert "Repeat this run" not in (tmp_path / "report.html").read_text("utf-8")
    fewer = ts.verify(problem, models=MODELS, model="fem", references=["linear"], refine=False)
    assert fewer.model == "fem" and list(fewer.comparisons) == ["linear"]
    alone = ts.solve(problem, MODELS["springs"])
    assert (result.solutions["springs"].states[-1].displacement == alone.states[-1].displacement).all()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "models={"),
        ({"models": {"a b": MODELS["fem"]}}, "'a b' is not a name"),
        ({"models": {"a": 3}}, "3 is not a model"),
        ({"models": [*MODELS.values()]}, "models={"),
        ({"models": {1: MODELS["fem"]}}, "'1' is not a name"),
        ({"models": MODELS, "tolerance": 3}, "tolerance = 3"),
        ({"models": MODELS, "tolerance": "5 %"}, "tolerance = '5 %' is not between 0 and 1"),
        ({"models": MODELS, "timeout": "60"}, "timeout = '60': a time above 0 s is expected"),
        ({"models": MODELS, "timeout": -1}, "timeout = -1"),
        ({"models": MODELS, "progress": 3}, "progress = 3"),
        ({"models": MODELS, "probe": 1.5}, "point 1.5: 2 coordinates are expected"),
        ({"models": MODELS, "probe": ("a", "b")}, r"point \('a', 'b'\): 2 coordinates"),
        (
            {"models": MODELS, "references": "fem"},
            "references = 'fem': a list of names is expected",
        ),
        ({"models": MODELS, "probe": "rigt"}, "did you mean 'right'"),
        ({"models": MODELS, "probe": 10}, "probe = 10: nodes are 0 to 9"),
        ({"models": MODELS, "title": ""}, "title = '': a text is expected"),
        ({"models": MODELS, "title": 3}, "title = 3: a text is expected"),
        ({"models": MODELS, "model": ["fem"]}, r"\['fem'\] is not among the models"),
        ({"models": MODELS, "references": 3}, "references = 3: a list of names is expected"),
        ({"models": MODELS, "references": [["fem"]]}, r"\['fem'\] is not among the models"),
        ({"models": MODELS, "model": "spring"}, "'spring' is not among the models .did you mean 'springs'"),
        ({"models": MODELS, "references": ["fem", "springs"]}, "the compared model itself"),
    ],
)
def test_wrong_models_and_options_are_errors(problem: ts.Problem, given: dict[str, object], words: str) -> None:
    with pytest.raises(TruespringError, match=words):
        ts.verify(problem, **given)


def test_wrong_changes_and_options_of_a_study_are_errors(strip: Path) -> None:
    with pytest.raises(TruespringError, match=r"strip.toml.*'materal'.*did you mean 'material'"):
        ts.read_study(strip, **{"materal.young": 3.0})
    with pytest.raises(TruespringError, match=r"material.poison = 3.*did you mean 'poisson'"):
        ts.read_study(strip, **{"material.poison": 3.0})
    with pytest.raises(TruespringError, match=r"tolerance: a study has its own.*compare.tolerance"):
        ts.verify(strip, tolerance=0.1)
    with pytest.raises(TruespringError, match="cannot be written"):
        ts.verify(ts.read_study(strip, **SMALL), out=strip)


def test_new_returns_a_text_or_writes_files(tmp_path: Path) -> None:
    assert ts.new("mesh", tmp_path / "own.toml") == tmp_path / "own.toml"
    written = list(tmp_path.iterdir())
    assert {file.suffix for file in written} >= {".toml", ".msh"} and {file.stem for file in written} == {"own"}
    assert ts.read_study(tmp_path / "own.toml").problem.mesh.n_nodes > 10
    assert 'file = "mesh.msh"' in ts.new("mesh") and 'file = "own.msh"' in (tmp_path / "own.toml").read_text("utf-8")
    for given in (("own",), ("mesh", tmp_path / "own.toml"), ("mesh", tmp_path / "own.txt")):
        with pytest.raises(TruespringError, match=r"allowed: block|exists|ends in \.toml"):
            ts.new(*given)


def test_the_report_of_versions_names_what_is_installed() -> None:
    report = ts.Report()
    assert report.versions["truespring"] == ts.__version__ == version("truespring")
    assert report.versions["numpy"] == version("numpy") and "cores" in report.machine
    assert str(report).splitlines()[0].split() == ["truespring", ts.__version__]
