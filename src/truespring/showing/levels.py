"""Choose the state of a solution that is shown."""

import operator
from collections.abc import Sequence

from truespring.errors import OutputError, shown
from truespring.solution import Solution, State


def state_of(solution: Solution, level: int) -> State:
    """Return a state by its number, counted from the end if negative.

    Raises OutputError if the solution has no such state.
    """
    return numbered(solution.states, level, solution)


def numbered(states: Sequence[State], level: int, solution: Solution) -> State:
    """Return one of some states of a solution by its number, counted from the end if negative."""
    n_states = len(states)
    if not n_states:
        raise OutputError(f"{solution.label} is a surface without load levels: write it as .stl or .vtu")
    try:
        number = operator.index(level)
    except TypeError:
        raise OutputError(
            f"level = {shown(level)}: the number of a state is expected, 0 to {n_states - 1}, or -1 for the last one; "
            "solution.table() lists the load factors"
        ) from None
    if not -n_states <= number < n_states:
        raise OutputError(
            f"level = {number}: {solution.label} has {n_states} states, 0 to {n_states - 1}, or -1 for the last one"
        )
    return states[number]
