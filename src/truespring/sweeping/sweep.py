"""A sweep: one study with many values, each point solved once."""

import logging
import math
import os
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from truespring.errors import TruespringError
from truespring.outputs import Lock
from truespring.report.summary import summary
from truespring.showing.progress import chosen, counting
from truespring.study import StudyText, read_text, run
from truespring.study.changes import changed
from truespring.sweeping.here import run_here
from truespring.sweeping.plan import Plan, Point, digests, make_plan
from truespring.sweeping.pool import Failure, Note, Pool, check_workers, require_dask
from truespring.sweeping.result import Sweep, write_sweep
from truespring.sweeping.store import CONVERGED, FAILED, Store
from truespring.sweeping.values import make_changes, read_points

#: Called with the number of finished points, of failed ones, and of all.
Progress = Callable[[int, int, int], None]


_LOGGER = logging.getLogger(__name__)

# A worker is killed after twice the time limit of all models of a point, plus this [s].
_GRACE = 30.0

# Largest number of elements of a generated mesh whose points may be solved in this process.
_MOST_ELEMENTS = 2000


def sweep(
    study: str | Path,
    vary: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    *,
    lhs: int | None = None,
    seed: int = 0,
    points: str | Path | Sequence[Mapping[str, Any]] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    retry_failed: bool = False,
    timeout: float | None = None,
    progress: bool | Progress | None = True,
) -> Sweep:
    """Solve a study with many values of its keys.

    The rows of the result and of its `table()` are the points, sorted by their values. Columns are the varied keys,
    `status` and `reason` of each point, and the numbers of its summary, such as `models.springs.load_factor` and
    `comparison.linear.rms_error`, in SI units.

    Args:
        study: a study file.
        vary: values by key: {"material.young": ["4 kPa", 8e3], "material.poisson": "0:0.45:10"}; all combinations are
            solved.
        out: folder for results, as of `truespring sweep --out`; points solved there before are not solved again.
        lhs: number of points of a Latin hypercube over the values, instead of all combinations; drawn with `seed`.
        points: instead of `vary`, the values of each point by key, or a CSV file with one row per point.
        workers: number of processes on this machine, by default the number of cores; points of small generated meshes
            are solved in this process while that is faster than starting them.
        scheduler: address of a Dask cluster to use instead.
        retry_failed: whether to solve failed points again.
        timeout: time limit of each model [s]; None is no limit.
        progress: whether to show a progress bar in a notebook or terminal; or a callback with the
            number of finished points, of failed ones, and of all.

    Example:
        >>> import truespring as ts
        >>> study = ts.read_study(ts.new("strip", "strip.toml"), **{"mesh.elements": [4, 1], "solver.load_steps": 2})
        >>> vary = {"mesh.elements": [[2, 1], [4, 1]], "compare.refine": [False]}
        >>> found = ts.sweep("strip.toml", vary, workers=1)
        >>> found.converged, len(found.rows)
        (True, 2)
    """
    plan = plan_sweep(study, vary, lhs, seed, points)
    with chosen(progress, lambda: counting("points")) as advance:
        if out is None:
            with tempfile.TemporaryDirectory(prefix="truespring-") as folder:
                return run_sweep(plan, Path(folder), workers, scheduler, timeout=timeout, progress=advance)
        done = run_sweep(
            plan, Path(out), workers, scheduler, retry_failed=retry_failed, timeout=timeout, progress=advance
        )
    write_sweep(done, Path(out))
    return done


def plan_sweep(
    study: str | Path,
    vary: Mapping[str, Any] | None,
    lhs: int | None = None,
    seed: int = 0,
    points: str | Path | Sequence[Mapping[str, Any]] | None = None,
) -> Plan:
    """Return the checked points of a sweep, see `sweep`; raise TruespringError if the study or a value is wrong."""
    require_dask()
    text = read_text(study)
    text.study()  # report errors of the study once, not for every point
    if points is None:
        return make_plan(text, make_changes(text, vary or {}, lhs, seed))
    if vary or lhs is not None:
        raise TruespringError("points are given, and values to vary or a Latin hypercube too: give one of them")
    return make_plan(text, read_points(points) if isinstance(points, str | Path) else list(points))


