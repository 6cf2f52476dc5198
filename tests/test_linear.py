"""Linear solvers: multigrid against factorisations, what they tell of stability, and what they fall back on."""

import re
import time
from collections.abc import Callable
from dataclasses import replace

import numba
import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.linalg import spsolve

import truespring as ts
from truespring.errors import ProblemError
from truespring.kernels import threads, vectors
from truespring.linear import choice, direct, levels
from truespring.linear.gradients import IndefiniteError
from truespring.linear.iterative import Preconditioned
from truespring.linear.levels import Matrix
from truespring.linear.nested import Interpolation
from truespring.mesh import interpolations

SOFT, THIN = ts.Material(young=1e4, poisson=0.3), ts.PlaneStress(thickness=0.01)
LIBRARIES = [name for name in direct.FACTORISERS if direct.present(name)]

MULTIGRID = ("multigrid", "geometric multigrid")


def cantilever(
    mesh: ts.Mesh, force: float, material: ts.Material = SOFT, regions: list[ts.Region] | None = None
) -> ts.Problem:
    total = (0.0, -force, 0.0)[: mesh.dim]
    section = THIN if mesh.dim == 2 else None
    return ts.Problem(mesh, material, section, [ts.Fixed("left")], [ts.Force("right", total)], regions or [])


def check_cycle(ready: choice.Tangent, problem: ts.Problem) -> None:
    """The V-cycle is symmetric and positive."""
    assert isinstance(ready, Preconditioned) and ready.coarse is not None
    free = ~problem.loading.held
    a, b = (np.where(free, np.random.default_rng(seed).normal(size=free.shape), 0.0) for seed in (3, 4))
    image = [ready.coarse.cycle(ready.level, one).copy() for one in (a, b)]
    assert (image[0] * a).sum() > 0 and (image[1] * b).sum() > 0
    assert (image[0] * b).sum() == pytest.approx((image[1] * a).sum(), rel=1e-4)


def chosen(name: str, problem: ts.Problem) -> choice.LinearSolver:
    """Return a linear solver by name; "geometric multigrid" is multigrid with coarser meshes."""
    nodes, held = problem.mesh.nodes, problem.loading.held
    if name == "geometric multigrid":
        return choice.choose("multigrid", nodes, held, lambda: interpolations(problem.mesh, 60))
    return choice.choose(name, nodes, held)


def strip(n: int = 12) -> ts.Problem:
    return cantilever(ts.rectangle((4, 1), (4 * n, n)), 0.4)


def block() -> ts.Problem:
    return cantilever(ts.box((4, 1, 1), (20, 5, 5)), 25.0)


def ragged() -> ts.Problem:
    """Voxels with a ragged boundary: cubes of a ball with bites taken out, held at one end."""
    whole = ts.box((1, 1, 1), (12, 12, 12))
    centres = whole.nodes[whole.elements].mean(axis=1)
    inside = np.linalg.norm(centres - 0.5, axis=1) < 0.5
    bitten = (np.linalg.norm(centres - [0.5, 0.95, 0.5], axis=1) < 0.25) | (np.abs(centres[:, 2] - 0.7) < 0.04)
    kept = whole.elements[inside & ~(bitten & (centres[:, 0] > 0.3))]
    used, numbers = np.unique(kept, return_inverse=True)
    mesh = ts.Mesh(whole.nodes[used], numbers.reshape(kept.shape), "hexahedron")
    left = np.flatnonzero(mesh.nodes[:, 0] <= mesh.lower[0] + 1e-9)
    right = np.flatnonzero(mesh.nodes[:, 0] >= mesh.upper[0] - 1e-9)
    return ts.Problem(mesh, SOFT, None, [ts.Fixed(left)], [ts.Force(right, (20.0, -20.0, 0.0))])


