"""The verdict of a map in sentences made from its numbers."""

from collections.abc import Sequence

import numpy as np

from truespring.arrays import Floats
from truespring.models import Fem
from truespring.report.quantity import percent, tolerance_percent
from truespring.validity.deviation import Deviation
from truespring.validity.lines import spans
from truespring.validity.maps import Map, Maps
from truespring.validity.reference import Reference
from truespring.validity.refine import LINES

# Ends of intervals closer than this share of the range are equal.
_SAME = 0.02
# Errors of the stiffness below this share are not reported.
_EXACT = 0.005


def verdict(validity: Maps, one: Map) -> str:
    """Return the verdict of a map."""
    if one.unavailable:
        return f"{one.load.did}, {one.rule.words} are not available: {one.unavailable}."
    first = [_by_load(validity, one), *_small(one)] if validity.x == "load" else [_by_mesh(validity, one)]
    return " ".join([*first, *_ends(one), *_left_out(one), *_unsure(one)])


def _by_load(validity: Maps, one: Map) -> str:
    """Return up to which size springs agree with the reference, by rows."""
    law, line = Fem(validity.law).label, validity.tolerance
    rows = [spans(one.x, errors, line) for errors in one.errors]
    begin = f"{one.load.did}{_moving(one)}, {one.rule.words} are"
    if not any(rows):
        best = float(np.nanmin(one.errors))
        row, place = np.argwhere(one.errors == best)[0]
        at = f"at {one.load.text(float(one.x[place]))}" if place else "under a small load"
        at += _at_row(validity, one, int(row))
        return (
            f"{begin} nowhere within {tolerance_percent(line)} of {law}: the smallest error is {percent(best)}, {at}."
        )
    clauses = [f"within {tolerance_percent(line)} of {law} {_where(validity, one, rows, True)}"]
    for other in _others(one, line):
        found = [spans(one.x, errors, other) for errors in one.errors]
        clauses.append(f"within {tolerance_percent(other)} {_where(validity, one, found, False)}")
    return f"{begin} {'; '.join(clauses)}."


def _moving(one: Map) -> str:
    """Return the size of the study's load as a clause; empty for standard loads."""
    return f", with a displacement of the probe of up to {one.load.text(float(one.x[-1]))}" if one.load.own else ""


def _others(one: Map, line: float) -> list[float]:
    """Return the tightest line that springs are within anywhere, and the next one wider than `line`."""
    reached = [other for other in LINES if other < line and any(spans(one.x, errors, other) for errors in one.errors)]
    wider = [other for other in LINES if other > line]
    return [*reached[:1], *wider[:1]]


def _where(validity: Maps, one: Map, rows: Sequence[list[tuple[float, float]]], first: bool) -> str:
    """Return over which sizes springs are within a line, on rows with the whole range, else on the best ones."""
    span = float(one.x[-1])
    whole = [bool(found) and found[0][0] <= _SAME * span and found[0][1] >= (1 - _SAME) * span for found in rows]
    if any(whole):
        up_to = f"up to {one.load.text(span)}" if first else "over the whole range"
        return up_to + (_every(validity, one, first) if all(whole) else f" {_rows(validity, one, whole, first)}")
    if not any(rows):
        return "nowhere"
    if all(_alike(rows[0], found, span) for found in rows[1:]):
        return f"{_stretches(one, rows[0])}{_every(validity, one, first)}"
    best = max(range(len(rows)), key=lambda row: sum(end - begin for begin, end in rows[row]))
    near = [_alike(rows[best], found, span) for found in rows]
    less = "" if all(near) or not first else ", less on others" if validity.y == "depth" else ", less elsewhere"
    return f"{_stretches(one, rows[best])} {_rows(validity, one, near, first)}{less}"


def _alike(one: list[tuple[float, float]], other: list[tuple[float, float]], span: float) -> bool:
    return len(one) == len(other) and bool(np.allclose(one, other, rtol=0, atol=_SAME * span))


def _stretches(one: Map, found: Sequence[tuple[float, float]]) -> str:
    """Return intervals in words: "up to 6 % strain", "from 6.2 to 16 % strain"."""
    words = []
    for first, last in found:
        if first <= 0:
            words.append(f"up to {one.load.text(last)}")
        else:
            words.append(f"from {_number(one, first)} to {one.load.text(last)}")
    return " and ".join(words)


