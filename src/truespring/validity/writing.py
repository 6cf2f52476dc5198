"""What a map leaves behind: validity.json, validity.csv, pictures and a page."""

import csv
import json
import math
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from truespring.models import Fem
from truespring.outputs import Output
from truespring.report.figures import Drawing
from truespring.report.quantity import percent, significant
from truespring.report.shell import picture, render, versions
from truespring.report.style import figure_style
from truespring.validity.curve import Curve
from truespring.validity.lines import polylines
from truespring.validity.maps import Map, Validity
from truespring.validity.picture import figures
from truespring.validity.reference import Reference
from truespring.validity.refine import LINES
from truespring.validity.sentences import unconverged, verdict

#: Version of the form of validity.json; told in it.
FORM = 1

#: Columns of validity.csv: a row for each load level of each path of springs. Sizes are shares, errors relative.
COLUMNS = (
    "load",
    "rule",
    "depth",
    "aspect",
    "poisson",
    "n_nodes",
    "size",
    "rms_error",
    "probe_error",
    "force_error",
    "stiffness",
    "end",
)


def write_validity(validity: Validity, out: Path, command: str | None = None) -> dict[str, Path]:
    """Write validity.json, validity.csv, figures/ and report.html into out/STEM; return where each is.

    `command` is what does it again, where it was a command line.
    """
    with Output(out / validity.stem, "validity.json") as output:
        _write(validity, output.staging, command)
        output.publish()
    return {name: output.folder / name for name in ("validity.json", "validity.csv", "figures", "report.html")}


def _write(validity: Validity, folder: Path, command: str | None) -> None:
    (folder / "figures").mkdir()
    text = json.dumps(validity_values(validity), indent=1, allow_nan=False)
    (folder / "validity.json").write_text(text + "\n", encoding="utf-8")
    with (folder / "validity.csv").open("w", newline="", encoding="utf-8") as stream:
        table = csv.DictWriter(stream, COLUMNS)
        table.writeheader()
        table.writerows(rows(validity))
    with figure_style():
        drawings = {
            name: Drawing(sheet.png(), sheet.svg(), sheet.title, sheet.width) for name, sheet in figures(validity)
        }
    for name, drawing in drawings.items():
        (folder / "figures" / f"{name}.png").write_bytes(drawing.png)
        (folder / "figures" / f"{name}.svg").write_bytes(drawing.svg)
    (folder / "report.html").write_text(_page(validity, drawings, command), encoding="utf-8")


def rows(validity: Validity) -> Iterator[dict[str, Any]]:
    """Yield a row for each load level of each path of springs, its keys COLUMNS; None where nothing is known."""
    for one in validity.maps:
        for spot, curve in sorted(one.curves.items(), key=lambda item: str(item[0])):
            numbers = np.column_stack(
                [curve.sizes, curve.rms_errors, curve.probe_errors, curve.force_errors, curve.stiffness]
            )
            for level in numbers.tolist():
                told = [value if math.isfinite(value) else None for value in level]
                yield {
                    "load": one.load.name,
                    "rule": one.rule.name,
                    "depth": spot.depth or validity.body.depth or None,
                    "aspect": validity.body.aspect if spot.aspect is None else spot.aspect,
                    "poisson": validity.body.poisson if spot.poisson is None else spot.poisson,
                    "n_nodes": curve.n_nodes,
                    **dict(zip(COLUMNS[6:11], told, strict=True)),
                    "end": curve.end,
                }


def validity_values(validity: Validity) -> dict[str, Any]:
    """Return all of a map as values that JSON can hold; docs/validity.md describes them."""
    found = {
        "form": FORM,
        "title": validity.title,
        "truespring": version("truespring"),
        "versions": dict(versions()),
        "law": validity.law,
        "x": validity.x,
        "y": validity.y,
        "line_errors": list(LINES),
        "tolerance": validity.tolerance,
        "maps": [_map_values(validity, one) for one in validity.maps],
        "references": [_reference_values(one) for one in validity.references],
        "solves": {
            "springs": validity.solves[0],
            "reference": validity.solves[1],
            "whole_grid": validity.full,
            "seconds": round(validity.seconds, 3),
        },
        "notes": list(validity.notes),
    }
    return dict(_plain(found))


