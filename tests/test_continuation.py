"""Paths past limit points: trusses in closed form, the star dome, columns that buckle."""

import math
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from docs.loads_and_paths import circle
from scipy import sparse

import truespring as ts
from tests.closed_forms import shallow_truss_force, shallow_truss_limit
from tests.test_network import CROWN, FORCE, LIMITS, dome, shallow_truss
from truespring.errors import TruespringError
from truespring.solvers.continuation import _bordered, _Constraint


def truss(rise: float, force: float) -> tuple[ts.Problem, ts.SpringNetwork]:
    network = shallow_truss(rise)
    supports, load = ts.Fixed(on=[0, 2]), ts.Force(on=[1], total=(0.0, -force))
    return ts.Problem(network.mesh, supports=supports, loads=load), network


def critical(path: ts.Solution, kind: str) -> list[ts.State]:
    return [state for state in path.states if state.critical == kind]


# --- the truss of von Mises ---------------------------------------------------------------------------------

SHALLOW = [rise for rise in LIMITS if rise < 0.7]  # steeper ones buckle to the side before their limit


@pytest.mark.parametrize("rise", LIMITS)
@pytest.mark.parametrize("control", ["displacement", "arc-length"])
def test_shallow_truss_all_the_way_through(rise: float, control: str) -> None:
    """Down through both limits, which are exact, and on: every state is on the closed form."""
    stiffness = 1 / math.hypot(1.0, rise)
    sunk_at_limit, limit = shallow_truss_limit(1.0, rise, stiffness)
    problem, network = truss(rise, 1.5 * limit)
    solver: ts.DisplacementControl | ts.ArcLength = ts.DisplacementControl([1], "y", to=-2.4 * rise, steps=24)
    if control == "arc-length":
        solver = ts.ArcLength(load_steps=8)
    path = ts.solve(problem, network, solver)
    assert path.status is ts.Status.CONVERGED and path.complete
    for state in path.states:
        sunk = -state.displacement[1, 1]
        assert state.displacement[1, 0] == pytest.approx(0, abs=1e-9)
        force = shallow_truss_force(sunk, 1.0, rise, stiffness)
        assert 1.5 * limit * state.load_factor == pytest.approx(force, rel=1e-8, abs=1e-9 * limit)
    first, second = critical(path, "limit point")
    # One eigenvalue is negative between the limits: at both of them none is, the fewer of the two sides.
    assert first.negative_eigenvalues == second.negative_eigenvalues == 0
    assert 1.5 * limit * first.load_factor == pytest.approx(limit, rel=1e-6)
    assert 1.5 * limit * second.load_factor == pytest.approx(-limit, rel=1e-6)
    assert -first.displacement[1, 1] == pytest.approx(sunk_at_limit, rel=1e-4)
    assert -second.displacement[1, 1] == pytest.approx(2 * rise - sunk_at_limit, rel=1e-4)
    inside = [s for s in path.states if sunk_at_limit * 1.01 < -s.displacement[1, 1] < 2 * rise - 1.01 * sunk_at_limit]
    assert inside and all(state.negative_eigenvalues for state in inside)
    assert any("limit point at load factor" in warning for warning in path.warnings)


def test_steps_of_a_displacement_are_met() -> None:
    problem, network = truss(0.2, 1.0)
    path = ts.solve(problem, network, ts.DisplacementControl([1], "y", to=-0.3, steps=6))
    levels = [state for state in path.states if not state.critical]
    assert [state.level for state in levels] == pytest.approx([k / 6 for k in range(7)])
    assert [state.displacement[1, 1] for state in levels] == pytest.approx([-0.05 * k for k in range(7)], abs=1e-13)


# --- the star dome --------------------------------------------------------------------------------------------


def crowned() -> tuple[ts.Problem, ts.SpringNetwork]:
    network = dome(published=True)
    supports, load = ts.Fixed(on=list(range(7, 13))), ts.Force(on=[0], total=(0.0, 0.0, -FORCE))
    return ts.Problem(network.mesh, supports=supports, loads=load), network


def test_star_dome_through_its_first_limit() -> None:
    problem, network = crowned()
    path = ts.solve(problem, network, ts.DisplacementControl([0], "z", to=-1.0, steps=20))
    assert path.complete
    at = {round(-state.displacement[0, 2], 6): state.load_factor for state in path.states if not state.critical}
    shares = {
        0.05: 0.217554,
        0.1: 0.387817,
        0.2: 0.599996,
        0.3: 0.665744,
        0.5: 0.483901,
        0.8: -0.120965,
        1.0: -0.457504,
    }
    for sunk, share in shares.items():
        assert at[sunk] == pytest.approx(share, abs=2e-5)
    first = critical(path, "limit point")[0]
    assert first.load_factor == pytest.approx(0.6658, abs=1e-4)
    assert -first.displacement[0, 2] == pytest.approx(0.302, abs=0.002)