def _number(one: Map, size: float) -> str:
    """Return a size without its unit, except "°"."""
    return one.load.text(size).partition(" ")[0]


def _every(validity: Maps, one: Map, first: bool) -> str:
    """Return a clause for a statement that holds on all rows."""
    if len(one.y) < 2 or not first:
        return ""
    what = {
        "depth": f"on every mesh of {one.y[0]:g} to {one.y[-1]:g} elements through the depth",
        "aspect": f"with elements of any length, {one.y[0]:.3g} to {one.y[-1]:.3g} times their height",
        "poisson": f"at any Poisson's ratio from {one.y[0]:.3g} to {one.y[-1]:.3g}",
    }
    return f" {what[str(validity.y)]}"


def _at_row(validity: Maps, one: Map, row: int) -> str:
    if len(one.y) < 2 or np.nanmax(np.nanmin(one.errors, axis=1)) - np.nanmin(one.errors) < 1e-4:
        return ""
    return f" {_run(validity.y, one.y[row], one.y[row])}"


def _rows(validity: Maps, one: Map, kept: Sequence[bool], first: bool = True) -> str:
    """Return rows in words, with runs of neighbours as ranges."""
    runs: list[list[float]] = []
    for place, (value, there) in enumerate(zip(one.y, kept, strict=True)):
        if there and place and kept[place - 1]:
            runs[-1][1] = float(value)
        elif there:
            runs.append([float(value)] * 2)
    if validity.y == "depth":
        counts = " or ".join(f"{begin:g}" if begin == end else f"{begin:g} to {end:g}" for begin, end in runs)
        if not first:
            return f"on those of {counts}"
        return f"on meshes of {counts} {_elements(runs[-1][1])} through the depth"
    return " and ".join(_run(validity.y, begin, end) for begin, end in runs)


def _elements(count: float) -> str:
    return "element" if count == 1 else "elements"


def _run(axis: str | None, first: float, last: float) -> str:
    values = f"{first:.3g}" if first == last else f"{first:.3g} to {last:.3g}"
    match axis:
        case "depth":
            return f"on meshes of {values} {_elements(last)} through the depth"
        case "aspect":
            if values == "1":
                return "with elements as long as high"
            return f"with elements {values} times as long as high"
        case "poisson":
            return f"at {'a ' if first == last else ''}Poisson's ratio{'' if first == last else 's'} of {values}"
        case _:
            return ""


def _small(one: Map) -> list[str]:
    """Return the error of the stiffness under a small load."""
    found = {spot: float(deviation.stiffness_on_grid[0]) for spot, deviation in one.deviations.items()}
    low, high = min(found.values()), max(found.values())
    if high - low < 2 * _EXACT:
        return [f"Under a small load their stiffness is {_stiff((low + high) / 2)}."]
    ends = sorted(found.items(), key=lambda item: item[1])
    range_of = [f"{_stiff(value)}{_spot(spot)}" for spot, value in (ends[0], ends[-1])]
    return [f"Under a small load their stiffness is from {range_of[0]} to {range_of[1]}."]


def _spot(spot: object) -> str:
    depth, aspect, poisson = (getattr(spot, name) for name in ("depth", "aspect", "poisson"))
    if depth is not None:
        return f" ({depth} {_elements(depth)})"
    if aspect is not None:
        return f" (aspect {aspect:.3g})"
    return "" if poisson is None else f" (Poisson's ratio {poisson:.3g})"


def _stiff(value: float) -> str:
    if abs(value) < _EXACT:
        return "correct"
    return f"{percent(abs(value))} too {'high' if value > 0 else 'low'}"


def _ends(one: Map) -> list[str]:
    """Return where the reference and the springs end."""
    found = []
    for reference in one.references.values():
        if reference.end:
            law = Fem(reference.law).label
            found.append(f"{law} itself ends at {one.load.text(reference.reached)} ({reference.end}).")
            break
    ended = {spot: deviation for spot, deviation in one.deviations.items() if deviation.end}
    if ended:
        first: tuple[object, Deviation] = min(ended.items(), key=lambda item: item[1].reached)
        found.append(f"The springs end at {one.load.text(first[1].reached)}{_spot(first[0])}: {first[1].end}.")
    return found


