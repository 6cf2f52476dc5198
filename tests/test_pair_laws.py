"""Force laws of springs: the continuum that they are, the moduli that they keep, and where they are available."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import truespring as ts
from tests.closed_forms import difference_errors, observed_orders
from tests.studies import STUDY, written
from truespring.arrays import Floats
from truespring.calibration import make_unknowns
from truespring.errors import ModelError
from truespring.models import PAIR_LAWS
from truespring.study import read_study

NEO = "neo-hookean"
OWN = ts.UserStiffness(0.3, 0.4)
STEPS = (4e-3, 2e-3, 1e-3)
SOFT, SHEET = ts.Material(young=10e3, poisson=1 / 3), ts.PlaneStress(0.01)


def stretched(mesh: ts.Mesh, *loads: ts.Force, poisson: float = 1 / 3) -> ts.Problem:
    loads = loads or (ts.Force(on="right", total=(1.2, 0.0, 0.0)[: mesh.dim]),)
    return ts.Problem(mesh, ts.Material(10e3, poisson), SHEET if mesh.dim == 2 else None, [ts.Fixed("left")], loads)


SQUARES, CUBES = stretched(ts.rectangle((0.08, 0.04), (4, 2))), stretched(ts.box((2.0, 1.0, 1.0), (2, 1, 1)))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", PAIR_LAWS)
def test_tension_and_stiffness_are_derivatives_of_the_energy(name: str, dim: int) -> None:
    law, k, rest, length = (
        PAIR_LAWS[name],
        np.array([2.0, 3.0, 0.7]),
        np.array([1.0, 0.4, 2.0]),
        np.array([1.3, 0.3, 2]),
    )
    energies = difference_errors(
        lambda step: law.energy(k, rest, length + step, dim), law.tension(k, rest, length, dim), STEPS
    )
    tensions = difference_errors(
        lambda step: law.tension(k, rest, length + step, dim), law.stiffness(k, rest, length, dim), STEPS
    )
    for errors in (energies, tensions):
        if law.linear:
            assert errors.max() < 1e-10
        else:
            assert errors[0] > 1e-8
            assert observed_orders(errors, STEPS) == pytest.approx(2, abs=0.1)
    assert not np.any(law.energy(k, rest, rest, dim)) and not np.any(law.tension(k, rest, rest, dim))
    assert law.stiffness(k, rest, rest, dim) == pytest.approx(k, rel=1e-15)
    s = length / rest
    if not law.linear:
        closed = k * rest**2 / (dim + 2) * (s**2 / 2 + s ** (-dim) / dim - 1 / 2 - 1 / dim)
        assert law.energy(k, rest, length, dim) == pytest.approx(closed, rel=1e-12, abs=1e-15)


def directions(dim: int) -> tuple[Floats, Floats]:
    """Unit vectors and weights of a product rule on the circle or sphere, whose sum is 1."""
    angle = np.arange(160) * 2 * np.pi / 160
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if dim == 2:
        return circle, np.full(160, 1 / 160)
    height, weight = np.polynomial.legendre.leggauss(60)
    ring = np.sqrt(1 - height**2)
    points = [np.concatenate([r * circle, np.full((160, 1), z)], axis=1) for r, z in zip(ring, height, strict=True)]
    return np.concatenate(points), np.repeat(weight / 2 / 160, 160)


@pytest.mark.parametrize("dim", [2, 3])
def test_the_mean_over_directions_is_the_closed_form(dim: int) -> None:
    """Springs of all directions, with sum k L^2 = d (d + 2) per volume, have mu = 1."""
    n, weight = directions(dim)
    F = np.eye(dim) + np.random.default_rng(7).uniform(-0.25, 0.25, (dim, dim))
    length, one = np.linalg.norm(n @ F.T, axis=1), np.ones(len(n))
    density = weight @ PAIR_LAWS[NEO].energy(dim * (dim + 2) * one, one, length, dim)
    J = np.linalg.det(F)
    closed = (np.trace(F.T @ F) - dim) / 2 + 1 / J - 1
    assert abs(J - 1) > 0.05 and closed > 0.05
    assert density == pytest.approx(closed, rel=1e-8)


def neo_hookean_stress(stretch: float) -> float:
    """Nominal stress of a bar of Young's modulus 1 and Poisson's ratio 1/3 by the neo-Hookean law of FEM."""
    mu, lam = 3 / 8, 3 / 4
    aside = brentq(lambda t: mu * (t * t - 1) + lam * np.log(stretch * t * t), 0.3, 3)
    return float((mu * (stretch**2 - 1) + lam * np.log(stretch * aside**2)) / stretch)


@pytest.mark.parametrize(
    ("law", "stretch", "excess"),
    [(NEO, 0.8, 4.6), (NEO, 1.2, 1.0), (NEO, 1.3, 1.9), (NEO, 1.5, 3.2), ("straight", 0.8, -23), ("straight", 1.5, 54)],
)
def test_a_bar_of_squares_against_the_continuum(law: str, stretch: float, excess: float) -> None:
    """Numbers of an independent code, in percent of the nominal stress."""
    problem = ts.Problem(
        ts.rectangle((2.0, 2.0), (2, 2)),
        ts.Material(young=1.0, poisson=1 / 3),
        ts.PlaneStress(1.0),
        [
            ts.Fixed(on="left", fix="x"),
            ts.Fixed(on="left-bottom", fix="y"),
            ts.Fixed(on="right", fix="x", displacement=(2 * stretch - 2, 0.0)),
        ],
    )
    state = ts.solve(problem, ts.Springs("isotropic", law=law), ts.Newton(load_steps=2)).states[-1]
    stress = -state.reaction[problem.mesh.nodes[:, 0] == 0, 0].sum() / 2
    digits = 0.05 if law == NEO else 0.5
    assert 100 * (stress / neo_hookean_stress(stretch) - 1) == pytest.approx(excess, abs=digits + 0.005)


@pytest.mark.parametrize(("law", "low", "high"), [("straight", 0.24, 0.30), (NEO, 0.025, 0.031)])
def test_a_strip_stretched_by_a_third_of_its_modulus(law: str, low: float, high: float) -> None:
    problem = stretched(ts.rectangle((0.16, 0.04), (16, 4)))
    solver = ts.Newton(load_steps=3)
    found, reference = (
        ts.solve(problem, model, solver).states[-1].displacement
        for model in (ts.Springs("isotropic", law=law), ts.Fem("neo-hookean"))
    )
    assert low < np.linalg.norm(found - reference) / np.linalg.norm(reference) < high


@pytest.mark.parametrize("volume", [False, True], ids=["plain", "volume"])
@pytest.mark.parametrize("problem", [SQUARES, CUBES], ids=["squares", "cubes"])
def test_the_moduli_at_small_strain_do_not_depend_on_the_law(problem: ts.Problem, volume: bool) -> None:
    k_body = None if problem.mesh.dim == 2 else 0.1
    laws = [ts.Springs("isotropic", volume=volume, k_body=k_body, law=law) for law in (None, *PAIR_LAWS)]
    first, *others = (springs.potential(problem).hessian(problem.mesh.nodes).toarray() for springs in laws)
    for other in others:
        assert other == pytest.approx(first, rel=1e-14, abs=1e-14 * np.abs(first).max())
    if volume:
        assert ts.moduli(problem, laws[-1]).poisson() == pytest.approx(1 / 3, rel=1e-12)


def sixth_order(n: Floats, weight: Floats) -> Floats:
    """The sum of weight n (x) n (x) n (x) n (x) n (x) n over unit vectors, shape (27, 27)."""
    cubes = np.einsum("si,sj,sk->sijk", n, n, n).reshape(len(n), -1)
    return np.asarray((weight[:, None] * cubes).T @ cubes)


def test_cubes_have_the_directions_of_lebedev() -> None:
    """The tensor of k L^2 n (x) ... of the springs of a cell is isotropic to the sixth order; that of others is not."""
    kind = CUBES.mesh.kind
    stiffness = ts.Springs("isotropic", law=NEO).element_stiffness(CUBES)[0] / 10e3
    edge, face, body = (stiffness[links[0]] for links in np.split(np.arange(28), [12, 24]))
    assert [len(kind.edges), len(kind.diagonals), len(kind.body_diagonals)] == [12, 12, 4]
    assert [edge, face, body] == pytest.approx([1 / 7, 4 / 35, 9 / 70], rel=1e-14)
    ends = CUBES.mesh.nodes[CUBES.mesh.elements[0]][np.array(kind.links)]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    n = (ends[:, 1] - ends[:, 0]) / length[:, None]
    for law, isotropic in ((NEO, True), ("straight", False)):
        weight = ts.Springs("isotropic", law=law).element_stiffness(CUBES)[0] * length**2
        expected = weight.sum() * sixth_order(*directions(3))
        difference = np.abs(sixth_order(n, weight) - expected).max() / expected.max()
        assert difference < 1e-13 if isotropic else difference > 0.01
    chosen = ts.Springs("isotropic", law=NEO, k_body=0.05).element_stiffness(CUBES)[0, -1]
    assert chosen == pytest.approx(500, rel=1e-14)
    straight = ts.Springs("isotropic").element_stiffness(CUBES)[0, -1]
    assert straight == pytest.approx(10e3 / 12, rel=1e-14)


def test_a_spring_of_no_length_has_infinite_energy() -> None:
    network = ts.SpringNetwork([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0, 1], [1, 2]], [1.0, 1.0], law=NEO)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert network.energy(np.array([[0.0, 0.0], [0.0, 0.0], [2.0, 0.0]])) == np.inf
    assert network.cell_fields(network.nodes * 1.5)["strain_energy"].sum() == network.energy(network.nodes * 1.5)


def test_calibration_scales_springs_of_the_law() -> None:
    unknowns = make_unknowns(SQUARES, ts.Springs("isotropic", law=NEO))
    values = 1 + 0.1 * np.arange(len(unknowns))
    positions = SQUARES.mesh.nodes * [1.3, 0.9]
    force = unknowns.potential(values).gradient(positions)
    assert (unknowns.forces(positions) @ values).reshape(force.shape) == pytest.approx(force, rel=1e-12, abs=1e-14)
    assert unknowns.model(values).potential(SQUARES).gradient(positions) == pytest.approx(force, rel=1e-14, abs=1e-16)


@pytest.mark.parametrize(
    ("rule", "stiffness", "law"),
    [
        ("projected", None, NEO),
        ("biquadratic", None, NEO),
        ("isotropic", None, "gent"),
        ("gaussian", None, "straight"),
        (None, OWN, "yeoh"),
    ],
)
def test_a_law_that_springs_do_not_have(rule: str | None, stiffness: ts.UserStiffness | None, law: str) -> None:
    with pytest.raises(ModelError, match=f"law = '{law}'.*available"):
        ts.Springs(rule, stiffness, law=law)


def test_an_unknown_law_of_a_network() -> None:
    with pytest.raises(ModelError, match="'neo-hookean'"):
        ts.SpringNetwork([[0.0, 0.0], [1.0, 0.0]], [[0, 1]], [1.0], law="neohookean")


def test_a_study_has_the_law(tmp_path: Path) -> None:
    mesh = ts.rectangle((0.04, 0.01), (8, 2))
    rows = {tuple(sorted(pair)) for pair in mesh.elements[:, np.array(mesh.kind.links)].reshape(-1, 2).tolist()}
    (tmp_path / "k.csv").write_text("a,b,stiffness\n" + "".join(f"{a},{b},2\n" for a, b in rows), encoding="utf-8")
    keys = {
        "by-rule": 'rule = "isotropic"',
        "own": "stiffness = { edge = 0.3, diagonal = 0.4 }",
        "from-file": 'stiffness = { file = "k.csv" }',
    }
    models = "".join(f'[models.{name}]\nkind = "springs"\nlaw = "{NEO}"\n{key}\n' for name, key in keys.items())
    study = read_study(written(tmp_path, STUDY + models))
    networks = {name: model.potential(study.problem) for name, model in study.entries.items() if name != "linear"}
    laws = {name: network.law for name, network in networks.items() if isinstance(network, ts.SpringNetwork)}
    assert laws == {"springs": "straight", **dict.fromkeys(keys, NEO)}
    assert NEO in study.entries["by-rule"].label
