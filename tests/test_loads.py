"""Loads: their resultants, their potentials, and closed forms."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import truespring as ts
from tests.closed_forms import pressed_pipe
from truespring.arrays import Bools, Floats
from truespring.conditions import Refined
from truespring.errors import TruespringError
from truespring.loading.moment import _route_to
from truespring.potential import Potential

SOFT = ts.Material(10e3, 0.3, density=1100.0)


def strip(**more: object) -> ts.Problem:
    values = {"supports": ts.Fixed("left"), "loads": ts.Force("right", (0.0, -0.01)), **more}
    return ts.Problem(ts.rectangle((0.16, 0.04), (8, 2)), SOFT, ts.PlaneStress(0.01), **values)  # type: ignore[arg-type]


def cube(**more: object) -> ts.Problem:
    values = {"supports": ts.Fixed("left"), "loads": ts.Force("right", (0.0, -0.01, 0.0)), **more}
    return ts.Problem(ts.box((0.1, 0.1, 0.1), (3, 3, 3)), SOFT, **values)  # type: ignore[arg-type]


def shaken(mesh: ts.Mesh) -> ts.Mesh:
    """Inner nodes moved at random: elements of many forms, the body's outline as it was."""
    inner = np.ones(mesh.n_nodes, dtype=bool)
    inner[mesh.boundary] = False
    size = (mesh.measures.mean()) ** (1 / mesh.dim)
    noise = np.random.default_rng(4).uniform(-0.15, 0.15, mesh.nodes.shape) * size
    return ts.Mesh(mesh.nodes + inner[:, None] * noise, mesh.elements, mesh.element)


BODIES = {
    "squares": ts.rectangle((4.0, 3.0), (4, 3)),
    "triangles": ts.rectangle((4.0, 3.0), (4, 3), "triangle", "alternating"),
    "cubes": ts.box((3.0, 2.0, 4.0), (3, 3, 3)),
    "tetrahedra": ts.box((3.0, 2.0, 4.0), (3, 3, 3), "tetrahedron"),
}


def loaded(name: str, load: object) -> ts.Problem:
    mesh = shaken(BODIES[name])
    section = ts.PlaneStress(0.5) if mesh.dim == 2 else None
    return ts.Problem(mesh, ts.Material(1e4, 0.25, density=2.0), section, ts.Fixed("left"), load)  # type: ignore[arg-type]


# --- dead loads ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BODIES)
def test_weight_has_its_total_and_its_centre(name: str) -> None:
    problem = loaded(name, ts.Gravity((0.3, -9.81, 0.2)[: BODIES[name].dim]))
    mesh, force = problem.mesh, problem.loading.external_force
    volume = float(np.prod(mesh.upper - mesh.lower)) * problem.body.thickness
    total = 2.0 * volume * np.array((0.3, -9.81, 0.2)[: mesh.dim])
    assert force.sum(axis=0) == pytest.approx(total, rel=1e-12)
    centre = (mesh.lower + mesh.upper) / 2
    assert mesh.nodes.T @ force == pytest.approx(np.outer(centre, total), rel=1e-12)


@pytest.mark.parametrize("name", BODIES)
def test_traction_has_its_total_and_its_centre(name: str) -> None:
    problem = loaded(name, ts.Traction("right", (5.0, -2.0, 1.0)[: BODIES[name].dim]))
    mesh, force = problem.mesh, problem.loading.external_force
    size = mesh.upper - mesh.lower
    total = float(np.prod(size[1:])) * problem.body.thickness * np.array((5.0, -2.0, 1.0)[: mesh.dim])
    assert force.sum(axis=0) == pytest.approx(total, rel=1e-12)
    centre = (mesh.lower + mesh.upper) / 2
    centre[0] = mesh.upper[0]
    assert mesh.nodes.T @ force == pytest.approx(np.outer(centre, total), rel=1e-12)


def test_regions_weigh_by_their_own_density() -> None:
    heavy = ts.Region(ts.Box((0.08, 0.0), (0.16, 0.04)), ts.Material(1e4, 0.3, density=3300.0))
    force = strip(loads=ts.Gravity((0.0, -10.0)), regions=heavy).loading.external_force
    assert force[:, 1].sum() == pytest.approx(-10.0 * 0.16 * 0.04 * 0.01 * (1100 + 3300) / 2, rel=1e-12)


