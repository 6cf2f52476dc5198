"""The loop of a live session: orders, pace, frames that are kept, and what a twin is given, by a stand-in clock."""

import time
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

import truespring as ts
from truespring.arrays import Floats
from truespring.live.commands import Command
from truespring.live.loop import Loop
from truespring.live.orders import MOST, Order, Orders
from truespring.live.pace import Meter, Pace
from truespring.live.ring import Kept, Ring
from truespring.live.session import Live


class StandIn:
    """A clock that a test moves; a sleep passes at once."""

    def __init__(self, overhead: float = 0.0) -> None:
        self.time, self.overhead = 100.0, overhead

    def now(self) -> float:
        return self.time

    def sleep(self, seconds: float) -> None:
        self.time += seconds + self.overhead


@dataclass(frozen=True)
class Ghost:
    time: float
    kind: str
    positions: Floats
    own: Floats | None = None


@dataclass
class Twin:
    """Notes what it is given, and returns ghosts that a test puts in."""

    told: list[Command] = field(default_factory=list)
    counts: list[tuple[int, bool]] = field(default_factory=list)
    ghosts: list[Ghost] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def tell(self, command: Command) -> None:
        self.told.append(command)

    def frames(self, n: int, still: bool) -> None:
        self.counts.append((n, still))

    def news(self) -> list[Ghost]:
        found, self.ghosts = self.ghosts, []
        return found

    def close(self) -> None: ...


def plate() -> ts.Problem:
    """A plate that is held on the left, at rest at its begin."""
    return ts.Problem(
        mesh=ts.rectangle(size=(0.04, 0.02), elements=(4, 2)),
        material=ts.Material(young=10e3, poisson=1 / 3, density=1000.0),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left")],
        stated=False,
        dynamics=ts.Dynamics(1.0),
    )


def loop_of(**more: object) -> Loop:
    session = Live(plate(), ts.Springs("gaussian"), models={"soft": ts.Springs("gaussian")})
    return Loop(session, **{"clock": StandIn(), **more})  # type: ignore[arg-type]


def turns(loop: Loop, n: int) -> None:
    for _ in range(n):
        loop.turn()


def test_the_latest_of_equal_orders_counts() -> None:
    orders = Orders()
    for order in (
        Order("move", "a", (1.0,)),
        Order("move", "b", (2.0,)),
        Order("young", value=2.0),
        Order("move", "a", (3.0,)),
        Order("step"),
        Order("move", "a", (4.0,)),
    ):
        assert orders.add(order)
    taken = [(one.kind, one.name, one.place) for one in orders.take()]
    after = [("young", "", ()), ("step", "", ()), ("move", "a", (4.0,))]  # across a step nothing is replaced
    assert taken == [("move", "a", (3.0,)), ("move", "b", (2.0,)), *after]
    assert orders.take() == []


def test_the_queue_is_bounded() -> None:
    orders = Orders()
    assert [orders.add(Order("step")) for _ in range(MOST + 2)].count(False) == 2
    assert orders.add(Order("young", value=1.0)) is False and len(orders) == MOST


def test_frames_are_due_at_the_speed_that_is_asked_for() -> None:
    pace, clock = Pace(0.02, speed=2.0), StandIn()
    begin = clock.time
    for _ in range(10):
        clock.sleep(pace.wait(clock.now()))
    assert clock.time - begin == pytest.approx(9 * 0.01)


def test_what_a_slow_machine_loses_is_not_made_up_for() -> None:
    clock = StandIn(overhead=0.05)  # each frame takes longer than the 0.02 s that it advances
    pace, meter = Pace(0.02), Meter()
    for _ in range(30):
        clock.sleep(pace.wait(clock.now()))
        meter.add(clock.now(), 0.02)
    assert meter.rates() == pytest.approx((1 / 0.05, 0.02 / 0.05))
    clock.overhead = 0.0
    waits = [pace.wait(clock.now()) for _ in range(3)]
    assert sum(waits) > 0.02  # at most one frame comes early


