"""Pressure on surfaces with a free edge: its work depends on the path, and its tangent is not symmetric."""

from itertools import pairwise

import numpy as np
import pytest
from scipy import sparse
from scipy.integrate import solve_ivp

import truespring as ts
from truespring.arrays import Floats
from truespring.errors import ProblemError
from truespring.linear import choose
from truespring.potential import SparseMatrix, Unsymmetric
from truespring.solvers import ArcLength, DisplacementControl
from truespring.solvers.balance import Balance

SOFT = ts.Material(1e4, 0.3, density=1000.0)
WARNING = "open surface has no potential"


def strip(pressure: float = 40.0, **more: object) -> ts.Problem:
    """A short cantilever, pressed on its upper side."""
    mesh = ts.rectangle((4.0, 1.0), (12, 3))
    values = {"supports": ts.Fixed("left"), "loads": ts.Pressure("top", pressure), **more}
    return ts.Problem(mesh, SOFT, ts.PlaneStrain(1.0), **values)  # type: ignore[arg-type]


def slab(counts: tuple[int, int, int] = (6, 2, 3), poisson: float = 0.3, pressure: float = 30.0) -> ts.Problem:
    """A patch of its upper side pressed."""
    patch = ts.Box((1.9, 0.9, -0.1), (4.1, 1.1, 1.1))
    mesh, material = ts.box((4.0, 1.0, 1.5), counts), ts.Material(1e4, poisson)
    return ts.Problem(mesh, material, None, ts.Fixed("left"), ts.Pressure(patch, pressure))


def load_of(problem: ts.Problem) -> Unsymmetric:
    (load,) = problem.loading.following
    assert isinstance(load, Unsymmetric)
    return load


def shaken(problem: ts.Problem, seed: int = 3) -> Floats:
    noise = np.random.default_rng(seed).uniform(-0.1, 0.1, problem.mesh.nodes.shape)
    return np.asarray(problem.mesh.nodes + np.where(problem.loading.held, 0.0, noise))


# --- the load ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("build", [strip, slab])
def test_the_tangent_is_the_slope_of_the_forces_and_not_symmetric(build: object) -> None:
    problem = build()  # type: ignore[operator]
    load, x = load_of(problem), shaken(problem)
    way = np.random.default_rng(4).normal(size=x.shape)
    step = 1e-6
    slope = (load.gradient(x + step * way) - load.gradient(x - step * way)) / (2 * step)
    tangent = load.tangent(x)
    image = (tangent @ way.ravel()).reshape(x.shape)
    assert np.linalg.norm(slope - image) < 1e-8 * np.linalg.norm(image)
    half = (tangent + tangent.T).toarray() / 2
    assert load.hessian(x).toarray() == pytest.approx(half, abs=1e-12 * np.abs(half).max())
    assert not load.symmetric and not problem.loading.symmetric
    assert problem.loading.has_potential(0.0) and not problem.loading.has_potential(1.0)


def test_its_work_depends_on_the_path() -> None:
    """On a closed way it does work, by Gauss points, which are exact."""
    problem = strip()
    load, corners = load_of(problem), [problem.mesh.nodes, *(shaken(problem, seed) for seed in (1, 2))]
    works = []
    for start, end in pairwise([*corners, corners[0]]):
        at = np.polynomial.legendre.leggauss(3)
        steps = [load.gradient((start + end + one * (end - start)) / 2) * (end - start) / 2 for one in at[0]]
        works.append(sum(weight * step.sum() for weight, step in zip(at[1], steps, strict=True)))
    assert abs(sum(works)) > 0.01 * max(map(abs, works))
    assert list(problem.loading.energies(corners[1], 1.0)) == []


@pytest.mark.parametrize("pressure", [0.0, 40.0])
def test_a_held_edge_has_a_potential(pressure: float) -> None:
    assert strip(pressure, supports=[ts.Fixed("left"), ts.Fixed("right")]).loading.symmetric
    assert strip(pressure).loading.symmetric == (pressure == 0)


