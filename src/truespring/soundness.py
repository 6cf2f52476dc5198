"""Status and warnings of a solution: inverted, unstable and unbalanced states."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from truespring.dynamics import Dynamics
from truespring.mesh.selections import AXES
from truespring.problem import Problem
from truespring.solution import State, Status

# A larger relative residual is reported; it occurs only under loads that are near rounding errors.
_LOOSE = 1e-6
# A motion that gains more than this share of its energy is reported.
_GAINED = 0.02
#: A state with a larger relative residual is no equilibrium: the unbalanced force is not small against the load.
UNBALANCED = 1e-3


def path_status(
    problem: Problem, states: tuple[State, ...], best: State | None, finite: bool, keeps_to_stable: bool
) -> Status:
    """Return the status of a solution of a problem; `best` is the state of a level that was not reached, else None.

    `finite` and `keeps_to_stable` are those of model and solver, see Model.finite and Solver.keeps_to_stable_states.
    """
    if best is not None:
        return Status.NOT_CONVERGED
    if any(state.area_ratio <= 0 for state in states) and finite:
        return Status.INVERTED
    if keeps_to_stable and any(state.negative_eigenvalues for state in states):
        return Status.UNSTABLE
    fixed = problem.dynamics is not None and problem.dynamics.iterations
    return Status.FIXED_ITERATIONS if fixed else Status.CONVERGED


def path_warnings(
    problem: Problem,
    states: tuple[State, ...],
    best: State | None,
    finite: bool,
    keeps_to_stable: bool,
    below_rounding: bool,
    symmetric: bool = True,
) -> tuple[str, ...]:
    """Return warnings about a solution: why it ended, and which states are not valid.

    `below_rounding` is true if it ended because the load is below rounding errors, `symmetric` if all loads have
    potentials; other arguments as `path_status`.
    """
    warnings = []
    if best is not None:
        bad = [
            state.load_factor for state in states if state.negative_eigenvalues or (state.area_ratio <= 0 and finite)
        ]
        good = [state.load_factor for state in states if not bad or state.load_factor < bad[0]]
        last = f"{good[-1]:.6g}" if good else "none"
        why = _BELOW_ROUNDING if below_rounding else Status.NOT_CONVERGED.advice
        warnings.append(
            best.reason
            or f"{problem.where(best.load_factor)} was not reached (relative residual {best.residual:.1e}); "
            f"last good load factor: {last}; {why}"
        )
    inverted = [state for state in states if state.area_ratio <= 0]
    what = "area" if states and states[0].positions.shape[1] == 2 else "volume"
    if inverted:
        advice = "a linear model does not detect it" if not finite else Status.INVERTED.advice
        warnings.append(
            f"inverted from {problem.where(inverted[0].load_factor)} on "
            f"(smallest {what} ratio {min(state.area_ratio for state in inverted):.3g}): {advice}"
        )
    for state in states:
        if state.critical:
            warnings.append(_critical_warning(state))
    if not keeps_to_stable:
        warnings += _missed_points(states)
    unstable = [state for state in states if state.negative_eigenvalues]
    if unstable and keeps_to_stable:
        count = unstable[0].negative_eigenvalues
        warnings.append(
            f"unstable at load factor {unstable[0].load_factor:.6g} ({count} negative "
            f"eigenvalue{'s' if count != 1 else ''} of the tangent): {Status.UNSTABLE.advice}"
        )
    branched = [state for state in states if state.branched]
    if branched:
        warnings.append(
            f"stability was lost before load factor {branched[0].load_factor:.6g}: the solution follows a stable "
            "branch nearby (buckling); to which side is arbitrary"
        )
    snapped = [state for state in states if state.snapped]
    if snapped:
        warnings.append(
            f"just before load factor {snapped[0].load_factor:.6g} the body moved much further than the previous step "
            "suggests: it may have snapped through unstable states, which are not in the solution; use more load_steps"
        )
    if problem.dynamics is not None:
        reached = (*states, *([] if best is None else [best]))
        largest = max((state.residual for state in reached if state.load_factor > 0), default=0.0)
        return (*warnings, *_fixed_iterations(problem.dynamics, largest), *_gained_energy(states))
    loose = max((state.residual for state in states if state.load_factor > 0), default=0.0)
    if loose > _LOOSE:
        warnings.append(f"balanced only to a relative residual of {loose:.1e}: the load is near rounding errors")
    if not symmetric:
        warnings.append(_NO_POTENTIAL)
    elif any(state.negative_eigenvalues is None for state in states):
        warnings.append("stability not proven: the inertia of a tangent was not computed")
    return tuple(warnings)


_NO_POTENTIAL = (
    "the pressure on an open surface has no potential: its work depends on the path, so the energy of the loads is not "
    "defined, and stability not proven"
)


def _fixed_iterations(dynamics: Dynamics, residual: float) -> Iterator[str]:
    """Yield a warning if the number of iterations is fixed; `residual` is the largest of the steps [-]."""
    if dynamics.iterations:
        several = "s" * (dynamics.iterations != 1)
        yield (
            f"{dynamics.iterations} iteration{several} a step, not converged: the largest relative residual is "
            f"{residual:.1e}"
        )


def _gained_energy(states: tuple[State, ...]) -> Iterator[str]:
    """Yield a warning if a motion gained energy that nothing gave it, which is an error of the steps."""
    energies = [state.moving.energies for state in states if state.moving is not None]
    stored = max((one.kinetic + one.elastic + one.contact for one in energies), default=0.0)
    gained = max((-one.numerical for one in energies), default=0.0)
    if stored and gained > _GAINED * stored:
        share = 100 * gained / stored
        yield (
            f"the steps added up to {gained:.3g} J to the energy of the motion, {share:.2g} % of the largest kinetic, "
            "elastic and contact energy: use a shorter step, or the scheme bdf2"
        )


_BELOW_ROUNDING = (
    "the load is below rounding errors: it is too small for the stiffness and the coordinates of the body; apply a "
    "larger load, or place the body near the origin"
)


def _missed_points(states: tuple[State, ...]) -> Iterator[str]:
    """Yield a warning for each change of stability whose critical point is not among the states."""
    for last, there in pairwise(states):
        before, after = last.negative_eigenvalues, there.negative_eigenvalues
        if not (last.critical or there.critical or before is None or after is None) and before != after:
            yield (
                f"stability changes between load factors {last.load_factor:.6g} and {there.load_factor:.6g}, and the "
                "critical point was not found: use more load_steps, a finer mesh or elements that do not lock"
            )


def _critical_warning(state: State) -> str:
    """Return the warning about a critical point."""
    assert state.mode is not None  # every critical point has a mode
    node, axis = np.unravel_index(int(np.abs(state.mode).argmax()), state.mode.shape)
    place = f"node {node} moves most, along {AXES[axis]}"
    if state.critical == "limit point":
        return f"limit point at load factor {state.load_factor:.6g}: under this load the body snaps through; {place}"
    return (
        f"bifurcation at load factor {state.load_factor:.6g}: the body buckles to the side; {place}. "
        "The solution stays on the primary branch, which a real body would leave"
    )
