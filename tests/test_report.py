"""The verdict in words, the figures and the page, on paths whose errors are known by construction."""

import base64
import csv
import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path as FilePath
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch, Rectangle

import truespring as ts
from tests.wording import in_order
from truespring.mesh import Surface
from truespring.reference import Level, Placing, Record, placed
from truespring.report.bodies import undeformed_figure
from truespring.report.curves import write_reactions
from truespring.report.drawing import Drawing
from truespring.report.figures import draw_figures, over_name, save_figures
from truespring.report.frame import round_numbers, written
from truespring.report.page import render_page, write_page
from truespring.report.plots import _apart, _uncrossed
from truespring.report.quantity import input_quantity, percent, quantity, round_factor, significant
from truespring.report.result import Result
from truespring.report.sheet import Area, Sheet
from truespring.report.style import figure_style
from truespring.report.summary import summary
from truespring.report.support_curves import support_figures
from truespring.report.symbols import find_arrows
from truespring.report.undeformed import undeformed_of
from truespring.report.verdict import (
    carrying_sentence,
    closest_sentence,
    drive,
    force_sentence,
    mesh_sentence,
    moduli_sentence,
    verdict,
)
from truespring.report.words import draw_words, text_width
from truespring.solvers import Cost

LEVELS = (0.2, 0.4, 0.6, 0.8, 1.0)
LABELS = {"linear": "linear FEM", "svk": "St. Venant-Kirchhoff FEM", "hencky": "Hencky FEM"}


def stretched(**supports: Any) -> ts.Problem:
    """A strip of 4 x 1 squares pulled along x, or moved where supports are given."""
    return ts.Problem(
        mesh=ts.rectangle(size=(0.08, 0.02), elements=(4, 1)),
        material=ts.Material(young=10e3, poisson=1 / 3),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left"), *supports.get("more", ())],
        loads=supports.get("loads", [ts.Force(on="right", total=(0.4, 0.0))]),
    )


def path(
    problem: ts.Problem,
    factors: Sequence[float] = (1,) * 5,
    levels: Sequence[float] = (0.0, *LEVELS),
    **more: Any,
) -> ts.Solution:
    """A path that moves every node in proportion to its x, at each loaded level by `factors` times the level."""
    loaded = dict(zip(LEVELS, factors, strict=True))
    nodes = problem.mesh.nodes
    shape = np.column_stack([nodes[:, 0], 0 * nodes[:, 0]])
    states = []
    for level in levels:
        displacement = 0.3 * level * loaded.get(level, 0.0) * shape
        states.append(
            ts.State(
                load_factor=level,
                positions=nodes + displacement,
                all_positions=nodes + displacement,
                displacement=displacement,
                reaction=np.zeros_like(nodes),
                applied_force=level * problem.loading.external_force.sum(axis=0),
                energy=0.0,
                iterations=3,
                residual=1e-12,
                negative_eigenvalues=0,
                branched=False,
                area_ratio=0.9,
                stretch=None,
                level=level,
            )
        )
    values = {"label": "linear FEM", "kind": "fem", "status": ts.Status.CONVERGED, **more}
    values |= {"has_springs": values["kind"] == "springs", "element": "linear" if values["kind"] == "fem" else None}
    return ts.Solution(problem=problem, states=tuple(states), **values)


def result(
    model: ts.Solution,
    references: Mapping[str, ts.Solution],
    title: str = "A strip",
    stem: str = "strip",
    name: str = "springs",
) -> Result:
    probe = ts.named_point(model.problem.mesh, "right-middle")
    return Result(
        title=title,
        file=FilePath(f"{stem}.toml"),
        problem=model.problem,
        solutions={name: model, **references},
        probe=probe,
        model=name,
        comparisons={key: ts.compare(model, one, probe, 0.05) for key, one in references.items()},
        tolerance=0.05,
        source='# A strip of\n# soft stuff.\ntitle = "A strip"  # <as written>\n',
    )


def said(errors: Mapping[str, Sequence[float]], **model: Any) -> str:
    """The verdict on springs whose rms error against each reference is given by level."""
    problem = stretched()
    springs = path(problem, label="springs (lloyd)", kind="springs", **model)
    references = {
        key: path(problem, [1 / (1 + error) for error in values], label=LABELS[key]) for key, values in errors.items()
    }
    return verdict(result(springs, references))


@pytest.mark.parametrize(
    ("errors", "parts"),
    [
        (
            {"linear": (0.01, 0.01, 0.01, 0.01, 0.021)},
            ("up to full load", "5 % of linear FEM.", "full load", "linear FEM 2.1 %"),
        ),
        (
            {"linear": (0.01, 0.02, 0.2, 0.3, 0.34), "svk": (0.03, 0.04, 0.06, 0.1, 0.123)},
            ("up to load factor 0.4", "5 % of both", "full load", "St. Venant-Kirchhoff FEM 12 %", "linear FEM 34 %"),
        ),
        (
            {
                "linear": (0.01, 0.02, 0.2, 0.3, 0.34),
                "svk": (0.01, 0.01, 0.02, 0.02, 0.03),
                "hencky": (0.1, 0.2, 0.5, 0.9, 1.23),
            },
            (
                *("5 %", "of St. Venant-Kirchhoff FEM up to full load,", "of linear FEM up to load factor 0.4,"),
                *("of Hencky FEM at no load level.", "full load", "St. Venant-Kirchhoff FEM 3.0 %", "linear FEM 34 %"),
                "Hencky FEM 120 %",
            ),
        ),
        (
            {"linear": (0.1, 0.1, 0.2, 0.3, 0.4), "svk": (0.1, 0.1, 0.2, 0.3, 0.3)},
            ("no load level", "5 % of any", "full load", "St. Venant-Kirchhoff FEM 30 %", "linear FEM 40 %"),
        ),
        (
            {"linear": (0.1, 0.04, 0.03, 0.3, 0.4), "svk": (0.1, 0.06, 0.04, 0.03, 0.02)},
            (
                *("5 %", "of St. Venant-Kirchhoff FEM only from load factor 0.6", "of linear FEM only between load"),
                *(" factors 0.4 and 0.6.", "full load", "St. Venant-Kirchhoff FEM 2.0 %", "linear FEM 40 %"),
            ),
        ),
        (
            {"linear": (0.01, 0.1, 0.2, 0.06, 0.04)},
            ("up to load factor 0.2 and again at full load", "5 % of linear FEM", "full load", "linear FEM 4.0 %"),
        ),
    ],
    ids=["to full load", "one limit", "two limits", "never", "only later", "gap"],
)
def test_verdict_of_complete_paths(errors: Mapping[str, Sequence[float]], parts: tuple[str, ...]) -> None:
    text = said(errors)
    assert in_order(text, *parts), text
    assert text.count("%") == 1 + len(errors) and text.count("load factor") == "".join(parts).count("load factor")


