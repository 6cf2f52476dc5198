"""The README and the pages of docs: their Python runs, their studies are read, their numbers and keys are true."""

import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from matplotlib import pyplot

from tests.names import missing, named_files
from tests.test_examples import EXAMPLES
from truespring.mesh import ELEMENT_KINDS
from truespring.models import ELEMENTS, LAWS, RULES
from truespring.study import read_study, run
from truespring.study.schema import MODEL_KINDS, StudyKeys

ROOT = EXAMPLES.parent
SECTIONS = ("", "accuracy", "coming-from", "export", "howto", "reference", "start", "theory")
STUDIES = ROOT / "docs" / "accuracy" / "studies.md"
PAGES = [ROOT / "README.md", *(page for one in SECTIONS for page in sorted((ROOT / "docs" / one).glob("*.md")))]


#: Sections of many pages: their Python runs in verification, their studies in test_pages.py.
MANY = ("docs/howto/", "docs/coming-from/")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page; the long ones, under <!-- long -->, run in verification."""

    page: str
    text: str
    long: bool


def blocks(language: str) -> list[Block]:
    fence = re.compile(rf"^(<!-- long -->\n)?```{language}\n(.*?)^```", re.DOTALL | re.MULTILINE)
    return [
        Block(page.relative_to(ROOT).as_posix(), text, bool(long))
        for page in PAGES
        for long, text in fence.findall(page.read_text(encoding="utf-8"))
    ]


def pages_of_python() -> list[Any]:
    """Return pages, and whether their long blocks run."""
    found = {(one.page, one.long) for one in blocks("python")}
    return [
        pytest.param(page, long, marks=[pytest.mark.verification] if long or page.startswith(MANY) else [])
        for page, long in sorted(found)
    ]


def test_the_pages_hold_code() -> None:
    assert len(blocks("python")) >= 2
    assert len(blocks("toml")) >= 2


@pytest.mark.parametrize(("page", "long"), pages_of_python())
def test_python_on_the_pages_runs(page: str, long: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The blocks of a page follow each other: each may use the names of those before it."""
    monkeypatch.chdir(tmp_path)  # some write files
    shutil.copytree(EXAMPLES, tmp_path / "examples")  # as where one stands in the project
    for name, text in named_files((ROOT / page).read_text(encoding="utf-8")).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    known: dict[str, object] = {}
    for one in blocks("python"):
        if one.page == page and one.long <= long:
            exec(compile(one.text, page, "exec"), known)
    pyplot.close("all")


