"""Ten minutes of a live session."""

import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import psutil
import pytest

from tests.test_live_loop import loop_of
from truespring.live.guest import Guest, Names
from truespring.live.orders import MOST, Order

# Duration [s], and memory that may be added after the first minute [bytes]: commands are kept to be repeated.
SOAK, GROWN = 600.0, 20e6


@pytest.mark.verification
def test_ten_minutes_with_a_slow_page() -> None:
    """Memory stays flat, simulated and real time stay together, and no queue grows while a page answers nothing."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:  # in a process without other tests' memory
        alone.submit(soak, SOAK).result()


def soak(duration: float) -> None:
    """Pull to and fro for a duration [s]; raise AssertionError for what grows."""
    loop, process = loop_of(clock=None), psutil.Process()
    slow = Guest(loop, Names(), owner=True)
    loop.start()
    loop.ask(Order("pull", "pull 1", node=0))
    begin, first = time.monotonic(), None
    while (passed := time.monotonic() - begin) < duration:
        x, y = loop.live.grasps["pull 1"].at if loop.latest.marks else (0.0, 0.0)
        loop.ask(Order("move", "pull 1", (x, y + 1e-3 * (round(passed) % 2))))
        slow.due()
        assert len(loop.orders) <= MOST and len(loop.ring) < 400
        if first is None and passed > min(60.0, duration / 2):
            first = process.memory_info().rss, loop.latest.time, passed
        time.sleep(0.02)
    loop.stop()
    assert first is not None
    memory, simulated, at = first
    assert process.memory_info().rss - memory < GROWN
    assert loop.latest.time - simulated <= 1.01 * (passed - at)  # never ahead of the clock; behind on a busy machine
    assert slow._sent == 3 and not loop.messages