@pytest.mark.parametrize("n", [1, 4])
def test_a_bar_hangs_by_its_own_weight(n: int) -> None:
    """u = rho g L^2 / (2 E) at its end, exact at the nodes of linear elements without sideways strain."""
    problem = ts.Problem(
        ts.rectangle((0.2, 0.05), (n, 1)),
        ts.Material(1e5, 0.0, density=1000.0),
        ts.PlaneStress(0.01),
        ts.Fixed("left"),
        ts.Gravity((9.81, 0.0)),
    )
    end = ts.solve(problem, ts.Fem("linear"), ts.Newton(load_steps=1)).states[-1].displacement[-1]
    assert end == pytest.approx([1000 * 9.81 * 0.2**2 / (2 * 1e5), 0.0], rel=1e-10, abs=1e-15)


def test_quadratic_elements_take_the_same_weight() -> None:
    mesh = ts.box((1.0, 1.0, 1.0), (2, 2, 2), "tetrahedron")
    problem = ts.Problem(mesh, ts.Material(1e4, 0.45, density=10.0), None, ts.Fixed("left"), ts.Gravity((0, -9.81, 0)))
    path = ts.solve(problem, ts.Fem("linear", element="quadratic"), ts.Newton(load_steps=1))
    assert path.states[-1].applied_force == pytest.approx([0, -98.1, 0], rel=1e-12)
    assert path.states[-1].reaction.sum(axis=0) == pytest.approx([0, 98.1, 0], rel=1e-9, abs=1e-8)


# --- loads that follow -----------------------------------------------------------------------------------

FOLLOWING: dict[str, Callable[[], ts.Problem]] = {
    "pressure on an edge": lambda: strip(
        supports=[ts.Fixed("left"), ts.Fixed("right")], loads=ts.Pressure("top", 300.0)
    ),
    "pressure all around": lambda: strip(
        supports=[ts.Fixed("middle"), ts.Fixed("right-middle", ["y"])],
        loads=ts.Pressure(ts.Box((0.0, 0.0), (0.16, 0.04)), 300.0),
    ),
    "pressure between planes of symmetry": lambda: strip(
        supports=[ts.Fixed("left", ["x"]), ts.Fixed("right", ["x"]), ts.Fixed("bottom", ["y"])],
        loads=ts.Pressure("top", 300.0),
    ),
    "pressure in space": lambda: cube(
        supports=[ts.Fixed("left"), *(ts.Fixed(side, ["z"]) for side in ("back", "front")), ts.Fixed("right", ["x"])],
        loads=ts.Pressure("top", 200.0),
    ),
    "pressure on tetrahedra": lambda: ts.Problem(
        ts.box((0.1, 0.1, 0.1), (3, 3, 3), "tetrahedron"),
        SOFT,
        supports=[ts.Fixed("left"), ts.Fixed("right"), ts.Fixed("back"), ts.Fixed("front")],
        loads=ts.Pressure("top", 200.0),
    ),
    "moment": lambda: strip(loads=ts.Moment("right", 0.002)),
}
# On elements of second order, of straight and of curved edges.
FOLLOWING |= {
    "pressure on an edge, second order": lambda: triangles(
        supports=[ts.Fixed("left"), ts.Fixed("right")], loads=ts.Pressure("top", 300.0)
    ),
    "pressure all around, second order": lambda: triangles(
        supports=[ts.Fixed("middle"), ts.Fixed("right-middle", ["y"])],
        loads=ts.Pressure(ts.Box((0.0, 0.0), (0.16, 0.04)), 300.0),
    ),
    "pressure on tetrahedra, second order": FOLLOWING["pressure on tetrahedra"],
    "pressure on curved triangles, second order": lambda: bulged(FOLLOWING["pressure on an edge, second order"]()),
    "pressure on curved tetrahedra, second order": lambda: bulged(FOLLOWING["pressure on tetrahedra"]()),
    "moment, second order": lambda: triangles(loads=ts.Moment("right", 0.002)),
}


def triangles(**more: object) -> ts.Problem:
    return replace(strip(**more), mesh=ts.rectangle((0.16, 0.04), (8, 2), "triangle", "alternating"))


