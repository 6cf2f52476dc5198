"""How far a path may be trusted: its status, and warnings of states that are inverted, unstable or not balanced."""

import numpy as np

from truespring.mesh.selections import AXES
from truespring.solution import State, Status

# A relative residual above this is a warning; it can only come from loads that are lost in rounding.
_LOOSE = 1e-6
#: Above this a state is no equilibrium: what is unbalanced is no longer small beside the load.
UNBALANCED = 1e-3


def path_status(states: tuple[State, ...], best: State | None, finite: bool, keeps_to_stable: bool) -> Status:
    """Return the status of a path that ended at `states[-1]`, or did not reach `best`."""
    if best is not None:
        return Status.NOT_CONVERGED
    if any(state.area_ratio <= 0 for state in states) and finite:
        return Status.INVERTED
    if keeps_to_stable and any(state.negative_eigenvalues for state in states):
        return Status.UNSTABLE
    return Status.CONVERGED


def path_warnings(
    states: tuple[State, ...], best: State | None, finite: bool, keeps_to_stable: bool, drowned: bool
) -> tuple[str, ...]:
    """Return why a path ended and where it should not be trusted, in sentences."""
    warnings = []
    if best is not None:
        bad = [
            state.load_factor for state in states if state.negative_eigenvalues or (state.area_ratio <= 0 and finite)
        ]
        good = [state.load_factor for state in states if not bad or state.load_factor < bad[0]]
        last = f"{good[-1]:.6g}" if good else "none"
        why = _DROWNED if drowned else Status.NOT_CONVERGED.advice
        warnings.append(
            best.reason
            or f"load factor {best.load_factor:.6g} was not reached (relative residual {best.residual:.1e}); "
            f"last good load factor: {last}; {why}"
        )
    inverted = [state for state in states if state.area_ratio <= 0]
    what = "area" if states and states[0].positions.shape[1] == 2 else "volume"
    if inverted:
        advice = "a linear model does not notice" if not finite else Status.INVERTED.advice
        warnings.append(
            f"inverted from load factor {inverted[0].load_factor:.6g} on "
            f"(smallest {what} ratio {min(state.area_ratio for state in inverted):.3g}): {advice}"
        )
    for state in states:
        if state.critical:
            warnings.append(_critical_warning(state))
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
            f"stability was lost before load factor {branched[0].load_factor:.6g}: the path goes on along a stable "
            "branch nearby (buckling); the side it took is arbitrary"
        )
    snapped = [state for state in states if state.snapped]
    if snapped:
        warnings.append(
            f"just before load factor {snapped[0].load_factor:.6g} the body moved much further than the step before "
            "lets expect: it may have snapped past unstable states, which are not on the path; more load_steps tell"
        )
    loose = max((state.residual for state in states if state.load_factor > 0), default=0.0)
    if loose > _LOOSE:
        warnings.append(f"balanced only to a relative residual of {loose:.1e}: the load drowns in rounding")
    if any(state.negative_eigenvalues is None for state in states):
        warnings.append("stability not proven: the inertia of a tangent could not be found")
    return tuple(warnings)


_DROWNED = (
    "the load is lost in rounding: it is too small for the stiffness and the coordinates of the body; apply a larger "
    "load, or place the body near the origin"
)


def _critical_warning(state: State) -> str:
    assert state.mode is not None  # a critical point has one
    node, axis = np.unravel_index(int(np.abs(state.mode).argmax()), state.mode.shape)
    place = f"node {node} moves most, along {AXES[axis]}"
    if state.critical == "limit point":
        return f"limit point at load factor {state.load_factor:.6g}: under this load the body snaps through; {place}"
    return (
        f"bifurcation at load factor {state.load_factor:.6g}: the body buckles to the side; {place}. "
        "The path goes on straight ahead, which a real body would leave"
    )
