"""Kill a sweep repeatedly at random times, and check that no point is lost or solved twice.

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

# Enough points that the sweep is not complete after twenty kills.
_POISSON, _FORCES = 40, 12
_STUDY = Path(__file__).parents[1] / "examples" / "bending.toml"


def main(kills: int) -> int:
    """Kill a sweep `kills` times, complete it, and compare it with an undisturbed one; return the exit code."""
    with tempfile.TemporaryDirectory() as folder:
        disturbed, undisturbed = Path(folder) / "disturbed", Path(folder) / "undisturbed"
        known: dict[str, tuple[int, int]] = {}
        longest = 3 * _seconds_to_first(Path(folder) / "timed")
        for number in range(1, kills + 1):
            wait = random.uniform(0, longest)  # includes kills while it starts
            sweep = _started(disturbed)
            time.sleep(wait)
            ended = sweep.poll() is not None
            if not ended:
                os.killpg(sweep.pid, signal.SIGKILL)
            sweep.communicate()
            found = _records(disturbed)
            _hold(all(found.get(name) == stamp for name, stamp in known.items()), "a record was lost or written again")
            _print(f"kill {number:2}: after {wait:.1f} s, {len(found)} points kept{', it had ended' if ended else ''}")
            known = found
        (last, rows), (_, expected) = (_finished(out) for out in (disturbed, undisturbed))
        found = _records(disturbed)
        _hold(last == len(known), f"{len(known)} records existed, {last} were used")
        _hold(all(found[name] == stamp for name, stamp in known.items()), "a point was solved twice")
        _hold(len(rows) == _POISSON * _FORCES and rows == expected, "results differ from those of an undisturbed run")
        _print(f"{kills} kills, {len(rows)} points: none lost, none solved twice, results equal to an undisturbed run")
    return 0


def _seconds_to_first(out: Path) -> float:
    """Return the time until a sweep writes its first record [s]."""
    begun = time.perf_counter()
    sweep = _started(out)
    while not list(out.glob("points/*.json")):
        time.sleep(0.05)
        _hold(sweep.poll() is None, "the sweep ended without a record")
    os.killpg(sweep.pid, signal.SIGKILL)
    sweep.communicate()
    return time.perf_counter() - begun


def _started(out: Path) -> "subprocess.Popen[str]":
    """Start a sweep in a process group."""
    vary = [f"material.poisson=0:0.45:{_POISSON}", f"load.1.force.2=-0.004:-0.04:{_FORCES}", "mesh.elements=[32,8]"]
    command = [sys.executable, "-m", "truespring", "sweep", str(_STUDY), "--out", str(out), "--json", "--quiet"]
    command += [part for one in vary for part in ("--vary", one)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, start_new_session=True
    )


def _finished(out: Path) -> tuple[int, list[dict[str, object]]]:
    """Complete a sweep; return the number of points solved before, and the rows without times."""
    result = json.loads(_started(out).communicate()[0])
    rows = [{name: value for name, value in row.items() if not name.endswith("seconds")} for row in result["rows"]]
    return result["n_before"], rows


def _records(out: Path) -> dict[str, tuple[int, int]]:
    """Return inode and modification time of each record, after reading it: both change if it is written again."""
    found = {}
    for file in (out / "points").glob("*.json"):
        _hold(json.loads(file.read_text(encoding="utf-8"))["point"] == file.stem, f"{file.name} is not complete")
        found[file.stem] = (file.stat().st_ino, file.stat().st_mtime_ns)
    return found


def _print(text: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def _hold(holds: bool, failure: str) -> None:
    """Exit with a message unless a condition holds."""
    if not holds:
        raise SystemExit(f"failed: {failure}")


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 20))
