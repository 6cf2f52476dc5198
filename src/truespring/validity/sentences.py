"""The verdict of a map in words: one sentence for each springs model and load type, from its numbers alone."""

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

# Ends of stretches that are nearer than this share of the range are one.
_SAME = 0.02
# Stiffness off by less is none to speak of.
_EXACT = 0.005


def verdict(validity: Maps, one: Map) -> str:
    """Return the verdict of a map."""
    if one.refused:
        return f"{one.load.did}, {one.rule.words} cannot be had: {one.refused}."
    said = [_by_load(validity, one), *_small(one)] if validity.x == "load" else [_by_mesh(validity, one)]
    return " ".join([*said, *_ends(one), *_left_out(one), *_unsure(one)])


def _by_load(validity: Maps, one: Map) -> str:
    """Up to which size on which rows."""
    law, line = Fem(validity.law).label, validity.tolerance
    rows = [spans(one.x, errors, line) for errors in one.errors]
    begin = f"{one.load.did}{_moving(one)}, {one.rule.words} are"
    if not any(rows):
        best = float(np.nanmin(one.errors))
        row, place = np.argwhere(one.errors == best)[0]
        at = f"at {one.load.told(float(one.x[place]))}" if place else "under a small load"
        at += _at_row(validity, one, int(row))
        return f"{begin} nowhere within {tolerance_percent(line)} of {law}: nearest {at}, {percent(best)} off."
    clauses = [f"within {tolerance_percent(line)} of {law} {_where(validity, one, rows, True)}"]
    for other in _others(one, line):
        found = [spans(one.x, errors, other) for errors in one.errors]
        clauses.append(f"within {tolerance_percent(other)} {_where(validity, one, found, False)}")
    return f"{begin} {'; '.join(clauses)}."


def _moving(one: Map) -> str:
    """Of the study's own load, what its size is."""
    return f", which moves the probe by up to {one.load.told(float(one.x[-1]))}" if one.load.own else ""


def _others(one: Map, line: float) -> list[float]:
    """The tightest line of all that is met anywhere, and the next wider than the first told."""
    met = [other for other in LINES if other < line and any(spans(one.x, errors, other) for errors in one.errors)]
    wider = [other for other in LINES if other > line]
    return [*met[:1], *wider[:1]]


def _where(validity: Maps, one: Map, rows: Sequence[list[tuple[float, float]]], first: bool) -> str:
    """Over which sizes on which rows: those with the whole range, else the best of all."""
    span = float(one.x[-1])
    whole = [bool(found) and found[0][0] <= _SAME * span and found[0][1] >= (1 - _SAME) * span for found in rows]
    if any(whole):
        up_to = f"up to {one.load.told(span)}" if first else "all the way"
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
    """Where stretches lie: "up to 6 % strain", "from 6.2 to 16 % strain"."""
    words = []
    for first, last in found:
        if first <= 0:
            words.append(f"up to {one.load.told(last)}")
        else:
            words.append(f"from {_number(one, first)} to {one.load.told(last)}")
    return " and ".join(words)


def _number(one: Map, size: float) -> str:
    """A size without its unit, with "°" where that is written close."""
    told = one.load.told(size)
    return told.partition(" ")[0]


def _every(validity: Maps, one: Map, first: bool) -> str:
    """Say that all rows are alike."""
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


def _rows(validity: Maps, one: Map, chosen: Sequence[bool], first: bool = True) -> str:
    """Rows in words, runs of neighbours as from and to."""
    runs: list[list[float]] = []
    for place, (value, there) in enumerate(zip(one.y, chosen, strict=True)):
        if there and place and chosen[place - 1]:
            runs[-1][1] = float(value)
        elif there:
            runs.append([float(value)] * 2)
    if validity.y == "depth":
        told = " or ".join(f"{begin:g}" if begin == end else f"{begin:g} to {end:g}" for begin, end in runs)
        if not first:
            return f"on those of {told}"
        return f"on meshes of {told} {_elements(runs[-1][1])} through the depth"
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
    """How stiff the springs are under a small load."""
    found = {spot: float(deviation.stiffness_on_grid[0]) for spot, deviation in one.deviations.items()}
    low, high = min(found.values()), max(found.values())
    if high - low < 2 * _EXACT:
        return [f"Under a small load they are {_stiff((low + high) / 2)}."]
    ends = sorted(found.items(), key=lambda item: item[1])
    told = [f"{_stiff(value)}{_spot(spot)}" for spot, value in (ends[0], ends[-1])]
    return [f"Under a small load they are from {told[0]} to {told[1]}."]


def _spot(spot: object) -> str:
    depth, aspect, poisson = (getattr(spot, name) for name in ("depth", "aspect", "poisson"))
    if depth is not None:
        return f" ({depth} {_elements(depth)})"
    if aspect is not None:
        return f" (aspect {aspect:.3g})"
    return "" if poisson is None else f" (Poisson's ratio {poisson:.3g})"


