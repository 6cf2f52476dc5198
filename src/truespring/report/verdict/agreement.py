"""Sentences on agreement: with which references, up to which load level, and the errors at full load."""

from collections.abc import Iterator

import numpy as np

from truespring.comparison import Comparison
from truespring.report.axis import axis_of
from truespring.report.quantity import percent, quantity, tolerance_percent
from truespring.report.result import Result
from truespring.report.standing import equally_wrong_sentence, own_error_sentence
from truespring.report.verdict.naming import display_name, everyone, level_name, listed, subject
from truespring.report.verdict.reach import never, rank, reach, starts_within
from truespring.support_errors import decisive


def agreement_sentences(result: Result) -> Iterator[str]:
    """Yield where the model agrees with its references, its errors at full load, and those of the references."""
    measured = {name: one for name, one in result.comparisons.items() if one.load_factors.size}
    if measured:
        where, beyond = _where_it_agrees(result, measured)
        errors = _errors(result, measured)
        if beyond and errors:
            yield f"{where}; {'' if _over_the_way(measured) else 'beyond, '}{errors}."
        else:
            yield f"{where}."
            if errors:
                yield f"{errors}."
        who, plural = subject(result)
        names = {name: display_name(result, name) for name in result.comparisons}
        yield from filter(None, (equally_wrong_sentence(result, who, plural, names), own_error_sentence(result, names)))
    for name, one in result.comparisons.items():
        if name not in measured or float(one.load_factors[-1]) != 1.0:
            yield _short_of_full_load(result, name, one)


def _where_it_agrees(result: Result, measured: dict[str, Comparison]) -> tuple[str, bool]:
    """Return a clause on where the model agrees with which reference, and whether only up to some level below 1."""
    who, plural = subject(result)
    within = f"within {tolerance_percent(result.tolerance)} of"
    groups: dict[str, list[str]] = {}
    for name in sorted(measured, key=lambda name: rank(measured[name])):
        groups.setdefault(reach(result, measured[name]), []).append(name)
    starts = any(starts_within(one) for one in measured.values())
    verb = ("stay" if starts else "come") + ("" if plural else "s")
    if len(groups) > 1:
        clauses = [
            f"of {listed([_named(result, measured, name) for name in names])} {where}"
            for where, names in groups.items()
        ]
        return f"{who} {verb} within {tolerance_percent(result.tolerance)} {listed(clauses, ', and ')}", False
    ((where, names),) = groups.items()
    references = everyone(result, names) if len(names) > 1 else _named(result, measured, names[0])
    axis = axis_of(result)
    if where == never(axis):
        do = "do" if plural else "does"
        some = references if len(names) == 1 else "any reference"
        return f"{where} {do} {who} come {within} {some}", False
    if where.startswith(("up to", axis.up_to_full)):
        comma = "," if "," in where or where.startswith("over") else ""
        return f"{where}{comma} {who} {verb} {within} {references}", not where.startswith(axis.up_to_full)
    return f"{who} {verb} {within} {references} {where}", False


def _named(result: Result, measured: dict[str, Comparison], name: str) -> str:
    """Return a reference by its name, with the errors at full load if `_is_complete`."""
    shown, one = display_name(result, name), measured[name]
    return f"{shown} ({_off(one)} {axis_of(result).at_full})" if _is_complete(one) else shown


def _is_complete(one: Comparison) -> bool:
    """Return whether forces are compared too, and the model agrees at every level up to full load."""
    return one.agrees_up_to_load_factor == 1.0 and _is_forced(one)


def _is_forced(one: Comparison) -> bool:
    """Return whether a force or torque is compared at the last level, or over the way."""
    return bool(decisive(np.nan, one.last_supports).quantity)


def _errors(result: Result, measured: dict[str, Comparison]) -> str | None:
    """Return the errors at full load that are not known yet, smallest first; None without a reference that has some."""
    known = {name: one.error for name, one in measured.items() if one.error is not None and not _is_complete(one)}
    if not known:
        return None
    parts = [
        f"{display_name(result, name)} {_off(measured[name])}" for name in sorted(known, key=lambda name: known[name])
    ]
    # The errors of one reference may be separated by commas.
    between = "; " if any(map(_is_forced, measured.values())) else ", "
    return f"{_what(measured)}{axis_of(result).at_full}: {between.join(parts)}"


def _over_the_way(measured: dict[str, Comparison]) -> bool:
    return any(one.over_the_way for one in measured.values())


def _what(measured: dict[str, Comparison]) -> str:
    return "root mean square " if _over_the_way(measured) else ""


def _off(one: Comparison) -> str:
    """Return the errors at the last level or over the way, the larger first, with the quantity if forces are known."""
    displacement = one.last(one.rms_errors)
    found = [(displacement, "in displacement")] if np.isfinite(displacement) else []
    several = len(one.last_supports) > 1
    largest = decisive(np.nan, one.last_supports)
    if not largest.quantity:
        return percent(displacement)
    found.append((largest.error, f"in the {largest.quantity}{f' of {largest.support}' if several else ''}"))
    return ", ".join(f"{percent(error)} {what}" for error, what in sorted(found, reverse=True))


def _short_of_full_load(result: Result, name: str, one: Comparison) -> str:
    """Return how a comparison ends that does not reach full load, or has surfaces only."""
    who, axis = display_name(result, name), axis_of(result)
    if one.load_factors.size:
        level = float(one.load_factors[-1])
        if one.agrees_up_to_load_factor is None:
            return f"{who} is known at {axis.exact(level)} only, there {_off(one)}."
        return f"with {who} the comparison ends at {axis.exact(level)}, there {_off(one)}."
    if one.surface is None and one.hausdorff is not None:
        distances = quantity(one.hausdorff.rms, "m", 2), quantity(one.hausdorff.max, "m", 2)
        return "the distance between the surfaces is {} (root mean square), {} at most.".format(*distances)
    if one.surface is None:
        return f"{who} and {subject(result)[0]} have no {axis.level} in common."
    level = one.reference.surface.load_factor if one.reference.surface else 1.0
    return (
        f"the outline is {quantity(one.surface.outline_rms, 'm', 2)} (root mean square), at most "
        f"{quantity(one.surface.outline_max, 'm', 2)}, off that of {who} at {level_name(result, level)}."
    )
