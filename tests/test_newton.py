"""The solver: buckling, scale invariance, prescribed motion, failure with the best state, supports that do not hold."""

import math
from collections.abc import Callable
from functools import cache
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import sparse

import truespring as ts
from tests.closed_forms import bending_factor, buckled_column_tip
from truespring.solvers.balance import Balance
from truespring.solvers.doubts import snapped
from truespring.solvers.line_search import Step, _candidates, _search

SOFT = ts.Material(young=1.0, poisson=1 / 3)
THIN = ts.PlaneStress(1.0)
RULES = {"lloyd": (5 / 16, 7 / 16), "isotropic": (3 / 8, 3 / 8)}
MODELS: dict[str, ts.Springs | ts.Fem] = {
    "springs": ts.Springs(rule="lloyd"),
    "linear": ts.Fem(law="linear"),
    "saint-venant-kirchhoff": ts.Fem(law="saint-venant-kirchhoff"),
    "neo-hookean": ts.Fem(law="neo-hookean"),
    "hencky": ts.Fem(law="hencky"),
}


# --- Buckling --------------------------------------------------------------------------------------------------------


def column(load: float, slenderness: int, depth: int) -> ts.Problem:
    """A clamped-free column of squares, `depth` of them over its thickness of 1 m, pressed at its end."""
    return ts.Problem(
        ts.rectangle((float(slenderness), 1.0), (slenderness * depth, depth)),
        SOFT,
        THIN,
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(-load, 0.0))],
    )


def euler_load(rule: str, slenderness: int, depth: int) -> float:
    """pi^2 EI / 4 L^2 with the bending factor of the lattice [N]."""
    return math.pi**2 / 48 / slenderness**2 * bending_factor(*RULES[rule], depth)


@pytest.mark.parametrize(("slenderness", "depth"), [(20, 2), (40, 2), (20, 4)])
@pytest.mark.parametrize("rule", RULES)
def test_a_column_loses_stability_at_eulers_load(rule: str, slenderness: int, depth: int) -> None:
    # A handful of iterations finds the straight state and tells its inertia, but not the bent branch.
    brief = ts.Newton(load_steps=1, max_iterations=5, max_cutbacks=0)

    def lost(load: float) -> bool:
        path = ts.solve(column(load, slenderness, depth), ts.Springs(rule=rule), brief)
        assert path.complete
        return path.states[-1].branched or bool(path.states[-1].negative_eigenvalues)

    # Beside EI the column has shear and shortens: of the order of the strain at Euler's load.
    euler = euler_load(rule, slenderness, depth)
    assert lost((1 + 3e-3) * euler) and not lost((1 - 3e-3) * euler)


@pytest.mark.parametrize("rule", RULES)
def test_a_column_below_eulers_load_stays_straight(rule: str) -> None:
    problem = column(0.98 * euler_load(rule, 20, 2), 20, 2)
    path = ts.solve(problem, ts.Springs(rule=rule), ts.Newton(load_steps=2))
    assert path.status is ts.Status.CONVERGED
    assert all(state.negative_eigenvalues == 0 and not state.branched for state in path.states)
    end = problem.mesh.nodes[:, 0] == 20
    assert abs(path.states[-1].displacement[end, 1].mean()) < 1e-9
    assert not any("stability" in warning for warning in path.warnings)


@pytest.mark.parametrize(("slenderness", "depth"), [(20, 2), (40, 4)])
@pytest.mark.parametrize("rule", RULES)
def test_a_column_above_eulers_load_bends_like_the_elastica(rule: str, slenderness: int, depth: int) -> None:
    problem = column(1.2 * euler_load(rule, slenderness, depth), slenderness, depth)
    path = ts.solve(problem, ts.Springs(rule=rule), ts.Newton(load_steps=1))
    state = path.states[-1]
    assert path.status is ts.Status.CONVERGED
    assert state.branched
    assert state.negative_eigenvalues == 0
    assert any("stability was lost" in warning and "branch" in warning for warning in path.warnings)
    sideways, down = buckled_column_tip(1.2)
    tip = state.displacement[ts.named_point(problem.mesh, "right-middle")] / slenderness
    assert abs(tip[1]) == pytest.approx(sideways, rel=5e-3)
    assert -tip[0] == pytest.approx(down, rel=5e-3)


