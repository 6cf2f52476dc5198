"""What every potential owes the solvers: derivatives, symmetry, frame invariance, balance, a projected Hessian.

The cases come from the tables: every rule on every kind of element that it is made for, every law on every element.
"""

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import truespring as ts
from tests.closed_forms import difference_errors, material_of, observed_orders
from tests.meshes import plane_of_two, solid_of_four
from tests.near import near
from truespring import assembly
from truespring.arrays import Floats
from truespring.conditions import Refined
from truespring.kernels.threads import set_threads
from truespring.mesh.kinds import ELEMENT_KINDS
from truespring.models import (
    ELEMENTS,
    LAWS,
    RULES,
    Model,
    VolumeSprings,
    fem_potential,
)
from truespring.models.fem_potential import FemPotential
from truespring.models.gaussian_rule import GAUSSIAN_LAWS
from truespring.models.heml import HEML_LAWS
from truespring.models.mass_tensor import TENSOR_LAWS, NonlinearTensors
from truespring.models.summed import SummedElements
from truespring.models.terzopoulos import BOUNDARIES
from truespring.potential import Potential, Projectable, Stressed, Stretched

THIN, LONG = ts.PlaneStress(0.4), ts.PlaneStrain(0.4)
MIXED = ("plane of two kinds", "solid of four kinds")
BODIES = (*(element for element, kind in ELEMENT_KINDS.items() if kind.dim > 1), *MIXED)
SEEDS = (3, 271, 31415)


@dataclass(frozen=True)
class Case:
    """A potential and what holds for it.

    Attributes:
        build: makes the potential.
        model, problem: what to solve; None for a plain network.
        quadratic: the energy is quadratic, and not frame invariant.
        infinitesimal: a part of the body takes a turn for strain: not frame invariant, no balance of moments.
        springs: it has `stretch`.
        stressed: it takes a stress for its geometric part.
        geometric: a stress given to the Hessian makes its geometric part.
        quadratic_stress: the stress is at most quadratic in the positions.
        semidefinite: of springs, the Hessian without stress is semidefinite.
        cuts: the projection does no more than cut negative eigenvalues off, of springs or of elements; in Gaussian
            springs it reduces the pressure.
        barrier: an inverted element has infinite energy.
        ends: the law ends at a finite stretch.
        cancels: the energy at rest is a difference of terms that are not zero.
        mirrored: a mirror image has no energy: only lengths, or C, are seen.
    """

    build: Callable[[], Potential]
    model: Model | None = None
    problem: ts.Problem | None = None
    quadratic: bool = False
    infinitesimal: bool = False
    springs: bool = False
    stressed: bool = True
    geometric: bool = True
    quadratic_stress: bool = False
    semidefinite: bool = True
    cuts: bool = True
    barrier: bool = False
    ends: bool = False
    cancels: bool = False
    mirrored: bool = False


def shape(element: str) -> ts.Mesh:
    """A small body of elements of a kind, each of about unit size."""
    match element:
        case "triangle":
            return ts.rectangle((2.0, 2.0), (2, 2), "triangle", "alternating")
        case "quadrilateral":
            return ts.rectangle((3.0, 2.0), (3, 2))
        case "tetrahedron":
            return ts.box((1.5, 1.5, 1.5), (1, 1, 1), "tetrahedron")
        case "wedge":
            return ts.box((2.0, 1.0, 1.0), (2, 1, 1), "wedge")
        case "pyramid":
            return ts.box((4.0, 2.0, 2.0), (2, 1, 1), "pyramid")
        case "plane of two kinds":
            return plane_of_two((3.0, 2.0), (3, 2))
        case "solid of four kinds":
            return solid_of_four(2.0)
        case _:
            return ts.box((2.0, 1.0, 1.0), (2, 1, 1))


def body(
    mesh: ts.Mesh,
    section: ts.PlaneStress | ts.PlaneStrain = THIN,
    distorted: bool = True,
    poisson: float = 0.3,
    law: str = "linear",
) -> ts.Problem:
    """A body held on the left and pulled on the right; its nodes moved by up to a seventh where `distorted`."""
    x, y = mesh.nodes[:, 0], mesh.nodes[:, 1]
    jitter = np.random.default_rng(5813).uniform(-1 / 7, 1 / 7, mesh.nodes.shape) if distorted else 0.0
    pull, more = np.array([0.1, -0.15, 0.06]), np.array([0.02, 0.05, -0.03])
    return ts.Problem(
        ts.Mesh(mesh.nodes + jitter, mesh.elements, mesh.element),
        material_of(law, 7.0, poisson),
        section if mesh.dim == 2 else None,
        [ts.Fixed(on=np.flatnonzero(x == 0))],
        # The second load meets held nodes too: their supports answer for that share.
        [
            ts.Force(np.flatnonzero(x == mesh.upper[0]), pull[: mesh.dim].tolist()),
            ts.Force(np.flatnonzero(y == 0), more[: mesh.dim].tolist()),
        ],
    )


