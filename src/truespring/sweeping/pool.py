"""Solve independent points on a Dask cluster, with recovery from workers and schedulers that die."""

import itertools
import logging
import os
import queue
import threading
import time
import warnings
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from types import TracebackType
from typing import Any, TypeVar

from truespring.errors import TruespringError
from truespring.sweeping.cluster import LocalCluster

Key = TypeVar("Key", bound=Hashable)

#: Called with messages on the cluster: a scheduler is lost, or has no workers.
Note = Callable[[str], None]

# Interval of checks of the scheduler while no point is finished [s].
_LOOK = 0.5

#: Time limit of the first connection to a scheduler [s].
FIRST_PATIENCE = 10.0

# Largest number of restarts of the local cluster in a row without a solved point.
_MOST_STARTS = 5


@dataclass(frozen=True, slots=True)
class Failure:
    """A point without result, and the reason."""

    reason: str


class _LostError(Exception):
    """The scheduler has died or cannot be reached."""


class Pool:
    """Workers of this machine or of a cluster that solve points; a context manager.

    If a worker dies, another one solves its point. A point that kills its workers is a Failure. If the local scheduler
    dies it is restarted; an external one is waited for up to `patience` seconds. Only points without result are solved
    again.

    Args:
        workers: number of processes on this machine, by default the number of cores.
        scheduler: address of a Dask cluster to use instead, such as "tcp://10.0.0.1:8786".
        threads: threads of BLAS and of the compiled loops in each worker.
        patience: time limit to reconnect to a scheduler [s].
        timeout: time limit of one point, after which its worker is killed [s]; None is no limit.
        note: called with messages on the cluster.
    """

    def __init__(
        self,
        workers: int | None = None,
        scheduler: str | None = None,
        *,
        threads: int = 1,
        patience: float = 60.0,
        timeout: float | None = None,
        note: Note | None = None,
    ) -> None:
        """Start the workers or connect to the scheduler; raise TruespringError if that fails."""
        require_dask()
        check_workers(workers, scheduler)
        self.scheduler, self.threads, self.patience, self.timeout = scheduler, threads, patience, timeout
        self.workers = workers
        self._note = note or (lambda _: None)
        self._cluster: LocalCluster | None = None
        self._client: Any = None  # a distributed.Client, whose methods have no types
        self._waiting = False
        self._rounds = itertools.count()
        self._quiet = _Quiet()
        self._connect(FIRST_PATIENCE if scheduler else patience)

    def __enter__(self) -> "Pool":
        """Return the pool."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the pool."""
        self.close()

    def close(self) -> None:
        """Disconnect from the cluster; end a local one."""
        if self._client is not None:
            with suppress(Exception):  # errors of a connection that is closed do not matter
                self._client.close(timeout=2)
            self._client = None
        if self._cluster is not None:
            self._cluster.close()
            self._cluster = None
        self._quiet.end()

    @property
    def pids(self) -> tuple[int, ...]:
        """Process ids of the local cluster: scheduler, then workers; empty for an external cluster."""
        if self._cluster is None or self._client is None:
            return ()
        return (self._cluster.pid, *self._client.run(os.getpid).values())

    def run(self, points: Mapping[Key, Any], task: Callable[[Any], Any]) -> Iterator[tuple[Key, Any | Failure]]:
        """Yield key and result, or Failure, of task(value) for every point, in the order in which they finish.

        Task and values are pickled to the workers, results back; an exception of the task is a Failure with its text.
        """
        left = dict(points)
        suspects: dict[Key, Any] = {}
        starts = 0
        while left:
            try:
                for key, outcome in self._round(left, task):
                    starts = 0
                    value = left.pop(key)
                    if outcome is None:
                        suspects[key] = value
                    else:
                        yield key, outcome[0]
            except _LostError:
                starts += 1
                self._reconnect(starts)
        # A point on a worker that died may not be the cause: solve each suspect alone.
        for key, value in suspects.items():
            outcome = self._alone(key, value, task)
            yield key, Failure(_KILLED) if outcome is None else outcome[0]

    def _alone(self, key: Key, value: Any, task: Callable[[Any], Any]) -> tuple[Any] | None:
        for starts in range(1, _MOST_STARTS + 1):
            try:
                ((_, outcome),) = self._round({key: value}, task)
                return outcome
            except _LostError:
                self._reconnect(starts)
        return None

    def _round(self, points: dict[Key, Any], task: Callable[[Any], Any]) -> Iterator[tuple[Key, tuple[Any] | None]]:
        """Yield the outcome of each point in a tuple, None if it is suspected of killing workers."""
        client = self._client
        if client is None or client.status != "running":
            raise _LostError
        keys = list(points)
        group = f"point-{client.id}-{next(self._rounds)}"
        ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        try:
            made = client.map(
                Guarded(task, self.threads, self.timeout),
                [points[key] for key in keys],
                key=[(group, number) for number in range(len(keys))],
                pure=False,
            )
        except (OSError, RuntimeError):
            raise _LostError from None
        futures = {future.key: key for future, key in zip(made, keys, strict=True)}
        for future in made:
            future.add_done_callback(ended.put)
        held = {future.key: future for future in made}
        del made
        try:
            while held:
                try:
                    future = ended.get(timeout=_LOOK)
                except queue.Empty:
                    self._check()
                    continue
                key, outcome = future.key, _outcome(future)
                del held[key], future  # lets the worker release its result
                yield futures[key], outcome
        finally:
            with suppress(Exception):
                client.cancel(list(held.values()))

    def _check(self) -> None:
        """Raise _LostError if the scheduler is lost; note if it has no workers."""
        gone = self._cluster is not None and not self._cluster.alive
        if gone or self._client is None or self._client.status != "running":
            raise _LostError
        if self.scheduler is not None and not self._waiting and not self._client.scheduler_info()["workers"]:
            self._waiting = True
            self._note(
                f"the scheduler {self.scheduler} has no workers: waiting; start one by `dask worker {self.scheduler}`"
            )

    def _reconnect(self, starts: int) -> None:
        """Restart the local cluster, or reconnect to the external scheduler."""
        self.close()
        if self.scheduler is None:
            if starts > _MOST_STARTS:
                raise TruespringError(f"the scheduler died {starts} times without a solved point: {_KEPT}")
            self._note("the scheduler died: restarting it; solved points are kept")
            self._connect(self.patience)
            return
        self._note(f"the scheduler {self.scheduler} is lost: reconnecting for up to {self.patience:g} s")
        try:
            self._connect(self.patience)
        except TruespringError as error:
            raise TruespringError(f"{error}; {_KEPT}") from None

    def _connect(self, patience: float) -> None:
        from distributed import Client

        self._quiet.begin()
        if self.scheduler is None:
            from dask.system import CPU_COUNT

            self._cluster = LocalCluster(self.workers or CPU_COUNT)
        address = self.scheduler or (self._cluster.address if self._cluster else "")
        security = self._cluster.security if self._cluster else None
        deadline = time.monotonic() + patience
        while self._client is None:
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # of differing versions; those that matter raise errors
                    connected: Any = Client
                    timeout = max(1.0, min(5.0, deadline - time.monotonic()))
                    self._client = connected(address, timeout=timeout, security=security)
            except ValueError as error:
                raise TruespringError(
                    f"scheduler {address!r} is not an address such as tcp://10.0.0.1:8786: {error}"
                ) from None
            except (OSError, RuntimeError):
                if time.monotonic() < deadline:
                    time.sleep(0.5)
                    continue
                raise TruespringError(
                    f"scheduler {address}: no Dask scheduler answers within {patience:g} s; start one by "
                    "`dask scheduler`, or omit the address to use the cores of this machine"
                ) from None