def test_trouble_of_the_model_is_said_first() -> None:
    fine = {"linear": (0.01,) * 5}
    stopped = said(fine, levels=(0.0, 0.2, 0.4), status=ts.Status.NOT_CONVERGED)
    assert in_order(
        *(stopped, "springs", "no equilibrium beyond load factor 0.4.", "up to load factor 0.4", "last level"),
        *("5 % of linear FEM.", "linear FEM", "ends at load factor 0.4", "1.0 %"),
    )
    nowhere = said(fine, levels=(0.0,), status=ts.Status.NOT_CONVERGED)
    assert in_order(nowhere, "springs", "no equilibrium at any load level", "linear FEM", "no load level in common")
    assert "%" not in nowhere


@pytest.mark.parametrize(
    ("status", "spoilt", "words"),
    [
        (ts.Status.UNSTABLE, {"negative_eigenvalues": 1}, "unstable"),
        (ts.Status.INVERTED, {"area_ratio": -0.1}, "inverted"),
    ],
)
def test_unsound_states_are_named_with_their_level(status: ts.Status, spoilt: dict[str, Any], words: str) -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)", status=status)
    states = tuple(replace(one, **spoilt) if one.load_factor >= 0.6 else one for one in springs.states)
    text = verdict(result(replace(springs, states=states), {"linear": path(problem)}))
    assert in_order(text, "springs", words, "first", "load factor 0.6", "up to full load", "5 %", "linear FEM 0 %")


def test_a_reference_that_stops_early_is_named() -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)")
    short = path(problem, levels=(0.0, 0.2, 0.4), label="Hencky FEM", status=ts.Status.NOT_CONVERGED)
    text = verdict(result(springs, {"hencky": short, "linear": path(problem)}))
    assert in_order(
        *(text, "Hencky FEM", "no equilibrium beyond load factor 0.4.", "of linear FEM up to full load,"),
        *("of Hencky FEM up to load factor 0.4", "last level", "full load", "linear FEM 0 %."),
        *("Hencky FEM", "ends at load factor 0.4", "0 %"),
    )


def test_the_one_that_is_carried_is_named_with_the_nodes_of_the_other() -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)")
    fine = path(replace(problem, mesh=ts.rectangle(size=(0.08, 0.02), elements=(6, 1))), label="linear FEM")
    points = np.array([[0.01, 0.005, 0.0], [0.05, 0.012, 0.0], [0.07, 0.018, 0.0]])
    markers = placed(Record(FilePath("m.csv"), "csv", points, {}, (Level(1.0, 0 * points),)), Placing(), "markers")
    for other, parts in (
        (fine, ("linear FEM", "10 nodes of springs")),
        (markers, ("springs (lloyd)", "3 nodes of markers")),
    ):
        found = replace(result(springs, {"other": other}), in_detail=True)
        assert in_order(carrying_sentence(found) or "", *parts)


def test_verdict_without_references() -> None:
    springs = path(stretched(), kind="springs", label="springs (lloyd)")
    text = verdict(result(springs, {}))
    assert in_order(text, "springs", "full load", "stable equilibria", "nothing", "compared", "probe", "24.0 mm")
    unknown = replace(springs, states=[replace(state, negative_eigenvalues=None) for state in springs.states])
    assert "equilibria of unknown stability" in verdict(result(unknown, {}))


def test_a_single_model_that_is_not_springs_is_spoken_of_in_the_singular() -> None:
    problem = stretched()
    mine = path(problem, label="linear FEM")
    other = path(problem, [1 / 1.2] * 5, label="Hencky FEM")
    text = verdict(result(mine, {"hencky": other}, name="linear"))
    assert in_order(text, "no load level", "does linear FEM", "5 % of Hencky FEM", "full load", "Hencky FEM 20 %")


def test_prescribed_motion_speaks_of_motion_and_of_the_force_it_takes(page_of: Callable[[Result], "Page"]) -> None:
    problem = stretched(more=[ts.Fixed(on="right", fix=["x"], displacement=[0.008, 0.0])], loads=())
    springs = ts.solve(problem, ts.Springs("isotropic"))
    linear = ts.solve(problem, ts.Fem("linear"))
    found = result(springs, {"linear": linear})
    assert "full motion" in verdict(found) and "load:" not in verdict(found)
    force = [
        quantity(one.states[-1].reaction[problem.mesh.nodes[:, 0] > 0.07, 0].sum(), "N") for one in (springs, linear)
    ]
    apart = found.comparisons["linear"].force_error
    assert apart is not None and apart > 0.01
    parts = ("force", "full motion, along x:", f"springs {force[0]}", f"linear FEM {force[1]} ({percent(apart)}")
    assert in_order(force_sentence(found) or "", *parts)
    assert drive(found).axis == 0 and drive(found).sign == 1
    page = page_of(found)
    # Of the table of errors, and of that of supports.
    assert [text for text in page.said if text in ("largest", "force")] == ["largest", "force", "force"]
    assert percent(apart) in [text.replace("\N{NO-BREAK SPACE}", " ") for text in page.said]
    assert "force" not in page_of(result(path(stretched()), {"b": path(stretched())})).said


