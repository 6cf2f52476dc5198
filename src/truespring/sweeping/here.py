"""Solve points in this process, as long as that takes less time than starting workers."""

import time
from collections.abc import Callable, Hashable, Iterator, Mapping
from typing import Any, TypeVar

from truespring.sweeping.pool import Failure, Guarded

Key = TypeVar("Key", bound=Hashable)

#: Time that starting workers takes: measured 3.1 to 3.6 s on two cores [s].
START = 3.0


def run_here(
    points: Mapping[Key, Any], task: Callable[[Any], Any], workers: int, threads: int
) -> Iterator[tuple[Key, Any | Failure]]:
    """Yield key and result, or Failure, of task(value) in the order of the points.

    Stop after two points or more if `workers` processes would solve the others faster, their start included. The first
    point may load compiled kernels, so the fastest one counts.
    """
    guarded = Guarded(task, threads, None)
    fastest = float("inf")
    for done, (key, value) in enumerate(points.items()):
        alone = (len(points) - done) * fastest
        if done > 1 and alone - alone / workers > START:
            return
        started = time.perf_counter()
        outcome = guarded(value)
        fastest = min(fastest, time.perf_counter() - started)
        yield key, outcome
