"""Memory: how much of it this process may use, and slices of work that take little of it."""

from collections.abc import Iterator
from pathlib import Path

import psutil

# What the temporary arrays of one slice may take: little beside a body, and still within reach of a cache.
_SLICE = 2**23

# Where Linux keeps the limits of cgroups, by version, and what each calls them.
_CGROUPS = (("sys/fs/cgroup", "memory.max"), ("sys/fs/cgroup/memory", "memory.limit_in_bytes"))


def available_memory() -> int:
    """Return the memory that this process may come to use [bytes]: the machine's, or what its cgroup leaves of it."""
    return min([int(psutil.virtual_memory().total), *_cgroup_limits(Path("/"))])


def _cgroup_limits(root: Path) -> list[int]:
    """The limits that the process's cgroup and those above it set [bytes]; `root` is where the file system begins."""
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
        for group in (own, *own.parents):  # within a container the path may be that of the host: its root counts
            try:
                limit = (root / mount / group / name).read_text(encoding="utf-8").strip()
            except OSError:
                continue
            found += [int(limit)] if limit.isdecimal() else []  # else "max": no limit
    return found


def slices(n: int, bytes_each: float) -> Iterator[slice]:
    """Yield slices that cover range(n), so long that what needs `bytes_each` [bytes] for each of n stays small."""
    step = max(1, int(_SLICE / bytes_each))
    for first in range(0, n, step):
        yield slice(first, min(first + step, n))
