"""The report on a motion: labels in seconds, three errors, film strips, energies, tools, animations."""

import re
import sys
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

import truespring as ts
from tests.studies import changed, written
from tests.test_report import Page, called, page_of, words
from tests.test_tools import angle, write_stl
from tests.wording import in_order
from truespring.cli import main
from truespring.dynamics import Energies, Moving
from truespring.report.animation import NO_VIDEO, write_animation
from truespring.report.axis import axis_of, history_words
from truespring.report.bodies3d import one_color, solid
from truespring.report.figures import draw_figures
from truespring.report.page import render_page
from truespring.report.render import Layer
from truespring.report.result import MotionErrors, Result
from truespring.report.summary import summary
from truespring.report.surfaces import seen
from truespring.report.tables import result_tables
from truespring.report.timelines import energies_figure
from truespring.report.touching import drawn_tools, with_tools
from truespring.report.verdict import verdict, verdict_sentences
from truespring.report.viewer import viewer
from truespring.sweeping.figures import measured
from truespring.sweeping.table import rows_of
from truespring.tools import TOOLS, Tool

__all__ = ["page_of"]  # a fixture

DURATION = 0.4
BALL = ts.Sphere("ball", 0.01, [[0, 0.06, 0.04], [0.4, 0.06, 0.02]])


def problem(tools: Sequence[Tool] = (), dynamics: ts.Dynamics | None = None, over: Any = None) -> ts.Problem:
    """A strip of 4 x 1 squares, held at its left, with a force at its right."""
    return ts.Problem(
        mesh=ts.rectangle(size=(0.08, 0.02), elements=(4, 1)),
        material=ts.Material(young=10e3, poisson=0.3, density=1000.0),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -0.1), over=over)],
        dynamics=dynamics,
        tools=tools,
    )


def moved(body: ts.Problem, factor: float, kind: str, n: int = 20, until: float = 1.0) -> ts.Solution:
    """A path whose nodes swing along y by `factor` x^2 sin(2 pi level), with energies of which the sum is the work."""
    nodes = body.mesh.nodes
    states = []
    for level in np.linspace(0, until, round(n * until) + 1).tolist():
        displacement = np.column_stack([0 * nodes[:, 0], factor * 5 * nodes[:, 0] ** 2 * np.sin(2 * np.pi * level)])
        energies = Energies(1e-3 + 2e-3 * level, 1e-3 * level, -5e-3 * level, 0.0, 3e-3 * level, -1e-3 * level)
        states.append(
            ts.State(
                load_factor=level,
                positions=nodes + displacement,
                all_positions=nodes + displacement,
                displacement=displacement,
                reaction=np.zeros_like(nodes),
                applied_force=np.array([0.0, -0.1]),
                energy=energies.elastic,
                iterations=3,
                residual=1e-12,
                negative_eigenvalues=None,
                branched=False,
                area_ratio=0.9,
                stretch=None,
                level=level,
                touches=body.loading.touches(nodes, level),
                moving=Moving(level * (body.duration or 1.0), 0 * nodes, energies),
            )
        )
    springs = kind == "springs"
    done = ts.Status.CONVERGED if until == 1 else ts.Status.NOT_CONVERGED
    return ts.Solution(
        body,
        "springs (gaussian)" if springs else "neo-Hookean FEM",
        kind,
        tuple(states),
        done,
        has_springs=springs,
        element=None if springs else "linear",
        n_unknowns=16,
    )


def result(
    error: float = 0.02, splits: MotionErrors | None = None, body: ts.Problem | None = None, until: float = 1.0
) -> Result:
    """Springs that swing further than FEM by the share `error`."""
    body = problem(dynamics=ts.Dynamics(DURATION, 0.004, "bdf2")) if body is None else body
    springs, fem = moved(body, 1 + error, "springs", until=until), moved(body, 1.0, "fem")
    return Result(
        title="A swing",
        file=Path("swing.toml"),
        problem=body,
        solutions={"springs": springs, "fem": fem},
        probe=ts.named_point(body.mesh, "right-middle"),
        model="springs",
        comparisons={"fem": ts.compare(springs, fem)},
        tolerance=0.05,
        source="",
        splits=splits,
    )


