"""Constitutive laws: every entry of LAWS against its own closed form, and what a law with its own constants needs."""

import sys
from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.optimize import brentq

import truespring as ts
from tests.law_contract import CHECKS
from truespring.arrays import Floats
from truespring.material import Lame
from truespring.models import LAWS, Constant, Law
from truespring.models.fem_potential import FemPotential
from truespring.models.invariants import Derivatives, condensed
from truespring.models.law import Constants, Response
from truespring.models.laws import material_constants
from truespring.models.rubber import gent, neo_hookean, yeoh
from truespring.models.symmetric import determinant, inverted
from truespring.study import schema

KEYS = {"young", "poisson", "mu", "bulk", "density", "fibres"}


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
@pytest.mark.parametrize("law", LAWS)
def test_contract(law: str, check: Callable[[Law], None]) -> None:
    check(LAWS[law])


def test_keys_of_a_material_are_one_thing_each() -> None:
    """Laws that share the name of a constant mean the same; none takes a key that [material] has anyway."""
    by_name: dict[str, set[str]] = {}
    for law in LAWS.values():
        for name, constant in law.constants.items():
            by_name.setdefault(name, set()).add(constant.unit)
            assert constant.smallest <= constant.example <= constant.largest
            assert constant.meaning and name.isidentifier()
    assert all(len(units) == 1 for units in by_name.values())
    assert not by_name.keys() & {*KEYS, "on"}


# --- a law with constants of its own ----------------------------------------------------------------------------------


def _of_c(c: Constants) -> Constants:
    return Constants(c["c2"], 2 * np.asarray(c["c1"]), c.plane_stress)


SCRATCH = Law(
    lambda C, c: LAWS["neo-hookean"].respond(C, _of_c(c)),
    lambda stretch, c: LAWS["neo-hookean"].density(stretch, _of_c(c)),
    label="scratch",
    source="the neo-Hookean law by other constants",
    finite=True,
    barrier=True,
    quadratic=False,
    trace=None,
    constants={
        "c1": Constant("stress", "half of the shear modulus", example=0.4, smallest=0.0),
        "c2": Constant("stress", "first Lame constant", example=0.9, default=1.2),
        "exponent": Constant(None, "a number without use", example=2.0, default=2.0),
    },
    lame=lambda c: Lame(c["c2"], 2 * c["c1"]),
)


@pytest.fixture
def scratch(monkeypatch: pytest.MonkeyPatch) -> None:
    """LAWS with one more entry, wherever it is looked up."""
    table = MappingProxyType({**LAWS, "scratch": SCRATCH})
    for module in [module for name, module in sys.modules.items() if name.startswith("truespring")]:
        if vars(module).get("LAWS") is LAWS:
            monkeypatch.setattr(module, "LAWS", table)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_a_new_law_passes_the_contract(check: Callable[[Law], None]) -> None:
    check(SCRATCH)


def _ten_times(law: Law) -> Law:
    """The law ten times too stiff against a change of volume."""
    return replace(law, respond=lambda C, c: law.respond(C, replace(c, lam=10 * np.asarray(c.lam))))


def _wrong_formula_too(law: Law) -> Law:
    return replace(_ten_times(law), density=lambda stretch, c: law.density(stretch, replace(c, lam=10 * c.lam)))


def _at_finite_strain(law: Law) -> Law:
    """The law with a term of fourth order in ln J, which nothing sees at small strain."""

    def respond(C: Floats, c: Constants) -> Response:
        plain, log_J = law.respond(C, c), np.log(determinant(C)) / 2
        pressure = 2 * c.mu * log_J**3 * inverted(C)
        return replace(plain, energy=plain.energy + c.mu / 2 * log_J**4, stress=plain.stress + pressure)

    return replace(law, respond=respond)


def _by_wrong_slope(I1: Floats, y: Floats, constants: Constants) -> Derivatives:
    found = yeoh(I1, y, constants)
    return replace(found, by_trace_y=1.01 * found.by_trace_y)


