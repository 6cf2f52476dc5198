"""A solution, alone or with a reference, as a Result: what figures and animations draw."""

from pathlib import Path

from truespring.comparison import TOLERANCE, compare, most_moved
from truespring.errors import OutputError
from truespring.report.result import Result
from truespring.solution import Solution, State


def result_of(solution: Solution, over: Solution | None, probe: int | None = None) -> Result:
    """Return the result of a solution, and of a reference that it is compared with."""
    if not solution.states:
        raise OutputError(f"{solution.label} is a surface without load levels: nothing moves")
    name, paths, comparisons = solution.label, {solution.label: solution}, {}
    watched = most_moved(solution) if probe is None else probe
    if over is not None:
        other = over.label if over.label != name else f"{name} (reference)"
        paths[other] = over
        comparisons[other] = compare(solution, over, watched, TOLERANCE)
    return Result(
        title=name,
        file=Path("solution.toml"),
        problem=solution.problem,
        paths=paths,
        probe=watched,
        model=name,
        comparisons=comparisons,
        tolerance=TOLERANCE,
        source="",
    )


def states_of_both(solution: Solution, over: Solution | None) -> tuple[State, ...]:
    """Return the states of a solution at levels that the reference also has; all without a reference.

    Raises OutputError if there is no level above zero that both have.
    """
    if over is None:
        return solution.states
    both = tuple(state for state in solution.states if over.at(state.level) is not None)
    if not any(state.loaded for state in both):
        raise OutputError(
            f"{solution.label} and {over.label} have no level above zero in common: solve both with the same load_steps"
        )
    return both
