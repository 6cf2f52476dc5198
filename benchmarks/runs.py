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
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from subprocess import PIPE
from typing import Any

from benchmarks.cases import LOADS, REFERENCE, SIZES, SPRINGS, STRETCHED, bar, n_nodes
from benchmarks.machine import hardware

HERE = Path(__file__).parent
ROOT = HERE.parent
CACHE = HERE / ".cache"

#: Time limit of a solution [s]; beyond it the program does not solve larger meshes of that load.
LIMIT = 120.0

# Time limit of a process [s], with reading, warm-up and failed attempts.
_PROCESS_LIMIT = 3 * LIMIT

# Solutions faster than this [s] are repeated REPEATS times, for the median; those of LADDER run once.
_SHORT, REPEATS = 20.0, 3


@dataclass(frozen=True)
class Program:
    """A program to measure.

    Attributes:
        label: name in tables and the figure.
        law: material law.
        module: module of benchmarks.programs.
        arguments: command-line arguments after the case.
        dims: dimensions of the bodies whose SIZES it runs on.
        ladder: dimensions of the bodies whose LADDER it runs on, in bending only.
        peer: whether it needs the environment of the peers.
    """

    label: str
    law: str
    module: str
    arguments: tuple[str, ...] = ()
    dims: tuple[int, ...] = (2, 3)
    ladder: tuple[int, ...] = (2, 3)
    peer: bool = False


