"""Sentences on a result without comparison."""

from collections.abc import Iterator

import numpy as np

from truespring.equilibrium import FINE, Solution, Status
from truespring.report.axis import axis_of
from truespring.report.quantity import quantity
from truespring.report.result import Result
from truespring.report.verdict.naming import full_level, level_name, listed, subject

_CRITICAL = ("limit point", "bifurcation")


def alone_sentences(result: Result) -> Iterator[str]:
    """Yield how far the model went, through which equilibria, and how far the probe moved."""
    if result.model is None:
        done = sum(path.status in FINE for path in result.solutions.values())
        yield f"{done} of {len(result.solutions)} models reached {full_level(result)}; nothing was compared."
        return
    path = result.solutions[result.model]
    who, plural = subject(result)
    if path.status in FINE and axis_of(result).moves:
        were = "were" if plural else "was"
        yield f"{who} {were} followed {axis_of(result).up_to_full}{_fixed(path)}; nothing was compared with them."
    elif path.status is Status.CONVERGED:
        verb = "reach" if plural else "reaches"
        yield f"{who} {verb} {full_level(result)} through {_way(path)}; nothing was compared with them."
    else:
        yield "Nothing was compared."
    if path.states:
        moved = float(np.linalg.norm(path.states[-1].displacement[result.probe]))
        at = full_level(result) if path.complete else level_name(result, path.load_factor)
        yield f"At {at} the displacement of the probe is {quantity(moved, 'm')}."


def _fixed(path: Solution) -> str:
    """Return how the steps of a motion ended unless they were solved, as the end of a clause."""
    return ", in steps that are not converged" if path.status is Status.FIXED_ITERATIONS else ""


def _way(path: Solution) -> str:
    """Return through which equilibria and critical points a path passed."""
    critical = [state for state in path.states if state.critical]
    if not critical:
        counts = [state.negative_eigenvalues for state in path.states]
        if any(counts):
            return "equilibria of which some are unstable"
        return "equilibria of unknown stability" if None in counts else "stable equilibria"
    kinds = {kind: [f"{one.load_factor:.4g}" for one in critical if one.critical == kind] for kind in _CRITICAL}
    points = [
        f"a {kind} at load factor {at[0]}" if len(at) == 1 else f"{kind}s at load factors {listed(at)}"
        for kind, at in kinds.items()
        if at
    ]
    return f"{listed(points)}, in part through unstable states"
