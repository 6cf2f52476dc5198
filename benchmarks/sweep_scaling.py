"""Measure the speedup of a sweep by its workers, and the overhead of a point.

`python -m benchmarks.sweep_scaling [POINTS]`, by default 200, prints the results and writes sweep_scaling.json.
"""

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from benchmarks import machine
from truespring.sweeping import Pool, plan_sweep, run_sweep

_STUDY = Path(__file__).parents[1] / "examples" / "bending.toml"

# A task that sleeps uses no core: the rest of its time is overhead of the sweep [s].
_PAUSE = 0.05


def pause(seconds: float) -> float:
    """Sleep, and return the time [s]."""
    time.sleep(seconds)
    return seconds


def main(n_points: int) -> int:
    """Measure, print and write the results; return the exit code."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None  # other processes slow the measurement
    alone = {workers: _pauses(workers, n_points) for workers in (1, 2)}
    overhead = {workers: (alone[workers] - n_points * _PAUSE / workers) / n_points * workers for workers in alone}
    swept = {workers: _sweep(workers, n_points) for workers in (1, 2)}
    values = {
        "n_points": n_points,
        "pauses": {"seconds": alone, "pause": _PAUSE, "overhead_per_point": overhead},
        "sweep": {
            "seconds": swept,
            "speedup": {kind: swept[1][kind] / swept[2][kind] for kind in swept[1]},
            "study": _STUDY.name,
        },
        "load_before": load,
        "date": machine.today(),
        "machine": machine.hardware(),
        "versions": {**machine.versions(), "distributed": version("distributed")},
    }
    text = json.dumps(values, indent=1, default=str)
    sys.stdout.write(f"{text}\n")
    (Path(__file__).parent / "sweep_scaling.json").write_text(f"{text}\n", encoding="utf-8")
    return 0


def _pauses(workers: int, n_points: int) -> float:
    """Return the time of `n_points` pauses on workers that have already started [s]."""
    with Pool(workers) as pool:
        list(pool.run(dict.fromkeys(range(4 * workers), 0.01), pause))
        return _timed(lambda: list(pool.run(dict.fromkeys(range(n_points), _PAUSE), pause)))


def _sweep(workers: int, n_points: int) -> dict[str, float]:
    """Return the time of a sweep of equal points [s]: `whole`, and `warm` without the start of the workers."""
    vary = {"material.density": [1000.0 + number for number in range(n_points)], "mesh.elements": [[32, 8]]}
    plan = plan_sweep(_STUDY, vary)
    came: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        whole = _timed(
            lambda: run_sweep(plan, Path(folder), workers, progress=lambda *_: came.append(time.perf_counter()))
        )
    first = 1 + workers  # the first report has no points; the first point of each worker loads and compiles
    return {"whole": whole, "warm": (came[-1] - came[first]) * n_points / (n_points - workers)}


def _timed(call: Callable[[], Any]) -> float:
    """Return the wall time of a call [s]."""
    begun = time.perf_counter()
    call()
    return time.perf_counter() - begun


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 200))
