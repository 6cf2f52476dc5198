"""Run programs on cases, each in a separate process; results are cached, so that an interrupted run can resume."""

import hashlib
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from subprocess import PIPE
from typing import Any

import numpy as np

from benchmarks.cases import LADDER, REFERENCE, SIZES, STRETCHED, bar, n_nodes
from benchmarks.machine import hardware

HERE = Path(__file__).parent
ROOT = HERE.parent
CACHE = HERE / ".cache"

#: Time limit of a solution [s]; beyond it the program does not solve larger meshes of that load.
LIMIT = 120.0

#: Time limit of all measurements [s]; a run that would start later is left out.
WHOLE_LIMIT = 90 * 60.0

# Time limit of a process [s], with reading, warm-up and failed attempts.
_PROCESS_LIMIT = 2 * LIMIT

# Beginnings of failures that larger meshes share.
_TIME = ("longer than", "the next size would exceed")

# Processes whose solution is faster than this [s] are repeated REPEATS times, for the median; those of LADDER once.
_SHORT, REPEATS = 20.0, 3


@dataclass(frozen=True)
class Program:
    """A program to measure.

    Attributes:
        label: name in tables and the figure.
        law: material law.
        element: kind of element.
        module: module of benchmarks.programs.
        arguments: command-line arguments after the case.
        dims: dimensions of the bodies whose SIZES it runs on.
        ladder: keys of LADDER that it runs on.
        peer: whether it needs the environment of the peers.
        largest: largest depth of SIZES, by dimension; all if empty.
        coarser: its mesh has so many times fewer elements over the height than the others, rounded up.
    """

    label: str
    law: str
    element: str
    module: str
    arguments: tuple[str, ...] = ()
    dims: tuple[int, ...] = (2, 3)
    ladder: tuple[tuple[int, str], ...] = ()
    peer: bool = False
    largest: dict[int, int] = field(default_factory=dict)
    coarser: int = 1


_PLANE, _SPACE, _SOFT = ((2, "bending"),), ((3, "bending"),), ((3, "soft block"),)
_ALL = (*_PLANE, *_SPACE, *_SOFT)
_SVK = "St. Venant-Kirchhoff"

#: The springs that the page is about.
SPRINGS = "gaussian"

