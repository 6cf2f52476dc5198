"""Time to the same error of the displacement in bending.

The error of a solution is the rms distance of the nodes of the coarsest mesh (`Case.sampled`) from the limit of fine
meshes under the law of its program, over the rms displacement. The limit is extrapolated from the three finest meshes
of truespring's finite elements. Springs of other laws are held against the St. Venant-Kirchhoff law.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from benchmarks.runs import PROGRAMS, Measured

#: Relative errors.
TARGETS = (0.05, 0.02, 0.01)

# Programs whose limit is the truth of a law.
_TRUTH = {"neo-Hookean": "fem-nh", "St. Venant-Kirchhoff": "fem-svk", "springs": "fem-svk"}

# Largest ratio of errors over which a time is extrapolated beyond the finest mesh.
_FARTHEST = 4.0


def solved(runs: Iterable[Measured], program: str, dim: int, load: str) -> list[Measured]:
    """Return the successful runs of a program on a body, from coarse to fine."""
    found = (run for run in runs if (run.program, run.dim, run.load) == (program, dim, load) and run.seconds)
    return sorted(found, key=lambda run: run.depth)


def limit(runs: Sequence[Measured]) -> np.ndarray | None:
    """Return the limit of the samples [m] by u(h) = limit + c h^p on the three finest meshes (Richardson).

    Returns those of the finest mesh if no order p from 0.2 to 8 fits; None for less than three runs.
    """
    if len(runs) < 3:
        return None
    first, second, third = (np.array(run.samples) for run in runs[-3:])
    h, k, m = (1 / run.depth for run in runs[-3:])
    closer = np.linalg.norm(second - third)
    ratio = np.linalg.norm(first - second) / closer if closer else math.inf

    def mismatch(order: float) -> float:
        """Return the ratio of two differences for an order of convergence, minus that of the runs."""
        return (h**order - k**order) / (k**order - m**order) - ratio

    lowest, highest = 0.2, 8.0
    if not math.isfinite(ratio) or mismatch(lowest) * mismatch(highest) > 0:
        return third
    order = brentq(mismatch, lowest, highest)
    return third + (third - second) * m**order / (k**order - m**order)


def truth(runs: Sequence[Measured], program: str, dim: int, load: str) -> np.ndarray | None:
    """Return the limit of the law of a program [m], None if it was not measured."""
    return limit(solved(runs, _TRUTH[PROGRAMS[program].law], dim, load))


def error(run: Measured, exact: np.ndarray) -> float:
    """Return the relative error of a run [-]."""
    return float(np.linalg.norm(np.array(run.samples) - exact) / np.linalg.norm(exact))


@dataclass(frozen=True)
class Reached:
    """Cost of an error.

    Attributes:
        seconds: time [s].
        unknowns: number of unknowns, interpolated.
        bound: whether the coarsest mesh has a smaller error: both are upper bounds.
        extrapolated: whether the finest mesh has a larger error.
    """

    seconds: float
    unknowns: float
    bound: bool = False
    extrapolated: bool = False


def reached(runs: Sequence[Measured], exact: np.ndarray, target: float) -> Reached | None:
    """Return the cost beyond which all errors of a program are below the target; None if that is too far.

    `runs` are ordered from coarse to fine. Time and unknowns are powers of the error between two meshes, and beyond
    the finest mesh, if the last step towards it reduced the error.
    """
    found = [error(run, exact) for run in runs]
    missed = [place for place, value in enumerate(found) if value > target]
    place = missed[-1] + 1 if missed else 0
    if not runs or len(runs) < 2:
        return None
    if place == 0:
        return Reached(runs[0].median, runs[0].n_unknowns, bound=True)
    beyond = place == len(runs)
    place = min(place, len(runs) - 1)
    before, after = runs[place - 1], runs[place]
    coarser, finer = found[place - 1], max(found[place], target / 100)  # avoids the logarithm of zero
    if beyond and (finer >= coarser or finer > _FARTHEST * target):
        return None
    share = math.log(coarser / target) / math.log(coarser / finer)
    return Reached(
        before.median ** (1 - share) * after.median**share,
        before.n_unknowns ** (1 - share) * after.n_unknowns**share,
        extrapolated=beyond,
    )


def to_the_same_error(
    runs: Sequence[Measured], dim: int, load: str
) -> dict[str, tuple[Measured, float, list[Reached | None]]]:
    """Return the finest run of each program on a body of `cases.BODIES`, its error, and the cost of each of TARGETS."""
    found = {}
    for name, program in PROGRAMS.items():
        exact, own = truth(runs, name, dim, load), solved(runs, name, dim, load)
        if exact is None or (dim, load) not in program.ladder or len(own) < 2:
            continue
        found[name] = own[-1], error(own[-1], exact), [reached(own, exact, target) for target in TARGETS]
    return found
