"""Paths on different meshes: what is carried, what is left out, and what the errors are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from truespring.arrays import Floats, Ints, along_axes
from truespring.comparison import most_moved
from truespring.errors import ProblemError
from truespring.misfit import Misfit, displacement_misfit, find_misfit
from truespring.reference import Level, Placing, Record, placed

LENGTH, HEIGHT = 0.16, 0.04
FILE = Path("result.vtu")


def beam(rows: int = 4, element: str = "quadrilateral", dim: int = 2) -> ts.Problem:
    counts, size = (4 * rows, rows, rows), (LENGTH, HEIGHT, HEIGHT)
    mesh = ts.rectangle(size[:2], counts[:2], element) if dim == 2 else ts.box(size, counts, element)
    return ts.Problem(
        mesh,
        ts.Material(10e3, 0.3),
        ts.PlaneStress(0.01) if dim == 2 else None,
        [ts.Fixed("left")],
        [ts.Force("right", (0.0, -0.03, 0.01)[:dim])],
    )


def solved(problem: ts.Problem, element: str | None = None) -> ts.Solution:
    return ts.solve(problem, ts.Fem("saint-venant-kirchhoff", element), ts.Newton(load_steps=4))


@pytest.fixture(scope="module")
def coarse() -> ts.Solution:
    return solved(beam(4))


@pytest.fixture(scope="module")
def solid() -> ts.Solution:
    return solved(beam(2, "hexahedron", 3))


def as_read(
    path: ts.Solution, moved: Floats | None = None, cells: dict[str, Ints] | None = None, unit: float = 1.0
) -> ts.Solution:
    """A path as if it had been read from a file: without its problem, moved as a whole, in another unit."""
    mesh = path.problem.mesh

    def in_space(vectors: Floats) -> Floats:
        return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))

    motion = np.zeros(3) if moved is None else moved
    levels = [
        Level(state.load_factor, (in_space(state.displacement) + state.load_factor * motion) / unit)
        for state in path.states
        if state.load_factor
    ]
    cells = {mesh.kind.vtk: mesh.elements} if cells is None else cells
    record = Record(FILE, "vtu", in_space(mesh.nodes) / unit, cells, tuple(levels))
    return placed(record, Placing(), "file")


def field(problem: ts.Problem, path: ts.Solution) -> ts.Solution:
    """A smooth displacement, given at the nodes of a mesh: each state of a path with that instead."""
    at = problem.mesh.nodes / LENGTH
    moved = 0.1 * LENGTH * np.stack([np.sin(2 * at[:, 0] + at[:, 1]), at[:, 0] ** 2 * np.cos(3 * at[:, 1])], axis=1)

    def with_field(state: ts.State) -> ts.State:
        displacement = state.load_factor * moved
        positions = problem.mesh.nodes + displacement
        return replace(state, displacement=displacement, positions=positions, all_positions=positions)

    return replace(path, states=tuple(with_field(state) for state in path.states))


# --- one mesh ---------------------------------------------------------------------------------


def test_a_path_is_not_apart_from_itself_nor_from_what_was_read_of_it(coarse: ts.Solution, solid: ts.Solution) -> None:
    for path in (coarse, solid):
        for other in (path, as_read(path)):
            for found in (ts.compare(path, other), ts.compare(other, path)):
                assert found.node_by_node and found.n_outside == 0
                assert found.rms_error == pytest.approx(0, abs=1e-15) and found.max_error == pytest.approx(0, abs=1e-15)
                assert found.hausdorff is not None and found.hausdorff.max < 1e-16
                assert found.agrees_up_to_load_factor == 1.0
                assert found.load_factors == pytest.approx([0.25, 0.5, 0.75, 1.0])


def test_a_copy_moved_as_a_whole_is_apart_by_the_motion(solid: ts.Solution) -> None:
    motion = np.array([0.003, -0.004, 0.012])
    found = ts.compare(as_read(solid, motion), solid)
    assert found.rms_distances == pytest.approx(np.linalg.norm(motion) * found.load_factors, rel=1e-12)
    assert found.max_distances == pytest.approx(found.rms_distances, rel=1e-12)
    free = solid.problem.mesh.nodes[:, 0] > 0  # the others are held
    size = np.sqrt((solid.states[-1].displacement[free] ** 2).sum(axis=1).mean())
    assert found.rms_error == pytest.approx(0.013 / size)
    assert found.hausdorff is not None and 0.9 * 0.013 < found.hausdorff.max <= 0.013 * (1 + 1e-12)


def test_nodes_in_another_order_are_compared_node_by_node(coarse: ts.Solution) -> None:
    mesh = coarse.problem.mesh
    order = np.random.default_rng(0).permutation(mesh.n_nodes)
    place = np.argsort(order)
    levels = tuple(Level(s.load_factor, np.pad(s.displacement[order], ((0, 0), (0, 1)))) for s in coarse.states[1:])
    points = np.pad(mesh.nodes[order], ((0, 0), (0, 1)))
    points += 2e-7 * np.random.default_rng(1).uniform(-1, 1, points.shape) * [1, 1, 0]  # six digits of a file
    other = placed(Record(FILE, "vtu", points, {"quad": place[mesh.elements]}, levels), Placing(), "file")
    found = ts.compare(other, coarse, "right-middle")
    assert found.node_by_node and found.rms_error is not None and found.rms_error < 1e-15
    assert found.model.problem is coarse.problem  # what is known of loads and supports is kept
    assert found.model.problem.mesh.nodes[found.probe] == pytest.approx([LENGTH, HEIGHT / 2])


def test_distances_in_metres_do_not_tell_model_from_reference(coarse: ts.Solution) -> None:
    other = ts.solve(coarse.problem, ts.Springs("isotropic"), ts.Newton(load_steps=4))
    one, two = ts.compare(coarse, other), ts.compare(other, coarse)
    assert one.rms_distances == pytest.approx(two.rms_distances, rel=1e-14) and one.rms_distances[-1] > 1e-4
    assert one.hausdorff == pytest.approx(two.hausdorff, rel=1e-12)
    assert one.rms_error != pytest.approx(two.rms_error, rel=1e-3)


def test_the_node_that_moves_most_is_free_and_of_several_the_first_along_x(coarse: ts.Solution) -> None:
    problem = coarse.problem
    size = np.linalg.norm(coarse.states[-1].displacement, axis=1)
    assert most_moved(coarse) == size.argmax() != 0
    some = np.array([3, 5, 7])
    assert most_moved(coarse, some) == some[size[some].argmax()]
    even = [replace(state, displacement=np.full_like(state.displacement, 0.1)) for state in coarse.states]
    first = most_moved(replace(coarse, states=tuple(even)))
    assert problem.mesh.nodes[first] == pytest.approx([LENGTH / 16, 0.0])  # those on the left are held


def test_stored_energies_are_compared_if_both_are_known(coarse: ts.Solution) -> None:
    other = ts.solve(coarse.problem, ts.Springs("isotropic"), ts.Newton(load_steps=4))
    found = ts.compare(other, coarse)
    ours, theirs = other.states[-1].energy, coarse.states[-1].energy
    assert found.energy_error == pytest.approx(abs(ours - theirs) / theirs) and found.energy_error > 1e-3
    assert ts.compare(as_read(other), coarse).energy_error is None


# --- meshes of their own ----------------------------------------------------------------------


@pytest.mark.parametrize("element", ["quadrilateral", "triangle"])
def test_one_field_on_finer_meshes_is_carried_at_the_order_of_the_elements(element: str, coarse: ts.Solution) -> None:
    """The reference is carried: its elements' interpolation is what errs, by h^2."""
    at = beam(23, element)
    fine = field(at, replace(coarse, problem=at, potential=None))
    errors = []
    for rows in (2, 4, 8):
        problem = beam(rows, element)
        found = ts.compare(fine, field(problem, replace(coarse, problem=problem, potential=None)))
        assert not found.node_by_node and found.n_outside == 0
        errors.append(found.rms_error)
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (orders > 1.8).all() and (orders < 2.3).all(), orders


