"""Measure live sessions: python -m benchmarks.live; writes live.json and the table of docs/live.md.

A cube of 60 mm, soft as liver (3 kPa, Poisson's ratio 0.45, 1060 kg/m^3), stands under gravity while a patch of its top
is drawn up by 25 mm and back in half of a swing of 1 Hz; the liver of examples/organ.toml hangs in its supports while a
patch is drawn by 5 mm in the same way. Times are of one thread, the shortest of frames in wall time and the median; the
truth is leapfrog with a quarter of the step. Finite elements take the same steps (leapfrog, neo-Hookean, all cores).
"""

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import truespring as ts
from benchmarks import machine
from truespring.equilibrium import moving_body
from truespring.kernels.threads import limited, one_blas_thread
from truespring.live import Live
from truespring.live.actions import Weight
from truespring.live.steppers import Acting, StepByStep
from truespring.models import Model
from truespring.motion.explicit import Leapfrog
from truespring.study import read_study

FRAME, FRAMES = 1 / 60, 30
BEGIN, END = "<!-- begin of the measured table -->", "<!-- end of the measured table -->"
_HERE = Path(__file__).parent
PAGE = _HERE.parent / "docs" / "live.md"
# Steps that finite elements take, and turns of the loop at 1 kHz.
_FEM_STEPS, _TICKS = 5, 2000
TICK = 1e-3


@dataclass(frozen=True)
class Case:
    """A body that is pulled.

    Attributes:
        name: in words.
        problem: returns the problem.
        at: the middle of the patch [m].
        way: how far it is drawn [m].
        radius: of the patch [m].
        error: largest error of a frame against the true motion [-], inf if it is only told.
        paced: whether frames must be computed in the time between them.
    """

    name: str
    problem: Callable[[], ts.Problem]
    at: tuple[float, float, float]
    way: tuple[float, float, float]
    radius: float
    error: float
    paced: bool = True


def cube(n: int) -> ts.Problem:
    """Return the cube of n elements a side."""
    return ts.Problem(
        ts.box((0.06, 0.06, 0.06), (n, n, n)),
        ts.Material(3e3, 0.45, density=1060.0),
        supports=[ts.Fixed("bottom")],
        loads=[ts.Gravity((0.0, -9.81, 0.0))],
        dynamics=ts.Dynamics(1.0),
    )


def organ(edge: str | None = None) -> ts.Problem:
    """Return the liver in voxels of another edge."""
    text = (_HERE.parent / "examples" / "organ.toml").read_text(encoding="utf-8")
    if edge is not None:
        text = text.replace('edge = "0.626 mm"', f'edge = "{edge}"')
    file = _HERE.parent / "out" / "bench" / f"organ-{edge}.toml"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return read_study(file).problem


_TOP, _LIVER = (0.03, 0.06, 0.03), (0.045, 0.047, 0.022)
CASES = (
    Case("cube", lambda: cube(9), _TOP, (0.0, 0.025, 0.0), 0.0095, 0.005),
    Case("cube", lambda: cube(20), _TOP, (0.0, 0.025, 0.0), 0.0095, 0.01),
    Case("liver, voxels of 2 mm", lambda: organ("2 mm"), _LIVER, (0.0, 0.005, 0.0), 0.004, 0.01),
    Case("liver, voxels of 0.626 mm", organ, _LIVER, (0.0, 0.005, 0.0), 0.004, np.inf, paced=False),
)


