"""The tutorials: each is a notebook of Python cells, with links that lead somewhere; the long test runs it."""

import ast
import re
from pathlib import Path

import pytest

TUTORIALS = Path(__file__).parents[1] / "docs" / "tutorials"
NOTEBOOKS = sorted(page for page in TUTORIALS.glob("*.md") if page.name != "index.md")
names = pytest.mark.parametrize("page", NOTEBOOKS, ids=lambda page: page.stem)


def cells(page: Path) -> list[str]:
    """Return the code of each cell, without its options."""
    text = page.read_text(encoding="utf-8")
    found = re.findall(r"^```\{code-cell\}[^\n]*\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    return [re.sub(r"\A(:[^\n]*\n)+", "", cell) for cell in found]


@names
def test_a_tutorial_is_a_notebook(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert re.match(r"---\n.*?kernelspec:\n.*?name: python3\n.*?---\n\n# \S", text, re.DOTALL)
    for cell in cells(page):
        ast.parse(cell, page.name)
    code = "\n".join(cells(page))
    assert "import truespring as ts" in code and "assert " in code
    assert "**You will learn**" in text and "\n## What next\n" in text


@names
def test_links_and_pictures_of_a_tutorial_exist(page: Path) -> None:
    prose = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    targets = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", prose)
    assert targets
    for target in targets:
        assert (page.parent / target).exists(), f"{page.name} links to {target}"


def test_the_page_of_tutorials_shows_each_with_a_picture() -> None:
    index = (TUTORIALS / "index.md").read_text(encoding="utf-8")
    assert len(NOTEBOOKS) >= 8
    stems = [page.stem for page in NOTEBOOKS]
    assert sorted(re.findall(r"^:link: (\S+)$", index, re.MULTILINE)) == stems
    tree = re.search(r"```\{toctree\}\n:hidden:\n\n(.*?)```", index, re.DOTALL)
    assert tree is not None and sorted(tree[1].split()) == stems
    pictures = re.findall(r"^:img-top: (\S+)$", index, re.MULTILINE)
    assert len(pictures) == len(stems) and all((TUTORIALS / picture).exists() for picture in pictures)


@pytest.mark.verification
@names
def test_a_tutorial_runs(page: Path, tmp_path: Path) -> None:
    """A notebook runs to its end in an empty folder, shows its pictures, and leaves nothing beside its page."""
    jupytext = pytest.importorskip("jupytext")
    nbclient = pytest.importorskip("nbclient")
    before = sorted(TUTORIALS.iterdir())
    notebook = jupytext.read(page)
    nbclient.NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    ).execute()
    drawing = [cell for cell in notebook.cells if re.search(r"subplots\(|\.plot\(", cell.source) and "outputs" in cell]
    assert drawing
    for cell in drawing:
        assert any("image/png" in output.get("data", {}) for output in cell.outputs), cell.source
    assert sorted(TUTORIALS.iterdir()) == before