def test_an_unstable_equilibrium_is_never_passed_in_silence() -> None:
    """Two bars in a line, pushed together: straight they are unstable, and a kink frees them of all stress."""
    network = ts.SpringNetwork([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0, 1], [1, 2]], [1.0, 1.0])
    problem = ts.Problem(network.mesh, supports=[ts.Fixed(on=[0]), ts.Fixed(on=[2], displacement=(-0.2, 0.0))])
    path = ts.solve(problem, network)
    assert path.complete
    assert any("stability was lost" in warning or "unstable" in warning for warning in path.warnings)
    if path.status is ts.Status.CONVERGED:  # then it has left the line
        last = path.states[-1]
        assert any(state.branched for state in path.states)
        assert last.energy == pytest.approx(0, abs=1e-12)
        assert abs(last.positions[1, 1]) == pytest.approx(math.sqrt(1 - 0.81), rel=1e-6)
    else:
        assert path.status is ts.Status.UNSTABLE


# --- Scale -----------------------------------------------------------------------------------------------------------


def bent(model: str, stress: float, length: float, depth: float, load: float = 1.0) -> ts.Solution:
    """A cantilever of 8 by 2 squares with every stress, length and thickness multiplied, bent by a third of itself."""
    problem = ts.Problem(
        ts.rectangle((4 * length, length), (8, 2)),
        ts.Material(young=stress, poisson=0.3),
        ts.PlaneStress(depth),
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(0.0, -0.003 * load * stress * length * depth))],
    )
    return ts.solve(problem, MODELS[model], ts.Newton(load_steps=3))


@cache
def bent_in_units(model: str) -> ts.Solution:
    return bent(model, 1.0, 1.0, 1.0)


@settings(max_examples=6, deadline=None, derandomize=True)
@given(stress=st.integers(-20, 20), length=st.integers(-20, 20), depth=st.integers(-20, 20))
@pytest.mark.parametrize("model", MODELS)
def test_powers_of_two_change_no_bit(model: str, stress: int, length: int, depth: int) -> None:
    """Factors from a millionth to a million: where they round nothing, the whole history is the same."""
    path, unit = bent(model, 2.0**stress, 2.0**length, 2.0**depth), bent_in_units(model)
    assert path.status is unit.status is ts.Status.CONVERGED
    assert [state.iterations for state in path.states] == [state.iterations for state in unit.states]
    assert np.array_equal(path.load_factors, unit.load_factors)
    for scaled, state in zip(path.states, unit.states, strict=True):
        assert np.array_equal(scaled.displacement, 2.0**length * state.displacement)
        assert scaled.residual == state.residual


@settings(max_examples=6, deadline=None, derandomize=True)
@given(stress=st.floats(-6, 6), length=st.floats(-6, 6), depth=st.floats(-6, 6))
@pytest.mark.parametrize("model", MODELS)
def test_units_do_not_matter(model: str, stress: float, length: float, depth: float) -> None:
    path, unit = bent(model, 10.0**stress, 10.0**length, 10.0**depth), bent_in_units(model)
    assert path.status is unit.status
    assert np.array_equal(path.load_factors, unit.load_factors)
    size = np.abs(unit.states[-1].displacement).max()
    for scaled, state in zip(path.states, unit.states, strict=True):
        assert np.abs(scaled.displacement / 10.0**length - state.displacement).max() <= 1e-10 * size
        energy = scaled.energy / 10.0 ** (stress + 2 * length + depth)
        assert energy == pytest.approx(state.energy, rel=1e-9, abs=1e-12 * unit.states[-1].energy)


# --- Levels, prescribed motion ---------------------------------------------------------------------------------------