def truss(law: str = "straight") -> ts.SpringNetwork:
    """Fifteen springs between six nodes in space, some with a rest length that is not their distance."""
    generator = np.random.default_rng(2718)
    pairs = np.array([(i, j) for i in range(6) for j in range(i)])
    nodes = generator.uniform(-1, 1, (6, 3))
    distance = np.linalg.norm(nodes[pairs[:, 0]] - nodes[pairs[:, 1]], axis=1)
    rest_length = distance * generator.uniform(0.8, 1.2, len(pairs))
    return ts.SpringNetwork(nodes, pairs, generator.uniform(0.5, 5, len(pairs)), rest_length, law)


def _spring_case(model: ts.Springs, problem: ts.Problem) -> Case:
    plain = not model.volume
    return Case(
        lambda: model.potential(problem),
        model,
        problem,
        springs=True,
        quadratic_stress=model.coupled,
        cuts=plain,
        mirrored=plain,
    )


def _gaussian_case(model: ts.Springs, problem: ts.Problem) -> Case:
    law = LAWS[model.law or "neo-hookean"]
    return Case(
        lambda: model.potential(problem),
        model,
        problem,
        springs=True,
        semidefinite=law.constant_springs,
        cuts=False,
        barrier=True,
        ends="jm" in law.constants,
        cancels=True,
    )


def _springs() -> dict[str, Case]:
    """Every rule on every element that it is for: distorted where it stands that."""
    cases = {}
    for rule, entry in RULES.items():
        for element in (*entry.elements, *(name for name in MIXED if entry.takes(shape(name)))):
            if (rule, element) == ("least-squares", "solid of four kinds"):
                continue  # a spring is negative where wedges and pyramids meet
            model = ts.Springs(rule)
            regular = element in entry.shapes or (element in MIXED and bool(entry.shapes))
            regular |= element in ("pyramid", *MIXED) and not entry.coupled
            problem = body(shape(element), distorted=not regular)
            make = _gaussian_case if rule == "gaussian" else _spring_case
            cases[f"{rule}, {element}"] = make(model, problem)
    square, cube = body(shape("quadrilateral"), distorted=False), body(shape("hexahedron"), distorted=False)
    bricks = ts.rectangle((3.6, 2.0), (3, 2)), ts.box((2.0, 1.1, 0.9), (2, 1, 1))
    body_centred = ts.box((2.4, 2.4, 2.4), (2, 2, 2), "bcc-tetrahedron")
    more = {
        "own, quadrilateral": (ts.Springs(stiffness=ts.UserStiffness(0.4, 0.3)), body(shape("quadrilateral"))),
        "own, hexahedron": (ts.Springs(stiffness=ts.UserStiffness(0.2, 0.1, 0.1)), body(shape("hexahedron"))),
        "lloyd, single": (ts.Springs("lloyd", sharing="single"), square),
        "isotropic, rectangles": (ts.Springs("isotropic"), body(bricks[0], distorted=False)),
        "isotropic, bricks": (ts.Springs("isotropic"), body(bricks[1], distorted=False)),
        "biquadratic, plane strain": (ts.Springs("biquadratic"), body(shape("quadrilateral"), LONG)),
        "volume, squares": (ts.Springs("isotropic", volume=True), body(bricks[0], distorted=False, poisson=0.45)),
        "volume, plane strain": (ts.Springs("isotropic", volume=True), body(square.mesh, LONG, False)),
        "volume, cubes": (ts.Springs("isotropic", volume=True), body(cube.mesh, distorted=False, poisson=0.4)),
        "volume, below Cauchy's": (ts.Springs("isotropic", volume=True), body(cube.mesh, distorted=False, poisson=0.1)),
        "isotropic, neo-hookean, squares": (ts.Springs("isotropic", law="neo-hookean"), square),
        "volume, neo-hookean, cubes": (
            ts.Springs("isotropic", volume=True, law="neo-hookean"),
            body(cube.mesh, distorted=False, poisson=0.4),
        ),
        "volume, tetrahedra": (ts.Springs("lloyd", volume=True), body(body_centred, distorted=False, poisson=0.4)),
    }
    return cases | {name: _spring_case(*pair) for name, pair in more.items()}


