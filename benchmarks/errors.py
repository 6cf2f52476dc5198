"""Time to the same error: how long a program takes until the tip of the bent body is as near to the truth as wanted.

The truth is St. Venant-Kirchhoff's law solved exactly: the finite elements of truespring, carried on from their
three finest meshes to infinitely fine ones. It is the law that CalculiX solves and that biquadratic springs have
for their limit.
"""

import math
from dataclasses import dataclass

from scipy.optimize import brentq

from benchmarks.runs import Measured

#: Relative errors of the tip.
TARGETS = (0.05, 0.02, 0.01)

TRUTH = "fem-svk"


def solved(runs: list[Measured], program: str, dim: int) -> list[Measured]:
    """Return the runs of a program on the bent body that gave a result, from coarse to fine."""
    found = (run for run in runs if (run.program, run.dim, run.load) == (program, dim, "bending") and run.seconds)
    return sorted(found, key=lambda run: run.depth)


def limit(runs: list[Measured]) -> float:
    """Return the tip at infinitely fine meshes: that of tip(h) = limit + c h^p through the three finest (Richardson).

    The finest itself where these do not approach a limit so; not a number without runs.
    """
    if len(runs) < 3:
        return runs[-1].tip if runs else math.nan
    (first, second, third) = (run.tip for run in runs[-3:])
    h, k, m = (1 / run.depth for run in runs[-3:])
    wanted = (first - second) / (second - third) if second != third else math.inf

    def mismatch(order: float) -> float:
        return (h**order - k**order) / (k**order - m**order) - wanted

    lowest, highest = 0.2, 8.0
    if not math.isfinite(wanted) or mismatch(lowest) * mismatch(highest) > 0:
        return third
    order = brentq(mismatch, lowest, highest)
    return third + (third - second) * m**order / (k**order - m**order)


@dataclass(frozen=True)
class Accuracy:
    """How near a program comes to the truth on the bent body.

    Attributes:
        floor: the error that remains at infinitely fine meshes; the sign tells too soft (+) from too stiff.
        seconds: to each of TARGETS; None where it is never reached.
        nodes: about how many it takes, as `seconds`.
        bounds: true where the coarsest mesh is good enough already: `seconds` is then more than needed.
    """

    floor: float
    seconds: tuple[float | None, ...]
    nodes: tuple[float | None, ...]
    bounds: tuple[bool, ...]


def accuracy(runs: list[Measured], truth: float) -> Accuracy:
    """Judge the runs of one program, from coarse to fine."""
    reached = [_reached(runs, truth, target) for target in TARGETS]
    return Accuracy(
        floor=limit(runs) / truth - 1,
        seconds=tuple(one[0] if one else None for one in reached),
        nodes=tuple(one[1] if one else None for one in reached),
        bounds=tuple(bool(one and one[2]) for one in reached),
    )


def _reached(runs: list[Measured], truth: float, target: float) -> tuple[float, float, bool] | None:
    """Seconds and nodes from which on all meshes are within the target, and whether that is the coarsest mesh.

    A mesh that meets the target by accident, while a finer one does not, does not count. Between two meshes
    both are taken to be powers of the error.
    """
    errors = [abs(run.tip / truth - 1) for run in runs]
    missed = [place for place, error in enumerate(errors) if error > target]
    place = missed[-1] + 1 if missed else 0
    if place == len(runs):
        return None
    if place == 0:
        return runs[0].median, runs[0].n_nodes, True
    before, after = runs[place - 1], runs[place]
    smallest = target / 100  # an error that is zero by accident has no logarithm
    share = math.log(errors[place - 1] / target) / math.log(errors[place - 1] / max(errors[place], smallest))
    return (
        before.median ** (1 - share) * after.median**share,
        before.n_nodes ** (1 - share) * after.n_nodes**share,
        False,
    )