@settings(max_examples=10, deadline=None, derandomize=True)
@given(steps=st.integers(1, 23), model=st.sampled_from(["springs", "linear", "neo-hookean"]))
def test_every_requested_level_is_among_the_states(steps: int, model: str) -> None:
    problem = ts.Problem(
        ts.rectangle((2.0, 1.0), (2, 1)),
        SOFT,
        THIN,
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(0.1, -0.02))],
    )
    path = ts.solve(problem, MODELS[model], ts.Newton(load_steps=steps))
    assert path.complete
    assert path.states[0].load_factor == 0
    assert not path.states[0].displacement.any()
    for k in range(steps + 1):
        assert path.at(k / steps) is not None
    assert (np.diff(path.load_factors) > 0).all()


@pytest.mark.parametrize("model", ["springs", "saint-venant-kirchhoff", "neo-hookean"])
def test_requested_levels_are_kept_where_steps_are_cut_back(model: str) -> None:
    """With few iterations a level, steps are halved and grow again: the levels asked for are met all the same."""
    problem = ts.Problem(
        ts.rectangle((4.0, 1.0), (8, 2)),
        SOFT,
        THIN,
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(0.0, -0.02))],
    )
    hasty = ts.Newton(load_steps=4, max_iterations=5, method="line-search")
    path = ts.solve(problem, MODELS[model], hasty)
    assert path.status is ts.Status.CONVERGED
    assert len(path.states) > 5, "a step was cut back"
    for k in range(5):
        assert path.at(k / 4) is not None
    whole = ts.solve(problem, MODELS[model], ts.Newton(load_steps=4)).states[-1]
    assert np.abs(path.states[-1].displacement - whole.displacement).max() < 1e-8 * np.abs(whole.displacement).max()


@pytest.mark.parametrize("model", MODELS)
def test_prescribed_motion_gives_the_forces_back(model: str) -> None:
    """Moved to where a force has brought it, the end answers with that force, and the rest follows."""
    mesh, end = ts.rectangle((4.0, 1.0), (8, 2)), 17
    assert mesh.nodes[end] == pytest.approx([4, 0.5])
    load = np.array([0.01, -0.008])
    forced = ts.solve(
        ts.Problem(mesh, SOFT, THIN, [ts.Fixed(on="left")], [ts.Force(on=[end], total=load)]), MODELS[model]
    )
    there = forced.states[-1]
    moved = ts.solve(
        ts.Problem(mesh, SOFT, THIN, [ts.Fixed(on="left"), ts.Fixed(on=[end], displacement=there.displacement[end])]),
        MODELS[model],
    )
    assert forced.status is moved.status is ts.Status.CONVERGED
    state = moved.states[-1]
    assert state.reaction[end] == pytest.approx(load, rel=1e-7)
    assert moved.applied_force(state) == pytest.approx(load, rel=1e-7)
    size = np.abs(there.displacement).max()
    assert size > 0.3
    assert np.abs(state.displacement - there.displacement).max() < 1e-8 * size
    assert state.energy == pytest.approx(there.energy, rel=1e-8)


def test_a_body_held_at_every_node_moves_as_prescribed() -> None:
    mesh = ts.rectangle((1.0, 1.0), (1, 1))
    supports = [ts.Fixed(on=[node], displacement=mesh.nodes[node] * [0.5, -0.2]) for node in range(4)]
    path = ts.solve(ts.Problem(mesh, SOFT, THIN, supports), MODELS["springs"], ts.Newton(load_steps=4))
    assert path.status is ts.Status.CONVERGED
    assert path.states[-1].positions == pytest.approx(mesh.nodes * [1.5, 0.8])


# --- Failure ---------------------------------------------------------------------------------------------------------


def pulled_element(stress: float) -> ts.Problem:
    """One square between rollers, under nominal `stress` [E] along x."""
    return ts.Problem(
        ts.rectangle((1.0, 1.0), (1, 1)),
        SOFT,
        THIN,
        [ts.Fixed(on="left", fix="x"), ts.Fixed(on="bottom", fix="y")],
        [ts.Force(on="right", total=(stress, 0.0))],
    )