def test_star_dome_by_arc_length_meets_the_same_limit() -> None:
    problem, network = crowned()
    path = ts.solve(problem, network, ts.ArcLength(load_steps=10, max_steps=40))
    controlled = ts.solve(problem, network, ts.DisplacementControl([0], "z", to=-0.5, steps=10))
    mine, theirs = critical(path, "limit point")[0], critical(controlled, "limit point")[0]
    assert mine.load_factor == pytest.approx(theirs.load_factor, rel=1e-7)
    assert mine.positions == pytest.approx(theirs.positions, abs=1e-4 * CROWN)


# --- columns that buckle ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("depth", [2, pytest.param(4, marks=pytest.mark.verification)])
def test_a_column_buckles_at_the_load_of_euler(depth: int) -> None:
    """pi^2 EI(n) / (4 L^2), EI(n) that of Lloyd's springs at this depth, slender enough that little else counts."""
    slender = 40
    problem = ts.Problem(
        ts.rectangle((float(slender), 1.0), (slender * depth, depth)),
        ts.Material(1.0, 1 / 3),
        ts.PlaneStress(1.0),
        ts.Fixed("left"),
        ts.Force("right", (-1.2 * math.pi**2 / (4 * slender**2) / 12, 0.0)),
    )
    factor = ts.moduli(problem, ts.Springs("lloyd")).bending[depth]
    path = ts.solve(problem, ts.Springs("lloyd"), ts.ArcLength(load_steps=6))
    assert path.complete
    (first, *_) = critical(path, "bifurcation")
    assert 1.2 * first.load_factor == pytest.approx(factor, rel=2e-3)
    assert first.mode is not None
    tip = first.mode[np.isclose(problem.mesh.nodes[:, 0], slender)]
    assert abs(tip[:, 1]).min() > 0.99 and abs(tip[:, 0]).max() < 0.1
    assert any("bifurcation" in warning and "along y" in warning for warning in path.warnings)
    assert path.states[-1].negative_eigenvalues == 1


def column_of_quadratic_springs(n: int) -> ts.Problem:
    """Return a slender column under 1.2 times Euler's load."""
    young, length, width = 1e6, 0.4, 0.01
    euler = math.pi**2 * young * width**4 / 12 / (4 * length**2)
    return ts.Problem(
        ts.rectangle((width, length), (2, n), "triangle", diagonal="alternating"),
        ts.Material(young, 0.3),
        ts.PlaneStress(width),
        ts.Fixed("bottom"),
        ts.Force("top", (0.0, -1.2 * euler)),
    )


@pytest.mark.parametrize(("n", "error"), [(20, 3e-3), (40, 1.5e-3)])
def test_a_bifurcation_is_found_where_newton_fails_next_to_it(n: int, error: float) -> None:
    """Near the point rounding errors move the column along the mode, and no equilibrium is found."""
    problem, springs = column_of_quadratic_springs(n), ts.Springs("gaussian", element="quadratic")
    found = []
    for load_steps in (4, 6, 9):
        path = ts.solve(problem, springs, ts.ArcLength(load_steps=load_steps))
        assert path.states[0].negative_eigenvalues == 0 and path.states[-1].negative_eigenvalues == 1
        (point,) = critical(path, "bifurcation")
        assert not any("stability changes" in warning for warning in path.warnings)
        found.append(1.2 * point.load_factor)
    assert found == pytest.approx([1.0] * 3, abs=error)
    assert np.ptp(found) < 1e-4  # far less than the steps


class _WithoutPoints(ts.ArcLength):
    def follow(self, *arguments: Any, **named: Any) -> Iterator[Any]:
        yield from (state for state in super().follow(*arguments, **named) if not state.critical)


def test_a_critical_point_that_is_not_found_is_a_warning() -> None:
    path = ts.solve(
        column_of_quadratic_springs(20), ts.Springs("gaussian", element="quadratic"), _WithoutPoints(load_steps=6)
    )
    last, there = (state.load_factor for state in path.states[-2:])
    (missed,) = [warning for warning in path.warnings if warning.startswith("stability changes between load factors")]
    assert f"{last:.6g} and {there:.6g}" in missed and 1.2 * last < 1 < 1.2 * there


# --- with FEM, motion, and what cannot be done -------------------------------------------------------------------


def test_fem_and_springs_follow_a_controlled_bending() -> None:
    problem = ts.Problem(
        ts.rectangle((0.16, 0.04), (16, 4)),
        ts.Material(1e4, 1 / 3),
        ts.PlaneStress(0.01),
        ts.Fixed("left"),
        ts.Force("right", (0.0, -0.043)),
    )
    control = ts.DisplacementControl("right-middle", "y", to=-0.06, steps=6)
    paths = [ts.solve(problem, model, control) for model in (ts.Springs("isotropic"), ts.Fem("saint-venant-kirchhoff"))]
    for path in paths:
        assert path.status is ts.Status.CONVERGED
        again = ts.solve(
            ts.Problem(
                problem.mesh,
                problem.material,
                problem.section,
                problem.supports,
                ts.Force("right", (0.0, -0.043 * path.load_factor)),
            ),
            path.potential,
            ts.Newton(load_steps=2),
        )
        assert again.states[-1].positions == pytest.approx(path.states[-1].positions, abs=1e-9)
    compared = ts.compare(*paths)
    assert compared.rms_error is not None and compared.rms_error < 0.05


