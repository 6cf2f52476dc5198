"""The limit: how fast this machine's memory is, and how near to it compiled loops come that do little but move it."""

import os
import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

# Of each array [bytes]: far larger than any cache.
_ARRAY = 2**29
_REPEATS = 7


@dataclass(frozen=True)
class Kernel:
    """A loop to be timed: `run` does it once, and has to move `bytes_moved` to and from memory to do so.

    What must move is every input once and every output once; what an input or output that fits into a
    cache is read again is not counted, nor what the hardware reads of a line before it is written.
    """

    name: str
    run: Callable[[], object]
    bytes_moved: int


@dataclass(frozen=True)
class Moved:
    """What a kernel took: the median of several runs [s], and the bytes it must move."""

    name: str
    seconds: float
    bytes_moved: int

    def over(self, bandwidth: float) -> float:
        """How many times longer than the bytes alone at `bandwidth` [bytes/s]."""
        return self.seconds * bandwidth / self.bytes_moved


def measure(kernel: Kernel, repeats: int = _REPEATS) -> Moved:
    """Time a kernel, after a run that is not counted."""
    kernel.run()
    return Moved(kernel.name, statistics.median(_timed(kernel.run) for _ in range(repeats)), kernel.bytes_moved)


def bandwidth() -> dict[str, float]:
    """Return the bytes a second that can be read, and read and written, by one thread and by all: the best of several.

    Of a copy both what is read and what is written counts.
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
    """Call a function on the pieces of arrays, each in a thread."""
    list(pool.map(function, *arrays))


def _timed(function: Callable[[], object]) -> float:
    started = time.perf_counter()
    function()
    return time.perf_counter() - started