def _map_values(validity: Validity, one: Map) -> dict[str, Any]:
    springs = one.rule.springs
    return {
        "load": one.load.name,
        "load_in_words": one.load.how,
        "size": one.load.size,
        "size_unit": one.load.unit,
        "size_scale": one.load.scale,
        "rule": one.rule.name,
        "same_springs": list(one.rule.same),
        "springs": {"rule": springs.rule, "volume": springs.volume, "sharing": springs.sharing},
        "verdict": verdict(validity, one),
        "refused": one.refused or None,
        "x": one.x,
        "y": one.y,
        "errors": one.errors,
        "lines": {f"{line:g}": parts for line, parts in polylines(one).items()} if one.curves else {},
        "points": [{**_spot(spot), **_curve_values(curve)} for spot, curve in one.curves.items()],
        "failures": [{**_spot(spot), "reason": reason} for spot, reason in one.failures.items()],
        "solved": len(one.curves),
        "whole_grid": one.full,
    }


def _spot(spot: Any) -> dict[str, Any]:
    return {name: getattr(spot, name) for name in ("depth", "aspect", "poisson")}


def _curve_values(curve: Curve) -> dict[str, Any]:
    return {
        "n_nodes": curve.n_nodes,
        "reached": curve.reached,
        "end": curve.end or None,
        "interpolation_error": curve.interpolation,
        "size": curve.sizes,
        "rms_error": curve.rms_errors,
        "probe_error": curve.probe_errors,
        "force_error": curve.force_errors,
        "stiffness": curve.stiffness,
    }


def _reference_values(one: Reference) -> dict[str, Any]:
    return {
        "load": one.load.name,
        "law": one.law,
        "poisson": one.poisson,
        "load_factor": one.factor,
        "asked": one.asked,
        "reached": one.reached,
        "end": one.end or None,
        "converged": one.converged,
        "reference_error": one.error,
        "tolerance": one.tolerance,
        "order": one.order,
        "changes": list(one.changes),
        "n_nodes": list(one.n_nodes),
        "elements_through_depth": one.elements,
        "watched": {"quantity": one.settling.quantity, "unit": one.settling.unit, "values": list(one.settling.values)},
    }


def _plain(value: Any) -> Any:
    """Arrays as lists, and None for what is no number."""
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float):
        return float(f"{value:.7g}") if math.isfinite(value) else None
    return value


# --- the page -----------------------------------------------------------------------------------------


def _page(validity: Validity, drawings: Mapping[str, Drawing], command: str | None) -> str:
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


def _groups(validity: Validity, drawings: Mapping[str, Drawing]) -> Iterator[dict[str, Any]]:
    """What is told together: of one load type its verdicts and pictures, or of one rule where loads lie along y."""
    by_rule = validity.y == "load-type"
    for name in dict.fromkeys(one.rule.name if by_rule else one.load.name for one in validity.maps):
        maps = [one for one in validity.maps if (one.rule.name if by_rule else one.load.name) == name]
        begins = f"validity_{name.replace('+', '_')}"
        kept = [drawn for stem, drawn in drawings.items() if stem == begins or stem.startswith(f"{begins}_")]
        yield {
            "title": maps[0].rule.words[0].upper() + maps[0].rule.words[1:] if by_rule else maps[0].load.did,
            "how": "" if by_rule else maps[0].load.how,
            "verdicts": [verdict(validity, one).partition(one.rule.words) for one in maps],
            "same": [
                f"{', '.join(one.rule.same)}: the same springs here as {one.rule.name}" for one in maps if one.rule.same
            ],
            "pictures": [picture(drawn) for drawn in kept],
        }


def _warnings(validity: Validity) -> Iterator[str]:
    for one in validity.references:
        if not one.converged:
            yield f"{one.load.did}: {unconverged(one)}"
        if one.end:
            yield (
                f"{one.load.did}: {Fem(one.law).label} ends at {one.load.told(one.reached)} of the "
                f"{one.load.told(one.asked)} asked for ({one.end}); what lies beyond is hatched"
            )


def _reference_row(one: Reference) -> dict[str, str]:
    return {
        "load": one.load.name + ("" if one.poisson is None else f", Poisson's ratio {one.poisson:.3g}"),
        "reached": one.load.told(one.reached),
        "depth": "–" if one.elements is None else str(one.elements),
        "nodes": " → ".join(f"{count:,}" for count in one.n_nodes),
        "error": percent(one.error) if one.error > 1e-9 else "exact",
        "order": "–" if one.order is None else f"{one.order:.1f}",
        "converged": "converged" if one.converged else "not converged",
    }
