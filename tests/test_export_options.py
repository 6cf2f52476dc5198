"""Options of export targets: by key for all that have it, or for one; anything else is an error with the way out."""

from types import MappingProxyType
from typing import Any

import pytest

from tests.studies import written
from tests.wording import in_order
from truespring.cli import main
from truespring.errors import ExportError
from truespring.exports import read_options
from truespring.exports.options import options_of
from truespring.exports.target import Option, Target


def _target(**options: Option) -> Target:
    return Target(lambda exported: {}, "", "", (), frozenset(), "", "", options=MappingProxyType(options))


_TARGETS = {
    "one": _target(contact=Option(False, "contact of the surface"), steps=Option(10.0, "number of steps")),
    "two": _target(contact=Option(False, "contact of the surface"), name=Option("body", "name of the body")),
    "none": _target(),
}


def test_an_option_is_for_all_targets_that_have_it_or_for_one() -> None:
    found = options_of({"contact": True, "two.name": "liver"}, _TARGETS, _TARGETS)
    assert found == {
        "one": {"contact": True, "steps": 10.0},
        "two": {"contact": True, "name": "liver"},
        "none": {},
    }
    found = options_of({"two.contact": True, "steps": 3}, ["one", "two"], _TARGETS)
    assert found == {"one": {"contact": False, "steps": 3.0}, "two": {"contact": True, "name": "body"}}
    assert isinstance(found["one"]["steps"], float)


@pytest.mark.parametrize(
    ("given", "names", "words"),
    [
        ({"contakt": True}, ["one"], ("'contakt'", "one", "did you mean 'contact'", "one.contact, one.steps")),
        ({"two.contact": True}, ["one"], ("'two.contact'", "one.contact")),
        ({"name": "liver"}, ["one", "none"], ("'name'", "one, none", "one.contact")),
        ({"contact": True}, ["none"], ("'contact'", "have no options")),
        ({"contact": 1.0}, ["one"], ("one.contact = 1.0", "true or false", "contact of the surface", "false")),
        ({"steps": True}, ["one"], ("one.steps = True", "a number")),
        ({"steps": "many"}, ["one"], ("one.steps = 'many'", "a number", "number of steps", "10")),
        ({"name": 2.0}, ["two"], ("two.name = 2.0", "a text", "name of the body", "body")),
    ],
)
def test_other_options_are_errors(given: dict[str, Any], names: list[str], words: tuple[str, ...]) -> None:
    with pytest.raises(ExportError) as raised:
        options_of(given, names, _TARGETS)
    assert in_order(str(raised.value), *words)


def test_options_are_read_from_texts() -> None:
    assert read_options(["a=true", "b.c=1e3", "d=a=b"]) == {"a": True, "b.c": 1000.0, "d": "a=b"}
    for text in ("contact", "=true", "contact="):
        with pytest.raises(ExportError, match="KEY=VALUE"):
            read_options([text])


def test_the_verb_checks_options_before_it_solves(tmp_path: Any, capsys: pytest.CaptureFixture[str]) -> None:
    study = str(written(tmp_path))
    assert main(["export", study, "--to", "npz", "--option", "contact=true", "--out", str(tmp_path / "out")]) == 2
    assert in_order(capsys.readouterr().err, "option 'contact' of npz is unknown")
    assert not (tmp_path / "out").exists()