@pytest.mark.parametrize("way", [1, -1])
def test_a_body_that_pushes_does_not_look_like_one_that_pulls(way: int, page_of: Callable[[Result], "Page"]) -> None:
    problem = stretched(more=[ts.Fixed(on="right", fix=["x"], displacement=[way * 0.008, 0.0])], loads=())
    linear = ts.solve(problem, ts.Fem("linear"))
    right = problem.mesh.nodes[:, 0] > 0.07
    # It goes along with the motion: the one path takes a force along it, the other, turned round, holds it back.
    against = replace(
        linear, states=tuple(replace(one, reaction=-one.reaction) for one in linear.states), label="a spring let go"
    )
    found = result(linear, {"against": against}, name="linear")
    size = quantity(abs(float(linear.states[-1].reaction[right, 0].sum())), "N")
    direction = "x" if way > 0 else "−x"
    parts = ("force", f"along {direction}:", f"linear FEM {size},", f"a spring let go −{size} (200 %")
    assert in_order(force_sentence(found) or "", *parts)
    data = page_of(found).data
    assert data["motion"] and [one["force"][-1] for one in data["paths"]] == [size, f"−{size}"]


def test_a_surface_from_a_file_is_measured_by_its_outline() -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)")
    moved = springs.states[-1].positions + np.array([0.0, 0.001])
    triangles = problem.mesh.elements[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    read = ts.Solution(problem, "deformed.stl", "stl", (), ts.Status.CONVERGED, surface=Surface(moved, triangles))
    found = result(springs, {"ansys": read})
    assert in_order(verdict(found), "outline", "at most 1.0 mm", "deformed.stl at full load.")
    drawn = draw_figures(found)[over_name(found, "ansys")]
    assert segments(drawn, "reference") == len(Surface(moved, triangles).outline)


def test_closest_is_named_only_where_there_is_a_choice(page_of: Callable[[Result], "Page"]) -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)")
    near, far = path(problem, [1 / 1.02] * 5), path(problem, [1 / 1.3] * 5, label="Hencky FEM")
    both = result(springs, {"far": far, "near": near})
    assert in_order(closest_sentence(both) or "", "nearest at full load", "linear FEM", "2.0 %")
    assert closest_sentence(result(springs, {"near": near})) is None
    broken = replace(springs, status=ts.Status.UNSTABLE)
    assert closest_sentence(result(broken, {"far": far, "near": near})) is None
    told = page_of(result(broken, {"far": far, "near": near})).said
    assert "nearest" not in told
    assert "nearest" in page_of(both).said


def test_labels_that_two_paths_share_are_told_apart() -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)")
    text = verdict(result(springs, {"coarse": path(problem), "fine": path(problem, [1 / 1.5] * 5)}))
    assert "linear FEM (coarse) up to full load" in text and "linear FEM (fine) at no load level" in text


def test_moduli_are_said_beside_the_material() -> None:
    problem = stretched()
    # Uniform tension of the summed lattice: 15/17 E and 7/17 along x, 21/19 E and 5/19 at 45 degrees.
    text = moduli_sentence(ts.solve(problem, ts.Springs("lloyd")))
    assert text is not None
    assert "0.882 to 1.105" in text and "0.263 to 0.412" in text and "0.333" in text
    # One square under u = -x y stores E/(1 - nu^2) y^2 and G x^2: 9/8 and 3/8 of what the material would.
    assert "1.875" in text and "1.500" in text
    isotropic = moduli_sentence(ts.solve(problem, ts.Springs("isotropic")))
    assert isotropic is not None and "1.000 times" in isotropic and "1e+04 Pa" in isotropic


@pytest.mark.parametrize(
    ("elements", "deep", "excess"),
    # Squares under u = -x y: E/(1 - nu^2) + G a^2 / H^2 over E, less 1; over n rows 1/(2 n^2) at poisson 1/3.
    [(1, "1 element deep", 0.5), (4, "4 elements deep", 1 / 32)],
)
def test_the_mesh_error_of_the_reference_is_said_in_bending(elements: int, deep: str, excess: float) -> None:
    problem = ts.Problem(
        mesh=ts.rectangle(size=(0.08, 0.02), elements=(4 * elements, elements)),
        material=ts.Material(young=10e3, poisson=1 / 3),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.0, -1e-3))],
    )
    springs, linear = (ts.solve(problem, model) for model in (ts.Springs("lloyd"), ts.Fem("linear")))
    text = mesh_sentence(result(springs, {"linear": linear})) or ""
    assert in_order(text, "four-node elements", f"{percent(excess)} too stiff in bending", deep)
    assert mesh_sentence(result(springs, {"springs-too": springs})) is None  # no elements among the references
    assert mesh_sentence(result(linear, {"other": linear})) is None  # nothing known of the moduli


def test_the_mesh_error_is_not_said_of_a_body_that_is_pulled_or_a_fine_one() -> None:
    pulled = stretched()
    assert mesh_sentence(result(ts.solve(pulled, ts.Springs("lloyd")), {"linear": path(pulled)})) is None
    bent = replace(
        pulled, mesh=ts.rectangle(size=(0.08, 0.02), elements=(32, 8)), loads=[ts.Force(on="right", total=(0.0, -1e-3))]
    )
    springs = ts.solve(bent, ts.Springs("lloyd"))
    assert springs.moduli is not None and 1 < springs.moduli.fem_bending[8] < 1.01
    assert mesh_sentence(result(springs, {"linear": path(bent)})) is None


@pytest.mark.parametrize(
    ("found", "text"),
    [
        (percent(0.0214), "2.1 %"),
        (percent(0.344), "34 %"),
        (percent(1.234), "120 %"),
        (percent(0.0996), "10 %"),
        (percent(0.0), "0 %"),
        (percent(3e-6), "less than 0.01 %"),
        (percent(float("nan")), "no number"),
        (quantity(8823.53, "Pa"), "8.82 kPa"),
        (quantity(0.04, "m"), "40.0 mm"),
        (quantity(0.9999, "N"), "1000 mN"),
        (quantity(0.0, "N"), "0 N"),
        (input_quantity(-0.0428, "N"), "−42.8 mN"),
        (input_quantity(0.16, "m"), "160 mm"),
        (significant(9.996, 3), "10.0"),
    ],
)
def test_numbers_as_people_read_them(found: str, text: str) -> None:
    assert found == text


# --- figures and page -----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def solved() -> Result:
    problem = stretched()
    newton = ts.Newton(load_steps=4)
    models: dict[str, Any] = {"springs": ts.Springs("lloyd"), "linear": ts.Fem("linear"), "a/b": ts.Fem("hencky")}
    paths = {name: ts.solve(problem, model, newton) for name, model in models.items()}
    return result(paths["springs"], {name: paths[name] for name in ("linear", "a/b")}, "Soft <10k & co>", "soft & wet")


