"""The pages of the site: studies and their changes, command lines, and an entry for every status and warning."""

import ast
import re
import shlex
import shutil
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.names import named_files
from truespring.cli.parser import VERBS, parse
from truespring.equilibrium import Status
from truespring.errors import TruespringError
from truespring.models.findings import CODES
from truespring.study import read_study, run
from truespring.study.toml import toml_text
from truespring.templates import new

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
SOURCES = sorted((ROOT / "src" / "truespring").rglob("*.py"))
SECTIONS = ("howto", "coming-from")
PAGES = sorted(page for section in SECTIONS for page in (ROOT / "docs" / section).glob("*.md"))
TROUBLE = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")

_START = re.compile(r"truespring new (\w+)|^```toml\n(.*?)^```", re.DOTALL | re.MULTILINE)


def base_of(kind: str) -> dict[str, Any]:
    return tomllib.loads(new(kind))


def changed(base: dict[str, Any], tables: dict[str, Any]) -> dict[str, Any]:
    """Return a study with tables replaced by those of the same header, a list of tables as a whole."""
    models = {**base["models"], **tables.get("models", {})}
    return {**base, **tables, "models": models}


def studies() -> Iterator[Any]:
    """Yield the studies of the pages: a block that is not whole replaces tables of the study that it starts from.

    That is the last whole block above, or the study of the last `truespring new KIND` above.
    """
    for page in PAGES:
        base: dict[str, Any] = {}
        for number, found in enumerate(_START.finditer(page.read_text(encoding="utf-8"))):
            kind, text = found.groups()
            tables = base_of(kind) if kind else tomllib.loads(text)
            if tables.keys() >= {"mesh", "support", "models"}:
                base = tables
            if not kind:
                assert base, f"{page.name}: a block changes no study"
                whole = changed(base, tables)
                unrefined = {**whole.get("compare", {}), "refine": False}
                yield pytest.param({**whole, "compare": unrefined}, page, id=f"{page.stem}-{number}")


def written(study: dict[str, Any], page: Path, folder: Path) -> Path:
    """Write a study beside the files of its page, of `truespring new` and of the examples."""
    for one in (*(ROOT / "src" / "truespring" / "examples").iterdir(), *EXAMPLES.iterdir()):
        if one.is_file() and one.suffix in (".csv", ".msh", ".nrrd", ".stl"):
            shutil.copy(one, folder)
    for name, text in named_files(page.read_text(encoding="utf-8")).items():
        (folder / name).write_text(text, encoding="utf-8")
    file = folder / "study.toml"
    file.write_text(toml_text(study), encoding="utf-8")
    return file


@pytest.mark.parametrize(("study", "page"), list(studies()))
def test_a_study_of_a_page_is_valid(study: dict[str, Any], page: Path, tmp_path: Path) -> None:
    read_study(written(study, page, tmp_path))


@pytest.mark.verification
@pytest.mark.parametrize(("study", "page"), list(studies()))
def test_a_study_of_a_page_is_solved(study: dict[str, Any], page: Path, tmp_path: Path) -> None:
    found = run(read_study(written(study, page, tmp_path)))
    assert found.converged, {name: path.warnings for name, path in found.solutions.items()}


