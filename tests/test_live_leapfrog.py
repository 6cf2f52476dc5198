"""Compiled steps of leapfrog, against potentials, `Dynamics` and its scheme step by step."""

from dataclasses import replace

import numpy as np
import pytest

import truespring as ts
from tests.meshes import plane_of_two, shaken, solid_of_four
from truespring.equilibrium import moving_body
from truespring.live import Live
from truespring.live.actions import Weight
from truespring.live.compiled import Compiled, fitting
from truespring.live.steppers import Acting, StepByStep
from truespring.motion.explicit import Leapfrog
from truespring.motion.stages import Moment

SOFT = ts.Material(3e3, 0.45, density=1060.0)
DOWN = ts.Gravity((0.0, -9.81, 0.0))


def stepped() -> ts.Mesh:
    """A cube of voxels without a corner and without one inside, its nodes numbered anyhow."""
    whole = ts.box((0.05, 0.04, 0.03), (5, 4, 3))
    centre = whole.centres
    left = (centre > [0.03, 0.02, 0.01]).all(axis=1) | (np.abs(centre - [0.015, 0.015, 0.015]).max(axis=1) < 1e-4)
    nodes, numbers = np.unique(whole.elements[~left], return_inverse=True)
    order = np.random.default_rng(3).permutation(len(nodes))
    place = np.argsort(order)
    return ts.Mesh(whole.nodes[nodes][order], place[numbers.reshape(-1, 8)], "hexahedron")


def long(axis: int) -> ts.Mesh:
    """A row of more bricks than a batch has columns, along an axis."""
    return ts.box(np.roll([0.7, 0.01, 0.03], axis), np.roll([70, 1, 2], axis))


BODIES = {
    "bricks": (lambda: ts.box((0.03, 0.02, 0.01), (3, 4, 2)), None),
    "voxels": (stepped, None),
    "along x": (lambda: long(0), None),
    "along y": (lambda: long(1), None),
    "along z": (lambda: long(2), None),
    "distorted hexahedra": (lambda: shaken(ts.box((0.03, 0.02, 0.02), (3, 2, 2)), 1e-3), None),
    "tetrahedra": (lambda: ts.box((0.03, 0.02, 0.02), (2, 2, 2), "tetrahedron"), None),
    "wedges": (lambda: ts.box((0.03, 0.02, 0.02), (2, 2, 2), "wedge"), None),
    "pyramids": (lambda: ts.box((0.03, 0.02, 0.02), (2, 2, 2), "pyramid"), None),
    "four kinds": (lambda: solid_of_four(0.01), None),
    "plane strain": (lambda: ts.rectangle((0.03, 0.02), (3, 2)), ts.PlaneStrain(0.01)),
    "plane stress": (lambda: ts.rectangle((0.03, 0.02), (3, 2)), ts.PlaneStress(0.01)),
    "two kinds, plane stress": (lambda: plane_of_two((0.03, 0.02), (3, 2)), ts.PlaneStress(0.01)),
}


def body_of(name: str) -> tuple[ts.Problem, object]:
    """A body, half of it of another material."""
    make, section = BODIES[name]
    mesh = make()
    half = ts.Region(
        np.flatnonzero(mesh.centres[:, 0] <= np.median(mesh.centres[:, 0])), ts.Material(9e3, 0.3, density=800.0)
    )
    problem = ts.Problem(mesh, SOFT, section=section, regions=[half], dynamics=ts.Dynamics(1.0))
    return problem, moving_body(problem, ts.Springs("gaussian"))[0]


def deformed(nodes: np.ndarray, share: float = 0.1) -> np.ndarray:
    """Stretched, sheared and turned, with a part that differs from node to node."""
    generator, dim = np.random.default_rng(7), nodes.shape[1]
    linear = np.eye(dim) + share * generator.uniform(-1, 1, (dim, dim))
    turn = np.linalg.qr(generator.normal(size=(dim, dim)))[0]
    turn[0] *= np.sign(np.linalg.det(turn))
    return nodes @ (turn @ linear).T + 2e-4 * generator.uniform(-1, 1, nodes.shape)


def compiled_force(body: object, positions: np.ndarray) -> np.ndarray:
    """The internal force by no steps of the loop."""
    still = np.zeros_like(positions)
    stepper = Compiled(replace(body, loading=replace(body.loading, external_force=still, further=())), fitting(body))
    nothing = Acting((), (), (np.zeros(0, np.int64), np.zeros(0)), Weight(still, 0.0, 0.0))
    stepper.frame(Moment(0.0, positions, still), nothing, 1, 0.0)
    return -stepper._last.force.T


