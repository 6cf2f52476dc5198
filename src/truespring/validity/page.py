"""The page of a map."""

from collections.abc import Iterator, Mapping
from typing import Any

from truespring.models import Fem
from truespring.report.drawing import Drawing
from truespring.report.quantity import percent, significant
from truespring.report.shell import picture, render
from truespring.validity.maps import Maps
from truespring.validity.reference import Reference
from truespring.validity.sentences import unconverged, verdict


def render_validity(validity: Maps, drawings: Mapping[str, Drawing], command: str | None) -> str:
    """Return the page as HTML; `command` repeats the run."""
    return render(
        "validity/page.html.j2",
        command,
        title=validity.title,
        law=Fem(validity.law).label,
        groups=list(_groups(validity, drawings)),
        several=len(validity.maps) > 1,
        converged=all(one.converged for one in validity.references),
        warnings=[*_warnings(validity), *validity.notes],
        references=[_reference_row(one) for one in validity.references],
        by_load=validity.x == "load",
        moved=any(one.driven for one in validity.references),
        given=any(not one.driven for one in validity.references),
        solves=validity.solves,
        full=validity.full,
        seconds=significant(validity.seconds, 2),
    )


def _groups(validity: Maps, drawings: Mapping[str, Drawing]) -> Iterator[dict[str, Any]]:
    """Yield verdicts and figures grouped by load type, or by rule if y is the load type."""
    by_rule = validity.y == "load-type"
    for name in dict.fromkeys(one.rule.name if by_rule else one.load.name for one in validity.maps):
        maps = [one for one in validity.maps if (one.rule.name if by_rule else one.load.name) == name]
        begins = f"validity_{name.replace('+', '_')}"
        kept = [
            picture(drawn, stem) for stem, drawn in drawings.items() if stem == begins or stem.startswith(f"{begins}_")
        ]
        yield {
            "title": maps[0].rule.words[0].upper() + maps[0].rule.words[1:] if by_rule else maps[0].load.did,
            "how": "" if by_rule else maps[0].load.how,
            "verdicts": [verdict(validity, one).partition(one.rule.words) for one in maps],
            "same": [
                f"{', '.join(one.rule.same)}: the same springs on this mesh as {one.rule.name}"
                for one in maps
                if one.rule.same
            ],
            "pictures": kept,
        }


def _warnings(validity: Maps) -> Iterator[str]:
    for one in validity.references:
        if not one.converged:
            yield f"{one.load.did}: {unconverged(one)}"
        if one.end:
            yield (
                f"{one.load.did}: {Fem(one.law).label} ends at {one.load.text(one.reached)}, before "
                f"{one.load.text(one.target)} ({one.end}); the rest is hatched"
            )


def _reference_row(one: Reference) -> dict[str, str]:
    return {
        "load": one.load.name + ("" if one.poisson is None else f", Poisson's ratio {one.poisson:.3g}"),
        "reached": one.load.text(one.reached),
        "depth": "–" if one.elements is None else str(one.elements),
        "nodes": " → ".join(f"{count:,}" for count in one.n_nodes),
        "error": percent(one.error) if one.error > 1e-9 else "exact",
        "order": "–" if one.order is None else f"{one.order:.1f}",
        "converged": "converged" if one.converged else "not converged",
    }