PROGRAMS = {
    "gaussian": Program(
        "truespring, Gaussian springs", "neo-Hookean", "Gaussian springs", "truespring", ("gaussian",), ladder=_ALL
    ),
    "fem-nh": Program(
        "truespring, FEM (neo-Hookean)",
        "neo-Hookean",
        "linear; mean dilatation at 0.45",
        "truespring",
        ("neo-hookean",),
        ladder=_ALL,
        largest=REFERENCE,
    ),
    "fem-svk": Program(
        f"truespring, FEM ({_SVK})",
        _SVK,
        "linear; mean dilatation at 0.45",
        "truespring",
        ("saint-venant-kirchhoff",),
        ladder=_ALL,
        largest=REFERENCE,
    ),
    "calculix": Program("CalculiX (C3D8; CPE4)", _SVK, "linear", "calculix", ("C3D8",), ladder=_ALL, peer=True),
    "calculix-c3d8i": Program(
        "CalculiX (C3D8I)", _SVK, "incompatible modes", "calculix", ("C3D8I",), (3,), (*_SPACE, *_SOFT), peer=True
    ),
    "calculix-c3d20r": Program(
        "CalculiX (C3D20R)",
        _SVK,
        "20 nodes, reduced integration",
        "calculix",
        ("C3D20R",),
        (3,),
        (*_SPACE, *_SOFT),
        peer=True,
    ),
    "calculix-c3d20r-half": Program(
        "CalculiX (C3D20R, half as many a side)",
        _SVK,
        "20 nodes, reduced integration",
        "calculix",
        ("C3D20R",),
        (3,),
        peer=True,
        coarser=2,
    ),
    "felupe-nh": Program(
        "FElupe (neo-Hookean)", "neo-Hookean", "linear", "felupe", ("neo-hookean", "linear"), ladder=_ALL, peer=True
    ),
    "felupe-mixed": Program(
        "FElupe (neo-Hookean, three fields)",
        "neo-Hookean",
        "mean dilatation",
        "felupe",
        ("neo-hookean", "three-field"),
        (),
        _SOFT,
        peer=True,
    ),
    "felupe-quadratic": Program(
        "FElupe (neo-Hookean, 20 nodes)",
        "neo-Hookean",
        "20 nodes",
        "felupe",
        ("neo-hookean", "quadratic"),
        (),
        (*_SPACE, *_SOFT),
        peer=True,
    ),
    "felupe-svk": Program(
        f"FElupe ({_SVK})",
        _SVK,
        "linear",
        "felupe",
        ("saint-venant-kirchhoff", "linear"),
        ladder=(*_PLANE, *_SPACE),
        peer=True,
    ),
    "skfem": Program("scikit-fem", "neo-Hookean", "linear", "skfem", ladder=(*_PLANE, *_SPACE), peer=True),
    "isotropic": Program(
        "truespring, springs (isotropic)",
        "springs",
        "springs",
        "truespring",
        ("isotropic",),
        (3,),
        (*_PLANE, *_SPACE),
        largest={3: 33},
    ),
    "lloyd": Program("truespring, springs (lloyd)", "springs", "springs", "truespring", ("lloyd",), (2,), _PLANE),
    "biquadratic": Program(
        "truespring, springs (biquadratic)",
        _SVK,
        "biquadratic springs",
        "truespring",
        ("biquadratic",),
        ladder=(*_PLANE, *_SPACE),
        largest=REFERENCE,
    ),
}


