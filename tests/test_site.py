"""The site: parts made from the program are whole, links are checked, search finds a word."""

import functools
import http.server
import re
import shutil
import subprocess
import sys
import threading
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import truespring as ts
from tests.browser import CHROMIUM
from truespring.cli.parser import VERBS
from truespring.models import LAWS, RULES
from truespring.study.schema import StudyKeys

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture
def parts(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """The parts of pages that are made from the program."""
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    from generated import PARTS

    return {name: make() for name, make in PARTS.items()}


def test_no_line_of_a_page_is_a_comment_of_myst() -> None:
    # A line that begins with a percent sign is left out of the page, and splits the sentence.
    pages = [page for page in DOCS.rglob("*.md") if "_build" not in page.parts]
    assert len(pages) > 80
    prose = {page: re.sub(r"```.*?```|\$\$.*?\$\$", "", page.read_text("utf-8"), flags=re.DOTALL) for page in pages}
    assert not {page.name: lines for page, text in prose.items() if (lines := re.findall(r"^ *%.*", text, re.M))}


def test_generated_parts_hold_every_key_verb_and_name(parts: dict[str, str]) -> None:
    tables = StudyKeys.model_json_schema()
    keys = {key for one in (tables, *tables["$defs"].values()) for key in one["properties"]}
    assert len(keys) > 80
    assert not {key for key in keys if f"`{key}` |" not in parts["study-keys"]}
    assert not {verb for verb in VERBS if f"\n## {verb}\n" not in parts["commands"]}
    assert "`--held-out" in parts["commands"] and "truespring new strip" in parts["commands"]
    assert not {name for name in ts.__all__ if f"[`{name}`](api/{name}.rst)" not in parts["public-names"]}
    assert not {name for name in (*RULES, *LAWS) if f"| `{name}` | " not in parts["sources"]}


def test_a_public_name_without_a_topic_is_an_error(parts: dict[str, str], monkeypatch: pytest.MonkeyPatch) -> None:
    import public_names

    for topics in ({"Rest": ("Mesh",)}, public_names.TOPICS | {"More": ("Mesh",)}, {"Rest": ("nobody",)}):
        monkeypatch.setattr(public_names, "TOPICS", topics)
        with pytest.raises(ValueError, match="public names with no topic"):
            public_names.public_names()


def test_broken_links_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS))
    from check_links import broken

    (tmp_path / "a.html").write_text('<a href="b.html#there">b</a><a href="https://elsewhere.org/x">x</a>', "utf-8")
    (tmp_path / "b.html").write_text('<h1 id="there">b</h1><a href="#there">up</a>', "utf-8")
    assert broken(tmp_path) == []
    (tmp_path / "c.html").write_text('<a href="b.html#not">b</a><img src="d.png"><a href="#no">c</a>', "utf-8")
    found = [line.partition(": ")[2] for line in broken(tmp_path)]
    assert found == ["b.html#not: no such anchor", "d.png: no such file", "#no: no such anchor"]


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """Address of the site, built without notebooks and gallery, and served."""
    pytest.importorskip("sphinx")
    folder = tmp_path_factory.mktemp("site")
    shutil.copytree(DOCS.parent, folder / "project", ignore=shutil.ignore_patterns(".*", "out", "node_modules"))
    docs = folder / "project" / "docs"
    command = [sys.executable, "-m", "sphinx", *["-t", "quick", "-W", "--keep-going", "-n", "-q", "-b", "html"]]
    subprocess.run([*command, str(docs), str(folder / "html")], check=True, timeout=560)
    subprocess.run([sys.executable, str(DOCS / "check_links.py"), str(folder / "html")], check=True)

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None: ...

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder / "html"))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()


@pytest.mark.verification
def test_types_in_signatures_lead_to_their_pages(address: str) -> None:
    """The strict build ignores types without a page; those of public names have one."""
    with urllib.request.urlopen(f"{address}/reference/api/solve.html") as page:
        links = set(re.findall(r'href="(\w+)\.html#truespring\.\w+"', page.read().decode("utf-8")))
    assert {"Problem", "Solution"} <= links


@pytest.mark.verification
@pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium")
def test_search_finds_gaussian_and_pages_fit_a_phone(address: str, browser: Any) -> None:
    page = browser.new_page()
    page.goto(f"{address}/search.html?q=gaussian")
    page.wait_for_selector("#search-results li a")
    titles = page.locator("#search-results li a").all_inner_texts()
    assert any("Gaussian springs" in title for title in titles)
    page.goto(f"{address}/search.html?q=nosuchwordanywhere")
    page.wait_for_selector("#search-results p")
    assert page.locator("#search-results li a").count() == 0
    page.set_viewport_size({"width": 390, "height": 800})
    for name in ("index", "start/own-body", "theory/springs", "reference/keys", "howto/pressure", "models"):
        page.goto(f"{address}/{name}.html")
        assert page.evaluate("document.documentElement.scrollWidth") <= 390, name