def called(figure: Sheet, name: str) -> list[Any]:
    """The artists of a figure that an SVG calls by a name."""
    return [artist for artist in figure.artists if artist.get_gid() == name]


def segments(figure: Sheet, name: str) -> int:
    """The number of lines in the one path of a figure that is called `name`."""
    (drawn,) = called(figure, name)
    return int((drawn.get_path().codes == 1).sum())


def words(figure: Sheet) -> dict[str, Any]:
    """What is written in a figure, and where [points]."""
    figure.pixels(72)
    outlines = [artist for artist in figure.artists if isinstance(artist, PathPatch) and artist.get_label()]
    return {str(outline.get_label()): outline.get_window_extent() for outline in outlines}


def test_figures_hold_every_spring_edge_and_the_probe(solved: Result) -> None:
    figures = draw_figures(solved)
    assert set(figures) == {"undeformed", "springs_over_linear", "springs_over_a-b", "curves", "error", "moduli"}
    mesh, springs = solved.problem.mesh, solved.solutions["springs"]
    n_springs = 13 + 8  # edges of 4 x 1 squares, and two diagonals a square
    over = figures["springs_over_linear"]
    assert segments(over, "model") == n_springs
    assert segments(over, "reference") == len(mesh.edges) == 13
    assert segments(figures["undeformed"], "springs") == n_springs
    for name, positions in (("undeformed", mesh.nodes), ("springs_over_linear", springs.states[-1].positions)):
        (dot,) = called(figures[name], "probe")
        assert np.ravel(dot.get_data()) == pytest.approx(1e3 * positions[solved.probe])
        assert dot.get_color() == "#d3222a"
    assert called(figures["undeformed"], "clamped")


def test_curves_carry_the_name_of_the_law_and_the_numbers_of_the_path(solved: Result) -> None:
    figure = draw_figures(solved)["curves"]
    lines = {line.get_label(): line for line in figure.artists if isinstance(line, Line2D) and line.get_label()}
    assert set(lines) == {"springs (lloyd)", "linear FEM", "Hencky FEM, a/b"}
    said = words(figure)
    assert {"springs (lloyd)", "linear FEM", "Hencky FEM", "a/b"} <= said.keys()
    states = solved.solutions["springs"].states
    assert lines["springs (lloyd)"].get_ydata() == pytest.approx(
        [1e3 * state.displacement[solved.probe, 0] for state in states]
    )
    assert lines["springs (lloyd)"].get_xdata() == pytest.approx([400 * state.load_factor for state in states])
    assert {"total force along x [mN]", "displacement along x [mm]"} <= said.keys()
    # Numbers stand below and beside what they tell.
    right, up = figure.areas[0].place(np.array([(400.0, 400.0), (10.0, 10.0)])) * 72
    assert (said["400"].x0 + said["400"].x1) / 2 == pytest.approx(right[0], abs=0.5)
    assert (said["10"].y0 + said["10"].y1) / 2 == pytest.approx(up[1], abs=0.5)


@pytest.mark.parametrize(
    ("low", "high", "numbers"),
    [
        (-10, 50, ["−10", "0", "10", "20", "30", "40", "50"]),
        (0, 1.02, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]),
        (-0.013, 0.031, ["−0.01", "0.00", "0.01", "0.02", "0.03"]),
        (0, 0.13, ["0.000", "0.025", "0.050", "0.075", "0.100", "0.125"]),
        (0, 4.1e8, ["0", "1e+08", "2e+08", "3e+08", "4e+08"]),
        (1e-9, 3e-9, ["1e-09", "1.5e-09", "2e-09", "2.5e-09", "3e-09"]),
    ],
)
def test_axes_carry_round_numbers(low: float, high: float, numbers: list[str]) -> None:
    assert written(round_numbers(low, high)) == [number.replace("e-", "e−") for number in numbers]


def test_words_stand_where_they_are_put() -> None:
    sheet = Sheet(4, 3, "")
    draw_words(sheet, 1, 2, "HIH", 20)
    draw_words(sheet, 1, 1.5, "HHI", 20, align=1.0)
    draw_words(sheet, 2, 1.5, "IHI", 20, align=0.5, upright=True)
    draw_words(sheet, 1, 2, " ")
    left, right, up = (words(sheet)[text] for text in ("HIH", "HHI", "IHI"))
    assert left.y0 + left.y1 == pytest.approx(288, abs=0.02) and right.y0 + right.y1 == pytest.approx(216, abs=0.02)
    assert up.x0 + up.x1 == pytest.approx(288, abs=0.02) and up.y0 + up.y1 == pytest.approx(216, abs=3)
    assert left.x0 == pytest.approx(72, abs=3) and right.x1 == pytest.approx(72)
    assert left.height == pytest.approx(0.729 * 20, abs=0.01) and up.width == pytest.approx(left.height)
    assert left.width == pytest.approx(72 * text_width("HIH", 20), abs=5)
    assert len(words(sheet)) == 3


def test_a_sheet_draws_the_same_on_pixels_and_in_an_svg() -> None:
    sheet = Sheet(2, 1, "")
    area = Area(sheet, 0.5, 0.25, 1.0, 0.5, (0, 10), (-1, 1))
    assert area.place(np.array([(0, -1), (10, 1)])).tolist() == [[0.5, 0.25], [1.5, 0.75]] and area.inch == 10
    area.add(Rectangle((5, 0), 100, 100, color="red", lw=0, gid="clipped"))
    sheet.add(Rectangle((0, 0), 0.1, 0.1, color="blue", lw=0, zorder=2))
    sheet.add_image(np.full((3, 3, 3), [0, 255, 0], dtype=np.uint8), 0.0, 0.0, 0.2, 0.2, 1, "image")
    drawn = sheet.pixels(100)
    assert drawn.shape == (100, 200, 4)

    def color(x: float, y: float) -> list[int]:
        return drawn[round(100 * (1 - y)), round(100 * x)].tolist()  # type: ignore[no-any-return]

    white, red, green, blue = [255] * 4, [255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]
    assert [color(1.2, 0.6), color(1.7, 0.6), color(1.2, 0.4), color(0.7, 0.6)] == [red, white, white, white]
    assert [color(0.05, 0.05), color(0.15, 0.15)] == [blue, green]
    root = ElementTree.fromstring(sheet.svg())
    assert (root.get("width"), root.get("height")) == ("144pt", "72pt")
    (group,) = root.iterfind(".//*[@id='clipped']")
    numbers = [float(one) for one in re.findall(r"[\d.]+", group[0].get("d") or "")]
    assert numbers[:4] == [72, 36, 792, 36] and group[0].get("clip-path")  # downwards, in points
    assert root.find(".//*[@id='image']") is not None