def test_linear_models_bear_it_as_a_dead_load() -> None:
    pressed, drawn = strip(), strip(loads=ts.Traction("top", (0.0, -40.0)))
    one, other = (ts.solve(problem, ts.Fem("linear"), ts.Newton(load_steps=1)) for problem in (pressed, drawn))
    assert one.states[-1].displacement == pytest.approx(other.states[-1].displacement, rel=1e-9)
    assert one.warnings == other.warnings and one.states[-1].negative_eigenvalues == 0


# --- equilibria -------------------------------------------------------------------------------------------------------


def elastica(load: float, height: float) -> tuple[Floats, float]:
    """Tip of a cantilever of length 1 and bending stiffness 1 under pressure on its upper side, and its slope there.

    Since the load turns with the beam, all forces are known at the free end: an initial value problem from there to
    the clamp, turned afterwards. The upper side is longer than the axis by -curvature height / 2.
    """

    def rate(_: float, y: Floats) -> list[float]:
        angle, moment, along, across = y[:4]
        pressed = load * (1 - moment * height / 2)
        cos, sin = np.cos(angle), np.sin(angle)
        return [-moment, cos * across - sin * along, pressed * sin, -pressed * cos, -cos, -sin]

    angle, *_, x, y = solve_ivp(rate, (0, 1), np.zeros(6), rtol=1e-10, atol=1e-12).y[:, -1]
    cos, sin = np.cos(angle), np.sin(angle)
    return np.array([-cos * x - sin * y, sin * x - cos * y]), -angle


def test_a_slender_cantilever_is_the_elastica() -> None:
    height, load = 0.025, 4.0
    mesh = ts.rectangle((1.0, height), (40, 2), "triangle")
    pressure = load * 1e6 * height**3 / 12
    problem = ts.Problem(
        mesh, ts.Material(1e6, 0.0), ts.PlaneStress(1.0), ts.Fixed("left"), ts.Pressure("top", pressure)
    )
    path = ts.solve(problem, ts.Fem("saint-venant-kirchhoff"), ts.Newton(load_steps=2))
    assert path.status is ts.Status.CONVERGED
    end = mesh.nodes[:, 0] == 1.0
    tip, slope = elastica(load, height)
    found = path.states[-1].positions[end]
    assert found.mean(axis=0) - [0, height / 2] == pytest.approx(tip, abs=0.002)
    edge = found[mesh.nodes[end, 1].argmax()] - found[mesh.nodes[end, 1].argmin()]
    assert np.arctan2(-edge[0], edge[1]) == pytest.approx(slope, abs=0.003)
    dead, _ = elastica(0.0, height)
    assert np.linalg.norm(tip - dead) > 0.4  # far from rest


@pytest.mark.parametrize("model", [ts.Springs("gaussian"), ts.Fem("neo-hookean")])
def test_solutions_are_balanced_and_state_that_there_is_no_potential(model: ts.Springs | ts.Fem) -> None:
    problem = strip()
    path = ts.solve(problem, model, ts.Newton(load_steps=2))
    state = path.states[-1]
    assert path.status is ts.Status.CONVERGED and path.cost is not None and not path.cost.notes
    assert sum(WARNING in text for text in path.warnings) == 1
    assert [one.negative_eigenvalues for one in path.states] == [0, None, None]
    upper = problem.mesh.nodes[:, 1] == 1.0
    ends = state.positions[upper & np.isin(problem.mesh.nodes[:, 0], (0.0, 4.0))]
    along = ends[1] - ends[0]
    # The pressure on a chain of edges is that on the line between its ends.
    assert state.applied_force == pytest.approx(40 * np.array([along[1], -along[0]]), rel=1e-9)
    assert state.reaction.sum(axis=0) == pytest.approx(-state.applied_force, rel=1e-7)


def test_newtons_method_converges_at_second_order() -> None:
    """With the symmetric part of the tangent alone, it converges at first order."""
    residuals: list[float] = []
    newton = ts.Newton(load_steps=1, method="line-search", tolerance=1e-11)
    path = ts.solve(strip(), ts.Fem("neo-hookean"), newton, lambda level, _, residual: residuals.append(residual))
    assert path.complete
    last = [one for one in residuals if 1e-12 < one < 0.01]
    assert len(last) >= 3
    assert all(after < 100 * before**2 for before, after in pairwise(last)), residuals


