"""The time of a step of the C runtime beside that of a live session: python -m benchmarks.c_runtime STUDY... .

Both take steps of leapfrog in one thread, C by cc -O2 and by cc -O3 -march=native, the session by its compiled loop
where the springs have a constant stiffness, else step by step.
"""

import struct
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from truespring.exports import solve_springs, target_files
from truespring.live import Live
from truespring.models import Springs, springs_by_rule
from truespring.study import Study, read_study

_SECONDS = 1.0
_FLAGS = {
    "-O2": ("-O2",),
    "-O3 -march=native": ("-O3", "-march=native"),
    "-O2, float": ("-O2", "-DTRUESPRING_REAL=float"),
}


def _of_c(header: str, body: bytes, steps: int, flags: tuple[str, ...]) -> tuple[float, int]:
    """Return the time of a step [s] and the memory of the body [bytes]."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "truespring.h").write_text(header, encoding="utf-8")
        (Path(folder) / "body.bin").write_bytes(body)
        source = Path(__file__).with_suffix(".c")
        subprocess.run(
            ["cc", "-std=c99", *flags, f"-I{folder}", str(source), "-o", f"{folder}/speed", "-lm"], check=True
        )
        run = [f"{folder}/speed", f"{folder}/body.bin", str(steps)]
        seconds, size = subprocess.run(run, capture_output=True, text=True, check=True).stdout.split()
    return float(seconds), int(size)


def _of_ours(live: Live) -> float:
    """Return the processor's time of a step of a session [s]."""
    live.step()
    frames, begin = 0, time.process_time()
    while time.process_time() - begin < _SECONDS:
        live.step()
        frames += 1
    return (time.process_time() - begin) / frames / live.steps_a_frame


def _row(study: Study, name: str, model: Springs) -> str:
    """Return the row of a model."""
    exported = solve_springs(study.problem, model, study.solver)
    written = target_files(exported, ["c"])["c"]
    still = [replace(one, displacement=None) for one in study.problem.supports]  # a session needs histories of others
    live = Live(replace(study.problem, supports=still, dynamics=None), model, scheme="leapfrog")
    ours = _of_ours(live)
    header, body = str(written["truespring.h"]), bytes(written["body.bin"])  # type: ignore[arg-type]
    found = [_of_c(header, body, max(20, int(_SECONDS / ours)), flags) for flags in _FLAGS.values()]
    session = f"{1e3 * ours:.3g}{'' if live.scheme == 'leapfrog, compiled' else ', step by step'}"
    stable = f"{1e3 * struct.unpack_from('<d', body, 64)[0]:.3g}"
    times = [f"{1e3 * seconds:.3g}" for seconds, _ in found]
    cells = [f"{study.stem}, {name}", str(len(live.moment.positions)), stable, *times, session]
    return f"| {' | '.join([*cells, f'{found[0][1] / 1e6:.2g}'])} |"


def main(files: list[str]) -> None:
    """Print a row of a table for each springs model by rule of the studies."""
    flags = [f"cc {one} [ms]" for one in _FLAGS]
    cells = ["study, model", "nodes", "stable step [ms]", *flags, "truespring [ms]", "memory [MB]"]
    lines = [f"| {' | '.join(cells)} |", "|---" * len(cells) + "|"]
    sys.stdout.write("\n".join([*lines, ""]))
    for file in files:
        study = read_study(Path(file))
        for name, model in springs_by_rule(study.entries).items():
            sys.stdout.write(_row(study, name, model) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