def _gaussian() -> dict[str, Case]:
    """Every law of Gaussian springs in the plane and in space, hourglass modes, and springs of second order."""
    flat, solid, two = shape("quadrilateral"), shape("hexahedron"), shape("plane of two kinds")
    cases = {
        "hourglass": (ts.Springs("gaussian", hourglass=1.4), body(solid)),
        "quadratic, plane stress": (ts.Springs("gaussian", element="quadratic"), body(shape("triangle"))),
        "quadratic, plane strain": (ts.Springs("gaussian", element="quadratic"), body(shape("triangle"), LONG)),
        "quadratic, tetrahedra": (ts.Springs("gaussian", element="quadratic"), body(shape("tetrahedron"))),
    }
    for law in GAUSSIAN_LAWS:
        model = ts.Springs("gaussian", law=law)
        cases[f"{law}, plane strain"] = model, body(flat, LONG, law=law)
        if not LAWS[law].constant_springs:
            cases |= {
                f"{law}, plane stress": (model, body(flat, law=law)),
                f"{law}, space": (model, body(solid, law=law)),
            }
            cases[f"{law}, two kinds"] = model, body(two, law=law)
    return {f"gaussian, {name}": _gaussian_case(*pair) for name, pair in cases.items()}


def _fem() -> dict[str, Case]:
    """Every law on every element of every kind, in both sections of the plane."""
    cases = {}
    for law, entry in LAWS.items():
        for kind in BODIES:
            for section in (THIN, LONG) if shape(kind).dim == 2 else (THIN,):
                problem = body(shape(kind), section, law=law)
                for element in ELEMENTS:
                    model = ts.Fem(law, element)
                    try:
                        model.chosen_element(problem)
                    except ts.TruespringError:
                        continue
                    mean = element == "mean-dilatation"
                    name = f"{law}, {kind}, {element}" + (", plane strain" if section is LONG else "")
                    cases[name] = Case(
                        lambda model=model, problem=problem: model.potential(problem),
                        model,
                        problem,
                        quadratic=not entry.finite,
                        geometric=entry.finite,
                        quadratic_stress=entry.quadratic and not (entry.finite and mean),
                        barrier=entry.finite and (entry.barrier or mean),
                        ends="jm" in entry.constants,
                        cancels=entry.invariants is not None and not entry.constant_springs,
                        mirrored=entry.finite and not entry.barrier and not mean,
                    )
    return cases


def _links_and_tensors() -> dict[str, Case]:
    """HEML and the mass-tensor method by every law on every element that they go with."""
    cases = {}
    models = [ts.Heml(law) for law in HEML_LAWS] + [ts.MassTensor(law) for law in TENSOR_LAWS]
    for model in models:
        law, links = LAWS[model.law], isinstance(model, ts.Heml)
        for kind in BODIES:
            for section in (THIN, LONG) if shape(kind).dim == 2 else (THIN,):
                problem = body(shape(kind), section, law=model.law)
                try:
                    model.potential(problem)
                except ts.TruespringError:
                    continue
                name = f"{model.kind} {model.law}, {kind}" + (", plane strain" if section is LONG else "")
                cases[name] = Case(
                    lambda model=model, problem=problem: model.potential(problem),
                    model,
                    problem,
                    quadratic=not law.finite,
                    springs=links,
                    stressed=law.finite,
                    quadratic_stress=law.quadratic,
                    barrier=law.barrier,
                    ends="jm" in law.constants,
                    cancels=law.invariants is not None and not law.constant_springs,
                    mirrored=law.finite and not law.barrier,
                )
    return cases


def _metric() -> dict[str, Case]:
    """Terzopoulos' model by both rules of the boundary, in both sections of the plane and in space, two materials."""
    plane, space = ts.rectangle((3.6, 2.0), (3, 2)), ts.box((2.0, 1.1, 0.9), (2, 1, 1))
    cases = {}
    for boundary in BOUNDARIES:
        for name, mesh, section in (("plane", plane, THIN), ("plane strain", plane, LONG), ("space", space, THIN)):
            problem = replace(body(mesh, section, False), regions=[ts.Region([0], ts.Material(11.0, 0.1))])
            model = ts.Terzopoulos(boundary)
            cases[f"terzopoulos, {boundary}, {name}"] = Case(
                lambda model=model, problem=problem: model.potential(problem),
                model,
                problem,
                quadratic_stress=True,
                mirrored=True,
            )
    return cases


def _blocks() -> dict[str, Case]:
    """Boundary elements with a node inside, beside springs: distorted, at rest and turning with the block."""
    squares, triangles = ts.rectangle((4.0, 3.0), (4, 3)), ts.rectangle((3.0, 2.0), (3, 2), "triangle", "alternating")
    cubes = ts.box((3.0, 2.0, 2.0), (3, 2, 2))
    of_squares, of_cubes = [0, 1, 4, 5, 8, 9], [0, 1, 3, 4, 6, 7, 9, 10]
    kinds = {
        "squares": (squares, THIN, of_squares, "projected"),
        "plane strain": (squares, LONG, of_squares, "least-squares"),
        "triangles": (triangles, THIN, [0, 1, 2, 3, 6, 7, 8, 9], "lloyd"),
        "cubes": (cubes, THIN, of_cubes, "least-squares"),
    }
    cases = {}
    for name, (mesh, section, block, rule) in kinds.items():
        for corotated in (False, True):
            model, problem = ts.BemSprings(block, rule, corotated), body(mesh, section)
            cases[f"bem-springs, {name}{', corotated' if corotated else ''}"] = Case(
                lambda model=model, problem=problem: model.potential(problem),
                model,
                problem,
                infinitesimal=not corotated,
                springs=True,
                cuts=not corotated,
            )
    return cases