def test_unloaded_it_returns() -> None:
    problem = strip(loads=ts.Pressure("top", 40.0, over=[[0, 0], [0.5, 1], [1, 0]]))
    path = ts.solve(problem, ts.Fem("neo-hookean"), ts.Newton(load_steps=4))
    moved = [float(np.abs(state.displacement).max()) for state in path.states]
    assert path.complete and moved[2] > 0.5 and moved[4] < 1e-6 * moved[2]
    assert [state.negative_eigenvalues for state in path.states] == [0, None, None, None, 0]


@pytest.mark.parametrize("control", ["arc length", "displacement"])
def test_paths_with_the_load_factor_as_an_unknown_lead_to_the_same_state(control: str) -> None:
    problem, model = strip(), ts.Fem("neo-hookean")
    wanted = ts.solve(problem, model, ts.Newton(load_steps=2)).states[-1].positions
    sunk = float((wanted - problem.mesh.nodes)[(problem.mesh.nodes == [4.0, 0.0]).all(axis=1), 1][0])
    solver = ArcLength(load_steps=3) if control == "arc length" else DisplacementControl("right-bottom", "y", sunk, 3)
    path = ts.solve(problem, model, solver)
    assert path.complete and path.states[-1].load_factor == pytest.approx(1.0, rel=1e-8)
    assert path.states[-1].positions == pytest.approx(wanted, abs=1e-8)
    assert any(WARNING in text for text in path.warnings)


# --- linear systems ---------------------------------------------------------------------------------------------------


def bent(problem: ts.Problem, model: ts.Fem) -> tuple[SparseMatrix, Floats]:
    """A tangent away from rest, and its positions."""
    held = problem.loading.held
    x, y, z = problem.mesh.nodes.T
    positions = problem.mesh.nodes + np.stack([0.02 * x * y, -0.02 * x**2, 0.003 * x * z], axis=1)
    direct = choose("direct", problem.mesh.nodes, held, symmetric=False)
    balance = Balance(model.potential(problem), problem.loading, 1e-10, 20, direct)
    return balance.hessian(positions, 1.0), positions


@pytest.mark.parametrize("linear", ["direct", "scipy", "multigrid"])
def test_unsymmetric_systems_are_solved(linear: str) -> None:
    """Against SciPy's sparse solver with its own order of the unknowns; symmetric ones by the symmetric solver."""
    problem = slab(pressure=300.0)
    held, free = problem.loading.held, np.flatnonzero(~problem.loading.held.ravel())
    matrix, positions = bent(problem, ts.Fem("neo-hookean"))
    right = np.where(held, 0.0, np.random.default_rng(7).normal(size=held.shape))
    within = sparse.csc_array(sparse.csr_array(matrix)[free][:, free])
    assert abs(within - within.T).max() > 1e-3 * abs(within).max()
    wanted = np.zeros(held.shape)
    wanted.ravel()[free] = sparse.linalg.spsolve(within, right.ravel()[free])
    solver = choose(linear, problem.mesh.nodes, held, symmetric=False)
    tangent = solver.ready(matrix, positions)
    found = tangent.solve(right, 1e-9)
    assert np.abs(found - wanted).max() < 1e-6 * np.abs(wanted).max()
    assert tangent.negative_eigenvalues is None
    assert not tangent.solve(np.zeros(held.shape)).any()
    symmetric = sparse.bsr_array((matrix + matrix.T) / 2, blocksize=(3, 3))
    assert solver.ready(symmetric, positions).negative_eigenvalues == 0


@pytest.mark.parametrize("poisson", [0.3, 0.4999])
def test_multigrid_finds_the_same_equilibrium(poisson: float) -> None:
    problem, model = slab((8, 2, 3), poisson), ts.Springs("gaussian")
    one, other = (ts.solve(problem, model, ts.Newton(load_steps=1, linear=name)) for name in ("multigrid", "scipy"))
    assert one.complete and one.cost is not None and not one.cost.notes
    assert one.cost.linear.startswith("GMRES with") and one.cost.factorisations < one.cost.newton_iterations
    wanted = other.states[-1].displacement
    assert np.abs(one.states[-1].displacement - wanted).max() < 1e-7 * np.abs(wanted).max()


