"""Output folders are whole or plainly unfinished, whatever fails or is killed, and never hold two runs."""

import builtins
import csv
import errno
import io
import itertools
import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from truespring import cli
from truespring.errors import TruespringError
from truespring.outputs import UNFINISHED, Lock, Output

STUDY = """title = "A strip, pulled"
[mesh]
shape = "rectangle"
size = ["80 mm", "20 mm"]
elements = [4, 1]
[material]
young = "{young} kPa"
poisson = 0.3333333333
density = "1000 kg/m^3"
[section]
kind = "plane-stress"
thickness = "10 mm"
[[support]]
on = "left"
[[load]]
on = "right"
force = ["0.01 N", "-0.001 N"]
[solver]
load_steps = 2
[models.springs]
kind = "springs"
rule = "isotropic"
[models.{other}]
kind = "fem"
law = "linear"
"""


def written(folder: Path, young: float = 10, other: str = "linear") -> Path:
    study = folder / "study.toml"
    study.write_text(STUDY.format(young=young, other=other), encoding="utf-8")
    return study


def contents(folder: Path) -> dict[str, bytes]:
    return {one.relative_to(folder).as_posix(): one.read_bytes() for one in sorted(folder.rglob("*")) if one.is_file()}


# --- the folder ---------------------------------------------------------------------------------------


