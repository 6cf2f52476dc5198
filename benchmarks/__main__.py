"""Measure all programs and rebuild docs/performance.md: python -m benchmarks [--small], or make bench."""

import argparse
import json
import sys
from dataclasses import asdict

from benchmarks import machine, runs
from benchmarks.cases import LADDER, REFERENCE, SIZES
from benchmarks.page import build

# Meshes of --small, for development: each is measured once, and the page is written elsewhere.
_SMALL = {2: SIZES[2][:2], 3: SIZES[3][:2]}
_SMALL_LADDER = {2: LADDER[2][:6], 3: LADDER[3][:4]}


def measured(small: bool) -> dict:
    """Return all measurements of the page."""
    sizes, ladder = (_SMALL, _SMALL_LADDER) if small else (SIZES, LADDER)
    limits = runs.bandwidth()
    found = runs.measure_all(runs.jobs(sizes, ladder), 1 if small else runs.REPEATS)
    return {
        "date": machine.today(),
        "commit": machine.commit(),
        "machine": machine.hardware(),
        "versions": machine.versions(),
        "limit_seconds": runs.LIMIT,
        "bandwidth": limits,
        "kernels": [
            runs.kernels(dim, depth)
            for dim in sizes
            for depth in sorted({min(REFERENCE[dim], sizes[dim][-1]), sizes[dim][-1]})
        ],
        "command_line": runs.command_line(),
        "runs": [asdict(one) for one in found],
    }


def main() -> None:
    """Measure the programs and write results and page."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--small", action="store_true", help="small meshes, once each, written to out/bench")
    small = parser.parse_args().small
    results = measured(small)
    folder = runs.ROOT / "out" / "bench" if small else None
    file = (folder or runs.HERE) / "results.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(results, indent=1) + "\n")
    sys.stdout.write(build(file, folder or runs.ROOT / "docs") + "\n")


if __name__ == "__main__":
    main()
