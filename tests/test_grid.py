"""Cells of any kind, where places lie among them, and the mesh of their corners."""

import numpy as np
import pytest
import pyvista as pv
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from truespring.arrays import Floats, Ints
from truespring.errors import MeshError
from truespring.mesh import CELL_SHAPES, Grid, corner_measures, corner_mesh

KINDS = tuple(CELL_SHAPES)
VTK = {
    "line": 3,
    "line3": 21,
    "triangle": 5,
    "triangle6": 22,
    "quad": 9,
    "quad8": 23,
    "quad9": 28,
    "tetra": 10,
    "tetra10": 24,
    "hexahedron": 12,
    "hexahedron20": 25,
    "hexahedron27": 29,
    "wedge": 13,
    "wedge15": 26,
    "wedge18": 32,
    "pyramid": 14,
    "pyramid13": 27,
}


def some_inside(kind: str, count: int = 40, seed: int = 3) -> Floats:
    shape = CELL_SHAPES[kind]
    shares = np.random.default_rng(seed).dirichlet(np.ones(len(shape.corners)), count)
    return np.asarray(shares @ shape.corners)


def bent(points: Floats, seed: int = 5, size: float = 0.06) -> Floats:
    """Move points a little, each differently: cells become curved, and none inverted."""
    return points + size * np.random.default_rng(seed).uniform(-1, 1, points.shape)


def test_every_kind_is_known_to_vtk() -> None:
    assert set(VTK) == set(KINDS) and len(KINDS) > 15


@pytest.mark.parametrize("kind", KINDS)
def test_shape_functions_are_one_at_their_node_and_add_up_to_one(kind: str) -> None:
    shape = CELL_SHAPES[kind]
    assert shape.shapes(shape.places) == pytest.approx(np.eye(len(shape.places)), abs=1e-11)
    at = some_inside(kind)
    assert shape.shapes(at).sum(axis=1) == pytest.approx(1.0, abs=1e-11)
    assert shape.shapes(at) @ shape.places == pytest.approx(at, abs=1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_are_the_derivatives_to_second_order(kind: str) -> None:
    shape, at = CELL_SHAPES[kind], some_inside(kind)
    slopes = shape.slopes(at)
    assert np.abs(slopes).max() > 0.5
    for axis in range(shape.dim):
        errors = []
        for step in (1e-2, 5e-3):
            ahead = step * np.eye(shape.dim)[axis]
            difference = (shape.shapes(at + ahead) - shape.shapes(at - ahead)) / (2 * step)
            errors.append(np.abs(difference - slopes[:, :, axis]).max())
        assert errors[1] < 1e-10 or errors[0] / errors[1] > 3.5, errors


@pytest.mark.parametrize("kind", [kind for kind in KINDS if not kind.startswith("pyramid")])
def test_shape_functions_are_those_of_vtk_node_by_node(kind: str) -> None:
    """VTK, another program, tells the order of nodes; its pyramids have other own coordinates, and other functions."""
    shape = CELL_SHAPES[kind]
    flat = np.zeros((len(shape.places), 3))
    flat[:, : shape.dim] = shape.places
    cell = pv.UnstructuredGrid({VTK[kind]: np.arange(len(flat))[None]}, flat).GetCell(0)
    at = some_inside(kind)
    for own, mine in zip(at, shape.shapes(at), strict=True):
        theirs = [0.0] * len(flat)
        cell.InterpolateFunctions([*own, 0.0, 0.0][:3], theirs)
        assert mine == pytest.approx(theirs, abs=1e-11)


def test_a_curved_pyramid_carries_what_vtk_carries() -> None:
    points = bent(CELL_SHAPES["pyramid"].places)
    values = np.random.default_rng(8).normal(size=5)
    grid = pv.UnstructuredGrid({14: np.arange(5)[None]}, points)
    grid["values"] = values
    places = CELL_SHAPES["pyramid"].shapes(some_inside("pyramid")) @ points
    theirs = pv.PolyData(places).sample(grid, tolerance=1e-9)
    found = Grid(points, {"pyramid": np.arange(5)[None]}).locate(places)
    known = np.asarray(theirs["vtkValidPointMask"]).astype(bool)
    assert known.sum() > 30 and not found.outside.any()
    assert found.carry(values)[known] == pytest.approx(np.asarray(theirs["values"])[known], abs=1e-6)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if CELL_SHAPES[kind].dim > 1])
