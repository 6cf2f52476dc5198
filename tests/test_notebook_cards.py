"""`_repr_html_`: what a notebook shows of a value. The HTML is read by the parser of Python, the picture by Pillow."""

import base64
import io
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from PIL import Image

import truespring as ts
from truespring.showing import progress as bars
from truespring.showing.cards import Card
from truespring.showing.values import _CARDS

# Largest size of a card [bytes]: a notebook with a hundred of them has 10 MB.
MOST = 100_000


class Read(HTMLParser):
    """Text and pictures of HTML; all tags are closed in their order."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.texts: list[str] = []
        self.pictures: list[Any] = []
        self.open: list[str] = []
        self.feed(html)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert tag in {"div", "table", "tr", "th", "td", "b", "img", "progress", "small"}, tag
        if tag != "img":
            self.open.append(tag)
            return
        head, data = (dict(attrs)["src"] or "").split(",")
        assert head == "data:image/png;base64"
        self.pictures.append(Image.open(io.BytesIO(base64.b64decode(data))))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data)


@pytest.fixture(scope="module")
def result() -> Any:
    matplotlib.use("agg")
    problem = ts.Problem(
        mesh=ts.rectangle(size=(0.04, 0.01), elements=(4, 1)),
        material=ts.Material(young=10e3, poisson=0.3),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.1, 0.0))],
    )
    models = {"springs": ts.Springs(rule="lloyd"), "fem": ts.Fem(law="neo-hookean")}
    return ts.verify(problem, models=models, refine=False, title="<b>a & b</b>")


def test_each_value_has_a_table_and_a_picture(result: Any) -> None:
    from matplotlib import pyplot

    springs = result.solutions["springs"]
    values = [result.problem.mesh, result.problem, springs, result.comparison, springs.moduli, result]
    words = ["quadrilateral", "0.3", "converged", "root mean square", "Zener", result.verdict]
    assert [type(value) for value in values] == list(_CARDS)
    for value, word in zip(values, words, strict=True):
        html = value._repr_html_()
        read = Read(html)
        assert word in " ".join(read.texts) and len(html) < MOST
        (picture,) = read.pictures
        ground = np.asarray(picture.convert("RGB"))
        assert (ground[0, 0] == 255).all() and (ground != 255).any() and picture.width < 1000
        assert "color:" not in html.replace("background", "")  # those of the notebook, light or dark
    assert not pyplot.get_fignums()


def test_a_card_of_a_solution_has_the_length_of_its_largest_displacement(result: Any) -> None:
    """Not its largest component: every node moves by (3, 4) mm."""
    springs = result.solutions["springs"]
    last = springs.states[-1]
    moved = replace(last, displacement=np.tile([3e-3, 4e-3], (len(last.displacement), 1)))
    texts = Read(replace(springs, states=(*springs.states[:-1], moved))._repr_html_()).texts
    assert texts[texts.index("largest displacement") + 1] == "5.00 mm"


def test_a_title_of_the_user_is_a_text(result: Any) -> None:
    assert "Result: <b>a & b</b>" in Read(result._repr_html_()).texts


def test_what_cannot_be_drawn_is_a_table(result: Any) -> None:
    springs = result.solutions["springs"]
    still = replace(springs, states=(), status=ts.Status.NOT_CONVERGED, warnings=("<it> failed",))
    read = Read(still._repr_html_())
    assert "<it> failed" in read.texts and not [one for one in read.pictures if one.width < 10]
    many = ts.rectangle(size=(1.0, 1.0), elements=(210, 200))
    assert not Read(many._repr_html_()).pictures


def test_a_long_table_is_cut() -> None:
    read = Read(Card("long", [(str(n), "x") for n in range(100)]).html())
    assert "and 76 more" in read.texts and "99" not in read.texts


# --- progress ----------------------------------------------------------------------------------------


class Shell:
    """A shell of IPython with a kernel, as in Jupyter."""

    kernel = object()


def test_a_notebook_shows_the_progress_of_each_model(monkeypatch: pytest.MonkeyPatch) -> None:
    pages: list[str] = []

    class Handle:
        def update(self, page: Any) -> None:
            pages.append(page.data)

    def display(page: Any, display_id: bool) -> Handle:
        assert display_id
        pages.append(page.data)
        return Handle()

    ipython = pytest.importorskip("IPython")
    monkeypatch.setattr(ipython, "get_ipython", Shell)
    monkeypatch.setattr("IPython.display.display", display)
    monkeypatch.setattr(bars, "_EVERY", 0.0)
    with bars.bars() as advance:
        assert advance is not None
        advance("a<b", "springs", 0.25)
        advance("a<b", "fem", 0.5)
    assert Read(pages[0]).texts == [" a<b: springs ", "25%"] and 'value="0.25" max="1"' in pages[0]
    assert Read(pages[1]).texts[2:] == [" a<b: fem ", "50%"] and pages[-1] == ""
    with bars.counting("points") as count:
        assert count is not None
        count(3, 1, 7)
    assert Read(pages[-2]).texts[-1] == "3 of 7, 1 failed"


def test_nothing_is_shown_without_notebook_and_terminal(capfd: pytest.CaptureFixture[str], result: Any) -> None:
    with bars.bars() as advance, ts.ProgressBar() as bar:
        assert advance is None
        ts.solve(result.problem, ts.Springs(rule="lloyd"), progress=bar)
    assert capfd.readouterr() == ("", "")


def test_a_terminal_shows_a_bar(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with ts.ProgressBar("a [b]") as bar:
        bar(0.5, 3, 1e-3)
    assert "a [b]" in screen.getvalue() and "iteration 3, residual 1e-03" in screen.getvalue()


def test_a_comparison_with_markers_shows_the_springs_themselves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not the springs at the markers, which are a cloud of points."""
    file = tmp_path / "markers.csv"
    file.write_text("x [mm],y [mm],ux [mm],uy [mm]\n60,5,-1,-5\n20,12,0,-1\n", encoding="utf-8")
    problem = ts.Problem(
        mesh=ts.rectangle(size=(0.08, 0.02), elements=(4, 1)),
        material=ts.Material(young=1e4, poisson=0.3),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -0.01))],
    )
    springs, markers = ts.solve(problem, ts.Springs(rule="gaussian")), ts.read_result(file)
    drawn = []

    def plot(solution: ts.Solution, over: ts.Solution, *options: object) -> Any:
        drawn.append((solution, over))
        return solution.plot(over=over)

    monkeypatch.setattr("truespring.showing.values.plot_solution", plot)
    assert Read(ts.compare(springs, markers)._repr_html_()).pictures
    assert drawn == [(springs, markers)]