def shaken() -> ts.Problem:
    """Tetrahedra with nodes moved about, so that none is like another."""
    mesh = ts.box((4, 1, 1), (16, 4, 4), "tetrahedron")
    inner = ((mesh.nodes > mesh.lower + 1e-9) & (mesh.nodes < mesh.upper - 1e-9)).all(axis=1)
    moved = mesh.nodes + inner[:, None] * np.random.default_rng(2).uniform(-0.05, 0.05, mesh.nodes.shape)
    return cantilever(ts.Mesh(moved, mesh.elements, "tetrahedron"), 25.0)


def contrast(times: float, n: int) -> ts.Problem:
    """A third of the elements so many times as stiff as the others, anywhere."""
    mesh = ts.rectangle((4, 1), (4 * n, n))
    stiff = np.flatnonzero(np.random.default_rng(1).random(len(mesh.elements)) < 0.3)
    return cantilever(mesh, 0.3, regions=[ts.Region(stiff, ts.Material(young=1e4 * times, poisson=0.3))])


ILL_CONDITIONED: dict[str, tuple[Callable[[], ts.Problem], ts.Springs | ts.Fem]] = {
    "slender": (lambda: cantilever(ts.rectangle((40, 1), (320, 8)), 2e-3), ts.Springs(rule="isotropic")),
    "contrast": (lambda: contrast(1e4, 12), ts.Springs(rule="isotropic")),
    "large contrast": (lambda: contrast(1e8, 6), ts.Springs(rule="isotropic")),
    "volume": (
        lambda: cantilever(ts.box((4, 1, 1), (16, 4, 4)), 25.0, ts.Material(1e4, 0.49)),
        ts.Springs(rule="isotropic", volume=True),
    ),
    "tetrahedra": (shaken, ts.Springs(rule="biquadratic")),
    "ragged": (ragged, ts.Springs(rule="isotropic")),
    "one layer": (lambda: cantilever(ts.box((4, 0.1, 1), (40, 1, 10)), 0.02), ts.Springs(rule="isotropic")),
    "mean dilatation": (
        lambda: cantilever(ts.box((4, 1, 1), (12, 3, 3)), 25.0, ts.Material(1e4, 0.49)),
        ts.Fem(law="neo-hookean"),
    ),
}


@pytest.mark.parametrize("name", ILL_CONDITIONED)
def test_multigrid_converges_or_falls_back_and_says_so(name: str) -> None:
    build, model = ILL_CONDITIONED[name]
    problem = build()
    tip = ts.solve(problem, model, ts.Newton(load_steps=1, linear="scipy"))
    path = ts.solve(problem, model, ts.Newton(load_steps=1, linear="multigrid"))
    assert path.cost is not None and tip.cost is not None
    assert path.status is tip.status is ts.Status.CONVERGED
    exact, found = tip.states[-1].displacement, path.states[-1].displacement
    assert np.abs(exact).max() > 0.05 * problem.mesh.diameter, "it bends"
    assert np.abs(found - exact).max() <= 1e-8 * np.abs(exact).max()
    assert path.states[-1].negative_eigenvalues == 0
    assert path.cost.cg_iterations > 0
    assert path.cost.linear in MULTIGRID or any(re.search("instead of .*multigrid", note) for note in path.cost.notes)


@pytest.mark.parametrize("build", [strip, block])
def test_multigrid_needs_few_iterations_at_every_size(build: Callable[..., ts.Problem]) -> None:
    path = ts.solve(build(), ts.Springs(rule="isotropic"), ts.Newton(load_steps=1, tolerance=1e-8, linear="multigrid"))
    assert path.cost is not None
    assert path.newton_iterations <= 8
    assert path.cost.linear == "geometric multigrid"
    assert path.cost.cg_iterations <= 8 * path.newton_iterations
    assert 0 < path.cost.lanczos_iterations <= 25, "stability is computed at the end; at rest it is known"


