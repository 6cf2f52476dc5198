"""Tools and grasps: derivatives, areas, closed forms of contact and friction, and wrong input."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from tests.test_petsc import Rank
from truespring.arrays import Floats
from truespring.conditions import Interaction
from truespring.errors import ExportError, MeshError, ProblemError, StudyError
from truespring.exports import TARGETS, export
from truespring.exports.continuum import check_fem
from truespring.mesh import SecondOrder
from truespring.mesh.facets import triangles_of
from truespring.mesh.files.stl import stl_bytes
from truespring.piecewise import Piece
from truespring.potential import with_diagonal
from truespring.ranks import Layout, bisected
from truespring.refining import refined_problem
from truespring.study import plan, read_study
from truespring.tools import TOOLS, Tool
from truespring.tools.solid import Solid
from truespring.tools.surface import within

YOUNG, POISSON = 10e3, 0.3
MATERIAL = ts.Material(YOUNG, POISSON)
BALL = ts.Sphere("ball", 0.01, [[0, 0.03, 0.041], [1, 0.03, 0.037]])


def body(dim: int, element: str | None = None) -> ts.Mesh:
    """A block of 60 mm by 30 mm, with its top at y = 30 mm; not quite regular."""
    if dim == 2:
        return ts.rectangle((0.06, 0.03), (12, 6), element or "quadrilateral")
    return ts.box((0.06, 0.03, 0.06), (6, 2, 6), element or "hexahedron")


def problem(mesh: ts.Mesh, *tools: Tool, grasps: tuple[ts.Grasp, ...] = (), supports: object = None) -> ts.Problem:
    section = ts.PlaneStrain(0.01) if mesh.dim == 2 else None
    held = [ts.Fixed("bottom")] if supports is None else supports
    return ts.Problem(mesh, MATERIAL, section, held, tools=tools, grasps=grasps)  # type: ignore[arg-type]


def path(dim: int, *rows: tuple[float, float, float]) -> list[list[float]]:
    """Rows of place on the way, x and y, at the middle along z."""
    return [[*row, *([0.03] if dim == 3 else [])] for row in rows]


def angle(size: float) -> ts.Mesh:
    """A solid with a notch: a cube about the origin without the quarter of larger x and z."""
    cube = ts.box((size, size, size), (4, 4, 4))
    centred = cube.nodes - size / 2
    kept = ~((cube.centres[:, [0, 2]] > size / 2).all(axis=1))
    used = np.unique(cube.elements[kept])
    return ts.Mesh(centred[used], np.searchsorted(used, cube.elements[kept]), "hexahedron")


def write_stl(mesh: ts.Mesh, file: Path, scale: float = 1.0) -> Path:
    """The boundary of a body, or a part of it, as an STL file."""
    file.write_bytes(stl_bytes(scale * mesh.nodes[triangles_of(mesh.boundary)]))
    return file


@pytest.fixture(scope="module")
def notched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_stl(angle(0.024), tmp_path_factory.mktemp("tool") / "angle.stl", 1e3)


def above(dim: int, notched: Path) -> dict[str, Tool]:
    """One tool of each shape that is above the top at level 0, and goes down by 3 mm."""
    down = path(dim, (0, 0.031, 0.041), (1, 0.032, 0.038))
    flat = path(dim, (0, 0.031, 0.031), (1, 0.032, 0.028))
    zero = (0.0,) * (dim - 2)
    found: dict[str, Tool] = {
        "sphere": ts.Sphere("tool", 0.03, path(dim, (0, 0.031, 0.061), (1, 0.032, 0.058))),
        "capsule": ts.Capsule("tool", 0.01, (-0.011, 0.0, *zero), (0.012, 0.002, *zero), down),
        "plane": ts.HalfSpace("tool", (0.04, -2.0, *zero), flat),
        "box": ts.Block("tool", (0.023, 0.02, *([0.021] if dim == 3 else [])), down),
    }
    if dim == 3:
        found["stl"] = ts.StlTool("tool", notched, path(dim, (0, 0.031, 0.043), (1, 0.032, 0.04)), "mm")
    return found


def test_every_shape_is_tested(notched: Path) -> None:
    assert above(3, notched).keys() == TOOLS.keys() == {*above(2, notched), "stl"}


def in_a_step(tool: Tool, mesh: ts.Mesh, seed: int = 3) -> tuple[Interaction, Floats]:
    """Contact in the middle of a step with friction, and positions at which nodes touch, some sliding."""
    acting = problem(mesh, replace(tool, friction=0.4)).loading.interactions[0]
    moved = np.random.default_rng(seed).uniform(-4e-4, 4e-4, (2, *mesh.nodes.shape))
    begin = acting.cleared(mesh.nodes + moved[0], 0.8)
    positions = acting.cleared(begin + moved[1], 1.0)
    return acting.since(begin, 0.8, 3e-4).lagged(positions, 1.0), positions


@pytest.mark.parametrize("contact", ["penalty", "barrier"])
@pytest.mark.parametrize(("dim", "shape"), [(dim, one) for dim in (2, 3) for one in TOOLS if dim == 3 or one != "stl"])
def test_gradient_and_blocks_are_derivatives(dim: int, shape: str, contact: str, notched: Path) -> None:
    width = 5e-3 if contact == "barrier" else None
    mesh = body(dim)
    acting, positions = in_a_step(replace(above(dim, notched)[shape], contact=contact, width=width), mesh)
    nodes, blocks = acting.blocks(positions, 1.0)
    found = acting.gradient(positions, 1.0)
    assert np.array_equal(np.flatnonzero(found.any(axis=1)), np.sort(nodes))
    assert len(nodes) >= 2
    step = 1e-8
    by_energy, by_gradient = np.zeros_like(found), np.zeros_like(blocks)
    for row, node in enumerate(nodes):
        for axis in range(dim):
            there = [positions.copy() for _ in range(2)]
            there[0][node, axis] += step
            there[1][node, axis] -= step
            energies = [acting.energy(one, 1.0) for one in there]
            by_energy[node, axis] = (energies[0] - energies[1]) / (2 * step)
            gradients = [acting.gradient(one, 1.0)[node] for one in there]
            by_gradient[row, :, axis] = (gradients[0] - gradients[1]) / (2 * step)
    assert by_energy == pytest.approx(found, abs=1e-6 * np.abs(found).max())
    assert by_gradient == pytest.approx(blocks, abs=2e-5 * np.abs(blocks).max())
    assert blocks == pytest.approx(blocks.swapaxes(1, 2), abs=1e-12 * np.abs(blocks).max())


def test_stored_energy_is_without_friction(notched: Path) -> None:
    acting, positions = in_a_step(above(3, notched)["sphere"], body(3))
    assert 0 < acting.stored(positions, 1.0) < acting.energy(positions, 1.0)


def test_a_box_of_triangles_is_a_box() -> None:
    size = (0.02, 0.03, 0.04)
    block = ts.Block("box", size, (0, 0, 0))
    mesh = ts.box(size, (2, 3, 4), "tetrahedron")
    solid = Solid.of((mesh.nodes - np.array(size) / 2)[mesh.boundary[:, ::-1]])  # turned inside out
    places = np.random.default_rng(1).uniform(-0.03, 0.03, (300, 3))
    places[0] = (0.01, 0.004, 0.007)  # on a face, where the normal is that of the face
    gaps, normals = solid.gaps(places)
    expected, outward = block.gaps(places)
    assert gaps == pytest.approx(expected, abs=1e-12)
    outside = expected >= 0
    assert 100 < outside.sum() < 300
    assert normals[outside] == pytest.approx(outward[outside], abs=1e-9)
    assert solid.bends(places)[outside] == pytest.approx(block.bends(places)[outside], abs=1e-6)
    assert np.array(solid.bounds) == pytest.approx(np.array(block.bounds))
    assert solid.gaps(places[:0])[0].shape == (0,)


def test_a_notch_of_triangles_is_outside() -> None:
    mesh = angle(0.02)
    solid = Solid.of(mesh.nodes[triangles_of(mesh.boundary)])
    gaps, normals = solid.gaps(
        np.array([(0.002, 0, 0.003), (-0.003, 0.001, -0.004), (0.006, 0, -0.001), (0, 0.011, -0.001)])
    )
    assert gaps == pytest.approx([0.002, -0.005, -0.001, 0.001])
    assert normals == pytest.approx(np.array([(1, 0, 0), (0.6, 0, 0.8), (0, 0, 1), (0, 1, 0)]), abs=1e-12)


def test_a_flat_tip_is_outside_whatever_its_triangles() -> None:
    """A pyramid whose upper side is divided into six triangles, the lower one into one: equal weights would err."""
    upper = [(-1, 0.05, z) for z in np.linspace(-0.5, 0.5, 7)]
    ring = np.array([*upper, (-1, -0.05, 0.5), (-1, -0.05, -0.5)])
    after = np.roll(ring, -1, axis=0)
    sides = np.stack([np.zeros_like(ring), ring, after], axis=1)
    base = np.stack([np.broadcast_to(ring[0], (7, 3)), after[1:8], ring[1:8]], axis=1)
    solid = Solid.of(np.concatenate([sides, base]))
    place = np.array([0.03, -0.4, 0.0])
    gaps, normals = solid.gaps(np.array([place, (-0.9, 0.0, 0.1)]))
    assert gaps[0] == pytest.approx(np.linalg.norm(place))
    assert normals[0] == pytest.approx(place / np.linalg.norm(place))
    assert gaps[1] < 0


def test_a_surface_that_is_not_closed_is_no_tool(tmp_path: Path) -> None:
    cube = ts.box((1, 1, 1), (2, 2, 2))
    facets = cube.nodes[triangles_of(cube.boundary)]
    (tmp_path / "open.stl").write_bytes(stl_bytes(facets[1:]))
    with pytest.raises(MeshError, match=r"open.stl.*not closed.*3 edges"):
        ts.StlTool("tool", tmp_path / "open.stl", (0, 0, 0))
    turned = np.concatenate([facets[:1, ::-1], facets[1:]])
    (tmp_path / "turned.stl").write_bytes(stl_bytes(turned))
    with pytest.raises(MeshError, match="turned alike"):
        ts.StlTool("tool", tmp_path / "turned.stl", (0, 0, 0))
    with pytest.raises(MeshError, match=r"none.stl"):
        ts.StlTool("tool", tmp_path / "none.stl", (0, 0, 0))
    write_stl(cube, tmp_path / "cube.stl")
    with pytest.raises(MeshError, match="unit = 'mn'"):
        ts.StlTool("tool", tmp_path / "cube.stl", (0, 0, 0), "mn")
    with pytest.raises(ProblemError, match="needs a body in 3D"):
        problem(body(2), ts.StlTool("tool", tmp_path / "cube.stl", (0, 5)))


@pytest.mark.parametrize(
    ("mesh", "area"),
    [
        (ts.rectangle((0.06, 0.03), (4, 3)), 0.18 * 0.01),
        (ts.box((0.06, 0.03, 0.06), (4, 2, 4)), 2 * (2 * 0.06 * 0.03 + 0.06**2)),
        (ts.box((0.06, 0.03, 0.06), (4, 2, 4), "tetrahedron"), 2 * (2 * 0.06 * 0.03 + 0.06**2)),
    ],
)
def test_areas_are_those_of_the_surface(mesh: ts.Mesh, area: float) -> None:
    """A plane deep inside pushes each node with stiffness times area times depth."""
    ways = ((0, -1.0, *(0.0,) * (mesh.dim - 1)), (1, 1.0, *(0.0,) * (mesh.dim - 1)))
    tool = ts.HalfSpace("tool", (1, 0, 0)[: mesh.dim], ways, stiffness=7.0)
    bodies = [problem(mesh, tool).body]
    if mesh.element == "tetrahedron":
        bodies.append(bodies[0]._replace(second_order=SecondOrder(mesh)))
    for one in bodies:
        force = tool.acting_on(one, None, 1.0).touch(one.nodes, 1.0).force
        assert force[0] == pytest.approx(-7.0 * area * (1 - 0.03), rel=1e-12)
        assert not force[1:].any()


def uniaxial(mesh: ts.Mesh, tool: Tool) -> ts.Problem:
    """A block that only changes its height."""
    sides = [ts.Fixed(side, fix=[axis]) for side, axis in (("left", "x"), ("right", "x"), ("bottom", "y"))]
    if mesh.dim == 3:
        sides += [ts.Fixed("back", fix=["z"]), ts.Fixed("front", fix=["z"])]
    return problem(mesh, tool, supports=sides)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_plane_compresses_a_block_as_two_springs_in_series(dim: int) -> None:
    """The body of stiffness M / H per area, M the modulus of confined compression, and the contact k."""
    mesh, stiffness, way = body(dim), 3e6, 0.002
    tool = ts.HalfSpace(
        "plate", (0, -1, 0)[:dim], path(dim, (0, 0, 0.031), (1, 0, 0.03 - way)), stiffness=stiffness, on="top"
    )
    solution = ts.solve(uniaxial(mesh, tool), ts.Fem("linear"))
    assert solution.status == ts.Status.CONVERGED
    modulus = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))
    area = 0.06 * (0.01 if dim == 2 else 0.06)
    force = area * way / (0.03 / modulus + 1 / stiffness)
    state = solution.states[-1]
    assert solution.applied_force(state)[1] == pytest.approx(-force, rel=1e-9)
    touch = solution.problem.loading.interactions[0].touch(state.all_positions, 1.0)
    assert touch.force[1] == pytest.approx(force, rel=1e-9)
    assert touch.depth == pytest.approx(force / area / stiffness, rel=1e-9)
    assert touch.place[1] == pytest.approx(0.03 - way)
    first = solution.states[3]  # the plate does not touch yet
    assert not solution.applied_force(first).any()
    assert (first.iterations, first.residual) == (0, 0)
    assert solution.states[4].displacement[:, 1].min() < 0
    assert not any(state.snapped for state in solution.states)
    assert not [warning for warning in solution.warnings if "linear" not in warning]


@pytest.mark.parametrize("model", [ts.Fem("neo-hookean"), ts.Springs("gaussian")])
@pytest.mark.parametrize("dim", [2, 3])
def test_a_barrier_keeps_all_nodes_out(dim: int, model: ts.Fem | ts.Springs) -> None:
    mesh, way = body(dim), path(dim, (0, 0.03, 0.0405), (1, 0.03, 0.036))
    one = problem(mesh, ts.Sphere("ball", 0.01, way, contact="barrier"))
    solution = ts.solve(one, model, ts.Newton(4))
    assert solution.status == ts.Status.CONVERGED
    acting, width = one.loading.interactions[0], 1e-3 * mesh.diameter
    gaps = [
        np.linalg.norm(state.positions - acting.touch(state.positions, state.load_factor).place, axis=1).min() - 0.01
        for state in solution.states
    ]
    assert len(gaps) == 5
    assert all(0 < gap < width for gap in gaps[1:])
    assert all(acting.touch(state.positions, state.load_factor).depth == 0 for state in solution.states)


def rubbed(dim: int, drag: float, friction: float = 0.3) -> tuple[ts.Solution, Interaction]:
    """A block pressed by a plane in the first half of the way, then dragged along x."""
    rows = path(dim, (0, 0, 0.03), (0.5, 0, 0.029), (1, drag, 0.029))
    tool = ts.HalfSpace("plate", (0, -1, 0)[:dim], rows, friction=friction, on="top")
    one = problem(body(dim), tool)
    return ts.solve(one, ts.Fem("neo-hookean"), ts.Newton(8)), one.loading.interactions[0]


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.verification)])
def test_a_plate_that_slides_drags_with_the_coefficient_of_friction(dim: int) -> None:
    solution, _ = rubbed(dim, 0.02)
    assert solution.status == ts.Status.CONVERGED
    pressed, dragged = solution.at(0.5), solution.states[-1]
    assert pressed is not None
    assert abs(pressed.applied_force[0]) < 1e-6 * abs(pressed.applied_force[1])
    assert dragged.applied_force[0] / -dragged.applied_force[1] == pytest.approx(0.3, rel=1e-3)


@pytest.mark.verification
def test_friction_has_the_normal_forces_of_the_state_itself() -> None:
    """A ball that is pressed and drawn at once: the result does not depend on the number of steps."""
    rows = [[0, 0.03, 0.0405], [1, 0.034, 0.037]]
    one = problem(body(2), ts.Sphere("ball", 0.01, rows, friction=0.3))
    few, many = (ts.solve(one, ts.Fem("neo-hookean"), ts.Newton(steps)).states[-1] for steps in (4, 12))
    assert few.applied_force == pytest.approx(many.applied_force, rel=3e-3)
    assert few.applied_force[0] / -few.applied_force[1] > 0.29


def graded(n: int, ratio: float, length: float) -> ts.Mesh:
    """A cube of n x n x n bricks, each longer by a ratio than the one nearer to the edge x = z = 0 of the top."""
    unit = ts.box((1, 1, 1), (n, n, n))

    def along(share: Floats) -> Floats:
        return np.asarray(length * (ratio ** (n * share) - 1) / (ratio**n - 1))

    x, y, z = unit.nodes.T
    return ts.Mesh(np.stack([along(x), length - along(1 - y), along(z)], axis=1), unit.elements, "hexahedron")


def hertz(model: ts.Fem | ts.Springs, n: int, ratio: float) -> None:
    """A sphere pressed into a quarter of a block, four times as thick: 4/3 E/(1 - nu^2) sqrt(R) d^1.5."""
    radius, length, depths = 0.03, 0.12, np.array([0.0005, 0.001, 0.002])
    ways = [[share, 0, length + radius - depth, 0] for share, depth in zip((0.25, 0.5, 1), depths, strict=True)]
    ball = ts.Sphere("ball", radius, [[0, 0, length + radius, 0], *ways], on="top", stiffness=5e8)
    supports = [ts.Fixed("bottom"), ts.Fixed("left", fix=["x"]), ts.Fixed("back", fix=["z"])]
    one = problem(graded(n, ratio, length), ball, supports=supports)
    solution = ts.solve(one, model, ts.Newton(1))
    assert solution.status == ts.Status.CONVERGED
    states = [solution.at(share) for share in (0.25, 0.5, 1)]
    forces = 4 * np.array([-state.applied_force[1] for state in states if state is not None])
    expected = 4 / 3 * YOUNG / (1 - POISSON**2) * np.sqrt(radius) * depths**1.5
    assert forces / expected == pytest.approx(1, abs=0.08)
    assert np.polyfit(np.log(depths), np.log(forces), 1)[0] == pytest.approx(1.5, abs=0.06)
    acting = one.loading.interactions[0]
    for state, depth in zip(states, depths, strict=True):
        assert state is not None
        assert acting.touch(state.positions, state.load_factor).depth < 0.01 * depth


def test_a_sphere_on_springs_is_as_stiff_as_hertz_says() -> None:
    hertz(ts.Springs("gaussian"), 9, 1.35)


@pytest.mark.verification
@pytest.mark.parametrize("model", [ts.Fem("neo-hookean"), ts.Springs("gaussian")])
def test_a_sphere_is_as_stiff_as_hertz_says(model: ts.Fem | ts.Springs) -> None:
    hertz(model, 13, 1.28)


def test_the_error_of_a_reference_includes_friction() -> None:
    """A state with friction cannot be found at full load alone."""
    rows = [[0, 0, 0.03], [0.5, 0, 0.0295], [1, 0.01, 0.0295]]
    one = problem(ts.rectangle((0.06, 0.03), (4, 2)), ts.HalfSpace("plate", (0, -1), rows, friction=0.3, on="top"))
    found = ts.reference_error(one, ts.Fem("neo-hookean"), ts.Newton(4))
    assert found.limit is not None
    force = found.limit.states[-1].applied_force
    assert force[0] / -force[1] == pytest.approx(0.3, rel=1e-3)


def test_below_the_limit_a_plate_sticks() -> None:
    """The shear of a block under 0.2 % is below the friction of a pressure of 3 %."""
    drag = 6e-5
    solution, _ = rubbed(2, drag, friction=0.8)
    state, pressed = solution.states[-1], solution.at(0.5)
    assert pressed is not None
    assert 0 < state.applied_force[0] < 0.8 * -state.applied_force[1]
    top = solution.problem.mesh.nodes[:, 1] > 0.0299
    slip = drag - (state.displacement - pressed.displacement)[top, 0]
    creep = 1e-5 * solution.problem.mesh.diameter
    assert np.abs(slip).max() < 4 * creep  # of four steps
    assert np.median(np.abs(slip)) < 2 * creep


def test_second_order_elements_touch_like_first_order() -> None:
    """A first touch in the middle of the way is no snap-through."""
    forces = []
    for element in ("quadrilateral", "triangle"):
        one = problem(
            ts.rectangle((0.06, 0.03), (16, 8), element), replace(BALL, path=[[0, 0.03, 0.043], [1, 0.03, 0.037]])
        )
        solution = ts.solve(one, ts.Fem("neo-hookean"), ts.Newton(4))
        assert (solution.status, solution.warnings) == (ts.Status.CONVERGED, ())
        forces.append(solution.states[-1].applied_force[1])
    assert solution.element == "quadratic"
    assert forces[0] == pytest.approx(forces[1], rel=0.03)


def test_friction_of_a_node_at_a_state() -> None:
    """As an explicit scheme needs it: coefficient times normal force, and the tool's velocity in a motion of 2 s."""
    mesh = body(3)
    tool = ts.HalfSpace("plate", (0, -1, 0), [[0, 0, 0.03, 0], [1, 0, 0.029, 0], [2, 0.02, 0.029, 0]], friction=0.3)
    acting = tool.acting_on(problem(mesh, tool).body, YOUNG, 2.0)
    slide = acting.slide(mesh.nodes, 0.75)
    pushed = acting.gradient(mesh.nodes, 0.75)
    assert np.array_equal(slide.nodes, np.flatnonzero(mesh.nodes[:, 1] > 0.0299))
    assert slide.limit == pytest.approx(0.3 * np.linalg.norm(pushed[slide.nodes], axis=1))
    assert slide.normals == pytest.approx(np.tile((0, -1, 0), (len(slide.nodes), 1)))
    assert slide.velocity == pytest.approx((0.02, 0, 0))
    assert acting.slide(mesh.nodes, 0.25).velocity == pytest.approx((0, -0.001, 0))
    assert acting.corners == (0.5,)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_stiff_grasp_moves_its_patch_like_a_support(dim: int) -> None:
    mesh = body(dim)
    at = (0.06, 0.015, 0.03)[:dim]
    rows = [[0, *at], [1, at[0] + 0.004, at[1] + 0.003, *at[2:]]]
    grasp = ts.Grasp("forceps", at, 0.011, rows, stiffness=1e9)
    solution = ts.solve(problem(mesh, grasps=(grasp,)), ts.Fem("neo-hookean"))
    assert solution.status == ts.Status.CONVERGED
    patch = np.flatnonzero((np.linalg.norm(mesh.nodes - at, axis=1) <= 0.011) & (mesh.nodes[:, 0] > 0.0599))
    assert len(patch) >= 3
    motion = (0.004, 0.003, 0)[:dim]
    moved = problem(mesh, supports=[ts.Fixed("bottom"), ts.Fixed(patch, displacement=motion)])  # type: ignore[arg-type]
    expected = ts.solve(moved, ts.Fem("neo-hookean"))
    state = solution.states[-1]
    assert state.displacement == pytest.approx(expected.states[-1].displacement, abs=1e-7)
    force = solution.applied_force(state)
    assert force == pytest.approx(expected.applied_force(expected.states[-1]), abs=1e-4 * np.abs(force).max())
    assert force + state.reaction.sum(axis=0) == pytest.approx(0, abs=1e-8 * np.abs(force).max())
    touch = solution.problem.loading.interactions[0].touch(state.positions, 1.0)
    assert touch.force == pytest.approx(-force)
    assert not solution.applied_force(solution.states[0]).any()


