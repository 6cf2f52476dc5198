"""A cluster of this machine, in a process of its own: it ends with the process that started it, however that ends.

That process starts a Dask scheduler and workers of one thread each, writes the scheduler's address to its standard
output, and stops at the end of its standard input. Workers that die are started again, however often.

Whoever can connect to a Dask scheduler or worker can run code as its user. So all connections are encrypted by a key
of this cluster alone, of which they need to know: it is made for it, kept in memory, and told over standard input.
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

# What numerical libraries read when they are loaded: workers are as many as the cores, so each keeps to one.
_ONE_THREAD = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


# How often workers are looked after, and how long one may take to come back [s].
_LOOK, _PATIENCE = 1.0, 60.0


class LocalCluster:
    """Scheduler and workers on this machine.

    Attributes:
        address: where the scheduler listens.
        security: of distributed, with the key without which nobody can connect.
        pid: of the process that holds the scheduler and watches over its workers, which are its children.
    """

    def __init__(self, workers: int) -> None:
        """Start it; raise TruespringError with what it said where it does not come up."""
        certificate, key = _new_key()
        self.security = _security(certificate, key)
        self._said: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 (as long as the cluster)
        # Not -m: workers would import again what was run, and with it more than they need.
        command = [sys.executable, "-P", "-c", f"from truespring.sweeping.cluster import serve; serve({workers})"]
        paths = os.pathsep.join(path or str(Path.cwd()) for path in sys.path)  # what is found here is found there
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._said,
            env={**os.environ, **_ONE_THREAD, "PYTHONPATH": paths},
        )
        self.pid = self._process.pid
        assert self._process.stdin is not None and self._process.stdout is not None
        with suppress(BrokenPipeError):  # it ended: what it said is told below
            self._process.stdin.write(json.dumps([certificate, key]).encode() + b"\n")
            self._process.stdin.flush()
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


def serve(workers: int) -> None:
    """Be a cluster of so many workers until the end of standard input."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to all; who started us then closes us
    asyncio.run(_serve(workers))


async def _serve(workers: int) -> None:
    import dask
    from distributed import Nanny, Scheduler

    security = _security(*json.loads(sys.stdin.buffer.readline()))
    # A worker gets the next point when it has done one: whoever waits at a worker that dies is not blamed for it.
    dask.config.set({"distributed.scheduler.worker-saturation": 1.0, "distributed.scheduler.allowed-failures": 1})
    # Pages that tell of the cluster have no key: there are none.
    dask.config.set({"distributed.scheduler.http.routes": [], "distributed.worker.http.routes": []})

    async def nanny() -> Any:
        return await Nanny(scheduler.address, nthreads=1, host="127.0.0.1", memory_limit=0, security=security)

    async with Scheduler(host="127.0.0.1", port=0, dashboard=False, security=security) as scheduler:
        nannies = [_Watched(one) for one in await asyncio.gather(*(nanny() for _ in range(workers)))]
        sys.stdout.write(f"{scheduler.address}\n")
        sys.stdout.flush()
        ended = asyncio.create_task(asyncio.to_thread(sys.stdin.buffer.read))  # who started us closes it, or is no more
        while not ended.done():
            await asyncio.wait([ended], timeout=_LOOK)
            for place, one in enumerate(nannies):
                if one.gave_up():
                    with suppress(Exception):  # on a busy machine it may fail: it is tried again at the next look
                        await one.nanny.close(timeout=1)
                        nannies[place] = _Watched(await nanny())
        await asyncio.gather(*(one.nanny.close(timeout=2) for one in nannies), return_exceptions=True)


def _new_key() -> tuple[str, str]:
    """A certificate and its key, made for one cluster."""
    from distributed import Security

    make: Any = Security.temporary  # its methods have no types
    made = make()
    return made.tls_ca_file, made.tls_client_key


def _security(certificate: str, key: str) -> Any:
    """What takes connections of holders of the key only, and makes such, for every part of a cluster."""
    from distributed import Security

    make: Any = Security
    certificates = {f"tls_{part}_cert": certificate for part in _PARTS}
    keys = {f"tls_{part}_key": key for part in _PARTS}
    return make(require_encryption=True, tls_ca_file=certificate, **certificates, **keys)


_PARTS = ("client", "scheduler", "worker")


class _Watched:
    """A nanny, which starts its worker again when that dies; but gives up where one dies while it starts."""

    def __init__(self, nanny: Any) -> None:
        self.nanny, self.seen = nanny, time.monotonic()

    def gave_up(self) -> bool:
        """Whether it will not start a worker any more, or has not for long."""
        if self.nanny.is_alive():
            self.seen = time.monotonic()
        given_up = self.nanny.status.name in ("closed", "closing", "closing_gracefully", "failed")
        return given_up or time.monotonic() - self.seen > _PATIENCE