@dataclass
class Session:
    """A session that follows the pull.

    Attributes:
        live: the session.
        case: what is pulled.
        frames: number of frames so far.
        seconds: wall time of each frame.
        moved: displacements at the end of each frame [m].
    """

    live: Live
    case: Case

    def __post_init__(self) -> None:
        """Take hold of the patch."""
        nodes, _ = self.live.surface
        rest = self.live.problem.mesh.nodes
        self.at = rest[nodes[((rest[nodes] - self.case.at) ** 2).sum(axis=1).argmin()]]
        self.seconds: list[float] = []
        self.moved: list[np.ndarray] = []
        self.name = self.live.pull(
            self.live.positions[((rest - self.at) ** 2).sum(axis=1).argmin()], radius=self.case.radius
        )
        self.begin = self.live.grasps[self.name].place
        self.first = self.live.state

    def again(self, step: float) -> None:
        """Return to the begin, to take steps of another length [s]."""
        self.live.choose("leapfrog", step, 0)
        self.live.go_on(self.first)
        self.seconds, self.moved = [], []

    def frame(self) -> None:
        """Advance by a frame."""
        at = (len(self.seconds) + 1) * self.live.settings.frame
        self.live.pull(self.at, self.begin + np.sin(2 * np.pi * at) * np.array(self.case.way), name=self.name)
        started = time.perf_counter()
        self.live.step()
        self.seconds.append(time.perf_counter() - started)
        self.moved.append(self.live.positions - self.live.problem.mesh.nodes)


def session(case: Case, model: Model, step: float | str = "auto", frame: float = FRAME) -> Session:
    """Return a session that is about to be pulled."""
    return Session(Live(problem_of(case), model, scheme="leapfrog", step=step, frame=frame), case)


@cache
def problem_of(case: Case) -> ts.Problem:
    """Return the problem of a case, always the same one."""
    return case.problem()


def error(moved: list[np.ndarray], truth: list[np.ndarray]) -> float:
    """Return the worst of all frames: rms distance of the nodes over the largest rms displacement of the truth."""
    size = max(float(np.sqrt((one**2).sum(axis=1).mean())) for one in truth)
    pairs = zip(moved, truth, strict=True)
    return max(float(np.sqrt(((one - other) ** 2).sum(axis=1).mean())) for one, other in pairs) / size


def fem_step(live: Live) -> float:
    """Return the wall time of a step of finite elements from the state of a session, on all cores [s]."""
    body, _ = moving_body(live.problem, ts.Fem("neo-hookean"))
    stepper, last, spent = StepByStep(Leapfrog(body), "leapfrog"), live.moment, []
    still = np.zeros(last.positions.shape)
    nothing = Acting((), (), live.surface, Weight(still, 0.0, 0.0))
    with limited(None):
        last = stepper.frame(last, nothing, 1, live.step_length).moment  # compiles
        for _ in range(_FEM_STEPS):
            started = time.perf_counter()
            last = stepper.frame(last, nothing, 1, live.step_length).moment
            spent.append(time.perf_counter() - started)
    return min(spent)


def row(case: Case) -> dict:
    """Return the measurements of a case."""
    springs = ts.Springs("gaussian")
    one = session(case, springs)
    step, stable = one.live.step_length, one.live.steps_a_frame
    for _ in range(FRAMES):
        one.frame()
    fastest, median, moved = min(one.seconds), float(np.median(one.seconds)), one.moved
    halved = [note for note in one.live.notes if "halved" in note]
    one.again(step / 4)
    for _ in range(FRAMES):
        one.frame()
    return {
        "body": case.name,
        "nodes": problem_of(case).mesh.n_nodes,
        "steps": stable,
        "step": step,
        "milliseconds": 1e3 * fastest,
        "median": 1e3 * median,
        "step_seconds": fastest / stable,
        "error": error(moved, one.moved),
        "halved": halved,
        "fem_step_seconds": fem_step(one.live),
        "largest_error": None if np.isinf(case.error) else case.error,
        "paced": case.paced,
    }


def paced(case: Case) -> dict:
    """Return the lateness of a loop of frames of TICK, which waits for the clock before each frame."""
    one = session(case, ts.Springs("gaussian"), frame=TICK)
    for _ in range(50):
        one.frame()
    late, begin = [], time.perf_counter() + TICK
    one.seconds.clear()
    for tick in range(_TICKS):
        due = begin + tick * TICK
        while time.perf_counter() < due:
            pass
        late.append(time.perf_counter() - due)
        one.frame()
    spent = np.array(one.seconds)
    return {
        "body": case.name,
        "nodes": problem_of(case).mesh.n_nodes,
        "steps": one.live.steps_a_frame,
        "spent": [1e3 * float(value) for value in np.percentile(spent, (0, 50, 99, 100))],
        "late": [1e3 * float(value) for value in np.percentile(late, (50, 99, 100))],
        "missed": float((np.array(late) > TICK).mean()),
    }