def test_what_is_published_replaces_the_former_run_and_nothing_else(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    with Output(folder, "summary.json") as output:
        for name in ("summary.json", "a.csv", "figures/one.png", "figures/two.png", "gone/x.vtu"):
            (output.staging / name).parent.mkdir(exist_ok=True)
            (output.staging / name).write_text("first")
        assert not (folder / "summary.json").exists(), "nothing is in place before it is published"
        output.publish()
    (folder / "notes.txt").write_text("mine")
    with Output(folder, "other.json") as output:
        (output.staging / "figures").mkdir()
        for name in ("other.json", "figures/two.png"):
            (output.staging / name).write_text("other command")
        output.publish()
    with Output(folder, "summary.json") as output:
        for name in ("summary.json", "a.csv"):
            (output.staging / name).write_text("second")
        output.publish()
    found = contents(folder)
    del found[".truespring.json"]
    assert found == {
        "summary.json": b"second",
        "a.csv": b"second",
        "notes.txt": b"mine",
        "other.json": b"other command",
        "figures/two.png": b"other command",
    }
    assert not (folder / "gone").exists() and not (folder / UNFINISHED).exists()


def test_a_damaged_list_names_no_file_of_others(tmp_path: Path) -> None:
    folder, mine = tmp_path / "out", tmp_path / "mine.txt"
    folder.mkdir()
    mine.write_text("mine")
    for damaged in ("{", "[]", '{"summary.json": 3}', json.dumps({"summary.json": ["../mine.txt", str(mine)]})):
        (folder / ".truespring.json").write_text(damaged)
        with Output(folder, "summary.json") as output:
            (output.staging / "summary.json").write_text("new")
            output.publish()
        assert mine.read_text() == "mine" and (folder / "summary.json").read_text() == "new"


def test_a_second_run_in_the_same_folder_is_an_error(tmp_path: Path) -> None:
    with Lock(tmp_path / "out"):
        with pytest.raises(TruespringError, match="another run is writing"):
            Lock(tmp_path / "out")
        told = [sys.executable, "-m", "truespring", "solve", str(written(tmp_path)), "--out", str(tmp_path), "--quiet"]
        with Lock(tmp_path / "study"):
            process = subprocess.run(told, capture_output=True, text=True)
        assert process.returncode == 2 and "another run is writing" in process.stderr
    assert not (tmp_path / "out").exists() and not (tmp_path / "study").exists(), "nothing is left behind"
    Lock(tmp_path / "out").release()


def test_a_former_model_leaves_nothing_though_its_summary_is_cut(tmp_path: Path) -> None:
    assert cli.main(["solve", str(written(tmp_path, other="gone")), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    summary = tmp_path / "out/study/summary.json"
    summary.write_bytes(summary.read_bytes()[:100])
    assert (tmp_path / "out/study/gone.pvd").exists()
    assert cli.main(["solve", str(written(tmp_path)), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    assert not [name for name in contents(tmp_path / "out") if "gone" in name.replace(".truespring", "")]


# --- every write, open and rename fails once --------------------------------------------------------------

# Of each verb its options, and the file that comes last.
VERBS: dict[str, tuple[list[str], str]] = {
    "solve": ([], "study/summary.json"),
    "verify": ([], "study/summary.json"),
    "moduli": ([], "study/moduli.json"),
    "export": (["--to", "json"], "study/springs.json"),
    "modes": (["--count", "1"], "study/modes.json"),
}
LONG: dict[str, tuple[list[str], str]] = {
    "calibrate": (["--to", "linear"], "study/calibrate.json"),
    "map": (["--rule", "isotropic", "--load", "stretch", "--y", "none"], "study/validity.json"),
    "sweep": (["--vary", "material.poisson=0.3,0.25", "--workers", "1"], "sweep.csv"),
}


class Faults:
    """The n-th call that writes, opens to write or renames fails, below one folder."""

    def __init__(self, below: Path, number: int) -> None:
        self.below, self.number, self.calls = below, number, 0

    def due(self, *files: object) -> None:
        """Fail where it is the time."""
        if not any(str(file).startswith(str(self.below)) for file in files if isinstance(file, str | os.PathLike)):
            return
        self.calls += 1
        if self.calls == self.number:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(files[0]))

    @contextmanager
    def patched(self) -> Iterator[None]:
        with pytest.MonkeyPatch.context() as patch:
            for module, name in ((builtins, "open"), (io, "open")):
                patch.setattr(module, name, self._opening(getattr(module, name)))
            for name in ("replace", "rename", "unlink", "mkdir", "rmdir"):
                patch.setattr(os, name, self._before(getattr(os, name)))
            patch.setattr(os, "open", self._os_open(os.open))
            yield

    def _before(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*given: Any, **named: Any) -> Any:
            self.due(*given)
            return real(*given, **named)

        return call

    def _os_open(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(file: Any, flags: int, *more: Any, **named: Any) -> Any:
            self.due(file)
            return real(file, flags, *more, **named)

        return call

    def _opening(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(file: Any, mode: str = "r", *more: Any, **named: Any) -> Any:
            if not set(mode) & set("wax+"):
                return real(file, mode, *more, **named)
            self.due(file)
            return _Stream(real(file, mode, *more, **named), lambda: self.due(file))

        return call


class _Stream:
    """A file that is open, of which each write may stop half way."""

    def __init__(self, stream: Any, due: Callable[[], None]) -> None:
        self.stream, self.due = stream, due

    def write(self, data: Any) -> Any:
        try:
            self.due()
        except OSError:
            whole = data if isinstance(data, str) else bytes(data)
            self.stream.write(whole[: len(whole) // 2])
            raise
        return self.stream.write(data)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)

    def __enter__(self) -> "_Stream":
        return self

    def __exit__(self, *_: object) -> None:
        self.stream.close()


def whole(out: Path, marker: str) -> dict[str, bytes] | None:
    """What a run left, None where it is plainly unfinished; all that stands there can be read."""
    if not (out / marker).exists():
        return None
    found = {name: data for name, data in contents(out).items() if UNFINISHED not in name and "/." not in f"/{name}"}
    for name, data in found.items():
        if name.endswith(".json"):
            json.loads(data)
        elif name.endswith((".vtu", ".pvd")):
            ElementTree.fromstring(data)
        elif name.endswith(".csv"):
            assert data.endswith(b"\n") and len({len(row) for row in csv.reader(data.decode().splitlines())}) == 1
        elif name.endswith(".html"):
            assert data.rstrip().endswith(b"</html>")
    return found


def clean(found: dict[str, bytes] | None) -> dict[str, bytes]:
    """Files without what the clock says."""
    assert found is not None
    return {
        name: re.sub(rb'("?seconds"?[^,}\n<]*)|(\d+(\.\d+)? m?s\b)|(<dc:date>[^<]*)', b"", timeless(name, data))
        for name, data in found.items()
        if name.endswith((".csv", ".json", ".vtu", ".pvd", ".stl", ".toml")) and "points/" not in name
    }


def timeless(name: str, data: bytes) -> bytes:
    """A table without its columns of seconds; other files as they are."""
    if not name.endswith(".csv"):
        return data
    rows = list(csv.reader(data.decode().splitlines()))
    kept = [number for number, title in enumerate(rows[0]) if not title.endswith("seconds")]
    return repr([[row[number] for number in kept] for row in rows]).encode()


def fail_at(verb: str, more: list[str], marker: str, folder: Path, numbers: Iterator[int]) -> int:
    """Let one call after the other fail; return how many there were.

    Afterwards the folder holds the former run or the new one, whole, or none that could be taken for one.
    """
    told = [verb, "", *more, "--out", "", "--quiet"]

    def run(young: float, out: Path) -> int:
        told[1], told[-2] = str(written(folder, young)), str(out)
        return cli.main(told)

    wanted = []
    for young in (10, 20):
        assert run(young, folder / f"wanted{young}") == 0
        wanted.append(clean(whole(folder / f"wanted{young}", marker)))
    assert wanted[0] != wanted[1]
    out = folder / "out"
    for number in numbers:
        assert run(10, out) == 0
        faults = Faults(out, number)
        with faults.patched():
            code = run(20, out)
        if faults.calls < number:
            assert code == 0
            return faults.calls
        left = whole(out, marker)
        assert code in (0, 2), f"call {number}"
        if code == 0:  # what failed was of no account
            assert clean(left) == wanted[1], f"call {number}"
        elif left is not None:
            now = clean(left)
            assert now in wanted, f"call {number}: {[name for name in now if now[name] != wanted[0].get(name)]}"
    return 0


@pytest.mark.parametrize("verb", VERBS)
def test_a_disk_that_is_full_loses_nothing(verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    more, marker = VERBS[verb]
    fail_at(verb, more, marker, tmp_path, iter((2, 7) if verb == "verify" else (1, 4, 8)))
    told = capsys.readouterr().err
    assert "No space left on device" in told and "Traceback" not in told


@pytest.mark.verification
@pytest.mark.parametrize("verb", {**VERBS, **LONG})
def test_a_disk_that_is_full_at_any_call_loses_nothing(verb: str, tmp_path: Path) -> None:
    more, marker = {**VERBS, **LONG}[verb]
    assert fail_at(verb, more, marker, tmp_path, itertools.count(1)) > 10


# --- killed -----------------------------------------------------------------------------------------------


@pytest.mark.verification
def test_fifty_runs_that_are_killed(tmp_path: Path) -> None:
    """At random moments, most of them while it writes: the folder holds one run, whole, or plainly none."""
    random = np.random.default_rng(7)
    out, wanted = tmp_path / "out", []
    for young in (10, 20):
        assert cli.main(["verify", str(written(tmp_path, young)), "--out", str(tmp_path / str(young)), "--quiet"]) == 0
        wanted.append(clean(whole(tmp_path / str(young), "study/summary.json")))
    seen = {"former": 0, "new": 0, "unfinished": 0}
    killed = 0
    for _ in range(50):
        assert cli.main(["verify", str(written(tmp_path, 10)), "--out", str(out), "--quiet"]) == 0
        study = str(written(tmp_path, 20))
        told = [sys.executable, "-m", "truespring", "verify", study, "--out", str(out), "--quiet"]
        process = subprocess.Popen(told, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        while process.poll() is None and not (out / "study" / UNFINISHED / "springs.pvd").exists():
            time.sleep(0.002)
        time.sleep(random.uniform(0, 1.5))
        process.send_signal(signal.SIGKILL)
        process.communicate()
        killed += process.returncode == -signal.SIGKILL
        left = whole(out, "study/summary.json")
        if left is None:
            seen["unfinished"] += 1
            continue
        if not (out / "report.html").exists():
            left["report.html"] = b""
        now = clean(left)
        assert now in wanted
        seen["former" if now == wanted[0] else "new"] += 1
    assert killed >= 25 and seen["former"], seen
