"""The files of a map: validity.json, validity.csv, figures and a page."""

import csv
import json
import math
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from truespring.outputs import Output
from truespring.report.drawing import drawings, save_drawings
from truespring.report.shell import versions
from truespring.validity.deviation import Deviation
from truespring.validity.figures import figures as validity_figures
from truespring.validity.lines import polylines
from truespring.validity.maps import Map, Maps
from truespring.validity.page import render_validity
from truespring.validity.reference import Reference
from truespring.validity.refine import LINES
from truespring.validity.sentences import verdict

#: Version of the format of validity.json, its key `form`.
FORM = 1

#: Columns of validity.csv, with one row per load level of each path of springs. Sizes are shares, errors relative.
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

# Attributes of a Deviation in the columns from "size" on.
_OF_LEVELS = ("sizes", "rms_errors", "probe_errors", "force_errors", "stiffness")


def write_validity(validity: Maps, out: Path, command: str | None = None) -> dict[str, Path]:
    """Write validity.json, validity.csv, figures and report.html into out/STEM; return the paths by file name.

    `command` is the command line that repeats the run, for the report.
    """
    with Output(out / validity.stem, "validity.json") as output:
        _write(validity, output.staging, command)
        output.publish()
    return {name: output.folder / name for name in ("validity.json", "validity.csv", "figures", "report.html")}


def _write(validity: Maps, folder: Path, command: str | None) -> None:
    text = json.dumps(validity_values(validity), indent=1, allow_nan=False)
    (folder / "validity.json").write_text(text + "\n", encoding="utf-8")
    with (folder / "validity.csv").open("w", newline="", encoding="utf-8") as stream:
        table = csv.DictWriter(stream, COLUMNS)
        table.writeheader()
        table.writerows(rows(validity))
    figures = drawings(validity_figures(validity))
    save_drawings(figures, folder / "figures")
    (folder / "report.html").write_text(render_validity(validity, figures, command), encoding="utf-8")


def rows(validity: Maps) -> Iterator[dict[str, Any]]:
    """Yield one row per load level of each path of springs, with keys COLUMNS; unknown values are None."""
    for one in validity.maps:
        for spot, deviation in sorted(one.deviations.items(), key=lambda item: str(item[0])):
            numbers = np.column_stack([getattr(deviation, name) for name in _OF_LEVELS])
            for level in numbers.tolist():
                finite = [value if math.isfinite(value) else None for value in level]
                yield {
                    "load": one.load.name,
                    "rule": one.rule.name,
                    "depth": spot.depth or validity.body.depth or None,
                    "aspect": validity.body.aspect if spot.aspect is None else spot.aspect,
                    "poisson": validity.body.poisson if spot.poisson is None else spot.poisson,
                    "n_nodes": deviation.n_nodes,
                    **dict(zip(COLUMNS[6:11], finite, strict=True)),
                    "end": deviation.end,
                }


def validity_values(validity: Maps) -> dict[str, Any]:
    """Return a map as JSON values; docs/validity.md describes them."""
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


def _map_values(validity: Maps, one: Map) -> dict[str, Any]:
    springs = one.rule.springs
    return {
        "load": one.load.name,
        "load_in_words": one.load.how,
        "size": one.load.size,
        "size_unit": one.load.unit,
        "size_scale": one.load.scale,
        "rule": one.rule.name,
        "same_springs": list(one.rule.same),
        "springs": {
            "rule": springs.rule,
            "volume": springs.volume,
            "sharing": springs.sharing,
            **springs.parameters,
        },
        "verdict": verdict(validity, one),
        "refused": one.unavailable or None,
        "x": one.x,
        "y": one.y,
        "errors": one.errors,
        "lines": {f"{line:g}": parts for line, parts in polylines(one).items()} if one.deviations else {},
        "points": [{**_spot(spot), **_deviation_values(deviation)} for spot, deviation in one.deviations.items()],
        "failures": [{**_spot(spot), "reason": reason} for spot, reason in one.failures.items()],
        "solved": len(one.deviations),
        "whole_grid": one.full,
    }


def _spot(spot: Any) -> dict[str, Any]:
    return {name: getattr(spot, name) for name in ("depth", "aspect", "poisson")}


def _deviation_values(deviation: Deviation) -> dict[str, Any]:
    return {
        "n_nodes": deviation.n_nodes,
        "reached": deviation.reached,
        "end": deviation.end or None,
        "interpolation_error": deviation.interpolation,
        "size": deviation.sizes,
        "rms_error": deviation.rms_errors,
        "probe_error": deviation.probe_errors,
        "force_error": deviation.force_errors,
        "stiffness": deviation.stiffness,
    }


def _reference_values(one: Reference) -> dict[str, Any]:
    return {
        "load": one.load.name,
        "law": one.law,
        "poisson": one.poisson,
        "load_factor": one.factor,
        "asked": one.target,
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
    """Return a value with arrays as lists, numbers of 7 digits, and None for NaN and infinity."""
    if isinstance(value, Mapping):
        return {str(name): _plain(one) for name, one in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float):
        return float(f"{value:.7g}") if math.isfinite(value) else None
    return value
