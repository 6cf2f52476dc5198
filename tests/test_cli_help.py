"""The command line before anything is solved: help, examples, the nearest word, completion, `new`, closed pipes."""

import errno
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from argparse import Namespace
from dataclasses import replace
from pathlib import Path
from typing import Any, TextIO

import pytest

import truespring
from tests.test_examples import EXAMPLES
from truespring.cli import main, names, printing
from truespring.cli.parser import VERBS, build_parser, parse
from truespring.cli.verb import COMMON

KINDS = tuple(one.stem for one in (Path(truespring.__file__).parent / "examples").glob("*.toml"))


@pytest.fixture(scope="module")
def started(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with what `new` writes, and the shipped studies."""
    folder = tmp_path_factory.mktemp("started")
    for kind in KINDS:
        assert main(["new", kind, str(folder / f"{kind}.toml"), "--quiet"]) == 0
    shutil.copytree(EXAMPLES, folder / "examples")
    return folder


def check_command(line: str, folder: Path) -> None:
    """Assert that a command line is parsed, and that the files it reads are in a folder or stand for the user's own."""
    options = parse(shlex.split(line.partition(" > ")[0], comments=True)[1:])
    assert options is not None
    files = [getattr(options, key, []) for key in ("study", "case", "held_out", "source")]
    for file in (one for given in files for one in ([given] if isinstance(given, str) else given)):
        assert file in ("job.frd", "bracket.toml") or (folder / file.partition(":")[0]).is_file(), f"{line}: {file}"


def test_commands_of_the_first_pages_are_right(started: Path) -> None:
    pages = (EXAMPLES.parent / "README.md", *sorted((EXAMPLES.parent / "docs" / "start").glob("*.md")))
    lines = [
        line
        for page in pages
        for line in page.read_text(encoding="utf-8").splitlines()
        if line.startswith("truespring ")
    ]
    assert len(lines) > 12
    for line in lines:
        check_command(line, started)


def test_alone_it_prints_help_with_examples(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    shown = capsys.readouterr().out
    assert main(["--help"]) == 0
    assert capsys.readouterr().out == shown
    *_, last = re.findall(r"^    (\w+) ", shown, re.MULTILINE)
    assert last == "table1"
    examples = shown.split("examples:\n")[1].splitlines()
    assert len(examples) == 4 and all(line.split()[1] in VERBS for line in examples)


@pytest.mark.parametrize("name", VERBS)
def test_examples_of_a_verb_run(name: str, started: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name, "--help"]) == 0
    shown = [line.strip() for line in capsys.readouterr().out.split("examples:\n")[1].splitlines()]
    assert shown == list(VERBS[name].examples) and len(shown) == 2
    for line in shown:
        assert line.split()[:2] == ["truespring", name]
        check_command(line, started)


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["verfy", "x.toml"], "'verify'"),
        (["Solve", "x.toml"], "'solve'"),
        (["verify", "x.toml", "--thread", "2"], "'--threads'"),
        (["export", "x.toml", "--to", "npz", "--modl=springs"], "'--model'"),
        (["sweep", "x.toml", "--worker", "2"], "'--workers'"),
    ],
)
def test_the_nearest_word_is_named(arguments: list[str], word: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments) == 2
    assert f"did you mean {word}" in capsys.readouterr().err


@pytest.mark.parametrize("name", VERBS)
def test_every_verb_accepts_every_common_option(name: str) -> None:
    line = shlex.split(VERBS[name].examples[0].partition(" > ")[0])[1:]
    assert {"json", "quiet", "threads"} <= set(COMMON)
    for option, (words, _) in COMMON.items():
        for word in words:
            options = parse([*line, word, "3"] if option == "threads" else [*line, word])
            assert {key: getattr(options, key) for key in COMMON} == {
                **dict.fromkeys(COMMON, False),
                "threads": None,
                option: 3 if option == "threads" else True,
            }


def test_help_lists_common_options_that_have_an_effect() -> None:
    _, verbs = build_parser(VERBS)
    shown = {name: set(re.findall(r"--\w+", verbs[name].format_help())) for name in VERBS}
    common = {f"--{option}" for option in COMMON}
    assert {name: common - words for name, words in shown.items()} == {
        **{name: {"--verbose"} for name in VERBS},
        **{name: set() for name in ("verify", "solve", "check")},
        "live": {"--json", "--verbose"},
        "new": {"--threads", "--verbose"},
        "rules": {"--quiet", "--threads", "--verbose"},
        "schema": {"--json", "--quiet", "--threads", "--verbose"},
    }


def test_options_without_effect_change_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    shown = []
    for more in ((), ("--json", "--quiet", "--threads", "2")):
        assert main(["schema", *more]) == 0
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1] and json.loads(shown[0])


def test_names_in_help_are_those_of_the_tables(capsys: pytest.CaptureFixture[str]) -> None:
    from truespring.calibration import UNKNOWNS
    from truespring.exports import TARGETS
    from truespring.models import LAWS, RULES
    from truespring.reference import READERS
    from truespring.validity import LOAD_TYPES
    from truespring.validity.rules import VARIANTS

    assert [name for name, load in LOAD_TYPES.items() if load.dims == (3,)] == list(names.LOAD_TYPES_3D)
    for verb, tables in (
        ("calibrate", {"UNKNOWNS": UNKNOWNS}),
        ("map", {"LAWS": LAWS, "RULES": RULES, "LOAD_TYPES": LOAD_TYPES, "VARIANTS": VARIANTS}),
        ("compare", {"READERS": READERS}),
        ("export", {"TARGETS": TARGETS}),
    ):
        assert main([verb, "--help"]) == 0
        words = set(re.findall(r"[\w.+-]+", re.sub(r"-\n\s+", "-", capsys.readouterr().out)))
        for name, table in tables.items():
            own = tuple(getattr(table, "own", table))  # without those of installed packages
            assert getattr(names, name) == own, f"cli/names.py: {name} = {own}"
            assert set(own) <= words, set(own) - words