def bulged(problem: ts.Problem) -> ts.Problem:
    """The edges curved, but for those on planes that are held."""
    mesh = problem.mesh
    middles = mesh.nodes[mesh.edges].mean(axis=1)
    inside = (middles - mesh.lower) * (mesh.upper - middles) / (mesh.upper - mesh.lower) ** 2
    across = [axis for axis in range(mesh.dim) if axis != 1]
    middles[:, 1] += 0.2 * mesh.upper[1] * np.prod(inside[:, across], axis=1)
    return replace(problem, mesh=replace(mesh, middles=middles))


def following(name: str) -> tuple[ts.Problem, Potential, Floats, Bools]:
    """A problem, its load as a potential, a state far from rest, nodes that are held at rest, and what is free."""
    problem = FOLLOWING[name]()
    loading, nodes = problem.loading, problem.mesh.nodes
    if "second order" in name:
        potential = ts.Fem("linear", "quadratic").potential(problem)
        assert isinstance(potential, Refined)
        loading, nodes = potential.loading, potential.nodes
    (load,) = loading.following
    noise = np.random.default_rng(8).uniform(-0.03, 0.03, nodes.shape) * problem.mesh.diameter
    return problem, load, nodes + np.where(loading.held, 0.0, noise), ~loading.held


@pytest.mark.parametrize("name", FOLLOWING)
def test_forces_are_the_slope_of_the_work(name: str) -> None:
    problem, load, x, free = following(name)
    way = np.where(free, np.random.default_rng(9).normal(size=x.shape), 0.0)
    slope = float((load.gradient(x) * way).sum())
    assert abs(slope) > 1e-9
    errors = []
    for step in (1e-3, 5e-4):
        step *= problem.mesh.diameter / np.linalg.norm(way)
        rise = (load.energy(x + step * way) - load.energy(x - step * way)) / (2 * step)
        errors.append(abs(rise - slope) / abs(slope))
    assert errors[1] < 1e-6 and (errors[1] < 0.3 * errors[0] or errors[0] < 1e-9)


@pytest.mark.parametrize("name", FOLLOWING)
def test_the_tangent_is_the_slope_of_the_forces(name: str) -> None:
    problem, load, x, free = following(name)
    way = np.where(free, np.random.default_rng(9).normal(size=x.shape), 0.0)
    image = np.where(free, (load.hessian(x) @ way.ravel()).reshape(x.shape), 0.0)
    assert np.linalg.norm(image) > 0
    step = 1e-5 * problem.mesh.diameter / np.linalg.norm(way)
    slope = np.where(free, load.gradient(x + step * way) - load.gradient(x - step * way), 0.0) / (2 * step)
    assert np.linalg.norm(slope - image) < 1e-7 * np.linalg.norm(image)


@pytest.mark.parametrize("name", [name for name in FOLLOWING if "moment" not in name])
def test_pressure_has_its_total(name: str) -> None:
    """The normal of a surface that spans between planes integrates to its projection."""
    problem, load, _x, _free = following(name)
    force = -load.gradient(load.nodes).sum(axis=0)
    mesh, (given,) = problem.mesh, problem.loads
    assert isinstance(given, ts.Pressure)
    area = np.prod((mesh.upper - mesh.lower)[[axis for axis in range(mesh.dim) if axis != 1]]) * problem.body.thickness
    expected = np.zeros(mesh.dim)
    expected[1] = 0.0 if "around" in name else -given.pressure * float(area)
    assert force == pytest.approx(expected, abs=1e-12 * given.pressure * float(area))


@pytest.mark.parametrize("name", [name for name in FOLLOWING if "around" in name])
def test_pressure_on_a_closed_surface_leaves_no_force_whatever_its_form(name: str) -> None:
    _, load, x, _ = following(name)
    assert load.gradient(x).sum(axis=0) == pytest.approx([0, 0], abs=1e-12)


@pytest.mark.parametrize("name", [name for name in FOLLOWING if "moment" in name])
def test_a_moment_is_a_moment_at_every_state(name: str) -> None:
    _, load, x, _ = following(name)
    force = -load.gradient(x)
    assert force.sum(axis=0) == pytest.approx([0, 0], abs=1e-15)
    assert float((x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]).sum()) == pytest.approx(0.002, rel=1e-12)