def test_pictures_do_not_change_from_drawing_to_drawing(solved: Result) -> None:
    with figure_style():
        assert undeformed_figure(undeformed_of(solved)).svg() == undeformed_figure(undeformed_of(solved)).svg()


def test_names_at_the_ends_of_curves_keep_their_distance() -> None:
    places, ties = np.array([0.5, 0.5, 0.52, 0.98]), np.array([2.0, 1.0, 0.0, 0.0])
    moved = _apart(places, 0.1, ties)
    assert np.diff(np.sort(moved)).min() >= 0.1 - 1e-12
    assert moved[1] < moved[0] < moved[2] < moved[3]
    assert moved[:3].mean() == pytest.approx(places[:3].mean())
    assert moved.min() >= 0 and moved.max() <= 1


def test_leaders_do_not_cross() -> None:
    ends = np.array([[0.9, 0.5], [1.0, 0.48], [1.0, 0.1]])
    wanted = np.array([0.05, 0.2, 0.6])
    moved = _uncrossed(ends, 1.1, wanted)
    assert sorted(moved) == sorted(wanted)
    assert moved.tolist() == [0.6, 0.2, 0.05]


def test_the_right_margin_holds_the_longest_name() -> None:
    problem = stretched()
    short = path(problem, kind="springs", label="springs")
    long = path(problem, [0.7] * 5, label="springs (own stiffness, single) and then some more words")
    for found in (result(short, {"b": path(problem)}), result(short, {"b": path(problem), "c": long})):
        figure = draw_figures(found)["curves"]
        boxes = words(figure).values()
        assert len(boxes) >= 2
        assert all(box.x0 >= 0 and box.x1 <= 72 * figure.width for box in boxes)
        assert figure.areas[0].width >= 3.1


def moved_by(problem: ts.Problem, distance: float, **more: Any) -> ts.Solution:
    """A path whose right end moves upwards by `distance` [m], every other node in proportion to its x."""
    whole = path(problem, **more)
    nodes = problem.mesh.nodes
    shape = np.column_stack([0 * nodes[:, 0], distance * nodes[:, 0] / nodes[:, 0].max()])
    states = tuple(
        replace(one, displacement=one.load_factor * shape, positions=nodes + one.load_factor * shape)
        for one in whole.states
    )
    return replace(whole, states=states)


@pytest.mark.parametrize(
    ("share", "factor"),
    [(0.0, 1), (0.03, 1), (0.029, 2), (0.025, 2), (0.02, 5), (0.012, 10), (0.0021, 50), (0.00012, 1000), (1e-9, 1e8)],
)
def test_tiny_displacements_are_magnified_by_a_round_factor(share: float, factor: float) -> None:
    assert round_factor(share) == pytest.approx(factor)
    assert factor == 1 or 0.04 < share * factor <= 0.1201


def test_magnified_pictures_say_so_and_show_it(page_of: Callable[[Result], "Page"]) -> None:
    problem = stretched()  # 80 mm long
    tiny, larger = moved_by(problem, 8e-5, kind="springs", label="springs"), moved_by(problem, 1e-4)
    found = result(tiny, {"linear": larger})
    figure = draw_figures(found)[over_name(found, "linear")]
    assert "displacements × 50" in words(figure)
    (dot,) = called(figure, "probe")
    assert np.ravel(dot.get_data()) == pytest.approx([80, 50 * 0.08])
    page = page_of(found)
    assert "displacements × 50" in page.said
    assert page.tags.count("canvas") == 1
    data = page.data
    assert data["box"][1] == pytest.approx(20 + 50 * 0.1)
    plain = result(moved_by(problem, 4e-3, kind="springs", label="springs"), {"linear": moved_by(problem, 1e-4)})
    texts = words(draw_figures(plain)[over_name(plain, "linear")])
    assert not any("×" in text for text in texts)
    assert not any("displacements ×" in text for text in page_of(plain).said)