def _another_thickness(law: Law) -> Law:
    """The law with the third stretch of a body in space where it has no thickness."""

    def respond(C: Floats, c: Constants) -> Response:
        plain = law.respond(C, c)
        return replace(plain, thickness_stretch=np.sqrt(C[2])) if len(C) == 6 else plain

    return replace(law, respond=respond)


WRONG: dict[str, Law] = {
    "said to be linear in I1": replace(LAWS["yeoh"], constant_springs=True),
    "said to be not linear in I1": replace(LAWS["neo-hookean"], constant_springs=False),
    "another second derivative": replace(LAWS["yeoh"], invariants=_by_wrong_slope),
    "another function of I1": replace(LAWS["gent"], invariants=neo_hookean),
    "ten times too stiff in volume": _ten_times(LAWS["neo-hookean"]),
    "and so is its formula": _wrong_formula_too(LAWS["neo-hookean"]),
    "at finite strain only": _at_finite_strain(LAWS["neo-hookean"]),
    "another law in current axes": replace(LAWS["yeoh"], current=LAWS["neo-hookean"].current),
    "without a formula": replace(LAWS["hencky"], density=None),  # type: ignore[arg-type]
    "another thickness in 3D": _another_thickness(LAWS["hencky"]),
    "said to be quadratic": replace(LAWS["hencky"], quadratic=True),
    "said to have no barrier": replace(LAWS["hencky"], barrier=False),
    "another part of lambda": replace(LAWS["hencky"], trace="green"),
    "another domain": replace(LAWS["saint-venant-kirchhoff"], domain=(0.0, np.inf)),
    "other constants at small strain": replace(SCRATCH, lame=lambda c: Lame(c["c2"], 2.2 * c["c1"])),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_law_fails_the_contract(wrong: str) -> None:
    failed = []
    for check in CHECKS:
        try:
            check(WRONG[wrong])
        except (AssertionError, TypeError, RuntimeWarning):
            failed.append(check.__name__)
    assert failed
    if "ten times" in wrong or "formula too" in wrong:
        assert "check_rest" in failed


MATERIAL = ts.Material(2.07, 0.2647, constants={"c1": 0.41, "c2": 0.9})


def body(material: ts.Material, region: ts.Material | None = None) -> ts.Problem:
    regions = [] if region is None else [ts.Region([0, 1], region)]
    load = ts.Force("right", (0.1, 0.0))
    return ts.Problem(
        ts.rectangle((2.0, 1.0), (2, 2)), material, ts.PlaneStrain(1.0), [ts.Fixed("left")], load, regions
    )


@pytest.mark.usefixtures("scratch")
def test_a_model_takes_the_constants_of_its_law() -> None:
    """A law by c1 and c2 is the neo-Hookean law of the same lam and mu, region by region."""
    lam, mu = 0.9, 0.82
    same = ts.Material(mu * (3 * lam + 2 * mu) / (lam + mu), lam / 2 / (lam + mu))
    stiff = ts.Material(2 * same.young, same.poisson)
    for region, plain in ((None, None), (replace(stiff, constants={"c1": 2 * mu / 2, "c2": 2 * lam}), stiff)):
        ours = body(replace(same, constants={"c1": mu / 2, "c2": lam}), region)
        potentials = ts.Fem("scratch").potential(ours), ts.Fem("neo-hookean").potential(body(same, plain))
        positions = ours.mesh.nodes * [1.3, 0.9] + 0.05 * ours.mesh.nodes[:, ::-1] ** 2
        forces = [potential.gradient(positions) for potential in potentials]
        assert np.abs(forces[0]).max() > 0.01
        assert forces[0] == pytest.approx(forces[1], rel=1e-12, abs=1e-13)


@pytest.mark.usefixtures("scratch")
@pytest.mark.parametrize(
    ("constants", "named"),
    [
        ({}, ("c1", "Pa", "half of the shear modulus")),
        ({"c1": -1.0}, ("c1 = -1 Pa:", "a value of at least 0")),
        ({"c1": 0.41, "c3": 1.0}, ("c3", "c1, c2, exponent")),
        ({"c1": 4.1, "c2": 0.9}, ("young", "2.07", "0.2647")),
    ],
)
def test_constants_that_do_not_fit(constants: dict[str, float], named: tuple[str, ...]) -> None:
    with pytest.raises(ts.TruespringError) as error:
        ts.Fem("scratch").potential(body(replace(MATERIAL, constants=constants)))
    assert all(word in str(error.value) for word in named)


@pytest.mark.usefixtures("scratch")
def test_simplices_of_a_law_without_a_trace_are_quadratic() -> None:
    mesh = ts.rectangle((1.0, 1.0), (1, 1), "triangle")
    tight = ts.Material(1.0, 0.45)
    problem = ts.Problem(mesh, tight, ts.PlaneStrain(1.0), [ts.Fixed("left")], [ts.Force("right", (0.1, 0.0))])
    assert ts.Fem("scratch").chosen_element(problem) == "quadratic"
    assert ts.Fem("hencky").chosen_element(problem) == "quadratic-mean-dilatation"
    with pytest.raises(ts.TruespringError, match="quadratic-mean-dilatation"):
        ts.Fem("scratch", "quadratic-mean-dilatation").potential(problem)


@pytest.mark.parametrize("law", [name for name, law in LAWS.items() if law.trace == "logarithmic"])
def test_the_part_of_lam_is_at_the_mean(law: str) -> None:
    """Elements with mean dilatation differ by lam/2 ((ln of the mean of J)^2 - mean of (ln J)^2), for any law."""
    values = {name: constant.example for name, constant in LAWS[law].constants.items()}
    mesh = ts.box((1.0, 1.0, 1.0), (1, 1, 1), "tetrahedron")
    stuff = ts.Material(2.0, 0.4, constants=values)
    problem = ts.Problem(mesh, stuff, None, [ts.Fixed("left")], [ts.Force("right", (0.1, 0.0, 0.0))])
    plain, mean = (ts.Fem(law, element).potential(problem) for element in ("quadratic", "quadratic-mean-dilatation"))
    assert isinstance(plain, FemPotential)
    positions = plain.nodes + 0.2 * plain.nodes**2
    gradients, volumes = plain.quadrature()
    F = np.einsum("eki,epkj->epij", positions[plain.elements], gradients)
    J = np.linalg.det(F)
    average = (volumes * J).sum(axis=1) / volumes.sum(axis=1)
    change = (volumes.sum(axis=1) * np.log(average) ** 2).sum() - (volumes * np.log(J) ** 2).sum()
    assert abs(change) > 1e-4
    assert mean.energy(positions) - plain.energy(positions) == pytest.approx(stuff.lame.lam / 2 * change, rel=1e-9)


def test_constants_of_a_material_are_values() -> None:
    assert ts.Material(2.07, 0.2647, constants=(("c2", 0.9), ("c1", 0.41))) == MATERIAL
    assert len({MATERIAL, replace(MATERIAL, constants={"c1": 0.41, "c2": 0.9}), replace(MATERIAL, constants={})}) == 2
    with pytest.raises(ts.TruespringError, match="c1 = nan"):
        ts.Material(1.0, 0.3, constants={"c1": np.nan})


def test_a_study_takes_them_with_units() -> None:
    table = schema.with_constants(schema.MaterialKeys, "Material", SCRATCH.constants)
    found = table.model_validate({"young": "2 kPa", "poisson": 0.3, "c1": "0.4 kPa", "exponent": 3})
    expected = {"young": 2000.0, "poisson": 0.3, "density": None, "c1": 400.0, "c2": None, "exponent": 3.0}
    assert found.model_dump(include=set(expected)) == expected
    for key, value in (("c1", "0.4 mm"), ("c1", True), ("exponent", "2 Pa"), ("c3", 1.0)):
        with pytest.raises(ValidationError):
            table.model_validate({"young": 1.0, "poisson": 0.3, key: value})
    described = table.model_json_schema()["properties"]["c1"]["description"]
    assert "half of the shear modulus" in described and "[Pa]" in described
    assert set(material_constants()) == set(schema.MaterialKeys.model_fields) - KEYS


@pytest.mark.parametrize("ratio", [-0.6, -0.2, 0.0, 0.5, 2.0, 100.0])
def test_the_free_thickness_is_the_root_on_the_branch_that_begins_at_rest(ratio: float) -> None:
    """Of e^y - 1 + ratio/2 (log det + y), by bisection above its minimum; none where that is above zero."""
    log_det = np.linspace(-6.0, 6.0, 49)
    found = condensed(neo_hookean, 2.0 + log_det**2, log_det / 2, 2, Constants(ratio, 1.0, True)).C_33
    for value, at in zip(found, log_det, strict=True):

        def rest(y: float, at: float = at) -> float:
            return float(np.expm1(y) + ratio / 2 * (at + y))

        low = np.log(-ratio / 2) if ratio < 0 else -60.0 - abs(at) * 100
        if ratio < 0 and rest(low) > 0:
            assert np.isnan(value)
        else:
            assert np.log(value) == pytest.approx(brentq(rest, low, 60.0, xtol=1e-14), abs=1e-9)


# --- moduli, impossible constants, and the end of a law ---------------------------------------------------------------


def test_moduli_of_either_pair() -> None:
    material = ts.Material.from_moduli(1e3, 50e3, 1000.0, {"jm": 30.0})
    lam, mu = material.lame
    assert (mu, lam + 2 / 3 * mu) == pytest.approx((1e3, 50e3), rel=1e-12)
    assert (material.young, material.poisson) == pytest.approx((9 * 50e3 / 151, 148 / 302), rel=1e-14)
    table = schema.MaterialKeys.model_validate({"mu": "1 kPa", "bulk": "50 kPa", "density": 1000.0, "jm": 30})
    assert table.build(2) == material
    for mu, bulk, word in ((0.0, 1.0, "mu"), (1.0, -1.0, "bulk"), (1.0, np.inf, "bulk")):
        with pytest.raises(ts.TruespringError, match=word):
            ts.Material.from_moduli(mu, bulk)


@pytest.mark.parametrize(
    "names", ["", "young", "poisson", "mu", "bulk", "young mu", "young poisson mu", "mu bulk young"]
)
def test_another_set_of_moduli_is_an_error(names: str) -> None:
    with pytest.raises(ValidationError, match="young and poisson, or mu and bulk") as error:
        schema.MaterialKeys.model_validate(dict.fromkeys(names.split(), 0.3))
    assert all(name in str(error.value) for name in names.split())
    required = schema.MaterialKeys.model_json_schema()["oneOf"]
    assert required == [{"required": ["young", "poisson"]}, {"required": ["mu", "bulk"]}]


@pytest.mark.parametrize(
    ("law", "constants", "named"),
    [
        ("gent", {}, ("jm",)),
        ("gent", {"jm": 0.0}, ("jm = 0: ", "requires a value above 0")),
        ("arruda-boyce", {"locking_stretch": 1.0}, ("locking_stretch = 1: ", "above 1")),
        ("mooney-rivlin", {"c01": 0.6}, ("c01 = 0.6", "0.5")),
        ("mooney-rivlin", {"c01": -0.1}, ("c01 = -0.1 Pa", "at least 0")),
        ("ogden", {"alpha1": 0.0}, ("alpha1 = 0",)),
        ("ogden", {"alpha1": 2.0, "mu2": 0.1}, ("mu2 = 0.1", "alpha2")),
        ("ogden", {"alpha1": 2.0, "alpha3": 4.0}, ("alpha3 = 4", "mu3")),
        (
            "ogden",
            {"alpha1": 2.0, "mu2": 0.5, "alpha2": 3.0, "mu3": 0.5, "alpha3": 4.0},
            ("mu2 + mu3 = 1", "modulus 1"),
        ),
        ("ogden", {"alpha1": 2.0, "mu2": -0.1, "alpha2": 3.0}, ("mu2 = -0.1",)),
    ],
)
def test_impossible_constants(law: str, constants: dict[str, float], named: tuple[str, ...]) -> None:
    with pytest.raises(ts.TruespringError) as error:
        ts.Fem(law).potential(body(ts.Material.from_moduli(1.0, 10.0, None, constants)))
    assert all(word in str(error.value) for word in named)


def test_laws_that_are_others() -> None:
    """Ogden of one term is Mooney-Rivlin without c01 and Yeoh without c20; a region has other constants."""
    soft, stiff = ({"alpha1": 2.0, "c01": 0.0, "c20": 0.0, "c30": 0.0}, {"alpha1": 3.0, "mu2": 0.2, "alpha2": 2.0})
    first = body(ts.Material.from_moduli(1.0, 10.0, None, soft))
    positions = first.mesh.nodes * [1.3, 0.9] + 0.05 * first.mesh.nodes[:, ::-1] ** 2
    forces = [ts.Fem(law).potential(first).gradient(positions) for law in ("ogden", "mooney-rivlin", "yeoh")]
    assert np.abs(forces[0]).max() > 0.01
    assert forces[1] == pytest.approx(forces[0], abs=1e-13)
    assert forces[2] == pytest.approx(forces[0], abs=1e-13)
    materials = [ts.Material.from_moduli(1.0, 10.0, None, one) for one in (soft, stiff)]
    mixed = ts.Fem("ogden").potential(body(*materials))
    alone = [ts.Fem("ogden").potential(body(one)) for one in materials]
    assert isinstance(mixed, FemPotential)
    found = [one.element_hessians(positions) for one in (mixed, *alone) if isinstance(one, FemPotential)]
    assert found[0] == pytest.approx(np.concatenate([found[2][:2], found[1][2:]]), abs=1e-13)


@pytest.mark.parametrize("model", [ts.Fem("gent"), ts.Springs(rule="gaussian", law="gent")])
def test_a_motion_beyond_the_end_of_the_law(model: ts.Fem | ts.Springs) -> None:
    """A strip in plane strain, sheared by g at constant volume, has I1b - 3 = g^2."""
    material = ts.Material.from_moduli(1.0, 1e3, None, {"jm": 0.5})
    moved = [ts.Fixed("bottom"), ts.Fixed("top", displacement=(1.0, 0.0))]
    problem = ts.Problem(ts.rectangle((8.0, 1.0), (8, 2)), material, ts.PlaneStrain(1.0), moved, [])
    solution = ts.solve(problem, model, ts.Newton(20))
    assert solution.status == "not-converged"
    assert any("jm" in warning for warning in solution.warnings)
    assert 0.65 <= solution.states[-1].load_factor <= 0.75


def test_the_free_thickness_near_the_end_of_a_law() -> None:
    """An incompressible sheet; a start outside of the law's domain; a stretch that has no thickness."""
    stretches = np.array([[1.25, 1.0], [0.75, 0.9], [1.4, 1.2], [0.6, 1.6]])
    T, J = (stretches**2).sum(axis=1), stretches.prod(axis=1)
    found = condensed(gent, T, np.log(J), 2, Constants(1e6, 1.0, True, {"jm": 0.6}))
    assert found.C_33[:2] == pytest.approx(1 / J[:2] ** 2, rel=1e-4)
    assert (T + 1 / J**2 - 3 > 0.6).tolist() == [False, False, True, True]
    assert np.isnan(found.C_33).tolist() == [False, False, False, True]
    assert np.abs(found.across[:3]).max() < 1e-8 * 1e6