def commands() -> dict[str, str]:
    """Return the page of each command line of truespring in a block of shell commands."""
    pages = sorted(page for page in ROOT.glob("docs/**/*.md") if "_build" not in page.parts)
    return {
        line: page.relative_to(ROOT).as_posix()
        for page in (ROOT / "README.md", *pages)
        if page.name != "extending.md"  # its commands need the plugin of the examples
        for block in re.findall(r"^```sh\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
        for line in block.splitlines()
        if re.match(r"truespring [a-z]", line) and "STUDY" not in line
    }


def test_command_lines_of_the_pages_are_accepted() -> None:
    lines = commands()
    assert len(lines) > 60
    for line, page in lines.items():
        words = shlex.split(re.split(r"\s[|>&]\s", line)[0], comments=True)[1:]
        assert words[0] in VERBS, f"{page}: {line}"
        try:
            parse(words)
        except SystemExit:
            pytest.fail(f"{page}: {line}")


# Warnings: sentences of functions that return or yield warnings, as their name or docstring says.


def template(node: ast.expr, constants: dict[str, str]) -> str | None:
    """Return a text of the source with "…" for what is inserted; None if it is none."""
    match node:
        case ast.Constant(value=str() as text):
            return text
        case ast.JoinedStr(values=values):
            return "".join(template(one, constants) or "…" for one in values)
        case ast.BinOp(op=ast.Add(), left=left, right=right):
            return (template(left, constants) or "…") + (template(right, constants) or "…")
        case ast.Name(id=name):
            return constants.get(name)
    return None


def texts(function: ast.FunctionDef, constants: dict[str, str]) -> Iterator[str]:
    """Yield the sentences in a function, without its docstring and errors: long texts, not in another text."""
    todo: list[ast.AST] = list(function.body[1:] if ast.get_docstring(function) else function.body)
    while todo:
        node = todo.pop()
        logged = isinstance(node, ast.Call) and getattr(node.func, "attr", "") in ("info", "warning")
        if isinstance(node, ast.Raise) or logged:
            continue
        text = template(node, constants) if isinstance(node, ast.expr) else None
        if text is None:
            todo += ast.iter_child_nodes(node)
        elif len(text.replace("…", "")) > 11 and " " in text.strip("… "):
            yield text


def warns(function: ast.FunctionDef) -> bool:
    first = (ast.get_docstring(function) or "").partition("\n")[0]
    calls = (getattr(one.func, "attr", "") for one in ast.walk(function) if isinstance(one, ast.Call))
    names = {one.id for one in ast.walk(function) if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)}
    said = re.search(r"warning", f"{function.name} {first}", re.IGNORECASE)
    return bool(said) or "warn" in calls or "warnings" in names


def warnings_of_the_source() -> dict[str, str]:
    """Return the place of each sentence that the library may give as a warning."""
    found: dict[str, str] = {}
    for file in SOURCES:
        if "cli" in file.parts or file.name == "tables.py":  # they print warnings of other rooms
            continue
        code = file.read_text(encoding="utf-8")
        if "warn" not in code.lower():
            continue
        tree = ast.parse(code)
        constants = {
            target.id: text
            for node in tree.body
            if isinstance(node, ast.Assign) and (text := template(node.value, {}))
            for target in node.targets
            if isinstance(target, ast.Name)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and warns(node):
                found |= dict.fromkeys(texts(node, constants), f"{file.name}:{node.name}")
    return found


def quoted(text: str) -> list[str]:
    """Return the messages that a page quotes, `> ...` on a line of its own; "..." stands for what is inserted."""
    return [line.replace("...", "…") for line in re.findall(r"^> `(.+)`$", text, re.MULTILINE)]


def fits(entry: str, text: str) -> bool:
    """Return whether a message of a page is part of one of the source, or the other way round."""
    return any(pattern(inner).search(outer) for inner, outer in ((entry, text), (text, entry)))


@cache
def pattern(text: str) -> re.Pattern[str]:
    """Return the pattern of a message: "…" stands for anything."""
    return re.compile(".*".join(re.escape(part) for part in text.strip("… ").split("…")))


def test_every_warning_has_an_entry() -> None:
    entries, found = quoted(TROUBLE), warnings_of_the_source()
    assert len(found) > 40
    without = [f"{where}: {text}" for text, where in found.items() if not any(fits(one, text) for one in entries)]
    assert not without, "\n".join(["not on docs/troubleshooting.md:", *without])
    stale = [one for one in entries if not any(fits(one, text) for text in found)]
    assert not stale, "\n".join(["not in the source:", *stale])


def test_a_message_fits_its_entry_only() -> None:
    text = "inverted from … on (smallest … ratio …): …"
    assert fits(*quoted("> `inverted from ... on`"), text)
    assert not fits(*quoted("> `unstable at ...`"), text)
    assert not fits(*quoted("> `inverted from ... off`"), text)


def test_every_status_finding_and_error_has_an_entry() -> None:
    headings = set(re.findall(r"^### `(.+?)`", TROUBLE, re.MULTILINE))
    assert headings == {*Status}
    rows = re.findall(r"^\| `([\w-]+)` \|", TROUBLE, re.MULTILINE)
    errors = {one.__name__ for one in TruespringError.__subclasses__()}
    assert sorted(rows) == sorted({*CODES, *errors})