def test_a_grasp_holds_a_body_without_supports() -> None:
    """Its springs bear the weight."""
    mesh, heavy = body(3), ts.Material(YOUNG, POISSON, 1000.0)
    grasp = ts.Grasp("forceps", (0.06, 0.015, 0.03), 0.015, [0.06, 0.015, 0.03], stiffness=1e3)
    gravity = ts.Gravity((0, -1, 0))
    solution = ts.solve(ts.Problem(mesh, heavy, loads=[gravity], grasps=[grasp]), ts.Fem("neo-hookean"))
    assert solution.status == ts.Status.CONVERGED
    weight = 1000 * 0.06 * 0.03 * 0.06
    force = solution.problem.loading.interactions[0].touch(solution.states[-1].positions, 1.0).force
    assert force == pytest.approx((0, -weight, 0), abs=1e-8 * weight)
    with pytest.raises(ProblemError, match="free to move"):
        ts.Problem(mesh, heavy, loads=[gravity], grasps=[replace(grasp, radius=1e-3)])


def test_the_springs_of_a_grasp_share_its_stiffness() -> None:
    """On a body at rest the force is stiffness times motion; by default E times the radius, or the thickness."""
    for dim, stiffness in ((2, YOUNG * 0.01), (3, YOUNG * 0.012)):
        at = (0.06, 0.015, 0.03)[:dim]
        grasp = ts.Grasp("forceps", at, 0.012, [[0, *at], [1, 0.061, *at[1:]]])
        one = problem(body(dim), grasps=(grasp,))
        touch = one.loading.interactions[0].touch(one.mesh.nodes, 1.0)
        assert touch.force[0] == pytest.approx(-stiffness * 0.001)
        assert touch.depth == pytest.approx(0.001)
        assert one.loading.interactions[0].largest_stiffness().sum() == pytest.approx(stiffness)


