"""Plain networks of springs against published and closed-form answers."""

import pytest

import truespring as ts


def two_springs(load: tuple[float, float] = (5.0, 5.0)) -> ts.Path:
    """Ansys verification manual VM9: springs of 1 and 8 N/m, 10 m each, large deflection."""
    network = ts.SpringNetwork(
        nodes=[[0.0, 10.0], [0.0, 0.0], [0.0, -10.0]],
        springs=[[0, 1], [1, 2]],
        stiffness=[8.0, 1.0],
        rest_length=[10.0, 10.0],
    )
    problem = ts.Problem(
        mesh=network.mesh,
        supports=[ts.Fixed(on=[0, 2])],
        loads=[ts.Force(on=[1], total=load)],
    )
    return ts.solve(problem, network)


def test_ansys_vm9() -> None:
    state = two_springs().states[-1]
    # Ansys prints 8.631, 4.533 and 24.01; these are the ideal springs.
    assert state.displacement[1] == pytest.approx([8.63207, 4.53191], abs=1e-5)
    assert state.energy == pytest.approx(24.01163, abs=1e-5)
    assert state.reaction.sum(axis=0) == pytest.approx([-5.0, -5.0], abs=1e-8)