CASES = {
    "truss": Case(truss, springs=True),
    "truss, neo-hookean": Case(lambda: truss("neo-hookean"), springs=True),
    **_springs(),
    **_gaussian(),
    **_fem(),
    **_links_and_tensors(),
    **_metric(),
    **_blocks(),
}
# What bodies of several kinds store is a sum of what each kind stores, and a law is the same function on all elements:
# neo-Hookean bodies of several kinds, and laws with constants on the bodies of HELD, are held every time, all others in
# verification.
HELD = {
    ("quadrilateral", "linear", ""),
    ("quadrilateral", "mean-dilatation", ", plane strain"),
    ("hexahedron", "linear", ""),
    ("tetrahedron", "quadratic-mean-dilatation", ""),
}
SECTIONS = ("", ", plane strain")
LATER = {
    f"{law}, {kinds}, {element}{section}"
    for law, entry in LAWS.items()
    for kinds in BODIES
    for element in ELEMENTS
    for section in SECTIONS
    if (kinds in MIXED and law != "neo-hookean") or (entry.constants and (kinds, element, section) not in HELD)
} | {
    f"heml {law}, {kind}{section}"
    for law, entry in LAWS.items()
    for kind in ("triangle", "tetrahedron")
    for section in SECTIONS
    if entry.constants and (kind, section) != ("triangle", "")
}
assert LATER & CASES.keys()


def marked(names: Iterable[str]) -> list[Any]:
    """Names as parameters, those of LATER for verification."""
    return [pytest.param(name, marks=pytest.mark.verification) if name in LATER else name for name in names]


EVERY = marked(CASES)
SOLVED = [name for name, case in CASES.items() if case.model is not None and name not in LATER]
STRESSED = marked(name for name, case in CASES.items() if case.stressed)
INVARIANT = marked(name for name, case in CASES.items() if not case.quadratic and not case.infinitesimal)


@cache
def potential_of(name: str) -> Potential:
    return CASES[name].build()


def deformed(nodes: Floats, seed: int, size: float = 0.06) -> Floats:
    """Turned, sheared, pulled and shaken positions: nothing vanishes there."""
    generator = np.random.default_rng(seed)
    dim = nodes.shape[1]
    gradient = np.eye(dim) + generator.uniform(-0.25, 0.25, (dim, dim))
    return np.asarray(nodes @ turn(dim, 0.7).T @ gradient.T + generator.uniform(-size, size, nodes.shape))


def turn(dim: int, angle: float) -> Floats:
    """A rotation in the first two directions, in space followed by one in the last two."""
    matrix = np.eye(dim)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    if dim == 3:
        other = np.eye(3)
        other[1:, 1:] = matrix[:2, :2]
        matrix = other @ matrix
    return matrix


def test_every_rule_law_and_element_is_here() -> None:
    rules = sum(len(entry.elements) for entry in RULES.values()) + 8 + len(_gaussian())
    # Two interpolations on each of six kinds of element and two bodies of several, the plane ones in two sections; on
    # triangles in plane strain and on tetrahedra another.
    bodies = 3 * 2 + 5
    laws = len(LAWS) * 2 * bodies + 2 * sum(law.trace is not None for law in LAWS.values())
    # HEML: one law on every element, the others on simplices; mass-tensor: the linear law likewise, another on these.
    links, tensors = bodies + 3 * (len(HEML_LAWS) - 1), bodies + 3
    assert len(CASES) == 2 + rules + 13 + laws + links + tensors + 3 * len(BOUNDARIES) + 8
    assert rules >= 19 and laws >= 48
    assert {type(potential_of(name)).__name__ for name in CASES} == {
        *("SpringNetwork", "BiquadraticSprings", "VolumeSprings"),
        *("GaussianElements", "SummedGaussian", "_AtPoints", "_AtMean"),
        *("FemPotential", "MeanDilatationPotential", "QuadraticPotential", "QuadraticMeanPotential"),
        "MetricPotential",
        *("SummedElements", "SummedLinks", "HyperelasticLinks", "LinearTensors", "NonlinearTensors", "BlockSprings"),
    }


STEPS = (2e-2, 1e-2, 5e-3)


