"""Cuts of live bodies: what remains, that it moves on as before, and that a log of commands repeats it."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import truespring as ts
from truespring.errors import LiveError, ModelError
from truespring.live import Live
from truespring.live.blade import Blade
from truespring.live.commands import Command
from truespring.live.loop import Loop
from truespring.live.orders import Order
from truespring.live.remaining import remaining
from truespring.live.session import replayed
from truespring.mesh import remainder
from truespring.problem import Problem

from .meshes import plane_of_two, solid_of_four

G = 9.81
SOFT = ts.Material(young=3000.0, poisson=0.3, density=1000.0)


def bar(counts: tuple[int, int, int] = (7, 2, 2), edge: float = 0.01, **changes: object) -> Problem:
    """A bar that hangs from its left end, its weight along -z; 7 elements in a row: one layer is in the middle."""
    dynamics = ts.Dynamics(1.0, start="rest")
    known = {
        "mesh": ts.box([n * edge for n in counts], counts),
        "material": SOFT,
        "supports": ts.Fixed(on="left"),
        "loads": ts.Gravity((0.0, 0.0, -G)),
        "dynamics": dynamics,
    }
    return Problem(**(known | changes))


def across(x: float, size: float = 0.1) -> tuple[tuple[float, ...], ...]:
    """A blade through all of a bar at a place x: along y, its depth down z."""
    return (x, -size, size), (x, size, size), (0.0, 0.0, -2 * size)


def gaussian() -> ts.Springs:
    return ts.Springs(rule="gaussian")


def test_the_free_part_falls_as_a_body_in_free_fall() -> None:
    with Live(bar(), gaussian(), frame=0.01) as live:
        live.cut(*across(0.035))
        free = live.positions[:, 0] > 0.0395
        at_rest = live.positions
        live.step(8)
        fallen = (live.positions - at_rest)[free]
        exact = np.tile([0.0, 0.0, -G * live.time**2 / 2], (free.sum(), 1))
        np.testing.assert_allclose(fallen, exact, atol=1e-12 * 0.07)
        np.testing.assert_allclose(live.velocities[free], np.tile([0, 0, -G * live.time], (free.sum(), 1)), atol=1e-12)
        assert any("in 2 parts, 1 of them without a support: it falls free" in note for note in live.notes)


@pytest.mark.parametrize(
    "model", [gaussian(), ts.Springs(rule="isotropic", volume=True)], ids=["gaussian", "volume term"]
)
def test_the_held_part_comes_to_the_equilibrium_of_that_part_alone(model: ts.Springs) -> None:
    stiff = replace(SOFT, young=30000.0, poisson=0.25)
    damped = ts.Dynamics(1.0, damping=ts.Damping(mass=60.0), start="equilibrium")
    body = bar((5, 1, 1), material=stiff, dynamics=damped)
    with Live(body, model) as live:
        live.cut(*across(0.025))
        held = live.problem.mesh.nodes[:, 0] < 0.0255
        live.step(110)
        found = live.positions[held]
    alone = ts.solve(bar((2, 1, 1), material=stiff, dynamics=None), model).states[-1].positions
    undeformed = bar((2, 1, 1)).mesh.nodes
    np.testing.assert_allclose(found, alone, atol=1e-6 * np.abs(alone - undeformed).max())


def test_mass_places_and_velocities_of_what_remains_are_kept() -> None:
    body = bar()
    with Live(body, gaussian()) as live:
        live.pull((0.07, 0.02, 0.02), (0.08, 0.02, 0.03))
        live.step(4)
        places, velocities, n_elements = live.positions, live.velocities, len(body.mesh.elements)
        live.cut(*across(0.035))
        left = live.nodes_left
        np.testing.assert_array_equal(live.positions, places[left])
        np.testing.assert_array_equal(live.velocities, velocities[left])
        assert len(live.elements_left) == n_elements - 4
        assert len(left) == body.mesh.n_nodes  # each node of the layer belongs to a neighbour
        np.testing.assert_allclose(live.body.mass.sum(), 1000.0 * (n_elements - 4) * 0.01**3, rtol=1e-12)


def test_the_momentum_of_a_free_part_changes_by_its_weight_only() -> None:
    with Live(bar(material=replace(SOFT, young=30000.0)), gaussian()) as live:
        live.step(3)
        live.cut(*across(0.035))
        free, before = live.problem.mesh.nodes[:, 0] > 0.038, live.velocities
        assert len(live.elements_left) == 24
        mass, time = live.body.mass[free], live.time
        live.step(5)
        gained = mass @ (live.velocities - before)[free]
        np.testing.assert_allclose(gained, [0, 0, -G * mass.sum() * (live.time - time)], atol=1e-12 * G * mass.sum())


def test_a_cut_beside_the_body_changes_nothing() -> None:
    with Live(bar(), gaussian()) as live, Live(bar(), gaussian()) as whole:
        for one in (live, whole):
            one.step(2)
        live.cut((0.1, 0.0, 0.1), (0.1, 0.02, 0.1), (0.0, 0.0, -0.2))
        for one in (live, whole):
            one.step(2)
        np.testing.assert_array_equal(live.positions, whole.positions)
        assert "passes no element" in live.notes[-1]


@pytest.mark.parametrize("scheme", ["leapfrog", "bdf2"])
def test_a_log_with_cuts_repeats_the_session_bit_for_bit(scheme: str) -> None:
    def begin() -> Live:
        return Live(bar((5, 1, 1), material=replace(SOFT, young=30000.0)), gaussian(), scheme=scheme)

    with begin() as live, begin() as again:
        live.pull((0.05, 0.01, 0.01), (0.055, 0.01, 0.015))
        live.step(2)
        live.cut(*across(0.025))
        live.gravity(0.5)
        live.step(2)
        live.cut(*across(0.045))
        live.step(2)
        replayed(again, live.log.commands, live.log.frames)
        np.testing.assert_array_equal(again.positions, live.positions)
        assert again.notes == live.notes
        first, second = (one.elements for one in live.log.commands if one.kind == "cut")
        assert first == (2,)
        assert second


def test_a_session_of_another_model_removes_the_same_elements() -> None:
    with Live(bar((5, 1, 1)), gaussian()) as live, Live(bar((5, 1, 1)), ts.Fem("neo-hookean"), scheme="bdf2") as other:
        live.cut(*across(0.025))
        command = live.log.commands[-1]
        other.repeat(replace(command, place=()))
        np.testing.assert_array_equal(other.elements_left, live.elements_left)


def test_a_restart_brings_the_whole_body_back() -> None:
    with Live(bar((5, 1, 1)), gaussian()) as live, Live(bar((5, 1, 1)), gaussian()) as whole:
        live.cut(*across(0.025))
        live.step()
        live.restart()
        for one in (live, whole):
            one.step()
        np.testing.assert_array_equal(live.positions, whole.positions)


def test_a_cut_built_aside_takes_effect_in_a_later_frame_and_is_repeated() -> None:
    with Live(bar((5, 1, 1)), gaussian()) as live, Live(bar((5, 1, 1)), gaussian()) as again:
        live.step()
        live.cut(*across(0.025), aside=True)
        assert live.is_cutting
        while live.is_cutting:
            live.step()
        live.step()
        assert live.elements_left.tolist() == [0, 1, 3, 4]
        replayed(again, live.log.commands, live.log.frames)
        np.testing.assert_array_equal(again.positions, live.positions)


def test_a_cut_built_aside_is_built_again_where_the_material_changed() -> None:
    with Live(bar((5, 1, 1)), gaussian()) as live, Live(bar((5, 1, 1)), gaussian()) as again:
        live.cut(*across(0.025), aside=True)
        live.do("young", value=2.0)
        while live.is_cutting:
            live.step()
        replayed(again, live.log.commands, live.log.frames)
        np.testing.assert_array_equal(again.positions, live.positions)
        assert live.problem.material is not None
        assert live.problem.material.young == 6000.0


def test_grasps_keep_the_nodes_that_remain_and_are_released_without_any() -> None:
    with Live(bar(), gaussian()) as live:
        live.pull((0.07, 0.0, 0.0), name="gone", radius=0.001)
        live.pull((0.07, 0.02, 0.02), name="kept", radius=0.0151)
        live.step()
        stiffness = dict(zip(live.grasps["kept"].nodes.tolist(), live.grasps["kept"].stiffness, strict=True))
        live.cut((0.065, -0.01, 0.005), (0.065, 0.005, 0.005), (0.0, 0.0, -0.1))  # the lowest element at y < 0.01
        assert list(live.grasps) == ["kept"]
        assert "released, as none of their nodes remains: gone" in live.notes[-1]
        kept = live.grasps["kept"]
        now = {int(live.nodes_left[node]): value for node, value in zip(kept.nodes, kept.stiffness, strict=True)}
        assert now == {node: value for node, value in stiffness.items() if node in live.nodes_left}
        live.step()


def test_a_cut_of_the_whole_body_is_an_error_and_changes_nothing() -> None:
    with Live(bar((1, 1, 1)), gaussian()) as live:
        with pytest.raises(LiveError, match="nothing would remain"):
            live.cut(*across(0.005))
        assert not live.log.commands
        live.step()


@pytest.mark.parametrize(
    ("place", "why"),
    [
        ((0.0,) * 6, "9 finite numbers"),
        ((0.0,) * 8 + (np.nan,), "9 finite numbers"),
        ((0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0), "no area"),
        ((0.0,) * 9, "no area"),
    ],
)
def test_a_blade_without_area_or_numbers_is_an_error(place: tuple[float, ...], why: str) -> None:
    with Live(bar((2, 1, 1)), gaussian()) as live, pytest.raises(LiveError, match=why):
        live.do("cut", place=place)


def test_elements_of_another_mesh_are_an_error() -> None:
    with Live(bar((2, 1, 1)), gaussian()) as live, pytest.raises(LiveError, match="element 2 does not exist"):
        live.repeat(Command(0, "cut", elements=(1, 2)))


@pytest.mark.parametrize("dim", [2, 3])
def test_a_blade_passes_the_simplices_with_which_it_has_a_place_in_common(dim: int) -> None:
    """Compared with linear programs: a place of both is a convex combination of corners, and lies in the blade."""
    from scipy.optimize import linprog

    rng = np.random.default_rng(dim)
    mesh = ts.rectangle((1, 1), (1, 1), "triangle") if dim == 2 else ts.box((1, 1, 1), (1, 1, 1), "tetrahedron")
    several = 0
    for _ in range(12):
        positions = mesh.nodes + rng.normal(scale=0.1, size=mesh.nodes.shape)
        place = rng.uniform(-0.3, 1.3, size=dim * dim)
        place[2 * dim :] -= np.tile(place[:dim], dim - 2)
        blade = Blade.of(place, dim)
        expected = []
        for number, corners in enumerate(positions[mesh.elements]):
            k = dim + 1
            equal = np.zeros((dim + 1, k + dim - 1))
            equal[:dim, :k], equal[:dim, k:] = corners.T, -blade.sides.T
            equal[dim, :k] = 1
            bounds = [(0, 1)] * (k + dim - 1)
            known = linprog(np.zeros(k + dim - 1), A_eq=equal, b_eq=[*blade.start, 1], bounds=bounds)
            expected += [number] if known.status == 0 else []
        assert blade.passed(mesh, positions).tolist() == expected
        several += len(expected)
    assert several > 12


def test_a_blade_in_facets_between_elements_passes_those_on_one_side() -> None:
    mesh = ts.box((4.0, 1.0, 1.0), (4, 1, 1))
    start, end, depth = (2.0, -1.0, 2.0), (2.0, 2.0, 2.0), (0.0, 0.0, -4.0)
    assert Blade.of([*start, *end, *depth], 3).passed(mesh, mesh.nodes).tolist() == [1]  # its normal is -x
    assert Blade.of([*end, *start, *depth], 3).passed(mesh, mesh.nodes).tolist() == [2]


def test_a_blade_that_ends_in_a_facet_passes_no_further_element() -> None:
    mesh = ts.rectangle((3.0, 1.0), (3, 1))
    assert Blade.of([0.0, 0.5, 2.0, 0.5], 2).passed(mesh, mesh.nodes).tolist() == [0, 1]


@pytest.mark.parametrize(
    ("mesh", "place"),
    [
        (plane_of_two((0.06, 0.02), (6, 2)), (0.031, -0.1, 0.031, 0.1)),
        (solid_of_four(0.01), (0.015, -1, 1, 0.015, 1, 1, 0, 0, -2)),
    ],
    ids=["plane", "solid"],
)
def test_bodies_of_several_kinds_are_cut(mesh: ts.Mesh, place: tuple[float, ...]) -> None:
    section = ts.PlaneStress(0.01) if mesh.dim == 2 else None
    body = bar(mesh=mesh, loads=(), section=section)
    with Live(body, gaussian()) as live:
        live.do("cut", place=place)
        live.step(2)
        centres = mesh.centres[:, 0]
        assert len(live.elements_left) < len(mesh.elements)
        assert (np.abs(centres[np.setdiff1d(np.arange(len(centres)), live.elements_left)] - place[0]) < 0.011).all()


def test_supports_and_loads_stay_on_what_remains() -> None:
    """A traction of 50 Pa on the right: of its 4 facets 2 remain; a force in total keeps its share of each facet."""
    body = bar(
        supports=[ts.Fixed(on="left"), ts.Fixed(on="right", fix=["y"])],
        loads=[
            ts.Traction(on="right", traction=(50.0, 0.0, 0.0)),
            ts.Force(on="front", total=(0.0, 0.0, 0.14)),
            ts.Pressure(on="right", pressure=20.0),
        ],
    )
    mesh = body.mesh
    last = np.flatnonzero(mesh.centres[:, 0] > 0.06)
    gone = last[mesh.centres[last, 2] < 0.01]
    keep = np.setdiff1d(np.arange(len(mesh.elements)), gone)
    left = remaining(body, keep)
    force = left.problem.loading.external_force
    facet = 0.01**2
    np.testing.assert_allclose(force.sum(axis=0), [50.0 * 2 * facet, 0.0, 0.14], atol=1e-14)
    (follows,) = left.problem.loading.following
    pushed = -follows.gradient(left.problem.mesh.nodes).sum(axis=0)
    np.testing.assert_allclose(pushed, [-20.0 * 2 * facet, 0.0, 0.0], atol=1e-14)
    held = left.of.nodes[np.flatnonzero(left.problem.loading.held[:, 1])]
    sides = (mesh.nodes[:, 0] == 0) | (mesh.nodes[:, 0] > 0.0699)
    np.testing.assert_array_equal(held, np.intersect1d(np.flatnonzero(sides), left.of.nodes))


def test_new_faces_carry_no_load_of_a_side() -> None:
    """The right half falls off: what was the right side does not become the face of the cut."""
    body = bar(loads=[ts.Traction(on="right", traction=(50.0, 0.0, 0.0))])
    keep = np.flatnonzero(body.mesh.centres[:, 0] < 0.03)
    left = remaining(body, keep).problem
    assert not left.loads
    assert len(left.supports) == 1


def test_a_support_that_turns_keeps_its_centre() -> None:
    history = [(0.0, 0.0), (1.0, 1.0)]
    turned = ts.Fixed(on="left", rotation=0.3, axis=(1.0, 0.0, 0.0), over=history)
    body = bar(supports=turned)
    keep = np.flatnonzero((body.mesh.centres[:, 0] > 0.01) | (body.mesh.centres[:, 1] > 0.01))
    left = remaining(body, keep)
    before = body.loading.motion(1.0)[left.of.nodes]
    held = left.problem.loading.held
    assert 0 < held.sum() < body.loading.held.sum()
    np.testing.assert_allclose(left.problem.loading.motion(1.0)[held], before[held], atol=1e-15)


def test_regions_keep_their_material() -> None:
    hard = replace(SOFT, young=9000.0)
    body = bar(regions=[ts.Region(ts.Box((0.0, 0.0, 0.0), (0.03, 1.0, 1.0)), hard)])
    keep = np.arange(5, 24)
    left = remaining(body, keep).problem
    young = left.of_elements(lambda material: material.young)
    np.testing.assert_array_equal(young, body.of_elements(lambda material: material.young)[keep])


def test_a_grasp_of_the_problem_keeps_its_nodes() -> None:
    grasp = ts.Grasp("forceps", (0.07, 0.0, 0.0), 0.012, [(0.0, 0.07, 0.0, 0.0), (1.0, 0.08, 0.0, 0.0)], 5.0)
    body = bar(grasps=[grasp])
    nodes, stiffness = grasp.patch(body.body, None)
    centres = body.mesh.centres
    keep = np.flatnonzero((centres[:, 0] < 0.06) | (centres[:, 1] > 0.01))
    left = remaining(body, keep)
    (kept,) = left.problem.grasps
    now, springs = kept.patch(left.problem.body, None)
    there = np.isin(nodes, left.of.nodes)
    assert 0 < there.sum() < len(nodes)
    np.testing.assert_array_equal(left.of.nodes[now], nodes[there])
    np.testing.assert_array_equal(springs, stiffness[there])


def test_nodes_between_nodes_keep_their_state() -> None:
    mesh = ts.box((0.04, 0.01, 0.01), (4, 1, 1), "tetrahedron")
    body = bar(mesh=mesh)
    with Live(body, ts.Fem("neo-hookean", element="quadratic"), scheme="bdf2") as live:
        before, undeformed = live.moment.positions, live.body.potential.nodes
        live.step()
        moved = live.moment.positions - undeformed
        assert before.shape == moved.shape
        live.cut(*across(0.025))
        now = live.moment.positions - live.body.potential.nodes
        places = {tuple(np.round(place, 9)): row for place, row in zip(undeformed, moved, strict=True)}
        expected = [places[tuple(np.round(place, 9))] for place in live.body.potential.nodes]
        np.testing.assert_allclose(now, expected, atol=1e-15)


def test_middle_nodes_of_a_curved_mesh_remain() -> None:
    straight = ts.box((2.0, 1.0, 1.0), (2, 1, 1), "tetrahedron")
    curved = straight.nodes[straight.edges].mean(axis=1) + 0.01
    mesh = replace(straight, middles=curved)
    left = remainder(mesh, np.arange(3, 9))
    assert left.mesh.middles is not None
    of_edge = {tuple(edge): place for edge, place in zip(mesh.edges.tolist(), curved, strict=True)}
    expected = [of_edge[tuple(edge)] for edge in left.nodes[left.mesh.edges].tolist()]
    np.testing.assert_array_equal(left.mesh.middles, expected)


def test_a_chain_of_springs_is_cut() -> None:
    """A network is a body of lines: the blade removes the spring that it passes, and the rest of the chain falls."""
    nodes = np.column_stack([np.arange(5) * 0.1, np.zeros(5)])
    chain = ts.SpringNetwork(nodes, np.array(list(pairwise(range(5)))), np.full(4, 50.0), mass=np.full(5, 0.01))
    body = Problem(
        mesh=chain.mesh,
        supports=ts.Fixed(on=[0]),
        loads=[ts.Force(on=[4], total=(0.0, -0.01 * G))],
        dynamics=ts.Dynamics(1.0),
    )
    with Live(body, chain) as live:
        live.cut((0.25, -1.0), (0.25, 1.0))
        assert live.elements_left.tolist() == [0, 1, 3]
        time = 10 * live.settings.frame
        live.step(10)
        middle = live.positions[3:].mean(axis=0) - [0.35, 0.0]
        np.testing.assert_allclose(middle, [0.0, -G * time**2 / 4], atol=1e-12)


def test_springs_of_prescribed_stiffness_are_cut() -> None:
    mesh = ts.rectangle((0.04, 0.01), (4, 1))
    springs = np.concatenate([mesh.edges, mesh.elements[:, [0, 2]], mesh.elements[:, [1, 3]]])
    model = ts.PrescribedSprings(springs, np.arange(1.0, len(springs) + 1))
    left = remainder(mesh, np.array([0, 2, 3]))
    found = model.on_remainder(left)
    pairs = {tuple(sorted(pair)): k for pair, k in zip(springs.tolist(), model.stiffness, strict=True)}
    removed = {(n, m) for n in (1, 2, 6, 7) for m in (1, 2, 6, 7)} - {(1, 6), (2, 7)}
    expected = {pair: k for pair, k in pairs.items() if pair not in removed}
    now = {tuple(sorted(left.nodes[pair].tolist())): k for pair, k in zip(found.springs, found.stiffness, strict=True)}
    assert now == expected


def test_a_given_potential_cannot_be_cut() -> None:
    body = bar((3, 1, 1))
    potential = gaussian().potential(body)
    with Live(body, potential) as live, pytest.raises(ModelError, match="a given potential cannot be cut"):
        live.cut(*across(0.015))


@pytest.mark.parametrize("large", [3000, 0], ids=["at once", "aside"])
def test_a_page_cuts_a_small_body_at_once_and_a_large_one_aside(large: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("truespring.live.loop._LARGE", large)
    with Live(bar((5, 1, 1)), gaussian()) as live:
        loop = Loop(live)
        body = loop.latest.drawn.number
        start, end, depth = across(0.025)
        built: list[bool] = []
        cut = live.cut
        monkeypatch.setattr(live, "cut", lambda *place, aside: (built.append(aside), cut(*place, aside=aside)))
        loop.ask(Order("cut", place=(*start, *end, *depth)))
        loop.turn()
        assert built == [large == 0]
        while live.is_cutting:
            loop.turn()
        assert live.elements_left.tolist() == [0, 1, 3, 4]
        loop.turn()
        assert loop.latest.drawn.number == body + 1
        assert len(loop.latest.positions) == live.problem.mesh.n_nodes
