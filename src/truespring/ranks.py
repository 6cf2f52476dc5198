"""Processes that share the work on one body: their sums, and the nodes that each of them owns."""

import pickle
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from truespring.arrays import Floats, Ints, ShortInts

_Made = TypeVar("_Made")

# A process that raised an exception waits so long for the same one on the others [s].
_PATIENCE = 5.0


class Communicator(Protocol):
    """Processes that run the same calls in the same order; each function returns the same on all of them.

    Attributes:
        rank: number of this process, from 0.
        size: number of processes.
        handle: communicator of mpi4py, None of one process without MPI.
    """

    rank: int
    size: int
    handle: Any

    def sum(self, value: float) -> float:
        """Return the sum of a number over the processes, in the order of the ranks."""
        ...

    def largest(self, value: float) -> float:
        """Return the largest of a number over the processes."""
        ...

    def first(self, value: float) -> float:
        """Return the number of the first process: for decisions on numbers that may differ by rounding errors."""
        ...

    def joined(self, values: Floats) -> Floats:
        """Return the sum of arrays of the same shape, exact where all but one process have zero."""
        ...

    def together(self, work: Callable[[], _Made]) -> _Made:
        """Return what `work` returns on this process; if it raises an exception on one, raise that on all.

        `work` must exchange nothing: the other processes would wait for the one that raised.
        """
        ...

    def is_on_all(self, error: BaseException) -> bool:
        """Return whether all processes raise an exception of this class, and call this function, within seconds."""
        ...


class OneProcess:
    """A process alone."""

    rank, size, handle = 0, 1, None

    def sum(self, value: float) -> float:
        """Return the value."""
        return value

    def largest(self, value: float) -> float:
        """Return the value."""
        return value

    def first(self, value: float) -> float:
        """Return the value."""
        return value

    def joined(self, values: Floats) -> Floats:
        """Return the array."""
        return values

    def together(self, work: Callable[[], _Made]) -> _Made:
        """Return what `work` returns."""
        return work()

    def is_on_all(self, error: BaseException) -> bool:
        """Return True."""
        return True


#: The communicator of a process alone.
ALONE: Communicator = OneProcess()


class Processes:
    """Processes of a communicator of mpi4py."""

    def __init__(self, handle: Any) -> None:
        """Store the communicator, and duplicate it for comparing exceptions; all processes call this."""
        self.handle, self._aside = handle, handle.Dup()
        self.rank, self.size = int(handle.rank), int(handle.size)

    def sum(self, value: float) -> float:
        """Return the sum over the processes, in the order of the ranks, so that it is the same on all."""
        return float(sum(self._gathered(value).tolist()))

    def largest(self, value: float) -> float:
        """Return the largest value of the processes."""
        return float(self._gathered(value).max())

    def first(self, value: float) -> float:
        """Return the value of the first process."""
        return float(self._gathered(value)[0])

    def _gathered(self, value: float) -> Floats:
        """Return the values of the processes, shape (size,)."""
        found = np.empty(self.size)
        self.handle.Allgather(np.array([float(value)]), found)
        return found

    def joined(self, values: Floats) -> Floats:
        """Return the sum of the arrays of the processes."""
        found = np.empty(values.shape)
        self.handle.Allreduce(np.ascontiguousarray(values), found)
        return found

    def together(self, work: Callable[[], _Made]) -> _Made:
        """Return what `work` returns, or raise the exception of the lowest rank with one."""
        made, own = [], None
        try:
            made.append(work())
        except Exception as error:  # any: the other processes wait for this one
            own = error
        errors = self.handle.allgather(None if own is None else _portable(own))
        raised = next((error for error in errors if error is not None), None)
        if raised is not None:
            raise raised from own
        return made[0]

    def is_on_all(self, error: BaseException) -> bool:
        """Return whether all processes call this with an exception of the same class within seconds."""
        name = f"{type(error).__module__}.{type(error).__qualname__}"
        own, found = np.array([zlib.crc32(name.encode())]), np.empty(self.size, np.int64)
        request = self._aside.Iallgather(own, found)
        until = time.monotonic() + _PATIENCE
        while not request.Test():
            if time.monotonic() > until:
                return False
            time.sleep(0.01)
        return bool((found == own).all())


def _portable(error: Exception) -> Exception:
    """Return an exception that other processes can read."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # of any class, whose arguments may differ from those of its constructor
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


@cache
def started_processes() -> Communicator:
    """Return the processes that mpiexec has started, or that of this process alone."""
    from mpi4py import MPI

    return Processes(MPI.COMM_WORLD) if MPI.COMM_WORLD.size > 1 else ALONE


@dataclass(frozen=True, eq=False)
class Layout:
    """The nodes that each process owns.

    Attributes:
        ranks: the processes.
        owner: rank of the process that owns each node, shape (n_nodes,).
    """

    ranks: Communicator
    owner: ShortInts

    @cached_property
    def owned(self) -> Ints:
        """Nodes of this process, ascending, shape (n_owned,)."""
        return np.flatnonzero(self.owner == self.ranks.rank)

    @cached_property
    def numbers(self) -> ShortInts:
        """Number of each node in an order in which each process owns a range, shape (n_nodes,)."""
        numbers = np.empty(len(self.owner), np.int32)
        numbers[np.argsort(self.owner, kind="stable")] = np.arange(len(self.owner), dtype=np.int32)
        return numbers


def layout_alone(n_nodes: int) -> Layout:
    """Return the layout in which one process owns all nodes."""
    return Layout(ALONE, np.zeros(n_nodes, np.int32))


def bisected(nodes: Floats, n_parts: int) -> ShortInts:
    """Return the part of each node, shape (n_nodes,), by recursive bisection across the longest side of each part.

    `nodes` [m] has shape (n_nodes, dim), with at least one node for each part. Parts are equally large. Source: Berger
    and Bokhari, IEEE Trans. Comput. 36 (1987).
    """
    found = np.zeros(len(nodes), np.int32)

    def divide(numbers: Ints, first: int, n: int) -> None:
        """Number the parts of some nodes from `first` on."""
        if n == 1:
            found[numbers] = first
            return
        axis = int(np.ptp(nodes[numbers], axis=0).argmax())
        order = numbers[np.argsort(nodes[numbers, axis], kind="stable")]
        cut = len(numbers) * (n // 2) // n
        divide(np.sort(order[:cut]), first, n // 2)
        divide(np.sort(order[cut:]), first + n // 2, n - n // 2)

    divide(np.arange(len(nodes)), 0, n_parts)
    return found


@runtime_checkable
class Shared(Protocol):
    """A potential whose elements are shared among processes; its tangent has the rows of the own nodes only."""

    @property
    def layout(self) -> Layout:
        """The nodes of each process."""
        ...


def layout_of(potential: object) -> Layout | None:
    """Return the layout of a potential that processes share, None of another."""
    return potential.layout if isinstance(potential, Shared) else None


def ranks_of(potential: object) -> Communicator:
    """Return the processes that share a potential."""
    layout = layout_of(potential)
    return ALONE if layout is None else layout.ranks