def _stiff(value: float) -> str:
    if abs(value) < _EXACT:
        return "as stiff as they should be"
    return f"{percent(abs(value))} too {'stiff' if value > 0 else 'soft'}"


def _ends(one: Map) -> list[str]:
    """Where the springs, or the reference, come to an end."""
    said = []
    for reference in one.references.values():
        if reference.end:
            law = Fem(reference.law).label
            said.append(
                f"{law} itself ends at {one.load.told(reference.reached)} ({reference.end}): beyond it there is "
                "nothing to compare with."
            )
            break
    ended = {spot: deviation for spot, deviation in one.deviations.items() if deviation.end}
    if ended:
        first: tuple[object, Deviation] = min(ended.items(), key=lambda item: item[1].reached)
        said.append(f"The springs give way at {one.load.told(first[1].reached)}{_spot(first[0])}: {first[1].end}.")
    return said


def _left_out(one: Map) -> list[str]:
    if not one.failures:
        return []
    spot, reason = next(iter(one.failures.items()))
    places = len(one.failures) + len(one.deviations)
    return [f"At {len(one.failures)} of {places} places{_spot(spot)} there are none: {reason}."]


def _unsure(one: Map) -> list[str]:
    """Say where the reference is not converged."""
    worst = max(one.references.values(), key=lambda reference: reference.error)
    return [] if worst.converged else [f"The reference is not converged: it may be {percent(worst.error)} off itself."]


def unconverged(reference: Reference) -> str:
    """Say that a reference is not converged, and what that means."""
    return (
        f"The reference is not converged: on its finest mesh of {reference.n_nodes[-1]:,} nodes it may still be "
        f"{percent(reference.error)} off, so that lines below about {percent(3 * reference.error)} mean little."
    )


def _by_mesh(validity: Maps, one: Map) -> str:
    """Where along x at the last size of the load, row by row if there are rows."""
    law, line = Fem(validity.law).label, validity.tolerance
    size = max(reference.reached for reference in one.references.values())
    begin = f"{one.load.did}, at {one.load.told(size)}, {one.rule.words} are"
    rows = [spans(one.x, errors, line) for errors in one.errors]
    if not any(rows):
        if not np.isfinite(one.errors).any():
            return f"{begin} without an equilibrium everywhere."
        best = float(np.nanmin(one.errors))
        row, place = np.argwhere(one.errors == best)[0]
        where = _run(validity.x, float(one.x[place]), float(one.x[place])) + _at_row(validity, one, int(row))
        return f"{begin} nowhere within {tolerance_percent(line)} of {law}; nearest, {percent(best)} off, {where}."
    if len(rows) == 1:
        where = " and ".join(_run(validity.x, *_on_grid(one.x, validity.x, span)) for span in rows[0])
        return f"{begin} within {tolerance_percent(line)} of {law} {where}."
    groups = _grouped(rows, float(one.x[-1] - one.x[0]))
    chosen, found = max(groups, key=lambda group: sum(end - begin + 1e-9 for begin, end in group[1]))
    where = " and ".join(_run(validity.x, *_on_grid(one.x, validity.x, span)) for span in found)
    on = _rows(validity, one, [row in chosen for row in range(len(rows))])
    less = ", less elsewhere" if len(groups) > 1 else ""
    return f"{begin} within {tolerance_percent(line)} of {law} {where} {on}{less}."


def _on_grid(x: Floats, axis: str, span: tuple[float, float]) -> tuple[float, float]:
    """Ends of a stretch; of whole numbers those within it."""
    if axis != "depth":
        return span
    inside = x[(x >= span[0] - 1e-9) & (x <= span[1] + 1e-9)]
    return float(inside[0]), float(inside[-1])


def _grouped(
    rows: Sequence[list[tuple[float, float]]], span: float
) -> list[tuple[set[int], list[tuple[float, float]]]]:
    """Neighbouring rows whose stretches are alike, each group with those of its first row."""
    groups: list[tuple[set[int], list[tuple[float, float]]]] = []
    for row, found in enumerate(rows):
        if groups and len(groups[-1][1]) == len(found) and (not found or _alike(groups[-1][1], found, 2 * span)):
            groups[-1][0].add(row)
        else:
            groups.append(({row}, found))
    return groups


def headline(validity: Maps, one: Map) -> str:
    """Return the verdict in short, for the head of a picture."""
    if one.refused:
        return one.refused
    first = (_by_load if validity.x == "load" else _by_mesh)(validity, one).removesuffix(".")
    first = first.partition(f"{one.rule.words} are ")[2].partition(";")[0]
    return f"{first[0].upper()}{first[1:]}."


def row_words(validity: Maps, one: Map, with_range: bool) -> str:
    """Return what a row of an axis of names is called, with the range of its load where loads differ."""
    if validity.y == "load-type":
        return f"{one.load.name}, to {one.load.told(float(one.x[-1]))}" if with_range else one.load.name
    return one.rule.name if validity.y == "rule" else ""
