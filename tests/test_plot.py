"""Pictures of solutions in axes of matplotlib, by what the axes hold."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure
from PIL import Image

import truespring as ts
from tests.test_solution_files import solved
from truespring.errors import MeshError, OutputError
from truespring.showing.frames import curves_of

matplotlib.use("agg")


@pytest.fixture(scope="module")
def springs() -> ts.Solution:
    return solved(model=ts.Springs("gaussian"))


@pytest.fixture(scope="module")
def finite() -> ts.Solution:
    return solved(model=ts.Fem("neo-hookean"))


@pytest.fixture(scope="module")
def block() -> ts.Solution:
    return solved(size=(0.04, 0.01, 0.01), model=ts.Fem("saint-venant-kirchhoff"))


@pytest.fixture
def axes() -> Any:
    return Figure(layout="constrained").subplots()


def artist(axes: Any, name: str) -> Any:
    (found,) = [one for one in axes.get_children() if one.get_gid() == name]
    return found


def words(axes: Any) -> list[str]:
    legend = axes.get_legend()
    return [legend.get_title().get_text(), *(one.get_text() for one in legend.get_texts())]


def test_springs_are_blue_over_black_elements(springs: ts.Solution, finite: ts.Solution, axes: Any) -> None:
    assert springs.plot(over=finite, ax=axes) is axes
    mine, theirs = artist(axes, "solution"), artist(axes, "reference")
    ends = springs.states[-1].positions[springs.potential.springs]  # type: ignore[union-attr]
    assert np.array(mine.get_segments()) == pytest.approx(ends) and len(ends) > 20
    assert np.array(theirs.get_segments()) == pytest.approx(finite.states[-1].positions[finite.problem.mesh.edges])
    assert mine.get_zorder() > theirs.get_zorder() and matplotlib.colors.to_hex(mine.get_color()[0]) == "#0072b2"
    error = ts.compare(springs, finite).rms_errors[-1]
    title, *names = words(axes)
    assert title == f"Full load: {100 * error:.2g} % apart (root mean square)"
    assert names == [springs.label, finite.label, "undeformed"]
    assert axes.get_xlabel() == "x [mm]" and axes.xaxis.get_major_formatter()(0.02) == "20"
    assert axes.get_xlim()[0] < 0 and axes.get_xlim()[1] > 0.04 and axes.get_aspect() == 1


@pytest.mark.parametrize(
    ("color", "label"),
    [
        ("displacement", "displacement [mm]"),
        ("distance", "distance [mm]"),
        ("stress", "von Mises stress [kPa]"),
        ("stretch", "stretch of springs"),
        ("tension", "change of tension of springs [mN]"),
    ],
)
def test_colours_stand_for_the_quantity(
    color: str, label: str, springs: ts.Solution, finite: ts.Solution, axes: Any
) -> None:
    springs.plot(over=finite, color=color, ax=axes)
    drawn, state = artist(axes, "colors"), springs.states[-1]
    apart = np.linalg.norm(state.displacement - finite.states[-1].displacement, axis=1)
    fields = springs.to_pyvista()
    known = {
        "displacement": np.linalg.norm(state.displacement, axis=1),
        "distance": apart,
        "stretch": fields["stretch"][: len(springs.potential.springs)],  # type: ignore[union-attr]
        "tension": fields["tension_change"][: len(springs.potential.springs)],  # type: ignore[union-attr]
        "stress": von_mises(fields["stress"][-16:]),
    }[color]
    assert np.asarray(drawn.get_array()) == pytest.approx(known, rel=1e-6)
    (inset,) = [one for one in axes.child_axes if one.get_ylabel()]
    assert inset.get_ylabel() == label
    least, most = drawn.get_clim()
    if color in ("stretch", "tension"):  # the middle colour is that of a spring without change
        assert (least + most) / 2 == pytest.approx({"stretch": 1.0, "tension": 0.0}[color], abs=1e-12)
        assert max(-np.min(known - (least + most) / 2), np.max(known - (least + most) / 2)) == pytest.approx(
            (most - least) / 2
        )
    else:
        assert (least, most) == pytest.approx((0.0, known.max()))


def test_stress_of_straight_springs_is_force_over_area(axes: Any) -> None:
    strip = ts.Problem(
        ts.rectangle((0.04, 0.01), (8, 2)),
        ts.Material(young=1e4, poisson=1 / 3),
        ts.PlaneStress(thickness=0.02),
        supports=[ts.Fixed("left", ("x",)), ts.Fixed("bottom", ("y",))],
        loads=[ts.Force("right", (0.1, 0.0))],
    )
    stretched = ts.solve(strip, ts.Springs("lloyd"))
    stretched.plot(color="stress", ax=axes)
    height = np.ptp(stretched.states[-1].positions[:, 1])
    assert np.asarray(artist(axes, "colors").get_array()) == pytest.approx(0.1 / (0.02 * height), rel=1e-6)
    (inset,) = [one for one in axes.child_axes if one.get_ylabel()]
    assert inset.get_ylabel() == "von Mises stress of springs, mean at nodes [Pa]"


def von_mises(stress: Any) -> Any:
    """By the formula in components."""
    xx, xy, xz, _, yy, yz, _, _, zz = stress.T
    return np.sqrt(
        ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * (xy**2 + xz**2 + yz**2),
    )


def test_small_displacements_are_magnified(axes: Any) -> None:
    stiff = solved()
    small = ts.solve(
        ts.Problem(stiff.problem.mesh, ts.Material(1e7, 0.3), ts.PlaneStress(0.01), *_held(stiff)), ts.Springs("lloyd")
    )
    small.plot(ax=axes, level=-1)
    title, *_ = words(axes)
    factor = float(title.split("× ")[1].replace("\N{NO-BREAK SPACE}", ""))
    nodes, state = small.problem.mesh.nodes, small.states[-1]
    ends = (nodes + factor * state.displacement)[small.potential.springs]  # type: ignore[union-attr]
    assert factor > 1 and np.array(artist(axes, "solution").get_segments()) == pytest.approx(ends)
    other = small.plot(ax=Figure().subplots(), magnify=1)
    assert np.array(artist(other, "solution").get_segments()) == pytest.approx(
        state.positions[small.potential.springs]  # type: ignore[union-attr]
    )
    with pytest.raises(OutputError, match="magnify = 0: a factor above 0 is expected"):
        small.plot(magnify=0)


def _held(solution: ts.Solution) -> tuple[Any, Any]:
    return solution.problem.supports, solution.problem.loads


def test_a_body_in_space_is_an_image_with_its_colours(block: ts.Solution, axes: Any) -> None:
    block.plot(color="stress", level=1, ax=axes)
    image = artist(axes, "image")
    pixels = image.get_array()
    assert (pixels[..., 3] > 250).mean() > 0.1  # the body, on a clear ground
    left, right, bottom, top = image.get_extent()
    assert (right - left) / (top - bottom) == pytest.approx(pixels.shape[1] / pixels.shape[0], rel=0.01)
    (bar,) = axes.child_axes
    most = von_mises(block.to_pyvista(level=1)["stress"]).max()
    assert bar.get_ylim()[1] == pytest.approx(most) and bar.get_ylabel() == "von Mises stress [Pa]"
    assert words(axes)[0] == f"{block.label} · Load factor 0.5"
    reds = pixels[(pixels[..., 3] > 250) & (pixels[..., 0] > pixels[..., 2].astype(int) + 60)]
    assert len(reds) > 50  # yellow, the end of the colours


def test_springs_of_a_body_in_space_are_means_at_its_nodes(axes: Any) -> None:
    block = solved(size=(0.04, 0.01, 0.01), model=ts.Springs("gaussian"))
    block.plot(color="stretch", ax=axes)
    grid = block.to_pyvista()
    springs = block.potential.springs  # type: ignore[union-attr]
    means = [grid["stretch"][: len(springs)][(springs == node).any(axis=1)].mean() for node in range(20)]
    (bar,) = axes.child_axes
    assert bar.get_ylabel() == "stretch of springs, mean at nodes"
    assert max(bar.get_ylim()) - 1 == pytest.approx(np.abs(np.array(means) - 1).max())


def test_a_network_in_space_is_lines_seen_from_the_viewer(axes: Any) -> None:
    nodes = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1], [0.3, 1, 0.3]])
    springs = np.array([[0, 3], [1, 3], [2, 3]])
    length = np.linalg.norm(nodes[springs[:, 0]] - nodes[springs[:, 1]], axis=1)
    problem = ts.Problem(
        ts.Mesh(nodes, springs, "line"),
        supports=[ts.Fixed([0, 1, 2])],
        loads=[ts.Force([3], (0.0, -1.0, 0.0))],
    )
    truss = ts.solve(problem, ts.SpringNetwork(nodes, springs, np.full(3, 100.0), length), ts.Newton(1))
    truss.plot(color="tension", ax=axes, magnify=1)
    drawn = artist(axes, "colors")
    assert sorted(drawn.get_array()) == pytest.approx(sorted(truss.to_pyvista()["tension"]))
    assert max(drawn.get_array()) < 0  # all are pressed
    towards = np.array([0.55, 0.5, 1.0]) / np.linalg.norm([0.55, 0.5, 1.0])
    right = np.cross([0, 1, 0], towards)
    up = np.cross(towards, right / np.linalg.norm(right))
    tops = np.array(drawn.get_segments())[:, 1]
    assert tops[:, 1] == pytest.approx(np.full(3, truss.states[-1].positions[3] @ up))
    with pytest.raises(OutputError, match="has no stress; it has displacement, stretch, tension"):
        truss.plot(color="stress")


def test_surfaces_and_points_that_were_read(springs: ts.Solution, axes: Any, tmp_path: Path) -> None:
    surface = ts.read_stl(springs.problem, springs.write(tmp_path / "springs.stl"))
    springs.plot(over=surface, ax=axes)
    ends = np.array(artist(axes, "reference").get_segments())
    assert np.ptp(ends.reshape(-1, 2), axis=0) == pytest.approx(np.ptp(springs.states[-1].positions, axis=0), rel=1e-5)
    assert "outlines" in words(axes)[0]
    alone = surface.plot(ax=Figure().subplots())
    assert len(artist(alone, "solution").get_segments()) > len(surface.surface.outline)  # type: ignore[union-attr]
    with pytest.raises(OutputError, match="is a surface without displacements: draw it alone"):
        surface.plot(color="displacement")
    markers = ts.read_result(springs.write(tmp_path / "springs.csv"))
    dots = artist(markers.plot(color="displacement", ax=Figure().subplots()), "colors")
    assert np.asarray(dots.get_offsets()) == pytest.approx(springs.states[-1].positions)


def test_what_cannot_be_drawn_is_an_error(springs: ts.Solution, block: ts.Solution) -> None:
    with pytest.raises(OutputError, match=r"color = 'strech' is unknown \(did you mean 'stretch'\?\); allowed: dist"):
        springs.plot(color="strech")
    with pytest.raises(OutputError, match=r"color = 'distance' needs a reference: plot\(over=reference"):
        springs.plot(color="distance")
    with pytest.raises(OutputError, match=r"over = 'stress': a Solution is expected; a quantity is given as color="):
        springs.plot("stress")  # type: ignore[arg-type]
    with pytest.raises(OutputError, match=r"over = 'stress': a Solution is expected"):
        springs.animate("never.gif", "stress")  # type: ignore[arg-type]
    with pytest.raises(OutputError, match="cannot be written: "):
        springs.animate(Path(__file__) / "x.gif")
    with pytest.raises(OutputError, match="magnify = '10': a factor above 0 is expected"):
        springs.plot(magnify="10")  # type: ignore[arg-type]
    with pytest.raises(OutputError, match=r"ax has three axes: .* leave projection out"):
        block.plot(ax=Figure().add_subplot(projection="3d"))
    with pytest.raises(OutputError, match=r"has 2 dimensions, .* 3: they cannot be drawn in one picture"):
        springs.plot(over=block)
    others = ts.solve(springs.problem, ts.Springs("lloyd"), ts.Newton(3))
    assert words(others.plot(over=springs, ax=Figure().subplots()))[0].startswith("Full load")
    with pytest.raises(OutputError, match="has 2 states"):  # at rest and at full load
        others.plot(over=springs, level=2)


def test_without_axes_the_figure_is_one_of_pyplot(springs: ts.Solution) -> None:
    from matplotlib import pyplot

    axes = springs.plot(level=1)
    try:
        assert axes.figure is pyplot.gcf() and words(axes)[0] == "Load factor 0.5"
        assert axes.figure.get_figwidth() < 8
    finally:
        pyplot.close(axes.figure)


def test_an_animation_has_a_frame_for_each_level(springs: ts.Solution, finite: ts.Solution, tmp_path: Path) -> None:
    with Image.open(springs.animate(tmp_path / "a" / "springs.gif", over=finite)) as film:
        assert getattr(film, "n_frames") == len(springs.states)  # noqa: B009
    with Image.open(springs.animate(tmp_path / "colours.gif", color="displacement")) as film:
        # At rest all is of the first colour, at full load colours up to the last one, that of the bar, are there.
        seen = []
        for number in range(len(springs.states)):
            film.seek(number)
            pixels = np.asarray(film.convert("RGB")).astype(int)[:, : int(0.8 * film.width)]  # without the bar
            seen.append((np.abs(pixels - [253, 231, 37]).max(axis=-1) < 40).sum())
        assert seen[:-1] == [0, 0] and seen[-1] > 50
    with pytest.raises(OutputError, match=r"the suffix of an animation is \.gif or \.mp4, not '\.avi'"):
        springs.animate(tmp_path / "springs.avi")
    surface = ts.read_stl(springs.problem, springs.write(tmp_path / "springs.stl"))
    with pytest.raises(OutputError, match=r"needs two load levels or more that springs.stl has"):
        surface.animate(tmp_path / "surface.gif")
    with pytest.raises(OutputError, match=r"needs two load levels or more that springs.stl has"):
        surface.animate(tmp_path / "surface.gif", color="displacement")
    with pytest.raises(OutputError, match=r"two load levels or more that springs.* and springs.stl both have"):
        springs.animate(tmp_path / "both.gif", over=surface, color="displacement")
    with pytest.raises(OutputError, match=r"magnify = '10': springs.stl is a surface"):
        springs.plot(over=surface, magnify="10")  # type: ignore[arg-type]


def test_a_mesh_shows_its_sides_and_groups(axes: Any) -> None:
    ts.rectangle((0.04, 0.01), (8, 2)).plot(ax=axes)
    assert words(axes) == ["27 nodes, 16 elements: quadrilateral", "left", "right", "bottom", "top"]
    ends = np.array(artist(axes, "top").get_segments())
    assert (ends[..., 1] == 0.01).all() and np.abs(np.diff(ends[..., 0])).sum() == pytest.approx(0.04)
    other = ts.rectangle((0.04, 0.01), (8, 2)).plot(["right-middle"], ax=Figure().subplots())
    assert np.asarray(artist(other, "right-middle").get_offsets()) == pytest.approx(np.array([[0.04, 0.005]]))
    box = ts.box((0.02, 0.01, 0.01), (2, 1, 1))
    halves = ts.Mesh(box.nodes, box.elements, "hexahedron", element_groups={"soft": np.array([1])})
    image = artist(halves.plot(ax=Figure().subplots()), "image").get_array().astype(int)
    tinted = (image[..., 3] > 250) & (image[..., 2] > image[..., 0] + 40)  # the blue of the first name
    columns = np.flatnonzero(tinted.any(axis=0))
    body = np.flatnonzero((image[..., 3] > 250).any(axis=0))
    assert 0.3 < len(columns) / len(body) < 0.8 and columns.max() == pytest.approx(body.max(), abs=10)
    with pytest.raises(MeshError, match=r"'lft' is no side or point of this body \(did you mean 'left'\?\)"):
        box.plot(["lft"])
    with pytest.raises(MeshError, match=r"names = 'left': a list of names is expected, such as \['left'\]"):
        box.plot("left")


@pytest.mark.parametrize("size", [(0.04, 0.01), (0.04, 0.01, 0.01)])
def test_a_problem_shows_loads_and_springs(size: tuple[float, ...]) -> None:
    problem = solved(size=size, model=ts.Springs("gaussian")).problem
    load, blue = np.array([0xB8, 0x4A, 0x00]), np.array([0x00, 0x72, 0xB2])

    def count(axes: Any, color: Any) -> int:
        pixels = artist(axes, "image").get_array()[..., :3].astype(int)
        return int((np.abs(pixels - color).max(axis=-1) < 24).sum())

    plain, sprung = (problem.plot(model, ax=Figure().subplots()) for model in (None, ts.Springs("gaussian")))
    assert count(plain, load) > 200 and count(plain, blue) == 0 and count(sprung, blue) > 200


@pytest.mark.parametrize("dim", [2, 3])
def test_a_network_shows_its_lines_without_a_model(dim: int) -> None:
    """As elements, in their colour; its springs, which are at the same places, hide them."""
    nodes = np.array([(0.0, 0.0, 0.0), (1.0, 0.5, 0.0), (2.0, 0.0, 0.2)])[:, :dim]
    truss = ts.SpringNetwork(nodes, np.array([(0, 1), (1, 2), (0, 2)]), stiffness=np.ones(3))
    held = [ts.Fixed([0, 2]), ts.Fixed([1], fix=["x", "y", "z"][1:dim])]
    problem = ts.Problem(truss.mesh, supports=held, loads=[ts.Force([1], (0.1, 0.0, 0.0)[:dim])])

    def count(model: Any, color: Any) -> int:
        pixels = artist(problem.plot(model, ax=Figure().subplots()), "image").get_array()[..., :3].astype(int)
        return int((np.abs(pixels - color).max(axis=-1) < 24).sum())

    ink, blue = [0x16, 0x19, 0x1D], [0x00, 0x72, 0xB2]
    assert count(None, ink) > count(truss, ink) + 500 and count(None, blue) == 0 and count(truss, blue) > 500


def test_curves_have_each_line_once() -> None:
    branched = np.array([[0, 1], [2, 1], [2, 3], [3, 0], [1, 3], [5, 6], [6, 7], [7, 5], [8, 9]])
    curves = curves_of(branched)
    lines = [frozenset(pair) for curve in curves for pair in pairwise(curve)]
    assert len(lines) == len(branched) and set(lines) == {frozenset(pair) for pair in branched.tolist()}
    assert sorted(map(len, curves)) == [2, 2, 4, 5]  # two between 1 and 3, a triangle, a line
