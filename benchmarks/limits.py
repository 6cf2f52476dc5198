"""Memory bandwidth of this machine, and the time of kernels relative to it."""

import os
import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

# Size of each array [bytes]: much larger than any cache.
_ARRAY = 2**29
_REPEATS = 7


@dataclass(frozen=True)
class Kernel:
    """A loop to time.

    Attributes:
        name: name in the table.
        run: runs it once.
        bytes_moved: bytes that must move: each input and each output once. Repeated reads from cache, and reads of
            cache lines before they are written, do not count.
    """

    name: str
    run: Callable[[], object]
    bytes_moved: int


@dataclass(frozen=True)
class Moved:
    """Median time of several runs of a kernel [s], and the bytes that it must move."""

    name: str
    seconds: float
    bytes_moved: int

    def over(self, bandwidth: float) -> float:
        """Return the time relative to that of moving the bytes at `bandwidth` [bytes/s]."""
        return self.seconds * bandwidth / self.bytes_moved


def measure(kernel: Kernel, repeats: int = _REPEATS) -> Moved:
    """Return the time of a kernel after a warm-up run."""
    kernel.run()
    return Moved(kernel.name, statistics.median(_timed(kernel.run) for _ in range(repeats)), kernel.bytes_moved)


def bandwidth() -> dict[str, float]:
    """Return the bandwidth [bytes/s] of reading and of copying, by one thread and by all: the best of several runs.

    Of a copy, both bytes read and bytes written count.
    """
    n, cores = _ARRAY // 8, os.cpu_count() or 1
    source, target = np.ones(n), np.zeros(n)
    found = {}
    with ThreadPoolExecutor(cores) as pool:
        for threads in sorted({1, cores}):
            sources, targets = np.array_split(source, threads), np.array_split(target, threads)
            for name, function, arrays, moved in (
                ("read", np.sum, (sources,), source.nbytes),
                ("copy", np.copyto, (targets, sources), 2 * source.nbytes),
            ):
                run = partial(_all, pool, function, arrays)
                best = min(_timed(run) for _ in range(_REPEATS))
                found[f"{name}, {threads} thread{'s' * (threads > 1)}"] = moved / best
    return found


def _all(pool: ThreadPoolExecutor, function: Callable[..., object], arrays: Sequence[list[np.ndarray]]) -> None:
    """Call a function on pieces of arrays, each in a thread."""
    list(pool.map(function, *arrays))


def _timed(function: Callable[[], object]) -> float:
    """Return the wall time of a call [s]."""
    started = time.perf_counter()
    function()
    return time.perf_counter() - started
