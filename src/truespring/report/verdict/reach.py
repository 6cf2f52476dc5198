"""The load levels at which a model is within the tolerance of a reference."""

from truespring.comparison import Comparison
from truespring.report.axis import Axis, axis_of
from truespring.report.result import Result
from truespring.report.verdict.naming import listed


def reach(result: Result, one: Comparison) -> str:
    """Return at which levels the model is within the tolerance of a reference, such as "up to load factor 0.4".

    `never` if at no level.
    """
    axis = axis_of(result)
    levels, runs = one.load_factors, runs_within(one)
    if not runs:
        return never(axis)
    if one.agrees_up_to_load_factor is None:
        return f"at {axis.words(levels[0])}, the only level it is known at"
    first, *more = runs
    if first[0] == levels[0]:
        last = ", the last level that both reached" if first[1] == levels[-1] != 1 else ""
        again = f" and again {listed([_span(axis, run, levels[-1]) for run in more])}" if more else ""
        return axis.up_to_full if first[1] == 1 else f"up to {axis.words(first[1])}{last}{again}"
    return f"only {listed([_span(axis, run, levels[-1]) for run in runs])}"


def never(axis: Axis) -> str:
    """Return what `reach` returns for a model that is never within the tolerance."""
    return f"at no {axis.level}"


def runs_within(one: Comparison) -> list[tuple[float, float]]:
    """Return the first and last load factor of each run of consecutive levels within the tolerance."""
    runs: list[tuple[float, float]] = []
    neighbour = False
    for level, error in zip(one.load_factors.tolist(), one.errors.tolist(), strict=True):
        if error < one.tolerance:
            runs[len(runs) - neighbour :] = [(runs[-1][0] if neighbour else level, level)]
        neighbour = error < one.tolerance
    return runs


def starts_within(one: Comparison) -> bool:
    """Return whether the model is within the tolerance at the first level."""
    runs = runs_within(one)
    return bool(runs) and runs[0][0] == one.load_factors[0]


def rank(one: Comparison) -> tuple[float, bool, float]:
    """Return a key to sort by: the longest agreement from the first level on, then any agreement, then the error."""
    runs = runs_within(one)
    from_zero = runs[0][1] if starts_within(one) else 0.0
    return -from_zero, not runs, float(one.errors[-1])


def _span(axis: Axis, run: tuple[float, float], last: float) -> str:
    start, end = run
    if start == end:
        return f"at {axis.words(start)}"
    return f"from {axis.exact(start)} on" if end == last else f"between {axis.both(start, end)}"
