"""Distances of surfaces, in the plane and in space."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from truespring.arrays import Floats
from truespring.mesh import gap
from truespring.mesh.distance import distance_to


def surface(mesh: ts.Mesh) -> Floats:
    facets = mesh.boundary
    if facets.shape[1] == 4:
        facets = np.concatenate([facets[:, [0, 1, 2]], facets[:, [0, 2, 3]]])
    return np.asarray(mesh.nodes[facets])


BODIES = (ts.rectangle((2.0, 1.0), (8, 4)), ts.box((2.0, 1.0, 1.0), (4, 2, 2)))


@pytest.mark.parametrize("mesh", BODIES)
def test_a_surface_is_not_apart_from_itself_however_it_is_divided(mesh: ts.Mesh) -> None:
    mine = surface(mesh)
    assert gap(mine, mine) == (0.0, 0.0)
    finer = ts.rectangle((2.0, 1.0), (9, 5)) if mesh.dim == 2 else ts.box((2.0, 1.0, 1.0), (5, 3, 3))
    assert gap(mine, surface(finer)).max < 1e-14


@pytest.mark.parametrize("mesh", BODIES)
def test_a_convex_body_moved_without_turning_is_apart_by_the_motion(mesh: ts.Mesh) -> None:
    mine, motion = surface(mesh), np.array([0.3, -0.2, 0.1])[: mesh.dim]
    found = gap(mine, mine + motion)
    assert found.max == pytest.approx(np.linalg.norm(motion))
    assert 0 < found.rms < found.max
    assert gap(mine + motion, mine) == pytest.approx(found)


def test_the_root_mean_square_of_a_ball_that_grows_is_the_growth() -> None:
    angle = np.linspace(0, 2 * np.pi, 721)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ring = np.stack([circle[:-1], circle[1:]], axis=1)
    assert gap(ring, 1.1 * ring) == pytest.approx((0.1, 0.1), rel=1e-3)


@given(seed=st.integers(0, 10_000))
@settings(max_examples=40, deadline=None)
def test_the_distance_to_a_triangle_is_that_to_its_nearest_of_many_points(seed: int) -> None:
    rng = np.random.default_rng(seed)
    triangle, point = rng.normal(size=(3, 3)), 2 * rng.normal(size=3)
    share = np.linspace(0, 1, 201)
    first, second = (one.ravel() for one in np.meshgrid(share, share))
    shares = np.stack([1 - first - second, first, second], axis=1)[first + second <= 1 + 1e-12]
    nearest = np.linalg.norm(shares @ triangle - point, axis=1).min()
    found = float(distance_to(point[None], triangle[None])[0])
    size = np.linalg.norm(np.ptp(triangle, axis=0)) / 200
    assert found <= nearest + 1e-12 and nearest - found < size


def test_many_facets_of_many_sizes_are_searched_as_if_all_were_looked_at() -> None:
    rng = np.random.default_rng(7)
    centres, sizes = rng.uniform(-1, 1, (400, 1, 3)), 10 ** rng.uniform(-3, 0.3, (400, 1, 1))
    triangles = centres + sizes * rng.normal(size=(400, 3, 3))
    points = rng.uniform(-2, 2, (300, 3))
    each = [distance_to(points, one[None]) for one in triangles]
    assert distance_to(points, triangles) == pytest.approx(np.min(each, axis=0), abs=1e-13)


def test_a_flat_triangle_is_as_far_as_its_edges() -> None:
    flat = np.array([[[0.0, 0, 0], [1.0, 0, 0], [0.5, 0, 0]]])
    assert distance_to(np.array([[0.5, 2.0, 0.0]]), flat) == pytest.approx([2.0])