@pytest.mark.parametrize("name", EVERY)
def test_derivatives(name: str) -> None:
    """Central differences meet gradient and Hessian with order 2, or exactly where the energy is quadratic."""
    potential = potential_of(name)
    positions = deformed(potential.nodes, 31)
    assert np.isfinite(potential.energy(positions))
    directions = np.random.default_rng(32).normal(size=(6, *positions.shape))
    directions /= np.linalg.norm(directions, axis=(1, 2), keepdims=True)
    gradient, hessian = potential.gradient(positions), potential.hessian(positions)

    def energies(step: float) -> Floats:
        return np.array([potential.energy(positions + step * one) for one in directions])

    def gradients(step: float) -> Floats:
        return np.array([potential.gradient(positions + step * one).ravel() for one in directions])

    slopes = np.array([(gradient * one).sum() for one in directions])
    bends = np.array([hessian @ one.ravel() for one in directions])
    for errors in (difference_errors(energies, slopes, STEPS), difference_errors(gradients, bends, STEPS)):
        if CASES[name].quadratic:
            assert errors.max() < 1e-11
        else:
            assert errors[0] > 1e-8, "there is nothing to see an order in"
            assert observed_orders(errors, STEPS) == near(2, abs=0.1)


@pytest.mark.parametrize("name", EVERY)
def test_a_quadratic_energy_has_one_hessian_and_the_others_do_not(name: str) -> None:
    potential = potential_of(name)
    at_rest = potential.hessian(potential.nodes).toarray()
    elsewhere = potential.hessian(deformed(potential.nodes, 31)).toarray()
    change = np.linalg.norm(elsewhere - at_rest) / np.linalg.norm(at_rest)
    assert change < 1e-13 if CASES[name].quadratic else change > 0.05


@pytest.mark.parametrize("name", EVERY)
def test_the_tangent_is_symmetric_and_blind_to_translation(name: str) -> None:
    potential = potential_of(name)
    for seed in SEEDS:
        positions = deformed(potential.nodes, seed)
        hessian = potential.hessian(positions).toarray()
        size = np.abs(hessian).max()
        assert size > 0
        assert np.abs(hessian - hessian.T).max() <= 1e-13 * size
        n_nodes, dim = positions.shape
        assert np.abs(hessian @ np.tile(np.eye(dim), (n_nodes, 1))).max() <= 1e-12 * size
        force = potential.gradient(positions)
        assert np.abs(force.sum(axis=0)).max() <= 1e-12 * np.abs(force).max()


@pytest.mark.parametrize("name", INVARIANT)
def test_energy_does_not_depend_on_the_frame(name: str) -> None:
    potential = potential_of(name)
    for seed, angle, shift in zip(SEEDS, (0.9, -2.2, 3.1), (-10.0, 4.0, 0.3), strict=True):
        positions = deformed(potential.nodes, seed)
        n_nodes, dim = positions.shape
        Q = turn(dim, angle)
        seen = positions @ Q.T + shift
        assert potential.energy(seen) == near(potential.energy(positions), rel=1e-10)
        assert potential.energy(positions) > 0
        force = potential.gradient(positions)
        assert potential.gradient(seen) == near(force @ Q.T, rel=1e-9, abs=1e-10 * np.abs(force).max())
        everywhere = np.kron(np.eye(n_nodes), Q)
        turned = everywhere @ potential.hessian(positions).toarray() @ everywhere.T
        assert potential.hessian(seen).toarray() == near(turned, rel=1e-9, abs=1e-10 * np.abs(turned).max())
        moment = torque(positions, force)
        assert np.abs(moment).max() <= 1e-11 * np.abs(force).max() * np.abs(positions).max() * n_nodes


@pytest.mark.parametrize("name", marked(name for name, case in CASES.items() if case.quadratic or case.infinitesimal))
def test_the_linear_law_takes_a_turn_for_strain(name: str) -> None:
    potential = potential_of(name)
    nodes = potential.nodes
    assert potential.energy(nodes @ turn(nodes.shape[1], 0.5).T) > 0.1
    # Small turns leave no first-order trace: the energy grows with the fourth power of the angle.
    small = [potential.energy(nodes @ turn(nodes.shape[1], angle).T) for angle in (0.02, 0.01)]
    assert small[0] / small[1] == near(16, rel=1e-3)


@pytest.mark.parametrize("name", EVERY)
def test_rest_is_free_of_energy_and_force(name: str) -> None:
    potential = potential_of(name)
    if name.startswith("truss"):  # pre-stressed on purpose
        assert potential.energy(potential.nodes) > 0
        return
    elsewhere = deformed(potential.nodes, 31)
    size = np.abs(potential.gradient(elsewhere)).max()
    rounding = 1e-14 if CASES[name].cancels else 1e-15
    assert abs(potential.energy(potential.nodes)) <= rounding * potential.energy(elsewhere)
    assert np.abs(potential.gradient(potential.nodes)).max() <= 1e-14 * size
    values = np.linalg.eigvalsh(potential.hessian(potential.nodes).toarray())
    rigid = {2: 3, 3: 6}[potential.nodes.shape[1]]
    assert (np.abs(values) < 1e-12 * values[-1]).sum() == rigid, "translations and rotations, no other mechanism"
    assert values[0] > -1e-12 * values[-1]
    assert values[rigid] > 1e-5 * values[-1]