# --- levels in words ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "label", "level", "full", "whole"),
    [
        (problem(dynamics=ts.Dynamics(0.4, 0.01)), "time [s]", "0.16 s", "0.4 s", "over the whole motion of 0.4 s"),
        (problem(dynamics=ts.Dynamics(5e-3, 1e-3)), "time [ms]", "2 ms", "5 ms", "over the whole motion of 5 ms"),
        (problem(dynamics=ts.Dynamics(60.0, 1.0)), "time [s]", "24 s", "60 s", "over the whole motion of 60 s"),
        (problem(), "load factor", "load factor 0.4", "full load", "at full load"),
        (
            problem(over=[[0, 0], [0.5, 1], [1, 0]]),
            *("share of the way", "0.4 of the way", "the end of the way", "over the whole way"),
        ),
    ],
    ids=["seconds", "milliseconds", "a minute", "load", "history"],
)
def test_levels_are_times_in_a_motion(body: ts.Problem, label: str, level: str, full: str, whole: str) -> None:
    axis = axis_of(result(body=body))
    assert (axis.label, axis.words(0.4), axis.words(1.0), axis.at_full) == (label, level, full, whole)


def test_a_page_on_a_motion_says_nothing_of_load_levels(page_of: Any) -> None:
    page: Page = page_of(result(0.02, MotionErrors(0.01, 0.0)))
    said = " ".join(" ".join(page.said).replace("\N{NO-BREAK SPACE}", " ").split())
    assert not re.search(r"load factor|load level|full load", said)
    assert in_order(said, "over the whole motion of 0.4 s", "springs stay within 5 %", "the model", "0.4 s by bdf2")


def test_a_motion_that_stops_is_named_by_its_time() -> None:
    text = verdict(result(0.02, until=0.5))
    assert in_order(text, "springs could not be followed beyond 0.2 s", "up to 0.2 s", "ends at 0.2 s")


def test_without_a_reference_the_motion_is_described() -> None:
    found = result()
    alone = Result(**{name: getattr(found, name) for name in Result.__dataclass_fields__} | {"comparisons": {}})
    assert in_order(verdict(alone), "springs were followed over the whole motion of 0.4 s", "nothing was compared")


def test_a_sweep_shows_the_largest_displacement_of_a_motion() -> None:
    """At the end of a whole period the body is back; a quarter before it was furthest."""
    values = summary(result(0.1)) | {"comparison": {}}
    (row,) = rows_of(["k"], [{"values": {"k": 1}, "status": "converged", "reason": "", "summary": values}])
    assert row["models.springs.largest_probe_displacement"] == pytest.approx(1.1 * 5 * 0.08**2)
    assert next(measured([row])).values["springs"] == [pytest.approx(1.1 * 5 * 0.08**2 * 1e3)]  # [mm]


def test_an_exception_ends_a_motion_at_a_time() -> None:
    body = problem(dynamics=ts.Dynamics(0.4, 0.1, "bdf2"))
    (said,) = [one for one in ts.solve(body, ts.Springs("isotropic"), timeout=0.0).warnings if "stopped" in one]
    assert said.startswith("stopped beyond 0 s: the time limit") and "load_steps" not in said


# --- three errors ---------------------------------------------------------------------------------

EULER = {"duration": DURATION, "step": 0.004, "scheme": "euler"}


@pytest.mark.parametrize(
    ("model", "step", "solver", "asked", "parts"),
    [
        (0.03, 0.36, 0.03, EULER | {"iterations": 2}, ("time step", "36 %", "shorter step, or bdf2 instead of euler")),
        (0.03, 0.36, 0.0, EULER | {"scheme": "bdf2"}, ("time step", "36 %", "shorter step")),
        (0.03, 0.07, 0.0, EULER | {"step": "auto"}, ("time step", "7.0 %", "smaller accuracy")),
        (0.03, 0.02, 0.12, EULER | {"iterations": 1}, ("solver", "12 %", "more than 1")),
        (0.08, 0.02, 0.01, EULER, ("model", "8.0 %", "do not reduce it")),
        (0.02, 0.01, 0.0, EULER, ("model", "2.0 %", "below 5 %")),
        (0.30, 0.09, 0.06, EULER | {"iterations": 2}, ("model", "30 %", "the time step, 9.0 %", "the solver, 6.0 %")),
    ],
    ids=["step", "step of bdf2", "automatic", "solver", "model", "small", "all"],
)
def test_the_verdict_names_the_largest_error_and_what_reduces_it(
    model: float, step: float, solver: float, asked: dict[str, Any], parts: tuple[str, ...]
) -> None:
    found = result(model, MotionErrors(step, solver), problem(dynamics=ts.Dynamics(**asked)))
    sentences = verdict_sentences(found)
    (largest,) = [one for one in sentences if "largest error" in one]
    assert in_order(largest, f"The {parts[0]} is the largest", *parts[1:])
    assert largest.casefold().count(f"the {parts[0]}") == 1
    (listed,) = [one for one in sentences if one.startswith("Errors over the whole motion of 0.4 s: model")]
    shown = [round(100 * value) for value in (model, step, solver)]
    assert [round(float(one)) for one in re.findall(r"([\d.]+) % \(", listed)] == shown
    assert in_order(listed, "against neo-Hookean FEM", "steps half as long", "solved")
    trusted = max(step, solver) < 0.05
    assert ("within 5 %" in sentences[0]) == trusted
    assert (sentences[0] == largest) == (not trusted)
    named = parts[0] if step or solver else "model"
    assert summary(found)["motion"]["largest"] == named
    assert [round(100 * summary(found)["motion"][f"{one}_error"]) for one in ("model", "step", "solver")] == shown


