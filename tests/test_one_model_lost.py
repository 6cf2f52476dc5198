"""What ends one model, or standard output, ends nothing else: the rest is solved, written and said."""

import json
import math
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.calculix import needs_ccx
from tests.studies import changed, written
from truespring.arrays import Floats
from truespring.cli import main
from truespring.equilibrium import Status
from truespring.study import read_study
from truespring.validity.bodies import Body

BESIDE = '[models.nonlinear]\nkind = "fem"\nlaw = "neo-hookean"\n\n[compare]'


def summary_of(out: Path) -> dict[str, dict[str, object]]:
    return json.loads((out / "study" / "summary.json").read_text())["models"]


@pytest.mark.parametrize(
    ("error", "when", "verb"),
    [
        (np.linalg.LinAlgError("Eigenvalues did not converge"), "solving", "verify"),
        (FloatingPointError("overflow"), "solving", "solve"),
        (MemoryError(), "solving", "solve"),
        (IndexError("of a fault"), "solving", "solve"),
        (IndexError("of a fault"), "building", "verify"),
        (MemoryError(), "building", "solve"),
        (ts.TruespringError("the factorisation does not fit in memory"), "building", "solve"),
    ],
)
def test_an_exception_loses_its_own_model_only(
    error: Exception,
    when: str,
    verb: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Raised when the second of three models is built, or after its first level."""
    from truespring import equilibrium
    from truespring.models import FemPotential

    solve_one, gradient = equilibrium._solve, FemPotential.gradient

    def building(problem: ts.Problem, model: object, *more: object) -> object:
        if getattr(model, "law", "") == "neo-hookean":
            raise error
        return solve_one(problem, model, *more)

    def solving(self: FemPotential, positions: Floats) -> Floats:
        if self.law.barrier and np.abs(positions - self.nodes).max() > 1e-4:
            raise error
        return gradient(self, positions)

    if when == "building":
        monkeypatch.setattr(equilibrium, "_solve", building)
    else:
        monkeypatch.setattr(FemPotential, "gradient", solving)
    file = written(tmp_path, changed(("[compare]", BESIDE)))
    assert main([verb, str(file), "--out", str(tmp_path / "out"), "--quiet"]) == 1
    said = capsys.readouterr().err
    assert "Traceback" not in said and "model 'nonlinear' is not-converged" in said
    assert (str(error) or "out of memory") in said
    models = summary_of(tmp_path / "out")
    assert [models[name]["status"] for name in ("springs", "linear")] == ["converged"] * 2
    assert models["nonlinear"]["load_factor"] == 0
    for name in models:
        assert (tmp_path / "out" / "study" / f"{name}.pvd").is_file()
    assert (tmp_path / "out" / "report.html").is_file() == (verb == "verify")


def test_what_was_reached_before_an_exception_stands() -> None:
    """Springs that fail from half of the load on: the levels before are those of springs that do not."""

    class Failing(ts.SpringNetwork):
        def gradient(self, positions: Floats) -> Floats:
            if positions[1, 0] > 1.0 + 0.5 / 2:  # elongation beyond half of force over stiffness
                raise FloatingPointError("too long")
            return super().gradient(positions)

    nodes = [[0.0, 0.0], [1.0, 0.0]]
    problem = ts.Problem(
        ts.Mesh(np.array(nodes), np.array([[0, 1]]), "line"),
        supports=[ts.Fixed([0]), ts.Fixed([1], ["y"])],
        loads=[ts.Force([1], [1.0, 0.0])],
    )
    path = ts.solve(problem, Failing(nodes, [[0, 1]], [2.0], [1.0]), ts.Newton(load_steps=4))
    assert path.status is Status.NOT_CONVERGED and not path.complete
    assert path.load_factors.tolist() == [0.0, 0.25, 0.5]
    assert path.states[-1].displacement[1, 0] == pytest.approx(0.25)  # 0.5 N on 2 N/m
    assert any("FloatingPointError: too long" in text for text in path.warnings)


# --- the load does not move the controlled displacement ---------------------------------------------

CONTROLLED = '[solver]\ncontrol = "displacement"\non = "right"\ndirection = "y"\nto = "-5 mm"'


@pytest.mark.parametrize("steps", [1, 4])
def test_a_load_that_does_not_move_the_controlled_displacement(
    steps: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A bar is pulled along x and the mean of its end along y is controlled: by symmetry it is 0 under any load."""
    study = changed(
        ("[solver]\nload_steps = 2", f"{CONTROLLED}\nload_steps = {steps}"),
        ('["0 N", "-0.01 N"]', '["1 N", "0 N"]'),
        ("[compare]", '[models.hencky]\nkind = "fem"\nlaw = "hencky"\n\n[compare]'),
    )
    assert main(["solve", str(written(tmp_path, study)), "--out", str(tmp_path), "--quiet"]) == 1
    said = capsys.readouterr().err
    assert said.count("does not move") == 3
    for model in summary_of(tmp_path).values():
        assert model["status"] == "not-converged" and model["load_factor"] == 0


def test_a_small_component_of_the_load_is_enough_to_control_a_displacement() -> None:
    """A cantilever pulled along x and pushed down by a hundredth of that; its end is moved down by 5 mm."""
    problem = ts.Problem(
        mesh=ts.rectangle((0.16, 0.02), (16, 2)),
        material=ts.Material(1e6, 0.3),
        section=ts.PlaneStress(0.01),
        supports=[ts.Fixed("left")],
        loads=[ts.Force("right", (1.0, -0.01))],
    )
    path = ts.solve(problem, ts.Fem("saint-venant-kirchhoff"), ts.DisplacementControl("right", "y", -0.005, 4))
    assert path.status is Status.CONVERGED and path.complete
    end = problem.mesh.nodes[:, 0] == 0.16
    assert path.states[-1].displacement[end, 1].mean() == pytest.approx(-0.005, rel=1e-9)


# --- springs that are unstable at rest -------------------------------------------------------------


def test_springs_unstable_at_rest_have_a_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Elements 4 mm by 10 mm: the isotropic lattice has springs that push; alone on their path is the state at rest."""
    text = changed(
        ("elements = [8, 2]", "elements = [10, 1]"),
        ("poisson = 0.3", "poisson = 0.45"),
        ('rule = "lloyd"', 'rule = "isotropic"\nallow_negative = true'),
    )
    study = str(written(tmp_path, text))
    assert main(["verify", study, "--out", str(tmp_path), "--quiet"]) == 1
    springs = summary_of(tmp_path)["springs"]
    assert (springs["status"], springs["load_factor"]) == ("unstable", 0)
    assert (tmp_path / "study" / "report.html").stat().st_size > 10_000
    for one, other in ((f"{study}:springs", f"{study}:linear"), (f"{study}:linear", f"{study}:springs")):
        assert main(["compare", one, other, "--out", str(tmp_path / "compared"), "--quiet"]) == 1
    folder = str(tmp_path / "study")
    assert main(["compare", f"{folder}:springs", f"{folder}:linear", "--out", str(tmp_path / "again"), "--quiet"]) == 1
    assert "Traceback" not in capsys.readouterr().err


# --- standard output that cannot be written, time that is up ---------------------------------------


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
@pytest.mark.parametrize("unbuffered", ["", pytest.param("1", marks=pytest.mark.verification)])
def test_output_that_is_full(unbuffered: str) -> None:
    """Of output so short that only the end of the program writes it, and of output written at once."""
    with Path("/dev/full").open("w") as full:
        told = subprocess.run(
            [sys.executable, "-m", "truespring", "schema"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            env={"PYTHONUNBUFFERED": unbuffered, "PYTHONPATH": str(Path(ts.__file__).parents[1])},
        )
    assert told.returncode == 1
    assert told.stderr == "truespring: standard output cannot be written: No space left on device\n"


def test_output_whose_reader_has_gone() -> None:
    with subprocess.Popen(
        [sys.executable, "-m", "truespring", "rules"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={"PYTHONPATH": str(Path(ts.__file__).parents[1])},
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        process.stdout.close()
        said = process.stderr.read()
    assert process.returncode == 141 and said == ""


def test_a_model_whose_time_is_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = str(written(tmp_path)), str(tmp_path / "out")
    assert main(["solve", file, "--out", out, "--quiet", "--timeout", "1e-9"]) == 1
    assert "time limit of 1e-09 s was reached" in capsys.readouterr().err
    assert {model["status"] for model in summary_of(tmp_path / "out").values()} == {"not-converged"}
    assert main(["solve", file, "--out", out, "--quiet", "--timeout", "1000"]) == 0
    for wrong in ("0", "-1", "nan", "inf", "soon"):
        assert main(["solve", file, "--timeout", wrong]) == 2


@needs_ccx
def test_ccx_whose_time_is_up(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A body that takes ccx seconds is given up after a fifth of one; the springs beside it are solved."""
    text = changed(
        ("elements = [8, 2]", "elements = [160, 40]"),
        ('kind = "fem"\nlaw = "linear"', 'kind = "calculix"\nlaw = "saint-venant-kirchhoff"'),
    )
    started = time.monotonic()
    study = written(tmp_path, text.replace('rule = "lloyd"', 'rule = "isotropic"'))
    path = ts.study.run(read_study(study), comparing=False, timeout=0.2).solutions["linear"]
    assert time.monotonic() - started < 60
    assert path.status is Status.NOT_CONVERGED and path.load_factor < 1
    assert "time limit of 0.2 s was reached (--timeout)" in path.warnings[0]


# --- a study keeps what was read -------------------------------------------------------------------


def test_a_study_keeps_what_was_read(tmp_path: Path) -> None:
    """With changes, finer, and without its file: nobody reads it again."""
    file = written(tmp_path)
    study = read_study(file, **{"mesh.elements": [4, 1], "mesh.size": ["20 mm", "5 mm"], "material.young": 7.0})
    file.unlink()
    assert study.keys.mesh.elements == [4, 1] and study.keys.material.young == 7.0
    assert Body.of(study).shape.size == [0.02, 0.005] == Body.of(study).problem.mesh.upper.tolist()
    finer = study.finer().finer()
    assert finer.problem.mesh.n_nodes == 17 * 5 and finer.problem.material.young == 7.0
    assert Body.of(finer).depth == 4 and math.isclose(Body.of(finer).aspect, 1.0)


def test_a_changed_study_is_calibrated_as_it_was_changed(tmp_path: Path) -> None:
    """The study that is written asks for the changed body, not for that of the file."""
    from truespring.calibration.study import calibrate_study
    from truespring.calibration.writing import calibrated_study, write_calibrated

    changes = {"mesh.elements": [4, 1], "mesh.size": ["20 mm", "5 mm"], "load.1.force": [0.0, -1e-4]}
    found = calibrate_study(read_study(written(tmp_path), **changes))
    study, *_ = write_calibrated(found, tmp_path / "out", "")
    again = read_study(study)
    assert again.problem.mesh.n_nodes == 10
    assert tuple(again.problem.loads[0].total) == (0.0, -1e-4)
    assert "elements = [4, 1]" in calibrated_study(found, tmp_path, ["a.csv"])