PROGRAMS = {
    "lloyd": Program("truespring, springs (lloyd)", "springs", "truespring", ("lloyd",), (2,), (2,)),
    "isotropic": Program("truespring, springs (isotropic)", "springs", "truespring", ("isotropic",), (3,), (2, 3)),
    "biquadratic": Program("truespring, springs (biquadratic)", "St. Venant-Kirchhoff", "truespring", ("biquadratic",)),
    "fem-svk": Program(
        "truespring, FEM (St. Venant-Kirchhoff)", "St. Venant-Kirchhoff", "truespring", ("saint-venant-kirchhoff",)
    ),
    "fem-nh": Program("truespring, FEM (neo-Hookean)", "neo-Hookean", "truespring", ("neo-hookean",)),
    "calculix": Program("CalculiX", "St. Venant-Kirchhoff", "calculix", peer=True),
    "felupe-svk": Program(
        "FElupe (St. Venant-Kirchhoff)", "St. Venant-Kirchhoff", "felupe", ("saint-venant-kirchhoff",), peer=True
    ),
    "felupe-nh": Program("FElupe (neo-Hookean)", "neo-Hookean", "felupe", ("neo-hookean",), peer=True),
    "skfem": Program("scikit-fem", "neo-Hookean", "skfem", peer=True),
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
        """The number of nodes of the mesh."""
        return n_nodes(self.dim, self.depth)


@dataclass(frozen=True)
class Measured:
    """Results of a job.

    Attributes:
        program, dim, load, depth, n_nodes: the job.
        seconds: time of each run [s], empty after a failure.
        tip: displacement of the loaded end [m].
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


def jobs(sizes: dict[int, tuple[int, ...]], ladder: dict[int, tuple[int, ...]]) -> Iterator[Job]:
    """Yield all jobs; those of one program and load from small to large."""
    for dim, load in sorted(LOADS, key=lambda one: one[1]):  # bending first
        largest = STRETCHED[dim] if load == "stretching" else max(sizes[dim])
        for name, program in PROGRAMS.items():
            rungs = ladder[dim] if load == "bending" and dim in program.ladder else ()
            elements = name.startswith("fem") or (dim == 3 and name == "biquadratic")
            most = min(largest, REFERENCE[dim]) if elements else largest
            depths = [depth for depth in sizes[dim] if depth <= most] if dim in program.dims else []
            yield from (Job(name, dim, load, depth) for depth in sorted({*rungs, *depths}))


def measure_all(planned: Iterable[Job], repeats: int = REPEATS) -> list[Measured]:
    """Return the results of jobs, cached ones without running; skip jobs that would exceed LIMIT."""
    empty, last, found = empty_process(), None, []
    for job in planned:
        same = last is not None and (last.program, last.dim, last.load) == (job.program, job.dim, job.load)
        reason = too_slow(last, job) if same else ""
        last = _nothing(job, reason) if reason else measure(job, repeats if job.depth in SIZES[job.dim] else 1)
        found.append(replace(last, peak_bytes=max(0, last.peak_bytes - empty)))
        result = f"{last.median:.3g} s, tip {last.tip:.7g} m {last.notes}" if last.seconds else last.failure
        sys.stderr.write(f"{job.program:12} {job.dim}D {job.load:10} {job.n_nodes:8,} nodes  {result}\n")
    return found


def too_slow(last: Measured, job: Job) -> str:
    """Return why a job would exceed LIMIT, judged by a smaller mesh and time proportional to nodes; else empty."""
    if not last.seconds:
        return last.failure
    if last.median * job.n_nodes / last.n_nodes > LIMIT:
        return f"the next size would exceed {LIMIT:g} s ({last.median:.0f} s at {last.n_nodes:,} nodes)"
    return ""


def measure(job: Job, repeats: int) -> Measured:
    """Return the results of a job, repeated if it is fast."""
    runs: list[dict] = []
    while len(runs) < repeats and (not runs or runs[0]["seconds"] < _SHORT):
        name = f"{job.program}-{job.dim}d-{job.load}-{job.depth}-{len(runs)}"
        run = cached(name, fingerprint(job.program), lambda: execute(job))
        if "failure" in run:
            return _nothing(job, run["failure"])
        runs.append(run)
    seconds = tuple(run["seconds"] for run in runs)
    return Measured(**asdict(job), n_nodes=job.n_nodes, **runs[-1] | {"seconds": seconds})


def _nothing(job: Job, failure: str) -> Measured:
    """Return the result of a job that failed."""
    return Measured(**asdict(job), n_nodes=job.n_nodes, failure=failure)


def cached(name: str, code: str, run: Callable[[], Any]) -> Any:
    """Return the result of `run`, from the cache if it has one for the same digest of the code."""
    file = CACHE / f"{name}-{code}.json"
    if not file.is_file():
        found = run()
        CACHE.mkdir(exist_ok=True)
        file.write_text(json.dumps(found))
    return json.loads(file.read_text())


def fingerprint(name: str) -> str:
    """Return a digest of the code of a program, the cases and the machine, which the times depend on."""
    program = PROGRAMS[name]
    peers = [HERE / "peers.txt", *HERE.glob("programs/neo_hooke.py")]
    files = [HERE / "cases.py", HERE / "programs" / "common.py", HERE / "programs" / f"{program.module}.py"]
    files += peers if program.peer else [HERE / "kernels.py", *sorted((ROOT / "src" / "truespring").rglob("*.py"))]
    digest = hashlib.sha256(repr((program.arguments, hardware())).encode())
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def execute(job: Job) -> dict[str, Any]:
    """Run a job in a separate process; return its output, or {"failure": why}."""
    program = PROGRAMS[job.program]
    return in_process(f"programs.{program.module}", job, program.arguments, python(program.peer))


def in_process(module: str, job: Job, arguments: tuple[str, ...], interpreter: str = sys.executable) -> Any:
    """Run a module of benchmarks on the case of a job; return its output, or {"failure": why}."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "case.npz"
        bar(job.dim, job.load, job.depth).write(file)
        command = [interpreter, "-m", f"benchmarks.{module}", str(file), *arguments]
        with subprocess.Popen(
            command, cwd=ROOT, env=environment(), stdout=PIPE, stderr=PIPE, text=True, start_new_session=True
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


def bandwidth() -> dict[str, float]:
    """Return the memory bandwidth [bytes/s], see `limits.bandwidth`; never cached."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.kernels"], cwd=ROOT, env=environment(), stdout=PIPE, text=True, check=True
    )
    return json.loads(done.stdout)


def kernels(dim: int, depth: int) -> dict[str, Any]:
    """Return the times of the kernels of springs in bending, see `kernels.measured`; no rows after a failure."""
    rule = SPRINGS[dim]
    job = Job(rule, dim, "bending", depth)
    found = cached(
        f"kernels-{dim}d-{depth}", fingerprint(rule), lambda: in_process("kernels", job, PROGRAMS[rule].arguments)
    )
    return {"dim": dim, "n_nodes": job.n_nodes, "rows": [], "shares": {}, **found}


def python(peer: bool) -> str:
    """Return the Python interpreter of the peers' environment, or the current one."""
    return str(ROOT / ".venv-peers" / "bin" / "python") if peer else sys.executable


def environment() -> dict[str, str]:
    """Return the environment variables of processes: all cores, and no settings of BLAS or Python paths."""
    removed = ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE", "PYTHONPATH")
    kept = {name: value for name, value in os.environ.items() if name not in removed}
    return kept | {"OMP_NUM_THREADS": str(os.cpu_count())}


def empty_process() -> int:
    """Return the peak memory of a Python process that imports nothing [bytes]."""
    code = "print(next(line for line in open('/proc/self/status') if line.startswith('VmHWM')).split()[1])"
    done = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True, check=False)
    return int(done.stdout or 0) * 1024


def command_line(repeats: int = REPEATS) -> dict[str, float]:
    """Return the median wall times of two commands [s], with warm caches."""
    program = str(Path(sys.executable).parent / "truespring")
    study = str(ROOT / "examples" / "bending.toml")
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name, command in {
            "truespring verify examples/bending.toml": [program, "verify", study, "--quiet", "--out", folder],
            "truespring --help": [program, "--help"],
        }.items():
            times = []
            for _ in range(1 + repeats):
                started = time.perf_counter()
                subprocess.run(command, cwd=ROOT, env=environment(), capture_output=True, check=True)
                times.append(time.perf_counter() - started)
            found[name] = statistics.median(times[1:])
    return found