def run_sweep(
    plan: Plan,
    out: Path,
    workers: int | None = None,
    scheduler: str | None = None,
    *,
    threads: int = 1,
    retry_failed: bool = False,
    timeout: float | None = None,
    progress: Progress | None = None,
    note: Note | None = None,
) -> Sweep:
    """Solve every point of a plan that has no record in `out`, and write each record when it is solved.

    `progress` is called with counts of points, `note` with messages; other arguments are those of `sweep` and `Pool`.
    """
    with Lock(out / "points"):
        store = Store(out)
        found = {record["point"]: record for record in store.read()}
        records: dict[str, Mapping[str, Any]] = {
            name: record
            for name, record in found.items()
            if name in plan.points and not (retry_failed and record["status"] == FAILED)
        }
        notes = tuple(_notes(plan, found, records))
        if note:
            for text in notes:
                note(text)
        left = {name: (plan.text, point) for name, point in plan.points.items() if name not in records}
        n_before = len(records)
        if left:
            check_workers(workers, scheduler)
            tally = _Tally(plan, store, records, progress)
            tally.count()
            if scheduler is None and timeout is None:  # only ending a worker stops a library that does not return
                small = {name: job for name, job in left.items() if _is_small(job)}
                tally.record(run_here(small, solve_point, workers or os.cpu_count() or 1, threads))
            left = {name: job for name, job in left.items() if name not in records}
        if left:
            models = len(plan.text.document.get("models", ()))
            hard = None if timeout is None else 2 * models * timeout + _GRACE
            with Pool(workers, scheduler, threads=threads, timeout=hard, note=note) as pool:
                tally.record(pool.run(left, partial(solve_point, timeout=timeout)))
        return Sweep(plan, {name: records[name] for name in plan.points}, n_before, notes)


class _Tally:
    """Writes records and counts them."""

    def __init__(
        self, plan: Plan, store: Store, records: dict[str, Mapping[str, Any]], progress: Progress | None
    ) -> None:
        self.plan, self.store, self.records, self.progress = plan, store, records, progress
        self.n_failed = sum(record["status"] == FAILED for record in records.values())

    def record(self, outcomes: Iterable[tuple[str, dict[str, Any] | Failure]]) -> None:
        for name, outcome in outcomes:
            record = {**self._head(self.plan.points[name]), **_outcome(outcome)}
            self.store.write(record)
            self.records[name] = record
            self.n_failed += record["status"] == FAILED
            self.count()

    def count(self) -> None:
        _LOGGER.info("%d of %d points, %d failed", len(self.records), len(self.plan.points), self.n_failed)
        if self.progress:
            self.progress(len(self.records), self.n_failed, len(self.plan.points))

    def _head(self, point: Point) -> dict[str, Any]:
        return {
            "point": point.name,
            "study": self.plan.frame,
            "truespring": version("truespring"),
            "given": dict(point.changes),
            "values": dict(point.values),
        }


def solve_point(job: tuple[StudyText, Point], timeout: float | None = None) -> dict[str, Any]:
    """Solve one point and return its summary, with the stored energy of each model [J]; runs on a worker.

    `timeout` is the time limit of each model [s].
    """
    text, point = job
    _require_same_files(text, point)
    result = run(text.study(point.changes), timeout=timeout, refining=False)
    found = summary(result)
    for name, path in result.solutions.items():
        energy = path.states[-1].energy if path.states else math.nan
        found["models"][name]["energy"] = energy if math.isfinite(energy) else None
    return found


def _is_small(job: tuple[StudyText, Point]) -> bool:
    """Return whether a point is likely to take less time than starting workers: its mesh is generated and small."""
    text, point = job
    elements = getattr(text.keys(point.changes).mesh, "elements", None)
    return elements is not None and math.prod(elements) <= _MOST_ELEMENTS


def _require_same_files(text: StudyText, point: Point) -> None:
    """Raise TruespringError if a file of the study has changed since the point was planned."""
    now = digests(text.file.parent, changed(text.document, point.changes), {})
    for name in {**now, **point.files}:
        if now.get(name) != point.files.get(name):
            raise TruespringError(f"{text.file.parent / name}: the file has changed since the sweep began")


def _outcome(outcome: dict[str, Any] | Failure) -> dict[str, Any]:
    if isinstance(outcome, Failure):
        return {"status": FAILED, "reason": outcome.reason, "summary": None}
    if outcome["truespring"] != version("truespring"):
        versions = f"the worker has truespring {outcome['truespring']}, this is {version('truespring')}"
        return {"status": FAILED, "reason": f"{versions}: install the same version", "summary": None}
    stopped = [
        f"{name} is {model['status']} at load factor {model['load_factor']:.6g}"
        for name, model in outcome["models"].items()
        if model["status"] != CONVERGED
    ]
    return {"status": FAILED if stopped else CONVERGED, "reason": "; ".join(stopped) or None, "summary": outcome}


def _notes(plan: Plan, found: Mapping[str, Mapping[str, Any]], records: Mapping[str, Any]) -> list[str]:
    """Return messages on duplicate points and existing records."""
    notes = []
    if plan.n_twice:
        notes.append(f"{plan.n_twice} duplicate points are solved once")
    others = [record for name, record in found.items() if name not in plan.points]
    former = [record for record in others if _is_of(record, plan) and record["study"] != plan.frame]
    if former:
        notes.append(
            f"the study, one of its files, or truespring has changed since {len(former)} results in points/ were "
            "written: they are kept, but not used"
        )
    if len(others) > len(former):
        count = f"{len(others) - len(former)} results of other values"
        notes.append(f"{count} in points/ are kept, but are not in the table")
    if records:
        notes.append(f"{len(records)} of {len(plan.points)} points were solved before")
    return notes


def _is_of(record: Mapping[str, Any], plan: Plan) -> bool:
    """Return whether a record has the varied keys of a plan."""
    return set(record["values"]) == set(plan.keys)