def test_beyond_the_largest_load_the_best_state_and_the_last_good_level_are_named() -> None:
    """Hencky's P = E ln(l) / l has its maximum 1 / e at l = e."""
    full, limit = 0.4, 1 / math.e
    path = ts.solve(pulled_element(full), ts.Fem(law="hencky"))
    assert path.status is ts.Status.NOT_CONVERGED
    assert not path.complete
    assert 0.998 * limit < path.load_factor * full <= limit
    assert path.best is not None
    assert path.best.load_factor > path.load_factor
    assert path.best.load_factor * full > limit
    assert path.best.residual > 1e-10
    assert np.isfinite(path.best.positions).all()
    named = [warning for warning in path.warnings if "last good load factor" in warning]
    assert len(named) == 1
    assert f"{path.load_factor:.6g}" in named[0]
    assert f"{path.best.load_factor:.6g}" in named[0]
    # Requested levels were all kept up to there, and the step was cut back beyond the last of them.
    for k in range(10):
        assert path.at(k / 10) is not None
    between = [level for level in path.load_factors if abs(10 * level - round(10 * level)) > 1e-9]
    assert len(between) >= 2
    assert all(state.negative_eigenvalues == 0 for state in path.states)
    stretch = 1 + path.states[-1].displacement[1, 0]
    assert math.log(stretch) / stretch == pytest.approx(path.load_factor * full, rel=1e-9)


def test_just_below_the_largest_load_it_is_reached() -> None:
    path = ts.solve(pulled_element(0.9995 / math.e), ts.Fem(law="hencky"))
    assert path.status is ts.Status.CONVERGED
    assert path.states[-1].displacement[1, 0] > 1.6


def test_saint_venant_kirchhoff_gives_way_in_compression() -> None:
    """P = E l (l^2 - 1) / 2 has its minimum at l = 1 / sqrt(3)."""
    limit = 1 / 3 / math.sqrt(3)
    path = ts.solve(pulled_element(-0.25), ts.Fem(law="saint-venant-kirchhoff"))
    assert path.status is not ts.Status.CONVERGED
    upright = [state for state in path.states if state.area_ratio > 0]
    assert 0.95 * limit < upright[-1].load_factor * 0.25 <= limit
    assert upright[-1].displacement[1, 0] > 1 / math.sqrt(3) - 1
    assert path.warnings
    below = ts.solve(pulled_element(-0.995 * limit), ts.Fem(law="saint-venant-kirchhoff"))
    assert below.status is ts.Status.CONVERGED


def test_a_body_turned_inside_out_is_said_to_be_inverted() -> None:
    """Springs do not see a mirror image: moved through itself, the square is at rest again."""
    mesh = ts.rectangle((1.0, 1.0), (1, 1))
    supports = [ts.Fixed(on="left"), ts.Fixed(on="right", displacement=(-2.0, 0.0))]
    path = ts.solve(ts.Problem(mesh, SOFT, THIN, supports), MODELS["springs"], ts.Newton(load_steps=4))
    assert path.status is ts.Status.INVERTED
    assert path.states[-1].area_ratio == pytest.approx(-1)
    assert path.states[-1].energy == pytest.approx(0, abs=1e-20)
    assert any("inverted" in warning and "area" in warning for warning in path.warnings)
    linear = ts.solve(ts.Problem(mesh, SOFT, THIN, supports), MODELS["linear"], ts.Newton(load_steps=4))
    assert linear.status is ts.Status.CONVERGED
    assert any("inverted" in warning and "linear" in warning for warning in linear.warnings)


def test_a_law_with_a_barrier_stops_before_it() -> None:
    mesh = ts.rectangle((1.0, 1.0), (1, 1))
    supports = [ts.Fixed(on="left"), ts.Fixed(on="right", displacement=(-2.0, 0.0))]
    path = ts.solve(ts.Problem(mesh, SOFT, THIN, supports), MODELS["neo-hookean"], ts.Newton(load_steps=4))
    assert path.status is ts.Status.NOT_CONVERGED
    assert 0.25 <= path.load_factor < 0.5
    assert all(state.area_ratio > 0 for state in path.states)


def test_one_iteration_is_not_enough_and_says_so() -> None:
    hasty = ts.Newton(load_steps=1, max_iterations=1, max_cutbacks=0)
    path = ts.solve(pulled_element(0.5), MODELS["springs"], hasty)
    assert path.status is ts.Status.NOT_CONVERGED
    assert path.load_factor == 0
    assert path.best is not None
    assert path.best.load_factor == 1
    patient = ts.solve(pulled_element(0.5), MODELS["springs"], ts.Newton(load_steps=1, max_iterations=2))
    assert patient.load_factor > 0, "cut back, it gets somewhere"


