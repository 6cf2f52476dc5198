"""Measure the table, row by row."""

import os
import platform
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from truespring.errors import TruespringError
from truespring.table1.bodies import POISSON, Size, end_displacement, reference
from truespring.table1.entries import ENTRIES, Entry
from truespring.table1.measures import RATIOS, accuracy, material, reach, speed, to_one_percent

#: Called with the name of the current measurement and the completed share.
Progress = Callable[[str, float], None]


def measure_table(
    dims: tuple[int, ...] = (2, 3), methods: tuple[str, ...] = (), progress: Progress | None = None
) -> dict[str, Any]:
    """Return the measured table in 2D and 3D, as values for JSON.

    `methods` are the measured ones, all by default. A measure that a model does not support is missing from the row;
    `refused` has the reason.
    """
    started = time.perf_counter()
    measured = [
        (dim, entry)
        for dim in dims
        for entry in ENTRIES
        if dim in entry.dims and (not methods or entry.method in methods)
    ]
    rows = []
    for number, (dim, entry) in enumerate(measured):
        if progress:
            progress(f"{dim}D {entry.method}, {entry.name}", number / len(measured))
        rows.append(_row(entry, dim))
    if progress:
        progress("done", 1.0)
    return {
        "truespring": version("truespring"),
        "measured": datetime.now(UTC).strftime("%Y-%m-%d"),
        "seconds": time.perf_counter() - started,
        "machine": {
            "processor": _processor(),
            "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
            "python": platform.python_version(),
            **{name: version(name) for name in ("numpy", "scipy", "numba")},
        },
        "references": [_reference(dim) for dim in dims],
        "rows": rows,
    }


def sizes(dim: int) -> dict[str, Size]:
    """Return the mesh sizes of a dimension by measure."""
    if dim == 2:
        return {"speed": Size(2, 16), "accuracy": Size(2, 4), "limit": Size(2, 32), "reach": Size(2, 16)}
    return {"speed": Size(3, 4), "accuracy": Size(3, 4), "limit": Size(3, 8), "reach": Size(3, 4)}


def _row(entry: Entry, dim: int) -> dict[str, Any]:
    mesh = sizes(dim)
    row: dict[str, Any] = {"dim": dim, "method": entry.method, "name": entry.name, "chief": entry.chief}
    row["label"] = entry.model(dim, POISSON[dim]).label
    refused = []
    for one in _measures(entry, dim, mesh):
        try:
            row |= one()
        except TruespringError as error:
            refused.append(str(error))
    return row | {"refused": refused}


def _measures(entry: Entry, dim: int, mesh: dict[str, Size]) -> Iterator[Callable[[], dict[str, Any]]]:
    yield lambda: speed(entry, mesh["speed"])
    yield lambda: material(entry, dim)
    yield lambda: accuracy(entry, mesh["accuracy"], mesh["limit"])
    if dim == 2:
        yield lambda: to_one_percent(entry)
    yield lambda: reach(entry, mesh["reach"])


def _reference(dim: int) -> dict[str, Any]:
    """Return mesh, label and end displacements [m] of the reference."""
    path = reference(dim, large=True)
    small = reference(dim, large=False)
    return {
        "dim": dim,
        "elements": len(path.problem.mesh.elements),
        "n_nodes": len(path.whole.points),
        "label": path.label,
        "small_end": end_displacement(small, small.states[-1]).tolist(),
        "largest_end": end_displacement(path, path.states[-1]).tolist(),
        "poisson": POISSON[dim],
        "ratios": list(RATIOS),
    }


def _processor() -> str:
    try:
        with Path("/proc/cpuinfo").open(encoding="utf-8") as stream:
            return next(line.split(":")[1].strip() for line in stream if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or "unknown"