def test_elements_of_second_order_are_carried_by_their_own_interpolation(coarse: ts.Solution) -> None:
    problem = beam(3, "triangle")
    quadratic = solved(problem, "quadratic")
    nodes = quadratic.whole.points

    def with_square(state: ts.State) -> ts.State:
        moved = state.load_factor * nodes**2
        positions = nodes + moved
        n_nodes = problem.mesh.n_nodes
        return replace(state, displacement=moved[:n_nodes], positions=positions[:n_nodes], all_positions=positions)

    squares = replace(quadratic, states=tuple(with_square(state) for state in quadratic.states))
    at = coarse.problem.mesh.nodes
    mine = tuple(
        replace(state, displacement=state.load_factor * at**2, positions=at + state.load_factor * at**2)
        for state in coarse.states
    )
    found = ts.compare(replace(coarse, states=mine), squares)
    assert not found.node_by_node and found.rms_error is not None and found.rms_error < 1e-13


def test_what_lies_outside_is_left_out_and_counted(coarse: ts.Solution) -> None:
    longer = beam(4)
    mesh = ts.rectangle((1.25 * LENGTH, HEIGHT), (20, 4))
    longer = replace(longer, mesh=mesh)
    path = field(longer, replace(coarse, problem=longer, potential=None))
    theirs = field(coarse.problem, coarse)
    found = ts.compare(path, theirs)
    assert found.n_outside == 4 * 5 and found.rms_error is not None and found.rms_error < 1e-15
    assert (mesh.nodes[found.outside, 0] > LENGTH * 1.01).all()
    assert not found.outside[found.probe]
    elsewhere = ts.Mesh(coarse.problem.mesh.nodes + 1, coarse.problem.mesh.elements)
    far = replace(coarse, problem=replace(coarse.problem, mesh=elsewhere))
    with pytest.raises(ProblemError, match="unit, axes and origin"):
        ts.compare(far, coarse)