def test_processes_share_the_stiffness_of_a_contact() -> None:
    """Each adds the rows of its own nodes."""
    one, model = problem(body(2), BALL), ts.Fem("neo-hookean")
    summed = model.on_pieces(one)
    assert summed is not None
    owner = bisected(one.mesh.nodes, 3)
    pieces = [Piece(summed, one, Layout(Rank(rank, 3), owner)) for rank in range(3)]
    nodes, blocks = one.loading.interactions[0].blocks(one.mesh.nodes, 1.0)

    def tangent(potential: Any) -> Floats:
        return np.asarray(with_diagonal(potential.hessian(one.mesh.nodes), blocks, nodes).toarray())

    whole = tangent(model.potential(one))
    assert np.abs(whole).max() > 2 * np.abs(model.potential(one).hessian(one.mesh.nodes).toarray()).max()
    assert sum(map(tangent, pieces)) == pytest.approx(whole, abs=1e-12 * np.abs(whole).max())


@pytest.mark.parametrize("target", TARGETS)
def test_tools_are_not_exported(target: str, tmp_path: Path) -> None:
    with pytest.raises(ExportError, match="tools and grasps, such as 'ball'"):
        export(problem(body(2), BALL), ts.Springs("isotropic"), target, tmp_path)


def test_calculix_does_not_take_tools() -> None:
    with pytest.raises(ExportError, match="tools and grasps, such as 'ball'"):
        check_fem(problem(body(2), BALL), "neo-hookean")