@pytest.mark.parametrize(
    "settings_of_newton",
    [{"load_steps": 0}, {"max_iterations": 0}, {"max_cutbacks": -1}, {"tolerance": 0.0}, {"tolerance": 1.0}],
)
def test_settings_without_sense_are_refused(settings_of_newton: dict[str, float]) -> None:
    with pytest.raises(ts.TruespringError):
        ts.Newton(**settings_of_newton)


# --- Rigid motion ----------------------------------------------------------------------------------------------------

RIGID = {
    "along x": [ts.Fixed(on="bottom", fix="y")],
    "along y": [ts.Fixed(on="left", fix="x")],
    "by turning": [ts.Fixed(on="left-bottom")],
}


@pytest.mark.parametrize("motion", RIGID)
def test_supports_that_leave_the_body_free_are_refused_by_name(motion: str) -> None:
    with pytest.raises(ts.TruespringError, match=f"free to move {motion} as a rigid body"):
        ts.Problem(
            ts.rectangle((3.0, 1.0), (3, 1)), SOFT, THIN, RIGID[motion], [ts.Force(on="right", total=(1.0, 0.0))]
        )


def test_a_body_without_supports_is_refused() -> None:
    with pytest.raises(ts.TruespringError, match="rigid body"):
        ts.Problem(ts.rectangle((3.0, 1.0), (3, 1)), SOFT, THIN, [], [ts.Force(on="right", total=(1.0, 0.0))])


def test_rollers_in_a_row_do_not_stop_a_turn_about_them_in_space() -> None:
    nodes = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    pairs = [[i, j] for i in range(4) for j in range(i)]
    network = ts.SpringNetwork(nodes, pairs, [1.0] * 6)
    load = [ts.Force(on=[3], total=(0.0, 0.1, 0.0))]
    with pytest.raises(ts.TruespringError, match="by turning"):
        ts.Problem(network.mesh, supports=[ts.Fixed(on=[0, 1])], loads=load)
    held = ts.Problem(network.mesh, supports=[ts.Fixed(on=[0, 1]), ts.Fixed(on=[2], fix="z")], loads=load)
    state = ts.solve(held, network).states[-1]
    assert (state.reaction.sum(axis=0)) == pytest.approx([0, -0.1, 0], abs=1e-10)


def test_the_least_support_that_holds_is_enough_anywhere() -> None:
    """Three directions hold a plane body, far from the origin and of any size."""
    for shift, size in ((0.0, 1.0), (1e3, 1.0), (0.0, 1e-6)):
        mesh = ts.rectangle((3 * size, size), (3, 1))
        away = ts.Mesh(mesh.nodes + shift * size, mesh.elements)
        supports = [ts.Fixed(on="left-bottom"), ts.Fixed(on="right-bottom", fix="y")]
        load = ts.Force(on="top", total=(0.0, -1e-3 * size))
        path = ts.solve(ts.Problem(away, SOFT, THIN, supports, [load]), MODELS["springs"], ts.Newton(load_steps=1))
        assert path.status is ts.Status.CONVERGED
        ends = path.states[-1].reaction[:, 1].sum()
        assert ends == pytest.approx(1e-3 * size, rel=1e-8)


def test_springs_unstable_without_load_are_not_loaded() -> None:
    """Rectangles beyond an aspect of sqrt(3) take negative springs for an isotropic lattice: it hourglasses at rest."""
    problem = ts.Problem(
        mesh=ts.rectangle((4.0, 1.0), (2, 2)),
        material=ts.Material(1.0, 1 / 3),
        section=ts.PlaneStress(1.0),
        supports=[ts.Fixed(on="left")],
        loads=[ts.Force(on="right", total=(0.1, 0.0))],
    )
    path = ts.solve(problem, ts.Springs(rule="isotropic", allow_negative=True))
    assert path.status is ts.Status.UNSTABLE
    assert path.load_factor == 0.0
    assert np.linalg.eigvalsh(path.potential.hessian(problem.mesh.nodes).toarray())[0] < 0