def test_a_solid_is_compared_with_a_plane_body_at_the_middle_of_its_depth(
    coarse: ts.Solution, solid: ts.Solution
) -> None:
    for found in (ts.compare(solid, coarse), ts.compare(coarse, solid)):
        assert found.model.problem.mesh.dim == 2 and found.hausdorff is None
        assert found.n_outside == 0
    state, middle = solid.states[-1], np.isclose(solid.problem.mesh.nodes[:, 2], HEIGHT / 2)
    carried = ts.compare(coarse, solid).reference.states[-1]
    for node, moved in zip(solid.problem.mesh.nodes[middle], state.displacement[middle], strict=True):
        place = ts.nearest_node(coarse.problem.mesh, node[:2].tolist())
        assert carried.displacement[place] == pytest.approx(moved[:2], abs=1e-12)


def test_markers_are_compared_where_they_are(coarse: ts.Solution, solid: ts.Solution) -> None:
    """A body is carried to markers, whichever of both is the reference; they have no surface."""
    rng = np.random.default_rng(3)
    for path in (coarse, solid):
        mesh = path.problem.mesh
        points = rng.uniform(mesh.lower, mesh.upper, (12, mesh.dim))
        state = path.states[-1]
        moved = path.whole.locate(points).carry(state.displacement)
        moved[0] += 0.01
        pad = ((0, 0), (0, 3 - mesh.dim))
        record = Record(FILE, "csv", np.pad(points, pad), {}, (Level(1.0, np.pad(moved, pad)),))
        markers = placed(record, Placing(), "markers")
        for found in (ts.compare(path, markers), ts.compare(markers, path)):
            assert len(found.outside) == 12 and found.hausdorff is None and found.n_outside == 0
            assert found.max_distances == pytest.approx([0.01 * np.sqrt(mesh.dim)])
            assert found.rms_distances == pytest.approx([0.01 * np.sqrt(mesh.dim / 12)])
    other = placed(replace(record, points=record.points + 1e-3), Placing(), "others")
    with pytest.raises(ProblemError, match="12 points"):
        ts.compare(markers, other)


def test_a_surface_in_space_is_as_far_from_the_body_as_it_was_moved(solid: ts.Solution) -> None:
    """The outside of a solid as quadrilaterals of their own: a shift along x is all of the distance there is."""
    mesh, state = solid.problem.mesh, solid.states[-1]
    used, facets = np.unique(mesh.boundary, return_inverse=True)
    for shift in (0.0, 0.002):
        moved = state.displacement[used] + [shift, 0.0, 0.0]
        record = Record(FILE, "vtu", mesh.nodes[used], {"quad": facets.reshape(-1, 4)}, (Level(1.0, moved),))
        found = ts.compare(placed(record, Placing(), "surface"), solid)
        assert found.hausdorff is not None and found.hausdorff.max == pytest.approx(shift, rel=0.05, abs=1e-12)
        assert found.max_distances == pytest.approx([shift], abs=1e-15)


# --- units and axes that do not fit -----------------------------------------------------------


def turned(path: ts.Solution, axes: tuple[str, ...], factor: float = 1.0, shift: Floats | None = None) -> ts.Solution:
    """A solid as a file with other axes, unit and origin tells it."""
    mesh = path.problem.mesh
    back = np.linalg.inv(along_axes(np.eye(3), axes).T)  # from our axes to the file's
    levels = tuple(Level(s.load_factor, s.displacement @ back.T / factor) for s in path.states if s.load_factor)
    away = np.zeros(3) if shift is None else shift
    record = Record(FILE, "frd", (mesh.nodes - away) @ back.T / factor, {"hexahedron": mesh.elements}, levels)
    return placed(record, Placing(), "file")


def test_a_body_that_lies_right_has_no_misfit(coarse: ts.Solution, solid: ts.Solution) -> None:
    for path in (coarse, solid):
        assert find_misfit(as_read(path), path) is None
        assert find_misfit(path, as_read(path)) is None
    assert find_misfit(coarse, solid) is None and find_misfit(solid, coarse) is None
    assert displacement_misfit(ts.compare(as_read(solid), solid)) is None


