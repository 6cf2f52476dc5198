"""Solve a validity map in rounds, in one process or many."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from truespring.errors import StudyError, TruespringError, nearest
from truespring.models import LAWS
from truespring.showing.progress import chosen, paths
from truespring.study import Study, read_study, require_last_level
from truespring.sweeping import Failure, Pool
from truespring.validity.axes import NAMES, Range, axis_of, check_axes, known, range_of, sizes_to
from truespring.validity.bodies import Body, Spot
from truespring.validity.deviation import Deviation, deviation_of
from truespring.validity.loads import LOAD_TYPES, LoadType
from truespring.validity.maps import Key, Map
from truespring.validity.reference import Reference, solve_reference
from truespring.validity.refine import Cells, Rows
from truespring.validity.result import Validity
from truespring.validity.rules import MappedSprings, mapped_springs
from truespring.validity.solving import Solved, Task, run_task

#: Called with the path that was solved, the number of solved paths, and the number needed so far.
Progress = Callable[[str, int, int], None]

# Initial number of load steps in 2D and 3D, and largest number; steps are doubled if the interpolation is inaccurate.
_STEPS, _MOST_STEPS = {2: 10, 3: 6}, 48
# Largest relative interpolation error between levels: a tenth of the smallest line.
_BETWEEN = 0.001


def map_validity(
    study: str | Path | Study,
    *,
    law: str = "neo-hookean",
    loads: Sequence[str] | None = None,
    rules: Sequence[str] | None = None,
    x: str = "load",
    y: str | None = "depth",
    ranges: Mapping[str, Range | Sequence[float]] | None = None,
    adaptive: bool = True,
    workers: int | None = 1,
    scheduler: str | None = None,
    threads: int = 1,
    progress: bool | Progress | None = True,
) -> Validity:
    """Map the error of a study's springs against FEM by load level, mesh, material, rule or load type.

    Args:
        study: a study or its file.
        law: law of the reference, a key of LAWS; the reference is solved on finer meshes until it converges.
        loads: load types, keys of LOAD_TYPES, or "all"; by default the load of the study.
        rules: names of springs models of the study, rules, "RULE+VARIANT", or "all"; by default the springs of the
            study, or all rules if it has none.
        x: "load", "depth", "aspect" or "poisson"; without the load, errors are those at its last size.
        y: another of them, "rule", "load-type" or None; for a mesh from a file "depth" becomes "rule".
        ranges: first, last and, optionally, the number of values on the finest grid, by axis; the load starts at 0.
        adaptive: whether to solve only where a line passes, instead of the whole grid.
        workers: number of processes on this machine; 1 solves in this process, None uses the number of cores.
        scheduler: address of a Dask cluster to use instead.
        threads: threads of each worker.
        progress: whether to show a progress bar in a notebook or terminal; or a callback with the
            path that was solved, the number of solved paths, and the number needed so far.

    Raises StudyError for invalid arguments or combinations of them.

    Example:
        >>> import truespring as ts
        >>> study = ts.read_study(ts.new("strip", "strip.toml"), **{"mesh.elements": [4, 1], "solver.load_steps": 2})
        >>> options = {"law": "linear", "loads": ["stretch"], "rules": ["lloyd"], "y": None}
        >>> found = ts.map_validity(study, ranges={"load": (0, 0.1)}, **options)
        >>> found.converged, [one.rule.name for one in found.maps]
        (True, ['lloyd'])
    """
    read = study if isinstance(study, Study) else read_study(study)
    require_last_level(read, "map", in_proportion=True)
    if law not in LAWS:
        raise StudyError(f"law = '{law}' is unknown{nearest(law, LAWS)}; allowed: {', '.join(LAWS)}")
    started = time.perf_counter()
    with ExitStack() as stack:
        pool = None
        if workers != 1 or scheduler is not None:
            pool = stack.enter_context(Pool(None if scheduler else workers, scheduler, threads=threads))
        advance = stack.enter_context(chosen(progress, paths))
        run = _Run(read, law, loads, rules, x, y, ranges or {}, adaptive, pool, advance)
        maps = tuple(run.maps())
    return Validity(
        title=read.title,
        stem=read.stem,
        body=run.body,
        law=law,
        x=run.x,
        y=run.y,
        axes=run.axes,
        maps=maps,
        references=tuple(run.references[key] for key in run.reference_order),
        tolerance=read.tolerance,
        solves=(run.solved, sum(one.solves for one in run.spent)),
        full=sum(one.full for one in maps),
        seconds=time.perf_counter() - started,
        notes=tuple(axis.note for axis in run.axes.values() if axis.note),
    )


@dataclass(frozen=True, eq=False, slots=True)
class _ReferenceJob:
    """A reference to solve; it is pickled to a worker."""

    body: Body
    load: LoadType
    law: str
    poisson: float | None
    last: float | None
    steps: int


def _solve(job: Task | _ReferenceJob) -> Solved | Reference:
    if isinstance(job, Task):
        return run_task(job)
    return solve_reference(job.body, job.load, job.law, job.poisson, job.last, job.steps)


# Number of drawn rows per row of the grid, unless y is a depth.
_PARTS = 4


class _Run:
    """The state of a running map."""

    def __init__(
        self,
        study: Study,
        law: str,
        loads: Sequence[str] | None,
        rules: Sequence[str] | None,
        x: str,
        y: str | None,
        ranges: Mapping[str, Range | Sequence[float]],
        adaptive: bool,
        pool: Pool | None,
        progress: Progress | None,
    ) -> None:
        self.body = Body.of(study)
        if y == "depth" and x == "load" and self.body.shape is None:
            y = "rule"
        check_axes([x, y])
        self.x, self.y, self.law, self.pool = x, y, law, pool
        bounds = {known(name, {"load": 0, "depth": 0, "aspect": 0, "poisson": 0}): one for name, one in ranges.items()}
        self.ranges = {name: range_of(name, one) for name, one in bounds.items()}
        numbers = [name for name in (x, y) if name not in (None, "load", *NAMES)]
        if idle := [name for name in self.ranges if name not in (*numbers, "load")]:
            raise StudyError(f"the range of {idle[0]} has no effect: the axes of this map are x = {x}, y = {y}")
        self.axes = {str(name): axis_of(str(name), self.body, self.ranges) for name in numbers}
        if not adaptive:
            self.axes = {name: replace(axis, start=tuple(range(len(axis.values)))) for name, axis in self.axes.items()}
        names = list(LOAD_TYPES) if loads and "all" in loads else list(loads or ["own"])
        if "all" in (loads or ()):
            names = [
                one for one in names if self.body.dim in LOAD_TYPES[one].dims and (self.body.shape or one == "own")
            ]
        for name in names:
            if name not in LOAD_TYPES:
                raise StudyError(
                    f"load '{name}' is unknown{nearest(name, LOAD_TYPES)}; allowed: {', '.join(LOAD_TYPES)}, all"
                )
        self.loads = [self.body.load_type(name) for name in dict.fromkeys(names)]
        self.rules = {one.name: one for one in mapped_springs(study, rules, "poisson" in self.axes)}
        self.progress = progress or (lambda what, done, needed: None)
        self.references: dict[tuple[str, float | None], Reference] = {}
        self.steps = {load.name: _STEPS[self.body.dim] for load in self.loads}
        self.spent: list[Reference] = []
        self.found: dict[Key, Deviation | Failure] = {}
        self.solved, self.done, self.needed = 0, 0, 0

    @property
    def reference_order(self) -> list[tuple[str, float | None]]:
        """Keys of the references, by load in the given order, then by Poisson's ratio."""
        names = [load.name for load in self.loads]
        return sorted(self.references, key=lambda key: (names.index(key[0]), key[1] or 0.0))

    def maps(self) -> Iterator[Map]:
        """Solve the pending points of all maps, round by round; yield the maps at the end."""
        grids = {(load.name, rule): self._grid() for load in self.loads for rule in self.rules}
        while True:
            pending = {pair: {place: self._spot(place) for place in grid.pending()} for pair, grid in grids.items()}
            keys = [Key(*pair, spot) for pair, places in pending.items() for spot in places.values()]
            if not keys:
                break
            self._solve_all(keys)
            for pair, places in pending.items():
                values = {place: self._errors(Key(*pair, spot)) for place, spot in places.items()}
                grids[pair].add(values)
        for (load, rule), grid in grids.items():
            yield self._map(LOAD_TYPES[load], self.rules[rule], grid)

    def _grid(self) -> Any:
        y = self.axes.get(self.y or "")
        rows, start = (len(y.values), y.start) if y else (1, (0,))
        if self.x == "load":
            return Rows(rows, start)
        x = self.axes[self.x]
        if y is None:
            return Cells((len(x.values), 1), (x.start, (0,)))
        return Cells((len(x.values), len(y.values)), (x.start, y.start))

    def _spot(self, place: int | tuple[int, int]) -> Spot:
        """Return mesh and material at a place of a grid."""
        at = {}
        if isinstance(place, tuple):
            at[self.x] = self.axes[self.x].values[place[0]]
            if self.y in self.axes:
                at[str(self.y)] = self.axes[str(self.y)].values[place[1]]
        elif self.y in self.axes:
            at[str(self.y)] = self.axes[str(self.y)].values[place]
        depth, aspect, poisson = at.get("depth"), at.get("aspect"), at.get("poisson")
        return Spot(
            None if depth is None else int(depth),
            None if aspect is None else float(aspect),
            None if poisson is None else float(poisson),
        )

    def _errors(self, key: Key) -> Any:
        """Return the errors as complex numbers with a signed real part, see Rows; shape (n_sizes,) or a number."""
        found = self.found[key]
        if isinstance(found, Failure):
            return np.full(len(sizes_to(1.0)), np.nan) if self.x == "load" else np.nan
        signed = np.clip(found.stiffness_on_grid, -found.errors, found.errors)
        errors = signed + 1j * np.sqrt(found.errors**2 - signed**2)
        return errors if self.x == "load" else complex(errors[-1])

    def _solve_all(self, keys: list[Key]) -> None:
        """Solve references, then springs, then both again in more steps where the interpolation is inaccurate."""
        keys = [key for key in dict.fromkeys(keys) if key not in self.found]
        while keys:
            self._solve_references(keys)
            tasks: dict[Key, Any] = {}
            for key in keys:
                try:
                    tasks[key] = self._task(key)
                except TruespringError as error:
                    self.found[key] = Failure(str(error))
            for key, solved in self._run(tasks, lambda key: f"{key.load}: {key.rule}"):
                self.solved += 1
                self.found[key] = self._deviation(key, solved)
            short = [
                key
                for key in tasks
                if isinstance(found := self.found[key], Deviation) and found.interpolation > _BETWEEN
            ]
            keys = [key for key in short if self.steps[key.load] < _MOST_STEPS]
            for load in {key.load for key in keys}:
                self.steps[load] *= 2
                for one in [one for one in self.references if one[0] == load]:
                    del self.references[one]

    def _solve_references(self, keys: list[Key]) -> None:
        missing = {(key.load, key.spot.poisson) for key in keys} - self.references.keys()
        last = self.ranges["load"].last if "load" in self.ranges else None
        jobs = {
            (load, poisson): _ReferenceJob(self.body, LOAD_TYPES[load], self.law, poisson, last, self.steps[load])
            for load, poisson in sorted(missing, key=str)
        }
        for key, found in self._run(jobs, lambda key: f"{key[0]}: reference"):
            if isinstance(found, Failure):
                raise StudyError(found.reason)
            self.references[key] = found
            self.spent.append(found)

    def _task(self, key: Key) -> Task:
        reference = self.references[key.load, key.spot.poisson]
        problem = self.body.springs_problem(LOAD_TYPES[key.load], reference.factor, key.spot)
        return Task(problem, self.rules[key.rule].springs, self.steps[key.load])

    def _deviation(self, key: Key, solved: Any) -> Deviation | Failure:
        if isinstance(solved, Failure):
            return solved
        reference = self.references[key.load, key.spot.poisson]
        if not solved.states:
            return Failure(
                f"the springs have no equilibrium under a small load: {solved.end or 'unstable when unloaded'}"
            )
        probe = self.body.probe_in(solved.path.problem, LOAD_TYPES[key.load])
        return deviation_of(solved, reference, sizes_to(reference.target), probe)

    def _run(self, jobs: Mapping[Any, Any], words: Callable[[Any], str]) -> Iterator[tuple[Any, Any]]:
        self.needed += len(jobs)
        for key, found in self._each(jobs):
            self.done += 1
            self.progress(words(key), self.done, self.needed)
            yield key, found

    def _each(self, jobs: Mapping[Any, Any]) -> Iterator[tuple[Any, Any]]:
        if self.pool is not None and len(jobs) > 1:
            yield from self.pool.run(jobs, _solve)
            return
        for key, job in jobs.items():
            try:
                found: Any = _solve(job)
            except TruespringError as error:
                found = Failure(str(error))
            yield key, found

    def _map(self, load: LoadType, rule: MappedSprings, grid: Any) -> Map:
        here = {key.spot: one for key, one in self.found.items() if (key.load, key.rule) == (load.name, rule.name)}
        references = {poisson: one for (name, poisson), one in self.references.items() if name == load.name}
        y = self.axes.get(self.y or "")
        if self.x == "load":
            x = sizes_to(max(one.target for one in references.values()))
            full = grid.rows
        else:
            x = self.axes[self.x].values
            full = grid.shape[0] * grid.shape[1]
        errors, along = grid.filled(), np.zeros(0) if y is None else y.values
        smooth = along, errors
        if self.x == "load" and y is not None and y.name != "depth":
            places = np.arange((len(along) - 1) * _PARTS + 1) / _PARTS
            smooth = np.interp(places, np.arange(len(along)), along), grid.filled(_PARTS)
        return Map(
            load=load,
            rule=rule,
            x=x,
            y=along,
            errors=errors,
            smooth=smooth,
            deviations={spot: one for spot, one in here.items() if isinstance(one, Deviation)},
            failures={spot: one.reason for spot, one in here.items() if isinstance(one, Failure)},
            references=references,
            full=full,
        )