@pytest.mark.parametrize("name", ["scipy", "rslab", "pardiso", *MULTIGRID])
def test_every_linear_solver_solves(name: str) -> None:
    if name not in (*MULTIGRID, *LIBRARIES):
        pytest.skip(f"{name} is not installed")
    problem = block()
    potential = ts.Springs(rule="isotropic").potential(problem)
    nodes, held = problem.mesh.nodes, problem.loading.held
    turned = nodes + 0.1 * np.sin(nodes[:, ::-1])
    right = np.where(held, 0.0, np.random.default_rng(0).normal(size=nodes.shape))
    matrix = potential.hessian(turned)
    solver = chosen(name, problem)
    assert solver.name.startswith(name) or solver.name.startswith("direct")
    found = solver.ready(matrix, turned).solve(right, 1e-10)
    free = np.flatnonzero(~held.ravel())
    exact = spsolve(matrix.tocsc()[free][:, free], right.ravel()[free])
    assert np.abs(found.ravel()[free] - exact).max() <= 1e-7 * np.abs(exact).max()
    assert not found[held].any()
    assert solver.memory > matrix.data.nbytes / 4


@pytest.mark.parametrize("name", [*LIBRARIES, *MULTIGRID])
def test_a_negative_direction_is_seen(name: str) -> None:
    """A strip pressed together until it buckles: few eigenvalues of thousands are negative."""
    problem = cantilever(ts.rectangle((10, 1), (80, 8)), 0.1)
    potential = ts.Springs(rule="isotropic").potential(problem)
    nodes, held = problem.mesh.nodes, problem.loading.held
    free = np.flatnonzero(~held.ravel())
    solver = chosen(name, problem)
    assert solver.ready(potential.hessian(nodes), nodes).negative_eigenvalues == 0
    pressed = nodes * [0.99, 1.0]
    matrix = potential.hessian(pressed)
    eigenvalues = np.linalg.eigvalsh(matrix.toarray()[free][:, free])
    assert (eigenvalues < 0).sum() >= 1
    tangent = solver.ready(matrix, pressed)
    assert tangent.negative_eigenvalues == ((eigenvalues < 0).sum() if name not in MULTIGRID else 1)
    if name in MULTIGRID:
        with pytest.raises(IndefiniteError):
            tangent.solve(np.where(held, 0.0, np.random.default_rng(0).normal(size=nodes.shape)), 1e-10)


def test_a_column_buckles_under_multigrid_too() -> None:
    """The straight state is unstable: the path leaves it with the help of a factorisation, and says so."""
    mesh = ts.rectangle((20, 1), (80, 4))
    euler = np.pi**2 * 1e4 * 0.01 / 12 / (4 * 20**2)
    problem = ts.Problem(mesh, SOFT, THIN, [ts.Fixed("left")], [ts.Force("right", (-1.3 * euler, 0.0))])
    for name in ("scipy", "multigrid"):
        path = ts.solve(problem, ts.Springs(rule="isotropic"), ts.Newton(load_steps=2, linear=name))
        assert path.status is ts.Status.CONVERGED
        assert path.states[-1].branched or path.states[1].branched
        assert np.abs(path.states[-1].displacement[:, 1]).max() > 1
    assert path.cost is not None
    assert any(re.search("instead of .*multigrid", note) and "unstable" in note for note in path.cost.notes)


def test_what_runs_again_is_the_same_to_the_last_bit() -> None:
    one, two = (
        ts.solve(strip(40), ts.Springs(rule="isotropic"), ts.Newton(load_steps=1, linear="multigrid")) for _ in range(2)
    )
    assert np.array_equal(one.states[-1].positions, two.states[-1].positions)


def test_compile_time_is_known_within_the_block_and_counted_once() -> None:
    """`solve` subtracts it before the block ends."""

    def inner(x: float) -> float:
        return x + 1.0

    compiled_inner = numba.njit(inner)

    def outer(x: float) -> float:
        return compiled_inner(x) * 2.0

    compiled_outer = numba.njit(outer)
    with threads.compiling() as compiled:
        assert compiled() == 0
        started = time.perf_counter()
        assert compiled_outer(1.0) == 4.0
        assert 0 < compiled() <= time.perf_counter() - started
        before = compiled()
        compiled_outer(2.0)
        assert compiled() == before


