"""What the programs share: each reads a case, solves it, and prints one line of JSON."""

import json
import statistics
import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.cases import Case, bar

#: The relative residual that is asked of every program, each in its own norm.
TOLERANCE = 1e-8

#: Equal load increments that are tried one after another until the program converges.
INCREMENTS = (1, 2, 4, 8, 16)

# A process repeats a solution until so many seconds or so many solutions.
_LONG, _REPEATS = 2.0, 5

#: What the attempt to solve in so many increments gives: displacement [m], iterations, seconds.
Attempt = tuple[NDArray[np.float64], int, float]


@dataclass(frozen=True)
class Run:
    """What one run of a program says of itself.

    Attributes:
        version: of the program.
        seconds: from the built mesh to equilibrium, wall time.
        tip: how far the loaded end moves along the load [m].
        samples: displacement of the nodes of `Case.sampled` [m].
        n_unknowns: displacements of its mesh that are not held.
        iterations: of Newton, or of what the program does instead.
        peak_bytes: the largest resident memory of the process.
        linear_iterations: of conjugate gradients, over all Newton iterations; None for a direct solver.
        lanczos_iterations: beside these, of what tells of stability.
        notes: what else should be known.
    """

    version: str
    seconds: float
    tip: float
    samples: list[list[float]]
    n_unknowns: int
    iterations: int
    peak_bytes: int
    linear_iterations: int | None = None
    lanczos_iterations: int | None = None
    notes: str = ""


def peak_bytes(process: int | str = "self") -> int:
    """Return the largest resident memory so far of this process or of another [bytes], 0 of one that is gone."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0
    # Not getrusage: it counts what the parent had when it started the process.
    return next((int(line.split()[1]) * 1024 for line in status.splitlines() if line.startswith("VmHWM")), 0)


def main(solve: Callable[[Case], Run], warm_up: Mapping[int, int] = MappingProxyType({2: 2, 3: 2})) -> None:
    """Run `solve` on the case named on the command line and print what it found.

    A solve that is not timed comes first, so that what is imported or compiled late is there: of the bent
    body of `warm_up` elements over its height, by dimension; none if empty. A short one is repeated, for the median.
    """
    case = Case.read(sys.argv[1])
    if warm_up:
        solve(bar(case.dim, "bending", warm_up[case.dim]))
    run = solve(case)
    seconds = [run.seconds]
    while sum(seconds) < _LONG and len(seconds) < _REPEATS:
        seconds.append(solve(case).seconds)
    sys.stdout.write(json.dumps(asdict(replace(run, seconds=statistics.median(seconds)))) + "\n")


def in_few_increments(case: Case, version: str, attempt: Callable[[int], Attempt | None]) -> Run:
    """Return what `attempt` finds in as few equal load increments as it takes, without its memory.

    It returns None where it does not converge: only the one that does is timed.
    """
    for increments in INCREMENTS:
        found = attempt(increments)
        if found is not None:
            displacement, iterations, seconds = found
            notes = f"{increments} load steps" if increments > 1 else ""
            return run_of(case, version, displacement, iterations, seconds, notes=notes)
    raise SystemExit(f"no equilibrium in {INCREMENTS[-1]} load steps")


def run_of(
    case: Case, version: str, displacement: NDArray[np.float64], iterations: int, seconds: float, **more: Any
) -> Run:
    """Return the run of a program that found a displacement [m], shape (n_nodes, dim)."""
    return Run(
        version=version,
        seconds=seconds,
        tip=case.tip(displacement),
        samples=case.sampled(displacement),
        n_unknowns=int((~case.held).sum()),
        iterations=iterations,
        peak_bytes=peak_bytes(),
        **more,
    )
