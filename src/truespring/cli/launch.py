"""Processes that mpiexec starts: the first one prints and writes files, and all of them end together."""

import io
import os
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from truespring.errors import ProblemError

if TYPE_CHECKING:
    from truespring.study import Study

# Environment variables with the number of processes and the rank, by Open MPI, and by MPICH, Intel MPI and Slurm.
_VARIABLES = (("OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"), ("PMI_SIZE", "PMI_RANK"))
# A process that failed waits so long for the others before it ends them [s].
_PATIENCE = 5.0

#: The verb that several processes run.
SHARED_VERB = "solve"


@dataclass
class Launch:
    """How a command was started.

    Attributes:
        size, rank: number of processes that run the command, and the number of this one, from 0.
        orderly: whether the verb ended without an exception.
        messages: what a process other than the first would print on standard error.
    """

    size: int = 1
    rank: int = 0
    orderly: bool = False
    messages: io.StringIO = field(default_factory=io.StringIO)

    @contextmanager
    def silenced(self) -> Iterator[None]:
        """Keep a process other than the first from printing."""
        if self.rank == 0:
            yield
            return
        before = sys.stdout, sys.stderr
        with Path(os.devnull).open("w", encoding="utf-8") as nowhere:
            sys.stdout, sys.stderr = nowhere, self.messages
            try:
                yield
            finally:
                sys.stdout, sys.stderr = before

    def check_verb(self, verb: str) -> None:
        """Raise ProblemError if several processes were started for a verb that runs in one."""
        if self.size > 1 and verb != SHARED_VERB:
            raise ProblemError(
                f"{verb} runs in one process, mpiexec started {self.size}: remove mpiexec, or use {SHARED_VERB}"
            )

    def check_studies(self, studies: "list[Study]") -> None:
        """Raise ProblemError if the solvers of some studies do not share a body among the processes."""
        from truespring.linear import processes_of

        for study in studies:
            if self.size > 1 and study.solver.linear != "petsc":
                raise ProblemError(
                    f"{study.file}: solver.linear = '{study.solver.linear}' runs in one process, mpiexec started "
                    f"{self.size}: set linear = 'petsc', or remove mpiexec"
                )
            joined = processes_of(study.solver.linear).size
            if joined < self.size:
                raise ProblemError(
                    f"mpiexec started {self.size} processes, of which mpi4py finds {joined}: use the mpiexec of "
                    "the MPI library that mpi4py was built with"
                )
            if joined > self.size:
                known = ", ".join(size for size, _ in _VARIABLES)
                raise ProblemError(
                    f"mpi4py finds {joined} processes, but none of the environment variables {known} has their number: "
                    "start them with mpiexec, or with srun --mpi=pmi2"
                )

    def end(self, code: int) -> int:
        """Wait for the other processes and return the exit code.

        A process that failed ends the others if they do not end by themselves: they may wait for its part of a sum.
        """
        if self.size == 1:
            return code
        try:
            from mpi4py import MPI
        except (ImportError, RuntimeError):  # the error of the missing package or library has been printed
            return code
        if MPI.COMM_WORLD.size == 1:
            return code
        request = MPI.COMM_WORLD.Iallgather(bytearray([code]), found := bytearray(self.size))
        until = time.monotonic() + _PATIENCE
        while not request.Test():
            if not self.orderly and time.monotonic() > until:
                sys.stderr.write(self.messages.getvalue())
                for stream in (sys.stdout, sys.stderr):
                    with suppress(OSError, ValueError):  # its reader has ended
                        stream.flush()
                MPI.COMM_WORLD.Abort(code)
            time.sleep(0.01)
        if self.rank and code not in found[: self.rank]:
            sys.stderr.write(self.messages.getvalue())
        return code


def launch(environment: Mapping[str, str]) -> Launch:
    """Return how a command was started, from the environment variables of mpiexec."""
    for size, rank in _VARIABLES:
        if environment.get(size, "").isdecimal() and environment.get(rank, "").isdecimal():
            return Launch(int(environment[size]), int(environment[rank]))
    return Launch()
