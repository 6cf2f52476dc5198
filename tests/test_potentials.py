"""What every potential owes the solvers: derivatives, symmetry, frame invariance, balance, a projected Hessian."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from tests.closed_forms import difference_errors, observed_orders
from truespring.models import LAWS, RULES
from truespring.potential import Potential, Projectable, Stressed, Stretched


def body(section: ts.PlaneStress | ts.PlaneStrain, distorted: bool) -> ts.Problem:
    """A block of 3 by 2 squares, its nodes moved by up to a seventh of an element where `distorted`."""
    mesh = ts.rectangle((3.0, 2.0), (3, 2))
    if distorted:
        jitter = np.random.default_rng(5813).uniform(-1 / 7, 1 / 7, mesh.nodes.shape)
        mesh = ts.Mesh(mesh.nodes + jitter, mesh.elements)
    return ts.Problem(
        mesh,
        ts.Material(young=7.0, poisson=0.3),
        section,
        [ts.Fixed(on=[0, 4, 8])],
        # The second load meets a held node too: its support answers for that share.
        [ts.Force(on=[3, 7, 11], total=(0.1, -0.15)), ts.Force(on=[0, 1, 2, 3], total=(0.02, 0.05))],
    )


def truss() -> ts.SpringNetwork:
    """Fifteen springs between six nodes in space, some with a rest length that is not their distance."""
    generator = np.random.default_rng(2718)
    pairs = np.array([(i, j) for i in range(6) for j in range(i)])
    nodes = generator.uniform(-1, 1, (6, 3))
    distance = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
    rest_length = distance * generator.uniform(0.8, 1.2, len(pairs))
    return ts.SpringNetwork(nodes, pairs, generator.uniform(0.5, 5, len(pairs)), rest_length)


@dataclass(frozen=True)
class Case:
    """A potential and what holds for it; `problem` where there is one to solve."""

    potential: Callable[[], Potential]
    model: ts.Springs | ts.Fem | None
    problem: ts.Problem | None
    quadratic: bool
    springs: bool


def _cases() -> dict[str, Case]:
    thin, long = ts.PlaneStress(0.4), ts.PlaneStrain(0.4)
    own = ts.Springs(stiffness=ts.UserStiffness(0.4, 0.3))
    springs = {rule: ts.Springs(rule=rule) for rule in RULES} | {
        "own": own,
        "single": ts.Springs(rule="lloyd", sharing="single"),
    }
    cases = {"truss": Case(truss, None, None, quadratic=False, springs=True)}
    for name, model in springs.items():
        problem = body(thin, distorted=name in ("own", "projected", "least-squares"))
        cases[name] = Case(lambda m=model, p=problem: m.potential(p), model, problem, quadratic=False, springs=True)
    for law in LAWS:
        for section in (thin, long):
            problem, fem = body(section, distorted=True), ts.Fem(law=law)
            name = f"{law}, {type(section).__name__}"
            cases[name] = Case(
                lambda m=fem, p=problem: m.potential(p), fem, problem, quadratic=law == "linear", springs=False
            )
    return cases


CASES = _cases()
SOLVED = [name for name, case in CASES.items() if case.model is not None]
INVARIANT = [name for name, case in CASES.items() if not case.quadratic]


def deformed(nodes: np.ndarray, seed: int, size: float = 0.08) -> np.ndarray:
    """Turned, sheared, pulled and shaken positions: nothing vanishes there."""
    generator = np.random.default_rng(seed)
    dim = nodes.shape[1]
    gradient = np.eye(dim) + generator.uniform(-0.25, 0.25, (dim, dim))
    return nodes @ turn(dim, 0.7).T @ gradient.T + generator.uniform(-size, size, nodes.shape)


def turn(dim: int, angle: float) -> np.ndarray:
    """A rotation in the first two directions, in space followed by one in the last two."""
    matrix = np.eye(dim)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    if dim == 3:
        other = np.eye(3)
        other[1:, 1:] = matrix[:2, :2]
        matrix = other @ matrix
    return matrix


def test_every_rule_and_law_is_here() -> None:
    assert len(CASES) == 1 + len(RULES) + 2 + 2 * len(LAWS) >= 15


STEPS = (2e-2, 1e-2, 5e-3)


@pytest.mark.parametrize("seed", [31, 47])
@pytest.mark.parametrize("name", CASES)
def test_derivatives(name: str, seed: int) -> None:
    """Central differences meet gradient and Hessian with order 2, or exactly where the energy is quadratic."""
    potential = CASES[name].potential()
    positions = deformed(potential.nodes, seed)
    assert np.isfinite(potential.energy(positions))
    directions = np.random.default_rng(seed + 1).normal(size=(6, *positions.shape))
    directions /= np.linalg.norm(directions, axis=(1, 2), keepdims=True)
    gradient, hessian = potential.gradient(positions), potential.hessian(positions)

    def energies(step: float) -> np.ndarray:
        return np.array([potential.energy(positions + step * one) for one in directions])

    def gradients(step: float) -> np.ndarray:
        return np.array([potential.gradient(positions + step * one).ravel() for one in directions])

    slopes = np.array([(gradient * one).sum() for one in directions])
    bends = np.array([hessian @ one.ravel() for one in directions])
    for errors in (difference_errors(energies, slopes, STEPS), difference_errors(gradients, bends, STEPS)):
        if CASES[name].quadratic:
            assert errors.max() < 1e-11
        else:
            assert errors[0] > 1e-8, "there is nothing to see an order in"
            assert observed_orders(errors, STEPS) == pytest.approx(2, abs=0.1)


def test_a_quadratic_energy_has_one_hessian_and_the_others_do_not() -> None:
    for case in CASES.values():
        potential = case.potential()
        at_rest = potential.hessian(potential.nodes).toarray()
        elsewhere = potential.hessian(deformed(potential.nodes, 31)).toarray()
        change = np.linalg.norm(elsewhere - at_rest) / np.linalg.norm(at_rest)
        assert change < 1e-13 if case.quadratic else change > 0.05


@settings(max_examples=5, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
@pytest.mark.parametrize("name", CASES)
def test_the_tangent_is_symmetric_and_blind_to_translation(name: str, seed: int) -> None:
    potential = CASES[name].potential()
    positions = deformed(potential.nodes, seed)
    hessian = potential.hessian(positions).toarray()
    size = np.abs(hessian).max()
    assert size > 0
    assert np.abs(hessian - hessian.T).max() <= 1e-13 * size
    n_nodes, dim = positions.shape
    assert np.abs(hessian @ np.tile(np.eye(dim), (n_nodes, 1))).max() <= 1e-12 * size
    assert (
        np.abs(potential.gradient(positions).sum(axis=0)).max() <= 1e-12 * np.abs(potential.gradient(positions)).max()
    )


@settings(max_examples=5, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), angle=st.floats(-3.1, 3.1), shift=st.floats(-10, 10))
@pytest.mark.parametrize("name", INVARIANT)
def test_energy_does_not_depend_on_the_frame(name: str, seed: int, angle: float, shift: float) -> None:
    potential = CASES[name].potential()
    positions = deformed(potential.nodes, seed)
    n_nodes, dim = positions.shape
    Q = turn(dim, angle)
    seen = positions @ Q.T + shift
    assert potential.energy(seen) == pytest.approx(potential.energy(positions), rel=1e-10)
    assert potential.energy(positions) > 0
    force = potential.gradient(positions)
    assert potential.gradient(seen) == pytest.approx(force @ Q.T, rel=1e-9, abs=1e-10 * np.abs(force).max())
    everywhere = np.kron(np.eye(n_nodes), Q)
    turned = everywhere @ potential.hessian(positions).toarray() @ everywhere.T
    assert potential.hessian(seen).toarray() == pytest.approx(turned, rel=1e-9, abs=1e-10 * np.abs(turned).max())
    moment = torque(positions, force)
    assert np.abs(moment).max() <= 1e-11 * np.abs(force).max() * np.abs(positions).max() * n_nodes


@pytest.mark.parametrize("name", sorted(set(CASES) - set(INVARIANT)))
def test_the_linear_law_takes_a_turn_for_strain(name: str) -> None:
    potential = CASES[name].potential()
    turned = potential.nodes @ turn(2, 0.5).T
    assert potential.energy(turned) > 0.1
    # Small turns leave no first-order trace: the energy grows with the fourth power of the angle.
    small = [potential.energy(potential.nodes @ turn(2, angle).T) for angle in (0.02, 0.01)]
    assert small[0] / small[1] == pytest.approx(16, rel=1e-3)


@pytest.mark.parametrize("name", CASES)
def test_rest_is_free_of_energy_and_force(name: str) -> None:
    potential = CASES[name].potential()
    if name == "truss":  # pre-stressed on purpose
        assert potential.energy(potential.nodes) > 0
        return
    elsewhere = deformed(potential.nodes, 31)
    size = np.abs(potential.gradient(elsewhere)).max()
    assert abs(potential.energy(potential.nodes)) <= 1e-15 * potential.energy(elsewhere)
    assert np.abs(potential.gradient(potential.nodes)).max() <= 1e-14 * size
    values = np.linalg.eigvalsh(potential.hessian(potential.nodes).toarray())
    assert (np.abs(values) < 1e-12 * values[-1]).sum() == 3, "two translations and a rotation, no other mechanism"
    assert values[0] > -1e-12 * values[-1]


def torque(positions: np.ndarray, force: np.ndarray) -> np.ndarray:
    """The moment of nodal forces about the origin [N m], shape (1,) or (3,)."""
    return np.atleast_1d(
        np.cross(
            np.pad(positions, ((0, 0), (0, 3 - positions.shape[1]))), np.pad(force, ((0, 0), (0, 3 - force.shape[1])))
        ).sum(axis=0)
    )


@pytest.mark.parametrize("name", SOLVED)
def test_reactions_balance_the_loads(name: str) -> None:
    """Forces in sum, and moments about the origin: at the deformed state, for the linear law at rest."""
    case = CASES[name]
    assert case.problem is not None and case.model is not None
    path = ts.solve(case.problem, case.model, ts.Newton(load_steps=3, tolerance=1e-12))
    assert path.load_factor == 1.0
    external = case.problem.loading.external_force
    for state in path.states[1:]:
        force = state.reaction + state.load_factor * external
        size = state.load_factor * np.abs(external).sum()
        assert np.abs(force.sum(axis=0)).max() <= 1e-10 * size
        arms = case.problem.mesh.nodes if case.quadratic else state.positions
        assert np.abs(torque(arms, force)).max() <= 1e-10 * size * np.abs(arms).max()
        assert not state.reaction[~case.problem.loading.held].any()
        assert path.potential is not None
        assert path.potential.gradient(state.positions) == pytest.approx(force, abs=1e-10 * size)


def test_the_moment_needs_the_right_arms() -> None:
    """The balance of moments above sees which positions it is taken at."""
    case = CASES["lloyd"]
    assert case.problem is not None and case.model is not None
    state = ts.solve(case.problem, case.model).states[-1]
    force = state.reaction + case.problem.loading.external_force
    assert np.abs(torque(case.problem.mesh.nodes, force)).max() > 1e-4


@settings(max_examples=5, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6), squeeze=st.floats(0.6, 0.8))
@pytest.mark.parametrize("name", CASES)
def test_the_projected_hessian_is_semidefinite(name: str, seed: int, squeeze: float) -> None:
    potential = CASES[name].potential()
    assert isinstance(potential, Projectable)
    positions = deformed(potential.nodes * squeeze, seed)
    projected = potential.projected_hessian(positions).toarray()
    hessian = potential.hessian(positions).toarray()
    values = np.linalg.eigvalsh(projected)
    assert values[0] >= -1e-12 * values[-1]
    assert np.abs(projected - projected.T).max() <= 1e-13 * values[-1]
    # What the projection adds is positive too: it only cuts negative eigenvalues off.
    assert np.linalg.eigvalsh(projected - hessian)[0] >= -1e-12 * values[-1]


@pytest.mark.parametrize("name", INVARIANT)
def test_the_projection_acts_in_compression(name: str) -> None:
    potential = CASES[name].potential()
    squeezed = potential.nodes * 0.6
    hessian, projected = potential.hessian(squeezed).toarray(), potential.projected_hessian(squeezed).toarray()
    assert np.linalg.eigvalsh(hessian)[0] < -1e-3 * np.abs(hessian).max()
    assert np.abs(projected - hessian).max() > 1e-2 * np.abs(hessian).max()


@pytest.mark.parametrize("name", CASES)
def test_the_projection_leaves_a_semidefinite_hessian_alone(name: str) -> None:
    """Pulled in every direction, each spring's Hessian is semidefinite; at rest, each element's is."""
    potential = CASES[name].potential()
    assert isinstance(potential, Projectable)
    positions = potential.nodes * (1.5 if CASES[name].springs else 1.0)
    hessian, projected = potential.hessian(positions), potential.projected_hessian(positions)
    assert projected.toarray() == pytest.approx(hessian.toarray(), abs=1e-12 * abs(hessian).max())


@settings(max_examples=10, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
def test_one_element_or_spring_is_projected_to_the_nearest(seed: int) -> None:
    """The nearest semidefinite matrix cuts off the negative eigenvalues."""
    single = ts.rectangle((1.0, 1.0), (1, 1))
    problem = ts.Problem(
        single,
        ts.Material(1.0, 0.3),
        ts.PlaneStress(1.0),
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(1.0, 0.0))],
    )
    potentials: list[Projectable] = [ts.SpringNetwork([[0.0, 0.0, 0.0], [1.0, 0.5, 0.2]], [[0, 1]], [2.0])]
    potentials += [ts.Fem(law=law).potential(problem) for law in LAWS if LAWS[law].finite]
    for potential in potentials:
        positions = deformed(potential.nodes * 0.7, seed, size=0.05)
        values, vectors = np.linalg.eigh(potential.hessian(positions).toarray())
        nearest = (vectors * np.maximum(values, 0)) @ vectors.T
        assert potential.projected_hessian(positions).toarray() == pytest.approx(nearest, abs=1e-12 * values[-1])


@settings(max_examples=5, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
@pytest.mark.parametrize("name", CASES)
def test_a_given_stress_makes_the_geometric_part(name: str, seed: int) -> None:
    """With the stress of the positions the Hessian is the true one; it is affine in the stress."""
    potential = CASES[name].potential()
    assert isinstance(potential, Stressed)
    positions = deformed(potential.nodes, seed)
    hessian = potential.hessian(positions).toarray()
    size = np.abs(hessian).max()
    stress = potential.stress(positions)
    assert np.abs(stress).max() > 0
    assert potential.hessian(positions, stress).toarray() == pytest.approx(hessian, abs=1e-13 * size)
    material = potential.hessian(positions, 0 * stress).toarray()
    double = potential.hessian(positions, 2 * stress).toarray()
    assert double - hessian == pytest.approx(hessian - material, abs=1e-12 * size)
    if CASES[name].quadratic:
        assert np.abs(hessian - material).max() == 0
    else:
        assert np.abs(hessian - material).max() > 1e-4 * size
        assert np.linalg.eigvalsh(material)[0] >= -1e-12 * size or not CASES[name].springs


@pytest.mark.parametrize("name", CASES)
def test_only_springs_tell_their_stretch(name: str) -> None:
    potential = CASES[name].potential()
    assert isinstance(potential, Potential)
    assert isinstance(potential, Stretched) == CASES[name].springs
    if isinstance(potential, ts.SpringNetwork):
        grown = potential.stretch(potential.nodes * 1.25) / potential.stretch(potential.nodes)
        assert grown == pytest.approx(np.full(len(potential.springs), 1.25))
        tension = potential.stiffness * potential.rest_length * (potential.stretch(potential.nodes * 1.25) - 1)
        assert potential.stress(potential.nodes * 1.25) == pytest.approx(tension)


@pytest.mark.parametrize("law", [law for law in LAWS if LAWS[law].barrier])
def test_a_barrier_refuses_inversion(law: str) -> None:
    potential = CASES[f"{law}, PlaneStress"].potential()
    mirrored = potential.nodes * np.array([-1.0, 1.0])
    assert potential.energy(mirrored) == np.inf
    flattened = [potential.energy(potential.nodes * np.array([1.0, share])) for share in (1e-1, 1e-3, 1e-5)]
    assert flattened == sorted(flattened)
    assert flattened[-1] < np.inf


@pytest.mark.parametrize("name", ["lloyd", "saint-venant-kirchhoff, PlaneStress"])
def test_lengths_alone_do_not_see_a_mirror_image(name: str) -> None:
    potential = CASES[name].potential()
    assert potential.energy(potential.nodes * np.array([-1.0, 1.0])) == pytest.approx(0, abs=1e-20)
