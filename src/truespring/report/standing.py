"""The estimated errors of references in words."""

from collections.abc import Iterable

import numpy as np

from truespring.comparison import Comparison
from truespring.report.quantity import ROUNDING, percent, tolerance_percent
from truespring.report.result import Result


def own_errors(result: Result, name: str) -> tuple[str, str]:
    """Return the error of a reference, and that of the model against the refined reference, as text for a table."""
    known = result.standings.get(name)
    if known is None:
        return "not known", "-"
    refined = "-" if known.refined_error is None else percent(known.refined_error)
    return _percent(known.value), refined


def _percent(value: float | None) -> str:
    if value is None:
        return "not known"
    return "0 %" if value < ROUNDING else percent(value)


def own_error_sentence(result: Result, called: dict[str, str]) -> str | None:
    """Return the errors of the references on their mesh, and of the model against the refined references.

    None if no reference was refined. `called` has the display name of each reference.
    """
    known = {name: one for name, one in result.standings.items() if name in result.comparisons}
    values = {name: one.value for name, one in known.items() if one.value is not None}
    if not known:
        return None
    if not values:
        return f"how far {_who(result, list(known), 'is', 'are')} off is not known."
    low, high = min(values.values()), max(values.values())
    shown = _percent(high) if _percent(low) == _percent(high) else f"{_number(low)} to {_percent(high)}"
    unknown = [name for name in known if name not in values]
    rest = f"; of {_listed(called[name] for name in unknown)} it is not known" if unknown else ""
    refined = {name: one.refined_error for name, one in known.items() if one.refined_error is not None}
    against = [f"{called[name]} {percent(refined[name])}" for name in sorted(refined, key=lambda name: refined[name])]
    truth = f"; against refined references, {', '.join(against)}" if against else ""
    return f"{_who(result, list(values), 'is', 'are')} {shown} off{truth}{rest}."


def _who(result: Result, names: list[str], one: str, several: str) -> str:
    """Return the subject of a sentence: one reference by its label, several by their kind, with the verb."""
    labels = {result.solutions[name].label for name in names}
    paths = [result.solutions[name] for name in names]
    if all(path.has_springs for path in paths):
        return f"springs on this mesh {several} themselves"
    who = labels.pop() if len(labels) == 1 else "FEM" if all(path.element for path in paths) else "each reference"
    return f"{who} on this mesh {one} itself"


def _listed(parts: Iterable[str]) -> str:
    return ", ".join(parts)


def _number(value: float) -> str:
    return "0" if value < ROUNDING else percent(value).removesuffix(" %")


def equally_wrong_sentence(result: Result, who: str, plural: bool, called: dict[str, str]) -> str | None:
    """Return a warning if the model agrees with references whose own errors exceed the tolerance; else None.

    Without a warning are references whose refined solution the model agrees with, too.

    `who` is the name of the model, `plural` whether it is plural; `called` has the display name of each reference.
    """
    names = [
        name
        for name, one in result.comparisons.items()
        if _agrees(one)
        and (known := result.standings.get(name))
        and min(known.value or 0.0, np.inf if known.refined_error is None else known.refined_error) > result.tolerance
    ]
    if not names:
        return None
    worst = max(names, key=lambda name: result.standings[name].value or 0.0)
    known = result.standings[worst]
    assert known.value is not None  # it is above the tolerance
    if known.refined_error is None:
        both = f"{called[worst]} on this mesh is itself about {percent(known.value)} off"
    else:
        both = (
            f"on this mesh {called[worst]} is itself about {percent(known.value)} off, and {who} "
            f"{'are' if plural else 'is'} {percent(known.refined_error)} off the refined solution"
        )
    return f"this agreement is not evidence of accuracy: {both}, more than {tolerance_percent(result.tolerance)}."


def _agrees(one: Comparison) -> bool:
    """Return whether a model is within the tolerance of a reference at full load."""
    return one.error is not None and one.error < one.tolerance
