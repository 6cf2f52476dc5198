"""Whatever is asked, what a path says of its states is true: checked from outside, by other means than the solver's."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts

MODELS = {
    "lloyd": ts.Springs("lloyd"),
    "single": ts.Springs("isotropic", sharing="single"),
    "saint-venant-kirchhoff": ts.Fem("saint-venant-kirchhoff"),
    "neo-hookean": ts.Fem("neo-hookean"),
    "hencky": ts.Fem("hencky"),
}
pulls = st.floats(-0.1, 0.1).filter(lambda pull: pull == 0 or abs(pull) > 1e-6)
asked = given(
    name=st.sampled_from(sorted(MODELS)),
    elements=st.tuples(st.integers(1, 5), st.integers(1, 3)),
    poisson=st.floats(-0.4, 0.45),
    section=st.sampled_from([ts.PlaneStress, ts.PlaneStrain]),
    pull=st.tuples(pulls, pulls),
    motion=st.booleans(),
)


def check(
    name: str,
    elements: tuple[int, int],
    poisson: float,
    section: type[ts.PlaneStress] | type[ts.PlaneStrain],
    pull: tuple[float, float],
    motion: bool,
) -> None:
    """Solve a block of unit squares (E = 1) pulled, pushed and sheared at its right end, and check every state."""
    if not any(pull):
        return
    moved = [ts.Fixed("right", displacement=[4 * one for one in pull])] if motion else []
    problem = ts.Problem(
        mesh=ts.rectangle([float(count) for count in elements], elements),
        material=ts.Material(1.0, poisson),
        section=section(1.0),
        supports=[ts.Fixed("left"), *moved],
        loads=[] if motion else [ts.Force("right", pull)],
    )
    path = ts.solve(problem, MODELS[name], ts.Newton(load_steps=3, max_iterations=30, max_cutbacks=3))
    assert path.potential is not None
    loading, free = problem.loading, ~problem.loading.held.ravel()
    for state in path.states:
        x = state.positions
        gradient = path.potential.gradient(x)
        applied = state.load_factor * loading.external_force
        size = np.linalg.norm(gradient) + np.linalg.norm(applied)
        assert np.linalg.norm((gradient - applied).ravel()[free]) <= 1e-9 * size + 1e-13
        assert gradient - applied - state.reaction == pytest.approx(np.zeros_like(x), abs=1e-9 * size + 1e-13)
        held = x - problem.mesh.nodes - state.load_factor * loading.displacement
        assert np.abs(held[loading.held]).max() <= 1e-12 * problem.mesh.diameter
        assert state.energy == pytest.approx(path.potential.energy(x), rel=1e-12, abs=1e-16)
        if free.any():
            eigenvalues = np.linalg.eigvalsh(path.potential.hessian(x).toarray()[free][:, free])
            doubtful = np.abs(eigenvalues) < 1e-10 * np.abs(eigenvalues).max()
            if not doubtful.any():
                assert state.negative_eigenvalues == (eigenvalues < 0).sum()
        corners = x[problem.mesh.elements]
        to_next, to_last = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
        areas = to_next[..., 0] * to_last[..., 1] - to_next[..., 1] * to_last[..., 0]
        assert state.area_ratio == pytest.approx(areas.min(), rel=1e-9, abs=1e-12)
    unstable = any(state.negative_eigenvalues for state in path.states)
    inverted = any(state.area_ratio <= 0 for state in path.states)
    expected = {
        ts.Status.CONVERGED: path.complete and not unstable and not inverted,
        ts.Status.UNSTABLE: unstable and not inverted,
        ts.Status.INVERTED: inverted,
        ts.Status.NOT_CONVERGED: path.best is not None and not path.complete,
    }
    assert expected[path.status]
    if path.status is not ts.Status.CONVERGED:
        assert path.warnings
    levels = {round(level * 3) for level in path.load_factors if abs(level * 3 - round(level * 3)) < 1e-9}
    assert levels == set(range(1 + int(3 * path.load_factor + 1e-9)))


@settings(max_examples=15, deadline=None, derandomize=True)
@asked
def test_states_are_what_they_are_said_to_be(**asked_for: object) -> None:
    check(**asked_for)


@pytest.mark.verification
@settings(max_examples=400, deadline=None)
@asked
def test_states_are_what_they_are_said_to_be_at_length(**asked_for: object) -> None:
    check(**asked_for)