@pytest.mark.parametrize("name", BODIES)
def test_forces_and_energies_are_those_of_the_potential(name: str) -> None:
    _, body = body_of(name)
    positions = deformed(body.potential.nodes)
    force = body.potential.gradient(positions)
    assert np.abs(compiled_force(body, positions) - force).max() < 1e-12 * np.abs(force).max()
    stored = body.potential.energy(positions)
    assert Compiled(body, fitting(body)).elastic(positions) == pytest.approx(stored, rel=1e-11)


def test_a_large_compression_is_computed_by_the_logarithm_itself() -> None:
    _, body = body_of("bricks")
    for share in (0.55, 0.8, 1.3):
        positions = body.potential.nodes * share + 1e-5 * deformed(body.potential.nodes)
        force = body.potential.gradient(positions)
        assert np.abs(compiled_force(body, positions) - force).max() < 1e-11 * np.abs(force).max()


@pytest.mark.parametrize("name", ["bricks", "tetrahedra", "plane strain", "plane stress"])
def test_the_force_on_an_inverted_body_is_the_derivative_of_its_energy(name: str) -> None:
    _, body = body_of(name)
    mirrored = deformed(body.potential.nodes) * [-0.5, *[1.0] * (body.potential.nodes.shape[1] - 1)]
    stepper, step = Compiled(body, fitting(body)), 1e-7
    way = np.random.default_rng(2).normal(size=mirrored.shape)
    slope = (stepper.elastic(mirrored + step * way) - stepper.elastic(mirrored - step * way)) / (2 * step)
    assert slope == pytest.approx(float((compiled_force(body, mirrored) * way).sum()), rel=1e-6)


CUBE = ts.Problem(
    ts.box((0.06, 0.06, 0.06), (4, 4, 4)),
    SOFT,
    supports=[ts.Fixed("bottom")],
    loads=[DOWN],
    dynamics=ts.Dynamics(1.0),
)


def test_an_inverted_body_recovers() -> None:
    damped = replace(CUBE, dynamics=ts.Dynamics(1.0, start="equilibrium", damping=ts.Damping(mass=40.0)))
    live = Live(damped, ts.Springs("gaussian"))
    rest = live.positions
    wrong = rest.copy()
    inside = np.flatnonzero(np.abs(damped.mesh.nodes - 0.03).max(axis=1) < 1e-9)
    wrong[inside] += 0.03  # beyond the next nodes
    live.go_on(live.state, Moment(0.0, wrong, np.zeros_like(wrong)))
    assert live.warnings and not np.isfinite(live.body.potential.energy(wrong))
    live.step(90)
    assert not live.warnings and not [note for note in live.notes if "begins again" in note]
    assert np.abs(live.positions - rest).max() < 1e-3 * np.abs(rest - damped.mesh.nodes).max()


def by_steps(problem: ts.Problem, **settings: object) -> Live:
    """A session whose steps are taken one by one."""
    live = Live(problem, ts.Springs("gaussian"), **settings)
    live._core.mover.stepper = StepByStep(Leapfrog(live.body), "leapfrog")
    return live


@pytest.mark.parametrize("name", ["voxels", "four kinds", "two kinds, plane stress"])
def test_compiled_steps_are_those_taken_one_by_one(name: str) -> None:
    plain, _ = body_of(name)
    mesh, dim = plain.mesh, plain.mesh.dim
    left = np.flatnonzero(mesh.nodes[:, 0] < mesh.nodes[:, 0].min() + 1e-9)
    heavy = ts.Gravity((0.0, -9.81, 0.0)[:dim])
    dynamics = ts.Dynamics(1.0, damping=ts.Damping(mass=3.0))
    problem = replace(plain, supports=[ts.Fixed(left)], loads=[heavy], dynamics=dynamics)
    both = Live(problem, ts.Springs("gaussian")), by_steps(problem)
    assert [one.scheme for one in both] == ["leapfrog, compiled", "leapfrog"]
    far = mesh.nodes[mesh.nodes[:, 0].argmax()]
    for live in both:
        live.push(far + np.array([0.0, 0.004, 0.004])[:dim], radius=0.005)
        for share in (1, 2, 3):
            live.pull(far, far + 0.001 * share)
            live.step()
    first, second = both
    size = np.abs(second.positions - mesh.nodes).max()
    assert np.abs(first.positions - second.positions).max() < 1e-12 * size
    assert np.abs(first.velocities - second.velocities).max() < 1e-10 * np.abs(second.velocities).max()
    for held in ("pull", "sphere"):
        assert np.abs(first.forces[held]).max() > 0
        assert first.forces[held] == pytest.approx(second.forces[held], rel=1e-9, abs=1e-15)
    assert first.energies().total == pytest.approx(second.energies().total, rel=1e-6)
    assert first.energies().damped == pytest.approx(second.energies().damped, rel=1e-9)