def test_it_runs_pauses_and_takes_single_steps() -> None:
    loop = loop_of()
    turns(loop, 3)
    assert loop.latest.frames == 3 and loop.latest.time == pytest.approx(3 / 60)
    loop.ask(Order("pause"))
    turns(loop, 3)
    assert not loop.latest.running and loop.latest.frames == 3
    loop.ask(Order("step"))
    turns(loop, 3)
    assert loop.latest.frames == 4
    loop.ask(Order("play"))
    turns(loop, 2)
    assert loop.latest.running and loop.latest.frames == 6


def test_a_pull_moves_the_body_and_is_let_go() -> None:
    loop = loop_of()
    node = int(loop.latest.positions[loop.latest.drawn.nodes, 0].argmax())
    begin = loop.latest.positions[loop.latest.drawn.nodes[node]]
    loop.ask(Order("pull", "pull 1", node=node))
    loop.ask(Order("move", "pull 1", (begin[0], begin[1] + 0.004)))
    turns(loop, 30)
    assert [one.what for one in loop.latest.marks] == ["grasp"]
    assert loop.latest.positions[loop.latest.drawn.nodes[node], 1] > begin[1] + 0.001
    assert loop.latest.readout["marks"][0]["force"].endswith("N")
    loop.ask(Order("let-go", "pull 1"))
    loop.ask(Order("let-go", "pull 1"))  # twice is no error
    turns(loop, 1)
    assert not loop.latest.marks and not loop.messages


@pytest.mark.parametrize(
    ("order", "said"),
    [
        (Order("nope"), "command 'nope'"),
        (Order("move", "nothing", (0.0, 0.0)), "'nothing' is no grasp"),
        (Order("pull", "pull 1", node=10**6), "node 1000000: the drawn nodes are 0 to 14"),
        (Order("speed", value=1e9), "speed = 1000000000.0: must be a number from 0.01 to 10"),
        (Order("young", value=float("nan")), "young: value = nan"),
        (Order("model", "hard"), "model 'hard' is unknown; allowed: soft"),
        (Order("save"), "start with --record DIR"),
    ],
)
def test_a_wrong_order_is_a_message_and_ends_nothing(order: Order, said: str) -> None:
    loop = loop_of()
    loop.ask(order)
    turns(loop, 2)
    assert said in loop.messages[-1] and said in loop.latest.readout["notes"][-1]
    assert loop.latest.frames == 2 and loop.latest.running


def test_an_error_of_the_session_pauses_it(monkeypatch: pytest.MonkeyPatch) -> None:
    loop = loop_of()
    monkeypatch.setattr(loop.live, "step", lambda: 1 / 0)
    turns(loop, 2)
    assert not loop.latest.running and "ZeroDivisionError" in loop.messages[-1]
    monkeypatch.undo()
    for kind in ("restart", "play"):
        loop.ask(Order(kind))
    turns(loop, 2)
    assert loop.latest.running and loop.latest.frames > 0


def test_a_grasp_added_after_a_restart_has_no_force_yet() -> None:
    """Also while the session is paused: the page shows it at once."""
    loop = loop_of()
    loop.ask(Order("pull", "pull 1", node=0))
    turns(loop, 2)
    for order in (Order("pause"), Order("restart"), Order("pull", "pull 2", node=1)):
        loop.ask(order)
    turns(loop, 1)
    assert [(one["name"], one["force"]) for one in loop.latest.readout["marks"]] == [("pull 2", None)]


def test_settings_are_those_that_were_set() -> None:
    loop = loop_of(model="first")
    known = loop.latest.readout["settings"]
    assert known == {"gravity": 0.0, "young": 1.0, "poisson": pytest.approx(1 / 3), "damping": 0.0}
    for order in (Order("young", value=2.0), Order("damping", value=3.0), Order("gravity", value=1.0)):
        loop.ask(order)
    loop.ask(Order("model", "soft"))
    turns(loop, 1)
    readout = loop.latest.readout
    assert readout["settings"] == {**known, "young": 2.0, "damping": 3.0, "gravity": 1.0}
    assert (readout["model"], readout["models"]) == ("soft", ["soft"])


