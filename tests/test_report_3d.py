"""What a report shows of bodies in 3D: pictures, the interactive view, the words, VTU and STL files."""

import base64
import importlib.util
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

import meshio
import numpy as np
import pytest
from matplotlib.lines import Line2D

import truespring as ts
from tests.test_report import Page, called, words
from tests.wording import in_order
from truespring.mesh import Mesh
from truespring.mesh.facets import triangles_of
from truespring.report import render as rendering
from truespring.report.bodies import path_lines
from truespring.report.bodies3d import distance_picture, over_picture, undeformed_picture
from truespring.report.drawing import Drawing
from truespring.report.figures import draw_figures, save_figures
from truespring.report.frame3d import figure_of, shot
from truespring.report.page import render_page
from truespring.report.render import Image, Layer, Shot, draw, read_job, render, rgb, stacked, write_job
from truespring.report.result import Result
from truespring.report.series import write_series, write_stl
from truespring.report.style import BLUE, INK, error_colors, figure_style
from truespring.report.surfaces import VIEW, edges_of, facets_of, lines_on, normals, outline, seen
from truespring.report.tables import result_tables
from truespring.report.undeformed import undeformed_of
from truespring.report.verdict import drive
from truespring.report.viewer import viewer

SIZE = (0.08, 0.02, 0.04)


def body(element: str = "hexahedron", elements: Sequence[int] = (4, 1, 2), **more: Any) -> ts.Problem:
    """A bar of 80 x 20 x 40 mm held on the left and pressed down on the right."""
    values = {
        "mesh": ts.box(size=SIZE, elements=elements, element=element),
        "material": ts.Material(young=10e3, poisson=0.3),
        "supports": [ts.Fixed(on="left")],
        "loads": [ts.Force(on="right", total=(0.0, -0.05, 0.0))],
    }
    return ts.Problem(**{**values, **more})


def network(mesh: Mesh) -> ts.SpringNetwork:
    """A spring on every pair of nodes that may carry one."""
    pairs = mesh.elements[:, np.array(mesh.kind.links)].reshape(-1, 2)
    springs = np.unique(np.sort(pairs, axis=1), axis=0)
    return ts.SpringNetwork(mesh.nodes, springs, np.ones(len(springs)))