def test_a_surface_is_magnified_only_where_its_displacement_is_known(page_of: Callable[[Result], "Page"]) -> None:
    problem = stretched()
    tiny = moved_by(problem, 8e-5, kind="springs", label="springs")
    triangles = problem.mesh.elements[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
    surface = Surface(tiny.states[-1].positions, triangles)
    alone = ts.Solution(problem, "deformed.stl", "stl", (), ts.Status.CONVERGED, surface=surface)
    known = replace(alone, states=tiny.states[-1:])
    for read, factor in ((alone, 1), (known, 100)):
        found = result(tiny, {"ansys": read})
        figure = draw_figures(found)[over_name(found, "ansys")]
        (dot,) = called(figure, "probe")
        assert np.ravel(dot.get_data()) == pytest.approx([80, factor * 0.08])
        data = page_of(found).data
        assert (data["magnified"] == "") == (factor == 1)
        assert (data["paths"][1]["surface"] is None) == (factor > 1)


def test_the_picture_follows_the_body_and_the_model_not_a_reference_that_goes_far_away(
    page_of: Callable[[Result], "Page"],
) -> None:
    problem = stretched()
    springs = moved_by(problem, 0.04, kind="springs", label="springs")
    near, far = moved_by(problem, 0.1), moved_by(problem, 1000.0, label="linear FEM that ran away")
    found = result(springs, {"near": near, "far": far})
    figures = draw_figures(found)
    heights = {}
    for name, leaves in (("near", False), ("far", True)):
        figure = figures[over_name(found, name)]
        low, high = figure.areas[0].y
        heights[name] = high - low
        assert ("linear FEM that ran away leaves the picture" in words(figure)) == leaves
        (drawn,) = called(figure, "reference")
        assert drawn.get_clip_path() is not None or drawn.get_clip_box() is not None
    assert heights["near"] > 120 and 60 < heights["far"] < 80  # mm
    data = page_of(found).data
    assert data["box"] == pytest.approx([80, 120])
    assert [one["beyond"] for one in data["paths"]] == [False, False, True]
    steps = np.frombuffer(base64.b64decode(data["paths"][2]["positions"][-1]), dtype="<f4").reshape(-1, 2)
    assert steps * 120 / 65535 == pytest.approx(1e3 * far.states[-1].positions, rel=1e-6, abs=1e-3)


def supports(problem: ts.Problem) -> dict[tuple[float, float], list[Any]]:
    """The marks of supports in the picture of what was asked, by their place in mm."""
    figure = draw_figures(result(path(problem), {"b": path(problem)}))["undeformed"]
    found: dict[tuple[float, float], list[Any]] = {}
    for mark in [one for one in called(figure, "support") if isinstance(one, Line2D)]:
        x, y = np.ravel(mark.get_data())
        found.setdefault((round(float(x), 6), round(float(y), 6)), []).append(mark.get_marker().vertices)
    return found


def held(*fixed: ts.Fixed, elements: tuple[int, int]) -> ts.Problem:
    return ts.Problem(
        mesh=ts.rectangle(size=(1.0, 1.0), elements=elements),
        material=ts.Material(young=10e3, poisson=0.3),
        section=ts.PlaneStress(thickness=0.01),
        supports=fixed,
        loads=[ts.Force(on="top", total=(0.0, 1.0))],
    )


def test_rollers_along_a_side_are_thinned_and_point_outwards() -> None:
    sides = (ts.Fixed(on="left", fix=["x"]), ts.Fixed(on="bottom", fix=["y"]))
    found = supports(held(*sides, elements=(40, 40)))
    left = {place[1]: marks for place, marks in found.items() if place[0] == 0 and place[1] > 0}
    bottom = {place[0]: marks for place, marks in found.items() if place[1] == 0 and place[0] > 0}
    assert len(found) == len(left) + len(bottom) + 1 and len(found[0, 0]) == 2  # the corner rolls on neither
    for marks, axis in ((left, 0), (bottom, 1)):
        places = sorted(marks)
        assert 5 < len(places) < 25
        assert np.diff(places) == pytest.approx(places[1] - places[0])
        assert all(len(one) == 1 for one in marks.values())
        assert all(one[0][:, axis].min() < -0.5 and one[0][:, axis].max() <= 0 for one in marks.values())
    coarse = supports(held(*sides, elements=(4, 4)))
    assert len([place for place in coarse if place[0] == 0]) == 5


def test_rollers_along_their_own_side_stand_outside_and_do_not_flip() -> None:
    found = supports(held(ts.Fixed(on="bottom"), ts.Fixed(on="right", fix=["y"]), elements=(4, 4)))
    right = {place: marks for place, marks in found.items() if place[0] == 1}
    assert sorted(y for _, y in right) == [0.25, 0.5, 0.75, 1.0]  # the corner is clamped and hatched
    shapes = [marks[0] for marks in right.values()]
    assert all(one == pytest.approx(shapes[0]) for one in shapes)
    assert shapes[0][:, 0].min() >= -1e-12 and shapes[0][:, 1].max() <= 1e-12


def test_figures_are_written_as_png_and_svg(solved: Result, tmp_path: FilePath) -> None:
    save_figures(solved, tmp_path / "figures")
    files = sorted(file.name for file in (tmp_path / "figures").iterdir())
    assert files == sorted(f"{name}.{kind}" for name in draw_figures(solved) for kind in ("png", "svg"))
    for file in (tmp_path / "figures").iterdir():
        if file.suffix == ".png":
            assert file.read_bytes().startswith(b"\x89PNG")
        else:
            assert ElementTree.parse(file).getroot().tag.endswith("svg")


def test_drawing_leaves_the_settings_of_matplotlib_alone(solved: Result) -> None:
    import matplotlib

    before = dict(matplotlib.rcParams)
    draw_figures(solved)
    assert dict(matplotlib.rcParams) == before


@pytest.fixture
def page_of(monkeypatch: pytest.MonkeyPatch) -> Callable[[Result], "Page"]:
    """Pages without their pictures, which take a second each."""
    blank = Drawing(b"", b"<svg/>", "", 1.0)
    monkeypatch.setattr("truespring.report.page.render_figures", lambda _: {"undeformed": blank, "moduli": blank})
    return lambda found: Page(render_page([found], ""))


class Page(HTMLParser):
    """What a page loads, links to and says."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.links: list[str] = []
        self.tags: list[str] = []
        self.ids: list[str] = []
        self.policy = ""
        self.scripts: list[str] = []
        self.said: list[str] = []
        self.tagged: set[str] = set()
        self._in_tag = False
        self.feed(text)

    @property
    def data(self) -> Any:
        """The data of the first interactive view."""
        return json.loads(next(script for script in self.scripts if script.startswith("{")))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = {name: value or "" for name, value in attrs}
        self.tags.append(tag)
        self._in_tag = values.get("class") == "name"
        self.loaded += [values[name] for name in ("src", "srcset", "poster", "data", "action") if name in values]
        self.links += [values["href"]] if "href" in values else []
        self.ids += [values["id"]] if "id" in values else []
        if values.get("http-equiv") == "Content-Security-Policy":
            self.policy = values["content"]

    def handle_data(self, data: str) -> None:
        inside = self.tags[-1] if self.tags else ""
        (self.scripts if inside == "script" else self.said).append(data)
        if self._in_tag:
            self.tagged.add(data)
            self._in_tag = False


def test_page_loads_nothing_and_escapes_what_it_was_given(solved: Result, tmp_path: FilePath) -> None:
    write_page([solved, solved], tmp_path / "report.html", "truespring verify 'soft & wet.toml' --out out")
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert len(page.loaded) == 2 * 6 and all(address.startswith("data:image/") for address in page.loaded)
    own = [link for link in page.links if link.startswith("#")]
    assert own and all(link.removeprefix("#") in page.ids for link in own)
    assert all(link.startswith("data:text/csv;base64,") for link in set(page.links) - set(own))
    assert page.policy.startswith("default-src 'none';")
    assert not {"link", "iframe", "object", "embed", "base"} & set(page.tags)
    assert "url(" not in "".join(page.said) and "@import" not in text
    assert "<10k" not in text and "Soft &lt;10k &amp; co&gt;" in text
    assert "# &lt;as written&gt;" in text
    assert len(page.ids) == len(set(page.ids))


def test_page_tells_verdict_law_advice_and_how_to_run_it_again(solved: Result) -> None:
    page = Page(render_page([solved], "truespring verify soft.toml --out out"))
    told = " ".join("".join(page.said).replace("\N{NO-BREAK SPACE}", " ").split())
    assert verdict(solved) in told
    assert told.index(verdict(solved)) < told.index("Errors at full load")
    for words in ("Hencky FEM a/b", "truespring verify soft.toml --out out", "scikit-fem", "1 element deep this mesh"):
        assert words in told
    assert all(warning in told for path in solved.solutions.values() for warning in path.warnings)


def test_page_and_summary_tell_how_a_path_was_solved_and_what_it_took(page_of: Callable[[Result], "Page"]) -> None:
    problem = stretched()
    cost = Cost("line search", "multigrid", 21, 120, 17, 3, 10**6, 2, ("mixed integration points were given up",))
    springs = path(problem, kind="springs", label="springs (lloyd)", cost=cost)
    once = replace(cost, newton_iterations=1, cg_iterations=0, lanczos_iterations=0, notes=())
    nested = replace(once, coarse=(replace(once, newton_iterations=7), replace(once, newton_iterations=4)))
    others = {"linear": path(problem, cost=once), "read": path(problem, label="read")}
    found = result(springs, others | {"nested": path(problem, label="nested", cost=nested)})
    told = "".join(page_of(found).said)
    assert "line search, multigrid, 21 Newton iterations, 120 CG iterations, 17 of Lanczos for stability; mixed" in told
    assert "linear FEM: line search, multigrid, 1 Newton iteration\n" in told and "read: " not in told
    assert "multigrid, 1 Newton iteration; on coarser meshes before that 7, 4 Newton iterations" in told
    models = summary(found)["models"]
    assert models["springs"]["solver"]["memory"] == 10**6 and models["linear"]["solver"]["newton"] == "line search"
    assert models["read"]["solver"] is None
    json.dumps(models, allow_nan=False)


def test_names_are_tags_wherever_the_label_does_not_begin_with_them(page_of: Callable[[Result], "Page"]) -> None:
    problem = stretched()
    springs = path(problem, kind="springs", label="springs (lloyd)")
    other = path(problem, kind="springs", label="springs (isotropic)")
    page = page_of(result(springs, {"lloyd": other, "linear": path(problem)}))
    assert page.tagged == {"lloyd"}
    same = path(problem, kind="springs", label="springs (lloyd)")
    found = result(springs, {"lloyd": same})
    said = words(draw_figures(found)[over_name(found, "lloyd")])
    assert {"springs (lloyd) · springs", "springs (lloyd) · lloyd"} <= said.keys()


@pytest.mark.parametrize("poisson", [0.3, 0.25])
def test_plane_strain_explains_the_moduli_that_it_wants(poisson: float, page_of: Callable[[Result], "Page"]) -> None:
    problem = ts.Problem(
        mesh=ts.rectangle(size=(0.08, 0.02), elements=(4, 1)),
        material=ts.Material(young=10e3, poisson=poisson),
        section=ts.PlaneStrain(thickness=0.01),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.4, 0.0))],
    )
    springs = ts.solve(problem, ts.Springs("isotropic"))
    told = "".join(page_of(result(springs, {"b": springs})).said).replace("\N{NO-BREAK SPACE}", " ")
    young, ratio = {0.3: ("11.0 kPa", "0.429"), 0.25: ("10.7 kPa", "0.333")}[poisson]
    parts = (f"E/(1 − ν²) = {young}", f"ν/(1 − ν) = {ratio}", "E = 10 kPa", f"ν = {poisson}.")
    assert in_order(told, "plane strain", *parts)
    thin = replace(problem, section=ts.PlaneStress(thickness=0.01))
    plain = ts.solve(thin, ts.Springs("isotropic"))
    told = "".join(page_of(result(plain, {"b": plain})).said)
    assert "plane stress" in told and "plane strain" not in told


def test_the_bending_table_holds_springs_and_elements_side_by_side(solved: Result) -> None:
    page = Page(render_page([solved], ""))
    start = page.said.index("four-node FEM")
    cells = [text.strip() for text in page.said[start:] if text.strip()]
    assert cells[1:5] == ["1 element deep", "this mesh", "1.875", "1.500"]
    assert cells[5:8] == ["2 elements deep", "1.131", "1.125"]


def test_the_viewer_is_shown_before_it_is_drawn(solved: Result) -> None:
    script = "".join(Page(render_page([solved], "")).scripts)
    assert 0 < script.index("host.hidden = false") < script.index("start(host")


def test_a_model_that_failed_shows_its_advice(solved: Result) -> None:
    stopped = replace(solved.solutions["springs"], status=ts.Status.NOT_CONVERGED)
    page = Page(render_page([replace(solved, solutions={**solved.solutions, "springs": stopped})], ""))
    assert ts.Status.NOT_CONVERGED.advice in "".join(page.said)


def test_the_viewer_holds_the_positions_of_every_level(solved: Result) -> None:
    page = Page(render_page([solved], ""))
    data = page.data
    assert [one["name"] for one in data["paths"]] == ["springs", "linear", "a/b"]
    assert data["paths"][0]["levels"] == solved.solutions["springs"].load_factors.tolist()
    clouds = [
        solved.problem.mesh.nodes,
        *(state.positions for one in solved.solutions.values() for state in one.states),
    ]
    lower, upper = np.concatenate(clouds).min(axis=0), np.concatenate(clouds).max(axis=0)
    extent = (upper - lower).max()
    for found, one in zip(data["paths"], solved.solutions.values(), strict=True):
        for packed, state in zip(found["positions"], one.states, strict=True):
            steps = np.frombuffer(base64.b64decode(packed), dtype="<u2").reshape(-1, 2)
            assert lower + steps / 65535 * extent == pytest.approx(state.positions, abs=1e-5 * extent)
    lines = np.frombuffer(base64.b64decode(data["paths"][0]["lines"]), dtype="<u4")
    assert lines.size == 2 * 21 and lines.max() == solved.problem.mesh.n_nodes - 1


def test_a_page_of_a_plain_network() -> None:
    network = ts.SpringNetwork([[0, 10], [0, 0], [0, -10]], [[0, 1], [1, 2]], [1.0, 8.0])
    problem = ts.Problem(network.mesh, supports=[ts.Fixed(on=[0, 2])], loads=[ts.Force(on=[1], total=(5.0, 5.0))])
    only = ts.solve(problem, network)
    found = Result("Two springs", FilePath("vm9.toml"), problem, {"net": only}, 1, None, {}, 0.05, "")
    assert in_order(verdict(found), "1 of 1", "full load", "nothing was compared")
    page = Page(render_page([found], ""))
    assert len(page.loaded) == 2  # as asked, and the curve


def test_reactions_of_moved_supports_are_written_and_drawn(tmp_path: FilePath) -> None:
    """Force and moment of each support that moves; they balance the weight and the other support."""
    problem = ts.Problem(
        ts.rectangle((0.16, 0.04), (8, 2)),
        ts.Material(1e4, 0.3, density=1000.0),
        ts.PlaneStress(0.01),
        [ts.Fixed("left"), ts.Fixed("right", displacement=(0.01, -0.02), rotation=0.2)],
        ts.Gravity((0.0, -1.0)),
    )
    found = {
        name: ts.solve(problem, model) for name, model in (("a", ts.Springs("isotropic")), ("b", ts.Fem("linear")))
    }
    told = result(found["a"], {"b": found["b"]}, name="a")
    write_reactions(told, tmp_path / "reactions.csv")
    rows = list(csv.DictReader((tmp_path / "reactions.csv").read_text().splitlines()))
    assert len(rows) == 2 * 11 and {row["support"] for row in rows} == {"2"}
    for row in (rows[10], rows[21]):
        state = found[row["model"]].states[-1]
        right = problem.held[1].nodes
        assert [float(row["fx [N]"]), float(row["fy [N]"])] == pytest.approx(state.reaction[right].sum(axis=0))
        assert [float(row["ux [m]"]), float(row["uy [m]"])] == pytest.approx([0.01, -0.02])
        about = state.positions[right].mean(axis=0)
        arms, weight = state.positions - about, state.reaction + problem.loading.external_force
        left = np.setdiff1d(np.arange(problem.mesh.n_nodes), right)
        others = (arms[left, 0] * weight[left, 1] - arms[left, 1] * weight[left, 0]).sum()
        own = (arms[right, 0] * problem.loading.external_force[right, 1]).sum()
        if row["model"] == "a":  # linear elements balance on the body at rest
            assert float(row["mz [N m]"]) + own == pytest.approx(-others, rel=1e-6)
    assert "reactions" in draw_figures(told)


@pytest.mark.parametrize("pressure", [300.0, -100.0])
def test_pressure_has_arrows_along_its_side(pressure: float) -> None:
    problem = replace(stretched(), loads=(ts.Pressure("top", pressure),))
    arrows = find_arrows(problem, 0.08)
    tails, tips = (np.array(ends) for ends in zip(*(arrow.ends for arrow in arrows), strict=True))
    assert tips - tails == pytest.approx(np.tile([0.0, -0.08 * 0.08 * np.sign(pressure)], (4, 1)))
    at_side = tips if pressure > 0 else tails
    assert at_side == pytest.approx(np.column_stack([0.01 + 0.02 * np.arange(4), np.full(4, 0.02)]))
    assert [arrow.text for arrow in arrows] == ["", "", "", f"p = {pressure:g} Pa".replace("-", "\N{MINUS SIGN}")]


def test_pressure_in_space_has_arrows_where_its_side_is_seen() -> None:
    block = ts.Problem(
        ts.box((0.04, 0.04, 0.04), (2, 2, 2)),
        ts.Material(1e4, 0.3),
        None,
        [ts.Fixed("left")],
        [ts.Pressure("top", 1.0)],
    )
    towards = np.array([0.55, 0.5, 1.0])

    def arrows(side: str) -> int:
        return len(find_arrows(replace(block, loads=(ts.Pressure(side, 1.0),)), 0.04, lambda at: at[:, :2], towards))

    assert (arrows("top"), arrows("right"), arrows("bottom")) == (4, 4, 1)


def test_every_moved_support_has_curves_of_its_force_and_torque() -> None:
    """A block twisted at one end and pressed at the other: the curves end at the resultants of reactions."""
    problem = ts.Problem(
        ts.rectangle((0.16, 0.04), (8, 2)),
        ts.Material(1e4, 0.3),
        ts.PlaneStress(0.01),
        [ts.Fixed("left", displacement=(0.004, 0.0)), ts.Fixed("right", rotation=0.2)],
        [],
    )
    path = ts.solve(problem, ts.Springs("isotropic"), ts.Newton(load_steps=2))
    figures = dict(support_figures(result(path, {})))
    titles = [sheet.title for sheet in figures.values()]
    assert list(figures)[:2] == ["reactions", "reactions_2"]
    assert {"Torque of support 2, right", "Force of support 1, left"} <= set(titles)
    right, state = problem.held[1].nodes, path.states[-1]
    arms = state.positions[right] - state.positions[right].mean(axis=0)
    torque = (arms[:, 0] * state.reaction[right, 1] - arms[:, 1] * state.reaction[right, 0]).sum()
    sheet = next(sheet for sheet in figures.values() if sheet.title == "Torque of support 2, right")
    line = next(one for one in sheet.artists if isinstance(one, Line2D) and len(one.get_xdata()) == 3)
    assert "torque of the support [mN m]" in words(sheet)
    assert line.get_xdata()[-1] == pytest.approx(1e3 * torque)
    assert line.get_ydata() == pytest.approx(np.degrees([0.0, 0.1, 0.2]))


def test_loads_without_a_total_are_drawn_by_their_factor() -> None:
    problem = ts.Problem(
        ts.rectangle((0.1, 0.01), (20, 2)),
        ts.Material(1e4, 1 / 3),
        ts.PlaneStress(0.01),
        ts.Fixed("left"),
        ts.Moment("right", 1e-5),
    )
    figure = draw_figures(result(ts.solve(problem, ts.Springs("isotropic"), ts.Newton(load_steps=2)), {}))["curves"]
    assert {"load factor", "Displacement of the probe against load factor"} <= set(words(figure))