def slender(share: float) -> tuple[ts.Problem, float]:
    """A beam of 400 by 2 elements under a force that bends it by a share of its length, and that deflection [m]."""
    length, height = 1.0, 0.005
    force = ts.Force("right", (0.0, -3 * 1e6 * height**3 / 12 * share * length))
    mesh, material = ts.rectangle((length, height), (400, 2)), ts.Material(1e6, 1 / 3)
    return ts.Problem(mesh, material, ts.PlaneStress(1.0), [ts.Fixed("left")], [force]), share * length


@pytest.mark.parametrize("share", [1e-7, 1e-9])
def test_a_load_below_rounding_errors_does_not_converge(share: float) -> None:
    """What is unbalanced is no longer small beside the load: no such state is called converged."""
    problem, _ = slender(share)
    path = ts.solve(problem, ts.Springs("isotropic"), ts.Newton(load_steps=2))
    assert path.status is ts.Status.NOT_CONVERGED and len(path.states) == 1
    assert path.best is not None and path.best.residual > 1e-3
    assert any("rounding" in text for text in path.warnings)


def test_a_motion_below_rounding_errors_does_not_converge() -> None:
    """Of a body moved as a whole all forces are rounding: no harm, unless its coordinates do not hold the motion."""
    mesh, material = ts.rectangle((0.1, 0.05), (4, 2)), ts.Material(1e9, 0.3)

    def moved(left: float, right: float) -> ts.Solution:
        ends = [ts.Fixed(on, displacement=(way, 0.0)) for on, way in (("left", left), ("right", right))]
        return ts.solve(ts.Problem(mesh, material, ts.PlaneStress(0.01), ends), ts.Springs("lloyd"), ts.Newton(2))

    whole = moved(1e-7, 1e-7)
    assert whole.status is ts.Status.CONVERGED
    assert whole.states[-1].displacement[:, 0] == pytest.approx(1e-7, rel=1e-6)
    assert moved(0.0, 1e-7).status is ts.Status.CONVERGED
    lost = moved(0.0, 1e-16)  # a few times the rounding error of 0.1
    assert lost.status is ts.Status.NOT_CONVERGED and lost.best is not None and lost.best.residual > 1e-3


@pytest.mark.parametrize("model", [ts.Springs("isotropic"), ts.Fem("linear"), ts.Fem("saint-venant-kirchhoff")])
@pytest.mark.parametrize("share", [1e-3, 1e-5])
def test_a_slender_body_follows_a_load_near_rounding_errors(model: ts.Springs | ts.Fem, share: float) -> None:
    """Under tiny loads the answer is linear in them, though rounding of the positions makes forces nearly as large."""
    problem, tip = slender(share)
    path = ts.solve(problem, model, ts.Newton(load_steps=4))
    assert path.status is ts.Status.CONVERGED
    moved = [-state.displacement[ts.named_point(problem.mesh, "right-middle"), 1] for state in path.states]
    shares = np.array(moved[1:]) / moved[-1]
    assert shares == pytest.approx([0.25, 0.5, 0.75, 1.0], rel=3e-3)
    assert 0.5 * tip < moved[-1] < 1.1 * tip


def test_no_state_of_a_runaway_counts_as_balanced() -> None:
    """Where iterates run away, their own size excuses no residual, and no overflow reaches the user."""
    problem = ts.Problem(
        ts.box((3.0, 3.0, 3.0), (3, 3, 3), "bcc-tetrahedron"),
        ts.Material(2e3, 0.1),
        None,
        [ts.Fixed("left")],
        [ts.Force("right", (1500.0, -300.0, 100.0))],
    )
    path = ts.solve(problem, ts.Springs("lloyd", volume=True), ts.Newton(load_steps=4))
    assert path.status is not ts.Status.CONVERGED
    assert len(path.states) > 2
    assert max(state.residual for state in path.states) < 1e-8


