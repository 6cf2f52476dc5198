"""Sentences on paths that did not reach full load through stable equilibria."""

from collections.abc import Callable, Iterator

from truespring.equilibrium import Solution, State, Status
from truespring.report.axis import Axis, axis_of
from truespring.report.result import Result
from truespring.report.verdict.naming import display_name, subject


def trouble_sentences(result: Result) -> Iterator[str]:
    """Yield what went wrong with the compared model, then with its references."""
    names = [result.model] if result.model is not None else []
    for name in names + [name for name in result.comparisons if name != result.model]:
        trouble = path_trouble(result, name)
        if trouble is not None:
            yield trouble


def path_trouble(result: Result, name: str) -> str | None:
    """Return what went wrong with a path; None if it reached full load through stable equilibria."""
    path = result.solutions[name]
    axis = axis_of(result)
    who, plural = subject(result) if name == result.model else (display_name(result, name), False)
    match path.status:
        case Status.NOT_CONVERGED if path.load_factor == 0:
            return f"{who} {axis.stops} at any {axis.level}."
        case Status.NOT_CONVERGED:
            return f"{who} {axis.stops} beyond {axis.exact(path.load_factor)}."
        case Status.INVERTED:
            start = _first(path, axis, lambda state: state.area_ratio <= 0)
            have = "have" if plural else "has"
            return f"{who} {have} an inverted element{start}; results beyond that are not reliable."
        case Status.UNSTABLE:
            start = _first(path, axis, lambda state: bool(state.negative_eigenvalues))
            are = "are" if plural else "is"
            return f"{who} {are} in an unstable equilibrium{start}; a real body would buckle out of it."
        case _:
            return None


def _first(path: Solution, axis: Axis, troubled: Callable[[State], bool]) -> str:
    """Return the first load level in trouble, as the end of a clause."""
    levels = [state.load_factor for state in path.states if troubled(state)]
    return f", first at {axis.exact(levels[0])}" if levels else ""