def path(problem: ts.Problem, share: float, levels: Sequence[float] = (0.0, 0.5, 1.0), **more: Any) -> ts.Solution:
    """A path whose nodes sink with the square of x, at full load by `share` of 40 mm at the right end."""
    nodes = problem.mesh.nodes
    shape = np.outer((nodes[:, 0] / SIZE[0]) ** 2, [0.0, -0.04, 0.0])
    states = tuple(
        ts.State(
            load_factor=level,
            positions=nodes + level * share * shape,
            all_positions=nodes + level * share * shape,
            displacement=level * share * shape,
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
        for level in levels
    )
    values = {"label": "linear FEM", "kind": "fem", "status": ts.Status.CONVERGED, **more}
    values |= {"has_springs": values["kind"] == "springs", "element": "linear" if values["kind"] == "fem" else None}
    return ts.Solution(problem=problem, states=states, **values)


def result(problem: ts.Problem, share: float = 1.1, references: Mapping[str, ts.Solution] | None = None) -> Result:
    """Springs that sink by `share` beside a reference that sinks by 1."""
    springs = path(problem, share, kind="springs", label="springs (own)", potential=network(problem.mesh))
    others = {"linear": path(problem, 1.0)} if references is None else references
    probe = ts.named_point(problem.mesh, "right-top-front")
    return Result(
        title="A bar",
        file=FilePath("bar.toml"),
        problem=problem,
        solutions={"springs": springs, **others},
        probe=probe,
        model="springs",
        comparisons={name: ts.compare(springs, other, probe, 0.05) for name, other in others.items()},
        tolerance=0.05,
        source="",
    )


@pytest.fixture
def by_matplotlib(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a machine without PyVista, which is quicker too."""
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "pyvista" else find(name))


# --- the surface ----------------------------------------------------------------------------------


def test_the_eye_is_at_the_front_to_the_right_and_above() -> None:
    assert pytest.approx(np.eye(3)) == VIEW @ VIEW.T
    assert np.linalg.det(VIEW) == pytest.approx(1)
    assert (VIEW[2] > 0).all()  # right, top and front are nearer
    assert VIEW[1, 1] > 0.8 and VIEW[0, 1] == 0  # y is up
    assert seen(VIEW) == pytest.approx(np.eye(3))
    assert seen(np.array([1.0, 0, 0]))[0] > 0.8  # x to the right


def test_lines_on_the_surface_of_a_hexahedron_and_its_outline() -> None:
    mesh = ts.box(size=(1, 1, 1), elements=(1, 1, 1))
    facets, springs = facets_of(mesh), network(mesh).springs
    assert len(springs) == 12 + 12 + 4
    on, owners = lines_on(facets, springs)
    assert on.sum() == 24  # all but the diagonals through the body
    for line, sides in zip(springs[on], owners, strict=True):
        assert all(set(line) <= set(facets[side]) for side in sides)
        is_edge = np.abs(mesh.nodes[line[0]] - mesh.nodes[line[1]]).sum() == 1
        assert (sides[0] != sides[1]) == is_edge  # an edge lies on two facets
    assert len(edges_of(facets)) == 12
    eye = seen(mesh.nodes)
    assert len(outline(eye, facets)) == 12
    smooth = ts.box(size=(1, 1, 1), elements=(3, 3, 3))
    assert len(outline(smooth.nodes, facets_of(smooth))) == 36  # only the edges of the cube


def test_the_silhouette_is_where_the_surface_turns_away() -> None:
    # A ball: no sharp edges, one closed line about it.
    mesh = ts.box(size=(2, 2, 2), elements=(12, 12, 12))
    centred = mesh.nodes - 1
    radius = np.abs(centred).max(axis=1, keepdims=True)
    length = np.linalg.norm(centred, axis=1, keepdims=True)
    ball = seen(np.divide(centred * radius, length, out=np.zeros_like(centred), where=length > 0))
    facets = facets_of(mesh)
    assert len(outline(ball, facets)) == 0
    rim = outline(ball, facets, silhouette=True)
    assert len(rim) > 20
    assert np.linalg.norm(ball[np.unique(rim), :2], axis=1).min() > 0.95
    _, uses = np.unique(rim, return_counts=True)
    assert (uses % 2 == 0).all()  # closed


@pytest.mark.parametrize("element", ["hexahedron", "tetrahedron", "bcc-tetrahedron"])
def test_facets_face_outwards_and_close_the_body(element: str) -> None:
    mesh = body(element).mesh
    facets = facets_of(mesh)
    outwards = mesh.nodes[facets].mean(axis=1) - np.array(SIZE) / 2
    assert ((normals(mesh.nodes, facets) * outwards).sum(axis=1) > 0).all()
    assert enclosed(mesh.nodes[triangles_of(facets)]) == pytest.approx(np.prod(SIZE))


def enclosed(triangles: Any) -> float:
    """The volume within a closed surface, by the divergence theorem."""
    return float(np.linalg.det(triangles).sum() / 6)


# --- images ---------------------------------------------------------------------------------------


def square(depth: float, low: float, high: float) -> Any:
    corners = [[low, low], [high, low], [high, high], [low, high]]
    return np.array([[[x, y, depth] for x, y in corners]])


def scene(filled: bool = True) -> Shot:
    """A red square behind a green one, and a line through the middle that lies on the red one."""
    faces = np.concatenate([square(0.0, -1.0, 1.0), square(1.0, -0.4, 0.4)])
    colors = np.array([[[1.0, 0, 0]] * 4, [[0, 1.0, 0]] * 4])
    lines = np.array([[[-0.9, 0.0, 0.0], [0.9, 0.0, 0.0]]])
    layer = Layer(faces, colors if filled else None, lines, np.array([[0, 0]]), BLUE, 4.0)
    return Shot((layer,), np.array([-1.2, -1.2]), np.array([1.2, 1.2]), (120, 120), 1.0)


def colour(image: Image, x: float, y: float) -> list[int]:
    return image[round(60 - 50 * y), round(60 + 50 * x)].tolist()


def check_scene(filled: Image, hidden: Image) -> None:
    blue = [*np.rint(255 * rgb(BLUE)).astype(int).tolist(), 255]
    assert colour(filled, 0.7, 0.5) == [255, 0, 0, 255]
    assert colour(filled, 0.0, 0.3) == [0, 255, 0, 255]
    assert colour(filled, 0.0, 0.0) == [0, 255, 0, 255]  # the line is behind
    assert colour(filled, 0.7, 0.0) == blue
    assert colour(filled, 1.1, 1.1)[3] == 0
    assert colour(hidden, 0.7, 0.0) == blue  # the faces hide, and are not to be seen
    assert colour(hidden, 0.0, 0.0)[3] == colour(hidden, 0.7, 0.5)[3] == 0


def test_matplotlib_finds_what_hides_what() -> None:
    check_scene(draw(scene()), draw(scene(filled=False)))


def test_images_are_stacked_as_paint_is() -> None:
    paints = [[200, 0, 0, 255], [0, 200, 0, 51], [0, 0, 200, 255], [0, 0, 0, 0]]
    red, thin_green, blue, none = (np.array(paint, dtype=np.uint8).reshape(1, 1, 4) for paint in paints)
    for images, wanted in (
        ((red, thin_green), [160, 40, 0, 255]),
        ((red, blue), [0, 0, 200, 255]),
        ((none, thin_green), [0, 200, 0, 51]),
        ((thin_green, none, none), [0, 200, 0, 51]),
    ):
        assert stacked(images).ravel().tolist() == wanted


def test_a_job_is_read_as_it_was_written(tmp_path: FilePath) -> None:
    write_job([scene(), scene(filled=False)], tmp_path / "job.npz")
    for back, wanted in zip(read_job(tmp_path / "job.npz"), (scene(), scene(filled=False)), strict=True):
        assert back.size == wanted.size and back.points == wanted.points
        assert (draw(back) == draw(wanted)).all()


@pytest.mark.skipif(importlib.util.find_spec("pyvista") is None, reason="PyVista is not installed")
@pytest.mark.verification
def test_pyvista_and_matplotlib_draw_the_same() -> None:
    found = result(body("tetrahedron", (8, 2, 4)))
    comparison = found.comparisons["linear"]
    pictures = [over_picture(found, "linear", comparison), distance_picture(found, "linear", comparison)]
    shots = [scene(), scene(filled=False), *(shot(picture) for picture in pictures if picture)]
    images, note = render(shots)()
    if note:
        pytest.skip(note)  # no graphics on this machine; said, not hidden
    check_scene(images[0], images[1])
    for image, wanted in zip(images[2:], shots[2:], strict=True):
        ours = draw(wanted)
        assert image.shape == ours.shape
        on_paper = [np.where(one[..., 3:] > 0, one[..., :3], 255).astype(float) for one in (image, ours)]
        apart = np.abs(on_paper[0] - on_paper[1]).max(axis=2)
        assert (on_paper[0] < 250).any() and apart.mean() < 6


def dies(code: str) -> Callable[[FilePath, FilePath], list[str]]:
    return lambda job, answer: [sys.executable, "-c", code, str(job), str(answer)]


BLANK = "import sys, numpy as np; np.savez(sys.argv[2], image_0=np.zeros((9, 9, 4), np.uint8))"


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("import os; os.abort()", "PyVista's process was ended by signal 6"),
        (
            r"import sys; sys.exit('\x1b[33m12:00 WARN| no library.')",
            "failed (exit code 1): no library; on Linux",
        ),
        ("import time; time.sleep(60)", "took more than 1 s"),
        (BLANK, "PyVista drew nothing"),
    ],
)
def test_a_child_that_fails_leaves_pictures_by_matplotlib_and_the_reason(
    code: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: True if name == "pyvista" else find(name))
    monkeypatch.setattr(rendering, "_command", dies(code))
    if "sleep" in code:
        monkeypatch.setattr(rendering, "_PATIENCE", 0.5)
        monkeypatch.setattr(rendering, "_PATIENCE_EACH", 0.5)
    images, note = render([scene()])()
    assert in_order(note, "pictures in 3D", "matplotlib", words)
    assert (images[0] == draw(scene())).all()


def test_without_pyvista_the_way_out_is_told(by_matplotlib: None) -> None:
    assert "pip install 'truespring[3d]'" in render([scene()])()[1]


# --- pictures -------------------------------------------------------------------------------------


def test_pictures_hold_the_lines_that_lie_on_the_surface() -> None:
    found = result(body())
    comparison = found.comparisons["linear"]
    over = over_picture(found, "linear", comparison)
    assert over is not None
    black, blue = over.layers
    n_edges = len(edges_of(facets_of(found.problem.mesh)))
    n_facets = len(facets_of(found.problem.mesh))
    assert black.ink == INK and len(black.lines) == n_edges and black.colors is not None
    assert blue.ink == BLUE and len(blue.lines) == n_edges + 2 * n_facets and blue.colors is None
    assert blue.faces == pytest.approx(seen(comparison.model.states[-1].positions)[facets_of(found.problem.mesh)])
    assert black.faces == pytest.approx(seen(comparison.reference.states[-1].positions)[facets_of(found.problem.mesh)])
    assert over.title == "Full load: 10 % apart (root mean square)"
    asked = undeformed_picture(undeformed_of(found))
    assert asked.title == f"Undeformed: 30 nodes, 8 elements, {59 + 2 * 38 + 4 * 8} springs"  # of edges, faces, cubes


def test_the_surface_is_coloured_by_the_distance_of_its_nodes() -> None:
    found = result(body())
    comparison = found.comparisons["linear"]
    drawn = distance_picture(found, "linear", comparison)
    assert drawn is not None and drawn.bar is not None
    # 44 mm beside 40 mm at the right end, nothing at the left one; by the square of x between.
    assert drawn.title == "Full load: at most 10 %, 4.0 mm from linear FEM"
    assert drawn.bar.largest == pytest.approx(100 * comparison.max_errors[-1]) == pytest.approx(10)
    assert drawn.bar.label == "distance [% of the reference's largest displacement]"
    surface = drawn.layers[0]
    assert surface.colors is not None
    facets = facets_of(found.problem.mesh)
    share = (found.problem.mesh.nodes[facets, 0] / SIZE[0]) ** 2
    wanted = error_colors(share)
    light = surface.colors / wanted
    assert light == pytest.approx(np.broadcast_to(light[:, :1, :1], light.shape))  # one light a facet
    assert 0.8 - 1e-9 <= light.min() < light.max() <= 1 + 1e-9


def test_a_reference_that_does_not_move_is_measured_in_metres() -> None:
    problem = body()
    found = result(problem, references={"linear": path(problem, 0.0)})
    drawn = distance_picture(found, "linear", found.comparisons["linear"])
    assert drawn is not None and drawn.bar is not None
    assert drawn.bar.label == "distance [mm]" and drawn.bar.largest == pytest.approx(44)
    assert drawn.title == "Full load: at most 44 mm from linear FEM"


def test_tiny_displacements_are_magnified_and_the_distance_is_not() -> None:
    problem = body()
    found = result(problem, share=1.1e-3, references={"linear": path(problem, 1e-3)})
    comparison = found.comparisons["linear"]
    nodes, facets = problem.mesh.nodes, facets_of(problem.mesh)
    large = seen(nodes + 200 * comparison.model.states[-1].displacement)
    for draw_it, layer in ((over_picture, 1), (distance_picture, 0)):
        drawn = draw_it(found, "linear", comparison)
        assert drawn is not None and drawn.remark == "displacements × 200"
        assert drawn.layers[layer].faces == pytest.approx(large[facets])
    assert drawn is not None and drawn.title == "Full load: at most 10 %, 4.0 µm from linear FEM"


def test_the_probe_the_arrow_and_the_scale_are_where_they_belong() -> None:
    found = result(body())
    picture = undeformed_picture(undeformed_of(found))
    with figure_style():
        figure = figure_of(picture, draw(shot(picture)))
    (dot,) = called(figure, "probe")
    assert np.ravel(dot.get_data()) == pytest.approx(1e3 * seen(found.problem.mesh.nodes)[found.probe, :2])
    (image,) = called(figure, "image")
    wanted = shot(picture)
    (area,) = figure.areas
    assert [*area.x, *area.y] == pytest.approx([1e3 * v for v in np.ravel(np.stack([wanted.lower, wanted.upper]).T)])
    corners = area.place(1e3 * np.stack([wanted.lower, wanted.upper]))
    assert image.get_window_extent().get_points() == pytest.approx(corners)
    texts = words(figure)
    assert {"F = 50 mN", "x", "y", "z", "each 10 mm"} <= texts.keys()
    assert called(figure, "clamped")
    # Loaded facets are tinted instead of dotted with nodes.
    assert not called(figure, "loaded")
    assert picture.layers[0].colors is not None
    right = np.isclose(found.problem.mesh.nodes[facets_of(found.problem.mesh), 0], SIZE[0]).all(axis=1)
    tints = picture.layers[0].colors.mean(axis=1)
    assert (np.ptp(tints, axis=1) > 0.1)[right].all() and (np.ptp(tints, axis=1) < 0.05)[~right].all()


def test_rollers_stand_on_the_sides_that_they_hold() -> None:
    held = [ts.Fixed(on=side, fix=[axis]) for side, axis in (("left", "x"), ("bottom", "y"), ("back", "z"))]
    found = result(body(supports=held))
    picture = undeformed_picture(undeformed_of(found))
    with figure_style():
        figure = figure_of(picture, draw(shot(picture)))
    pins = [one for one in called(figure, "support") if isinstance(one, Line2D)]
    places = {tuple(np.round(np.ravel(pin.get_data()), 6)) for pin in pins}
    nodes = found.problem.mesh.nodes
    on_sides = (np.isclose(nodes, 0)).any(axis=1)
    assert places <= {tuple(place) for place in np.round(1e3 * seen(nodes[on_sides])[:, :2], 6)}
    assert len(pins) > 10 and not called(figure, "clamped")


def test_figures_of_a_study_in_3d(by_matplotlib: None, tmp_path: FilePath) -> None:
    problem = body("tetrahedron", (2, 1, 1))
    found = result(problem, references={"linear": path(problem, 1.0), "a/b": path(problem, 1.05, label="Hencky FEM")})
    drawn = save_figures(found, tmp_path)
    pairs = [f"springs_{what}_{name}" for name in ("linear", "a-b") for what in ("over", "error")]
    assert set(drawn) == {"undeformed", *pairs, "curves", "error"}
    for name in pairs:
        assert (tmp_path / f"{name}.png").read_bytes().startswith(b"\x89PNG")
        svg = (tmp_path / f"{name}.svg").read_text("utf-8")
        assert "data:image/png;base64," in svg and "http" not in re.sub(
            r'xmlns(:\w+)?="[^"]*"|<!DOCTYPE[^>]*>', "", svg
        )
    assert {one.note for one in drawn.values()} == {"", drawn["undeformed"].note} and drawn["undeformed"].note


def test_a_network_in_space_has_no_surface_and_is_drawn_all_the_same(by_matplotlib: None) -> None:
    nodes = [[0, 0, 0], [2, 0, 0], [1, 0, 2], [1, 2, 1]]
    tripod = ts.SpringNetwork(nodes, [[0, 3], [1, 3], [2, 3]], [1.0, 1.0, 1.0])
    problem = ts.Problem(
        tripod.mesh, supports=[ts.Fixed(on=[0, 1, 2])], loads=[ts.Force(on=[3], total=(0.0, -0.1, 0.0))]
    )
    soft, stiff = (ts.solve(problem, replace(tripod, stiffness=k * tripod.stiffness)) for k in (1, 2))
    stiff = replace(stiff, label="stiff springs")
    found = Result(
        "A tripod",
        FilePath("tripod.toml"),
        problem,
        {"soft": soft, "stiff": stiff},
        3,
        "soft",
        {"stiff": ts.compare(soft, stiff, 3)},
        0.05,
        "",
    )
    figures = draw_figures(found)
    assert set(figures) == {"undeformed", "soft_over_stiff", "curves", "error"}
    assert called(figures["undeformed"], "loaded")
    data = viewer(found, 10_000)
    assert data is not None and data["triangles"] == "" and numbers(data["paths"][0]["lines"]).size == 6


# --- the interactive view -------------------------------------------------------------------------


def numbers(text: str) -> Any:
    return np.frombuffer(base64.b64decode(text), dtype="<u4")


def test_the_scene_holds_surface_springs_and_positions() -> None:
    problem = body(elements=(6, 3, 3))
    found = result(problem)
    data = viewer(found, 400_000)
    assert data is not None
    mesh, springs = problem.mesh, network(problem.mesh).springs
    assert data["n_nodes"] == mesh.n_nodes  # springs inside are few: all nodes are kept
    triangles, lines, inside = (
        numbers(text).reshape(-1, k)
        for text, k in ((data["triangles"], 3), (data["paths"][0]["lines"], 2), (data["paths"][0]["inside"], 2))
    )
    assert len(lines) + len(inside) == len(springs) and 0 < len(inside) < len(springs)
    assert numbers(data["paths"][1]["inside"]).size == 0
    longest = max(data["box"])
    assert data["unit"] == "mm" and data["box"] == pytest.approx([80, 20 + 44, 40])
    lower = np.array([0, -0.044, 0])
    for packed, state in zip(data["paths"][0]["positions"], found.solutions["springs"].states, strict=True):
        steps = np.frombuffer(base64.b64decode(packed), dtype="<u2").reshape(-1, 3)
        places = lower + steps * (1e-3 * longest / 65535)
        assert places == pytest.approx(state.positions, abs=2e-6)
        assert enclosed(places[triangles]) == pytest.approx(mesh.measures_at(state.positions).sum(), rel=1e-3)
    assert data["probe"] == found.probe
    # 44 mm and 40 mm at the right end: 4 mm apart
    assert data["paths"][1]["most"] == ["0 m", "2.0 mm", "4.0 mm"]
    assert len(data["colors"]) == 33 and all(len(color) == 3 for color in data["colors"])


@pytest.mark.parametrize(
    "model", [ts.Springs("isotropic", volume=True), ts.Springs("biquadratic")], ids=["volume", "biquadratic"]
)
def test_every_model_of_springs_is_drawn_by_its_springs(model: ts.Springs) -> None:
    problem = body()
    springs = path(problem, 1.0, kind="springs", label="springs", potential=model.potential(problem))
    assert path_lines(springs).tolist() == network(problem.mesh).springs.tolist()
    assert path_lines(path(problem, 1.0, potential=ts.Fem("linear").potential(problem))).tolist() == (
        problem.mesh.edges.tolist()
    )


def test_nodes_inside_that_nothing_is_drawn_at_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("truespring.report.scene._MOST_SPRINGS", 100)
    monkeypatch.setattr("truespring.report.scene._MOST_SOLID", 100)
    problem = body(elements=(6, 3, 3))
    found = result(problem)
    data = viewer(found, 400_000)
    assert data is not None
    outside = np.unique(facets_of(problem.mesh))
    assert data["n_nodes"] == len(outside) < problem.mesh.n_nodes
    assert outside[data["probe"]] == found.probe
    assert numbers(data["triangles"]).max() == len(outside) - 1
    assert data["paths"][0]["inside"] == ""
    per_level = 3 * len(outside) * 2
    assert viewer(found, 2 * per_level - 1) is None
    kept = viewer(found, 2 * per_level)
    assert kept is not None and kept["paths"][0]["levels"] == [0.0, 1.0]


@pytest.fixture
def page_of(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Page]:
    """Pages without their pictures, which take a second each."""
    blank = Drawing(b"", b"<svg/>", "", 1.0, "Drawn by hand.")
    names = ("undeformed", "springs_over_linear", "springs_error_linear")
    monkeypatch.setattr("truespring.report.page.render_figures", lambda _: dict.fromkeys(names, blank))
    return lambda *found: Page(render_page(found, ""))


def told(page: Page) -> str:
    return " ".join("".join(page.said).replace("\N{NO-BREAK SPACE}", " ").split())


def scripts(page: Page) -> list[str]:
    return [script.strip() for script in page.scripts if script.strip()]


def bundle() -> str:
    return FilePath(rendering.__file__).with_name("scene.min.js").read_text("utf-8")


def test_the_bundle_is_part_of_pages_with_a_body_in_3d_alone(page_of: Callable[..., Page]) -> None:
    plane = ts.Problem(
        mesh=ts.rectangle(size=(0.08, 0.02), elements=(4, 1)),
        material=ts.Material(young=10e3, poisson=1 / 3),
        section=ts.PlaneStress(thickness=0.01),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.4, 0.0))],
    )
    only = ts.solve(plane, ts.Fem("linear"), ts.Newton(load_steps=2))
    flat = Result("Flat", FilePath("flat.toml"), plane, {"linear": only}, 1, "linear", {}, 0.05, "")
    assert len(scripts(page_of(flat))) == 5  # the two of every page, the data, and the two that draw them
    both = scripts(page_of(result(body()), flat))
    assert [script == bundle().strip() for script in both] == [False, False, False, False, True, False, False]
    still = result(body(), references={})
    still = replace(still, solutions={"springs": path(body(), 1.0, levels=(0.0,), kind="springs", label="springs")})
    assert len(scripts(page_of(still))) == 3  # nothing turns


def test_a_page_in_3d_loads_nothing(page_of: Callable[..., Page]) -> None:
    page = page_of(result(body()))
    assert page.policy.startswith("default-src 'none';") and "unsafe-eval" not in page.policy
    assert page.loaded and all(address.startswith("data:image/") for address in page.loaded)
    assert not {"link", "iframe", "object", "embed", "base"} & set(page.tags)
    addresses = set(re.findall(r"(?:https?:)?//[\w.-]+\.\w+[\w./-]*", "".join(page.scripts)))
    assert addresses <= {"http://www.w3.org/1999/xhtml"}  # a name, which is not fetched
    for word in ("fetch(", "XMLHttpRequest", "WebSocket", "importScripts", "import(", "eval("):
        assert word not in bundle().replace(".import(", "")
    data = page.data
    assert len(data["box"]) == 3 and "canvas" in page.tags


@pytest.mark.parametrize("name", ["scene.js", "view.js"])
def test_the_bundle_is_that_of_its_source_and_carries_the_licence(name: str) -> None:
    text = (FilePath(__file__).parent.parent / "viewer" / name).read_text("utf-8")
    said = re.findall(r'"([#\w][^"\n]{5,})"', re.sub(r"^import .*?;$", "", text, flags=re.DOTALL | re.MULTILINE))
    assert len(said) > 3
    for line in said:
        assert line in bundle(), f"{line}: build the bundle anew, npm run build in viewer/"
    assert "The MIT License" in bundle() and "three.js authors" in bundle()
    assert "</script" not in bundle().lower()


def test_the_page_speaks_of_a_body_in_3d(page_of: Callable[..., Page]) -> None:
    half = ts.Region(on=ts.Box((0.0, 0.0, 0.0), (0.04, 0.02, 0.04)), material=ts.Material(young=50e3, poisson=0.25))
    problem = body(regions=[half])
    problem = replace(problem, mesh=replace(problem.mesh, notes=("2 nodes that no element uses were left out",)))
    found = result(problem)
    words = told(page_of(found))
    assert "80 mm × 20 mm × 40 mm" in words
    assert "(0 m, 0 m, 0 m) to (40 mm, 20 mm, 40 mm), 4 elements: Young’s modulus 50 kPa, Poisson’s ratio 0.25" in words
    assert "1 region of another material" in words
    assert "volume ratio" in words and "area ratio" not in words
    assert "plane st" not in words and " thick" not in words
    assert in_order(words, "mesh: 2 nodes that no element uses were left out")
    assert "note: mesh: 2 nodes that no element uses were left out" in list(result_tables(found))
    assert words.count("Drawn by hand.") == 1
    assert "coloured by its distance" in words and "distance from the reference" in words and "WebGL" in words


def test_a_push_along_z_is_told_as_such(page_of: Callable[..., Page], by_matplotlib: None) -> None:
    problem = body(loads=[ts.Force(on="front", total=(0.0, 0.0, -0.2))])
    found = result(problem)
    assert drive(found).axis == 2 and drive(found).name == "−z"
    assert "total force along −z [mN]" in words(draw_figures(found)["curves"])
    assert "(0 N, 0 N, −200 mN)" in told(page_of(found))


def test_a_body_too_large_for_a_page_says_where_its_levels_are(
    page_of: Callable[..., Page], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("truespring.report.page._BUDGET", 100)
    page = page_of(result(body()))
    assert in_order(told(page), "too large", ".pvd", "ParaView") and len(scripts(page)) == 3


# --- files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", ["hexahedron", "tetrahedron", "bcc-tetrahedron"])
def test_the_stl_of_a_solid_is_its_closed_surface(element: str, tmp_path: FilePath) -> None:
    problem = body(element)
    deformed = path(problem, 1.0)
    write_stl(deformed, tmp_path / "deformed.stl")
    read = meshio.read(tmp_path / "deformed.stl")
    triangles = read.points[read.cells_dict["triangle"]]
    assert len(triangles) == len(triangles_of(facets_of(problem.mesh)))
    exact = problem.mesh.measures_at(deformed.states[-1].positions).sum()
    assert enclosed(triangles) == pytest.approx(exact, rel=1e-6)


@pytest.mark.parametrize(
    ("element", "cell"),
    [("hexahedron", "hexahedron"), ("tetrahedron", "tetra"), ("triangle", "triangle"), ("quadrilateral", "quad")],
)
def test_vtu_files_of_every_kind_of_element(element: str, cell: str, tmp_path: FilePath) -> None:
    if element in ("triangle", "quadrilateral"):
        problem = ts.Problem(
            mesh=ts.rectangle(size=SIZE[:2], elements=(4, 1), element=element),
            material=ts.Material(young=10e3, poisson=0.3),
            section=ts.PlaneStress(thickness=0.01),
            supports=[ts.Fixed(on="left")],
            loads=[ts.Force(on="right", total=(0.0, -0.001))],
        )
    else:
        problem = body(element, loads=[ts.Force(on="right", total=(0.0, -0.001, 0.0))])
    quadratic = ts.Fem("linear", element="quadratic") if cell in ("tetra", "triangle") else ts.Fem("linear")
    solved = ts.solve(problem, quadratic, ts.Newton(load_steps=1))
    write_series(solved, tmp_path, "linear")
    write_stl(solved, tmp_path / "deformed.stl")
    read = meshio.read(tmp_path / "linear" / "linear_0001.vtu")
    assert read.cells_dict[cell].tolist() == problem.mesh.elements.tolist()
    dim = problem.mesh.dim
    assert read.point_data["displacement"][:, :dim] == pytest.approx(solved.states[-1].displacement)
    assert sum(values.sum() for values in read.cell_data["strain_energy"]) == pytest.approx(solved.states[-1].energy)
    assert len(meshio.read(tmp_path / "deformed.stl").cells_dict["triangle"]) > 0
