"""The twin of a live session: errors at equal times, against `solve`, `compare`, `Dynamics` and finer steps."""

import os
import signal
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import truespring as ts
from truespring.errors import LiveError
from truespring.live import Live, hold
from truespring.live.beside import Beside, Job
from truespring.live.commands import Command
from truespring.live.ghost import Ghost
from truespring.live.measured import Measures
from truespring.live.twin import Twin, packed

FEM, SPRINGS = ts.Fem("neo-hookean"), ts.Springs("gaussian")
NEWTON = ts.Newton(tolerance=1e-12)
TIP = (0.1, 0.01)
UP = (0.095, 0.016)


def body(**changes: object) -> ts.Problem:
    known = {
        "mesh": ts.rectangle((0.1, 0.02), (10, 2)),
        "material": ts.Material(3e3, 0.3, density=1000.0),
        "section": ts.PlaneStress(0.01),
        "supports": [ts.Fixed(on="left")],
        "dynamics": ts.Dynamics(1.0, scheme="leapfrog", damping=ts.Damping(mass=20.0)),
    }
    return ts.Problem(**known | changes)


def session(problem: ts.Problem | None = None, **known: object) -> Live:
    """A session by leapfrog, whatever takes less time."""
    return Live(body() if problem is None else problem, **{"model": SPRINGS, "scheme": "leapfrog"} | known)


class Ring:
    """All frames of a session by time."""

    def __init__(self, live: Live) -> None:
        self.live, self.kept = live, [(live.time, live.positions)]

    def step(self, frames: int) -> None:
        for _ in range(frames):
            self.live.step()
            self.kept.append((self.live.time, self.live.positions))

    def at(self, moment: float) -> np.ndarray | None:
        return next((places for when, places in self.kept if abs(when - moment) < 1e-9), None)


def beside(live: Live, reference: object = FEM) -> Beside:
    """What runs beside a session, told its begin."""
    found = Beside(Job(live.problem, reference, live.model, live.models, live.settings))
    found.frames(0, False, live.step_length, live.state)
    return found


def told(found: Beside, live: Live, still: bool = False) -> list[Ghost]:
    """All ghosts after the commands and frames of a session; the commands leave its log."""
    for command in live.log.commands:
        found.tell(command)
    live.log.commands.clear()
    found.frames(live.log.frames, still, live.step_length, live.state if still else None)
    ghosts: list[Ghost] = []
    while (more := found.turn()) is not None:
        ghosts += more
    return ghosts


def of(ghosts: list[Ghost], kind: str) -> list[Ghost]:
    return [one for one in ghosts if one.kind == kind]


def held(live: Live, problem: ts.Problem) -> ts.Problem:
    """The same body with the grasp of a session, as a problem at rest."""
    grip = live.grasps["pull"]
    path = [[0, *grip.at], [1, *grip.place]]
    grasp = ts.Grasp("pull", grip.at.tolist(), grip.radius, path, stiffness=float(grip.stiffness.sum()))
    return replace(problem, dynamics=None, grasps=[grasp])


def test_the_models_error_at_rest_is_that_of_solve() -> None:
    live = session()
    ring, found, measures = Ring(live), beside(live), Measures(live)
    live.pull(TIP, UP)
    ring.step(30)
    (ghost,) = of(told(found, live, still=True), "rest")
    measures.take(ghost, ring)
    static = held(live, body())
    mine, right = (ts.solve(static, model, NEWTON) for model in (SPRINGS, FEM))
    compared, size = ts.compare(mine, right), right.states[-1].displacement
    expected = compared.rms_distances[-1] / np.sqrt((size[compared.compared] ** 2).sum(axis=1).mean())
    assert measures.model is not None
    assert expected > 1e-3
    assert measures.model.error == pytest.approx(expected, rel=1e-6)
    apart = np.linalg.norm(mine.states[-1].positions - right.states[-1].positions, axis=1)
    assert np.abs(measures.model.distances - apart).max() < 1e-6 * apart.max()


def test_a_released_body_comes_to_the_equilibrium_of_solve() -> None:
    weight = [ts.Gravity((0.0, -2.0))]
    dynamics = ts.Dynamics(1.0, scheme="leapfrog", start="equilibrium", damping=ts.Damping(mass=10.0))
    live = session(body(loads=weight, dynamics=dynamics))
    live.pull(TIP, UP)
    live.step(20)
    live.release("pull")
    live.step(280)
    state = ts.solve(body(loads=weight, dynamics=None), SPRINGS, NEWTON).states[-1]
    assert np.abs(live.positions - state.positions).max() < 1e-6 * np.abs(state.displacement).max()


