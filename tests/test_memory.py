"""How much memory there is by what the system says, work in slices, and answers that do not outlive their object."""

import gc
import weakref
from pathlib import Path

import psutil
import pytest

from truespring import memory
from truespring.remembering import remembered

GIB = 2**30


def system(root: Path, cgroup: str, limits: dict[str, str]) -> Path:
    """A file system with the process's cgroups and the limits of some."""
    for name, text in {"proc/self/cgroup": cgroup, **limits}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    return root


V1 = "12:cpu,cpuacct:/a\n5:memory:/docker/0f\n1:name=systemd:/docker/0f\n"
CGROUPS = {
    "version 2": ("0::/user/job\n", {"sys/fs/cgroup/user/job/memory.max": "1073741824\n"}, [GIB]),
    "one above": ("0::/user/job\n", {"sys/fs/cgroup/user/memory.max": "1073741824\n"}, [GIB]),
    "no limit": ("0::/user/job\n", {"sys/fs/cgroup/user/job/memory.max": "max\n"}, []),
    "in a container": ("0::/\n", {"sys/fs/cgroup/memory.max": "2147483648\n"}, [2 * GIB]),
    "another's": ("0::/user/job\n", {"sys/fs/cgroup/user/other/memory.max": "1073741824\n"}, []),
    "version 1": (V1, {"sys/fs/cgroup/memory/docker/0f/memory.limit_in_bytes": "1073741824\n"}, [GIB]),
    "version 1 in a container": (V1, {"sys/fs/cgroup/memory/memory.limit_in_bytes": "1073741824\n"}, [GIB]),
    "nonsense": ("\n", {}, []),
}


@pytest.mark.parametrize("name", CGROUPS)
def test_limits_of_cgroups_are_found(name: str, tmp_path: Path) -> None:
    cgroup, limits, expected = CGROUPS[name]
    assert memory._cgroup_limits(system(tmp_path, cgroup, limits)) == expected


def test_the_smallest_limit_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert memory._cgroup_limits(tmp_path) == []  # a system without cgroups
    monkeypatch.setattr(memory, "_cgroup_limits", lambda _: [])
    assert memory.available_memory() == psutil.virtual_memory().total
    monkeypatch.setattr(memory, "_cgroup_limits", lambda _: [3 * 2**20, 2**63])
    assert memory.available_memory() == 3 * 2**20


@pytest.mark.parametrize("bytes_each", [1.0, 1e4, 1e12])
def test_slices_cover_everything_once(bytes_each: float) -> None:
    found = list(memory.slices(10_007, bytes_each))
    assert [place for part in found for place in range(10_007)[part]] == list(range(10_007))
    assert max(part.stop - part.start for part in found) * bytes_each <= max(memory._SLICE, bytes_each)
    assert not list(memory.slices(0, bytes_each))


def test_answers_are_kept_as_long_as_what_was_asked_lives() -> None:
    class Thing:
        pass

    asked = []

    @remembered
    def answer(thing: Thing, factor: int = 1) -> list[int]:
        asked.append(factor)
        return [factor]

    one, other = Thing(), Thing()
    assert answer(one) is answer(one) and answer(one, 2) is not answer(one) and answer(other) is not answer(one)
    assert answer(one, factor=2) == [2]
    assert asked == [1, 2, 1, 2]
    gone = weakref.ref(one)
    del one
    gc.collect()
    assert gone() is None
