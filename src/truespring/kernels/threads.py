"""Run kernels on several threads, and measure the time of compiling them."""

import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import copy_context
from functools import cache, partial
from itertools import pairwise
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import event

#: Flags that keep sums in order: `fastmath=True` would reorder them, which is slower here and less reproducible.
FASTMATH = {"contract", "nsz", "arcp"}

#: Decorator of kernels: compiled without parallel loops, without the interpreter lock, and cached on disk.
kernel: Callable[[Callable[..., Any]], Callable[..., Any]] = numba.njit(nogil=True, cache=True, fastmath=FASTMATH)

#: Decorator of loops over plain vectors, whose sums may be reordered for vector registers.
vector_kernel: Callable[[Callable[..., Any]], Callable[..., Any]] = numba.njit(
    nogil=True, cache=True, fastmath=FASTMATH | {"reassoc"}
)

# Smallest number of rows, springs or elements that is worth another thread.
_SMALLEST_PIECE = 4000

Array = TypeVar("Array", bound=np.ndarray[Any, Any])
Item = TypeVar("Item")
Result = TypeVar("Result")

_chosen: int | None = None


def n_threads() -> int:
    """Return the number of threads of kernels: as set, else the cores that this process may use."""
    if _chosen is not None:
        return _chosen
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def set_threads(count: int | None) -> None:
    """Set the number of threads of kernels; None uses all cores."""
    global _chosen
    _chosen = count


@contextmanager
def limited(count: int | None) -> Iterator[None]:
    """Set the number of threads of kernels within the block; None uses all cores."""
    former = _chosen
    set_threads(count)
    try:
        yield
    finally:
        set_threads(former)


def pieces(n: int, smallest: int = _SMALLEST_PIECE) -> list[tuple[int, int]]:
    """Return ranges that divide 0..n, at most one per thread, each of at least `smallest` unless it is the only one."""
    count = max(1, min(n_threads(), n // max(smallest, 1)))
    bounds = [n * piece // count for piece in range(count + 1)]
    return list(pairwise(bounds))


def run(function: Callable[..., Any], n: int, *arguments: Any, smallest: int = _SMALLEST_PIECE) -> list[Any]:
    """Call function(first, last, *arguments) on all pieces of 0..n; return the results in order."""
    return run_on(pieces(n, smallest), function, *arguments)


def run_on(ranges: list[tuple[int, int]], function: Callable[..., Any], *arguments: Any) -> list[Any]:
    """Call function(first, last, *arguments) on ranges, each in a thread; return the results in order."""
    (first, *others) = ranges
    if not others or not _in_use.acquire(blocking=False):  # a second caller runs without other threads
        return [function(*piece, *arguments) for piece in (first, *others)]
    try:
        workers = _workers(len(others))
        for worker, piece in zip(workers, others, strict=True):
            worker.start(function, *piece, *arguments)
        try:
            found = [function(*first, *arguments)]
        finally:
            for worker in workers:
                worker.wait()
        return found + [worker.result() for worker in workers]
    finally:
        _in_use.release()


def computed(function: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[Result]:
    """Yield function(item) of all items in order; each thread computes one, and then all are yielded."""
    step = n_threads()

    def some(begin: int, end: int, first: int) -> list[Result]:
        return [function(item) for item in items[first + begin : first + end]]

    for first in range(0, len(items), step):
        for results in run(some, min(step, len(items) - first), first, smallest=1):
            yield from results


def writable(array: Array) -> Array:
    """Return a contiguous, writable array, same shape and unit: numba compiles again for read-only arrays."""
    writable: Array = np.require(array, requirements=["C", "W"])
    return writable


class _Worker:
    """A thread that waits for calls; its two locks take a third of the time of an executor."""

    def __init__(self) -> None:
        self._called, self._returned = threading.Lock(), threading.Lock()
        self._called.acquire()
        self._returned.acquire()
        threading.Thread(target=self._work, name="truespring", daemon=True).start()

    def start(self, function: Callable[..., Any], *arguments: Any) -> None:
        """Start a call in the thread."""
        self._call = partial(copy_context().run, function, *arguments)  # with NumPy's settings of warnings
        self._called.release()

    def wait(self) -> None:
        """Wait until the call has ended."""
        self._returned.acquire()

    def result(self) -> Any:
        """Return the result of the last call, or raise its exception."""
        if self._error is not None:
            raise self._error
        return self._result

    def _work(self) -> None:
        """Execute calls, one after the other, until the process ends."""
        while True:
            self._called.acquire()
            self._result, self._error = None, None
            try:
                self._result = self._call()
            except BaseException as error:  # `result` raises it
                self._error = error
            del self._call  # frees the arrays
            self._returned.release()


_in_use = threading.Lock()
_waiting: list[_Worker] = []


def _workers(count: int) -> list[_Worker]:
    """Return threads that wait for calls, starting them if needed."""
    while len(_waiting) < count:
        _waiting.append(_Worker())
    return _waiting[:count]


def _forget() -> None:
    """Discard the threads: a forked process does not have them."""
    global _in_use
    _in_use = threading.Lock()
    _waiting.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


class _Stopwatch(event.Listener):
    """Add up the time of events; nested events count once."""

    def __init__(self) -> None:
        self.seconds, self._depth, self._started = 0.0, 0, 0.0

    def on_start(self, event: Any) -> None:
        """Start the clock, unless within another event."""
        if not self._depth:
            self._started = time.perf_counter()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        """Stop the clock, unless within another event."""
        self._depth -= 1
        if not self._depth:
            self.seconds += time.perf_counter() - self._started


@cache
def _libraries() -> Any:
    """Return the controller of the threads of numerical libraries; finding them takes milliseconds."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


# The limit is that of the process: held by one thread at a time, so that each restores what was there before.
_limiting = threading.RLock()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Limit numerical libraries to one thread within the block.

    Their threads wait for each other in loops, which takes longer than the work on small matrices.
    """
    with _limiting, _libraries().limit(limits=1):
        yield


@contextmanager
def compiling() -> Iterator[Callable[[], float]]:
    """Yield a function that returns the time spent on compiling kernels within the block so far [s]."""
    watch = _Stopwatch()
    with event.install_listener("numba:compile", watch):
        yield lambda: watch.seconds
