"""Measure schemes and steps of a soft cube against its true motion: python -m benchmarks.motion; writes docs/motion.md.

A cube of 60 mm, soft as liver (3 kPa, Poisson's ratio 0.45, 1060 kg/m^3), stands on its bottom under gravity, which
acts at once, while a patch of its top is drawn up by 25 mm and back in half of a swing of 1 Hz; with and without
damping by the material. The truth is leapfrog with a quarter of its safe step. Times are CPU seconds of one thread.
"""

import json
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import truespring as ts
from benchmarks import machine
from truespring.kernels.threads import limited, one_blas_thread

FRAME, DURATION = 1 / 60, 0.5
BEGIN, END = "<!-- begin of the measured table -->", "<!-- end of the measured table -->"
_HERE = Path(__file__).parent
PAGE = _HERE.parent / "docs" / "motion.md"


@dataclass(frozen=True)
class Row:
    """A way to move the cube.

    Attributes:
        scheme: scheme of time integration.
        steps: number of steps in a frame of 1/60 s.
        iterations: Newton iterations of a step, 0 to solve it.
        damping: time of the dashpots of the material [s].
    """

    scheme: str
    steps: int
    iterations: int = 0
    damping: float = 0.0

    @property
    def words(self) -> str:
        """The scheme, and how its steps are solved."""
        if self.scheme == "leapfrog":
            return "leapfrog"
        return f"{self.scheme}, " + ("solved" if not self.iterations else f"{self.iterations} iteration a step")


#: Ways to move the cube by elements a side and damping; the last one of each is the most exact.
ROWS = {
    (9, 0.0): (
        *(Row(scheme, steps) for scheme in ("euler", "bdf2", "midpoint") for steps in (1, 2, 4, 8)),
        *(Row(scheme, steps, 1) for scheme in ("euler", "bdf2") for steps in (1, 4)),
        Row("leapfrog", 20),
    ),
    (9, 0.01): (
        *(Row(scheme, steps) for scheme in ("euler", "bdf2", "midpoint") for steps in (1, 2, 4)),
        *(Row(scheme, 1, 1) for scheme in ("euler", "bdf2")),
        Row("leapfrog", 220),
    ),
    (20, 0.0): (Row("bdf2", 1), Row("bdf2", 4), Row("bdf2", 1, 1), Row("leapfrog", 44)),
}


def problem(n: int, dynamics: ts.Dynamics) -> ts.Problem:
    """Return the cube of n elements a side."""
    way = [(t, 0.03, 0.06 + 0.025 * np.sin(2 * np.pi * t), 0.03) for t in np.linspace(0, DURATION, 61)]
    return ts.Problem(
        ts.box((0.06, 0.06, 0.06), (n, n, n)),
        ts.Material(3e3, 0.45, density=1060.0),
        supports=[ts.Fixed("bottom")],
        loads=[ts.Gravity((0.0, -9.81, 0.0))],
        grasps=[ts.Grasp("hand", (0.03, 0.06, 0.03), 0.0095, way)],
        dynamics=dynamics,
    )


def moved(n: int, row: Row, finer: int = 1) -> tuple[ts.Solution, float]:
    """Return the motion by a scheme, and its CPU seconds."""
    step = FRAME / row.steps / finer
    damping = ts.Damping(stiffness=row.damping)
    asked = ts.Dynamics(
        DURATION, step=step, scheme=row.scheme, iterations=row.iterations, record=FRAME, damping=damping
    )
    body = problem(n, asked)
    started = time.thread_time()
    path = ts.solve(body, ts.Springs("gaussian"), ts.Newton(tolerance=1e-6))
    return path, time.thread_time() - started


def error(path: ts.Solution, truth: ts.Solution) -> float:
    """Return the worst of all frames: rms distance of the nodes over the largest rms displacement of the truth."""
    if not path.complete:
        return float("inf")
    pairs = list(zip(path.states, truth.states, strict=True))
    size = max(float(np.sqrt((there.displacement**2).sum(axis=1).mean())) for _, there in pairs)
    away = [float(np.sqrt(((one.displacement - there.displacement) ** 2).sum(axis=1).mean())) for one, there in pairs]
    return max(away) / size


def measured() -> dict:
    """Return the measurements of all rows."""
    found = []
    with limited(1), one_blas_thread():
        for (n, damping), several in ROWS.items():
            rows = [replace(row, damping=damping) for row in several]
            truth, _ = moved(n, rows[-1], 4)
            moved(n, rows[0])  # compiles
            for row in rows:
                path, seconds = moved(n, row)
                frames = round(DURATION / FRAME)
                found.append(
                    {
                        "nodes": (n + 1) ** 3,
                        "damping": damping,
                        "scheme": row.words,
                        "steps": row.steps,
                        "milliseconds": 1e3 * seconds / frames,
                        "error": error(path, truth),
                        "iterations": path.newton_iterations / (frames * row.steps),
                    }
                )
                sys.stderr.write(f"{found[-1]}\n")
    return {"date": machine.today(), "machine": machine.hardware(), "versions": machine.versions(), "rows": found}


def table(results: dict) -> str:
    """Return the measurements as a table in Markdown."""
    lines = [
        "| nodes | damping | scheme | steps a frame of 1/60 s | CPU ms a frame | Newton iterations a step | error |",
        "|---:|---:|---|---:|---:|---:|---:|",
    ]
    for row in results["rows"]:
        off = "unstable" if not np.isfinite(row["error"]) else f"{100 * row['error']:.2g} %"
        lines.append(
            f"| {row['nodes']:,} | {1e3 * row['damping']:g} ms | {row['scheme']} | {row['steps']} | "
            f"{row['milliseconds']:.3g} | {row['iterations']:.2g} | {off} |"
        )
    return "\n".join(lines)


def main() -> None:
    """Measure, and write the results and the table of the page."""
    results = measured()
    (_HERE / "motion.json").write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    page = PAGE.read_text(encoding="utf-8")
    before, after = page[: page.index(BEGIN) + len(BEGIN)], page[page.index(END) :]
    PAGE.write_text(f"{before}\n\n{table(results)}\n\n{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