def test_a_tool_on_node_numbers_acts_on_the_refined_mesh() -> None:
    mesh = ts.rectangle((0.06, 0.03), (4, 2))
    top = np.flatnonzero(mesh.nodes[:, 1] > 0.0299)
    finer = refined_problem(problem(mesh, replace(BALL, on=top)))  # type: ignore[arg-type]
    acting, expected = (one.loading.interactions[0] for one in (finer, replace(finer, tools=[replace(BALL, on="top")])))
    pushed = acting.gradient(finer.mesh.nodes, 1.0)
    assert pushed.any()
    assert np.array_equal(pushed, expected.gradient(finer.mesh.nodes, 1.0))


@pytest.mark.parametrize(
    ("tool", "words"),
    [
        (
            replace(BALL, path=[[0, 0.03, 0.0375], [1, 0.03, 0.037]]),
            ["ball", "inside the body by 0.0025 m", "(0.03, 0.04)"],
        ),
        (
            replace(BALL, path=[[0, 0.03, 0.04], [1, 0.03, 0.037]], contact="barrier"),
            ["ball", "barrier starts outside"],
        ),
        (replace(BALL, path=[[0, 0.03, 0.041], [0.8, 0.03, 0.037]]), ["ball", "path ends at 0.8", "[1, ...]"]),
        (replace(BALL, path=[[0.1, 0.03, 0.041], [1, 0.03, 0.037]]), ["path begins at 0.1", "[0, ...]"]),
        (replace(BALL, path=[[0, 0.03, 0.041], [0, 0.03, 0.037], [1, 0, 0]]), ["must ascend"]),
        (replace(BALL, path=[[0, 0.03, 0.041, 0], [1, 0.03, 0.037, 0]]), ["2 coordinates", "3 values, not 4"]),
        (replace(BALL, path=[0.03, 0.041, 0]), ["does not move", "2 values, not 3"]),
        (replace(BALL, path=[[0, 0.03, 0.041], [1, 0.03]]), ["rows of equal length"]),
        (replace(BALL, path="down"), ["rows of equal length"]),
        (replace(BALL, radius=-0.01), ["radius", "positive number"]),
        (replace(BALL, friction=-0.1), ["friction", "not negative"]),
        (replace(BALL, stiffness=0.0), ["stiffness", "positive number"]),
        (replace(BALL, width=float("nan")), ["width", "positive number"]),
        (replace(BALL, contact="barier"), ["contact", "did you mean 'barrier'"]),
        (replace(BALL, on="lft"), ["on", "left"]),
        (ts.HalfSpace("ball", (0, 0), [0, 1]), ["normal", "must not be zero"]),
        (ts.HalfSpace("ball", (0, -1, 0), [0, 1]), ["normal", "2 numbers"]),
        (ts.Block("ball", (0.01, 0), [0, 1]), ["size", "must be positive"]),
        (ts.Capsule("ball", 0.01, (0, 0), (0, 0), [0, 1]), ["end", "use a sphere"]),
        (ts.Grasp("ball", (0.07, 0.015), 0.005, [0.07, 0.015]), ["no node", "0.01 m away"]),
        (ts.Grasp("ball", (0.06, 0.015), 0.0, [0.07, 0.015]), ["radius", "positive number"]),
    ],
)
def test_wrong_tools_are_errors_with_the_way_out(tool: Tool | ts.Grasp, words: list[str]) -> None:
    grasps = (tool,) if isinstance(tool, ts.Grasp) else ()
    with pytest.raises(ProblemError) as error:
        problem(body(2), *(() if grasps else (tool,)), grasps=grasps)  # type: ignore[arg-type]
    assert str(error.value).startswith("'ball'")
    for word in words:
        assert word in str(error.value)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_small_tool_between_the_nodes_starts_inside(dim: int, tmp_path: Path) -> None:
    place = (0.0325, 0.013, 0.034)[:dim]
    tools: list[Tool] = [
        ts.Sphere("ball", 1e-4, place),
        ts.Capsule("ball", 1e-4, (0, 0, 0)[:dim], (1e-4, 0, 0)[:dim], place),
        ts.Block("ball", (1e-4,) * dim, place),
    ]
    if dim == 3:
        tools.append(ts.StlTool("ball", write_stl(angle(1e-4), tmp_path / "tool.stl"), place))
    for tool in tools:
        with pytest.raises(ProblemError, match="'ball': path: starts inside the body, between its nodes"):
            problem(body(dim), tool)
        problem(body(dim), replace(tool, path=(0.0325, 0.0302, 0.034)[:dim]))  # type: ignore[call-arg]


