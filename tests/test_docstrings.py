"""The examples in the docstrings of public names run, those of methods after the one of their class."""

import doctest
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import pytest

import truespring as ts

# Tables of rules and laws, which have no docstring, and the live session, whose example runs in test_live_*.py.
_WITHOUT = {"LAWS", "RULES", "Live"}

# Names whose examples solve many problems or load large libraries.
_SLOW = {
    *("Calibration", "Comparison", "LoadCase", "Mesh", "OwnError", "Solution", "Sweep", "Validity"),
    *("calibrate", "compare", "converge", "draw_calibration", "map_validity", "reference_error", "sweep", "verify"),
}


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


def test_each_public_name_has_an_example() -> None:
    assert len(ts.__all__) > 80
    assert not [name for name in ts.__all__ if name not in _WITHOUT and not any(examples(name))]


def test_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran = run_examples(set(ts.__all__) - _WITHOUT - _SLOW, tmp_path, monkeypatch)
    assert ran >= {"Problem", "Problem.plot", "Result", "solve"}


@pytest.mark.verification
def test_slow_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ran = run_examples(_SLOW, tmp_path, monkeypatch)
    assert ran >= {*_SLOW, "Solution.write", "Solution.plot", "Mesh.from_meshio"}


def run_examples(names: set[str], folder: Path, monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """Run the examples of public names, those of each name in a folder of its own; return what ran."""
    matplotlib.use("agg")
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    ran = set()
    for name in sorted(names):
        (folder / name).mkdir()
        monkeypatch.chdir(folder / name)
        known: dict[str, Any] = {}
        for example in examples(name):
            example.globs = known
            runner.run(example, clear_globs=False)
            ran.add(example.name)
    from matplotlib import pyplot

    pyplot.close("all")
    assert runner.summarize(verbose=False).failed == 0
    return ran


def test_an_example_with_a_wrong_result_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def wrong() -> None:
        """Return nothing.

        >>> 1 + 1
        3
        """

    monkeypatch.setattr(ts, "wrong", wrong, raising=False)
    with pytest.raises(AssertionError):
        run_examples({"wrong"}, tmp_path, monkeypatch)
