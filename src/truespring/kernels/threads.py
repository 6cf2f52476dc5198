"""Running kernels on several threads, and what compiling them costs."""

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import pairwise
from typing import Any, TypeVar

import numba
import numpy as np
from numba.core import event

#: Flags under which sums stay fast and stay the same: `fastmath=True` would reorder them, which is slower here.
FASTMATH = {"contract", "nsz", "arcp"}

#: How every kernel is compiled: serially, released from the interpreter's lock, kept on disk.
kernel: Callable[[Callable[..., Any]], Callable[..., Any]] = numba.njit(nogil=True, cache=True, fastmath=FASTMATH)

#: How loops over plain vectors are compiled: sums in the order of the machine's vector registers.
vector_kernel: Callable[[Callable[..., Any]], Callable[..., Any]] = numba.njit(
    nogil=True, cache=True, fastmath=FASTMATH | {"reassoc"}
)

# Pieces smaller than so many rows, springs or elements are not worth the hand-over to another thread.
_SMALLEST_PIECE = 4000

Array = TypeVar("Array", bound=np.ndarray[Any, Any])

_chosen: int | None = None


def n_threads() -> int:
    """Return how many threads kernels take: as set, else the cores that this process may use."""
    if _chosen is not None:
        return _chosen
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def set_threads(count: int | None) -> None:
    """Set how many threads kernels take; None goes back to all cores."""
    global _chosen
    _chosen = count


def pieces(n: int, smallest: int = _SMALLEST_PIECE) -> list[tuple[int, int]]:
    """Cut the range 0..n into at most one piece a thread, none smaller than `smallest` but the only one."""
    count = max(1, min(n_threads(), n // max(smallest, 1)))
    bounds = [n * piece // count for piece in range(count + 1)]
    return list(pairwise(bounds))


def run(function: Callable[..., Any], n: int, *arguments: Any, smallest: int = _SMALLEST_PIECE) -> list[Any]:
    """Call function(first, last, *arguments) on all pieces of 0..n and return what each returned, in order."""
    return run_on(pieces(n, smallest), function, *arguments)


def run_on(ranges: list[tuple[int, int]], function: Callable[..., Any], *arguments: Any) -> list[Any]:
    """Call function(first, last, *arguments) on ranges, each in a thread, and return what each returned, in order."""
    (first, *others) = ranges
    if not others or not _in_use.acquire(blocking=False):  # whoever comes second does without other threads
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


def writable(array: Array) -> Array:
    """Return a contiguous array that is not frozen: kernels are compiled anew for frozen ones."""
    writable: Array = np.require(array, requirements=["C", "W"])
    return writable


class _Worker:
    """A thread that waits for calls: two locks hand them over in a third of the time that an executor takes."""

    def __init__(self) -> None:
        self._called, self._returned = threading.Lock(), threading.Lock()
        self._called.acquire()
        self._returned.acquire()
        threading.Thread(target=self._work, name="truespring", daemon=True).start()

    def start(self, function: Callable[..., Any], *arguments: Any) -> None:
        self._call = partial(function, *arguments)
        self._called.release()

    def wait(self) -> None:
        self._returned.acquire()

    def result(self) -> Any:
        if self._error is not None:
            raise self._error
        return self._result

    def _work(self) -> None:
        while True:
            self._called.acquire()
            self._result, self._error = None, None
            try:
                self._result = self._call()
            except BaseException as error:  # raised again where it is waited for
                self._error = error
            del self._call  # and with it the arrays
            self._returned.release()


_in_use = threading.Lock()
_waiting: list[_Worker] = []


def _workers(count: int) -> list[_Worker]:
    while len(_waiting) < count:
        _waiting.append(_Worker())
    return _waiting[:count]


def _forget() -> None:
    """A process that was forked has none of the threads."""
    global _in_use
    _in_use = threading.Lock()
    _waiting.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


class _Stopwatch(event.Listener):
    """Adds up the time of events; one within another counts once."""

    def __init__(self) -> None:
        self.seconds, self._depth, self._started = 0.0, 0, 0.0

    def on_start(self, event: Any) -> None:
        if not self._depth:
            self._started = time.perf_counter()
        self._depth += 1

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if not self._depth:
            self.seconds += time.perf_counter() - self._started


@contextmanager
def compiling() -> Iterator[Callable[[], float]]:
    """Yield a function that tells the seconds spent on compiling kernels so far within the block."""
    watch = _Stopwatch()
    with event.install_listener("numba:compile", watch):
        yield lambda: watch.seconds
