"""What a reader takes from a page: tables as in the output folder, the animation, pictures with the names of files."""

import base64
import csv
import io
import re
from pathlib import Path

import pytest
from PIL import Image

import truespring as ts
from truespring.report import downloads as taking
from truespring.report.downloads import films_in
from truespring.report.page import render_page
from truespring.report.result import Result


@pytest.fixture(scope="module")
def pulled() -> Result:
    problem = ts.Problem(
        ts.rectangle((0.08, 0.02), (4, 1)),
        ts.Material(10e3, 1 / 3),
        ts.PlaneStress(0.01),
        [ts.Fixed("left"), ts.Fixed("right", displacement=(0.008, 0.0))],
    )
    paths = {"springs": ts.solve(problem, ts.Springs("lloyd"), ts.Newton(load_steps=2))}
    paths["linear"] = ts.solve(problem, ts.Fem("linear"), ts.Newton(load_steps=2))
    compared = {"linear": ts.compare(paths["springs"], paths["linear"], 9)}
    return Result("Pulled", Path("pulled.toml"), problem, paths, 9, "springs", compared, 0.05, "")


def links(page: str) -> dict[str, bytes]:
    """Return the content of each data URL that the page offers, by the name under which it is saved."""
    found = re.findall(r'<a href="data:[\w/]+;base64,([^"]*)" download="([^"]+)"', page)
    return {name: base64.b64decode(content) for content, name in found}


def test_tables_are_those_of_the_solutions(pulled: Result) -> None:
    found = links(render_page([pulled], None))
    assert set(found) == {"pulled_curves.csv", "pulled_reactions.csv"}
    text = "\n".join(line for line in found["pulled_curves.csv"].decode().splitlines() if not line.startswith("#"))
    last = [row for row in csv.reader(io.StringIO(text)) if row and row[0] == "springs"][-1]
    moved, force = (float(last[column]) for column in (2, 4))
    state = pulled.solutions["springs"].states[-1]
    assert moved == pytest.approx(0.008)
    assert force == pytest.approx(state.reaction[pulled.problem.held[1].nodes, 0].sum())


def test_the_animation_is_part_of_the_page(pulled: Result, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Image.new("RGB", (4, 4)).save(tmp_path / "animation.gif")
    (tmp_path / "animation.mp4").write_bytes(b"film")
    films = films_in(tmp_path)
    page = render_page([pulled], None, [films])
    assert links(page)["pulled_animation.mp4"] == b"film"
    shown = re.findall(r'<img src="data:image/gif;base64,([^"]*)"[^>]* data-name="([^"]*)"', page)
    assert [(base64.b64decode(content), name) for content, name in shown] == [
        (films["animation.gif"], "pulled_animation")
    ]
    monkeypatch.setattr(taking, "_LARGEST_FILM", 3)
    page = render_page([pulled], None, [films])
    assert "image/gif" not in page and "<code>animation.mp4</code> in the output folder" in page


def test_pictures_have_the_names_of_their_files(pulled: Result) -> None:
    from truespring.report.figures import render_figures

    names = re.findall(r'<img [^>]*data-name="([^"]*)"', render_page([pulled], None))
    assert names and set(names) <= {f"pulled_{name}" for name in render_figures(pulled)}