def test_pieces_cover_the_range_once() -> None:
    threads.set_threads(3)
    try:
        assert threads.pieces(10, 1) == [(0, 3), (3, 6), (6, 10)]
        assert threads.pieces(10, 6) == [(0, 10)]
        assert threads.pieces(0) == [(0, 0)]
    finally:
        threads.set_threads(None)


def test_a_factorisation_that_does_not_fit_is_refused_before_it_starts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "available_memory", lambda: 2**20)
    with pytest.raises(ProblemError, match=r"needs about .* GiB.*multigrid"):
        ts.solve(strip(), ts.Springs(rule="isotropic"), ts.Newton(linear="direct"))
    unstable = ts.solve(strip(), ts.Springs(rule="isotropic"), ts.Newton(load_steps=1, linear="multigrid"))
    assert unstable.complete


def test_names_are_checked() -> None:
    with pytest.raises(ProblemError, match=r"linear = 'multigrd'.*'multigrid'.*allowed: auto, direct"):
        ts.Newton(linear="multigrd")
    with pytest.raises(ProblemError, match=r"method = 'mip'.*allowed: auto, mixed, line-search"):
        ts.Newton(method="mip")


def shuffled() -> ts.Problem:
    """A cube with nodes in no order at all: nearly every block crosses from one piece of the rows to another."""
    mesh = ts.box((1.0, 1.0, 1.0), (14, 14, 14))
    order = np.random.default_rng(2).permutation(mesh.n_nodes)
    nodes = np.empty_like(mesh.nodes)
    nodes[order] = mesh.nodes
    return ts.Problem(
        ts.Mesh(nodes, order[mesh.elements], mesh.element),
        ts.Material(1.0, 0.45),
        None,
        ts.Fixed("left"),
        ts.Force("right", (0.0, -0.01, 0.0)),
    )