@pytest.mark.parametrize("name", [name for name in FOLLOWING if "pressure" in name])
def test_pressure_gives_back_on_a_loop_what_it_took(name: str) -> None:
    """Along a closed way its work is none, each stretch of it by Gauss points; half of the way is some."""
    problem, load, x, free = following(name)
    ways = [np.where(free, np.random.default_rng(seed).normal(size=x.shape), 0.0) for seed in (1, 2)]
    size = 0.02 * problem.mesh.diameter / np.abs(ways).max()
    corners = [x, x + size * ways[0], x + size * ways[1], x]
    works = []
    for start, end in pairwise(corners):
        at, weights = np.polynomial.legendre.leggauss(3)
        parts = [load.gradient((start + end + one * (end - start)) / 2) * (end - start) / 2 for one in at]
        works.append(sum(weight * part.sum() for weight, part in zip(weights, parts, strict=True)))
    assert abs(sum(works)) < 1e-12 * max(map(abs, works)) and max(map(abs, works)) > 0


@pytest.mark.parametrize("angle", [-10.0, -3.5, 0.4, 3.3, 6.5, 9.0])
def test_rotation_of_a_face_counts_whole_turns(angle: float) -> None:
    """A strip rolled up to this angle at its end, held at the other."""
    problem = ts.Problem(
        ts.rectangle((4.0, 0.1), (80, 2)), SOFT, ts.PlaneStress(1.0), ts.Fixed("left"), ts.Moment("right", 1.0)
    )
    (load,) = problem.loading.following
    radius = 4.0 / angle
    turn = problem.mesh.nodes[:, 0] / radius
    y = problem.mesh.nodes[:, 1] - 0.05
    rolled = np.stack([(radius - y) * np.sin(turn), radius - (radius - y) * np.cos(turn)], axis=1)
    assert -load.energy(rolled) == pytest.approx(angle, rel=1e-12)


def test_whole_turns_are_counted_by_all_edges_along_a_way_from_what_is_held() -> None:
    for name in ("triangles", "cubes"):
        mesh = BODIES[name]
        held = np.repeat(mesh.nodes[:, :1] == 0.0, mesh.dim, axis=1)
        face = np.flatnonzero(mesh.nodes[:, 0] == mesh.upper[0])
        route = _route_to(mesh, face, held)
        nodes = [int(edges[0, 0]) for edges in route.pairs]
        assert held[nodes[0]].all() and nodes[-1] in face and len(set(nodes)) == len(nodes) > 3
        beside = {frozenset(edge) for edge in mesh.edges.tolist()}
        assert all(frozenset(pair) in beside for pair in pairwise(nodes))
        for node, edges in zip(nodes, route.pairs, strict=True):
            assert {frozenset(edge) for edge in edges.tolist()} == {edge for edge in beside if node in edge}
            assert (edges[:, 0] == node).all()


# --- a pipe under pressure ---------------------------------------------------------------------------------


def pipe(n: int, inner: float = 1.0, outer: float = 2.0, **more: object) -> ts.Problem:
    """A quarter of a pipe, cut along two planes of symmetry."""
    flat = ts.rectangle((1.0, 1.0), (n, 2 * n))
    radius, angle = inner + (outer - inner) * flat.nodes[:, 0], flat.nodes[:, 1] * math.pi / 2
    places = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    bottom, left = np.flatnonzero(flat.nodes[:, 1] == 0), np.flatnonzero(flat.nodes[:, 1] == 1)
    places[left, 0] = 0.0
    inside = np.flatnonzero(flat.nodes[:, 0] == 0)
    values = {"loads": ts.Pressure(inside, 1.0), **more}  # type: ignore[arg-type]
    return ts.Problem(
        ts.Mesh(places, flat.elements, flat.element),
        ts.Material(1000.0, 0.3),
        ts.PlaneStrain(1.0),
        [ts.Fixed(bottom, ["y"]), ts.Fixed(left, ["x"])],  # type: ignore[arg-type]
        **values,  # type: ignore[arg-type]
    )


