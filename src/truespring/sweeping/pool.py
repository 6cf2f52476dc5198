"""Independent points on a Dask cluster: each is solved, or its failure is told, whatever dies meanwhile."""

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
from types import TracebackType
from typing import Any, TypeVar

from truespring.errors import TruespringError
from truespring.sweeping.cluster import LocalCluster

Key = TypeVar("Key", bound=Hashable)

#: Told in words what goes on beside the points: a scheduler that is lost, workers that are waited for.
Report = Callable[[str], None]

# How often it is looked whether the scheduler still lives, while no point comes in [s].
_LOOK = 0.5

#: How long a scheduler may take to answer for the first time [s].
FIRST_PATIENCE = 10.0

# So many clusters of this machine in a row may die without one point solved.
_MOST_STARTS = 5


@dataclass(frozen=True, slots=True)
class Failure:
    """A point that has no result, and why."""

    reason: str


class _LostError(Exception):
    """The scheduler is no more, or cannot be reached."""


class Pool:
    """Workers that solve points, of this machine or of a cluster; closed at the end of a `with` block.

    A worker that is killed costs no point: another tries again. A point that kills its workers is a Failure. A
    scheduler of our own that dies is started anew; one of others is waited for, `patience` seconds long. Only what
    has no result yet is then solved again.

    Args:
        workers: processes on this machine, by default as many as cores.
        scheduler: address of any Dask cluster, such as "tcp://10.0.0.1:8786"; its workers are taken instead.
        threads: of BLAS and of our own kernels, in each worker.
        patience: how long a scheduler may be out of reach [s].
        timeout: after how long a worker that is still at one point is killed [s]; None is never.
        report: told in words what goes on beside the points.
    """

    def __init__(
        self,
        workers: int | None = None,
        scheduler: str | None = None,
        *,
        threads: int = 1,
        patience: float = 60.0,
        timeout: float | None = None,
        report: Report | None = None,
    ) -> None:
        """Start the workers, or connect; raise TruespringError where neither can be."""
        require_dask()
        if workers is not None and scheduler is not None:
            raise TruespringError("workers and scheduler are given: a cluster has its own workers; give one")
        if workers is not None and workers < 1:
            raise TruespringError(f"workers = {workers} is not allowed: 1 or more, or None for as many as cores")
        self.scheduler, self.threads, self.patience, self.timeout = scheduler, threads, patience, timeout
        self.workers = workers
        self._report = report or (lambda _: None)
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
        """Leave the cluster; one of our own ends."""
        if self._client is not None:
            with suppress(Exception):  # whatever is wrong with a connection, it is left
                self._client.close(timeout=2)
            self._client = None
        if self._cluster is not None:
            self._cluster.close()
            self._cluster = None
        self._quiet.end()

    @property
    def pids(self) -> tuple[int, ...]:
        """Processes of our own cluster: that of the scheduler, then the workers; none where it is of others."""
        if self._cluster is None or self._client is None:
            return ()
        return (self._cluster.pid, *self._client.run(os.getpid).values())

    def run(self, points: Mapping[Key, Any], task: Callable[[Any], Any]) -> Iterator[tuple[Key, Any | Failure]]:
        """Yield the key and the result, or the Failure, of task(value) for every point, as they end.

        Both task and values travel to the workers, results back; an exception of the task is a Failure with its text.
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
                self._again(starts)
        # Whoever was with a worker that died may not be what killed it: alone nobody else can be blamed.
        for key, value in suspects.items():
            outcome = self._alone(key, value, task)
            yield key, Failure(_KILLED) if outcome is None else outcome[0]

    def _alone(self, key: Key, value: Any, task: Callable[[Any], Any]) -> tuple[Any] | None:
        for starts in range(1, _MOST_STARTS + 1):
            try:
                ((_, outcome),) = self._round({key: value}, task)
                return outcome
            except _LostError:
                self._again(starts)
        return None

    def _round(self, points: dict[Key, Any], task: Callable[[Any], Any]) -> Iterator[tuple[Key, tuple[Any] | None]]:
        """Yield each point's outcome in a tuple, None where it is suspected of killing workers."""
        client = self._client
        if client is None or client.status != "running":
            raise _LostError
        keys = list(points)
        group = f"point-{client.id}-{next(self._rounds)}"
        ended: queue.SimpleQueue[Any] = queue.SimpleQueue()
        try:
            made = client.map(
                _Guarded(task, self.threads, self.timeout),
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
                    self._look()
                    continue
                key, outcome = future.key, _outcome(future)
                del held[key], future  # a worker may forget its result
                yield futures[key], outcome
        finally:
            with suppress(Exception):
                client.cancel(list(held.values()))

    def _look(self) -> None:
        """Raise where nothing can come in any more."""
        gone = self._cluster is not None and not self._cluster.alive
        if gone or self._client is None or self._client.status != "running":
            raise _LostError
        if self.scheduler is not None and not self._waiting and not self._client.scheduler_info()["workers"]:
            self._waiting = True
            self._report(
                f"the scheduler {self.scheduler} has no workers: waiting; `dask worker {self.scheduler}` is one"
            )

    def _again(self, starts: int) -> None:
        """Find a way back to a scheduler."""
        self.close()
        if self.scheduler is None:
            if starts > _MOST_STARTS:
                raise TruespringError(f"the scheduler died {starts} times without a point solved: {_KEPT}")
            self._report("the scheduler died: another is started, what was solved is kept")
            self._connect(self.patience)
            return
        self._report(f"the scheduler {self.scheduler} is lost: waiting for it, {self.patience:g} s at most")
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
                    warnings.simplefilter("ignore")  # versions that differ: what matters fails, and says so
                    connected: Any = Client
                    timeout = max(1.0, min(5.0, deadline - time.monotonic()))
                    self._client = connected(address, timeout=timeout, security=security)
            except ValueError as error:
                raise TruespringError(
                    f"scheduler {address!r}: is no address such as tcp://10.0.0.1:8786: {error}"
                ) from None
            except (OSError, RuntimeError):
                if time.monotonic() < deadline:
                    time.sleep(0.5)
                    continue
                raise TruespringError(
                    f"scheduler {address}: no Dask scheduler answers there within {patience:g} s; start one by "
                    "`dask scheduler`, or leave the address out to take the cores of this machine"
                ) from None


_KEPT = "what was solved is kept, and the same command goes on with it"
_KILLED = (
    "every worker that tried it was killed: perhaps it needs more memory or time than there is, or a library crashed"
)


class _Guarded:
    """The task as workers run it: threads and time limited, failures as values, which always find their way back."""

    def __init__(self, task: Callable[[Any], Any], threads: int, timeout: float | None) -> None:
        self.task, self.threads, self.timeout = task, threads, timeout

    def __call__(self, value: Any) -> Any:
        if self.timeout is None:
            return self._result(value)
        # Nothing else ends a library that does not return; whoever watches over the worker starts another one.
        end = threading.Timer(self.timeout, os._exit, (1,))
        end.daemon = True
        end.start()
        try:
            return self._result(value)
        finally:
            end.cancel()

    def _result(self, value: Any) -> Any:
        from threadpoolctl import threadpool_limits

        from truespring.kernels.threads import set_threads

        set_threads(self.threads)
        with threadpool_limits(self.threads):
            try:
                return self.task(value)
            except TruespringError as error:
                return Failure(str(error))
            except MemoryError:
                return Failure("out of memory: take fewer elements")
            except Exception as error:
                return Failure(f"{type(error).__name__}: {error}")


def _outcome(future: Any) -> tuple[Any] | None:
    """The result of a future that ended, in a tuple; None where workers died of it, or of its neighbour."""
    from distributed import CancelledError, KilledWorker

    try:
        return (future.result(),)
    except KilledWorker:
        return None
    except (CancelledError, OSError):
        raise _LostError from None
    except Exception as error:  # not of the task: it could not travel, or a worker lacks what it needs
        return (Failure(f"a worker could not run it: {type(error).__name__}: {error}"),)


class _Quiet:
    """Silences what Dask logs of connections that end: it is told as points that fail, or are solved again."""

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


def require_dask() -> None:
    """Raise TruespringError with the way out where what sweeps need is not installed."""
    try:
        import cryptography
        import distributed
        import polars
    except ImportError as error:
        raise TruespringError(
            f"{error.name} is not installed: sweeps need it; pip install 'truespring[sweep]'"
        ) from None
    del cryptography, distributed, polars
