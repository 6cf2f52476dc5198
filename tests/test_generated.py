"""Generated studies, valid and spoilt: whatever a study is, the program answers it, and in time."""

import random
import shutil
import sys
from pathlib import Path

import pytest

from tests.generated import HOSTILE, faults, study, told, valid, words
from truespring.loading import LOADS
from truespring.models import LAWS, RULES
from truespring.study import schema

# Numbers of studies by verb: what every run of the tests takes, and what the long one takes.
QUICK = {"check": range(0, 75), "solve": range(100, 120), "verify": range(204, 207, 2)}
LONG = {"check": range(10_000, 26_000), "solve": range(30_000, 33_700), "verify": range(40_000, 40_300)}


def run_all(numbers: dict[str, range], folder: Path) -> dict[tuple[str, int], list[str]]:
    found = {}
    for verb, several in numbers.items():
        for number in several:
            place = folder / f"{verb}-{number}"
            place.mkdir()
            found[verb, number] = faults(verb, study(number), place)
            shutil.rmtree(place)
    return {key: told for key, told in found.items() if told}


def test_generated_studies_are_answered(tmp_path: Path) -> None:
    assert run_all(QUICK, tmp_path) == {}


@pytest.mark.verification
@pytest.mark.parametrize(("verb", "part"), [(verb, part) for verb in LONG for part in range(4)])
def test_many_generated_studies_are_answered(verb: str, part: int, tmp_path: Path) -> None:
    assert sum(map(len, LONG.values())) == 20_000
    assert run_all({verb: LONG[verb][part::4]}, tmp_path) == {}


def test_the_generator_makes_what_it_says() -> None:
    """The same number gives the same text; all kinds, rules, laws and controls come up."""
    assert study(7) == study(7) != study(9)
    several = [valid(random.Random(number)) for number in range(0, 600, 2)]
    models = [model for tables in several for model in tables["models"].values()]
    elsewhere = {"stl", "network", "calculix", "bem-springs"}  # they need a file, a program, or a block
    assert {model["kind"] for model in models} == set(schema.MODEL_KINDS) - elsewhere
    assert {model.get("rule") for model in models} >= set(RULES)
    assert {model.get("law") for model in models} >= set(LAWS)
    assert {key for tables in several for load in tables.get("load", []) for key in load} == {
        "on",
        *(key for name, kind in LOADS.items() for key in kind.quantities(name)),
    }
    assert {tables["solver"]["control"] for tables in several} == set(words(schema.SolverKeys, "control"))
    assert len(HOSTILE) > 100


def test_most_valid_studies_are_taken_and_most_spoilt_ones_refused(tmp_path: Path) -> None:
    """Else nothing would be tried."""
    codes: dict[int, list[int]] = {0: [], 1: []}
    for number in range(300, 330):
        file = tmp_path / "study.toml"
        file.write_text(study(number), encoding="utf-8")
        codes[number % 2].append(told("check", file, "--quiet").code)
    assert codes[0].count(0) > 9
    assert codes[1].count(2) > 5


def test_a_fault_would_be_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What goes wrong within a model, and within a command, both show."""

    def broken(*_: object, **__: object) -> None:
        raise IndexError("no such thing")

    text = next(study(number) for number in range(100, 200, 2) if faults("check", study(number), tmp_path) == [])
    module = sys.modules["truespring.study.run"]  # its name in the package is the function's
    monkeypatch.setattr(module, "solve", broken)
    assert any("IndexError" in one for one in faults("solve", text, tmp_path))
    shutil.rmtree(tmp_path / "out")
    monkeypatch.setattr("truespring.report.tables.result_tables", broken)
    assert any("IndexError" in one for one in faults("solve", text, tmp_path))