@pytest.mark.parametrize("n_pieces", [1, 2, 5])
def test_the_preconditioner_is_positive_however_rows_are_divided(
    n_pieces: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(levels, "_PIECES", n_pieces)
    monkeypatch.setattr(levels, "_SMALLEST_PIECE", 50_000)
    problem = shuffled()
    springs = ts.Springs("isotropic", volume=True)
    potential = springs.potential(problem)
    solver = choice.choose("multigrid", problem.mesh.nodes, problem.loading.held)
    tangent = solver.ready(potential.hessian(problem.mesh.nodes), problem.mesh.nodes)
    assert isinstance(tangent, Preconditioned) and len(tangent.level.bounds) == n_pieces + 1
    check_cycle(tangent, problem)
    path = ts.solve(problem, springs, ts.Newton(load_steps=1, tolerance=1e-8, linear="multigrid"))
    assert path.status is ts.Status.CONVERGED and path.cost is not None
    assert not path.cost.notes and path.cost.linear in MULTIGRID


@pytest.mark.parametrize("name", MULTIGRID)
def test_results_do_not_depend_on_the_number_of_threads(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tangents and V-cycles are the same to the last bit; sums over all nodes differ by rounding."""
    monkeypatch.setattr(vectors, "SMALLEST", 1000)
    problem = shuffled()
    nodes, held = problem.mesh.nodes, problem.loading.held
    residual = np.where(held, 0.0, np.random.default_rng(4).normal(size=held.shape))
    matrices, cycles, solutions, iterations = [], [], [], []
    for count in (1, 2, 3):
        with threads.limited(count):
            solver, matrix = chosen(name, problem), ts.Springs("gaussian").potential(problem).hessian(nodes)
            tangent = solver.ready(matrix, nodes)
            assert isinstance(tangent, Preconditioned) and len(tangent.level.bounds) > 4
            matrices.append(matrix.data)
            cycles.append(tangent.precondition(residual).copy())
            solutions.append(tangent.solve(residual, 1e-9))
            iterations.append(solver.cg_iterations)
    assert all((one == matrices[0]).all() for one in matrices)
    assert all((one == cycles[0]).all() for one in cycles)
    assert len(set(iterations)) == 1
    assert all(np.abs(one - solutions[0]).max() <= 1e-11 * np.abs(solutions[0]).max() for one in solutions)


@pytest.mark.parametrize("per_second", [60, 360, 480, 2000, 10_000])
def test_multigrid_solves_where_the_mass_dominates(per_second: int) -> None:
    """K + M / h^2: where no neighbour is strong, there are no aggregates, and the smoother suffices."""
    mesh = ts.box((0.1, 0.1, 0.1), (9, 9, 9))
    problem = cantilever(mesh, 0.01, ts.Material(young=3e3, poisson=0.25))
    stiffness = ts.Springs("isotropic").potential(problem).hessian(mesh.nodes)
    mass = 1060 * 0.1**3 / mesh.n_nodes
    matrix = sparse.bsr_array(stiffness + sparse.diags_array(np.full(3000, mass * per_second**2)), blocksize=(3, 3))
    matrix.sort_indices()
    held = problem.loading.held
    right = np.where(held, 0.0, np.random.default_rng(0).normal(size=held.shape))
    solver = choice.choose("multigrid", mesh.nodes, held)
    found = solver.ready(matrix, mesh.nodes).solve(right, 1e-9)
    rest = np.where(held, 0.0, (matrix @ found.ravel()).reshape(right.shape) - right)
    assert np.linalg.norm(rest) <= 1e-7 * np.linalg.norm(right)
    assert solver.cg_iterations <= 15


def test_stability_at_rest_is_computed_unless_all_springs_are_positive_and_unstressed() -> None:
    problem = strip()
    plain = ts.Springs(rule="isotropic").potential(problem)
    assert isinstance(plain, ts.SpringNetwork) and plain.semidefinite_at_rest
    negative, pressed = plain.stiffness.copy(), 1.2 * plain.rest_length
    negative[7] *= -0.1
    solver = ts.Newton(load_steps=1, linear="multigrid")
    for network in (
        ts.SpringNetwork(plain.nodes, plain.springs, negative, plain.rest_length),
        ts.SpringNetwork(plain.nodes, plain.springs, plain.stiffness, pressed),
    ):
        assert not network.semidefinite_at_rest
        rest = next(iter(solver.follow(network, problem.loading)))
        assert rest.cost is not None and rest.cost.lanczos_iterations > 0
    rest = next(iter(solver.follow(plain, problem.loading)))
    assert rest.cost is not None and rest.cost.lanczos_iterations == 0 == rest.negative_eigenvalues


def sheared() -> ts.Problem:
    """Quadrilaterals of odd counts, not rectangular: a lattice too."""
    mesh = ts.rectangle((4, 1), (51, 13))
    skew = ts.Mesh(mesh.nodes @ [[1.0, 0.2], [0.3, 1.0]], mesh.elements, mesh.element)
    left, right = (np.flatnonzero(mesh.nodes[:, 0] == x) for x in (0.0, 4.0))
    return ts.Problem(skew, SOFT, THIN, [ts.Fixed(left)], [ts.Force(right, (0.0, -0.3))])


NESTED: dict[str, tuple[Callable[[], ts.Problem], ts.Springs | ts.Fem]] = {
    "even": (lambda: cantilever(ts.box((4, 1, 1), (24, 6, 6)), 40.0), ts.Springs("isotropic")),
    "odd": (lambda: cantilever(ts.box((4, 1, 1), (21, 5, 7)), 40.0), ts.Springs("gaussian")),
    "slender": (lambda: cantilever(ts.rectangle((40, 1), (280, 7)), 2e-3), ts.Springs("isotropic")),
    "sheared": (sheared, ts.Fem("neo-hookean")),
    "quadratic": (
        lambda: cantilever(ts.rectangle((4, 1), (23, 7), "triangle"), 0.3),
        ts.Fem("neo-hookean", element="quadratic"),
    ),
}


@pytest.mark.parametrize("name", NESTED)
def test_geometric_multigrid_takes_six_iterations_at_any_counts(name: str) -> None:
    build, model = NESTED[name]
    problem = build()
    solver = ts.Newton(load_steps=1, tolerance=1e-11, linear="multigrid")
    path, exact = ts.solve(problem, model, solver), ts.solve(problem, model, replace(solver, linear="direct"))
    assert path.cost is not None and path.cost.linear == "geometric multigrid"
    assert path.cost.cg_iterations <= 6.5 * path.cost.newton_iterations
    assert np.abs(exact.states[-1].displacement).max() > 0.1 * problem.mesh.diameter, "it bends"
    apart = np.abs(path.states[-1].displacement - exact.states[-1].displacement).max()
    assert apart <= 1e-8 * np.abs(exact.states[-1].displacement).max()


def test_a_body_with_slits_is_solved_by_aggregates_as_they_are_faster() -> None:
    path = ts.solve(ragged(), ts.Springs(rule="isotropic"), ts.Newton(load_steps=1, linear="multigrid"))
    assert path.cost is not None and path.cost.linear == "multigrid"
    assert path.cost.cg_iterations <= 12 * path.cost.newton_iterations


def test_coarse_matrices_are_those_of_interpolated_displacements() -> None:
    problem = cantilever(ts.box((5, 3, 4), (5, 3, 4)), 1.0)
    nodes, held = problem.mesh.nodes, problem.loading.held.copy()
    held[7, 1] = True
    matrix = ts.Springs("isotropic").potential(problem).hessian(nodes + 0.1 * np.sin(3 * nodes[:, ::-1]))
    (weights, *_) = interpolations(problem.mesh, 60)
    transfer = Interpolation.of(weights, held)
    starts, columns = transfer.pattern(matrix.indptr, matrix.indices)
    coarse = Matrix(starts, columns, np.full((len(columns), 3, 3), np.nan), np.zeros((weights.shape[1], 3), bool))
    transfer.galerkin(Matrix(matrix.indptr, matrix.indices, matrix.data, held), coarse)
    spread = sparse.diags_array((~held).ravel().astype(float)) @ sparse.kron(weights, np.eye(3))
    exact = (spread.T @ matrix @ spread).toarray()
    found = sparse.bsr_array((coarse.data, columns, starts), shape=exact.shape).toarray()
    assert np.abs(found - exact).max() <= 1e-13 * np.abs(exact).max()
    turned = nodes @ [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0], [0.0, 0.0, 1.0]]
    assert np.abs(weights @ transfer.fitted(turned) - turned).max() <= 0.01 * np.abs(turned).max()


@pytest.mark.parametrize("n_threads", [1, 3])
def test_geometric_v_cycle_is_symmetric_and_positive(n_threads: int) -> None:
    problem = cantilever(ts.box((3, 1, 1), (33, 11, 11)), 25.0)
    bent = problem.mesh.nodes + 0.2 * np.sin(problem.mesh.nodes[:, ::-1])
    matrix = ts.Springs("isotropic").potential(problem).projected_hessian(bent)
    threads.set_threads(n_threads)
    try:
        check_cycle(chosen("geometric multigrid", problem).ready(matrix, bent), problem)
    finally:
        threads.set_threads(None)


def test_two_numbers_of_threads_agree() -> None:
    found = []
    for count in (1, 2):
        threads.set_threads(count)
        try:
            path = ts.solve(strip(40), ts.Springs(rule="isotropic"), ts.Newton(1, 1e-12, linear="multigrid"))
            found.append(path.states[-1].positions)
        finally:
            threads.set_threads(None)
    assert np.abs(found[0] - found[1]).max() <= 1e-11