def torque(positions: Floats, force: Floats) -> Floats:
    """The moment of nodal forces about the origin [N m], shape (3,)."""
    missing = ((0, 0), (0, 3 - positions.shape[1]))
    return np.asarray(np.cross(np.pad(positions, missing), np.pad(force, missing)).sum(axis=0))


@pytest.mark.parametrize("name", SOLVED)
def test_reactions_balance_the_loads(name: str) -> None:
    """Forces in sum, and moments about the origin: at the deformed state, for the linear law at rest."""
    case = CASES[name]
    assert case.problem is not None and case.model is not None
    path = ts.solve(case.problem, case.model, ts.Newton(load_steps=2, tolerance=1e-12))
    assert path.load_factor == 1.0
    potential = path.potential
    assert potential is not None
    loading = potential.loading if isinstance(potential, Refined) else case.problem.loading
    total = case.problem.loading.external_force.sum(axis=0)
    assert loading.external_force.sum(axis=0) == near(total, rel=1e-12)
    for state in path.states[1:]:
        inner = potential.gradient(state.all_positions)
        size = state.load_factor * np.abs(loading.external_force).sum()
        unbalanced = inner - state.load_factor * loading.external_force
        assert np.abs(unbalanced[~loading.held]).max() <= 1e-10 * size
        assert np.abs(inner.sum(axis=0)).max() <= 1e-10 * size
        arms = potential.nodes if case.quadratic else state.all_positions
        if not case.infinitesimal:
            assert np.abs(torque(arms, inner)).max() <= 1e-10 * size * np.abs(arms).max()
        assert state.reaction.sum(axis=0) == near(-state.load_factor * total, abs=1e-10 * size)
        assert not state.reaction[~case.problem.loading.held].any()
        if not isinstance(potential, Refined):
            assert state.all_positions is state.positions or (state.all_positions == state.positions).all()
            assert state.reaction == near(np.where(loading.held, unbalanced, 0.0), abs=1e-10 * size)


def test_the_moment_needs_the_right_arms() -> None:
    """The balance of moments above sees which positions it is taken at."""
    case = CASES["lloyd, quadrilateral"]
    assert case.problem is not None and case.model is not None
    state = ts.solve(case.problem, case.model).states[-1]
    force = state.reaction + case.problem.loading.external_force
    assert np.abs(torque(case.problem.mesh.nodes, force)).max() > 1e-4


@pytest.mark.parametrize("name", EVERY)
def test_the_projected_hessian_is_semidefinite(name: str) -> None:
    potential = potential_of(name)
    assert isinstance(potential, Projectable)
    for seed, squeeze in zip(SEEDS, (0.6, 0.7, 0.8), strict=True):
        positions = deformed(potential.nodes * squeeze, seed, size=0.05)
        projected = potential.projected_hessian(positions).toarray()
        hessian = potential.hessian(positions).toarray()
        values = np.linalg.eigvalsh(projected)
        assert values[0] >= -1e-12 * values[-1]
        assert np.abs(projected - projected.T).max() <= 1e-13 * values[-1]
        if CASES[name].cuts:  # then what the projection adds is positive too
            assert np.linalg.eigvalsh(projected - hessian)[0] >= -1e-12 * values[-1]


@pytest.mark.parametrize("name", INVARIANT)
def test_the_projection_acts_in_compression(name: str) -> None:
    potential = potential_of(name)
    assert isinstance(potential, Projectable)
    squeezed = potential.nodes * 0.6
    hessian, projected = potential.hessian(squeezed).toarray(), potential.projected_hessian(squeezed).toarray()
    assert np.linalg.eigvalsh(hessian)[0] < -1e-3 * np.abs(hessian).max()
    assert np.abs(projected - hessian).max() > 1e-2 * np.abs(hessian).max()


@pytest.mark.parametrize("name", EVERY)
def test_the_projection_leaves_a_semidefinite_hessian_alone(name: str) -> None:
    """Pulled in every direction, each spring's own Hessian is semidefinite; at rest, each element's is."""
    potential = potential_of(name)
    assert isinstance(potential, Projectable)
    positions = potential.nodes * (1.5 if isinstance(potential, ts.SpringNetwork) else 1.0)
    hessian, projected = potential.hessian(positions).toarray(), potential.projected_hessian(positions).toarray()
    if isinstance(potential, VolumeSprings) and potential.term.kappa.min() < 0:  # what lowers the energy is cut off
        assert np.linalg.eigvalsh(projected - hessian)[0] >= -1e-12 * np.abs(hessian).max()
        assert np.abs(projected - hessian).max() > 1e-2 * np.abs(hessian).max()
    else:
        assert projected == near(hessian, abs=1e-12 * np.abs(hessian).max())