@pytest.mark.parametrize(
    "block",
    [
        pytest.param(one, marks=[pytest.mark.verification] if one.long else [])
        for one in blocks("toml")
        if not one.page.startswith(MANY)
    ],
)
def test_studies_on_the_pages_run(block: Block, tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    file.write_text(block.text, encoding="utf-8")
    for table in (ROOT / "examples").glob("*.csv"):
        shutil.copy(table, tmp_path)
    assert run(read_study(file)).converged


def test_every_key_rule_and_law_is_documented() -> None:
    study, models = (ROOT / "docs" / "study.md").read_text("utf-8"), (ROOT / "docs" / "models.md").read_text("utf-8")
    tables = StudyKeys.model_json_schema()
    keys = set(tables["properties"]) | {key for one in tables["$defs"].values() for key in one["properties"]}
    assert len(keys) > 25
    assert not missing(keys, study)
    quoted = set(re.findall(r"`([^`\n]+)`", models))
    assert not {*RULES, *LAWS, *ELEMENTS} - quoted
    assert not missing({*ELEMENT_KINDS} - {"line"}, study)


def test_the_schema_names_what_the_tables_hold() -> None:
    """Rules and laws with their description, elements and kinds of model: as values, each a word of its own."""
    tables = StudyKeys.model_json_schema()["$defs"]
    for table, key, names in (
        ("SpringsKeys", "rule", RULES),
        ("FemKeys", "law", LAWS),
        ("FemKeys", "element", ELEMENTS),
    ):
        found = tables[table]["properties"][key]
        forms = found.get("anyOf", [found])
        assert {name for form in forms for name in form.get("enum", ())} == set(names)
        if key != "element":
            assert not missing(names, " ".join(form.get("description", "") for form in forms))
    kinds = {table["properties"]["kind"].get("const") for table in tables.values() if "kind" in table["properties"]}
    assert set(MODEL_KINDS) <= kinds


def test_a_short_name_is_not_found_in_a_longer_word() -> None:
    assert missing(["obj", "stl"], "objects as stl files") == {"obj"}
    assert missing(["linear", "quadratic"], "nonlinear, bi-quadratic, `quadratic`") == {"linear"}


def test_the_tables_of_errors_are_against_the_truth_of_each_law() -> None:
    """Its figures are those of a mesh twice refined; the studies themselves tell them to a fifth of a percent."""
    pages = [page.read_text(encoding="utf-8") for page in (ROOT / "README.md", STUDIES)]
    results = [run(read_study(EXAMPLES / f"{name}.toml")) for name in ("stretching", "bending")]
    for name in results[0].comparisons:
        label = results[0].solutions[name].label
        readme, row = (
            re.search(rf"^\| {re.escape(label)} \| ([\d.]+) % \| ([\d.]+) % \|", page, re.MULTILINE) for page in pages
        )
        assert row is not None and readme is not None and row.groups() == readme.groups(), label
        for shown, result in zip(row.groups(), results, strict=True):
            error = result.standings[name].refined_error
            assert error is not None
            assert float(shown) == pytest.approx(100 * error, abs=0.5 if error > 0.1 else 0.2)


@pytest.mark.verification
def test_the_tables_of_errors_are_those_of_the_page_that_measures_them() -> None:
    from docs.build_verification import against_the_truth

    readme, page = (page.read_text(encoding="utf-8").replace("*", "") for page in (ROOT / "README.md", STUDIES))
    rows = re.findall(r"^\| (.*): (.*) \| (.*)% \| (.*)% \|$", against_the_truth(), re.MULTILINE)
    shown = {
        (model, law): " | ".join(f"{float(one):.{0 if float(one) > 10 else 1}f} %" for one in found)
        for model, law, *found in rows
    }
    models = "springs (lloyd)", "springs (gaussian)", "four-node elements"
    laws = {law for _, law in shown}
    assert len(laws) == 4
    for law in laws:
        assert f"| {law} | {' | '.join(shown[model, law] for model in models)} |" in page
        assert f"| {law} | {' | '.join(shown[model, law] for model in models[:2])} |" in readme


def test_the_page_on_hourglass_is_that_of_its_values() -> None:
    from docs.build_hourglass import DOCS, page

    found = json.loads((DOCS / "hourglass.json").read_text(encoding="utf-8"))
    assert page(found) == (DOCS / "hourglass.md").read_text(encoding="utf-8")


def test_links_of_the_pages_lead_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"


def named(row: str) -> tuple[set[Path], list[str]]:
    """Return the files and folders of a row of CONTRIBUTING, and the names in its backticks that none of them is."""
    roots = [ROOT, ROOT / "src" / "truespring"]
    found: set[Path] = set()
    left = []
    for token in re.findall(r"`([^`]+)`", row):
        if token.startswith("out") or "SUFFIX" in token or not re.fullmatch(r"[\w./]+(/|\.(py|md|toml))", token):
            left.append(token)
            continue
        here = next((root / token for root in (*sorted(found), *roots) if (root / token).exists()), None)
        assert here is not None or token == "figures/", f"CONTRIBUTING.md: {token} does not exist"
        found |= {here} if here else set()
    return found, left


def test_files_tables_and_classes_of_contributing_exist() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    rows = [row for row in text.splitlines() if row.startswith("| a")]
    code = "\n".join(file.read_text(encoding="utf-8") for file in (ROOT / "src").rglob("*.py"))
    assert len(rows) > 20
    for row in rows:
        files, names = named(row)
        assert files, row
        lines = "\n".join(one.read_text(encoding="utf-8") for one in files if one.is_file())
        for name in names:
            if re.fullmatch(r"_?[A-Z][A-Z_]+", name) and name not in ("KIND", "HEML"):
                assert re.search(rf"^{name}\b.*=", lines, re.MULTILINE), f"no {name} in a file of: {row}"
            elif re.fullmatch(r"([A-Z][a-z]+)+", name):
                assert re.search(rf"^class {name}\b", code, re.MULTILINE), f"no class {name}: {row}"
    makes = set(re.findall(r"`make (\w+)`", text))
    assert makes <= set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
