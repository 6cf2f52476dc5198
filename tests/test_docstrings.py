"""The examples in the docstrings of public names run, those of methods after the one of their class."""

import doctest
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import pytest

import truespring as ts

# Names without a docstring of their own, and one whose example another test runs, with others of its kind.
_WITHOUT = {"LAWS", "RULES", "Live"}


def examples(name: str) -> Iterator[doctest.DocTest]:
    """The examples of a public name, then of its own methods and properties."""
    value = getattr(ts, name)
    parts = {name: value}
    if inspect.isclass(value):
        own = {key: getattr(value, key) for key in vars(value) if not key.startswith("_")}
        parts |= {f"{name}.{key}": one for key, one in own.items() if inspect.isroutine(one) or _is_property(one)}
    for part, one in parts.items():
        found = doctest.DocTestParser().get_doctest(inspect.getdoc(one) or "", {}, part, None, None)
        if found.examples:
            yield found


def _is_property(value: object) -> bool:
    return isinstance(value, property) or type(value).__name__ == "cached_property"


def test_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    matplotlib.use("agg")
    monkeypatch.chdir(tmp_path)
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    ran = set()
    for name in sorted(set(ts.__all__) - _WITHOUT):
        known: dict[str, Any] = {}
        for example in examples(name):
            example.globs = known
            runner.run(example, clear_globs=False)
            ran.add(example.name)
    from matplotlib import pyplot

    pyplot.close("all")
    assert runner.summarize(verbose=False).failed == 0
    assert ran >= {"Solution", "Solution.write", "Solution.plot", "Mesh", "Mesh.from_meshio", "Problem.plot"}