@given(seed=st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_a_linear_field_is_carried_exactly_inside_and_a_little_beyond(kind: str, seed: int) -> None:
    shape = CELL_SHAPES[kind]
    rng = np.random.default_rng(seed)
    points = bent(shape.places, seed)
    grid = Grid(points, {kind: np.arange(len(points))[None]})
    gradient, offset = rng.normal(size=(shape.dim, 2)), rng.normal(size=2)
    places = shape.shapes(some_inside(kind, seed=seed)) @ points
    off = places + 2e-4 * rng.uniform(-1, 1, places.shape)
    for some in (places, off):
        found = grid.locate(some)
        assert not found.outside.any()
        assert found.carry(points @ gradient + offset) == pytest.approx(some @ gradient + offset, abs=1e-9)


def distorted(n: int) -> Grid:
    mesh = ts.rectangle((1.0, 0.5), (2 * n, n))
    inner = ((mesh.nodes > mesh.lower) & (mesh.nodes < mesh.upper)).all(axis=1)
    moved = mesh.nodes.copy()
    moved[inner] += np.random.default_rng(1).uniform(-0.25, 0.25, (inner.sum(), 2)) * 0.5 / n
    return Grid(moved, {"quad": mesh.elements})


def test_each_place_is_found_in_a_mesh_of_many_cells_and_what_is_outside_is_told() -> None:
    grid = distorted(20)
    places = np.random.default_rng(2).uniform(-0.1, 1.1, (4000, 2)) * [1.0, 0.5]
    found = grid.locate(places)
    beyond = np.maximum(np.maximum(-places, places - [1.0, 0.5]), 0.0)
    outside = np.linalg.norm(beyond, axis=1) > 1e-3 * np.hypot(1.0, 0.5)
    assert 500 < outside.sum() < 3500
    assert (found.outside == outside).all()
    assert found.carry(grid.points)[~outside] == pytest.approx(places[~outside], abs=1e-12)
    # Its nearest point stands for a place outside.
    nearest = np.linalg.norm(places[outside][:, None] - grid.points, axis=2).min(axis=1)
    assert found.distance[outside] == pytest.approx(nearest)
    assert np.linalg.norm(found.carry(grid.points) - places, axis=1)[outside] == pytest.approx(nearest)


def test_cells_of_very_different_sizes_are_all_found() -> None:
    """One large cell beside a thousand small ones, a hundred times longer than wide."""
    large = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    small = ts.rectangle((1.0, 0.01), (10, 100))
    points = np.concatenate([large, small.nodes + np.array([1.0, 0.0])])
    grid = Grid(points, {"quad": np.concatenate([np.arange(4)[None], small.elements + 4])})
    rng = np.random.default_rng(0)
    places = np.concatenate([rng.uniform(0, 1, (200, 2)), rng.uniform(0, 1, (200, 2)) * [1.0, 0.01] + [1.0, 0.0]])
    found = grid.locate(places)
    assert not found.outside.any()
    assert found.carry(points) == pytest.approx(places, abs=1e-12)


def test_a_field_on_ever_finer_cells_is_carried_at_their_order() -> None:
    def field(at: Floats) -> Floats:
        return np.sin(3 * at[:, 0]) * np.cos(2 * at[:, 1])

    places = np.random.default_rng(4).uniform(0.02, 0.48, (500, 2))
    errors = []
    for n in (4, 8, 16):
        grid = distorted(n)
        errors.append(np.abs(grid.locate(places).carry(field(grid.points)) - field(places)).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (orders > 1.7).all(), orders


def test_a_surface_in_space_carries_to_feet_of_places_near_it() -> None:
    mesh = ts.rectangle((1.0, 1.0), (4, 4), "triangle")
    points = np.column_stack([mesh.nodes, 0.3 * mesh.nodes[:, 0]])
    grid = Grid(points, {"triangle": mesh.elements})
    assert not grid.fills and grid.cell_dim == 2
    found = grid.locate(np.array([[0.4, 0.3, 0.12], [0.4, 0.3, 0.5]]))
    assert found.outside.tolist() == [False, True]
    assert found.carry(points)[0] == pytest.approx([0.4, 0.3, 0.12])


def test_cells_of_a_lower_dimension_only_bound_others() -> None:
    grid = Grid(np.eye(3)[:, :2], {"triangle": np.array([[0, 1, 2]]), "line": np.array([[0, 1]])})
    assert set(grid.cells) == {"triangle"} and grid.fills


@pytest.mark.parametrize(
    ("cells", "words"),
    [
        ({"polygon": np.zeros((1, 5), int)}, "'polygon' are not supported"),
        ({"quad": np.zeros((1, 3), int)}, "shape"),
        ({"quad": np.array([[0, 1, 2, 9]])}, "name points 0 to 9"),
    ],
)
def test_cells_that_cannot_be_are_refused(cells: dict[str, Ints], words: str) -> None:
    with pytest.raises(MeshError, match=words):
        Grid(np.zeros((4, 2)) + np.arange(4)[:, None], cells)


# --- the mesh of corners -----------------------------------------------------------------------


def mixed_cube() -> Grid:
    """A cube of bricks, of which some are wedges and pyramids, its points numbered at random, some cells mirrored."""
    mesh = ts.box((1.0, 1.0, 1.0), (3, 3, 3))
    new = np.random.default_rng(0).permutation(mesh.n_nodes)
    points = np.empty((mesh.n_nodes, 3))
    points[new] = mesh.nodes
    bricks = new[mesh.elements]
    middle = points[bricks].mean(axis=1)
    in_wedges, in_pyramids = middle[:, 0] < 0.4, middle[:, 0] > 0.7
    cut = bricks[in_wedges]
    wedges = np.concatenate([cut[:, [0, 1, 2, 4, 5, 6]], cut[:, [3, 2, 0, 7, 6, 4]]])
    tips = len(points) + np.arange(in_pyramids.sum())
    faces = CELL_SHAPES["hexahedron"].facets
    pyramids = np.concatenate([np.column_stack([bricks[in_pyramids][:, list(face)], tips]) for face in faces])
    return Grid(
        np.concatenate([points, middle[in_pyramids]]),
        {"hexahedron": bricks[~in_wedges & ~in_pyramids], "wedge": wedges, "pyramid": pyramids},
    )


def test_cells_of_several_kinds_stay() -> None:
    grid = mixed_cube()
    mesh, nodes = corner_mesh(grid)
    assert mesh.element_kinds == ("pyramid", "wedge", "hexahedron") and (grid.points[nodes] == mesh.nodes).all()
    assert mesh.measures.min() > 0 and mesh.measures.sum() == pytest.approx(1.0)
    assert len(mesh.boundary) == 6 * 9 + 6  # each of six wedges' triangles beside that of its twin
    assert corner_measures(mesh.nodes[mesh.boundary]).sum() == pytest.approx(6.0)


def test_cells_beside_bricks_with_corners_that_are_one_become_tetrahedra_that_meet_face_to_face() -> None:
    grid = mixed_cube()
    wedges = grid.cells["wedge"]
    bricks = np.concatenate([grid.cells["hexahedron"], wedges[:, [0, 1, 2, 2, 3, 4, 5, 5]]])
    cells = {"hexahedron": bricks, "pyramid": grid.cells["pyramid"]}
    mesh, nodes = corner_mesh(Grid(grid.points, cells))
    assert mesh.element == "tetrahedron" and (grid.points[nodes] == mesh.nodes).all()
    assert mesh.measures.min() > 0 and mesh.measures.sum() == pytest.approx(1.0)
    # Were faces divided differently on both sides, they would count as boundary.
    assert len(mesh.boundary) == 6 * 9 * 2
    assert corner_measures(mesh.nodes[mesh.boundary]).sum() == pytest.approx(6.0)


def test_cells_of_one_kind_stay_and_mirrored_ones_are_turned() -> None:
    mesh = ts.box((1.0, 1.0, 1.0), (2, 2, 2))
    cells = mesh.elements.copy()
    cells[::2] = cells[::2][:, [0, 3, 2, 1, 4, 7, 6, 5]]
    found, _ = corner_mesh(Grid(mesh.nodes, {"hexahedron": cells}))
    assert found.element == "hexahedron" and found.measures.sum() == pytest.approx(1.0)


def test_collapsed_bricks_as_other_programs_write_wedges_are_read() -> None:
    brick = np.array([[0, 1, 2, 2, 3, 4, 5, 5]])
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=float)
    mesh, _ = corner_mesh(Grid(points, {"hexahedron": brick}))
    assert mesh.element == "tetrahedron" and mesh.measures.sum() == pytest.approx(0.5)


def test_points_alone_are_joined_by_the_shortest_lines() -> None:
    points = np.array([[0.0, 0.0], [0.0, 1.0], [5.0, 0.0], [5.0, 1.0], [5.0, 3.0]])
    mesh, nodes = corner_mesh(Grid(points, {}))
    assert mesh.element == "line" and nodes.tolist() == [0, 1, 2, 3, 4]
    assert {tuple(sorted(line)) for line in mesh.elements.tolist()} == {(0, 1), (2, 3), (3, 4), (0, 2)} or {
        tuple(sorted(line)) for line in mesh.elements.tolist()
    } == {(0, 1), (2, 3), (3, 4), (1, 3)}
    with pytest.raises(MeshError, match="single point"):
        corner_mesh(Grid(points[:1], {}))
