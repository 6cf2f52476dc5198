"""Sentences on the separate errors of a motion."""

from collections.abc import Iterator

from truespring.report.axis import axis_of
from truespring.report.parts import Part, by_scheme, largest_of, part_words, parts_of
from truespring.report.quantity import percent, tolerance_percent
from truespring.report.result import Result
from truespring.report.verdict.naming import listed

_SUBJECTS = {"model": "the model", "time step": "the time step", "solver": "the solver"}


def motion_sentences(result: Result) -> Iterator[str]:
    """Yield the largest error of a motion and what reduces it, then all three with what each is measured against.

    Also the energy that the scheme dissipated, if that is not below the tolerance.
    """
    parts = parts_of(result)
    if not parts:
        return
    most = largest_of(parts)
    if most is not None:
        yield _largest_sentence(result, most)
    shown = [f"{one.name} {part_words(one)} ({one.against})" for one in parts]
    yield f"errors{_measured(result)} {axis_of(result).at_full}: {', '.join(shown)}."
    taken = by_scheme(result.solutions[result.model or ""])
    if taken is not None and abs(taken) >= result.tolerance:
        did = "dissipated" if taken > 0 else "added"
        yield f"the scheme itself {did} {percent(abs(taken))} of the energy given to the body."
    for note in result.splits.notes if result.splits else ():
        yield f"not every error is known: {note}."


def integration_dominates(result: Result) -> bool:
    """Return whether the error of the time step or of the solver is not below the tolerance."""
    return any(one.name != "model" and (one.value or 0.0) >= result.tolerance for one in parts_of(result))


def _measured(result: Result) -> str:
    """Return of what the errors are, where forces are compared, too."""
    forced = any(one.force_error is not None for one in result.comparisons.values())
    return " in displacement" if forced else ""


def _largest_sentence(result: Result, most: Part) -> str:
    who, error = _SUBJECTS[most.name], percent(most.value or 0.0)
    largest = f"{who} is the largest error of the motion{_measured(result)}, {error}"
    if (most.value or 0.0) < result.tolerance:
        return f"{largest}, below {tolerance_percent(result.tolerance)}."
    above = [one for one in parts_of(result) if one.name != most.name and (one.value or 0.0) >= result.tolerance]
    others = listed([f"{_SUBJECTS[one.name]}, {part_words(one)}," for one in above]) if above else ""
    limit = tolerance_percent(result.tolerance)
    further = f"; {others} {'are' if len(above) > 1 else 'is'} above {limit}, too" if above else ""
    return f"{largest}: {most.remedy}{further}."