@dataclass(frozen=True)
class Job:
    """One program on one mesh under one load."""

    program: str
    dim: int
    load: str
    depth: int

    @property
    def n_nodes(self) -> int:
        """The number of nodes of the mesh of linear elements that the job is compared with."""
        return n_nodes(self.dim, self.load, self.depth)

    @property
    def own_depth(self) -> int:
        """Number of elements over the height of the mesh of the program."""
        return -(-self.depth // PROGRAMS[self.program].coarser)


@dataclass(frozen=True)
class Measured:
    """Results of a job.

    Attributes:
        program, dim, load, depth, n_nodes: the job.
        seconds: time of each process [s], empty after a failure.
        tip: displacement of the loaded end [m].
        samples: displacement of the nodes of the coarsest mesh [m], see `Case.sampled`.
        n_unknowns: displacements of the mesh that are not held.
        iterations, linear_iterations, lanczos_iterations: numbers of iterations of the last run.
        peak_bytes: peak memory of the last run beyond that of an empty Python process [bytes].
        version, notes: version of the program, and remarks on the run.
        failure: why there is no result, else empty.
    """

    program: str
    dim: int
    load: str
    depth: int
    n_nodes: int
    seconds: tuple[float, ...] = ()
    tip: float = float("nan")
    samples: tuple[tuple[float, ...], ...] = ()
    n_unknowns: int = 0
    iterations: int = 0
    linear_iterations: int | None = None
    lanczos_iterations: int | None = None
    peak_bytes: int = 0
    version: str = ""
    notes: str = ""
    failure: str = ""

    @property
    def median(self) -> float:
        """The median of the times [s]."""
        return statistics.median(self.seconds)


class Session:
    """A running log on standard error, the time that is left, and the results so far, from which a run resumes."""

    def __init__(self, folder: Path = CACHE, limit: float = WHOLE_LIMIT) -> None:
        self._folder, self._started, self._limit = folder, time.monotonic(), limit

    def log(self, text: str) -> None:
        """Print a line with the time since the start."""
        minutes, seconds = divmod(round(time.monotonic() - self._started), 60)
        sys.stderr.write(f"[{minutes:3}:{seconds:02}] {text}\n")

    @property
    def over(self) -> bool:
        """Whether the time limit is reached."""
        return time.monotonic() - self._started > self._limit

    def cached(self, name: str, code: str, run: Callable[[], Any]) -> Any:
        """Return the result of `run`, from the folder if it has one for the same digest of the code."""
        file = self._folder / f"{name}-{code}.json"
        if not file.is_file():
            found = run()
            self._folder.mkdir(parents=True, exist_ok=True)
            file.write_text(json.dumps(found))
        return json.loads(file.read_text())


def jobs(
    sizes: dict[int, tuple[int, ...]], ladder: dict[tuple[int, str], tuple[int, ...]], loads: Iterable[tuple[int, str]]
) -> Iterator[Job]:
    """Yield the jobs of bodies; those of one program and load from small to large."""
    for dim, load in loads:
        for name, program in PROGRAMS.items():
            rungs = ladder.get((dim, load), ()) if (dim, load) in program.ladder else ()
            most = min(program.largest.get(dim, max(sizes[dim])), STRETCHED[dim] if load == "stretching" else 10**9)
            whole = dim in program.dims and load in ("bending", "stretching")
            depths = [depth for depth in sizes[dim] if depth <= most] if whole else []
            yield from (Job(name, dim, load, depth) for depth in sorted({*rungs, *depths}))


def measure_all(planned: Iterable[Job], session: Session, repeats: int = REPEATS) -> list[Measured]:
    """Return the results of jobs, cached ones without running; skip jobs that would exceed a limit."""
    empty, found, before = empty_process(), [], []
    for job in planned:
        if before and (before[-1].program, before[-1].dim, before[-1].load) != (job.program, job.dim, job.load):
            before = []
        reason = too_slow(before, job) if before else ""
        if session.over:
            reason = f"left out: the time limit of {WHOLE_LIMIT / 60:g} minutes for all programs"
        on_ladder = job.depth in LADDER.get((job.dim, job.load), ()) and job.depth not in SIZES[job.dim]
        last = _nothing(job, reason) if reason else measure(job, session, 1 if on_ladder else repeats)
        before.append(last)
        found.append(replace(last, peak_bytes=max(0, last.peak_bytes - empty)))
        result = f"{last.median:.3g} s, tip {last.tip:.7g} m {last.notes}" if last.seconds else last.failure
        session.log(f"{job.program:20} {job.dim}D {job.load:10} {job.n_nodes:8,} nodes  {result}")
    return found


def too_slow(before: Sequence[Measured], job: Job) -> str:
    """Return why a job would exceed LIMIT, else empty: time is a power of the nodes, by the last two meshes."""
    last = before[-1]
    if not last.seconds:  # one that did not converge on a coarse mesh may do so on a finer one
        return last.failure if last.failure.startswith(_TIME) else ""
    power = 1.0
    solved = [one for one in before if one.seconds]
    if len(solved) > 1 and last.median > 1:
        coarser = solved[-2]
        power = max(power, float(np.log(last.median / coarser.median) / np.log(last.n_nodes / coarser.n_nodes)))
    if last.median * (job.n_nodes / last.n_nodes) ** power > LIMIT:
        return f"the next size would exceed {LIMIT:g} s ({last.median:.0f} s at {last.n_nodes:,} nodes)"
    return ""


def measure(job: Job, session: Session, repeats: int) -> Measured:
    """Return the results of a job, repeated if it is fast."""
    runs: list[dict] = []
    while len(runs) < repeats and (not runs or runs[0]["seconds"] < _SHORT):
        name = f"{job.program}-{job.dim}d-{job.load.replace(' ', '-')}-{job.depth}-{len(runs)}"
        run = session.cached(name, fingerprint(job.program), lambda: execute(job))
        if "failure" in run:
            return _nothing(job, run["failure"])
        runs.append(run)
    return measured_of(job, runs)


def measured_of(job: Job, runs: list[dict]) -> Measured:
    """Return the results of a job from the output of its processes."""
    seconds = tuple(run["seconds"] for run in runs)
    return Measured(**asdict(job), n_nodes=job.n_nodes, **runs[-1] | {"seconds": seconds})


def _nothing(job: Job, failure: str) -> Measured:
    """Return the result of a job that failed."""
    return Measured(**asdict(job), n_nodes=job.n_nodes, failure=failure)


def fingerprint(name: str) -> str:
    """Return a digest of the code of a program, the cases and the machine, which the times depend on."""
    program = PROGRAMS[name]
    files = [HERE / "cases.py", HERE / "programs" / "common.py", HERE / "programs" / f"{program.module}.py"]
    files += [HERE / "peers.txt", HERE / "programs" / "neo_hooke.py"] if program.peer else []
    return digest(repr(program.arguments), files, ours=not program.peer)


def digest(text: str, files: Iterable[Path], ours: bool = True) -> str:
    """Return a digest of a text, files, the machine and, if `ours`, the source of truespring."""
    source = sorted((ROOT / "src" / "truespring").rglob("*.py")) if ours else []
    found = hashlib.sha256(repr((text, hardware())).encode())
    for file in [*files, *source]:
        found.update(file.read_bytes())
    return found.hexdigest()[:12]


def execute(job: Job, source: Path = ROOT / "src") -> dict[str, Any]:
    """Run a job in a separate process, with truespring from `source`; return its output, or {"failure": why}."""
    program = PROGRAMS[job.program]
    return on_case(f"programs.{program.module}", job, program.arguments, python(program.peer), source)


def on_case(
    module: str,
    job: Job,
    arguments: tuple[str, ...],
    interpreter: str = sys.executable,
    source: Path = ROOT / "src",
) -> dict[str, Any]:
    """Run a module of benchmarks on the case of a job; return its output, or {"failure": why}."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "case.npz"
        bar(job.dim, job.load, job.own_depth).write(file)
        return in_process(module, (str(file), *arguments), interpreter, source)


def in_process(
    module: str, arguments: tuple[str, ...] = (), interpreter: str = sys.executable, source: Path = ROOT / "src"
) -> dict[str, Any]:
    """Run a module of benchmarks; return the JSON that it prints last, or {"failure": why}."""
    command = [interpreter, "-m", f"benchmarks.{module}", *arguments]
    with subprocess.Popen(
        command, cwd=ROOT, env=environment(source), stdout=PIPE, stderr=PIPE, text=True, start_new_session=True
    ) as process:
        try:
            printed, complaint = process.communicate(timeout=_PROCESS_LIMIT)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return {"failure": f"longer than {_PROCESS_LIMIT:g} s"}
        except BaseException:  # KeyboardInterrupt included
            os.killpg(process.pid, signal.SIGKILL)
            raise
    if process.returncode:
        return {"failure": (complaint.strip().splitlines() or ["no message"])[-1]}
    return json.loads(printed.splitlines()[-1])


def python(peer: bool) -> str:
    """Return the Python interpreter of the peers' environment, or the current one."""
    return str(ROOT / ".venv-peers" / "bin" / "python") if peer else sys.executable


def environment(source: Path = ROOT / "src") -> dict[str, str]:
    """Return the environment variables of processes: all cores, truespring from `source`, no settings of BLAS."""
    removed = ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    kept = {name: value for name, value in os.environ.items() if name not in removed}
    return kept | {"OMP_NUM_THREADS": str(os.cpu_count()), "PYTHONPATH": str(source)}


def empty_process() -> int:
    """Return the peak memory of a Python process that imports nothing [bytes]."""
    code = "print(next(line for line in open('/proc/self/status') if line.startswith('VmHWM')).split()[1])"
    done = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=False)
    return int(done.stdout or 0) * 1024
