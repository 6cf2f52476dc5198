"""Multigrid beside exact changes of volume of nearly incompressible bodies, against factorisations."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

import truespring as ts
from tests.test_linear import cantilever
from truespring.linear import choice, scalar
from truespring.linear.direct import Direct
from truespring.linear.gradients import IndefiniteError
from truespring.linear.pressure import PressureMultigrid, Separated
from truespring.linear.scalar import Scalar
from truespring.mesh import interpolations
from truespring.potential import Stressed, Volumetric
from truespring.problem import Problem

MODELS = {"gaussian": ts.Springs("gaussian"), "fem": ts.Fem("neo-hookean")}


def block(poisson: float, element: str = "hexahedron") -> Problem:
    """A block bent by an eighth of its length."""
    return cantilever(
        ts.box((4, 1, 1), (20, 5, 5) if element == "hexahedron" else (8, 2, 2), element=element),
        25.0,
        ts.Material(1e4, poisson),
    )


def bent(nodes: np.ndarray) -> np.ndarray:
    """Return nodes of a body that is bent, and not quite at constant volume."""
    x, y, z = nodes.T
    return nodes + np.stack([0.1 * x * (0.5 - y), 0.05 * x**2, 0.002 * x * z], axis=1)


def prepared(problem: Problem, model: str, positions: np.ndarray) -> tuple[PressureMultigrid, object, object]:
    potential = MODELS[model].potential(problem)
    assert isinstance(potential, Volumetric) and isinstance(potential, Stressed)
    held, mesh = problem.loading.held, problem.mesh
    coarser = (lambda: interpolations(mesh, 60)) if mesh.element == "hexahedron" else tuple
    solver = choice.choose("multigrid", potential.nodes, held, coarser, potential.volume_stiffness)
    assert isinstance(solver, PressureMultigrid)
    # The stress of the undeformed body: that of these positions is far from a balance.
    matrix = potential.hessian(positions, potential.stress(potential.nodes))
    return solver, matrix, Direct(held, "scipy")


QUADRATIC = {
    "quadratic gaussian": ts.Springs("gaussian", element="quadratic"),
    "quadratic fem": ts.Fem("neo-hookean", element="quadratic-mean-dilatation"),
}
OTHERS = QUADRATIC | {"linear fem": ts.Fem("linear"), "volume springs": ts.Springs("isotropic", volume=True)}


@pytest.mark.parametrize("name", [*MODELS, *OTHERS])
def test_the_volume_is_a_part_of_the_tangent(name: str) -> None:
    """The difference of two tangents, of another bulk modulus and of the same stress, is the stiffness of the cells."""
    model = (MODELS | OTHERS | {"gaussian": ts.Springs("gaussian", hourglass=1.0)})[name]
    materials = [ts.Material.from_moduli(1.0, lam + 2 / 3) for lam in (20.0, 40.0)]
    mesh = ts.box((4, 1, 1), (4, 2, 2), "tetrahedron") if name in QUADRATIC else ts.box((4, 1, 1), (8, 2, 2))
    problem = cantilever(mesh, 25.0)
    soft, stiff = (model.potential(replace(problem, material=one)) for one in materials)
    positions = bent(soft.nodes)
    assert isinstance(soft, Volumetric) and isinstance(stiff, Volumetric) and isinstance(soft, Stressed)
    assert isinstance(stiff, Stressed)
    stress = soft.stress(positions)
    difference = (stiff.hessian(positions, stress) - soft.hessian(positions, stress)).toarray()
    ((less,), (cells,)) = (one.volume_stiffness(positions) for one in (soft, stiff))
    assert (cells.stiffness - less.stiffness) / cells.shear == pytest.approx(20.0, rel=0.4)
    if name != "volume springs":  # the springs have a bulk modulus, and the term is not logarithmic
        assert cells.stiffness / cells.shear == pytest.approx(40.0) and less.stiffness / less.shear == pytest.approx(20)
    expected = np.zeros_like(difference)
    for nodes, slope, more in zip(cells.elements, cells.slope, cells.stiffness - less.stiffness, strict=True):
        place = (3 * nodes[:, None] + np.arange(3)).ravel()
        expected[np.ix_(place, place)] += more * np.outer(slope, slope)
    assert np.abs(difference - expected).max() < 1e-12 * np.abs(difference).max()


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("poisson", [0.49, 0.4999])
def test_the_solution_is_that_of_a_factorisation(model: str, poisson: float) -> None:
    problem = block(poisson)
    for positions in (problem.mesh.nodes, bent(problem.mesh.nodes)):
        solver, matrix, direct = prepared(problem, model, positions)
        tangent, factors = solver.ready(matrix, positions), direct.ready(matrix, positions)
        assert isinstance(tangent, Separated)
        assert tangent.negative_eigenvalues == factors.negative_eigenvalues == 0
        assert solver.lanczos_iterations <= 15
        right = np.where(problem.loading.held, 0.0, problem.loading.external_force)
        wanted, found = factors.solve(right), tangent.solve(right, 1e-9)
        # Blocks of the finest level are in single precision.
        assert np.abs(found - wanted).max() <= 5e-5 * np.abs(wanted).max()


@pytest.mark.parametrize("model", MODELS)
def test_iterations_do_not_depend_on_poissons_ratio(model: str) -> None:
    """Conjugate gradients of usual multigrid take 60 to more than 150."""
    counts = []
    for poisson in (0.496, 0.499, 0.4999, 0.49999):
        problem = block(poisson)
        solver, matrix, _ = prepared(problem, model, problem.mesh.nodes)
        solver.ready(matrix, problem.mesh.nodes).solve(problem.loading.external_force, 2e-3)
        counts.append(solver.cg_iterations)
    assert max(counts) <= 15, counts


def test_large_scalar_matrices_are_solved_by_conjugate_gradients(monkeypatch: pytest.MonkeyPatch) -> None:
    """Against the factorisation, which smaller ones have; twice the same to the last bit."""
    line = sparse.diags_array([-np.ones(19), 2 * np.ones(20), -np.ones(19)], offsets=[-1, 0, 1])
    eye = sparse.eye_array(20)
    square = sparse.csr_array(sparse.kron(line, eye) + sparse.kron(eye, line) + 1e-3 * sparse.eye_array(400)) * 1e-12
    right = np.random.default_rng(3).normal(size=400)
    wanted = Scalar(square).solve(right)
    assert square @ wanted == pytest.approx(right, abs=1e-9)
    monkeypatch.setattr(scalar, "_DIRECT", 0)
    found = Scalar(square).solve(right)
    assert 0 < np.linalg.norm(found - wanted) <= 1e-3 * np.linalg.norm(wanted)
    assert (Scalar(square).solve(right) == found).all()


@pytest.mark.parametrize("name", [*MODELS, *OTHERS, "gaussian tetrahedra"])
def test_a_body_of_almost_constant_volume_is_solved_without_factorisation(name: str) -> None:
    model = (MODELS | OTHERS).get(name, MODELS["gaussian"])
    problem = block(0.4999, "tetrahedron" if name in QUADRATIC or name not in MODELS | OTHERS else "hexahedron")
    path, direct = (
        ts.solve(problem, model, ts.Newton(load_steps=2, tolerance=1e-11, linear=linear))
        for linear in ("multigrid", "scipy")
    )
    assert path.status is ts.Status.CONVERGED
    assert path.cost is not None and path.cost.linear.endswith("with pressures") and not path.cost.notes
    tip = direct.states[-1].displacement
    assert np.abs(path.states[-1].displacement - tip).max() <= 1e-8 * np.abs(tip).max()


@pytest.mark.parametrize(("poisson", "factor"), [(0.475, 1.2), (0.45, 15.0)], ids=["eigenvalue", "diagonal"])
def test_a_stable_tangent_is_stable_though_the_rest_of_it_is_not(poisson: float, factor: float) -> None:
    """Cells are said to be stiffer than they are: without them, the tangent has a negative eigenvalue or diagonal."""
    problem = block(poisson)
    potential, held = MODELS["gaussian"].potential(problem), problem.loading.held
    assert isinstance(potential, Volumetric)
    matrix, cells = potential.hessian(potential.nodes), potential.volume_stiffness(potential.nodes)
    stiffer = [one._replace(stiffness=factor * one.stiffness) for one in cells]
    solver = choice.choose("multigrid", potential.nodes, held, volumes=lambda _: stiffer)
    assert isinstance(solver, PressureMultigrid)
    rest = solver.sheared(matrix, potential.nodes, stiffer)
    assert rest is None if factor > 2 else rest is not None and rest[0].negative_eigenvalues == 1
    tangent, factors = solver.ready(matrix, potential.nodes), Direct(held, "scipy").ready(matrix, potential.nodes)
    assert isinstance(tangent, Separated)
    assert tangent.negative_eigenvalues == factors.negative_eigenvalues == 0
    right = problem.loading.external_force
    found, wanted = tangent.solve(right, 1e-9), factors.solve(right)
    assert np.abs(found - wanted).max() <= 5e-5 * np.abs(wanted).max()


def test_an_unstable_state_is_seen_as_without_pressures() -> None:
    """A block pressed to two thirds of its length by its own stress, kept in place."""
    problem = block(0.499)
    potential = MODELS["gaussian"].potential(problem)
    positions = problem.mesh.nodes * [0.6, 1.29, 1.29]
    matrix = potential.hessian(positions)
    solver = choice.choose("multigrid", potential.nodes, problem.loading.held, volumes=potential.volume_stiffness)
    tangent = solver.ready(matrix, positions)
    assert Direct(problem.loading.held, "scipy").ready(matrix, positions).negative_eigenvalues
    assert tangent.negative_eigenvalues == 1
    start = np.where(problem.loading.held, 0.0, np.random.default_rng(1).normal(size=positions.shape))
    with pytest.raises(IndefiniteError):
        tangent.solve(start, 1e-8)
