"""Wall times of the command line, with an empty and with a full cache of compiled code."""

import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.runs import REPEATS, ROOT, Session, environment

_STUDY = str(ROOT / "examples" / "bending.toml")

#: Commands by name; FOLDER is replaced.
COMMANDS = {
    "truespring --help": ["--help"],
    "truespring verify examples/bending.toml": ["verify", _STUDY, "--quiet", "--out", "FOLDER"],
    "truespring sweep examples/bending.toml, three points": [
        "sweep",
        _STUDY,
        "--vary",
        "load.1.force.2=-10 mN,-20 mN,-43 mN",
        "--quiet",
        "--out",
        "FOLDER",
    ],
}
#: The command that is also timed with an empty cache of compiled code.
COLD = "truespring verify examples/bending.toml"


def command_line(session: Session, repeats: int = REPEATS) -> dict[str, float]:
    """Return the median wall times of commands [s]."""
    found: dict[str, float] = {}
    for name, arguments in COMMANDS.items():
        _once(arguments, {})
        _record(found, name, [_once(arguments, {}) for _ in range(repeats)], session)
    cold = []
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as empty:
            cold.append(_once(COMMANDS[COLD], {"NUMBA_CACHE_DIR": empty}))
    _record(found, f"{COLD}, compiling", cold, session)
    return found


def _record(found: dict[str, float], name: str, times: list[tuple[float, float]], session: Session) -> None:
    """Add the median time of a command, and that of its solutions if it has some."""
    whole, solving = (statistics.median(values) for values in zip(*times, strict=True))
    found[name] = whole
    if solving:
        found[f"{name}, solving"] = solving
    session.log(f"{name}: {whole:.2f} s")


def _once(arguments: list[str], variables: dict[str, str]) -> tuple[float, float]:
    """Return the wall time of a command, run with more variables of the environment, and of its solutions [s]."""
    with tempfile.TemporaryDirectory() as folder:
        given = [str(Path(folder) / "out") if part == "FOLDER" else part for part in arguments]
        command = [sys.executable, "-m", "truespring", *given]
        started = time.perf_counter()
        subprocess.run(command, cwd=ROOT, env=environment() | variables, stdout=subprocess.DEVNULL, check=True)
        taken = time.perf_counter() - started
        summaries = [json.loads(file.read_text()) for file in Path(folder).rglob("summary.json")]
    return taken, sum(model["seconds"] for summary in summaries for model in summary["models"].values())