def test_a_scripted_pull_is_the_motion_of_dynamics() -> None:
    frame, frames = 1 / 60, 6
    at, radius = (0.03, 0.06, 0.03), 0.02
    ends = [(0.03 + 1e-3 * k, 0.06 + 2e-3 * k, 0.03) for k in range(frames + 1)]
    live = Live(CUBE, ts.Springs("gaussian"))
    live.pull(at, radius=radius)
    for end in ends[1:]:
        live.pull(at, end)
        live.step()
    stiffness = float(live.grasps["pull"].stiffness.sum())
    way = [(k * frame, *end) for k, end in enumerate(ends)]
    asked = ts.Dynamics(frames * frame, step=live.step_length, scheme="leapfrog", record=frame)
    pulled = replace(CUBE, grasps=[ts.Grasp("pull", at, radius, way, stiffness)], dynamics=asked)
    path = ts.solve(pulled, ts.Springs("gaussian"))
    size = np.abs(path.states[-1].displacement).max()
    assert np.abs(live.positions - path.states[-1].positions).max() < 1e-12 * size


def test_a_session_repeats_bit_for_bit() -> None:
    found = []
    for _ in range(2):
        live = Live(CUBE, ts.Springs("gaussian"))
        for k in range(4):
            live.pull([0.03, 0.06, 0.03], [0.03, 0.06 + 0.003 * k, 0.03])
            live.step()
        found.append(live.positions.tobytes())
    assert found[0] == found[1]


def test_a_step_that_is_too_long_is_halved_and_the_energy_stays_bounded() -> None:
    live = Live(CUBE, ts.Springs("gaussian"))
    live._core.mover.longest = 1.3 * live._core.built.stable  # unstable at rest, too
    longest = live.step_length
    weight = 9.81 * live.body.mass

    def total() -> float:
        fallen = float(weight @ (CUBE.mesh.nodes[:, 1] - live.positions[:, 1]))
        return live.energies().kinetic + live.energies().elastic - fallen

    totals, stored = [], []
    for _ in range(60):
        live.step()
        totals.append(total())
        stored.append(live.energies().elastic)
    assert live.step_length < live._core.built.stable < longest
    assert [note for note in live.notes if "the step is halved" in note]
    assert not [note for note in live.notes if "unstable" in note]
    assert np.ptp(totals[20:]) < 0.01 * max(stored)
    assert max(np.abs(totals)) < 0.2 * max(stored)


def test_frames_of_another_state_begin_with_its_own_forces() -> None:
    first, second = Live(CUBE, ts.Springs("gaussian")), Live(CUBE, ts.Springs("gaussian"))
    first.step(5)
    second.step(2)
    second.go_on(first.state)
    first._core.mover.stepper.forget()
    first.step()
    second.step()
    assert np.array_equal(first.positions, second.positions)


def test_the_choice_of_a_scheme_says_what_was_measured() -> None:
    live = Live(CUBE, ts.Springs("gaussian"))
    assert live.scheme == "leapfrog, compiled" and live.why.startswith("leapfrog: ") and not live.notes
    slow = Live(CUBE, ts.Springs("gaussian"), frame=1e-6)  # in no time at all
    assert slow.scheme == "leapfrog, compiled" and "real-time factor" in slow.why and slow.notes == [slow.why]
    barrier = replace(CUBE, tools=[ts.Sphere("ball", 0.01, (0.03, 0.075, 0.03), contact="barrier")])
    assert Live(barrier, ts.Springs("gaussian")).why == "bdf2: leapfrog has no stable step"
    assert Live(CUBE, ts.Springs("gaussian"), scheme="bdf2").why == ""


def test_what_compiled_steps_take() -> None:
    swaying = replace(CUBE, loads=[replace(DOWN, over=[(0.0, 0.0), (1.0, 1.0)])])
    for problem, springs in ((swaying, "gaussian"), (CUBE, "isotropic")):
        assert fitting(moving_body(problem, ts.Springs(springs))[0]) is None
    assert fitting(moving_body(CUBE, ts.Springs("gaussian"))[0]) is not None
