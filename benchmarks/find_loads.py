"""Compute and print the loads of `cases.BODIES`: python -m benchmarks.find_loads."""

import sys

from scipy.optimize import brentq

import truespring as ts
from benchmarks.cases import BODIES, SIZES, YOUNG, bar
from benchmarks.programs.truespring import problem_of


def load(dim: int, kind: str) -> float:
    """Return the total force [N] that moves the loaded end of Gaussian springs as far as the body's `moved`."""
    newton, body = ts.Newton(load_steps=2, tolerance=1e-8), BODIES[dim, kind]

    def too_far(force: float) -> float:
        """Return the displacement of the end beyond that of the body [m]."""
        case = bar(dim, kind, SIZES[dim][0], force)
        path = ts.solve(problem_of(case), ts.Springs("gaussian"), newton)
        return case.tip(path.states[-1].displacement) - body.moved * body.length

    # Brackets over E times the cross section: a beam that bends by a force, a bar that a force extends.
    near = 0.16 / body.length**2 if body.axis else 0.3
    sign = -1 if body.axis else 1
    return brentq(too_far, sign * YOUNG * near / 2, sign * YOUNG * near * 2, rtol=1e-7)


if __name__ == "__main__":
    for dim, kind in BODIES:
        sys.stdout.write(f"({dim}, {kind!r}): {load(dim, kind):.5g}\n")
