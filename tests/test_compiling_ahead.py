"""Kernels that a second process compiles for the first command."""

import inspect
import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from tests.test_examples import EXAMPLES
from truespring.kernels import ahead
from truespring.kernels.ahead import SIGNATURES, argument_types, compiling_ahead

# Prints the kernels that a command compiles, without those that only other kernels call.
LISTED = """
import sys
from numba.core import event
from truespring.cli import main

class Listener(event.Listener):
    depth = 0

    def on_start(self, event):
        if not self.depth:
            kernel = event.data["dispatcher"].py_func
            print("compiled:", kernel.__module__.rpartition(".")[2] + "." + kernel.__name__)
        self.depth += 1

    def on_end(self, event):
        self.depth -= 1

event.register("numba:compile", Listener())
assert main(["solve", *sys.argv[1:]]) == 0
"""


def started(*arguments: str, cache: Path) -> subprocess.CompletedProcess[str]:
    """Run Python with a folder for compiled code."""
    variables = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    return subprocess.run([sys.executable, *arguments], input="", capture_output=True, text=True, env=variables)


@pytest.mark.parametrize("name", SIGNATURES)
def test_signatures_have_a_type_for_each_argument(name: str) -> None:
    module, kernel = name.split(".")
    function = getattr(import_module(f"truespring.kernels.{module}"), kernel).py_func
    for dim in (2, 3):
        assert len(argument_types(SIGNATURES[name], dim)) == len(inspect.signature(function).parameters)


def test_types_are_those_of_arguments() -> None:
    import numpy as np
    from numba import typeof

    frozen = np.ones(3)
    frozen.flags.writeable = False
    values = (5, np.ones((2, 3)), frozen, np.ones(3, np.int32), np.ones((2, 2), bool), True, (0.0,) * 3, (0.0,) * 9)
    assert argument_types("n f2 F1 i1 b2 q z zz", 3) == tuple(map(typeof, values))


def test_the_second_process_ends_with_the_block(monkeypatch: pytest.MonkeyPatch) -> None:
    processes: list[Any] = []

    def start(dim: int) -> Any:
        processes.append(start_one(dim))
        return processes[-1]

    start_one = ahead._started
    monkeypatch.setattr(ahead, "_started", start)
    monkeypatch.setattr(ahead, "n_threads", lambda: 2)
    monkeypatch.setattr(ahead, "_nothing_cached", lambda: False)
    with compiling_ahead(2):
        assert processes == []
    monkeypatch.setattr(ahead, "_nothing_cached", lambda: True)
    with pytest.raises(KeyError), compiling_ahead(2):
        assert processes[0].poll() is None
        raise KeyError
    assert processes[0].returncode is not None


def test_the_second_process_ends_in_order_after_its_work() -> None:
    """Its thread that waits for the end of the first process does not stop it from ending."""
    code = (
        "import threading, time; from truespring.kernels import ahead; "
        "threading.Thread(target=ahead._end_with_parent, daemon=True).start(); time.sleep(0.2)"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdin=subprocess.PIPE) as process:
        assert process.wait(60) == 0


@pytest.mark.verification
def test_the_second_process_compiles_what_a_study_needs(tmp_path: Path) -> None:
    compile_them = "from truespring.kernels.ahead import compile_ahead; compile_ahead(2)"
    assert started("-c", compile_them, cache=tmp_path / "cache").returncode == 0
    study = [str(EXAMPLES / "bending.toml"), "--out", str(tmp_path)]
    shown = started("-c", LISTED, *study, cache=tmp_path / "cache")
    assert shown.returncode == 0, shown.stderr
    compiled = [line.split()[1] for line in shown.stdout.splitlines() if line.startswith("compiled:")]
    assert compiled == ["measures.quadrilaterals"]  # the only one for a single dimension
