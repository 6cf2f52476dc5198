"""Measure all programs and rebuild docs/performance.md: python -m benchmarks [--small] [--repeats N], or make bench."""

import argparse
import json
import sys
from dataclasses import asdict

from benchmarks import commands, machine, older, organ, runs
from benchmarks.cases import LADDER, OLDER, REFERENCE, SIZES
from benchmarks.page import build
from benchmarks.runs import CACHE, HERE, PROGRAMS, ROOT, SPRINGS, Job, Session

# Meshes of --small, for development: each is measured once, and the page is written elsewhere.
_SMALL = {2: SIZES[2][:2], 3: SIZES[3][:2]}
_SMALL_LADDER = {key: depths[:3] for key, depths in LADDER.items()}
_SMALL_OLDER = {2: 25, 3: 10}

# Programs whose loops are timed, by dimension and depth of the mesh; the first of a program and dimension explains it.
_LOOPS = (
    (SPRINGS, 3, REFERENCE[3]),
    (SPRINGS, 2, REFERENCE[2]),
    ("fem-nh", 3, REFERENCE[3]),
    ("fem-nh", 2, REFERENCE[2]),
    (SPRINGS, 3, OLDER[3]),
    (SPRINGS, 2, OLDER[2]),
    ("isotropic", 3, OLDER[3]),
    ("lloyd", 2, OLDER[2]),
)


def measured(small: bool, repeats: int) -> dict:
    """Return all measurements of the page; times are the median of so many processes, if one is short."""
    session = Session(CACHE / "small" if small else CACHE)
    sizes, ladder = (_SMALL, _SMALL_LADDER) if small else (SIZES, LADDER)
    bandwidth = runs.in_process("kernels")
    session.log("memory bandwidth: " + ", ".join(f"{name} {value / 1e9:.1f} GB/s" for name, value in bandwidth.items()))
    code = runs.digest("", [HERE / "commands.py", ROOT / "examples" / "bending.toml"])
    command_line = session.cached("commands", code, lambda: commands.command_line(session, repeats))
    before = older.compared(session, _SMALL_OLDER if small else OLDER, repeats)
    ratios = organ.POISSON[:1] if small else organ.POISSON
    bodies = [_on_the_organ(poisson, model, session) for poisson in ratios for model in organ.MODELS]
    loops = dict.fromkeys((name, dim, min(depth, sizes[dim][-1])) for name, dim, depth in _LOOPS)
    profiles = [_loops(*one, session) for one in loops]
    loads = ((3, "soft block"), (3, "bending"), (2, "bending"), (3, "stretching"), (2, "stretching"))
    found = runs.measure_all(runs.jobs(sizes, ladder, loads), session, repeats)
    return {
        "date": machine.today(),
        "commit": machine.commit(),
        "machine": machine.hardware(),
        "versions": machine.versions(),
        "limit_seconds": runs.LIMIT,
        "repeats": repeats,
        "bandwidth": bandwidth,
        "command_line": command_line,
        "older_commit": older.COMMIT,
        "older": before,
        "organ": bodies,
        "kernels": profiles,
        "runs": [asdict(one) for one in found],
    }


def _on_the_organ(poisson: float, model: str, session: Session) -> dict:
    """Return the times of a model on the organ, or why there are none."""
    code = runs.digest(model, [HERE / "organ.py", ROOT / "examples" / "organ.toml"])
    found = session.cached(f"organ-{model}-{poisson}", code, lambda: runs.in_process("organ", (str(poisson), model)))
    session.log(f"organ, {model}, Poisson's ratio {poisson:g}: {found.get('solve', found.get('failure'))}")
    return {"key": model, "poisson": poisson, **found}


def _loops(name: str, dim: int, depth: int, session: Session) -> dict:
    """Return the times of the loops of a program in bending, see `kernels.measured`; no rows after a failure."""
    job = Job(name, dim, "bending", depth)
    code = runs.digest(name, [HERE / file for file in ("kernels.py", "limits.py", "parts.py", "phases.py", "cases.py")])
    arguments = PROGRAMS[name].arguments
    found = session.cached(f"kernels-{name}-{dim}d-{depth}", code, lambda: runs.on_case("kernels", job, arguments))
    session.log(f"loops of {name}, {dim}D, {job.n_nodes:,} nodes: {found.get('failure', 'measured')}")
    return {
        "program": name,
        "dim": dim,
        "n_nodes": job.n_nodes,
        "rows": [],
        "phases": {},
        "shares": {},
        "parts": {},
        **found,
    }


def main() -> None:
    """Measure the programs and write results and page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--small", action="store_true", help="small meshes, once each, written to out/bench")
    parser.add_argument("--repeats", type=int, default=runs.REPEATS, help="processes for the time of a short solution")
    options = parser.parse_args()
    small: bool = options.small
    results = measured(small, 1 if small else options.repeats)
    folder = ROOT / "out" / "bench" if small else None
    file = (folder or HERE) / "results.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(results, indent=1) + "\n")
    sys.stdout.write(build(file, folder or ROOT / "docs") + "\n")


if __name__ == "__main__":
    main()