def test_completion_knows_verbs_options_and_names(capsys: pytest.CaptureFixture[str]) -> None:
    for shell in ("bash", "zsh", "tcsh"):
        assert main(["--print-completion", shell]) == 0
        script = capsys.readouterr().out
        for word in (*VERBS, "held-out", "mujoco", "organ"):
            assert word in script, f"{shell}: {word}"
    assert main(["--print-completion", "fish"]) == 2
    bash = shutil.which("bash")
    assert main(["--print-completion", "bash"]) == 0
    script = capsys.readouterr().out
    if bash is not None:
        typed = "COMP_WORDS=(truespring export --to m); COMP_CWORD=3; _shtab_truespring; echo ${COMPREPLY[@]}"
        shown = subprocess.run([bash, "-c", f"{script}\n{typed}"], capture_output=True, text=True, check=True).stdout
        assert shown.split() == ["mujoco"]


def test_new_studies_are_right_and_overwrite_nothing(
    started: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    files = [str(started / f"{kind}.toml") for kind in KINDS]
    assert main(["check", *files, "--json"]) == 0
    plans = json.loads(capsys.readouterr().out)
    assert len(plans) == len(KINDS) >= 4 and (len(plans["strip"]["size"]), len(plans["organ"]["size"])) == (2, 3)
    for plan in plans.values():
        assert plan["models"]["springs"]["n_springs"] and plan["compare"]["references"]
        assert plan["mesh_notes"] == []
    monkeypatch.chdir(tmp_path)
    assert main(["new", "mesh", "liver.toml"]) == 0
    assert {one.name for one in tmp_path.iterdir()} == {"liver.toml", "liver.msh", "liver.geo"}
    assert 'file = "liver.msh"' in (tmp_path / "liver.toml").read_text("utf-8")
    for wrong in (["mesh", "liver.toml"], ["mesh", "liver.msh"], ["strip", "none/strip.toml"], ["strp"]):
        assert main(["new", *wrong]) == 2
    (tmp_path / "organ.nrrd").touch()
    assert main(["new", "organ"]) == 2
    assert not (tmp_path / "organ.toml").exists() and (tmp_path / "organ.nrrd").read_bytes() == b""


def test_a_closed_pipe_is_no_error() -> None:
    command = [sys.executable, "-m", "truespring", "--help"]
    buffered = {**os.environ, "PYTHONUNBUFFERED": ""}
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=buffered) as writer:
        assert writer.stdout is not None and writer.stderr is not None
        writer.stdout.close()  # long before it has started to write
        assert writer.stderr.read() == b"" and writer.wait() == 141


def written_to(stream: TextIO, arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    """Return the exit code of a command with this standard output."""
    with stream, monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", stream)
        return main(arguments)


@pytest.mark.parametrize("arguments", [["schema"], ["rules"], ["new", "strip"], ["--help"]])
def test_a_command_ends_when_its_output_is_closed(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    reader, writer = os.pipe()
    os.close(reader)
    assert written_to(os.fdopen(writer, "w", buffering=1), arguments, monkeypatch) == 141
    assert capsys.readouterr().err == ""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize("buffering", [1, -1])
def test_a_full_disk_is_an_error(
    buffering: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    stream = Path("/dev/full").open("w", buffering=buffering, encoding="utf-8")  # noqa: SIM115
    assert written_to(stream, ["rules"], monkeypatch) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize(
    "error",
    [
        BrokenPipeError(errno.EPIPE, "Broken pipe"),
        ConnectionResetError(errno.ECONNRESET, "Connection reset by peer"),
        OSError(errno.ENOSPC, "No space left on device"),
        OSError("a text alone"),
        OSError(errno.EACCES, "Permission denied", "curves.csv"),
    ],
)
def test_other_errors_of_streams_are_printed(
    error: OSError, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(_: Namespace) -> int:
        raise error

    monkeypatch.setitem(VERBS, "rules", replace(VERBS["rules"], run=run))
    assert main(["rules"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    for text in (error.strerror or str(error), error.filename or ""):
        assert text in line


def undescribed(schema: dict[str, Any]) -> list[str]:
    """Return the keys of the study file without a description, as TABLE.KEY."""
    tables = {"StudyKeys": schema, **schema["$defs"]}
    keys = [(f"{name}.{key}", one) for name, table in tables.items() for key, one in table["properties"].items()]
    assert len(keys) > 80
    return [key for key, one in keys if len(one.get("description", "").split()) < 2]


def test_every_key_of_the_schema_has_a_description(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["schema"]) == 0
    schema = json.loads(capsys.readouterr().out)
    assert undescribed(schema) == []
    assert all("description" in table for table in schema["$defs"].values())


def test_progress_off_a_terminal_is_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def printed(every: float, quiet: bool) -> tuple[str, str]:
        monkeypatch.setattr(printing, "_EVERY", every)
        options = Namespace(quiet=quiet)
        with printing.progress(options) as advance, printing.counting(options, "points") as (count, note):
            if advance and count and note:
                advance("study", "springs", 0.5)
                count(3, 1, 8)
        return tuple(capsys.readouterr())  # type: ignore[return-value]

    assert printed(0.0, False) == ("", "truespring: study: springs: 50%\ntruespring: 3 of 8 points, 1 failed\n")
    assert printed(1000.0, False) == printed(0.0, True) == ("", "")
