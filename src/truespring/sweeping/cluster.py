"""A cluster of this machine, in a process of its own: it ends with the process that started it, however that ends.

`python -m truespring.sweeping.cluster N` starts a Dask scheduler and N workers of one thread each, writes the
scheduler's address to standard output, and stops at the end of its standard input.
"""

import asyncio
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import IO

from truespring.errors import TruespringError

# What numerical libraries read when they are loaded: workers are as many as the cores, so each keeps to one.
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


class LocalCluster:
    """Scheduler and workers on this machine.

    Attributes:
        address: where the scheduler listens.
        pid: of the process that holds the scheduler and watches over its workers, which are its children.
    """

    def __init__(self, workers: int) -> None:
        """Start it; raise TruespringError with what it said where it does not come up."""
        self._said: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 (as long as the cluster)
        command = [sys.executable, "-P", "-m", "truespring.sweeping.cluster", str(workers)]
        paths = os.pathsep.join(path or str(Path.cwd()) for path in sys.path)  # what is found here is found there
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            env={**os.environ, **_ONE_THREAD, "PYTHONPATH": paths},
        )
        self.pid = self._process.pid
        assert self._process.stdout is not None
        self.address = self._process.stdout.readline().decode().strip()
        if not self.address:
            self._process.wait()
            self._said.seek(0)
            told = self._said.read().decode(errors="replace").strip().splitlines()
            raise TruespringError(f"the workers of this machine did not start: {told[-1] if told else 'no word'}")

    @property
    def alive(self) -> bool:
        """Whether its process still runs."""
        return self._process.poll() is None

    def close(self) -> None:
        """End it and all of its workers."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._said.close()


async def _serve(workers: int) -> None:
    import dask
    from distributed import LocalCluster as DaskCluster

    # A worker gets the next point when it has done one: whoever waits at a worker that dies is not blamed for it.
    dask.config.set({"distributed.scheduler.worker-saturation": 1.0, "distributed.scheduler.allowed-failures": 2})
    cluster = DaskCluster(  # type: ignore[no-untyped-call]
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        dashboard_address=None,
        memory_limit=0,
        asynchronous=True,
    )
    async with cluster:
        sys.stdout.write(f"{cluster.scheduler_address}\n")
        sys.stdout.flush()
        await asyncio.to_thread(sys.stdin.buffer.read)  # until whoever started it closes it, or is no more


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all; who started us then closes us
    asyncio.run(_serve(int(sys.argv[1])))