def _left_out(one: Map) -> list[str]:
    if not one.failures:
        return []
    spot, reason = next(iter(one.failures.items()))
    places = len(one.failures) + len(one.deviations)
    return [f"{len(one.failures)} of {places} points{_spot(spot)} have no result: {reason}."]


def _unsure(one: Map) -> list[str]:
    """Return a warning if the reference is not converged."""
    worst = max(one.references.values(), key=lambda reference: reference.error)
    return [] if worst.converged else [f"The reference is not converged: its error is about {percent(worst.error)}."]


def unconverged(reference: Reference) -> str:
    """Return a warning on a reference that is not converged."""
    return (
        f"The reference is not converged: on its finest mesh of {reference.n_nodes[-1]:,} nodes its error is about "
        f"{percent(reference.error)}, so that lines below about {percent(3 * reference.error)} are not reliable."
    )


def _by_mesh(validity: Maps, one: Map) -> str:
    """Return where along x springs agree with the reference at the last size of the load, by rows."""
    law, line = Fem(validity.law).label, validity.tolerance
    size = max(reference.reached for reference in one.references.values())
    begin = f"{one.load.did}, at {one.load.text(size)}, {one.rule.words} are"
    rows = [spans(one.x, errors, line) for errors in one.errors]
    if not any(rows):
        if not np.isfinite(one.errors).any():
            return f"{begin} without equilibrium everywhere."
        best = float(np.nanmin(one.errors))
        row, place = np.argwhere(one.errors == best)[0]
        where = _run(validity.x, float(one.x[place]), float(one.x[place])) + _at_row(validity, one, int(row))
        least = f"the smallest error is {percent(best)}, {where}"
        return f"{begin} nowhere within {tolerance_percent(line)} of {law}; {least}."
    if len(rows) == 1:
        where = " and ".join(_run(validity.x, *_on_grid(one.x, validity.x, span)) for span in rows[0])
        return f"{begin} within {tolerance_percent(line)} of {law} {where}."
    groups = _grouped(rows, float(one.x[-1] - one.x[0]))
    kept, found = max(groups, key=lambda group: sum(end - begin + 1e-9 for begin, end in group[1]))
    where = " and ".join(_run(validity.x, *_on_grid(one.x, validity.x, span)) for span in found)
    on = _rows(validity, one, [row in kept for row in range(len(rows))])
    less = ", less elsewhere" if len(groups) > 1 else ""
    return f"{begin} within {tolerance_percent(line)} of {law} {where} {on}{less}."


def _on_grid(x: Floats, axis: str, span: tuple[float, float]) -> tuple[float, float]:
    """Return the ends of an interval, for depths the integers within it."""
    if axis != "depth":
        return span
    inside = x[(x >= span[0] - 1e-9) & (x <= span[1] + 1e-9)]
    return float(inside[0]), float(inside[-1])


def _grouped(
    rows: Sequence[list[tuple[float, float]]], span: float
) -> list[tuple[set[int], list[tuple[float, float]]]]:
    """Return groups of neighbouring rows with the same intervals, each with those of its first row."""
    groups: list[tuple[set[int], list[tuple[float, float]]]] = []
    for row, found in enumerate(rows):
        if groups and len(groups[-1][1]) == len(found) and (not found or _alike(groups[-1][1], found, 2 * span)):
            groups[-1][0].add(row)
        else:
            groups.append(({row}, found))
    return groups


def headline(validity: Maps, one: Map) -> str:
    """Return the verdict in short, as title of a figure."""
    if one.unavailable:
        return one.unavailable
    first = (_by_load if validity.x == "load" else _by_mesh)(validity, one).removesuffix(".")
    first = first.partition(f"{one.rule.words} are ")[2].partition(";")[0]
    return f"{first[0].upper()}{first[1:]}."


def row_words(validity: Maps, one: Map, with_range: bool) -> str:
    """Return the label of a row on an axis of names, with the range of its load if loads differ."""
    if validity.y == "load-type":
        return f"{one.load.name}, to {one.load.text(float(one.x[-1]))}" if with_range else one.load.name
    return one.rule.name if validity.y == "rule" else ""
