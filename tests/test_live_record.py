"""Sessions that are written: as studies that solve them again, and as tables that repeat them bit for bit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from truespring.errors import LiveError, StudyError
from truespring.live import Live
from truespring.live.record import read_session, replay, write_session
from truespring.study import Study, read_study, read_text, run

STUDY = """\
title = "A block"

[mesh]
shape = "box"
size = ["60 mm", "60 mm", "60 mm"]
elements = [2, 2, 2]

[material]
young = "3 kPa"
poisson = 0.45
density = "1060 kg/m^3"

[[support]]
on = "bottom"

[[load]]
gravity = ["0 m/s^2", "-9.81 m/s^2", "0 m/s^2"]

[dynamics]
duration = "0.5 s"
start = "equilibrium"
damping = { mass = "2 1/s" }

[models.springs]
kind = "springs"
rule = "gaussian"

[models.fem]
kind = "fem"
law = "neo-hookean"
"""
TOP = (0.03, 0.06, 0.03)
LONG = pytest.mark.verification


def study_of(folder: Path, *changes: tuple[str, str]) -> Study:
    text = STUDY
    for old, new in changes:
        assert text.count(old) == 1
        text = text.replace(old, new)
    file = folder / "block.toml"
    file.write_text(text, encoding="utf-8")
    return read_text(file).study(balanced=False)


def opened(study: Study, step: float = 1e-3, **settings: Any) -> Live:
    """A session whose steps are short enough for stiff pins, so that they are never halved."""
    return Live(study.problem, study.entries[study.model], models=study.entries, step=step, **settings)


def play(live: Live, frames: int = 4) -> Live:
    """Pull, hold, release, pull elsewhere by the same name, push by a sphere, gravity off and half on; and swing."""
    live.step(frames)
    live.pull(TOP)
    for share in (1, 2, 3):
        live.pull(TOP, to=(0.03 + 2e-3 * share, 0.06 + 3e-3 * share, 0.03))
        live.step()
    live.pin((0.0, 0.06, 0.0))
    live.step(frames)
    live.release("pull")
    live.gravity(0.0)
    live.pull((0.06, 0.06, 0.03), to=(0.07, 0.06, 0.03))
    live.step(2)
    live.push((0.03, 0.075, 0.03), radius=0.012)
    live.step()
    live.push((0.03, 0.066, 0.03))
    live.gravity(0.5)
    live.step(frames)
    live.release("pull")
    live.release("pin")
    live.step(frames)
    return live


def solved(folder: Path, live: Live) -> ts.Solution:
    """The motion of the session's model by session.toml."""
    study = read_study(folder / "session.toml")
    path = ts.solve(study.problem, study.entries[study.model], study.solver)
    assert path.status is ts.Status.CONVERGED, path.warnings
    assert path.states[-1].moving.time == pytest.approx(live.time, rel=1e-12)
    return path


def away(path: ts.Solution, live: Live) -> float:
    """The distance of the ends over the size of the body."""
    return float(np.abs(path.states[-1].positions - live.positions).max() / live.size)


@pytest.mark.parametrize("rule", ["gaussian", pytest.param("isotropic", marks=LONG)])
def test_a_study_solves_the_session_again(tmp_path: Path, rule: str) -> None:
    """By leapfrog, compiled or not, to rounding errors; FEM beside it."""
    live = play(opened(study_of(tmp_path, ('rule = "gaussian"', f'rule = "{rule}"'))))
    assert live.scheme.startswith("leapfrog") and ("compiled" in live.scheme) == (rule == "gaussian")
    moved = np.abs(live.positions - live.problem.mesh.nodes).max()
    assert moved > 0.003 and not live.halved
    files = write_session(live, read_study(tmp_path / "block.toml"), tmp_path / "out")
    assert [file.name for file in files] == ["session.toml", "pull.csv", "study.toml"]
    assert away(solved(tmp_path / "out", live), live) < 1e-12
    names = [one.name for one in read_study(files[0]).problem.touching]
    assert names == ["sphere", "pull", "pin", "pull 2"]


@LONG
def test_an_implicit_session_is_solved_again(tmp_path: Path) -> None:
    """To the tolerance of its solver."""
    live = play(opened(study_of(tmp_path), scheme="bdf2", step=1 / 240), frames=1)
    write_session(live, read_study(tmp_path / "block.toml"), tmp_path)
    assert read_study(tmp_path / "session.toml").problem.dynamics.scheme == "bdf2"
    assert away(solved(tmp_path, live), live) < 1e-9


