"""Compute and print the loads of `cases.LOADS`: python -m benchmarks.find_loads."""

import sys

from scipy.optimize import brentq

import truespring as ts
from benchmarks.cases import LENGTH, LOADS, MOVED, SIZES, SPRINGS, YOUNG, bar
from benchmarks.programs.truespring import problem_of

# Brackets of the loads, over E times the cross section.
_BRACKETS = {"bending": (-0.005, -0.001), "stretching": (0.1, 0.5)}


def load(dim: int, kind: str) -> float:
    """Return the total force [N] that moves the loaded end of the springs by MOVED."""
    newton = ts.Newton(load_steps=1, tolerance=1e-8)

    def too_far(force: float) -> float:
        """Return the displacement of the end beyond MOVED [m]."""
        case = bar(dim, kind, SIZES[dim][0], force)
        path = ts.solve(problem_of(case), ts.Springs(SPRINGS[dim]), newton)
        return case.tip(path.states[-1].displacement) - MOVED[kind] * LENGTH

    return brentq(too_far, *(YOUNG * share for share in _BRACKETS[kind]), rtol=1e-7)


if __name__ == "__main__":
    for dim, kind in LOADS:
        sys.stdout.write(f"({dim}, {kind!r}): {load(dim, kind):.5g}\n")