@pytest.mark.parametrize("factor", [1e-3, 1e-2, 0.0254])
def test_another_unit_is_noticed(factor: float, coarse: ts.Solution, solid: ts.Solution) -> None:
    for path in (coarse, solid):
        found = find_misfit(as_read(path, unit=factor), path)
        assert found == Misfit(factor=pytest.approx(factor))


@pytest.mark.parametrize("axes", [("x", "z", "-y"), ("z", "x", "y"), ("-y", "x", "z"), ("y", "x", "z")])
def test_other_axes_are_found_from_the_motion_if_the_boxes_are_equal(axes: tuple[str, ...], solid: ts.Solution) -> None:
    """The beam is as deep as it is wide: boxes alone do not tell y from z."""
    found = find_misfit(turned(solid, axes), solid)
    assert found is not None and found.axes == axes and found.factor == 1
    assert find_misfit(placed_again(turned(solid, axes), found), solid) is None


def placed_again(path: ts.Solution, found: Misfit) -> ts.Solution:
    grid = path.whole
    levels = tuple(Level(s.load_factor, s.all_positions - grid.points) for s in path.states if s.load_factor)
    record = Record(FILE, "frd", found.factor * grid.points, dict(grid.cells), levels)
    return placed(record, Placing(axes=found.axes, shift=found.shift), "file")


def test_unit_axes_and_origin_together_are_noticed(solid: ts.Solution) -> None:
    shift = np.array([0.5, -0.1, 0.2])
    found = find_misfit(turned(solid, ("x", "z", "-y"), 1e-3, shift), solid)
    assert found is not None and found.factor == pytest.approx(1e-3) and found.axes == ("x", "z", "-y")
    assert found.shift == pytest.approx(shift, abs=1e-6)


def test_another_body_has_no_misfit_that_would_mend_it(coarse: ts.Solution) -> None:
    other = solved(replace(beam(4), mesh=ts.rectangle((0.05, 0.045), (4, 4))))
    assert find_misfit(other, coarse) is None


def test_a_body_that_lies_right_but_moves_along_other_axes_is_noticed(solid: ts.Solution) -> None:
    """A mirror about its own middle leaves the box in place: only the motion tells."""
    mesh = solid.problem.mesh
    levels = tuple(Level(s.load_factor, s.displacement[:, [0, 2, 1]]) for s in solid.states if s.load_factor)
    swapped = placed(Record(FILE, "vtu", mesh.nodes, {"hexahedron": mesh.elements}, levels), Placing(), "file")
    found = displacement_misfit(ts.compare(swapped, solid))
    assert found is not None and found.factor == 1 and found.axes == ("x", "z", "y")
    levels = tuple(Level(s.load_factor, 1000 * s.displacement) for s in solid.states if s.load_factor)
    longer = placed(Record(FILE, "vtu", mesh.nodes, {"hexahedron": mesh.elements}, levels), Placing(), "file")
    found = displacement_misfit(ts.compare(longer, solid))
    assert found is not None and found.factor == pytest.approx(1e-3)


def test_points_without_displacement_are_left_out_with_their_cells(coarse: ts.Solution) -> None:
    """As a .dat file of CalculiX that prints a set of nodes only."""
    mesh = coarse.problem.mesh
    pad = ((0, 0), (0, 1))
    moved = np.pad(coarse.states[-1].displacement, pad)
    moved[mesh.nodes[:, 0] < 0.05] = np.nan
    path = placed(
        Record(FILE, "dat", np.pad(mesh.nodes, pad), {"quad": mesh.elements}, (Level(1.0, moved),)), Placing(), "file"
    )
    assert path.problem.mesh.lower[0] == pytest.approx(0.05) and "25 of 85 points" in path.warnings[0]
    assert ts.compare(path, coarse).rms_error == pytest.approx(0, abs=1e-15)
    assert ts.compare(coarse, path).n_outside == 25


def test_energies_in_the_units_of_a_file_are_converted_by_its_unit_of_force(coarse: ts.Solution) -> None:
    mesh, state = coarse.problem.mesh, coarse.states[-1]
    pad = ((0, 0), (0, 1))
    level = Level(1.0, 1e3 * np.pad(state.displacement, pad), energy=1e6 * state.energy)  # mm, mN
    record = Record(FILE, "dat", 1e3 * np.pad(mesh.nodes, pad), {"quad": mesh.elements}, (level,))
    assert ts.compare(placed(record, Placing("mm"), "file"), coarse).energy_error is None
    converted = placed(record, Placing("mm", force_unit="mN"), "file")
    assert ts.compare(converted, coarse).energy_error == pytest.approx(0, abs=1e-12)