@pytest.mark.parametrize("element", ["hexahedron", "tetrahedron", "wedge", "pyramid"])
def test_places_within_a_body(element: str) -> None:
    mesh = ts.box((0.06, 0.03, 0.06), (2, 1, 2), element)
    places = np.random.default_rng(4).uniform(-0.01, 0.07, (200, 3))
    expected = ((places > 0) & (places < (0.06, 0.03, 0.06))).all(axis=1)
    assert 20 < expected.sum() < 180
    assert np.array_equal(within(mesh, places), expected)


def test_two_tools_of_one_name_are_an_error() -> None:
    with pytest.raises(ProblemError, match="'ball': name"):
        problem(body(2), BALL, BALL)


def test_a_network_without_elements_has_no_surface() -> None:
    network = ts.SpringNetwork([[0, 0], [0.01, 0], [0, 0.01]], [[0, 1], [1, 2], [0, 2]], [1.0, 1.0, 1.0])
    supports = [ts.Fixed([0, 1])]
    with pytest.raises(ProblemError, match="network of springs without elements"):
        ts.Problem(network.mesh, supports=supports, tools=[replace(BALL, stiffness=1e6)])
    with pytest.raises(ProblemError, match=r"stiffness: is required.*\[Pa/m\]"):
        ts.Problem(network.mesh, supports=supports, tools=[BALL])
    rows = [[0, 0, 0.01], [1, 0, 0.011]]
    one = ts.Problem(network.mesh, supports=supports, grasps=[ts.Grasp("g", (0, 0.01), 0.001, rows, 5.0)])
    state = ts.solve(one, network).states[-1]
    assert state.applied_force == pytest.approx(-state.reaction.sum(axis=0), abs=1e-12)
    assert state.applied_force[1] == pytest.approx(5.0 * (0.001 - state.displacement[2, 1]))


