"""Runs: each program on each case in a process of its own; results are kept, so that a break costs little."""

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

#: What a solve may take [s]; larger meshes of that load are then not given to the program.
LIMIT = 120.0

# Failing attempts, warming up and reading come on top of what is timed.
_PROCESS_LIMIT = 3 * LIMIT

# Solves shorter than this [s] are run REPEATS times, for their median; those of the LADDER once.
_SHORT, REPEATS = 20.0, 3


@dataclass(frozen=True)
class Program:
    """What is run.

    Attributes:
        label: how tables and the figure call it.
        law: what it takes matter for.
        module: of benchmarks.programs.
        arguments: after the case.
        dims: of the bodies whose SIZES it is run on.
        ladder: of the bodies whose LADDER it is run on, bending only.
        peer: whether it lives in the environment of the peers.
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
    """One program on one mesh."""

    program: str
    dim: int
    load: str
    depth: int

    @property
    def n_nodes(self) -> int:
        """Of the mesh."""
        return n_nodes(self.dim, self.depth)


@dataclass(frozen=True)
class Measured:
    """What all runs of a job gave: `seconds` has one value a run, and none where `failure` says why.

    The other values are of the last run, `peak_bytes` over that of an empty Python process.
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
        """Of the seconds."""
        return statistics.median(self.seconds)


def jobs(sizes: dict[int, tuple[int, ...]], ladder: dict[int, tuple[int, ...]]) -> Iterator[Job]:
    """Yield all jobs; those of one program and load from small to large."""
    for dim, load in sorted(LOADS, key=lambda one: one[1]):  # what is bent first
        largest = STRETCHED[dim] if load == "stretching" else max(sizes[dim])
        for name, program in PROGRAMS.items():
            rungs = ladder[dim] if load == "bending" and dim in program.ladder else ()
            elements = name.startswith("fem") or (dim == 3 and name == "biquadratic")
            most = min(largest, REFERENCE[dim]) if elements else largest
            wanted = [depth for depth in sizes[dim] if depth <= most] if dim in program.dims else []
            yield from (Job(name, dim, load, depth) for depth in sorted({*rungs, *wanted}))


def measure_all(wanted: Iterable[Job], repeats: int = REPEATS) -> list[Measured]:
    """Run jobs, from the cache where they were run before; leave out what would take longer than LIMIT."""
    empty, last, found = empty_process(), None, []
    for job in wanted:
        same = last is not None and (last.program, last.dim, last.load) == (job.program, job.dim, job.load)
        reason = too_slow(last, job) if same else ""
        last = _nothing(job, reason) if reason else measure(job, repeats if job.depth in SIZES[job.dim] else 1)
        found.append(replace(last, peak_bytes=max(0, last.peak_bytes - empty)))
        told = f"{last.median:.3g} s, tip {last.tip:.7g} m {last.notes}" if last.seconds else last.failure
        sys.stderr.write(f"{job.program:12} {job.dim}D {job.load:10} {job.n_nodes:8,} nodes  {told}\n")
    return found


def too_slow(last: Measured, job: Job) -> str:
    """Return why a job is left out after what a smaller mesh took, if it is: the time at best grows with the nodes."""
    if not last.seconds:
        return last.failure
    if last.median * job.n_nodes / last.n_nodes > LIMIT:
        return f"would take longer than {LIMIT:g} s: {last.median:.0f} s at {last.n_nodes:,} nodes"
    return ""


def measure(job: Job, repeats: int) -> Measured:
    """Run a job once, and again where that was short."""
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
    return Measured(**asdict(job), n_nodes=job.n_nodes, failure=failure)


def cached(name: str, code: str, run: Callable[[], Any]) -> Any:
    """Return what `run` gives, from the cache if it is there under the same digest of its code."""
    file = CACHE / f"{name}-{code}.json"
    if not file.is_file():
        found = run()
        CACHE.mkdir(exist_ok=True)
        file.write_text(json.dumps(found))
    return json.loads(file.read_text())


def fingerprint(name: str) -> str:
    """A digest of what the times of a program depend on: its code here, the cases, the machine."""
    program = PROGRAMS[name]
    peers = [HERE / "peers.txt", *HERE.glob("programs/neo_hooke.py")]
    files = [HERE / "cases.py", HERE / "programs" / "common.py", HERE / "programs" / f"{program.module}.py"]
    files += peers if program.peer else [HERE / "kernels.py", *sorted((ROOT / "src" / "truespring").rglob("*.py"))]
    digest = hashlib.sha256(repr((program.arguments, hardware())).encode())
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def execute(job: Job) -> dict[str, Any]:
    """Run a job in a process of its own; return what it printed, or {"failure": why}."""
    program = PROGRAMS[job.program]
    return in_process(f"programs.{program.module}", job, program.arguments, python(program.peer))


def in_process(module: str, job: Job, arguments: tuple[str, ...], interpreter: str = sys.executable) -> Any:
    """Give the case of a job to a module of benchmarks; return what it prints, or {"failure": why}."""
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
            except BaseException:  # also of the user, who stops all
                os.killpg(process.pid, signal.SIGKILL)
                raise
    if process.returncode:
        return {"failure": (complaint.strip().splitlines() or ["no message"])[-1]}
    return json.loads(printed.splitlines()[-1])


def bandwidth() -> dict[str, float]:
    """Return the bandwidth of the machine's memory [bytes/s], see `limits.bandwidth`; measured anew each time."""
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.kernels"], cwd=ROOT, env=environment(), stdout=PIPE, text=True, check=True
    )
    return json.loads(done.stdout)


def kernels(dim: int, depth: int) -> dict[str, Any]:
    """Return the kernels of springs on the bent body, see `kernels.measured`; no rows if that failed."""
    rule = SPRINGS[dim]
    job = Job(rule, dim, "bending", depth)
    found = cached(
        f"kernels-{dim}d-{depth}", fingerprint(rule), lambda: in_process("kernels", job, PROGRAMS[rule].arguments)
    )
    return {"dim": dim, "n_nodes": job.n_nodes, "rows": [], "shares": {}, **found}


def python(peer: bool) -> str:
    """Return the interpreter of the peers' environment or of this one."""
    return str(ROOT / ".venv-peers" / "bin" / "python") if peer else sys.executable


def environment() -> dict[str, str]:
    """Return what processes see: every core, and no choice of kernels made for another program."""
    unwanted = ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE", "PYTHONPATH")
    kept = {name: value for name, value in os.environ.items() if name not in unwanted}
    return kept | {"OMP_NUM_THREADS": str(os.cpu_count())}


def empty_process() -> int:
    """Return the peak memory of a Python process that imports nothing [bytes]."""
    told = "print(next(line for line in open('/proc/self/status') if line.startswith('VmHWM')).split()[1])"
    done = subprocess.run([sys.executable, "-I", "-S", "-c", told], capture_output=True, text=True, check=False)
    return int(done.stdout or 0) * 1024


def command_line(repeats: int = REPEATS) -> dict[str, float]:
    """Return the wall times [s] of two commands, from a warm cache: medians."""
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
