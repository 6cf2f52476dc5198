"""Surfaces in the plane: their outline, where a place lies in them, and distances with a closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

import truespring as ts
from truespring.arrays import Floats
from truespring.errors import MeshError
from truespring.mesh import Surface, SurfaceDistance, surface_distance


def halved(mesh: ts.Mesh, positions: Floats | None = None) -> Surface:
    """The quadrilaterals of a mesh, each as two triangles."""
    a, b, c, d = mesh.elements.T
    points = mesh.nodes if positions is None else positions
    return Surface(points, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]))


def distance(mesh: ts.Mesh, surface: Surface, positions: Floats | None = None) -> SurfaceDistance:
    return surface_distance(mesh.nodes if positions is None else positions, mesh.boundary, surface)


def to_every_segment(places: Floats, segments: Floats) -> Floats:
    """Distance of each place to the nearest segment, by trying all."""
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    offset = places[:, None] - start
    share = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0, 1)
    return np.asarray(np.linalg.norm(offset - share[:, :, None] * along, axis=2).min(axis=1))


def nine_of_each(segments: Floats) -> Floats:
    share = np.linspace(0, 1, 9)[None, :, None]
    return np.asarray((segments[:, :1] * (1 - share) + segments[:, 1:] * share).reshape(-1, 2))


# --- distances with a closed form -----------------------------------------------------------------


def test_a_body_lies_on_itself() -> None:
    mesh = ts.rectangle((2.0, 1.0), (8, 4))
    found = distance(mesh, halved(mesh))
    assert max(found.outline_max, found.nodes_max) <= 1e-15


@pytest.mark.parametrize("elements", [(8, 8), (16, 8), (64, 64)])
def test_a_shifted_square(elements: tuple[int, int]) -> None:
    mesh, d = ts.rectangle((1.0, 1.0), elements), 0.25
    found = distance(mesh, halved(mesh, mesh.nodes + np.array([d, 0.0])))
    # Sides across the shift: d outside; inside min(d, y, 1 - y). Sides along it: only the last d is off, by up to d.
    across, along = d**2 + d**2 * (1 - 2 * d) + 2 * d**3 / 3, 2 * d**3 / 3
    assert found.outline_rms == pytest.approx(np.sqrt((across + along) / 4), rel=1e-12)
    assert found.outline_max == pytest.approx(d, rel=1e-12)
    # Nodes fall on nodes, except in the first d, whose nearest are in the shifted left side.
    column = np.arange(0, d, 1 / elements[0])
    beyond = np.zeros(elements[0] + 1)
    beyond[: len(column)] = d - column
    assert found.nodes_rms == pytest.approx(np.sqrt((beyond**2).mean()), rel=1e-12)
    assert found.nodes_max == pytest.approx(d, rel=1e-12)


def test_a_frame_around_a_rectangle() -> None:
    (a, b), g = (1.0, 0.5), 0.125
    inner, outer = ts.rectangle((a, b), (8, 4)), ts.rectangle((a + 2 * g, b + 2 * g), (10, 6))
    found = distance(inner, halved(outer, outer.nodes - g))
    # The inner outline is g away; so is the outer one, but for its corners: 8 ends with distance^2 = g^2 + t^2.
    integral = 2 * (2 * (a + b) * g**2) + 8 * (g**3 + g**3 / 3)
    assert found.outline_rms == pytest.approx(np.sqrt(integral / (4 * (a + b) + 8 * g)), rel=1e-12)
    assert found.outline_max == pytest.approx(np.sqrt(2) * g, rel=1e-12)
    assert found.nodes_max <= 1e-15  # every node of the inner one has one of the outer one under it


def test_distance_does_not_depend_on_how_the_outline_is_divided() -> None:
    coarse, d = ts.rectangle((1.0, 1.0), (4, 4)), np.array([0.25, 0.0])
    uneven = ts.rectangle((1.0, 1.0), (4, 400))  # one pair of sides in a hundred times as many pieces
    expected = distance(coarse, halved(coarse, coarse.nodes + d)).outline_rms
    assert distance(uneven, halved(coarse, coarse.nodes + d)).outline_rms == pytest.approx(expected, rel=1e-12)
    assert distance(uneven, halved(uneven, uneven.nodes + d)).outline_rms == pytest.approx(expected, rel=1e-12)


@settings(max_examples=30, deadline=None, derandomize=True)
@given(
    st.integers(1, 30),
    st.integers(1, 30),
    st.floats(-np.pi, np.pi),
    st.tuples(st.floats(-2, 2), st.floats(-2, 2)),
    st.integers(0, 2**32 - 1),
)
def test_outlines_against_every_pair(n_x: int, n_y: int, angle: float, shift: tuple[float, float], seed: int) -> None:
    """The shortcut over the nearest middles finds what trying every segment finds, for uneven segments too."""
    mesh = ts.rectangle((1.0, 0.5), (n_x, n_y))
    rng = np.random.default_rng(seed)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    surface = halved(mesh, (mesh.nodes**2 + 0.01 * rng.random(mesh.nodes.shape) / max(n_x, n_y)) @ turn.T + shift)
    mine, theirs = mesh.nodes[mesh.boundary], surface.points[surface.outline]
    apart = [to_every_segment(nine_of_each(mine), theirs), to_every_segment(nine_of_each(theirs), mine)]
    assert distance(mesh, surface).outline_max == pytest.approx(np.concatenate(apart).max(), rel=1e-12)


# --- outline --------------------------------------------------------------------------------------


def test_outline_of_a_rectangle_and_of_a_hole() -> None:
    mesh = ts.rectangle((4.0, 3.0), (4, 3))
    whole = halved(mesh)
    assert len(whole.outline) == 2 * (4 + 3)
    hole = (whole.points[whole.triangles].mean(axis=1) // 1 == [1, 1]).all(axis=1)
    assert hole.sum() == 2
    pierced = Surface(whole.points, whole.triangles[~hole])
    assert len(pierced.outline) == 2 * (4 + 3) + 4
    length = np.linalg.norm(np.diff(pierced.points[pierced.outline], axis=1), axis=2).sum()
    assert length == pytest.approx(14 + 4, rel=1e-14)


# --- where a place lies ---------------------------------------------------------------------------


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(4, 200), st.floats(-3, 3), st.integers(0, 2**32 - 1))
def test_a_place_is_the_mean_of_the_corners_that_hold_it(n_points: int, flatness: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    squeeze = np.array([1.0, 10.0**flatness])
    points = rng.random((n_points, 2))
    triangles = Delaunay(points).simplices
    triangles[::2] = triangles[::2, ::-1]  # either way round
    surface = Surface(points * squeeze, triangles)
    places = (rng.random((50, 2)) * 1.5 - 0.25) * squeeze
    triangle, shares, apart = surface.locate(places)
    corners = surface.points[surface.triangles[triangle]]
    assert (shares[:, :, None] * corners).sum(axis=1) == pytest.approx(places, abs=1e-6 * surface.diameter)
    inside = Delaunay(points).find_simplex(places / squeeze) >= 0
    # A share times the height over its edge is the distance from that edge: inside, up to single precision.
    sides = np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1)
    twice_area = np.abs(sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0])
    heights = twice_area[:, None] / np.linalg.norm(sides, axis=2)
    assert ((shares * heights)[inside] >= -1.1e-6 * surface.diameter).all()
    assert (apart[inside] == 0).all()
    expected = to_every_segment(places[~inside], surface.points[surface.outline])
    assert apart[~inside] == pytest.approx(expected, abs=1.1e-6 * surface.diameter)


def test_needles_are_searched_to_the_end() -> None:
    """In triangles 1000 times as long as high, hundreds of other middles are nearer to the thin end."""
    mesh = ts.rectangle((1.0, 1.0), (1, 1000))
    places = np.array([[0.1, 0.50005], [0.9, 0.25095], [0.5, 0.7501], [1.1, 0.5]])
    triangle, shares, apart = halved(mesh).locate(places)
    assert (shares[:3] >= 0).all()
    corners = halved(mesh).points[halved(mesh).triangles[triangle]]
    assert (shares[:, :, None] * corners).sum(axis=1) == pytest.approx(places, abs=1e-12)
    assert apart == pytest.approx([0, 0, 0, 0.1], abs=1e-15)


def test_triangles_without_area_hold_nothing() -> None:
    points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0]]
    surface = Surface(np.array(points), np.array([[0, 3, 1], [0, 1, 2]]))
    triangle, shares, apart = surface.locate(np.array([[0.5, 0.0], [0.25, 0.25]]))
    assert triangle.tolist() == [1, 1] and apart.tolist() == [0, 0]
    assert shares == pytest.approx(np.array([[0.5, 0.5, 0.0], [0.5, 0.25, 0.25]]), abs=1e-15)


# --- what is refused ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("points", "triangles", "word"),
    [
        ([[0.0, 0.0]], np.empty((0, 3), dtype=int), "empty"),
        ([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0, 1, 3]], "0 to 2"),
        ([[0.0, 0.0], [1.0, 0.0], [0.0, np.nan]], [[0, 1, 2]], "not finite"),
        ([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0, 1, 2], [0, 2, 1]], "no outline"),
        ([[0.0, 0.0, 0.0]], [[0, 0, 0]], "expected"),
    ],
)
def test_what_is_no_surface_is_refused(points: list[list[float]], triangles: list[list[int]], word: str) -> None:
    with pytest.raises(MeshError, match=word):
        Surface(np.array(points), np.array(triangles))