def test_the_moving_reference_is_that_of_dynamics() -> None:
    step, frame, n = 1 / 600, 1 / 60, 12
    live = session(step=step)
    found = beside(live)
    live.pull(TIP)
    rows, place = [[0.0, *TIP]], np.array(TIP)
    for number in range(1, n + 1):
        place = place + np.array([-0.0002, 0.0005])
        live.pull(TIP, place)
        live.step()
        rows.append([number * frame, *place])
    ghosts = of(told(found, live), "moving")
    assert [one.time for one in ghosts] == pytest.approx([number * frame for number in range(1, n + 1)])
    grip = live.grasps["pull"]
    grasp = ts.Grasp("pull", TIP, grip.radius, rows, stiffness=float(grip.stiffness.sum()))
    dynamics = replace(body().dynamics, duration=n * frame, step=step, record=frame)
    path = ts.solve(body(grasps=[grasp], dynamics=dynamics), FEM, NEWTON)
    for state, ghost in zip(path.states[1:], ghosts, strict=True):
        assert np.abs(ghost.positions - state.positions).max() < 1e-12 * 0.1
        assert ghost.time == pytest.approx(state.moving.time)


@pytest.mark.parametrize("scheme", ["leapfrog", pytest.param("bdf2", marks=pytest.mark.verification)])
def test_the_error_of_time_is_that_against_much_finer_steps(scheme: str) -> None:
    frame = 1 / 60
    undamped = ts.Dynamics(1.0, scheme=scheme)
    step = frame / 8

    def session_of(steps: float) -> Live:
        return Live(body(dynamics=undamped), SPRINGS, step=steps, scheme=scheme)

    live, exact = session_of(step), session_of(step / 8)
    ring, found, measures = Ring(live), beside(live, SPRINGS), Measures(live)
    for one in (live, exact):
        one.pull(TIP, (0.1, 0.012))
    ring.step(6)
    exact.step(6)
    ghost = of(told(found, live), "finer")[-1]
    assert ghost.time == pytest.approx(live.time)
    measures.take(ghost, ring)
    moved = exact.positions - live.problem.mesh.nodes
    expected = np.linalg.norm(live.positions - exact.positions) / np.linalg.norm(moved)
    assert measures.time is not None
    assert measures.time.error == pytest.approx(expected, rel=0.1)


def test_the_solvers_error_is_that_against_solved_steps() -> None:
    known = {"step": 1 / 120, "scheme": "bdf2"}
    undamped = body(dynamics=ts.Dynamics(1.0))
    live, exact = Live(undamped, SPRINGS, iterations=1, **known), Live(undamped, SPRINGS, **known)
    ring, found, measures = Ring(live), beside(live), Measures(live)
    live.pull(TIP, UP)
    ring.step(6)
    told(found, live)
    assert "solver" not in measures.words()
    found.present(live.state, live.step_length)
    exact.go_on(live.state)
    ring.step(1)
    exact.step()
    (ghost,) = of(told(found, live), "solved")
    measures.take(ghost, ring)
    moved = exact.positions - live.problem.mesh.nodes
    expected = np.linalg.norm(live.positions - exact.positions) / np.linalg.norm(moved)
    assert expected > 1e-5
    assert measures.solver is not None and measures.solver.error == pytest.approx(expected, rel=1e-6)
    assert measures.words()["solver"] == f"{100 * expected:.2g} % of a frame with 1 iteration a step"
    assert Measures(exact).words()["solver"] == "none: each step is solved to the tolerance"


def test_only_equal_times_are_compared() -> None:
    live = session()
    ring, measures = Ring(live), Measures(live)
    live.pull(TIP, UP)
    ring.step(5)
    late, now = ring.kept[-2][1], ring.kept[-1][1]
    measures.take(Ghost(ring.kept[-2][0], "moving", late), ring)
    assert measures.model is not None and measures.model.error == 0.0
    measures.take(Ghost(ring.kept[-2][0], "moving", now), ring)  # shifted by a frame: it is not that of the last
    assert measures.model.error > 0.01
    before = measures.model
    measures.take(Ghost(ring.kept[-1][0] + 1.0, "moving", now), ring)  # not kept
    assert measures.model is before
    ring.step(30)
    assert measures.words()["model"].endswith("in motion, 0.5 s behind")


