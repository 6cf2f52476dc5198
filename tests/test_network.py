"""Plain networks of springs against published and closed-form answers."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq, root

import truespring as ts
from tests.closed_forms import shallow_truss_force, shallow_truss_limit


def two_springs(load: tuple[float, float] = (5.0, 5.0)) -> ts.Solution:
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


def test_ansys_vm9_to_the_digits_printed() -> None:
    """Ansys stops at a looser residual: its figures hold to 0.03 %."""
    state = two_springs().states[-1]
    assert state.displacement[1] == pytest.approx([8.631, 4.533], rel=3e-4)
    assert state.energy == pytest.approx(24.01, rel=3e-4)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(push=st.floats(0.5, 8), lift=st.floats(-4, 8))
def test_two_springs_pull_as_their_lengths_say(push: float, lift: float) -> None:
    """The derivative of the energy by the position of the middle is the load; so are the reactions."""
    path = two_springs((push, lift))
    assert path.status is ts.Status.CONVERGED
    for state in path.states[1:]:
        x, y = state.positions[1]
        upper, lower = math.hypot(x, y - 10), math.hypot(x, y + 10)
        tension = 8 * (upper - 10), 1 * (lower - 10)
        pull = [
            tension[0] * x / upper + tension[1] * x / lower,
            tension[0] * (y - 10) / upper + tension[1] * (y + 10) / lower,
        ]
        assert pull == pytest.approx([state.load_factor * push, state.load_factor * lift], rel=1e-8, abs=1e-8)
        assert np.linalg.norm(state.reaction, axis=1) == pytest.approx(
            [abs(tension[0]), 0.0, abs(tension[1])], abs=1e-8
        )
        assert state.stretch == pytest.approx((min(upper, lower) / 10, max(upper, lower) / 10))


# --- Two bars leaning on each other ----------------------------------------------------------------------------------


def shallow_truss(rise: float) -> ts.SpringNetwork:
    """Half a span of 1 m, EA = 1 N: the truss of von Mises."""
    return ts.SpringNetwork([[-1.0, 0.0], [0.0, rise], [1.0, 0.0]], [[0, 1], [1, 2]], [1 / math.hypot(1.0, rise)] * 2)


def pushed(rise: float, force: float) -> ts.Solution:
    network = shallow_truss(rise)
    problem = ts.Problem(network.mesh, supports=[ts.Fixed(on=[0, 2])], loads=[ts.Force(on=[1], total=(0.0, -force))])
    return ts.solve(problem, network, ts.Newton(load_steps=4, tolerance=1e-13))


# Where the closed form has its maximum: rise over half-span, limit load over EA, motion at it.
LIMITS = {
    0.1: (3.8109e-4, 0.042361),
    0.2: (2.96052e-3, 0.085286),
    0.5: (0.03838374, 0.222120),
    1.0: (0.18740328, 0.490175),
}


@pytest.mark.parametrize("rise", LIMITS)
def test_shallow_truss_below_its_limit(rise: float) -> None:
    stiffness = 1 / math.hypot(1.0, rise)
    sunk_at_limit, limit = shallow_truss_limit(1.0, rise, stiffness)
    assert (limit, sunk_at_limit) == pytest.approx(LIMITS[rise], rel=2e-5)
    path = pushed(rise, 0.95 * limit)
    assert path.status is ts.Status.CONVERGED
    for state in path.states[1:]:
        force = state.load_factor * 0.95 * limit
        sunk = brentq(lambda w, f=force: shallow_truss_force(w, 1.0, rise, stiffness) - f, 0, sunk_at_limit, xtol=1e-15)
        assert -state.displacement[1, 1] == pytest.approx(sunk, rel=1e-8)
        assert state.displacement[1, 0] == pytest.approx(0, abs=1e-12)


@pytest.mark.parametrize("rise", LIMITS)
def test_shallow_truss_beyond_its_limit_hangs(rise: float) -> None:
    """No standing equilibrium is left: what the path ends in hangs below the supports, in tension, or is refused."""
    stiffness = 1 / math.hypot(1.0, rise)
    _, limit = shallow_truss_limit(1.0, rise, stiffness)
    path = pushed(rise, 1.05 * limit)
    standing = [state for state in path.states if state.positions[1, 1] > 0]
    assert max(state.load_factor for state in standing) <= 1 / 1.05
    if path.complete:
        sunk = -path.states[-1].displacement[1, 1]
        assert sunk > 2 * rise
        assert shallow_truss_force(sunk, 1.0, rise, stiffness) == pytest.approx(1.05 * limit, rel=1e-9)
        assert any("snapped" in warning for warning in path.warnings)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(rise=st.floats(0.05, 1.0), share=st.floats(0.1, 2.2))
def test_shallow_truss_moved_by_hand(rise: float, share: float) -> None:
    """Prescribed motion passes the limit; the reaction is the closed form, and its derivative the tangent."""
    network, stiffness, sunk = shallow_truss(rise), 1 / math.hypot(1.0, rise), share * rise
    problem = ts.Problem(network.mesh, supports=[ts.Fixed(on=[0, 2]), ts.Fixed(on=[1], displacement=(0.0, -sunk))])
    state = ts.solve(problem, network, ts.Newton(load_steps=3)).states[-1]
    assert -state.reaction[1, 1] == pytest.approx(shallow_truss_force(sunk, 1.0, rise, stiffness), rel=1e-10, abs=1e-13)
    step = 1e-5 * rise
    slope = shallow_truss_force(sunk + step, 1.0, rise, stiffness) - shallow_truss_force(
        sunk - step, 1.0, rise, stiffness
    )
    tangent = network.hessian(state.positions).toarray()[3, 3]
    assert tangent == pytest.approx(slope / (2 * step), rel=1e-6, abs=1e-8 * stiffness)


# --- A dome in space -------------------------------------------------------------------------------------------------

# Levy and Spillers, Analysis of Geometrically Nonlinear Structures, section 2.4.2 (the star dome of Hangai and
# Kawamata): crown, ring of six, six supports between them; E = 3e7, A = 0.0155, 220.46 at the crown.
STIFFNESS, FORCE = 3e7 * 0.0155, 220.46
CROWN, RING, BASE = 3.2346, (9.8425, 2.4472), (19.685, 0.0)


def dome(published: bool) -> ts.SpringNetwork:
    """The dome with the coordinates as printed, whose roots of three are cut to four digits, or regular to the last."""
    up, out = (8.5239, 17.0472) if published else (RING[0] * math.sqrt(0.75), BASE[0] * math.sqrt(0.75))
    (ring, height), (base, _) = RING, BASE
    nodes = [[0.0, 0.0, CROWN]]
    nodes += [[x, y, height] for x, y in [(ring, 0), (ring / 2, up), (-ring / 2, up)]]
    nodes += [[x, y, height] for x, y in [(-ring, 0), (-ring / 2, -up), (ring / 2, -up)]]
    nodes += [[x, y, 0.0] for x, y in [(out, base / 2), (0, base), (-out, base / 2)]]
    nodes += [[x, y, 0.0] for x, y in [(-out, -base / 2), (0, -base), (out, -base / 2)]]
    bars = [(0, i) for i in range(1, 7)] + [(i, i % 6 + 1) for i in range(1, 7)]
    bars += [(i, 6 + i) for i in range(1, 7)] + [(i % 6 + 1, 6 + i) for i in range(1, 7)]
    assert len(bars) == 24
    length = np.linalg.norm(np.diff(np.array(nodes)[bars], axis=1)[:, 0], axis=1)
    return ts.SpringNetwork(nodes, bars, STIFFNESS / length)


def test_star_dome_deflects_linearly_as_published() -> None:
    network = dome(published=True)
    free = np.arange(3 * 7)
    force = np.zeros(len(free))
    force[2] = -FORCE
    tangent = network.hessian(network.nodes).toarray()[np.ix_(free, free)]
    assert np.linalg.solve(tangent, force)[2] == pytest.approx(-0.20641184, abs=6e-9)


def test_star_dome_starts_as_published() -> None:
    """Solved under a small share of the load, pushed and pulled so that the second order cancels."""
    network, share = dome(published=True), 1e-3

    def crown(force: float) -> float:
        problem = ts.Problem(
            network.mesh,
            supports=[ts.Fixed(on=list(range(7, 13)))],
            loads=[ts.Force(on=[0], total=(0.0, 0.0, force))],
        )
        path = ts.solve(problem, network, ts.Newton(load_steps=1))
        assert path.status is ts.Status.CONVERGED
        return float(path.states[-1].displacement[0, 2])

    assert (crown(-share * FORCE) - crown(share * FORCE)) / (2 * share) == pytest.approx(-0.20641184, rel=2e-5)


@pytest.mark.parametrize("sunk", [0.1, 0.2, 0.5, 1.0])
def test_star_dome_moved_at_its_crown(sunk: float) -> None:
    """The symmetric path past its limit at 0.3: three bars in two unknowns, solved by hand."""

    def pulls(radius: float, height: float) -> tuple[float, float, float]:
        """Force of one sixth on the crown along z, and on a ring node along r and z."""

        def pull(across: tuple[float, float, float], rest: float) -> np.ndarray:
            length = math.sqrt(sum(part * part for part in across))
            return STIFFNESS * (1 / rest - 1 / length) * np.array(across)

        to_crown = pull((-radius, 0.0, CROWN - sunk - height), math.hypot(RING[0], CROWN - RING[1]))
        along_ring = pull((-radius / 2, radius * math.sqrt(3) / 2, 0.0), RING[0])
        c, s = math.cos(math.pi / 6), math.sin(math.pi / 6)
        rest = math.sqrt((BASE[0] * c - RING[0]) ** 2 + (BASE[0] * s) ** 2 + RING[1] ** 2)
        to_base = pull((BASE[0] * c - radius, BASE[0] * s, -height), rest)
        total = to_crown + 2 * along_ring + 2 * to_base
        return float(to_crown[2]), float(total[0]), float(total[2])

    found = root(lambda at: pulls(*at)[1:], RING, tol=1e-14)
    assert np.abs(found.fun).max() < 1e-8 * FORCE
    network = dome(published=False)
    problem = ts.Problem(
        network.mesh,
        supports=[ts.Fixed(on=list(range(7, 13))), ts.Fixed(on=[0], fix="z", displacement=(0.0, 0.0, -sunk))],
    )
    path = ts.solve(problem, network, ts.Newton(tolerance=1e-13))
    state = path.states[-1]
    assert state.load_factor == 1.0
    assert np.hypot(*state.positions[1:7, :2].T) == pytest.approx(np.full(6, found.x[0]), rel=1e-9)
    assert state.positions[1:7, 2] == pytest.approx(np.full(6, found.x[1]), rel=1e-9)
    assert state.reaction[0, 2] == pytest.approx(6 * pulls(*found.x)[0], rel=1e-8)
    # Share of 220.46 carried there by the dome as printed, from a separate path-following.
    shares = {0.1: 0.387817, 0.2: 0.599996, 0.5: 0.483901, 1.0: -0.457504}
    assert -state.reaction[0, 2] / FORCE == pytest.approx(shares[sunk], abs=1e-5)


# --- Collapse --------------------------------------------------------------------------------------------------------


def test_a_collapsed_spring_has_finite_force_and_tangent() -> None:
    network = ts.SpringNetwork([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0, 1], [1, 2], [2, 0]], [2.0, 3.0, 5.0])
    collapsed = np.array([[0.3, 0.2], [0.3, 0.2], [1.0, 1.0]])
    assert network.energy(collapsed) == pytest.approx(
        0.5 * 2 + 0.5 * 3 * (math.hypot(0.7, 0.8) - 1) ** 2 + 0.5 * 5 * (math.hypot(0.7, 0.8) - math.sqrt(2)) ** 2
    )
    assert np.isfinite(network.gradient(collapsed)).all()
    for matrix in (network.hessian(collapsed), network.projected_hessian(collapsed)):
        assert np.isfinite(matrix.toarray()).all()
    assert network.stretch(collapsed)[0] == 0


def test_a_spring_pushed_to_nothing_is_solved() -> None:
    """All nodes held, then one left free: a length of zero on the way does not stop the solver."""
    network = ts.SpringNetwork([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]], [[0, 1], [1, 2], [2, 0]], [2.0, 3.0, 5.0])
    onto = ts.Fixed(on=[1], displacement=(-1.0, 0.0))
    for supports in ([ts.Fixed(on=[0, 2]), onto], [ts.Fixed(on=[0]), onto]):
        path = ts.solve(ts.Problem(network.mesh, supports=supports), network, ts.Newton(load_steps=4))
        assert path.complete
        assert path.states[-1].stretch is not None
        assert path.states[-1].stretch[0] == 0
        assert np.isfinite(path.states[-1].reaction).all()


def test_a_rod_in_space_has_no_turn_about_itself() -> None:
    network = ts.SpringNetwork([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1], [1, 2]], [2.0, 3.0])
    problem = ts.Problem(
        network.mesh, supports=[ts.Fixed([0]), ts.Fixed([1, 2], "yz")], loads=[ts.Force([2], (6, 0, 0))]
    )
    assert ts.solve(problem, network).states[-1].displacement[:, 0] == pytest.approx([0, 3, 5])
