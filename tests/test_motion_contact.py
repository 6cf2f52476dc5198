"""Contact and friction in motion: a block on an incline, and a body that falls on a plane."""

import numpy as np
import pytest

import truespring as ts
from truespring.errors import ProblemError

G = 9.81
LONG = pytest.mark.verification


def sliding(
    angle: float,
    friction: float,
    length: float,
    scheme: str = "bdf2",
    step: float | str = 0.02,
    contact: str = "penalty",
    stiffness: float | None = None,
) -> ts.Solution:
    """A block on an incline, its axes along and normal to it, let go from rest; damped by its material.

    The step is a share of sqrt(length / g), the stiffness of the contact is that over young / length.
    """
    time = np.sqrt(length / G)
    slope = np.radians(angle)
    ground = ts.HalfSpace(
        "ground",
        (0.0, 1.0),
        (0, -1e-3 * length if contact == "barrier" else 0),
        friction=friction,
        contact=contact,
        stiffness=None if stiffness is None else 1e6 * stiffness,
    )
    problem = ts.Problem(
        ts.rectangle((length, length / 2), (2, 1)),
        ts.Material(1e6 * length, 0.3, density=1000.0),
        ts.PlaneStress(length),
        loads=[ts.Gravity((G * np.sin(slope), -G * np.cos(slope)))],
        tools=[ground],
        dynamics=ts.Dynamics(
            1.2 * time,
            step=step * time if isinstance(step, float) else step,
            scheme=scheme,
            record=0.2 * time,
            damping=ts.Damping(stiffness=0.02 * time),
        ),
    )
    path = ts.solve(problem, ts.Fem("neo-hookean"), ts.Newton(tolerance=1e-8))
    assert path.status is ts.Status.CONVERGED
    return path


def speed(state: ts.State) -> float:
    """The mean speed down the incline."""
    return float(state.moving.velocity[:, 0].mean())


@pytest.mark.parametrize(
    ("angle", "friction", "length"),
    [
        pytest.param(30, 0.4, 1e-3, marks=LONG),
        pytest.param(30, 0.4, 1.0, marks=LONG),
        (30, 0.0, 1.0),
        pytest.param(30, 0.0, 1e-3, marks=LONG),
    ],
)
def test_a_block_slides_down_an_incline(angle: float, friction: float, length: float) -> None:
    """The acceleration is g (sin - mu cos), on all scales."""
    path = sliding(angle, friction, length)
    (before, after) = path.states[-3], path.states[-1]
    found = (speed(after) - speed(before)) / (after.moving.time - before.moving.time)
    slope = np.radians(angle)
    assert found == pytest.approx(G * (np.sin(slope) - friction * np.cos(slope)), rel=5e-3)
    force = after.touches[0].force
    assert -force[1] == pytest.approx(path.problem.mass.sum() * G * np.cos(slope), rel=5e-3)
    assert force[0] == pytest.approx(-friction * force[1], rel=1e-6, abs=1e-12)


@LONG
def test_a_block_slides_on_a_barrier() -> None:
    path = sliding(30, 0.4, 1e-3, contact="barrier")
    before, after = path.states[-3], path.states[-1]
    found = (speed(after) - speed(before)) / (after.moving.time - before.moving.time)
    slope = np.radians(30)
    assert found == pytest.approx(G * (np.sin(slope) - 0.4 * np.cos(slope)), rel=5e-3)


@pytest.mark.verification
def test_leapfrog_slides_and_sticks_without_regularisation() -> None:
    """It knows what friction dissipates: that closes the sum of energies."""
    slope = np.radians(30)
    path = sliding(30, 0.4, 0.1, "leapfrog", "auto", stiffness=20.0)
    before, after = path.states[-3], path.states[-1]
    found = (speed(after) - speed(before)) / (after.moving.time - before.moving.time)
    assert found == pytest.approx(G * (np.sin(slope) - 0.4 * np.cos(slope)), rel=5e-3)
    assert after.touches[0].force[0] == pytest.approx(-0.4 * after.touches[0].force[1], rel=1e-6)
    assert abs(after.moving.energies.numerical) < 0.01 * after.moving.energies.damped

    held = sliding(20, 0.5, 0.1, "leapfrog", "auto", stiffness=20.0)
    bottom = held.problem.mesh.nodes[:, 1] == 0
    before, after = held.states[-3], held.states[-1]
    crept = (after.displacement - before.displacement)[bottom, 0].mean() / (after.moving.time - before.moving.time)
    assert abs(crept) < 1e-6 * np.sqrt(G * 0.1)  # a thousandth of what regularisation allows
    weight = held.problem.mass.sum() * G
    assert after.touches[0].force == pytest.approx(weight * np.array([np.sin(0.349066), -np.cos(0.349066)]), rel=0.02)
    assert abs(after.moving.energies.numerical) < 0.01 * after.moving.energies.damped