def test_an_error_at_rest_lasts_until_the_body_moves() -> None:
    live = session()
    ring, measures = Ring(live), Measures(live)
    live.pull(TIP, UP)
    ring.step(40)
    still, then = live.positions, live.time
    right = live.problem.mesh.nodes + 1.01 * (still - live.problem.mesh.nodes)
    measures.take(Ghost(then, "rest", right, own=still), ring)
    measures.take(Ghost(ring.kept[-4][0], "moving", still), ring)
    ring.step(10)
    assert measures.words()["model"] == "0.99 % at rest"
    live.release("pull")
    ring.step(20)
    assert measures.words()["model"] == "0.99 % at rest, 0.5 s behind"
    measures.take(Ghost(live.time, "moving", live.positions), ring)
    assert measures.words()["model"] == "0 % in motion"
    assert measures.words()["solver"].startswith("none")


def test_a_reference_too_far_behind_goes_on_from_rest(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("truespring.live.beside._FAR", 0.3)
    live = session()
    ring, found = Ring(live), beside(live)
    live.pull(TIP, UP)
    ring.step(24)
    assert not of(told(found, live), "moving")
    (rest,) = of(told(found, live, still=True), "rest")
    ring.step(3)
    ghosts = of(told(found, live, still=False), "moving")
    assert [one.time for one in ghosts] == pytest.approx([live.time - 2 / 60, live.time - 1 / 60, live.time])
    assert ghosts[0].since == pytest.approx(0.4)
    assert np.abs(ghosts[-1].positions - rest.positions).max() < 1e-9 * 0.1
    live.release("pull")
    ring.step(3)
    assert np.abs(of(told(found, live), "moving")[-1].positions - rest.positions).max() > 1e-3 * 0.1


def test_changes_of_the_body_are_followed() -> None:
    live = session(body(loads=[ts.Gravity((0.0, -1.0))]), models={"other": ts.Springs("isotropic")})
    ring, found = Ring(live), beside(live)
    live.pull(TIP, UP)
    ring.step(2)
    for young in (3.0, 2.0):
        live.do("young", value=young)
    live.do("poisson", value=0.2)
    live.do("model", "other")
    live.gravity(0.5)
    ring.step(3)
    (ghost,) = of(told(found, live, still=True), "rest")
    stiffer = ts.Material(6e3, 0.2, density=1000.0)
    static = held(live, body(material=stiffer, loads=[ts.Gravity((0.0, -0.5))]))
    for model, positions in ((FEM, ghost.positions), (ts.Springs("isotropic"), ghost.own)):
        state = ts.solve(static, model, NEWTON).states[-1]
        assert np.abs(positions - state.positions).max() < 1e-8 * np.abs(state.displacement).max()


def test_a_sphere_holds_both_models() -> None:
    live = session()
    ring, found = Ring(live), beside(live)
    live.push((0.08, 0.0301), radius=0.01)
    live.push((0.08, 0.026))
    ring.step(30)
    (ghost,) = of(told(found, live, still=True), "rest")
    ball = live.spheres["sphere"]
    path = [[0, 0.08, 0.0301], [1, 0.08, 0.026]]
    sphere = ts.Sphere("sphere", ball.radius, path, stiffness=ball.stiffness)
    state = ts.solve(replace(body(), dynamics=None, tools=[sphere]), FEM, NEWTON).states[-1]
    assert np.abs(ghost.positions - state.positions).max() < 1e-8 * np.abs(state.displacement).max()


def test_an_equilibrium_is_approached_from_the_undeformed_body_if_no_start_leads_to_it() -> None:
    live = session(body(loads=[ts.Gravity((0.0, -1.0))]), model=FEM)
    live.pull(TIP, UP)
    live.step(30)
    inverted = live.problem.mesh.nodes * [-1.0, 1.0]
    found = hold.Resting().find(live, live.state, [inverted], lambda: False)
    state = ts.solve(held(live, body(loads=[ts.Gravity((0.0, -1.0))])), FEM, NEWTON).states[-1]
    assert found is not None
    assert np.abs(found - state.positions).max() < 1e-8 * np.abs(state.displacement).max()


def test_a_search_ends_when_the_body_moves_again() -> None:
    live = session()
    ring, found = Ring(live), beside(live)
    live.pull(TIP, UP)
    ring.step(30)
    for command in live.log.commands:
        found.tell(command)
    found.frames(30, True, live.step_length, live.state)
    heard: list[int] = []

    def hear() -> None:
        heard.append(1)
        found.tell(Command(30, "release", "pull"))

    assert found.turn(hear) == []
    assert heard == [1] and found.held is None


def test_a_restart_begins_a_new_run() -> None:
    live = session()
    ring, found = Ring(live), beside(live)
    live.pull(TIP, UP)
    ring.step(3)
    first = of(told(found, live), "moving")
    live.restart()
    found.tell(Command(0, "restart"))
    ring.step(3)
    second = of(told(found, live), "moving")
    assert {one.run for one in first} == {0} and {one.run for one in second} == {1}
    assert np.abs(second[-1].positions - live.problem.mesh.nodes).max() < 1e-15


def test_a_coarser_mesh_is_quick_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(hold, "_MANY", 50)
    monkeypatch.setattr("truespring.live.rest._QUICK", 50)
    live = session(body(mesh=ts.rectangle((0.1, 0.02), (20, 4))))
    ring, found, measures = Ring(live), beside(live), Measures(live)
    live.pull(TIP, UP)
    ring.step(30)
    ghosts = of(told(found, live, still=True), "rest")
    assert [(one.coarse, one.own is None) for one in ghosts] == [(33, True), (0, False)]
    errors = []
    for ghost in ghosts:
        measures.take(ghost, ring)
        assert measures.model is not None
        errors.append(measures.model.error)
        assert ("on 33 nodes" in measures.words()["model"]) == (ghost.coarse > 0)
    assert 1e-3 < errors[1] != errors[0] == pytest.approx(errors[1], rel=0.3)


def test_second_order_elements_are_interpolated() -> None:
    live = session(body(mesh=ts.rectangle((0.1, 0.02), (10, 2), element="triangle")))
    ring, found = Ring(live), beside(live)
    live.pull(TIP, UP)
    ring.step(6)
    ghosts = told(found, live, still=True)
    (ghost,) = of(ghosts, "rest")
    state = ts.solve(held(live, live.problem), FEM, NEWTON).states[-1]
    assert len(state.all_positions) > len(state.positions) == len(ghost.positions)
    assert np.abs(ghost.positions - state.positions).max() < 1e-8 * np.abs(state.displacement).max()


def test_a_model_that_cannot_be_sent_says_so() -> None:
    class Local(ts.Springs):
        pass

    live = session()
    with pytest.raises(LiveError, match="define models in a module"):
        packed(Job(live.problem, Local("gaussian"), SPRINGS, {}, live.settings))


@pytest.mark.verification
def test_the_process_finds_what_is_beside_and_survives_its_end() -> None:
    live = session()
    ring = Ring(live)
    with Twin(live, FEM) as twin:
        measures = Measures(live, twin)
        live.pull(TIP, UP)
        known = {"rest": False, "moving": False, "finer": False}

        def go(until: Callable[[], bool]) -> None:
            end = time.monotonic() + 150
            while not until() and time.monotonic() < end:
                ring.step(1)
                twin.follow()
                for ghost in twin.news():
                    known[ghost.kind] = True
                    measures.take(ghost, ring)
                time.sleep(0.005)
            assert until()

        go(lambda: known["rest"] and known["finer"])
        static = held(live, body())
        mine, right = (ts.solve(static, model, NEWTON).states[-1].displacement for model in (SPRINGS, FEM))
        assert measures.model is not None
        assert measures.model.error == pytest.approx(np.linalg.norm(mine - right) / np.linalg.norm(right), rel=1e-6)
        live.release("pull")
        go(lambda: known["moving"])
        assert set(measures.words()) == {"model", "time", "solver"}
        assert twin.pid is not None
        os.kill(twin.pid, signal.SIGKILL)
        go(lambda: bool(twin.ended))
        ring.step(10)
        twin.follow()
        assert "exit code -9" in twin.ended and twin.news() == []
        assert measures.words()["model"] == twin.ended
    assert twin.ended


@pytest.mark.verification
def test_the_example_of_errors_measures_all_three(capfd: pytest.CaptureFixture[str]) -> None:
    from tests.test_examples import script

    found = script("live_errors").errors()
    assert len(found.splitlines()) == 3 and found.count("%") >= 2