def test_an_indefinite_tangent_is_shifted_by_ever_more_of_its_diagonal() -> None:
    """The smallest shift that helps is the best: it is tried first."""
    tangent = sparse.csr_array(np.array([[2.0, 5.0], [5.0, -4.0]]))
    balance: Any = SimpleNamespace(
        projected=lambda *_: None, in_blocks=lambda matrix: matrix, diagonal=lambda matrix: matrix.diagonal()
    )
    first, *others = _candidates(balance, np.zeros((1, 2)), tangent, 1.0)
    assert first is tangent
    shares = [(one - tangent).diagonal() / [2.0 + 3.0, 4.0 + 3.0] for one in others]
    assert all(share == pytest.approx(share[0], rel=1e-6) for share in shares)
    assert all(before[0] < 0.5 * share[0] for before, share in pairwise(shares))
    assert shares[0][0] < 1e-4 < 1 < shares[-1][0]


@pytest.mark.parametrize(
    ("energy", "slope", "newton", "length"),
    [
        (lambda t: (t - 0.3) ** 2, lambda t: 2 * (t - 0.3), True, 0.3),  # by interpolation to the bottom at once
        (lambda t: (t - 0.05) ** 2, lambda t: 2 * (t - 0.05), True, 0.05),  # a tenth, then half of it
        (lambda t: (t - 0.9) ** 2, lambda t: 2 * (t - 0.9), False, 1.0),
        (lambda t: -t if t < 0.9 else math.inf, lambda t: -1.0, True, 0.1),
        (lambda t: -t if t < 0.9 else math.inf, lambda t: -1.0, False, 0.1),  # what was cut is not doubled
        (lambda t: -t + (t / 40) ** 2, lambda t: -1 + t / 800, True, 1.0),
        (lambda t: -t + (t / 40) ** 2, lambda t: -1 + t / 800, False, 512.0),  # while it goes down at its end too
        (lambda t: -t, lambda t: -1.0, False, 1024.0),
        (lambda t: t, lambda t: 1.0, True, None),
    ],
)
def test_a_search_ends_where_the_energy_says(
    energy: Callable[[float], float], slope: Callable[[float], float], newton: bool, length: float | None
) -> None:
    balance: Any = SimpleNamespace(
        total_energy=lambda positions, level: (energy(positions[0, 0]), 1e-3),
        force=lambda positions, level: np.array([[slope(positions[0, 0])]]),
        scalar_product=lambda a, b: float((a * b).sum()),
    )
    step = Step(np.ones((1, 1)), -abs(slope(0.0)), newton)
    found = _search(balance, 1.0, np.zeros((1, 1)), step)
    assert found == (None if length is None else pytest.approx(np.array([[length]])))


def test_a_matrix_is_brought_into_blocks_once() -> None:
    matrix = sparse.csr_array(np.arange(36.0).reshape(6, 6))
    balance: Any = SimpleNamespace(free=np.ones((3, 2), dtype=bool))
    blocks = Balance.in_blocks(balance, matrix)
    assert blocks.format == "bsr" and blocks.blocksize == (2, 2) and (blocks.toarray() == matrix.toarray()).all()
    assert Balance.in_blocks(balance, blocks) is blocks
    other = sparse.bsr_array(matrix, blocksize=(3, 3))
    assert Balance.in_blocks(balance, other).blocksize == (2, 2)


@pytest.mark.parametrize(("far", "is_snap"), [(1.0, False), (3.0, False), (200.0, True)])
def test_a_step_much_longer_than_the_last_is_a_snap(far: float, is_snap: bool) -> None:
    """Per load factor: of a step of a third of the one before a third is expected. Whatever the unit."""
    for unit in (1e-6, 1.0, 1e6):
        states: list[Any] = [
            SimpleNamespace(load_factor=factor, positions=np.array([[unit * place, 0.0]]), branched=False)
            for factor, place in ((0.0, 0.0), (0.3, 3.0), (0.4, 3.0 + far))
        ]
        assert snapped(states[2], states[1], states[0]) is is_snap
        assert not snapped(states[2], states[1], None)
        assert not snapped(SimpleNamespace(**{**vars(states[2]), "branched": True}), states[1], states[0])