def test_leapfrog_has_no_stable_step_with_a_barrier() -> None:
    path = sliding(30, 0.4, 0.1, "auto", 0.6, contact="barrier")
    assert path.cost is not None
    assert path.cost.notes[0].startswith("scheme bdf2: a barrier has no stable step")
    with pytest.raises(ProblemError, match='contact = "penalty"'):
        sliding(30, 0.4, 0.1, "leapfrog", contact="barrier")


@pytest.mark.parametrize("length", [1.0, pytest.param(1e-3, marks=LONG)])
def test_a_block_sticks_to_an_incline(length: float) -> None:
    """It creeps with at most the speed of the regularisation, 0.001 sqrt(g L), where tan(angle) < mu."""
    path = sliding(20, 0.5, length)
    bottom = path.problem.mesh.nodes[:, 1] == 0
    before, after = path.states[-3], path.states[-1]
    crept = (after.displacement - before.displacement)[bottom, 0].mean() / (after.moving.time - before.moving.time)
    assert 0 < crept < 1e-3 * np.sqrt(G * length * np.hypot(1, 0.5))


def falling(
    n: int, scheme: str, stiffness: float | None, contact: str = "penalty", tolerance: float = 1e-8
) -> ts.Solution:
    """A soft block that falls by 5 cm on a plane, in n steps; the stiffness of the contact is that over young."""
    size, drop, young, duration = 0.1, 0.05, 2e4, 0.16
    ground = ts.HalfSpace(
        "ground",
        (0.0, 1.0),
        (0, -drop),
        stiffness=None if stiffness is None else stiffness * young / size,
        contact=contact,
        width=0.1 * size,
    )
    problem = ts.Problem(
        ts.rectangle((size, size), (2, 2)),
        ts.Material(young, 0.3, density=1000.0),
        ts.PlaneStress(size),
        loads=[ts.Gravity((0.0, -G))],
        tools=[ground],
        dynamics=ts.Dynamics(duration, step=duration / n, scheme=scheme, record=duration / 40),
    )
    return ts.solve(problem, ts.Fem("neo-hookean"), ts.Newton(tolerance=tolerance))


@pytest.mark.parametrize(
    ("scheme", "n", "contact"),
    [
        pytest.param("midpoint", 320, "penalty", marks=LONG),
        pytest.param("midpoint", 320, "barrier", marks=LONG),
        ("leapfrog", 640, "penalty"),
    ],
)
def test_a_body_falls_on_a_plane_and_keeps_its_energy(scheme: str, n: int, contact: str) -> None:
    """Kinetic and elastic energy, loads and contact keep their sum to 1e-3 m g h; the defect falls with the step."""

    def defect(n: int) -> float:
        path = falling(n, scheme, 10.0, contact, tolerance=1e-10)
        fallen = path.problem.mass.sum() * G * 0.05
        kept = [state.moving.energies for state in path.states]
        assert max(one.contact for one in kept) > 0.05 * fallen  # it touches
        assert path.states[-1].displacement[:, 1].mean() > -0.9 * 0.05  # and rebounds
        assert not path.warnings
        total = np.array([one.total for one in kept])
        return float(np.abs(total - total[0]).max()) / fallen

    coarse, fine = defect(n), defect(2 * n)
    assert fine < 1e-3
    assert fine < coarse / 3


def test_a_motion_that_gains_energy_has_a_warning() -> None:
    """Midpoint steps that are too long for the contact: kinetic, elastic, contact energy and that of the place grow."""
    path = falling(40, "midpoint", None)
    mass = path.problem.mass
    total = [
        float(mass @ (state.moving.velocity**2).sum(axis=1)) / 2
        + state.energy
        + state.moving.energies.contact
        + float(mass @ state.displacement[:, 1]) * G
        for state in path.states
    ]
    (warning,) = path.warnings
    assert warning.startswith("the steps added up to ") and "scheme bdf2" in warning
    assert float(warning.split()[5]) == pytest.approx(max(total), rel=5e-3)
    assert max(total) > mass.sum() * G * 0.05  # more than it had at the begin
    assert not falling(40, "bdf2", None).warnings
