"""Available memory, and slices of loops that limit temporary arrays."""

from collections.abc import Iterator
from pathlib import Path

import psutil

# Limit on the temporary arrays of one slice [bytes]: small, so that they stay in the cache.
_SLICE = 2**23

# Folder and file of the memory limit of a cgroup on Linux, for cgroups of version 2 and of version 1.
_CGROUPS = (("sys/fs/cgroup", "memory.max"), ("sys/fs/cgroup/memory", "memory.limit_in_bytes"))


def available_memory() -> int:
    """Return the memory that this process may use [bytes]: that of the machine, or a lower limit of its cgroup."""
    return min([int(psutil.virtual_memory().total), *_cgroup_limits(Path("/"))])


def _cgroup_limits(root: Path) -> list[int]:
    """Return the memory limits of the cgroup of this process and of its parents [bytes]; `root` is the root folder."""
    try:
        lines = (root / "proc/self/cgroup").read_text(encoding="utf-8").splitlines()
    except OSError:
        return []  # not Linux
    found = []
    for _, controllers, path in (line.split(":", 2) for line in lines if line.count(":") >= 2):
        if controllers and "memory" not in controllers.split(","):
            continue
        mount, name = _CGROUPS[bool(controllers)]
        own = Path(path.lstrip("/"))
        for group in (own, *own.parents):  # in a container the path may be that of the host: try the root too
            try:
                limit = (root / mount / group / name).read_text(encoding="utf-8").strip()
            except OSError:
                continue
            found += [int(limit)] if limit.isdecimal() else []  # else "max": no limit
    return found


def slices(n: int, bytes_each: float) -> Iterator[slice]:
    """Yield slices that cover range(n), such that `bytes_each` bytes per item fit the limit of a slice."""
    step = max(1, int(_SLICE / bytes_each))
    for first in range(0, n, step):
        yield slice(first, min(first + step, n))