def test_a_twin_is_given_commands_and_frames_in_order() -> None:
    twin = Twin()
    loop = loop_of(twin=twin)
    turns(loop, 2)
    loop.ask(Order("pull", "pull 1", node=0))
    loop.ask(Order("move", "pull 1", (0.0, 0.001)))
    turns(loop, 1)
    assert [(one.frame, one.kind) for one in twin.told] == [(2, "grasp"), (2, "move")]
    assert [n for n, _ in twin.counts][-1] == 3
    loop.ask(Order("restart"))
    loop.ask(Order("gravity", value=1.0))
    turns(loop, 1)
    assert [one.kind for one in twin.told[2:]] == ["restart", "gravity"] and twin.counts[-1][0] == 1


def test_a_ghost_is_compared_at_its_own_time() -> None:
    twin = Twin()
    loop = loop_of(twin=twin)
    loop.ask(Order("gravity", value=1.0))
    turns(loop, 10)
    kept = {round(60 * one.time): one.positions for one in loop.ring._kept}
    away = np.array([0.0, 1e-3])
    twin.ghosts = [Ghost(4 / 60, "moving", kept[4] + away), Ghost(5 / 60, "finer", kept[5])]
    turns(loop, 1)
    overlay = loop.latest.overlay
    assert overlay is not None and (overlay.kind, overlay.time) == ("moving", 4 / 60)
    assert overlay.distances == pytest.approx(np.full(len(kept[4]), 1e-3))
    twin.ghosts = [Ghost(99.0, "moving", kept[4])]  # not kept: nothing to compare with
    turns(loop, 1)
    assert loop.latest.overlay is overlay
    twin.ghosts = [Ghost(-9.0, "rest", kept[4] + away, kept[4])]  # nor this, but it has what it is compared with
    turns(loop, 1)
    assert loop.latest.overlay is not None and loop.latest.overlay.distances == pytest.approx(overlay.distances)
    loop.ask(Order("restart"))
    turns(loop, 1)
    assert loop.latest.overlay is None


def test_frames_are_kept_for_a_time_and_found_between() -> None:
    ring = Ring(0.1, seconds=1.0)
    for n in range(30):
        ring.add(Kept(n, 0.1 * n, np.full((2, 2), float(n))))
    assert len(ring) == 11 and ring.at(1.85) is None and ring.at(3.0) is None
    found = [ring.at(time) for time in (1.9, 2.25, 2.9)]
    assert [float(one[0, 0]) for one in found if one is not None] == pytest.approx([19.0, 22.5, 29.0])
    ring.add(Kept(0, 0.0, np.zeros((2, 2))))  # it began again
    assert len(ring) == 1


def test_the_thread_of_a_loop_runs_and_stops() -> None:
    seen = []
    loop = loop_of(clock=None)
    loop.watch(lambda: seen.append(loop.latest.number))
    loop.start()
    for _ in range(200):
        loop.orders.wait(0.01)
        if len(seen) > 3:
            break
    loop.stop()
    assert len(seen) > 3 and seen == sorted(seen)
    last = loop.latest.number
    time.sleep(0.05)
    assert loop.latest.number == last == seen[-1]


def test_a_body_at_rest_keeps_its_step() -> None:
    """Rounding errors of energies that cancel are no instability."""
    problem = replace(plate(), mesh=ts.rectangle(size=(0.04, 0.02), elements=(24, 12)))
    live = Live(problem, ts.Springs("gaussian"))
    steps = live.steps_a_frame
    live.step(10)
    assert live.steps_a_frame == steps and not [note for note in live.notes if "halved" in note]


def test_a_node_within_a_plane_body_stands_for_the_nearest_of_its_boundary() -> None:
    loop = loop_of()
    inside = next(k for k, at in enumerate(loop.latest.positions) if at == pytest.approx((0.02, 0.01)))
    loop.ask(Order("pull", "pull 1", node=inside))
    turns(loop, 1)
    assert [one.name for one in loop.latest.marks] == ["pull 1"] and not loop.messages
    x, y = loop.live.grasps["pull 1"].at
    assert (x, abs(y - 0.01)) == pytest.approx((0.02, 0.01))