def test_a_session_that_begins_with_a_pull(tmp_path: Path) -> None:
    """The patch has sagged, so the grasp begins elsewhere than at its undeformed centre; and it never moves again."""
    live = opened(study_of(tmp_path))
    live.pull(TOP)
    live.push((0.03, 0.063, 0.01), radius=0.012)
    live.gravity(0.0)
    live.step(7)
    write_session(live, read_study(tmp_path / "block.toml"), tmp_path)
    grasp = read_study(tmp_path / "session.toml").problem.grasps[0]
    assert grasp.during == (0.0, 7 / 60) and grasp.path[0][2] < 0.06 and grasp.origin == [0.03, 0.06, 0.03]
    assert away(solved(tmp_path, live), live) < 1e-12


@pytest.mark.parametrize(
    "changes", [pytest.param([], marks=pytest.mark.verification), [("young", 2.0), ("damping", 5.0)]]
)
def test_a_replay_is_the_session_bit_for_bit(tmp_path: Path, changes: list[tuple[str, float]]) -> None:
    live = opened(study_of(tmp_path), frame=0.01)
    for kind, value in changes:
        live.step()
        live.do(kind, value=value)
    if changes:
        live.gravity(0.5)
        live.restart()
    play(live)
    write_session(live, read_study(tmp_path / "block.toml"), tmp_path / "out")
    again = replay(tmp_path / "out")
    assert np.array_equal(again.positions, live.positions) and np.array_equal(again.velocities, live.velocities)
    assert again.time == live.time and again.log.commands == live.log.commands
    assert away(solved(tmp_path / "out", live), live) < 1e-12  # the study has the changes, too


def test_a_change_of_material_ends_the_study(tmp_path: Path) -> None:
    """Its steps are those before the change, which shortens them."""
    live = opened(study_of(tmp_path), step=1.0)
    live.pull(TOP, to=(0.03, 0.065, 0.03))
    live.step(3)
    held = live.positions
    live.do("young", value=4.0)
    live.step(3)
    write_session(live, read_study(tmp_path / "block.toml"), tmp_path)
    assert any("session.toml cannot repeat young: it ends at 0.05 s" in note for note in live.notes)
    assert "# session.toml cannot repeat young" in (tmp_path / "session.toml").read_text("utf-8")
    study = read_study(tmp_path / "session.toml")
    path = ts.solve(study.problem, study.entries[study.model])
    assert np.abs(path.states[-1].positions - held).max() < 1e-12 * live.size
    assert np.array_equal(replay(tmp_path).positions, live.positions)
    live.restart()
    files = write_session(live, read_study(tmp_path / "block.toml"), tmp_path)
    assert [file.name for file in files] == ["pull.csv", "study.toml"] and not (tmp_path / "session.toml").exists()


def test_a_cut_ends_the_study_and_is_repeated(tmp_path: Path) -> None:
    live = opened(study_of(tmp_path))
    live.step(2)
    live.pull(TOP, to=(0.03, 0.065, 0.03))
    live.step(2)
    live.cut((0.03, 0.061, -0.01), (0.03, 0.061, 0.07), (0.0, -0.02, 0.0))
    live.step(3)
    write_session(live, read_study(tmp_path / "block.toml"), tmp_path)
    assert read_study(tmp_path / "session.toml").problem.duration == pytest.approx(4 / 60)
    assert any("cannot repeat cut: it ends at 0.06667 s" in note for note in live.notes)
    again = replay(tmp_path)
    assert len(again.elements_left) < 8 and again.log.commands == live.log.commands
    assert np.array_equal(again.positions, live.positions)


def test_a_static_study_is_completed(tmp_path: Path) -> None:
    """Density, damping and begin are those that the session assumed; gravity is a load of its own."""
    plain = STUDY[: STUDY.index("[dynamics]")] + STUDY[STUDY.index("[models.springs]") :]
    plain = plain.replace('density = "1060 kg/m^3"\n', "").replace("[[load]]\ngravity", "[[load]]\non = 'top'\nforce")
    plain = plain.replace('["0 m/s^2", "-9.81 m/s^2", "0 m/s^2"]', "[0, -0.01, 0]")
    (tmp_path / "plain.toml").write_text(plain + '[solver]\ncontrol = "arc-length"\n', encoding="utf-8")
    study = read_study(tmp_path / "plain.toml")
    live = opened(study)
    live.step(2)
    live.gravity(1.0)
    live.step(5)
    write_session(live, study, tmp_path)
    written = read_study(tmp_path / "session.toml")
    assert written.problem.material.density == 1000.0 and written.problem.dynamics.start == "equilibrium"
    assert written.problem.loads[1] == ts.Gravity([0.0, 0.0, -9.81], over=((0.0, 0.0), (2 / 60, 0.0), (3 / 60, 1.0)))
    assert away(solved(tmp_path, live), live) < 1e-11