def test_a_soft_pipe_stores_what_its_equation_along_the_radius_says() -> None:
    """Neo-Hookean, widened by half: the one equation that is left, integrated, to the second order of the elements."""
    radius, energy = pressed_pipe(150.0, 1000.0, 0.3, 1.0, 2.0)
    errors = []
    for n in (4, 8):
        problem = pipe(n, loads=ts.Pressure(pipe(n).loads[0].on, 150.0))  # type: ignore[union-attr]
        state = ts.solve(problem, ts.Fem("neo-hookean"), ts.Newton(load_steps=5)).states[-1]
        errors.append(abs(4 * state.energy / energy - 1))
        assert state.positions[0, 0] == pytest.approx(radius, rel=0.25 / n**2)
    assert errors[1] < 0.007 and errors[0] / errors[1] == pytest.approx(4, rel=0.05)


def test_a_pipe_widens_as_lame_says() -> None:
    """u(a) = p a (1 + nu) / (E (b^2 - a^2)) ((1 - 2 nu) a^2 + b^2), to the second order of the elements' size."""
    exact = 1.3 / (1000 * 3) * (0.4 + 4)
    errors = []
    for n in (4, 8, 16):
        problem = pipe(n)
        state = ts.solve(problem, ts.Fem("linear"), ts.Newton(load_steps=1)).states[-1]
        errors.append(abs(state.displacement[0, 0] / exact - 1))
    assert errors[2] < 1.5e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.15) and errors[1] / errors[2] == pytest.approx(4, rel=0.15)


def test_a_pipe_under_large_pressure_balances_its_energy() -> None:
    """What the pressure does on the volume that it opens is what the pipe stores."""
    problem = pipe(4, loads=ts.Pressure(pipe(4).loads[0].on, 150.0))  # type: ignore[union-attr]
    path = ts.solve(problem, ts.Fem("neo-hookean"), ts.Newton(load_steps=40))
    assert path.status is ts.Status.CONVERGED
    (load,) = problem.loading.following
    swept = [-load.energy(state.positions) / 150.0 for state in path.states]
    work = np.trapezoid(150.0 * path.load_factors, swept)
    assert path.states[-1].displacement[0, 0] > 0.2
    assert work == pytest.approx(path.states[-1].energy, rel=1e-3)


@pytest.mark.parametrize("linear", ["direct", "multigrid"])
def test_springs_bear_pressure_by_every_solver(linear: str) -> None:
    problem = strip(supports=[ts.Fixed("left"), ts.Fixed("right")], loads=ts.Pressure("top", 400.0))
    path = ts.solve(problem, ts.Springs("isotropic"), ts.Newton(load_steps=2, linear=linear))
    state = path.states[-1]
    assert path.status is ts.Status.CONVERGED
    assert (state.reaction.sum(axis=0) + state.applied_force) == pytest.approx([0, 0], abs=1e-9)
    assert state.applied_force[1] == pytest.approx(-400 * 0.16 * 0.01, rel=1e-9)  # its chord is held


# --- prescribed rotation ------------------------------------------------------------------------------------


def test_a_body_turned_at_both_ends_is_not_strained() -> None:
    turn = {"rotation": 2.0, "about": (0.0, 0.0)}
    problem = strip(supports=[ts.Fixed("left", **turn), ts.Fixed("right", **turn)], loads=())  # type: ignore[arg-type]
    for model in (ts.Springs("lloyd"), ts.Fem("neo-hookean")):
        path = ts.solve(problem, model, ts.Newton(load_steps=8))
        assert path.status is ts.Status.CONVERGED
        x, y = problem.mesh.nodes.T
        turned = np.stack([math.cos(2) * x - math.sin(2) * y, math.sin(2) * x + math.cos(2) * y], axis=1)
        assert path.states[-1].positions == pytest.approx(turned, abs=1e-9)
        assert path.states[-1].energy < 1e-12


def test_a_twisted_bar_bears_a_moment() -> None:
    """Reactions at both ends are equal and opposite moments, near G J theta / L of a square, J = 0.1406 a^4."""
    mesh = ts.box((0.4, 0.1, 0.1), (16, 8, 8))
    problem = ts.Problem(
        mesh, ts.Material(1e4, 0.25), None, [ts.Fixed("left"), ts.Fixed("right", rotation=0.02, axis=(1, 0, 0))], ()
    )
    state = ts.solve(problem, ts.Fem("linear"), ts.Newton(load_steps=1)).states[-1]
    moment = []
    for side in (0.0, 0.4):
        nodes = np.flatnonzero(np.isclose(mesh.nodes[:, 0], side))
        arms = mesh.nodes[nodes] - np.array([side, 0.05, 0.05])
        moment.append(np.cross(arms, state.reaction[nodes]).sum(axis=0))
    assert moment[0] == pytest.approx(-moment[1], abs=1e-3 * abs(moment[1][0]))
    free = 4000 * 0.1406 * 0.1**4 * 0.02 / 0.4
    assert free < moment[1][0] < 1.15 * free  # ends that cannot warp, and elements, are stiffer


