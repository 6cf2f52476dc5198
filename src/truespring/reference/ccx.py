"""ccx, the solver of CalculiX: whether it is there, running it as a process, and what it says of a run."""

import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from truespring.errors import ModelError

#: Called with the number of the step and the share of it that is done.
Reached = Callable[[int, float], None]

#: After so long ccx is ended where no other limit is given [s].
TIMEOUT = 3600.0

# How long to wait before looking again how far ccx is [s].
_PATIENCE = 0.2
# Lines of what ccx says of an error that are told.
_LINES = 3

_MISSING = (
    "CalculiX is not installed: no program ccx is on the path. Debian and Ubuntu: apt-get install calculix-ccx; macOS "
    "and Windows: conda install -c conda-forge calculix; macOS with Homebrew: brew install "
    "costerwi/calculix/calculix-ccx, whose program has the version in its name: link it as ccx. Or leave this model out"
)


class Effort(NamedTuple):
    """What a step took: its increments, and iterations with those of attempts that were given up."""

    increments: int
    iterations: int


@dataclass(frozen=True)
class Finished:
    """A run of ccx that has ended.

    Attributes:
        code: its exit code; 201 for a deck that it refuses and for increments that do not converge alike.
        seconds: wall time.
        errors: what it says of each error, in its words.
        efforts: of the steps that it began, by their number from 1; empty without geometric nonlinearity.
        timeout: the limit that ended it [s], None where it ended by itself.
    """

    code: int
    seconds: float
    errors: tuple[str, ...]
    efforts: dict[int, Effort]
    timeout: float | None = None


def find_ccx() -> str:
    """Return the program; raise ModelError, which tells how to install it, where it is not on the path."""
    found = shutil.which("ccx")
    if found is None:
        raise ModelError(_MISSING)
    return found


def run_ccx(
    deck: Path, threads: int | None = None, reached: Reached | None = None, timeout: float | None = None
) -> Finished:
    """Run ccx on a deck in its own folder, which gets what ccx writes, for `timeout` seconds at most.

    `threads` are by default as many as truespring takes. Raises ModelError where ccx is not installed.
    """
    from truespring.kernels.threads import n_threads

    program, said = find_ccx(), deck.with_suffix(".txt")
    environment = os.environ | {"OMP_NUM_THREADS": str(threads or n_threads())}
    started, limit = time.perf_counter(), TIMEOUT if timeout is None else timeout
    ended = None
    with said.open("wb") as stream:
        process = subprocess.Popen(
            [program, "-i", deck.stem], cwd=deck.parent, env=environment, stdout=stream, stderr=subprocess.STDOUT
        )
        try:
            while True:
                try:
                    process.wait(min(_PATIENCE, limit))
                    break
                except subprocess.TimeoutExpired:
                    if time.perf_counter() - started > limit:
                        ended = limit
                        break
                    if reached and (done := [row for row in _increments(deck) if row.converged]):
                        reached(done[-1].step, done[-1].share)
        finally:
            process.kill()  # does nothing where it has ended
            process.wait()
    seconds = time.perf_counter() - started
    efforts: dict[int, Effort] = {}
    for row in _increments(deck):
        before = efforts.get(row.step, Effort(0, 0))
        efforts[row.step] = Effort(before.increments + row.converged, before.iterations + row.iterations)
    errors = tuple(_errors(said.read_text(encoding="utf-8", errors="replace").splitlines()))
    return Finished(process.returncode, seconds, errors, efforts, ended)


class _Increment(NamedTuple):
    step: int
    converged: bool
    iterations: int
    share: float


def _increments(deck: Path) -> Iterator[_Increment]:
    """The lines of the .sta file: step, increment, attempt (with a U if given up), iterations, and times."""
    try:
        lines = deck.with_suffix(".sta").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:  # not begun yet
        return
    for line in lines:
        parts = line.split()
        if len(parts) == 7 and parts[0].isdigit() and parts[3].isdigit():
            yield _Increment(int(parts[0]), not parts[2].endswith("U"), int(parts[3]), float(parts[5]))


def _errors(lines: list[str]) -> Iterator[str]:
    for number, line in enumerate(lines):
        if line.lstrip().startswith("*ERROR"):
            told = [line.strip()]
            for further in lines[number + 1 : number + _LINES]:
                if not further.strip() or further.lstrip().startswith("*"):
                    break
                told.append(further.strip())
            yield " ".join(told)
