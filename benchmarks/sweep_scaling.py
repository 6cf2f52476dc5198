"""How a sweep of equal points grows with its workers, and what a point costs beside its solve.

`python -m benchmarks.sweep_scaling [POINTS]`, by default 200, prints its figures and writes sweep_scaling.json here.
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

# A pause that takes no core: what a sweep adds to it is its own [s].
_PAUSE = 0.05


def pause(seconds: float) -> float:
    """A task without work."""
    time.sleep(seconds)
    return seconds


def main(n_points: int) -> int:
    """Measure, print and write."""
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None  # of others: they make all of this slower
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
    """Seconds for so many pauses, by workers that are up and have been asked once."""
    with Pool(workers) as pool:
        list(pool.run(dict.fromkeys(range(4 * workers), 0.01), pause))
        return _timed(lambda: list(pool.run(dict.fromkeys(range(n_points), _PAUSE), pause)))


def _sweep(workers: int, n_points: int) -> dict[str, float]:
    """Seconds for a sweep of equal points, with the start of its workers and without: from the first record on."""
    vary = {"material.density": [1000.0 + number for number in range(n_points)], "mesh.elements": [[32, 8]]}
    plan = plan_sweep(_STUDY, vary)
    came: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        whole = _timed(
            lambda: run_sweep(plan, Path(folder), workers, progress=lambda *_: came.append(time.perf_counter()))
        )
    first = 1 + workers  # the progress of nothing, then a point a worker, which compiles and loads
    return {"whole": whole, "warm": (came[-1] - came[first]) * n_points / (n_points - workers)}


def _timed(call: Callable[[], Any]) -> float:
    begun = time.perf_counter()
    call()
    return time.perf_counter() - begun


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 200))
