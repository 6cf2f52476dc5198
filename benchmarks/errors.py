"""Time to the same error of the tip displacement in bending.

The exact value is the limit of St. Venant-Kirchhoff finite elements of truespring, extrapolated from the three finest
meshes. CalculiX solves this law, and biquadratic springs converge to it.
"""

import math
from dataclasses import dataclass

from scipy.optimize import brentq

from benchmarks.runs import Measured

#: Relative errors of the tip displacement.
TARGETS = (0.05, 0.02, 0.01)

TRUTH = "fem-svk"


def solved(runs: list[Measured], program: str, dim: int) -> list[Measured]:
    """Return the successful runs of a program in bending, from coarse to fine."""
    found = (run for run in runs if (run.program, run.dim, run.load) == (program, dim, "bending") and run.seconds)
    return sorted(found, key=lambda run: run.depth)


def limit(runs: list[Measured]) -> float:
    """Return the limit of the tip displacement [m] by tip(h) = limit + c h^p on the three finest meshes (Richardson).

    Returns that of the finest mesh if no order p from 0.2 to 8 fits, NaN without runs.
    """
    if len(runs) < 3:
        return runs[-1].tip if runs else math.nan
    (first, second, third) = (run.tip for run in runs[-3:])
    h, k, m = (1 / run.depth for run in runs[-3:])
    ratio = (first - second) / (second - third) if second != third else math.inf

    def mismatch(order: float) -> float:
        """Return the ratio of two differences for an order of convergence, minus that of the runs."""
        return (h**order - k**order) / (k**order - m**order) - ratio

    lowest, highest = 0.2, 8.0
    if not math.isfinite(ratio) or mismatch(lowest) * mismatch(highest) > 0:
        return third
    order = brentq(mismatch, lowest, highest)
    return third + (third - second) * m**order / (k**order - m**order)


@dataclass(frozen=True)
class Accuracy:
    """Accuracy of a program in bending.

    Attributes:
        floor: relative error in the limit of fine meshes [-], positive if too soft.
        seconds: time to reach each of TARGETS [s], None if not reached.
        nodes: number of nodes to reach each of TARGETS, interpolated, None if not reached.
        bounds: true if the coarsest mesh reaches the target: `seconds` and `nodes` are then upper bounds.
    """

    floor: float
    seconds: tuple[float | None, ...]
    nodes: tuple[float | None, ...]
    bounds: tuple[bool, ...]


def accuracy(runs: list[Measured], truth: float) -> Accuracy:
    """Return the accuracy of a program from its runs, ordered from coarse to fine; `truth` is the exact tip [m]."""
    reached = [_reached(runs, truth, target) for target in TARGETS]
    return Accuracy(
        floor=limit(runs) / truth - 1,
        seconds=tuple(one[0] if one else None for one in reached),
        nodes=tuple(one[1] if one else None for one in reached),
        bounds=tuple(bool(one and one[2]) for one in reached),
    )


def _reached(runs: list[Measured], truth: float, target: float) -> tuple[float, float, bool] | None:
    """Return time [s] and nodes beyond which all errors are below the target, and whether that is the coarsest mesh.

    None if the finest mesh exceeds the target. Between two meshes, time and nodes are interpolated as powers of the
    error.
    """
    errors = [abs(run.tip / truth - 1) for run in runs]
    missed = [place for place, error in enumerate(errors) if error > target]
    place = missed[-1] + 1 if missed else 0
    if place == len(runs):
        return None
    if place == 0:
        return runs[0].median, runs[0].n_nodes, True
    before, after = runs[place - 1], runs[place]
    smallest = target / 100  # avoids the logarithm of zero
    share = math.log(errors[place - 1] / target) / math.log(errors[place - 1] / max(errors[place], smallest))
    return (
        before.median ** (1 - share) * after.median**share,
        before.n_nodes ** (1 - share) * after.n_nodes**share,
        False,
    )
