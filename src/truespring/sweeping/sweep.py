"""A sweep: one study with many values, every point of it solved once."""

import math
import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from truespring.errors import TruespringError
from truespring.outputs import Lock, Output
from truespring.report.drawing import Figures, sheets
from truespring.report.rows import table_of
from truespring.report.summary import summary
from truespring.study import StudyText, read_text, run
from truespring.study.changes import changed
from truespring.sweeping.figures import sweep_figures
from truespring.sweeping.plan import Plan, Point, digests, make_plan
from truespring.sweeping.pool import Failure, Pool, Report, require_dask
from truespring.sweeping.store import CONVERGED, FAILED, Store
from truespring.sweeping.table import rows_of, write_table
from truespring.sweeping.values import choose, read_points

if TYPE_CHECKING:
    import polars

#: Called with the points done, those of them that failed, and all.
Progress = Callable[[int, int, int], None]


# A worker that is still at a point after twice the time of all models, and so much more [s], is killed.
_GRACE = 30.0


@dataclass(frozen=True, eq=False)
class Sweep:
    """What a sweep gave.

    Attributes:
        plan: the study and its points.
        records: of each point, by name, in the order of the plan.
        n_before: how many had been solved before.
        notes: what there is to say of records that were found.
    """

    plan: Plan
    records: Mapping[str, Mapping[str, Any]]
    n_before: int
    notes: tuple[str, ...]

    @cached_property
    def rows(self) -> list[dict[str, Any]]:
        """A row a point, sorted by the varied values."""
        return rows_of(self.plan.keys, self.records.values())

    @property
    def n_failed(self) -> int:
        """How many points have no result, or not all of it."""
        return sum(record["status"] == FAILED for record in self.records.values())

    @property
    def converged(self) -> bool:
        """Whether every model of every point reached full load through stable equilibria."""
        return not self.n_failed

    def table(self) -> "polars.DataFrame":
        """Return `rows` as a table of polars."""
        return table_of(self.rows)

    def figures(self) -> Figures:
        """Return the figures by the stem of their names; `png()` and `svg()` of each are the bytes of a file."""
        drawn = sweep_figures(self.plan.keys, self.rows)
        return sheets((f"sweep_{number}", sheet) for number, sheet in enumerate(drawn, 1))

    def write(self, out: str | Path, command: str | None = None) -> dict[str, Path]:
        """Write sweep.csv, sweep.parquet and report.html into out; return where each is.

        `command` is the command line that repeats the run, named in the report.
        """
        folder = write_sweep(self, Path(out), command).parent
        return {name: folder / name for name in ("sweep.csv", "sweep.parquet", "report.html")}

    def __getattr__(self, name: str) -> Any:
        """Pass what a table of polars has on to it: `ts.sweep` returned one before."""
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._as_table(f".{name}"), name)

    def __getitem__(self, key: Any) -> Any:
        return self._as_table(f"[{key!r}]")[key]

    def _as_table(self, asked: str) -> "polars.DataFrame":
        text = f"ts.sweep(...){asked} is deprecated, use ts.sweep(...).table(){asked}"
        warnings.warn(text, DeprecationWarning, stacklevel=3)
        return self.table()


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
) -> Sweep:
    """Solve a study with many values of its keys.

    The rows of the result, and its `table()`, are the points, sorted by their values; columns are the varied keys,
    `status` and `reason` of each point, and the figures of its summary, such as `models.springs.load_factor` and
    `comparison.linear.rms_error`; SI units.

    Args:
        study: a study file.
        vary: values by key: {"material.young": ["4 kPa", 8e3], "material.poisson": "0:0.45:10"}; all combinations.
        out: a folder, as `truespring sweep --out` writes it: solved points are kept there, and not solved again.
        lhs: so many points of a Latin hypercube over the values instead of all combinations, drawn with `seed`.
        points: instead of `vary` the values of each point by key, or a CSV file of them, a row a point.
        workers: processes on this machine, by default as many as cores.
        scheduler: address of a Dask cluster to take instead.
        retry_failed: try points again that have failed.
        timeout: after how long a model that is not solved is given up [s]; None is never.
    """
    plan = plan_sweep(study, vary, lhs, seed, points)
    if out is None:
        with tempfile.TemporaryDirectory(prefix="truespring-") as folder:
            return run_sweep(plan, Path(folder), workers, scheduler, timeout=timeout)
    done = run_sweep(plan, Path(out), workers, scheduler, retry_failed=retry_failed, timeout=timeout)
    write_sweep(done, Path(out))
    return done