def measured() -> dict:
    """Return the measurements of all cases."""
    rows, loops = [], []
    with limited(1), one_blas_thread():
        for case in CASES:
            rows.append(row(case))
            sys.stderr.write(f"{rows[-1]}\n")
        for case in CASES[:3]:
            loops.append(paced(case))
            sys.stderr.write(f"{loops[-1]}\n")
    found = {"date": machine.today(), "machine": machine.hardware(), "versions": machine.versions()}
    return {**found, "rows": rows, "loops": loops}


def floors(results: dict) -> list[tuple[str, bool]]:
    """Return what a live session must reach, and whether it did."""
    found = []
    for one in results["rows"]:
        body = f"{one['body']}, {one['nodes']:,} nodes"
        if one["nodes"] == 1000:
            found.append((f"{body}: 5,000 steps a second", one["step_seconds"] <= 1 / 5000))
        if not one["paced"]:
            continue
        exact = one["error"] <= one["largest_error"]
        within = f"within {100 * one['largest_error']:g} % of the true motion"
        found.append((f"{body}: 60 frames a second in real time, {within}", exact and one["median"] <= 1e3 / 60))
        if one["nodes"] != 1000:
            found.append((f"{body}: 120 frames of 1/60 s a second (aim)", exact and one["median"] <= 1e3 / 120))
    for one in results["loops"]:
        words = f"{one['body']}, {one['nodes']:,} nodes: a loop of 1 kHz, 99 % of its turns within 1 ms"
        found.append((words, one["spent"][2] <= 1.0))
    return found


def table(results: dict) -> str:
    """Return the measurements as tables in Markdown."""
    lines = [
        "| body | nodes | step | steps a frame of 1/60 s | steps a second | ms a frame (median) | frames a second | "
        "real-time factor | error | the same step by FEM |",
        "|---|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for one in results["rows"]:
        frames = 1e3 / one["median"]
        fem = one["fem_step_seconds"]
        lines.append(
            f"| {one['body']} | {one['nodes']:,} | {1e3 * one['step']:.3g} ms | {one['steps']} | "
            f"{1 / one['step_seconds']:,.0f} | {one['milliseconds']:.3g} ({one['median']:.3g}) | {frames:.0f} | "
            f"{frames / 60:.2g} | {100 * one['error']:.2g} % | {1e3 * fem:.3g} ms, {fem / one['step_seconds']:.0f} x |"
        )
    lines += [
        "",
        "A loop of 1 kHz: each turn waits for the clock, moves the grasp and takes the steps of 1 ms.",
        "",
        "| body | nodes | steps a turn | ms a turn: least, median, 99 %, most | begun late by: median, 99 %, most | "
        "begun more than 1 ms late |",
        "|---|---:|---:|---:|---:|---:|",
    ]
    for one in results["loops"]:
        spent, late = ", ".join(f"{v:.2g}" for v in one["spent"]), ", ".join(f"{v:.2g}" for v in one["late"])
        lines.append(
            f"| {one['body']} | {one['nodes']:,} | {one['steps']} | {spent} | {late} ms | {100 * one['missed']:.2g} % |"
        )
    lines += ["", "| what a session must reach on two cores | reached |", "|---|---|"]
    lines += [f"| {words} | {'yes' if reached else 'no'} |" for words, reached in floors(results)]
    hardware = results["machine"]
    lines += ["", f"Measured on {results['date']}: {hardware['processor']}, {hardware['cores']} cores."]
    return "\n".join(lines)


def write(results: dict) -> None:
    """Write the results and the table of the page."""
    (_HERE / "live.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    page = PAGE.read_text(encoding="utf-8")
    before, after = page[: page.index(BEGIN) + len(BEGIN)], page[page.index(END) :]
    PAGE.write_text(f"{before}\n\n{table(results)}\n\n{after}", encoding="utf-8")


if __name__ == "__main__":
    write(measured())