@pytest.mark.parametrize("order", ["linear", "quadratic"])
def test_two_supports_that_turn_a_node_alike_turn_it_once(order: str) -> None:
    """The nodes on the left, at the top at once by both supports, and the midpoints of edges between them."""
    turn = {"rotation": 0.1, "about": (0.01, 0.0)}
    moved = ts.Fixed([0, 9], displacement=(0.0, 0.0), **turn)  # type: ignore[arg-type]
    problem = strip(supports=[ts.Fixed("left", **turn), moved], loads=())  # type: ignore[arg-type]
    problem = replace(problem, mesh=ts.rectangle((0.16, 0.04), (8, 2), "triangle", "alternating"))
    path = ts.solve(problem, ts.Fem("neo-hookean", order), ts.Newton(1))
    known = path.whole.points
    arms = known - (0.01, 0.0)
    turned = arms @ np.array([[math.cos(0.1), math.sin(0.1)], [-math.sin(0.1), math.cos(0.1)]]) + (0.01, 0.0)
    assert path.states[-1].all_positions == pytest.approx(turned, abs=1e-9)


def test_a_region_that_turns_starts_from_its_motion() -> None:
    """Held nodes are where they should be at each level, by every way to the balance."""
    problem = strip(supports=[ts.Fixed("left"), ts.Fixed("right", rotation=1.0, displacement=(-0.03, 0.02))], loads=())
    (turn,) = problem.loading.turns
    for method in ("mixed", "line-search"):
        path = ts.solve(problem, ts.Springs("isotropic"), ts.Newton(load_steps=5, method=method))
        assert path.complete
        for state in path.states:
            moved = turn.motion(state.load_factor) + state.load_factor * np.array([-0.03, 0.02])
            assert state.displacement[turn.nodes] == pytest.approx(moved, abs=1e-14)


# --- what is refused ------------------------------------------------------------------------------------------

WRONG: dict[str, tuple[Callable[[], ts.Problem], str]] = {
    "moment in space": (lambda: cube(loads=ts.Moment("right", 1.0)), "moment in 3D .*rotation and axis"),
    "moment on a node": (lambda: strip(loads=ts.Moment("right-middle", 1.0)), "moment .*two nodes"),
    "pressure on a point": (lambda: strip(loads=ts.Pressure("right-middle", 1.0)), "no complete facet"),
    "no density": (
        lambda: ts.Problem(
            ts.rectangle((1, 1), (1, 1)), ts.Material(1, 0.3), ts.PlaneStress(1), ts.Fixed("left"), ts.Gravity((0, -1))
        ),
        "gravity needs .*density",
    ),
    "gravity in another dimension": (
        lambda: strip(loads=ts.Gravity((0, 0, -9.81))),
        "gravity .*3 values.* 2 directions",
    ),
    "pressure of no number": (
        lambda: strip(loads=ts.Pressure("top", math.nan)),
        "pressure = nan: .*finite",
    ),
    "turn of a roller": (
        lambda: strip(supports=[ts.Fixed("left"), ts.Fixed("right", fix=["x"], rotation=1.0)]),
        "rotation = 1 rad .*fix = .'x'",
    ),
    "turn without an axis": (lambda: cube(supports=ts.Fixed("left", rotation=1.0)), "rotation .*axis in 3D"),
    "axis in the plane": (lambda: strip(supports=ts.Fixed("left", rotation=1.0, axis=(0, 0, 1))), "plane.*axis"),
    "centre without a turn": (lambda: strip(supports=ts.Fixed("left", about=(0.0, 0.0))), "about .*without a rotation"),
    "two motions": (
        lambda: strip(supports=[ts.Fixed("left", rotation=1.0), ts.Fixed("left-top")]),
        "two supports move node .* along",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_has_no_sense_is_refused(name: str) -> None:
    build, message = WRONG[name]
    with pytest.raises(TruespringError, match=message):
        build()
