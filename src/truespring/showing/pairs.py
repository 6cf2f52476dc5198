"""A solution, alone or over a reference, and the levels that both have."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from truespring.comparison import TOLERANCE, Comparison, compare, most_moved
from truespring.errors import OutputError, shown
from truespring.report.result import Result
from truespring.solution import SAME_LEVEL, Solution, State

#: The name of a file in results that were not read from one.
_NO_FILE = Path("solution")


@dataclass(frozen=True, eq=False)
class Pair:
    """A solution, and a reference that is drawn with it; None without one."""

    solution: Solution
    over: Solution | None = None

    @cached_property
    def result(self) -> Result:
        """The two as a result, for figures of reports."""
        solution, over = self.solution, self.over
        name = solution.label
        paths, comparisons = {name: solution}, {}
        watched = most_moved(solution)
        if over is not None:
            other = over.label if over.label != name else f"{name}, reference"
            paths[other] = over
            comparisons[other] = compare(solution, over, watched, TOLERANCE)
        return Result(
            title=name,
            file=_NO_FILE,
            problem=solution.problem,
            solutions=paths,
            probe=watched,
            model=name,
            comparisons=comparisons,
            tolerance=TOLERANCE,
            source="",
        )

    @property
    def comparison(self) -> Comparison | None:
        """The errors against the reference; None without one."""
        return next(iter(self.result.comparisons.values()), None)


def states_of_both(pair: Pair) -> tuple[State, ...]:
    """Return the states of a solution at levels that the reference also has; all without a reference.

    Raises OutputError if there is no level above zero that both have.
    """
    solution, over = pair.solution, pair.over
    if over is None:
        return solution.states
    if not isinstance(over, Solution):
        raise OutputError(f"over = {shown(over)}: a Solution is expected; a quantity is given as color='stress'")
    if over.problem.mesh.dim != solution.problem.mesh.dim:
        raise OutputError(
            f"{solution.label} has {solution.problem.mesh.dim} dimensions, {over.label} {over.problem.mesh.dim}: they "
            "cannot be drawn in one picture; truespring.compare compares them"
        )
    both = tuple(state for state in solution.states if has_level(over, state.level))
    if not any(state.loaded for state in both):
        raise OutputError(
            f"{solution.label} and {over.label} have no load level above zero in common: solve both with the same "
            "load_steps"
        )
    return both


def has_level(solution: Solution, level: float | None) -> bool:
    """Return whether a solution is known at a level; a surface is at one level only."""
    if solution.states or level is None:
        return solution.at(level) is not None
    return abs(solution.load_factor - level) <= SAME_LEVEL