def test_files_beside_the_study_are_found_from_another_folder(tmp_path: Path) -> None:
    """The path of a grasp, and a mesh; the grasp holds on after its path."""
    (tmp_path / "own.csv").write_text("t,x [mm],y [mm],z [mm]\n0,30,60,30\n0.5,32,60,30\n", encoding="utf-8")
    own = '[[grasp]]\nname = "own"\nat = [0.03, 0.06, 0.03]\nradius = 0.015\npath = "own.csv"\n\n[dynamics]'
    study = study_of(tmp_path, ("[dynamics]", own))
    live = opened(study, step=4e-3, frame=0.05)
    live.step(12)
    write_session(live, study, tmp_path / "a" / "b")
    assert 'path = "../../own.csv"' in (tmp_path / "a" / "b" / "study.toml").read_text("utf-8")
    assert read_study(tmp_path / "a" / "b" / "session.toml").problem.grasps[0].path[-1] == pytest.approx(
        [0.6, 0.032, 0.06, 0.03]
    )
    assert away(solved(tmp_path / "a" / "b", live), live) < 1e-12
    assert np.array_equal(replay(tmp_path / "a" / "b").positions, live.positions)


@LONG
def test_a_finer_study_is_written_as_it_was_opened(tmp_path: Path) -> None:
    study = study_of(tmp_path, ("elements = [2, 2, 2]", "elements = [1, 1, 1]")).finer()
    live = opened(study)
    live.pull(TOP, to=(0.03, 0.065, 0.03))
    live.step(2)
    write_session(live, study, tmp_path)
    assert away(solved(tmp_path, live), live) < 1e-12
    assert np.array_equal(replay(tmp_path).positions, live.positions)


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ("frames,", "frmes,", "no row has kind = 'frames'"),
        (",grasp,pull,", ",grsp,pull,", "command 'grsp' (did you mean 'grasp'?)"),
        ("3,0.05,move,pull,0.03", "3,0.05,move,pull,x", "pull.csv:9: could not convert string to float: 'x'"),
        (",springs,", ",spring,", "model 'spring' is not in study.toml; there are: springs, fem"),
        ("kind", "kin", "column 'kin' is unknown (did you mean 'kind'?)"),
    ],
)
def test_a_wrong_table_is_an_error_with_its_place(tmp_path: Path, before: str, after: str, says: str) -> None:
    live = opened(study_of(tmp_path))
    live.step(3)
    live.pull(TOP, to=(0.03, 0.065, 0.03))
    live.step(1)
    write_session(live, read_study(tmp_path / "block.toml"), tmp_path)
    text = (tmp_path / "pull.csv").read_text("utf-8")
    assert before in text
    (tmp_path / "pull.csv").write_text(text.replace(before, after, 1), encoding="utf-8")
    with pytest.raises((LiveError, StudyError)) as error:
        replay(tmp_path)
    assert says in str(error.value) and "pull.csv" in str(error.value)


def test_settings_are_read_with_all_digits(tmp_path: Path) -> None:
    live = opened(study_of(tmp_path), frame=1 / 70)
    live.step()
    live.pull(TOP, to=(0.03, 0.1 / 3, 0.03))
    live.step()
    write_session(live, read_study(tmp_path / "block.toml"), tmp_path)
    found = read_session(tmp_path)
    assert (found.model, found.frame, found.frames, found.scheme) == ("springs", 1 / 70, 2, "leapfrog")
    assert found.step == live.begun.longest
    assert [one.place for one in found.commands] == [one.place for one in live.log.commands]


@LONG
def test_the_errors_of_what_was_seen_are_separate(tmp_path: Path) -> None:
    """The verdict of `verify`: of the model beside FEM, of the step of the session, none of the solver."""
    live = play(opened(study_of(tmp_path)), frames=1)
    write_session(live, read_study(tmp_path / "block.toml"), tmp_path)
    result = run(read_study(tmp_path / "session.toml"))
    assert result.converged, [path.warnings for path in result.solutions.values()]
    assert np.abs(result.solutions["springs"].states[-1].positions - live.positions).max() < 1e-12 * live.size
    model, splits = result.comparisons["fem"].rms_error, result.splits
    assert splits is not None and splits.step is not None and model is not None
    assert 1e-4 < model < 0.2 and splits.step < 0.02 and splits.solver == 0.0
