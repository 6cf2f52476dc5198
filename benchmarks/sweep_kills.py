"""Kill a sweep with all of its processes over and over at random moments: nothing is lost, nothing done twice.

`python -m benchmarks.sweep_kills [KILLS]`, by default twenty, on POSIX systems.
"""

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# Enough points of a little work that twenty kills do not see the end of them.
_POISSON, _FORCES = 40, 12
_STUDY = Path(__file__).parents[1] / "examples" / "bending.toml"


def main(kills: int) -> int:
    """Kill a sweep so many times, let it end, and compare it with an undisturbed one; return an exit code."""
    with tempfile.TemporaryDirectory() as folder:
        disturbed, undisturbed = Path(folder) / "disturbed", Path(folder) / "undisturbed"
        known: dict[str, tuple[int, int]] = {}
        longest = 3 * _seconds_to_first(Path(folder) / "timed")
        for number in range(1, kills + 1):
            wait = random.uniform(0, longest)  # some hit it as it starts
            sweep = _started(disturbed)
            time.sleep(wait)
            ended = sweep.poll() is not None
            if not ended:
                os.killpg(sweep.pid, signal.SIGKILL)
            sweep.communicate()
            found = _records(disturbed)
            _hold(all(found.get(name) == stamp for name, stamp in known.items()), "a record was lost or written again")
            _tell(f"kill {number:2}: after {wait:.1f} s, {len(found)} points kept{', it had ended' if ended else ''}")
            known = found
        (last, rows), (_, wanted) = (_finished(out) for out in (disturbed, undisturbed))
        found = _records(disturbed)
        _hold(last == len(known), f"{len(known)} records were there, {last} were taken")
        _hold(all(found[name] == stamp for name, stamp in known.items()), "a point was solved twice")
        _hold(len(rows) == _POISSON * _FORCES and rows == wanted, "results differ from those of an undisturbed run")
        _tell(f"{kills} kills, {len(rows)} points: none lost, none solved twice, all as undisturbed")
    return 0


def _seconds_to_first(out: Path) -> float:
    """How long it takes until a sweep has its first record, on this machine as it is."""
    begun = time.perf_counter()
    sweep = _started(out)
    while not list(out.glob("points/*.json")):
        time.sleep(0.05)
        _hold(sweep.poll() is None, "it ended before it began")
    os.killpg(sweep.pid, signal.SIGKILL)
    sweep.communicate()
    return time.perf_counter() - begun


def _started(out: Path) -> "subprocess.Popen[str]":
    vary = [f"material.poisson=0:0.45:{_POISSON}", f"load.1.force.2=-0.004:-0.04:{_FORCES}", "mesh.elements=[32,8]"]
    command = [sys.executable, "-m", "truespring", "sweep", str(_STUDY), "--out", str(out), "--json", "--quiet"]
    command += [part for one in vary for part in ("--vary", one)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, start_new_session=True
    )


def _finished(out: Path) -> tuple[int, list[dict[str, object]]]:
    """How many points had been solved before, and the rows without what the clock says."""
    told = json.loads(_started(out).communicate()[0])
    rows = [{name: value for name, value in row.items() if not name.endswith("seconds")} for row in told["rows"]]
    return told["n_before"], rows


def _records(out: Path) -> dict[str, tuple[int, int]]:
    """All records, each read whole, and what changes when one is written again."""
    found = {}
    for file in (out / "points").glob("*.json"):
        _hold(json.loads(file.read_text(encoding="utf-8"))["point"] == file.stem, f"{file.name} is not whole")
        found[file.stem] = (file.stat().st_ino, file.stat().st_mtime_ns)
    return found


def _tell(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _hold(holds: bool, told: str) -> None:
    if not holds:
        raise SystemExit(f"failed: {told}")


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 20))
