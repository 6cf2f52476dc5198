"""Contact in motion: a block on an incline, and one that is dropped."""

from dataclasses import replace

import numpy as np
import pytest

import truespring as ts
from truespring.arrays import Floats
from truespring.errors import ProblemError

G = 9.81


def speeds(
    angle: float, friction: float, length: float, contact: str = "penalty", scheme: str = "bdf2"
) -> tuple[Floats, Floats]:
    """Time [s] and speed [m/s] down the incline of the centre of a stiff block, after it has settled."""
    height, slope = 0.4 * length, np.radians(angle)
    young = 1e4 * 1000 * G * length
    start = 0.0 if contact == "penalty" else -1e-3 * np.hypot(length, height)
    explicit = scheme == "leapfrog"  # a softer contact and less damping, for longer steps
    ramp = ts.HalfSpace(
        "ramp",
        (0, 1),
        (0.0, start),
        friction=friction,
        on="bottom",
        contact=contact,
        stiffness=20 * young / length if explicit else None,
    )
    time = 0.4 * np.sqrt(length / G)
    problem = ts.Problem(
        ts.rectangle((length, height), (2, 1)),
        ts.Material(young, 0.3, 1000.0),
        ts.PlaneStress(length),
        loads=[ts.Gravity((G * np.sin(slope), -G * np.cos(slope)))],
        tools=[ramp],
        dynamics=ts.Dynamics(
            time,
            step="auto" if explicit else time / 40,
            scheme=scheme,
            damping=ts.Damping(time / (400 if explicit else 40)),
        ),
    )
    solution = ts.solve(problem, ts.Fem("neo-hookean"))
    assert solution.status == ts.Status.CONVERGED
    moving = [state.moving for state in solution.states if state.moving is not None]
    if explicit:  # what is dissipated is known by itself
        assert abs(moving[-1].energies.numerical) < 0.02 * moving[-1].energies.damped
    times, share = np.array([one.time for one in moving]), problem.mass / problem.mass.sum()
    late = times > time / 2
    return times[late], np.array([share @ one.velocity[:, 0] for one in moving])[late]


@pytest.mark.parametrize(("length", "contact"), [(1.0, "penalty"), (1e-3, "penalty"), (1e-3, "barrier")])
def test_a_block_slides_as_coulomb_says(length: float, contact: str) -> None:
    """At any size: a = g (sin - mu cos)."""
    times, speed = speeds(30.0, 0.4, length, contact)
    slope = np.radians(30.0)
    assert np.polyfit(times, speed, 1)[0] == pytest.approx(G * (np.sin(slope) - 0.4 * np.cos(slope)), rel=5e-3)


@pytest.mark.parametrize("length", [1.0, 1e-3])
def test_a_block_that_sticks_creeps_slower_than_the_regularisation(length: float) -> None:
    """tan(20 degrees) = 0.36 is below mu = 0.5; friction is full at 0.001 sqrt(g L), L the size of the block."""
    _, speed = speeds(20.0, 0.5, length)
    size = length * np.hypot(1, 0.4)
    assert (speed > 0).all()
    assert speed.max() < 1e-3 * np.sqrt(G * size)


def test_leapfrog_slides_and_sticks_without_regularisation() -> None:
    times, speed = speeds(30.0, 0.4, 0.1, scheme="leapfrog")
    slope = np.radians(30.0)
    assert np.polyfit(times, speed, 1)[0] == pytest.approx(G * (np.sin(slope) - 0.4 * np.cos(slope)), rel=5e-3)
    _, speed = speeds(20.0, 0.5, 0.1, scheme="leapfrog")
    assert abs(speed[-10:].mean()) < 1e-6 * np.sqrt(G * 0.1)  # what is left is vibration


def defect(scheme: str, steps: int, contact: str) -> float:
    """Largest change of kinetic and elastic energy, loads and contact over the height of a fall, of m g h [-]."""
    length, height, young, turn = 0.1, 0.005, 1e4, 0.3
    square = ts.rectangle((length, length), (2, 2))
    nodes = square.nodes @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    mesh = ts.Mesh(nodes - nodes.min(axis=0), square.elements, square.element)
    width = 0.03 * length
    floor = ts.HalfSpace(
        "floor",
        (0, 1),
        (0.0, -height - (width if contact == "barrier" else 0.0)),
        contact=contact,
        stiffness=50 * young / length,
        width=width,
    )
    time = np.sqrt(2 * height / G) + 0.1
    problem = ts.Problem(
        mesh,
        ts.Material(young, 0.3, 1000.0),
        ts.PlaneStress(length),
        loads=[ts.Gravity((0, -G))],
        tools=[floor],
        dynamics=ts.Dynamics(time, step=time / steps, scheme=scheme, record=time / 50),
    )
    solution = ts.solve(problem, ts.Fem("neo-hookean"))
    assert solution.status == ts.Status.CONVERGED
    energies = [state.moving.energies for state in solution.states if state.moving is not None]
    assert max(one.contact for one in energies) > 0.1 * problem.mass.sum() * G * height
    total = np.array([one.kinetic + one.elastic + one.loads + one.contact for one in energies])
    return float(np.abs(total - total[0]).max() / (problem.mass.sum() * G * height))


def test_a_block_that_is_dropped_keeps_its_energy() -> None:
    coarse, fine = (defect("leapfrog", steps, "penalty") for steps in (500, 1500))
    assert fine < 1e-3
    assert np.log(coarse / fine) / np.log(3) == pytest.approx(2, abs=0.5)


@pytest.mark.verification
@pytest.mark.parametrize(("contact", "most"), [("penalty", 1e-3), ("barrier", 3e-3)])
def test_a_block_that_is_dropped_keeps_its_energy_by_midpoint(contact: str, most: float) -> None:
    coarse, fine = (defect("midpoint", steps, contact) for steps in (300, 900))
    assert fine < most
    assert np.log(coarse / fine) / np.log(3) == pytest.approx(2, abs=0.5)


def test_leapfrog_has_no_stable_step_with_a_barrier() -> None:
    mesh = ts.rectangle((0.1, 0.1), (2, 2))
    floor = ts.HalfSpace("floor", (0, 1), (0, -0.01), contact="barrier")
    problem = ts.Problem(
        mesh,
        ts.Material(1e4, 0.3, 1000.0),
        ts.PlaneStress(0.1),
        loads=[ts.Gravity((0, -G))],
        tools=[floor],
        dynamics=ts.Dynamics(1e-3, step=1e-4),
    )
    solution = ts.solve(problem, ts.Fem("neo-hookean"))
    assert solution.status == ts.Status.CONVERGED
    assert solution.cost is not None
    assert solution.cost.notes[0].startswith("scheme bdf2: a barrier has no stable step")
    with pytest.raises(ProblemError, match='contact = "penalty"'):
        ts.solve(replace(problem, dynamics=ts.Dynamics(1e-3, step=1e-4, scheme="leapfrog")), ts.Fem("neo-hookean"))
