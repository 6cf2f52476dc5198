"""A Dask cluster on this machine, in a child process that ends with its parent.

The child starts a scheduler and workers of one thread each, writes the scheduler's address to its standard output, and
stops at the end of its standard input. Workers that die are restarted.

Anyone who can connect to a Dask scheduler or worker can run code as its user. Therefore all connections are encrypted
and authenticated by a key that is made for each cluster, kept in memory and passed over standard input.
"""

import asyncio
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from truespring.errors import TruespringError

# Environment variables that limit numerical libraries to one thread; there are as many workers as cores.
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


# Interval of checks of the workers, and time limit of a restart [s].
_LOOK, _PATIENCE = 1.0, 60.0


class LocalCluster:
    """Scheduler and workers on this machine.

    Attributes:
        address: address of the scheduler.
        security: distributed.Security with the key of the cluster.
        pid: of the child process, the parent of the workers.
    """

    def __init__(self, workers: int) -> None:
        """Start the cluster; raise TruespringError with the last line of its output if it does not start."""
        certificate, key = _new_key()
        self.security = _security(certificate, key)
        self._errors: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 (as long as the cluster)
        # Not -m: workers would import again what was run, and with it more than they need.
        command = [sys.executable, "-P", "-c", f"from truespring.sweeping.cluster import serve; serve({workers})"]
        paths = os.pathsep.join(path or str(Path.cwd()) for path in sys.path)  # same modules as here
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env={**os.environ, **_ONE_THREAD, "PYTHONPATH": paths},
        )
        self.pid = self._process.pid
        assert self._process.stdin is not None and self._process.stdout is not None
        with suppress(BrokenPipeError):  # it has ended: its error is reported below
            self._process.stdin.write(json.dumps([certificate, key]).encode() + b"\n")
            self._process.stdin.flush()
        self.address = self._process.stdout.readline().decode().strip()
        if not self.address:
            self._process.wait()
            self._errors.seek(0)
            lines = self._errors.read().decode(errors="replace").strip().splitlines()
            raise TruespringError(f"the workers of this machine did not start: {lines[-1] if lines else 'no message'}")

    @property
    def alive(self) -> bool:
        """Whether the process is running."""
        return self._process.poll() is None

    def close(self) -> None:
        """End the process and all of its workers."""
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._errors.close()


def serve(workers: int) -> None:
    """Run a cluster with `workers` workers until the end of standard input."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all processes; the parent closes this one
    asyncio.run(_serve(workers))


async def _serve(workers: int) -> None:
    import dask
    from distributed import Nanny, Scheduler

    security = _security(*json.loads(sys.stdin.buffer.readline()))
    # A worker gets its next point when it has finished one, so that no waiting point is suspected if the worker dies.
    dask.config.set({"distributed.scheduler.worker-saturation": 1.0, "distributed.scheduler.allowed-failures": 1})
    # No status pages: they would be served without the key.
    dask.config.set({"distributed.scheduler.http.routes": [], "distributed.worker.http.routes": []})

    async def nanny() -> Any:
        return await Nanny(scheduler.address, nthreads=1, host="127.0.0.1", memory_limit=0, security=security)

    async with Scheduler(host="127.0.0.1", port=0, dashboard=False, security=security) as scheduler:
        nannies = [_Watched(one) for one in await asyncio.gather(*(nanny() for _ in range(workers)))]
        sys.stdout.write(f"{scheduler.address}\n")
        sys.stdout.flush()
        ended = asyncio.create_task(asyncio.to_thread(sys.stdin.buffer.read))  # ends when the parent closes it or dies
        while not ended.done():
            await asyncio.wait([ended], timeout=_LOOK)
            for place, one in enumerate(nannies):
                if one.gave_up():
                    with suppress(Exception):  # may fail on a busy machine; tried again at the next check
                        await one.nanny.close(timeout=1)
                        nannies[place] = _Watched(await nanny())
        await asyncio.gather(*(one.nanny.close(timeout=2) for one in nannies), return_exceptions=True)


def _new_key() -> tuple[str, str]:
    """Return a new certificate and its key."""
    from distributed import Security

    make: Any = Security.temporary  # its methods have no types
    made = make()
    return made.tls_ca_file, made.tls_client_key


def _security(certificate: str, key: str) -> Any:
    """Return the distributed.Security of all parts of a cluster with this key."""
    from distributed import Security

    make: Any = Security
    certificates = {f"tls_{part}_cert": certificate for part in _PARTS}
    keys = {f"tls_{part}_key": key for part in _PARTS}
    return make(require_encryption=True, tls_ca_file=certificate, **certificates, **keys)


_PARTS = ("client", "scheduler", "worker")


class _Watched:
    """A nanny, which restarts its worker when it dies, but gives up if the worker dies while it starts."""

    def __init__(self, nanny: Any) -> None:
        self.nanny, self.seen = nanny, time.monotonic()

    def gave_up(self) -> bool:
        """Return whether the nanny has stopped, or its worker has not been alive for too long."""
        if self.nanny.is_alive():
            self.seen = time.monotonic()
        given_up = self.nanny.status.name in ("closed", "closing", "closing_gracefully", "failed")
        return given_up or time.monotonic() - self.seen > _PATIENCE