STUDY = """
[mesh]
shape = "rectangle"
size = ["60 mm", "30 mm"]
elements = [12, 6]

[material]
young = "10 kPa"
poisson = 0.3

[section]
kind = "plane-strain"
thickness = "10 mm"

[[support]]
on = "bottom"

[[tool]]
name = "probe"
shape = "sphere"
radius = "10 mm"
path = [[0, "30 mm", "41 mm"], [1, "30 mm", "37 mm"]]
friction = 0.3
stiffness = "2 N/mm^3"
on = "top"

[[tool]]
shape = "capsule"
radius = "2 mm"
start = ["0 mm", "0 mm"]
end = ["5 mm", "0 mm"]
path = ["0 mm", "50 mm"]

[[grasp]]
at = ["60 mm", "15 mm"]
radius = "6 mm"
path = "pull.csv"

[models.fem]
kind = "fem"
law = "neo-hookean"
"""


def written(folder: Path, text: str = STUDY) -> Path:
    (folder / "pull.csv").write_text("t,x [mm],y [mm]\n0,60,15\n1,63,15\n", encoding="utf-8")
    (folder / "study.toml").write_text(text, encoding="utf-8")
    return folder / "study.toml"


def test_a_study_states_tools_and_grasps(tmp_path: Path) -> None:
    one = read_study(written(tmp_path)).problem
    assert one.tools[0].stiffness == pytest.approx(2e9)
    assert replace(one.tools[0], stiffness=2e9) == ts.Sphere(
        "probe", 0.01, [[0, 0.03, 0.041], [1, 0.03, 0.037]], friction=0.3, stiffness=2e9, on="top"
    )
    assert one.tools[1] == ts.Capsule("tool 2", 0.002, [0, 0], [0.005, 0], [0, 0.05])
    assert one.grasps == (ts.Grasp("grasp 1", [0.06, 0.015], 0.006, [[0, 0.06, 0.015], [1, 0.063, 0.015]]),)
    found = plan(read_study(tmp_path / "study.toml"))
    assert found["tools"] == [
        "'probe': sphere of radius 0.01 m, friction 0.3, from (0.03, 0.041) m to (0.03, 0.037) m",
        "'tool 2': capsule of radius 0.002 m from (0, 0) to (0.005, 0) m, at (0, 0.05) m",
        "'grasp 1': grasp within 0.006 m of (0.06, 0.015) m, from (0.06, 0.015) m to (0.063, 0.015) m",
    ]
    assert found["total_force"] == [0, 0]


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ('shape = "sphere"', 'shape = "spher"', ["tool.1.shape", "did you mean 'sphere'"]),
        ('radius = "10 mm"\n', "", ["tool.1", "radius is required and missing for a sphere"]),
        ('radius = "2 mm"', 'radius = "2 mm"\nsize = [1, 1]', ["tool.2", "size is no key of a capsule"]),
        ('"30 mm", "41 mm"]', '"30 mm", "36 mm"]', ["study.toml:22: tool.1.path", "inside the body by 0.004 m"]),
        ("[1, ", "[0.9, ", ["tool.1.path", "ends at 0.9"]),
        ('path = ["0 mm", "50 mm"]', 'path = ["0 mm", ["50 mm"]]', ["tool.2.path"]),
        ('path = ["0 mm", "50 mm"]', "path = []", ["tool.2.path", "not a path"]),
        ('"pull.csv"', '"push.csv"', ["grasp.1.path", "push.csv"]),
        ("friction = 0.3", "friction = -0.3", ["study.toml:23: tool.1.friction"]),
        ('on = "top"', 'on = "tp"', ["tool.1.on", "top"]),
        ('at = ["60 mm"', 'at = ["80 mm"', ["grasp.1.at", "0.02 m away"]),
        ("[[grasp]]", '[[grasp]]\nname = "probe"', ["name of two tools"]),
        ('shape = "sphere"\nradius = "10 mm"', 'shape = "stl"\nfile = "no.stl"', ["tool.1.file", "no.stl"]),
    ],
)
def test_a_wrong_key_is_an_error_with_its_line(tmp_path: Path, before: str, after: str, words: list[str]) -> None:
    assert before in STUDY
    with pytest.raises(StudyError) as error:
        read_study(written(tmp_path, STUDY.replace(before, after, 1)))
    for word in words:
        assert word in str(error.value)