# --- a real notebook --------------------------------------------------------------------------------

CELLS = (
    """import truespring as ts
problem = ts.Problem(
    ts.rectangle((0.04, 0.01), (4, 1)),
    ts.Material(young=10e3, poisson=0.3),
    ts.PlaneStress(thickness=0.01),
    supports=[ts.Fixed("left")],
    loads=[ts.Force("right", (0.1, 0.0))],
)
models = {"springs": ts.Springs("gaussian"), "fem": ts.Fem("neo-hookean")}
result = ts.verify(problem, models=models, refine=False)
result""",
    "result.solutions['springs'].plot();",
)


@pytest.mark.verification
def test_a_notebook_shows_progress_values_and_figures() -> None:
    """A figure is shown after a card, too, whose picture is drawn by the same library."""
    nbclient, nbformat = pytest.importorskip("nbclient"), pytest.importorskip("nbformat")
    shown: list[str] = []

    class Client(nbclient.NotebookClient):  # type: ignore[misc, name-defined]
        def process_message(self, message: Any, cell: Any, number: int) -> Any:
            if "display_data" in message["msg_type"]:
                shown.append(message["content"]["data"].get("text/html", ""))
            return super().process_message(message, cell, number)

    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(text) for text in CELLS])
    Client(notebook, timeout=120, kernel_name="python3").execute()
    progress, value = notebook.cells[0].outputs
    assert 'value="1" max="1"' in shown[-3] and progress.data["text/html"] == ""
    read = Read(value.data["text/html"])
    assert "Result: problem" in read.texts and len(read.pictures) == 1
    (figure,) = notebook.cells[1].outputs
    assert figure.data["image/png"]