def test_arc_length_carries_prescribed_motion() -> None:
    """A support that moves with the load factor: the path ends where load control does."""
    network = shallow_truss(0.2)
    supports = [ts.Fixed(on=[0, 2]), ts.Fixed(on=[1], fix=["y"], displacement=(0.0, -0.05))]
    problem = ts.Problem(network.mesh, supports=supports, loads=ts.Force([1], (1e-3, 0.0)))
    ends = [ts.solve(problem, network, solver).states[-1] for solver in (ts.Newton(load_steps=4), ts.ArcLength())]
    assert ends[1].load_factor == pytest.approx(1.0)
    assert ends[0].positions == pytest.approx(ends[1].positions, abs=1e-10)


def test_a_linear_body_needs_one_iteration_and_no_more_is_spent() -> None:
    problem = ts.Problem(
        ts.rectangle((4.0, 1.0), (4, 1)),
        ts.Material(1.0, 0.3),
        ts.PlaneStress(1.0),
        ts.Fixed("left"),
        ts.Force("right", (0.0, 1.0)),
    )
    control = ts.DisplacementControl("right-top", "y", to=0.2, steps=2, max_iterations=1)
    path = ts.solve(problem, ts.Fem("linear"), control)
    assert path.status is ts.Status.CONVERGED
    assert [state.iterations for state in path.states] == [0, 1, 1]
    whole = ts.solve(problem, ts.Fem("linear")).states[-1]
    factor = 0.2 / float(whole.displacement[ts.named_point(problem.mesh, "right-top"), 1])
    assert path.states[-1].load_factor == pytest.approx(factor)
    assert path.states[-1].displacement == pytest.approx(factor * whole.displacement, abs=1e-12)


def test_the_bordered_equations_are_met_where_there_is_a_step_at_all() -> None:
    """K u - a p = -r and w . u + s a = g, at a limit point too; nothing moves where no load grows."""
    balance: Any = SimpleNamespace(free=np.ones((2, 2), dtype=bool))
    rng = np.random.default_rng(7)
    push, weights, force = rng.normal(size=(3, 2, 2))
    regular = rng.normal(size=(4, 4))
    for tangent in (regular, regular @ np.diag([1.0, 1.0, 1.0, 0.0])):
        matrix = sparse.csr_array(tangent)
        step, advance = _bordered(balance, matrix, push, _Constraint(weights, 0.3, 0.0), force, 0.7)
        assert tangent @ step.ravel() - advance * push.ravel() == pytest.approx(-force.ravel())
        assert (weights * step).sum() + 0.3 * advance == pytest.approx(0.7)
    for push_of, matrix in ((0 * push, sparse.csr_array(regular)), (push, sparse.csr_array(regular * np.inf))):
        step, advance = _bordered(balance, matrix, push_of, _Constraint(weights, 0.0, 0.0), force, 0.7)
        assert np.isnan(step).all() and np.isnan(advance)


def test_controls_that_do_not_fit_raise() -> None:
    problem, network = truss(0.2, 1.0)
    for control, message in (
        (lambda: ts.DisplacementControl([0], "y", to=-0.1), "support"),
        (lambda: ts.DisplacementControl([1], "z", to=-0.1), "direction = 'z'.*x, y"),
        (lambda: ts.DisplacementControl([1], "y", to=0.0), "to = 0.0 m"),
        (lambda: ts.ArcLength(load_steps=0), "at least 1"),
        (lambda: ts.ArcLength(linear="multigrid"), "linear = 'multigrid'.*direct"),
    ):
        with pytest.raises(TruespringError, match=message):
            ts.solve(problem, network, control())


# --- a strip rolled up ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("depth", [2, 4])
def test_a_strip_is_bent_to_a_full_circle(depth: int) -> None:
    """M = 2 pi EI(n) / L turns the end once around and brings it back, within 1 % of the length."""
    problem, path = circle(depth)
    assert path.status is ts.Status.CONVERGED
    state = path.states[-1]
    end = problem.mesh.nodes[:, 0] == 40.0
    assert np.linalg.norm(state.positions[end].mean(axis=0) - (0.0, 0.5)) < 0.01 * 40
    (load,) = problem.loading.following
    assert -load.energy(state.positions) / problem.loads[0].moment == pytest.approx(2 * math.pi, rel=0.01)  # type: ignore[union-attr]
    half = path.at(0.5)
    assert half is not None
    # Half of the circle: the end stands above its start, by a diameter of L / pi ... L / pi each.
    across = half.positions[end].mean(axis=0) - (0.0, 0.5)
    assert across == pytest.approx([0.0, 2 * 40 / math.pi], abs=0.01 * 40)