_KEPT = "solved points are kept; the same command continues"
_KILLED = "every worker that tried it was killed: it may need more memory or time, or a library crashed"


class Guarded:
    """The task as it is run, with limits of threads and time, and errors returned as Failure."""

    def __init__(self, task: Callable[[Any], Any], threads: int, timeout: float | None) -> None:
        self.task, self.threads, self.timeout = task, threads, timeout

    def __call__(self, value: Any) -> Any:
        """Return the result of the task, or a Failure."""
        if self.timeout is None:
            return self._result(value)
        # Only ending the process stops a library that does not return; the nanny restarts the worker.
        end = threading.Timer(self.timeout, os._exit, (1,))
        end.daemon = True
        end.start()
        try:
            return self._result(value)
        finally:
            end.cancel()

    def _result(self, value: Any) -> Any:
        from threadpoolctl import threadpool_limits

        from truespring.kernels.threads import limited

        with limited(self.threads), threadpool_limits(self.threads):
            try:
                return self.task(value)
            except TruespringError as error:
                return Failure(str(error))
            except MemoryError:
                return Failure("out of memory: use fewer elements")
            except Exception as error:
                return Failure(f"{type(error).__name__}: {error}")


def _outcome(future: Any) -> tuple[Any] | None:
    """Return the result of a finished future in a tuple; None if workers died at it."""
    from distributed import CancelledError, KilledWorker

    try:
        return (future.result(),)
    except KilledWorker:
        return None
    except (CancelledError, OSError):
        raise _LostError from None
    except Exception as error:  # not of the task: it cannot be pickled, or a worker lacks a package
        return (Failure(f"a worker could not run it: {type(error).__name__}: {error}"),)


class _Quiet:
    """Silence Dask's log messages on closed connections, which are handled here."""

    _LOGGERS = ("distributed", "distributed.client", "distributed.core", "distributed.comm", "distributed.batched")

    def __init__(self) -> None:
        self._former: dict[str, int] = {}

    def begin(self) -> None:
        for name in self._LOGGERS:
            self._former.setdefault(name, logging.getLogger(name).level)
            logging.getLogger(name).setLevel(logging.CRITICAL)

    def end(self) -> None:
        for name, level in self._former.items():
            logging.getLogger(name).setLevel(level)
        self._former.clear()


def check_workers(workers: int | None, scheduler: str | None) -> None:
    """Raise TruespringError if both are given, or if there are less than one worker."""
    if workers is not None and scheduler is not None:
        raise TruespringError("workers and scheduler are given: a cluster has its own workers; give one of them")
    if workers is not None and workers < 1:
        raise TruespringError(f"workers = {workers}: it must be at least 1, or None for the number of cores")


def require_dask() -> None:
    """Raise TruespringError if a package that sweeps need is not installed; import none of them."""
    for name in ("cryptography", "distributed", "polars"):
        if find_spec(name) is None:
            raise TruespringError(f"{name} is not installed, sweeps need it: pip install 'truespring[sweep]'")