def test_an_error_that_is_not_known_is_said() -> None:
    text = verdict(result(0.02, MotionErrors(None, 0.0, ("steps half as long were not computed: time limit",))))
    assert in_order(text, "time step not known", "not computed: time limit")


def test_the_terminal_has_a_table_of_the_errors() -> None:
    tables = list(result_tables(result(0.03, MotionErrors(0.36, 0.0))))
    (table,) = [one for one in tables if "Separate errors" in str(getattr(one, "title", ""))]
    cells = [list(column.cells) for column in table.columns]  # type: ignore[union-attr]
    assert cells[0] == ["model", "time step", "solver"] and cells[2] == ["3.0 %", "36 %, largest", "0 %"]


# --- figures --------------------------------------------------------------------------------------


def test_a_film_strip_has_evenly_spaced_instants() -> None:
    found = result(0.1)
    figures = draw_figures(found)
    assert {"film_fem", "curves", "energies_springs", "energies_fem"} <= set(figures)
    assert "springs_over_fem" not in figures  # the last state of a motion says little
    strip = figures["film_fem"]
    times = [float(text.split(" s")[0]) for text in words(strip) if re.match(r"[\d.]+ s", text)]
    assert times[-1] == DURATION and len(times) == 6 and np.ptp(np.diff(times)) <= 0.0201
    assert len(called(strip, "model")) == len(called(strip, "reference")) == 6
    first, last = (called(strip, "model")[place].get_path().vertices for place in (0, -1))
    assert np.abs(first - last).max() > 1.0  # [mm]


def test_the_motion_of_the_probe_is_drawn_over_seconds() -> None:
    found = result(0.1)
    figure = draw_figures(found)["curves"]
    assert "time [s]" in words(figure)
    line = next(one for one in figure.artists if one.get_label() == "springs (gaussian)")
    x, y = line.get_data()  # type: ignore[attr-defined]
    assert x[-1] == pytest.approx(DURATION) and y[5] == pytest.approx(-1.1 * 5 * 0.08**2 * 1e3)  # down is positive


def test_the_stack_of_energies_is_the_work() -> None:
    """Of the made-up energies, 1 at the begin, 3 + 1 + 3 - 1 = 6 mJ at the end; what the scheme added is below zero."""
    figure = energies_figure(result(), "springs")
    tops = {name: called(figure, name)[0].get_xy() for name in ("kinetic", "elastic", "damped", "numerical")}
    n = 21
    ends = {name: tuple(sorted((corners[n - 1, 1], corners[n, 1]))) for name, corners in tops.items()}
    assert ends["kinetic"] == pytest.approx((0, 3)) and ends["elastic"] == pytest.approx((3, 4))
    assert ends["damped"] == pytest.approx((4, 7)) and ends["numerical"] == pytest.approx((-1, 0))
    (work,) = called(figure, "work")
    assert work.get_ydata()[[0, -1]] == pytest.approx([1, 6])
    assert tops["numerical"][:, 1].max() <= 0 and "energy at the begin and work done" in words(figure)
    assert "the scheme added 17 % of the work" in figure.title
    assert "The scheme itself added 17 % of the energy" in verdict(result(0.02, MotionErrors(0.01, 0.0)))


# --- tools ----------------------------------------------------------------------------------------


