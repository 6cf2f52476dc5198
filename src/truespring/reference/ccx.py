"""Run ccx, the solver of CalculiX, as a process, and read its progress and errors."""

import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from truespring.errors import ModelError

#: Called with the number of the step and its completed fraction.
Reached = Callable[[int, float], None]

#: Default time limit [s].
TIMEOUT = 3600.0

# Interval at which progress is read [s].
_PATIENCE = 0.2
# Number of lines of an error message that are kept.
_LINES = 3

_MISSING = (
    "CalculiX is not installed: no program ccx is on the path. Debian and Ubuntu: apt-get install calculix-ccx; macOS "
    "and Windows: conda install -c conda-forge calculix; macOS with Homebrew: brew install "
    "costerwi/calculix/calculix-ccx, whose program has the version in its name: link it as ccx. Or remove this model"
)


class Effort(NamedTuple):
    """The effort of a step: converged increments, and iterations, including those of abandoned attempts."""

    increments: int
    iterations: int


@dataclass(frozen=True)
class Finished:
    """A finished run of ccx.

    Attributes:
        code: exit code; 201 both for an invalid deck and for increments that do not converge.
        seconds: wall time [s].
        errors: the error messages of ccx.
        efforts: effort of each started step by its number from 1; empty without geometric nonlinearity.
        timeout: the time limit that ended the run [s], None if it was not reached.
    """

    code: int
    seconds: float
    errors: tuple[str, ...]
    efforts: dict[int, Effort]
    timeout: float | None = None


def find_ccx() -> str:
    """Return the path of ccx; raise ModelError, with instructions to install it, if it is not found."""
    found = shutil.which("ccx")
    if found is None:
        raise ModelError(_MISSING)
    return found


def run_ccx(
    deck: Path, threads: int | None = None, reached: Reached | None = None, timeout: float | None = None
) -> Finished:
    """Run ccx on a deck, in the folder of the deck, for at most `timeout` seconds.

    `threads` is by default the number that truespring uses. Raises ModelError if ccx is not installed.
    """
    from truespring.kernels.threads import n_threads

    program, log = find_ccx(), deck.with_suffix(".txt")
    environment = os.environ | {"OMP_NUM_THREADS": str(threads or n_threads())}
    started, limit = time.perf_counter(), TIMEOUT if timeout is None else timeout
    ended = None
    with log.open("wb") as stream:
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
            process.kill()  # no effect if it has ended
            process.wait()
    seconds = time.perf_counter() - started
    efforts: dict[int, Effort] = {}
    for row in _increments(deck):
        before = efforts.get(row.step, Effort(0, 0))
        efforts[row.step] = Effort(before.increments + row.converged, before.iterations + row.iterations)
    errors = tuple(_errors(log.read_text(encoding="utf-8", errors="replace").splitlines()))
    return Finished(process.returncode, seconds, errors, efforts, ended)


class _Increment(NamedTuple):
    step: int
    converged: bool
    iterations: int
    share: float


def _increments(deck: Path) -> Iterator[_Increment]:
    """Yield the rows of the .sta file: step, increment, attempt (with U if abandoned), iterations and times."""
    try:
        lines = deck.with_suffix(".sta").read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:  # not started yet
        return
    for line in lines:
        parts = line.split()
        if len(parts) == 7 and parts[0].isdigit() and parts[3].isdigit():
            yield _Increment(int(parts[0]), not parts[2].endswith("U"), int(parts[3]), float(parts[5]))


def _errors(lines: list[str]) -> Iterator[str]:
    for number, line in enumerate(lines):
        if line.lstrip().startswith("*ERROR"):
            message = [line.strip()]
            for further in lines[number + 1 : number + _LINES]:
                if not further.strip() or further.lstrip().startswith("*"):
                    break
                message.append(further.strip())
            yield " ".join(message)
