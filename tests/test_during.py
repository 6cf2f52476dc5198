"""Tools and grasps that act in a part of the way: closed forms, energies, and paths in CSV files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.test_tools import STUDY, body, problem
from truespring.equilibrium import moving_body
from truespring.errors import ProblemError, StudyError
from truespring.motion.explicit import stable_step
from truespring.report.touching import drawn_tools
from truespring.study import plan, read_study
from truespring.study.last_level import require_last_level

# A mass of 1 kg on a spring, which moves at the begin; a second spring holds it in an interval, and is drawn on there.
STIFFNESS, HELD, SPEED, DURING, END = 4.0, 5.0, 0.05, (0.3, 0.8), 1.1
AWAY = (0.1, 0.3)


def oscillator(scheme: str, step: float, during: tuple[float, float] | None = DURING) -> ts.Solution:
    nodes = np.array([[0.0, 0.0], [1.0, 0.0]])
    network = ts.SpringNetwork(nodes, np.array([[0, 1]]), np.array([STIFFNESS]), mass=np.ones(2))
    rows = [(0.3, 1 + AWAY[0], 0.0), (0.8, 1 + AWAY[1], 0.0)]
    rows = rows if during else [(0.0, *rows[0][1:]), *rows, (END, *rows[1][1:])]
    hold = ts.Grasp("hold", (1.0, 0.0), 0.1, rows, HELD, during=during, origin=(1.0, 0.0))
    supports = [ts.Fixed(on=[0]), ts.Fixed(on=[1], fix=["y"])]
    asked = ts.Dynamics(END, step=step, scheme=scheme, velocity=(SPEED, 0.0), record=0.1)
    one = ts.Problem(network.mesh, supports=supports, grasps=[hold], dynamics=asked)
    return ts.solve(one, network, ts.Newton(tolerance=1e-12))


def exact() -> tuple[float, float]:
    """Place and speed at the end: free, held by a spring whose end moves at a constant speed, and free again."""

    def swung(x: float, v: float, stiffness: float, t: float) -> tuple[float, float]:
        omega = np.sqrt(stiffness)
        cosine, sine = np.cos(omega * t), np.sin(omega * t)
        return x * cosine + v / omega * sine, v * cosine - x * omega * sine

    begin, end = DURING
    x, v = swung(0.0, SPEED, STIFFNESS, begin)
    share = HELD / (STIFFNESS + HELD)  # the mass rests at this share of the motion of the spring's end
    rate = (AWAY[1] - AWAY[0]) / (end - begin)
    x, v = swung(x - share * AWAY[0], v - share * rate, STIFFNESS + HELD, end - begin)
    return swung(x + share * AWAY[1], v + share * rate, STIFFNESS, END - end)


@pytest.mark.parametrize(
    ("scheme", "step"),
    [("leapfrog", 4e-3), ("midpoint", 2e-2), pytest.param("bdf2", 4e-3, marks=pytest.mark.verification)],
)
def test_a_mass_is_held_in_an_interval(scheme: str, step: float) -> None:
    """A spring that appears stretched brings its energy, and takes along what it stores as it goes: the sum closes."""
    x, v = exact()
    away, missing = [], []
    for h in (step, step / 2):
        path = oscillator(scheme, h)
        last = path.states[-1]
        found = last.displacement[1, 0], last.moving.velocity[1, 0]
        away.append(float(np.hypot(found[0] - x, found[1] - v)))
        energies = last.moving.energies
        missing.append(abs(energies.numerical))
        assert energies.contact == 0.0
        assert energies.kinetic + energies.elastic == pytest.approx(v**2 / 2 + STIFFNESS * x**2 / 2, rel=0.03)
    brought = HELD / 2 * (AWAY[0] - SPEED * np.sin(2 * DURING[0]) / 2) ** 2
    assert away[1] < 4e-3 and away[1] < 0.6 * away[0]
    assert missing[1] < 0.03 * brought and missing[1] < 0.6 * missing[0]


def test_it_acts_after_the_begin_and_up_to_the_end() -> None:
    path = oscillator("leapfrog", 5e-3)
    acts = [round(state.moving.time, 6) for state in path.states if state.touches[0].acts]
    assert acts == [0.4, 0.5, 0.6, 0.7, 0.8]
    assert [bool(state.touches[0].force.any()) for state in path.states] == [
        state.touches[0].acts for state in path.states
    ]


def test_steps_end_where_it_begins_and_ceases() -> None:
    """Here between the steps of 40 ms, which would miss the interval: an impulse of HELD AWAY times its length."""
    state = oscillator("midpoint", 0.04, during=(0.305, 0.315)).states[-1]
    impulse = HELD * (AWAY[0] - SPEED * np.sin(0.62) / 2) * 0.01
    expected = (SPEED * np.sin(2 * END) + impulse * np.sin(2 * (END - 0.31))) / 2
    assert state.displacement[1, 0] == pytest.approx(expected, abs=2e-4)


def test_at_rest_it_acts_in_a_share_of_the_way() -> None:
    at = (0.06, 0.015)
    grasp = ts.Grasp("hold", at, 0.006, [(0.25, 0.061, 0.015), (0.5, 0.062, 0.015)], during=(0.25, 0.5), origin=at)
    steps = ts.Newton(load_steps=8)
    path = ts.solve(problem(body(2), grasps=(grasp,)), ts.Fem("neo-hookean"), steps)
    assert path.status is ts.Status.CONVERGED
    always = replace(grasp, path=[(0, *at), (0.5, 0.062, 0.015), (1, 0.062, 0.015)], during=None, origin=None)
    held = ts.solve(problem(body(2), grasps=(always,)), ts.Fem("neo-hookean"), steps)
    for state, other in zip(path.states, held.states, strict=True):
        if state.load_factor == 0.5:
            assert state.displacement == pytest.approx(other.displacement, abs=1e-9)
        elif not 0.25 < state.load_factor < 0.5:
            assert np.abs(state.displacement).max() < 1e-12
    assert path.problem.returns


def test_a_tool_may_appear_in_the_body() -> None:
    """It stores energy at once, which the account has as its work; pushed out, the body swings with part of it."""
    mesh = body(2)
    ball = ts.Sphere("ball", 0.01, (0.03, 0.038), during=(0.01, 0.0102), stiffness=2e7)
    asked = ts.Dynamics(0.0105, step=1e-5, scheme="leapfrog", record=1e-4)
    one = ts.Problem(
        mesh, replace(ts.Material(10e3, 0.3), density=1e3), ts.PlaneStrain(0.01), [ts.Fixed("bottom")], tools=[ball],
        dynamics=asked,
    )  # fmt: skip
    path = ts.solve(one, ts.Fem("neo-hookean"))
    assert path.status is ts.Status.CONVERGED
    energies = [state.moving.energies for state in path.states]
    begin = one.loading.interactions[0].action.stored(mesh.nodes, 0.0)
    assert begin > 0 and energies[100].contact == energies[-1].contact == 0.0
    assert max(one.contact for one in energies) == pytest.approx(begin, rel=0.3)
    last = energies[-1]
    assert last.kinetic + last.elastic == pytest.approx(-last.loads, rel=0.08)
    assert 0.1 * begin < -last.loads < 0.6 * begin
    assert not drawn_tools(one, 0.0) and len(drawn_tools(one, 0.96)) == len(drawn_tools(one, None)) == 1


def test_the_stable_step_counts_what_acts_together() -> None:
    def step(*intervals: tuple[float, float]) -> float:
        grasps = [ts.Grasp(str(k), (0.06, 0.015), 0.006, (0.06, 0.015), 1e5, one) for k, one in enumerate(intervals)]
        heavy = ts.Material(10e3, 0.3, density=1e3)
        one = ts.Problem(
            body(2), heavy, ts.PlaneStrain(0.01), [ts.Fixed("bottom")], grasps=grasps, dynamics=ts.Dynamics(1.0)
        )
        return stable_step(moving_body(one, ts.Springs("gaussian"))[0])

    alone, together = step((0.1, 0.2)), step((0.1, 0.2), (0.15, 0.3))
    assert step((0.1, 0.2), (0.2, 0.3)) == alone
    assert together == pytest.approx(alone / np.sqrt(2), rel=0.02)


def test_a_body_held_for_a_while_may_move_at_rest() -> None:
    mesh = ts.rectangle((0.06, 0.03), (4, 2))
    grasp = ts.Grasp("hold", (0.06, 0.015), 0.02, (0.06, 0.015), during=(0.0, 0.9))
    with pytest.raises(ProblemError, match="free to move"):
        ts.Problem(mesh, ts.Material(1e4, 0.3), ts.PlaneStrain(0.01), grasps=[grasp])


MOVING = STUDY.replace("poisson = 0.3", "poisson = 0.3\ndensity = 1000") + '\n[dynamics]\nduration = "2 s"\n'
HELD_BY = 'path = "pull.csv"\nduring = ["0.5 s", "1.5 s"]\norigin = ["60 mm", "15 mm"]'
ROWS = """\
t [s],name,kind,x [mm],y [mm],radius [m],value
0,,gravity,,,,0.0
0.5,grasp 1,place,61,15,,
0.5,other,place,0,0,,
0.5,grasp 1,grasp,nan,15,0.006,12.0
1.5,grasp 1,place,63,15,,
"""


def written(folder: Path, text: str, rows: str = ROWS) -> Path:
    (folder / "pull.csv").write_text(rows, encoding="utf-8")
    file = folder / "study.toml"
    file.write_text(text.replace('path = "pull.csv"', HELD_BY), encoding="utf-8")
    return file


def test_a_study_reads_the_rows_of_a_name(tmp_path: Path) -> None:
    moving = MOVING.replace("[[0, ", "[[0, ").replace('[1, "30 mm", "37 mm"]', '[2, "30 mm", "37 mm"]')
    study = read_study(written(tmp_path, moving))
    rows = [[0.5, 0.061, 0.015], [1.5, 0.063, 0.015]]
    grasp = ts.Grasp("grasp 1", [0.06, 0.015], 0.006, rows, during=(0.5, 1.5), origin=[0.06, 0.015])
    assert study.problem.grasps == (grasp,)
    assert plan(study)["tools"][-1].endswith("(0.063, 0.015) m, acts from 0.5 to 1.5")


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("0.5,grasp 1,place,61", "0.5,grasp 1,place,6l", ["pull.csv:3: x = '6l' is not a number"]),
        ("0.5,grasp 1,place,61", "0.5,grasp 1,place,inf", ["pull.csv:3: x = inf is not finite"]),
        ("1.5,grasp 1,place", "0.5,grasp 1,place", ["pull.csv:6: t = 0.5 is not after 0.5", "must ascend"]),
        (",grasp 1,place", ",grasp,place", ["pull.csv:1: no row has name = 'grasp 1'", "names: grasp, other"]),
        (",place,", ",spot,", ["pull.csv:1: no row has kind = 'place'"]),
        ("1.5,grasp 1,place", "1.4,grasp 1,place", ["grasp.1.path", "ends at 1.4, the interval in which it acts"]),
        ("x [mm]", "x [s]", ["pull.csv:1: x:"]),
    ],
)
def test_a_wrong_row_is_an_error_with_its_line(tmp_path: Path, before: str, after: str, words: list[str]) -> None:
    moving = MOVING.replace('[1, "30 mm", "37 mm"]', '[2, "30 mm", "37 mm"]')
    assert before in ROWS
    with pytest.raises(StudyError) as error:
        read_study(written(tmp_path, moving, ROWS.replace(before, after)))
    assert "study.toml:38: grasp.1.path" in str(error.value)
    for word in words:
        assert word in str(error.value)


@pytest.mark.parametrize(
    ("during", "words"),
    [
        ('["0.5 s", "0.4 s"]', ["study.toml:39: grasp.1.during", "ascending from 0 to 2"]),
        ('["0.5 s", "2.5 s"]', ["grasp.1.during", "ascending from 0 to 2"]),
        ('["0.5 s"]', ["grasp.1.during", "is not an interval", '["0.2 s", "1.4 s"]']),
        ('["0.5 mm", "1 s"]', ["grasp.1.during", "0.5 mm"]),
    ],
)
def test_a_wrong_interval_is_an_error(tmp_path: Path, during: str, words: list[str]) -> None:
    moving = MOVING.replace('[1, "30 mm", "37 mm"]', '[2, "30 mm", "37 mm"]')
    file = written(tmp_path, moving)
    file.write_text(file.read_text("utf-8").replace('["0.5 s", "1.5 s"]', during), encoding="utf-8")
    with pytest.raises(StudyError) as error:
        read_study(file)
    for word in words:
        assert word in str(error.value)


def test_an_interval_of_times_needs_a_motion(tmp_path: Path) -> None:
    file = written(tmp_path, STUDY)
    with pytest.raises(StudyError, match=r"grasp\.1\.during: times need \[dynamics\]"):
        read_study(file)
    file.write_text(file.read_text("utf-8").replace('["0.5 s", "1.5 s"]', "[0.5, 0.9]"), encoding="utf-8")
    study = read_study(file)
    with pytest.raises(StudyError, match=r"grasp\.1\.during: ends at 0\.9, but sweep compares"):
        require_last_level(study, "sweep")