def of_every_shape(dim: int, folder: Path | None = None) -> dict[str, Tool]:
    """One tool of each shape; a solid only in space, where a file can be written to a folder."""
    still = (0.01, 0.02, 0.03)[:dim]
    return {
        "sphere": ts.Sphere("tool", 0.03, still),
        "capsule": ts.Capsule("tool", 0.01, (-0.02, 0.0, 0.01)[:dim], (0.01, 0.03, 0.0)[:dim], still),
        "plane": ts.HalfSpace("tool", (0.4, -2.0, 0.3)[:dim], still),
        "box": ts.Block("tool", (0.02, 0.03, 0.04)[:dim], still),
        **(
            {"stl": ts.StlTool("tool", write_stl(angle(0.02), folder / "tool.stl"), still)}
            if folder and dim == 3
            else {}
        ),
    }


@pytest.mark.parametrize(("dim", "shape"), [(dim, one) for dim in (2, 3) for one in TOOLS if dim == 3 or one != "stl"])
def test_what_is_drawn_of_a_tool_is_its_surface(dim: int, shape: str, tmp_path: Path) -> None:
    """The gap of drawn points is zero, that of the middles of lines and facets below the sagitta; facets face out."""
    tool = of_every_shape(dim, tmp_path)[shape]
    skin = tool.skin(np.full(dim, 0.01), 0.1)
    assert skin is not None and (len(skin.facets) > 0 or shape == "plane" or dim == 2)
    assert np.abs(tool.gaps(skin.points)[0]).max() < 1e-12
    middles = [skin.points[pairs].mean(axis=1) for pairs in (skin.lines, skin.facets) if len(pairs)]
    assert np.abs(tool.gaps(np.concatenate(middles))[0]).max() < 0.02 * 0.03
    if len(skin.facets):
        a, b, c, d = np.moveaxis(skin.points[skin.facets], 1, 0)
        across = np.cross(c - a, d - b)
        assert (np.einsum("ij,ij->i", across, tool.gaps((a + b + c + d) / 4)[1]) > 0).all()


def test_a_tool_is_drawn_where_it_is() -> None:
    dynamics = ts.Dynamics(DURATION, 0.004, "bdf2")
    found = result(0.1, body=problem([BALL], dynamics))
    figures = draw_figures(found)
    assert "tools" in figures and "tool" in words(figures["undeformed"])
    (circle,) = called(figures["undeformed"], "tool")
    distance = np.linalg.norm(circle.get_path().vertices - (60, 40), axis=1)
    assert distance == pytest.approx(10)
    last = called(figures["film_fem"], "tool")[-1].get_path().vertices
    assert np.linalg.norm(last - (60, 20), axis=1) == pytest.approx(10)
    (drawn,) = drawn_tools(found.problem, 0.5)
    assert np.linalg.norm(drawn.points - (0.06, 0.03), axis=1) == pytest.approx(0.01)


# --- animations -----------------------------------------------------------------------------------


def test_an_animation_has_a_frame_for_each_recorded_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("truespring.report.animation.importlib.util.find_spec", lambda name: None)
    assert write_animation(result(0.1), tmp_path) == NO_VIDEO
    with Image.open(tmp_path / "animation.gif") as film:
        assert film.n_frames == 21 and all(length % 2 == 0 for length in film.size)  # type: ignore[attr-defined]
        frames = []
        for number in range(film.n_frames):  # type: ignore[attr-defined]
            film.seek(number)
            frames.append(np.asarray(film.convert("RGB")).astype(int))
    assert [file.name for file in tmp_path.iterdir()] == ["animation.gif"]
    assert (tmp_path / "animation.gif").stat().st_size < 200_000
    red = np.abs(frames[5] - (0xD3, 0x22, 0x2A)).max(axis=2) < 30  # the probe, lowest and highest
    assert red.any() and np.abs(frames[5] - frames[15]).max() > 100


def test_an_animation_has_at_most_sixty_frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("truespring.report.animation.FRAMES", 4)
    sent: list[bytes] = []
    sizes: list[tuple[int, int]] = []

    def write_frames(file: str, size: tuple[int, int], **how: Any) -> Any:
        sizes.append(size)
        while True:
            frame = yield
            if frame is not None:
                sent.append(frame)

    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", SimpleNamespace(write_frames=write_frames, __spec__=object()))
    monkeypatch.setattr("truespring.report.animation.importlib.util.find_spec", lambda name: object())
    assert write_animation(result(0.1), tmp_path) == ""
    assert len(sent) == 4 and {len(one) for one in sent} == {3 * sizes[0][0] * sizes[0][1]}


