"""The scripts of the gallery: public names only, a title, short; run in `make verification`, with their own asserts."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from docs._ext.placeholders import stale

import truespring

GALLERY = Path(__file__).parent.parent / "examples" / "gallery"
SCRIPTS = sorted(GALLERY.glob("*/*.py"))
NAMES = [script.stem for script in SCRIPTS]
# Lines of a script, comments included.
MOST_LINES = 95


def text_of(script: Path) -> str:
    return script.read_text(encoding="utf-8")


def test_the_gallery_has_a_header_and_scripts() -> None:
    assert len(SCRIPTS) >= 14
    for folder in {GALLERY, *(script.parent for script in SCRIPTS)}:
        title, underline, empty, *rest = text_of(folder / "GALLERY_HEADER.rst").splitlines()
        assert underline in ("=" * len(title), "-" * len(title)) and not empty and any(rest)


@pytest.mark.parametrize("script", SCRIPTS, ids=NAMES)
def test_a_script_has_a_title_cells_and_few_lines(script: Path) -> None:
    text = text_of(script)
    docstring = ast.get_docstring(ast.parse(text))
    assert docstring is not None
    title, underline, empty, *rest = docstring.splitlines()
    assert underline == "=" * len(title) and not empty and rest
    assert re.search(r"^# %%$", text, re.MULTILINE)
    assert len(text.splitlines()) <= MOST_LINES


@pytest.mark.parametrize("script", SCRIPTS, ids=NAMES)
def test_a_script_uses_public_names_and_checks_itself(script: Path) -> None:
    tree = ast.parse(text_of(script))
    assert {one.name for node in ast.walk(tree) if isinstance(node, ast.Import) for one in node.names} >= {"truespring"}
    modules = [node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert not [module for module in modules if module.split(".")[0] in ("truespring", "tests")]
    used = {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "ts"
    }
    assert used and not [name for name in used if not hasattr(truespring, name)]
    assert any(isinstance(node, ast.Assert) for node in ast.walk(tree))


@pytest.mark.verification
@pytest.mark.parametrize("script", SCRIPTS, ids=NAMES)
def test_a_script_runs_without_a_warning_and_draws(script: Path) -> None:
    """Its asserts compare with closed forms and references; warnings are errors. It leaves no file behind."""
    before = set(script.parent.iterdir())
    drawn = "import runpy, sys; runpy.run_path(sys.argv[1], run_name='__main__'); import matplotlib.pyplot as plt"
    code = f"{drawn}; sys.exit(0 if plt.get_fignums() else 'no figure')"
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, str(script)],
        env={**os.environ, "MPLBACKEND": "agg"},
        cwd=script.parent,  # as sphinx-gallery, so that the files beside a script are found
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr[-3000:]
    assert set(script.parent.iterdir()) == before


def test_placeholders_of_scripts_that_did_not_run_are_stale(tmp_path: Path) -> None:
    """sphinx-gallery shows NAME_thumb.png before NAME_thumb.gif, also if only the latter is of the script."""
    thumbs = tmp_path / "motion" / "images" / "thumb"
    thumbs.mkdir(parents=True)
    for name in ("ran", "did_not_run"):
        (thumbs / f"sphx_glr_{name}_thumb.png").touch()
    (tmp_path / "motion" / "ran.py.md5").touch()
    assert [thumb.name for thumb in stale(tmp_path)] == ["sphx_glr_did_not_run_thumb.png"]
