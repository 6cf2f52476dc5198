"""Sweeps as processes of their own, what is killed of them, and tasks of which some fail.

Workers import this file: it takes little.
"""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil

from truespring.errors import TruespringError

# What a sweep takes of the clock, and so is not the same twice.
CLOCKED = "seconds"


def started(*arguments: object, **more: Any) -> "subprocess.Popen[str]":
    """Start `truespring sweep` at the head of a process group of its own."""
    command = [sys.executable, "-m", "truespring", "sweep", *map(str, arguments)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, **more
    )


def finished(process: "subprocess.Popen[str]", code: int = 0) -> dict[str, Any]:
    """Wait for a sweep with --json and return what it says."""
    told, errors = process.communicate(timeout=300)
    assert process.returncode == code, errors
    found: dict[str, Any] = json.loads(told)
    return found


def kill_group(process: "subprocess.Popen[str]") -> None:
    """Kill a sweep and all that it started, at once."""
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()


def records(out: Path) -> dict[str, tuple[int, int]]:
    """By name the records of points, all of them whole, and what changes when one is written again."""
    found = {}
    for file in (out / "points").glob("*.json"):
        assert json.loads(file.read_text(encoding="utf-8"))["point"] == file.stem
        found[file.stem] = (file.stat().st_ino, file.stat().st_mtime_ns)
    return found


def wait_until(holds: Callable[[], bool], seconds: float = 60.0) -> None:
    """Wait until something holds."""
    deadline = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < deadline, "it took too long"
        time.sleep(0.02)


def cluster_of(sweep: int) -> psutil.Process | None:
    """The process that holds the scheduler of a sweep, none where it has none just now."""
    for one in _children(psutil.Process(sweep)):
        if "truespring.sweeping.cluster" in " ".join(one.cmdline()):
            return one
    return None


def workers_of(sweep: int) -> list[psutil.Process]:
    """The workers of a sweep, or of a pool in a process."""
    cluster = cluster_of(sweep)
    return [] if cluster is None else [one for one in _children(cluster) if "spawn_main" in " ".join(one.cmdline())]


def _children(process: psutil.Process) -> list[psutil.Process]:
    found = []
    try:
        for one in process.children():
            if one.status() != psutil.STATUS_ZOMBIE and one.cmdline():
                found.append(one)
    except psutil.Error:
        pass
    return found


def square(number: int) -> int:
    """A task that kills its worker, or fails, at some numbers."""
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 4:
        raise ValueError("four")
    if number == 5:
        raise TruespringError("five")
    return number**2


def who(_: int) -> int:
    """A task that takes its time and tells who did it."""
    time.sleep(0.02)
    return os.getpid()


def sleep(seconds: int) -> None:
    """A task that takes so long."""
    time.sleep(seconds)


def threads(_: int) -> tuple[int, int, dict[str, str]]:
    """A task that tells the threads it has, of our own kernels and of BLAS, and the environment."""
    import numpy as np
    from threadpoolctl import threadpool_info

    from truespring.kernels.threads import n_threads

    np.linalg.norm(np.ones((2, 2)))
    return n_threads(), max(one["num_threads"] for one in threadpool_info()), dict(os.environ)


def unclocked(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Rows of a sweep without what the clock says."""
    return [{name: value for name, value in row.items() if not name.endswith(CLOCKED)} for row in rows]