def test_the_verb_writes_an_animation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    dynamics = '[dynamics]\nduration = "30 ms"\nstep = "10 ms"\nscheme = "euler"\n\n[solver]'
    study = changed(
        ("elements = [8, 2]", "elements = [4, 1]"),
        ("poisson = 0.3", 'poisson = 0.3\ndensity = "1000 kg/m^3"'),
        ("[solver]\nload_steps = 2", dynamics),
    )
    assert main(["solve", str(written(tmp_path, study)), "--out", str(tmp_path), "--animate"]) == 0
    with Image.open(tmp_path / "study" / "animation.gif") as film:
        assert film.n_frames == 4  # type: ignore[attr-defined]
    assert "time [ms]" in capsys.readouterr().out


def test_a_page_shows_the_film_and_the_energies() -> None:
    page = render_page([result(0.02, MotionErrors(0.3, 0.0))], None)
    for words_of in ("Film strip", "Over time", "Energies of springs", "Separate errors of displacement", "largest"):
        assert words_of in page


def test_a_history_is_listed_with_its_load() -> None:
    rows = [[0, 0], [0.05, 1], [0.1, 0]]
    moving = problem(dynamics=ts.Dynamics(0.4, 0.01), over=rows)
    assert history_words(moving, rows) == ", times 0 at 0 s, 1 at 0.05 s, 0 at 0.1 s"
    assert history_words(problem(over=rows), rows) == ", times 0 at 0, 1 at 0.05, 0 at 0.1 of the way"
    assert (
        history_words(moving, None) == "" and history_words(moving, [[k, k % 2] for k in range(9)]).count(" at ") == 5
    )


def test_an_unloaded_end_is_not_the_first_view() -> None:
    data = viewer(result(0.1), 10_000)
    assert data is not None
    assert data["start"] == 5 and data["axis"]["unit"] == "s"  # a quarter of the period
    assert data["paths"][0]["moved"][0] == data["paths"][0]["moved"][-1] == "0 m"


def test_in_space_tools_hide_what_is_behind_them() -> None:
    """Their faces are in every layer, coloured where those of the body are, and their lines are drawn last."""
    ball = ts.Sphere("ball", 0.01, [[0, 0.03, 0.04, 0.01], [0.4, 0.03, 0.02, 0.01]])
    body = ts.Problem(
        ts.box((0.04, 0.02, 0.02), (2, 1, 1)),
        ts.Material(young=10e3, poisson=0.3, density=1000.0),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -0.1, 0.0))],
        dynamics=ts.Dynamics(DURATION, 0.004, "bdf2"),
        tools=[ball],
    )
    skin = ball.skin(np.zeros(3), 0.1)
    (drawn,) = drawn_tools(body, 0.5)
    assert seen(np.array([0.03, 0.03, 0.01]) + skin.points) == pytest.approx(drawn.points)
    facets = body.mesh.boundary
    points = seen(body.mesh.nodes)
    layers = (
        solid(points, facets, one_color(facets, "#ffffff"), facets[:, :2], "#000000", 1.0),
        Layer(points[facets], None, points[facets[:, :2]], np.zeros((0, 2), dtype=int), "#0072b2", 1.0),
    )
    first, second, last = with_tools(layers, [drawn])
    n = len(facets) + len(skin.facets)
    assert [one.faces.shape for one in (first, second, last)] == [(n, 4, 3)] * 3
    assert first.colors is not None and first.colors.shape == (n, 4, 3)
    assert second.colors is None and last.colors is None
    silhouette = np.linalg.norm(last.lines[..., :2] - seen(np.array([0.03, 0.03, 0.01]))[:2], axis=-1)
    assert len(last.lines) > 20 and silhouette.min() > 0.95 * 0.01  # a circle in the picture


@pytest.mark.parametrize("dim", [2, 3])
def test_a_grasp_is_drawn_by_its_radius(dim: int) -> None:
    skin = ts.Grasp("forceps", (0.0,) * dim, 0.012, (0.0,) * dim).skin(np.zeros(dim), 0.1)
    assert np.linalg.norm(skin.points, axis=1) == pytest.approx(0.012)
    along = np.linalg.norm(np.diff(skin.points[skin.lines], axis=1)[:, 0], axis=1)
    assert along.sum() == pytest.approx((1 if dim == 2 else 3) * 2 * np.pi * 0.012, rel=2e-3)


def test_errors_are_those_of_displacement_where_forces_are_compared() -> None:
    dynamics = ts.Dynamics(DURATION, 0.004, "bdf2")
    splits = MotionErrors(0.01, 0.0)
    text = verdict(result(0.02, splits, problem([BALL], dynamics)))
    assert in_order(text, "the model is the largest error of the motion in displacement", "errors in displacement over")
    assert "of the motion in displacement" not in verdict(result(0.02, splits))