def test_a_negative_spring_is_projected_too() -> None:
    """Its own stiffness is what is negative: stretched or not, nothing of it that pushes away may be left."""
    network = ts.SpringNetwork([[0.0, 0.0], [1.0, 0.0]], [[0, 1]], [-2.0])
    for length in (0.7, 1.0, 1.4):
        projected = network.projected_hessian(network.nodes * length).toarray()
        assert np.linalg.eigvalsh(projected)[0] >= -1e-12


@settings(max_examples=10, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
def test_one_element_or_spring_is_projected_to_the_nearest(seed: int) -> None:
    """The nearest semidefinite matrix cuts off the negative eigenvalues."""
    potentials: list[Potential] = [ts.SpringNetwork([[0.0, 0.0, 0.0], [1.0, 0.5, 0.2]], [[0, 1]], [2.0])]
    for single in (ts.rectangle((1.0, 1.0), (1, 1)), ts.box((1.0, 1.0, 1.0), (1, 1, 1))):
        potentials += [
            ts.Fem(law).potential(body(single, distorted=False, law=law)) for law in LAWS if LAWS[law].finite
        ]
    for potential in potentials:
        positions = deformed(potential.nodes * 0.7, seed, size=0.05)
        values, vectors = np.linalg.eigh(potential.hessian(positions).toarray())
        nearest = (vectors * np.maximum(values, 0)) @ vectors.T
        assert isinstance(potential, Projectable)
        assert potential.projected_hessian(positions).toarray() == near(nearest, abs=1e-12 * values[-1])


@pytest.mark.parametrize("name", STRESSED)
def test_a_given_stress_makes_the_geometric_part(name: str) -> None:
    """With the stress of the positions the Hessian is the true one; it is affine in the stress."""
    potential = potential_of(name)
    assert isinstance(potential, Stressed)
    for seed in SEEDS:
        positions = deformed(potential.nodes, seed)
        hessian = potential.hessian(positions).toarray()
        size = np.abs(hessian).max()
        stress = potential.stress(positions)
        assert np.abs(stress).max() > 0
        assert potential.hessian(positions, stress).toarray() == near(hessian, abs=1e-13 * size)
        material = potential.hessian(positions, 0 * stress).toarray()
        double = potential.hessian(positions, 2 * stress).toarray()
        assert double - hessian == near(hessian - material, abs=1e-12 * size)
        if CASES[name].geometric:
            assert np.abs(hessian - material).max() > 1e-4 * size
            springs = CASES[name].springs and CASES[name].semidefinite
            below_zero = isinstance(potential, VolumeSprings) and potential.term.kappa.min() < 0
            assert np.linalg.eigvalsh(material)[0] >= -1e-12 * size or not springs or below_zero
        else:
            assert np.abs(hessian - material).max() == 0


@pytest.mark.parametrize("name", STRESSED)
def test_the_stress_is_carried_on_by_its_derivative(name: str) -> None:
    """Central differences along a step meet it with order 2, or exactly where the stress is quadratic."""
    potential = potential_of(name)
    assert isinstance(potential, Stressed)
    positions = deformed(potential.nodes, 31)
    stress = potential.stress(positions)
    assert potential.extrapolated_stress(positions, 0 * positions) == near(stress, rel=1e-13)
    directions = np.random.default_rng(32).normal(size=(6, *positions.shape))
    directions /= np.linalg.norm(directions, axis=(1, 2), keepdims=True)

    def extrapolated(step: float) -> Floats:
        return np.array([potential.extrapolated_stress(positions, step * one) for one in directions])

    slopes = (extrapolated(1e-5) - extrapolated(-1e-5)) / 2e-5

    def stresses(step: float) -> Floats:
        return np.array([potential.stress(positions + step * one) for one in directions])

    errors = difference_errors(stresses, slopes, STEPS)
    if CASES[name].quadratic_stress:
        assert errors.max() < 1e-9
    else:
        assert errors[0] > 1e-8, "there is nothing to see an order in"
        assert observed_orders(errors, STEPS) == near(2, abs=0.1)
    if not (isinstance(potential, FemPotential | SummedElements) and potential.law.trace == "logarithmic"):
        assert extrapolated(2.0) - stress == near(2 * slopes, abs=1e-9 * np.abs(extrapolated(2.0)).max())


@pytest.mark.parametrize("name", EVERY)
def test_slices_and_threads_change_nothing(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Small slices, or all elements on three threads: the same but for the order of sums."""
    positions = deformed(potential_of(name).nodes, 31)

    def answers() -> list[Floats]:
        potential = CASES[name].build()  # one that remembers nothing
        assert isinstance(potential, Projectable)
        by_stress = []
        if isinstance(potential, Stressed):
            stress = potential.stress(positions)
            by_stress = [stress, potential.extrapolated_stress(positions, positions)]
            by_stress += [potential.hessian(positions, 2 * stress).toarray()]
        return [
            *by_stress,
            np.array(potential.energy(positions)),
            potential.gradient(positions),
            potential.hessian(positions).toarray(),
            potential.projected_hessian(positions).toarray(),
            *potential.cell_fields(positions).values(),
        ]

    at_once = answers()
    with monkeypatch.context() as patched:
        patched.setattr(fem_potential, "_SLICE_POINTS", 1)
        patched.setattr(assembly, "_SLICE_BYTES", 1)
        sliced = answers()
    for module_name, module in tuple(sys.modules.items()):
        if module_name.startswith("truespring.models.") and hasattr(module, "_SMALLEST_PIECE"):
            monkeypatch.setattr(module, "_SMALLEST_PIECE", 1)
    monkeypatch.setattr(assembly, "_SMALLEST_SLAB", 1)
    set_threads(3)
    try:
        shared = answers()
    finally:
        set_threads(None)
    for found in (sliced, shared):
        for one, other in zip(found, at_once, strict=True):
            assert one == near(other, rel=1e-12, abs=1e-13 * np.nanmax(np.abs(other)), nan_ok=True)


@pytest.mark.parametrize("name", EVERY)
def test_only_springs_tell_their_stretch(name: str) -> None:
    potential = potential_of(name)
    assert isinstance(potential, Potential)
    assert isinstance(potential, Stretched) == CASES[name].springs
    if isinstance(potential, Stretched):
        grown = potential.stretch(potential.nodes * 1.25) / potential.stretch(potential.nodes)
        assert grown == near(np.full(len(grown), 1.25))
    if isinstance(potential, ts.SpringNetwork):
        s, dim = potential.stretch(potential.nodes * 1.25), potential.nodes.shape[1]
        line = s - 1 if potential.law == "straight" else (s - s ** -(dim + 1)) / (dim + 2)
        tension = potential.stiffness * potential.rest_length * line
        assert potential.stress(potential.nodes * 1.25) == near(tension)


@pytest.mark.parametrize("name", marked(name for name, case in CASES.items() if case.barrier))
def test_a_barrier_refuses_inversion(name: str) -> None:
    potential = potential_of(name)
    mirror = np.ones(potential.nodes.shape[1])
    mirror[0] = -1
    assert potential.energy(potential.nodes * mirror) == np.inf
    flat = np.eye(len(mirror))[1]
    flattened = [potential.energy(potential.nodes * (1 - flat + flat * share)) for share in (1e-1, 1e-3, 1e-5)]
    assert flattened == sorted(flattened)
    assert flattened[0 if CASES[name].ends else -1] < np.inf


@pytest.mark.parametrize("name", marked(name for name, case in CASES.items() if case.mirrored))
def test_lengths_alone_do_not_see_a_mirror_image(name: str) -> None:
    potential = potential_of(name)
    mirror = np.ones(potential.nodes.shape[1])
    mirror[0] = -1
    rounding = 1e-12 if isinstance(potential, NonlinearTensors) else 1e-20  # large terms of a polynomial cancel
    assert potential.energy(potential.nodes * mirror) == near(0, abs=rounding)
    assert potential.energy(potential.nodes * (1.1 * mirror)) > 1e-3


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("volume")])
def test_a_volume_term_sees_a_mirror_image(name: str) -> None:
    """It costs kappa/2 V0 (-2)^2: the springs alone cost nothing."""
    potential = potential_of(name)
    assert isinstance(potential, VolumeSprings)
    problem = CASES[name].problem
    assert problem is not None and problem.section is not None
    mirror = np.ones(problem.mesh.dim)
    mirror[0] = -1
    volume = problem.mesh.measures.sum() * problem.section.thickness
    expected = 2 * potential.term.kappa[0] * volume
    assert potential.energy(potential.nodes * mirror) == near(expected, rel=1e-10)


@pytest.mark.parametrize("name", marked(name for name, case in CASES.items() if case.model is not None))
def test_cells_carry_the_energy(name: str) -> None:
    """What is drawn adds up to the energy, but for a volume term, which lives on no spring."""
    potential = potential_of(name)
    positions = deformed(potential.nodes, 31)
    fields, energy = potential.cell_fields(positions), potential.energy(positions)
    if isinstance(potential, VolumeSprings):
        energy = potential.network.energy(positions)
    assert np.nansum(fields["strain_energy"]) == near(energy, rel=1e-12)
    n_cells = sum(map(len, potential.cells.values()))
    assert all(len(values) == n_cells for values in fields.values())
    assert ("line" in potential.cells) == CASES[name].springs