def plan_sweep(
    study: str | Path,
    vary: Mapping[str, Any] | None,
    lhs: int | None = None,
    seed: int = 0,
    points: str | Path | Sequence[Mapping[str, Any]] | None = None,
) -> Plan:
    """Return the points, checked, nothing solved; raise TruespringError where the study or a value is wrong."""
    require_dask()
    text = read_text(study)
    text.study()  # what is wrong with the study itself is said once, not of every point
    if points is None:
        return make_plan(text, choose(text, vary or {}, lhs, seed))
    if vary or lhs is not None:
        raise TruespringError("the points are given one by one: leave out what is varied, and the Latin hypercube")
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
    report: Report | None = None,
) -> Sweep:
    """Solve every point of a plan that has no record in `out` yet, and keep each record as soon as it is there."""
    with Lock(out / "points"):
        store = Store(out)
        found = {record["point"]: record for record in store.read()}
        records: dict[str, Mapping[str, Any]] = {
            name: record
            for name, record in found.items()
            if name in plan.points and not (retry_failed and record["status"] == FAILED)
        }
        notes = tuple(_notes(plan, found, records))
        if report:
            for note in notes:
                report(note)
        left = {name: point for name, point in plan.points.items() if name not in records}
        n_before = len(records)
        if left:
            models = len(plan.text.document.get("models", ()))
            hard = None if timeout is None else 2 * models * timeout + _GRACE
            pool = Pool(workers, scheduler, threads=threads, timeout=hard, report=report)
            _Tally(plan, store, records, progress).solve(left, pool, partial(solve_point, timeout=timeout))
        return Sweep(plan, {name: records[name] for name in plan.points}, n_before, notes)


class _Tally:
    """Keeps records as they come."""

    def __init__(
        self, plan: Plan, store: Store, records: dict[str, Mapping[str, Any]], progress: Progress | None
    ) -> None:
        self.plan, self.store, self.records, self.progress = plan, store, records, progress
        self.n_failed = sum(record["status"] == FAILED for record in records.values())

    def solve(self, points: Mapping[str, Point], pool: Pool, task: Callable[[Any], Any]) -> None:
        self.tell()
        with pool:
            asked = {name: (self.plan.text, point) for name, point in points.items()}
            for name, outcome in pool.run(asked, task):
                record = {**self._head(points[name]), **_outcome(outcome)}
                self.store.write(record)
                self.records[name] = record
                self.n_failed += record["status"] == FAILED
                self.tell()

    def tell(self) -> None:
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


def solve_point(asked: tuple[StudyText, Point], timeout: float | None = None) -> dict[str, Any]:
    """Solve one point, on a worker, and return its summary, with the stored energy of each model [J].

    A model that takes longer than `timeout` [s] is given up.
    """
    text, point = asked
    _refuse_other_than_planned(text, point)
    result = run(text.study(point.changes), timeout=timeout, refining=False)
    found = summary(result)
    for name, path in result.paths.items():
        energy = path.states[-1].energy if path.states else math.nan
        found["models"][name]["energy"] = energy if math.isfinite(energy) else None
    return found


def _refuse_other_than_planned(text: StudyText, point: Point) -> None:
    """A record is of the files and the version that it is named after."""
    now = digests(text.file.parent, changed(text.document, point.changes), {})
    for name in {**now, **point.files}:
        if now.get(name) != point.files.get(name):
            raise TruespringError(f"{text.file.parent / name}: is not the file that it was when the sweep began")


def _outcome(outcome: dict[str, Any] | Failure) -> dict[str, Any]:
    if isinstance(outcome, Failure):
        return {"status": FAILED, "reason": outcome.reason, "summary": None}
    if outcome["truespring"] != version("truespring"):
        told = f"the worker has truespring {outcome['truespring']}, this is {version('truespring')}"
        return {"status": FAILED, "reason": f"{told}: install the same on both", "summary": None}
    stopped = [
        f"{name} is {model['status']} at load factor {model['load_factor']:.6g}"
        for name, model in outcome["models"].items()
        if model["status"] != CONVERGED
    ]
    return {"status": FAILED if stopped else CONVERGED, "reason": "; ".join(stopped) or None, "summary": outcome}


def _notes(plan: Plan, found: Mapping[str, Mapping[str, Any]], records: Mapping[str, Any]) -> list[str]:
    """What is to be said of records that were found before."""
    notes = []
    if plan.n_twice:
        notes.append(f"{plan.n_twice} points were given more than once, and are solved once")
    others = [record for name, record in found.items() if name not in plan.points]
    former = [record for record in others if _is_of(record, plan) and record["study"] != plan.frame]
    if former:
        notes.append(
            f"the study, a file that it names, or truespring has changed since {len(former)} results in points/ were "
            "made: they stay there, and are not taken"
        )
    if len(others) > len(former):
        told = f"{len(others) - len(former)} results of other values"
        notes.append(f"{told} stay in points/, and are not in the table")
    if records:
        notes.append(f"{len(records)} of {len(plan.points)} points were solved before")
    return notes


def _is_of(record: Mapping[str, Any], plan: Plan) -> bool:
    """Whether a record is of a sweep that varied the same."""
    return set(record["values"]) == set(plan.keys)


def write_sweep(done: Sweep, out: Path, command: str | None = None) -> Path:
    """Write sweep.csv, sweep.parquet and report.html; return the first.

    The page tells how to run it again: the command line, where it was one.
    """
    from truespring.sweeping.page import render_sweep

    page = render_sweep(done.plan.text.file, done.plan.text.document.get("title"), done.plan.keys, done.rows, command)
    with Output(out, "sweep.csv") as output:
        write_table(done.rows, output.staging)
        (output.staging / "report.html").write_text(page, encoding="utf-8")
        output.publish()
    return out / "sweep.csv"