def test_a_symmetric_part_that_is_not_definite_is_left_to_a_factorisation() -> None:
    """Pressed along its axis, a cantilever stays straight far beyond Euler's load, under which a dead load buckles it.

    Beck, ZAMP 3, 1952: under a load that follows there is no other equilibrium.
    """
    mesh, pressure = ts.rectangle((8.0, 1.0), (24, 3)), 300.0
    problem = ts.Problem(
        mesh, ts.Material(1e4, 0.0), ts.PlaneStress(1.0), ts.Fixed("left"), ts.Pressure("right", pressure)
    )
    assert pressure > 9 * np.pi**2 / 4 * 1e4 / 12 / 8.0**2
    path = ts.solve(problem, ts.Fem("neo-hookean"), ts.Newton(load_steps=1, linear="multigrid"))
    assert path.complete and path.cost is not None
    assert path.cost.linear.startswith("direct") and "slow" in path.cost.notes[0]
    assert np.abs(path.states[-1].displacement[:, 1]).max() < 1e-6


def test_petsc_is_an_error() -> None:
    problem = strip()
    with pytest.raises(ProblemError, match=r"linear = 'petsc': .*open surface.*multigrid"):
        choose("petsc", problem.mesh.nodes, problem.loading.held, symmetric=False)


# --- motion -----------------------------------------------------------------------------------------------------------


def beck(load: float) -> complex:
    """Frequency of Beck's column of length, stiffness and mass 1, of the pair that meets at the load 20.05.

    Root of the characteristic equation (Beck 1952; Bolotin 1963, 2.1) by the secant method, from between the first two
    frequencies. An imaginary part is a rate of growth.
    """

    def residual(omega: complex) -> complex:
        root = np.sqrt(load**2 / 4 + omega**2)
        one, other = np.sqrt(load / 2 + root), np.sqrt(-load / 2 + root)
        even = load**2 + 2 * omega**2 * (1 + np.cos(one) * np.cosh(other))
        return complex(even + load * omega * np.sin(one) * np.sinh(other))

    before, now = 10.0 + 4.0j, 10.0 + 5.0j
    for _ in range(40):
        if now == before or residual(now) == residual(before):
            break
        before, now = now, now - residual(now) * (now - before) / (residual(now) - residual(before))
    assert abs(residual(now)) < 1e-9
    return now


@pytest.mark.verification
def test_a_column_flutters_beyond_becks_load() -> None:
    """Which no equilibrium shows: its growth and its frequency, by two terms of linear prediction; not below the load.

    The column is stubby by a twentieth, and has 12 elements.
    """
    height, young, density, step = 0.05, 1e6, 1000.0, 0.04
    bending = young * height**3 / 12
    unit = np.sqrt(bending / (density * height))
    mesh = ts.rectangle((1.0, height), (12, 1), "triangle")
    tips = []
    for load, duration in ((15.0, 2.4), (25.0, 3.2)):
        motion = ts.Dynamics(duration, step, "midpoint", start="equilibrium", velocity=(0.0, 1e-6), record=step)
        material, pressure = ts.Material(young, 0.0, density=density), ts.Pressure("right", load * bending / height)
        problem = ts.Problem(mesh, material, ts.PlaneStress(1.0), ts.Fixed("left"), pressure, dynamics=motion)
        path = ts.solve(problem, ts.Fem("saint-venant-kirchhoff"))
        assert path.status is ts.Status.CONVERGED
        end = mesh.nodes[:, 0] == 1.0
        tips.append(np.array([float(state.displacement[end, 1].mean()) for state in path.states]))
    bounded, growing = tips
    third = len(bounded) // 3
    assert np.abs(bounded[-third:]).max() < 2 * np.abs(bounded[:third]).max()
    late = growing[len(growing) // 2 :]
    terms = np.linalg.lstsq(np.stack([late[1:-1], late[:-2]], axis=1), late[2:], rcond=None)[0]
    found = np.log(np.roots([1, *-terms]).astype(complex)[0]) / step / unit
    expected = beck(25.0)
    assert found.real == pytest.approx(abs(expected.imag), rel=0.05)
    assert abs(found.imag) == pytest.approx(expected.real, rel=0.03)
