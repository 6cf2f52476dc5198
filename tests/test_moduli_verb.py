"""Springs judged before anything is solved, and the verbs that tell it: moduli and rules."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from tests.studies import changed, written
from truespring.cli import main
from truespring.models.bending import bending_excess
from truespring.models.findings import CODES, findings
from truespring.models.fitness import Fitness, follows_poisson, judge, recommended
from truespring.report.page import moduli_rows
from truespring.report.style import figure_style
from truespring.report.verdict import moduli_sentence
from truespring.report.young import Known, _facets, _visible, young_figure

THIRD = 1 / 3
GAUSSIAN, SECOND_ORDER = ts.Springs("gaussian"), ts.Springs("gaussian", element="quadratic")


def body(mesh: ts.Mesh, poisson: float, section: Any = None, regions: Any = (), force: float = 1e-4) -> ts.Problem:
    """A body of Young's modulus 1 Pa, held on its left and loaded on its right across x; plane stress in 2D."""
    left, right = (np.flatnonzero(np.isclose(mesh.nodes[:, 0], end)) for end in (mesh.lower[0], mesh.upper[0]))
    total = [0.0, force, 0.0][: mesh.dim]
    section = section or (ts.PlaneStress(1.0) if mesh.dim == 2 else None)
    return ts.Problem(mesh, ts.Material(1.0, poisson), section, [ts.Fixed(left)], [ts.Force(right, total)], regions)


def cook(n: int, diagonal: tuple[int, ...]) -> ts.Mesh:
    """Cook's membrane of n by n mapped quadrilaterals, each halved; the corners of the halves in `diagonal`."""
    s, t = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1)))
    weights = np.stack([(1 - s) * (1 - t), s * (1 - t), s * t, (1 - s) * t], axis=1)
    column, row = (axis.ravel() for axis in np.meshgrid(np.arange(n), np.arange(n)))
    first = column + (n + 1) * row
    cells = np.stack([first, first + 1, first + n + 2, first + n + 1], axis=1)
    nodes = weights @ np.array([[0, 0], [48, 44], [48, 60], [0, 44.0]])
    return ts.Mesh(nodes, cells[:, diagonal].reshape(-1, 3), "triangle")


FIRST_TO_THIRD, SECOND_TO_FOURTH = (0, 1, 2, 0, 2, 3), (0, 1, 3, 1, 2, 3)


def equilateral(n: int, moved: Callable[[np.ndarray], np.ndarray] = lambda nodes: nodes) -> ts.Mesh:
    """A lattice of equilateral triangles of side 1, n by n rhombi in rows that lean right and left in turn."""
    nodes = np.array([[i + 0.5 * (row % 2), row * math.sqrt(3) / 2] for row in range(n + 1) for i in range(n + 1)])
    triangles = []
    for row in range(n):
        for i in range(n):
            a, b, c, d = (row * (n + 1) + i + step for step in (0, 1, n + 1, n + 2))
            triangles += [[a, b, c], [b, d, c]] if row % 2 == 0 else [[a, d, c], [a, b, d]]
    return ts.Mesh(moved(nodes), np.array(triangles), "triangle")


def loaded_upwards(mesh: ts.Mesh) -> ts.Problem:
    """Triangles of Young's modulus 1 Pa and Poisson's ratio 1/3, held below and sheared above."""
    low, high = (np.flatnonzero(np.isclose(mesh.nodes[:, 1], end)) for end in (mesh.lower[1], mesh.upper[1]))
    load = ts.Force(high, (1e-4, 0.0))
    return ts.Problem(mesh, ts.Material(1.0, THIRD), ts.PlaneStress(1.0), [ts.Fixed(low)], [load])


# Bodies of the same mesh and material are one, whose moduli are found once.
SQUARES = body(ts.rectangle((4.0, 4.0), (4, 4)), THIRD)
CUBES, SOFT_CUBES = (body(ts.box((2.0, 2.0, 2.0), (2, 2, 2)), poisson) for poisson in (0.25, 0.45))
SIX = body(ts.box((2.0, 2.0, 2.0), (2, 2, 2), "tetrahedron"), 0.25)
BCC, SOFT_BCC = (body(ts.box((3.0, 3.0, 3.0), (3, 3, 3), "bcc-tetrahedron"), poisson) for poisson in (0.25, 0.45))


def codes(found: Fitness) -> list[str]:
    return [one.code for one in found.findings]


def numbers(found: Fitness, code: str) -> dict[str, float]:
    """The numbers of the one finding of a code."""
    (one,) = (one for one in found.findings if one.code == code)
    return dict(one.numbers)


def solved_error(problem: ts.Problem, springs: ts.Springs) -> float:
    """Rms distance from linear FEM on the same mesh, of second order where the springs are, under a small load."""
    once, reference = ts.Newton(load_steps=1), ts.Fem("linear", springs.element or "linear")
    error = ts.compare(ts.solve(problem, springs, once), ts.solve(problem, reference, once)).rms_error
    assert error is not None
    return error


# --- fit or not, and what is better ------------------------------------------------------------------


@pytest.mark.parametrize("diagonal", [FIRST_TO_THIRD, SECOND_TO_FOURTH])
@pytest.mark.parametrize("rule", ["lloyd", "van-gelder", "projected"])
def test_cooks_membrane_of_triangles_is_predicted_unfit(rule: str, diagonal: tuple[int, ...]) -> None:
    """Its wrong answers are foretold: E runs by far more than a factor of 3 over the directions."""
    problem, springs = body(cook(6, diagonal), THIRD), ts.Springs(rule, allow_negative=True)
    found = judge(problem, springs)
    assert not found.fit and numbers(found, "young")["highest"] > 3 * numbers(found, "young")["lowest"]
    assert found.better == SECOND_ORDER
    assert "Not fit" in found.sentence and 'rule = "gaussian", element = "quadratic"' in found.sentence
    assert ("negative" in codes(found)) == (rule == "projected")
    if rule != "projected":  # which is refused, or goes on with an indefinite matrix
        assert solved_error(problem, springs) > 0.2
    assert solved_error(problem, found.better) < 1e-3
    assert judge(problem, found.better).fit
    # Of first order they are no more than linear triangles, six deep.
    for first_order in (GAUSSIAN, ts.Springs("biquadratic")):
        assert solved_error(problem, first_order) < 1e-3
        beside = judge(problem, first_order)
        assert len(beside.reasons) == 1 and beside.better == SECOND_ORDER
        assert numbers(beside, "simplices")["excess"] > 0.05


@pytest.mark.parametrize("rule", ["lloyd", "van-gelder", "projected", "least-squares"])
def test_six_tetrahedra_to_a_cube_are_unfit_for_plain_springs(rule: str) -> None:
    found = judge(SIX, ts.Springs(rule))
    assert not found.fit and found.better == SECOND_ORDER
    assert "bcc-tetrahedron" in found.sentence
    if rule == "lloyd":
        young = numbers(found, "young")
        assert (young["lowest"], young["highest"]) == pytest.approx((0.390431, 2.857322), abs=1e-6)


@pytest.mark.parametrize(
    ("problem", "springs"),
    [
        (SQUARES, ts.Springs("isotropic")),
        (body(SQUARES.mesh, 0.3), ts.Springs("isotropic")),
        (SOFT_CUBES, ts.Springs("isotropic", volume=True)),
        (BCC, ts.Springs("lloyd")),
        (loaded_upwards(equilateral(4)), ts.Springs("lloyd")),
        (body(SQUARES.mesh, 0.2), ts.Springs("biquadratic")),
        (body(SQUARES.mesh, -0.3), GAUSSIAN),
        (body(SOFT_CUBES.mesh, 0.499), GAUSSIAN),
        (body(SIX.mesh, 0.49), SECOND_ORDER),
    ],
)
def test_fit_springs(problem: ts.Problem, springs: ts.Springs) -> None:
    found = judge(problem, springs)
    assert found.fit and found.reasons == () and found.better is None
    assert numbers(found, "young")["lowest"] == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize(
    ("element", "depth"), [("triangle", 2), ("triangle", 4), ("triangle", 12), ("tetrahedron", 2), ("tetrahedron", 4)]
)
def test_springs_that_are_linear_simplices_are_fit_where_these_bend_as_they_should(element: str, depth: int) -> None:
    """Coupled springs are linear FEM, held against the deflection of a slender beam: F L^3 / (3 E I)."""
    length = 12
    if element == "triangle":
        mesh = ts.rectangle((length, 1.0), (length * depth, depth), element)
    else:
        mesh = ts.box((length, 1.0, 1.0), (length * depth, depth, depth), element)
    section = ts.PlaneStress(1.0) if mesh.dim == 2 else None
    force = ts.Force("right", (0.0, -1e-6, 0.0)[: mesh.dim])
    problem = ts.Problem(mesh, ts.Material(1.0, 0.3), section, [ts.Fixed("left")], [force])
    path = ts.solve(problem, ts.Fem("linear", "linear"), ts.Newton(load_steps=1))
    tip = -path.states[-1].displacement[mesh.nodes[:, 0] == length, 1].mean()
    stiff = 1e-6 * length**3 / (3 * 1 / 12) / tip - 1
    assert bending_excess(problem) == pytest.approx(stiff, rel=0.25, abs=0.01)
    for springs in (ts.Springs("biquadratic"), GAUSSIAN):
        found = judge(problem, springs)
        assert found.fit == (stiff < 0.05)
        assert found.better == (None if found.fit else SECOND_ORDER)


def test_springs_that_lock_are_not_fit() -> None:
    assert not judge(body(SIX.mesh, 0.45), ts.Springs("biquadratic")).fit
    found = judge(body(ts.box((1.0, 1.0, 1.0), (4, 4, 4)), 0.49), ts.Springs("biquadratic"))
    assert len(found.reasons) == 1 and numbers(found, "locking") == {"poisson": 0.49}


def bar(element: str, poisson: float) -> ts.Problem:
    """A bar four times as long as deep, four cells deep, bent by a light load."""
    return body(ts.box((4.0, 1.0, 1.0), (16, 4, 4), element), poisson, force=1e-6)


@pytest.mark.parametrize("poisson", [0.25, 0.48])
def test_springs_that_lock_are_not_better(poisson: float) -> None:
    """Six tetrahedra a cube: springs of second order are better, which do not lock, than those of exact moduli."""
    problem = bar("tetrahedron", poisson)
    for rule in ("lloyd", "van-gelder", "biquadratic", "gaussian"):
        found = judge(problem, ts.Springs(rule))
        assert not found.fit and found.better == SECOND_ORDER
        assert ("locking" in codes(found)) == (poisson == 0.48 and ts.RULES[rule].coupled)
    assert judge(problem, SECOND_ORDER).fit


@pytest.mark.parametrize(
    ("problem", "rule", "pairs"),
    [
        (SQUARES, "lloyd", ts.Springs("isotropic")),
        (body(SQUARES.mesh, 0.45), "isotropic", ts.Springs("isotropic", volume=True)),
        # Below Cauchy's ratio the volume term would be negative, its energy without a bound.
        (body(SQUARES.mesh, 0.1), "isotropic", None),
        (SOFT_CUBES, "isotropic", ts.Springs("isotropic", volume=True)),
        (BCC, "van-gelder", ts.Springs("lloyd")),
        (SOFT_BCC, "lloyd", ts.Springs("lloyd", volume=True)),
        # Right triangles in turn: a lattice that springs of one stiffness make isotropic, at 2/sqrt(3) E.
        (
            body(ts.rectangle((8.0, 8.0), (8, 8), "triangle", "alternating"), THIRD),
            "lloyd",
            ts.Springs("lloyd", volume=True),
        ),
    ],
)
def test_gaussian_springs_are_proposed_and_the_simplest_of_pair_forces(
    problem: ts.Problem, rule: str, pairs: ts.Springs | None
) -> None:
    found = judge(problem, ts.Springs(rule))
    simplices = problem.mesh.element in ("triangle", "tetrahedron")
    assert not found.fit and found.better == recommended(problem) == (SECOND_ORDER if simplices else GAUSSIAN)
    assert judge(problem, found.better).fit
    assert ("pair forces" in found.sentence) == (pairs is not None)
    if pairs is not None:
        keys = f'rule = "{pairs.rule}"' + (", volume = true" if pairs.volume else "")
        assert f"pair forces only: {keys}." in found.sentence
        assert judge(problem, pairs).fit


def test_of_springs_of_pair_forces_that_are_fit_the_nearest_are_proposed() -> None:
    """Within 15 % Lloyd's summed springs on squares are fit too; the isotropic ones are exact."""
    assert judge(SQUARES, ts.Springs("lloyd"), 0.15).fit
    found = judge(SQUARES, ts.Springs("lloyd", sharing="single"), 0.15)
    assert found.better == GAUSSIAN and 'pair forces only: rule = "isotropic".' in found.sentence


def test_regions_that_are_too_stiff_and_too_soft_fail_the_patch_test() -> None:
    """Moduli within 2 % do not help where sizes of elements change along x: loaded, the body is 20 % off."""

    def graded(nodes: np.ndarray) -> np.ndarray:
        return nodes + np.stack([0.5 * np.sin(2 * np.pi * nodes[:, 0] / 12.5), 0 * nodes[:, 0]], axis=1)

    problem, springs = loaded_upwards(equilateral(12, graded)), ts.Springs("van-gelder")
    realised = ts.moduli(problem, springs)
    assert np.abs(np.array(realised.young_range) - 1).max() < 0.03
    assert np.abs(np.array(realised.poisson_range) - THIRD).max() < 0.02
    found = judge(problem, springs)
    assert not found.fit and len(found.reasons) == 1 and numbers(found, "patch-test")["error"] > 0.1
    assert solved_error(problem, springs) > 0.1


@pytest.mark.parametrize(("jitter", "fit"), [(0.1, True), (0.3, False)])
def test_disorder_from_element_to_element_averages_out(jitter: float, fit: bool) -> None:
    rng = np.random.default_rng(7321)

    def disordered(nodes: np.ndarray) -> np.ndarray:
        inner = ((nodes > nodes.min(axis=0) + 0.6) & (nodes < nodes.max(axis=0) - 0.6)).all(axis=1)
        return nodes + np.where(inner[:, None], rng.uniform(-jitter, jitter, nodes.shape), 0.0)

    problem, springs = loaded_upwards(equilateral(12, disordered)), ts.Springs("lloyd")
    assert ts.moduli(problem, springs).patch_score > 0
    assert judge(problem, springs).fit == fit
    if fit:
        assert solved_error(problem, springs) < 0.02


def test_the_outer_elements_of_a_lattice_are_remarked_upon() -> None:
    """Lloyd's springs of halved tetrahedra are not half as stiff: a coarse body is not what its lattice is."""
    found = judge(BCC, ts.Springs("lloyd"))
    assert found.fit and numbers(found, "outer-test")["error"] > 0.05
    whole = judge(CUBES, ts.Springs("isotropic"))
    assert whole.fit and "outer-test" not in codes(whole)


def test_bending_is_remarked_upon_and_decides_nothing() -> None:
    """Isotropic squares, two deep: 1 - 1/4 + 6 (3/8) / 4 of the material's EI, 1 + 1/8 of four-node elements."""
    problem = body(ts.rectangle((8.0, 2.0), (8, 2)), THIRD)
    found = judge(problem, ts.Springs("isotropic"))
    assert found.fit and numbers(found, "bending") == pytest.approx({"factor": 1.3125, "fem": 1.125, "depth": 2})
    assert "1.312" in found.sentence and "1.125" in found.sentence
    both = judge(problem, ts.Springs("lloyd")).sentence
    assert "1.131" in both and "0.938" in both  # Gaussian springs: 1 - nu / (1 + nu) / n^2
    assert "Bent" not in judge(body(ts.rectangle((8.0, 8.0), (8, 8)), THIRD), ts.Springs("isotropic")).sentence


def test_the_tolerance_decides_and_is_named() -> None:
    """Lloyd's squares: 15/17 to 21/19 E, Poisson's ratio 5/19 to 7/17."""
    assert judge(SQUARES, ts.Springs("lloyd"), 0.12).fit
    for tolerance, said in ((0.1, " 10 %"), (0.05, " 5 %")):
        assert said in judge(SQUARES, ts.Springs("lloyd"), tolerance).sentence


def test_every_material_of_a_body_is_judged() -> None:
    soft = ts.Material(0.1, 0.45)
    problem = body(ts.rectangle((4.0, 2.0), (8, 4)), THIRD, regions=[ts.Region(range(8), soft)])
    found = judge(problem, ts.Springs("isotropic"))
    assert not found.fit and found.better == GAUSSIAN
    (reason,) = found.reasons
    assert all(word in reason for word in ("0.1 Pa", "0.45", "Poisson's ratio"))
    assert "1 Pa and nu 0.333333" in found.sentence
    assert [one.numbers["material"] for one in found.findings if one.code == "poisson"] == [THIRD, 0.45]
    assert judge(problem, found.better).fit


def test_what_rules_follow_is_found_out() -> None:
    follow = {rule for rule in ts.RULES if follows_poisson(rule)}
    assert follow == {"least-squares", "projected", "biquadratic", "gaussian"}


# --- words and pictures ------------------------------------------------------------------------------


def said_of(problem: ts.Problem, springs: ts.Springs) -> str:
    path = ts.Solution(problem, springs.label, "springs", (), ts.Status.CONVERGED, moduli=ts.moduli(problem, springs))
    sentence = moduli_sentence(path)
    assert sentence is not None
    return sentence


def test_moduli_in_words() -> None:
    """The sentence of a path has the numbers of the findings."""
    exact = said_of(CUBES, ts.Springs("isotropic"))
    assert "1.000 times" in exact and " to " not in exact and "(1 Pa)" in exact and "finite elements" in exact
    six = said_of(SIX, ts.Springs("lloyd"))
    assert "0.390 to 2.857" in six and "0.067 to 0.875" in six and "bent" not in six
    regions = body(SQUARES.mesh, THIRD, regions=[ts.Region([0], ts.Material(2.0, 0.3))])
    assert "outside its regions" in said_of(regions, ts.Springs("lloyd"))


def test_findings_are_in_order_and_have_a_code() -> None:
    """What warns is what is above the line of its code; the same sentences stand in warnings and in the judgement."""
    for problem, springs in (
        (SQUARES, ts.Springs("lloyd")),
        (SIX, ts.Springs("van-gelder")),
        (BCC, ts.Springs("lloyd")),
    ):
        found = findings(problem, springs)
        order = [list(CODES).index(one.code) for one in found]
        assert order == sorted(order) and len(set(order)) == len(order)
        noted = tuple(one.sentence for one in found if one.excess > CODES[one.code].noted)
        assert ts.solve(problem, springs, ts.Newton(load_steps=1)).warnings[: len(noted)] == noted
        assert {one.sentence for one in found} <= {one.sentence for one in judge(problem, springs).findings}


def test_the_rows_of_the_report() -> None:
    six = ts.moduli(SIX, ts.Springs("lloyd"))
    rows = {what: found for what, found, _ in moduli_rows(six)}
    assert rows["Young’s modulus largest of all directions"] == "2.86 Pa"
    assert rows["largest over smallest Young’s modulus"] == f"{six.anisotropy:.3f}"
    squares = ts.moduli(SQUARES, ts.Springs("lloyd"))
    assert [what for what, _, _ in moduli_rows(squares)][-1] == "Zener ratio (1 is isotropic)"
    assert len(moduli_rows(squares)) == 5


def test_the_surface_in_space_is_youngs_modulus() -> None:
    """Cubes by the projected rule: 5/6 E along an edge, larger along the diagonals."""
    realised = ts.moduli(CUBES, ts.Springs("projected"))
    corners, share = _facets(realised)
    radius = np.linalg.norm(corners, axis=2)
    assert (radius.min(), radius.max()) == pytest.approx(realised.young_range, rel=1e-3)
    assert radius.min() == pytest.approx(5 / 6, rel=1e-3)
    assert np.abs(radius.mean(axis=1) - share).max() < 1e-9
    # Facets turn their front outwards: the volume that they enclose is positive, near that of the mean radius.
    centre, (p, q) = corners.mean(axis=1), (corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    volume = (centre * np.cross(p, q)).sum() / 6
    assert volume == pytest.approx(4 / 3 * np.pi * radius.mean() ** 3, rel=0.1)


def test_the_sphere_is_hidden_where_springs_are_stiffer() -> None:
    directions = np.random.default_rng(7321).normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    realised = ts.moduli(CUBES, ts.Springs("isotropic"))
    for factor, seen in ((2.0, 0.0), (1.0, 0.5), (0.5, 0.5)):
        visible = _visible(directions, replace(realised, elasticity=factor * realised.elasticity))
        assert visible.mean() == pytest.approx(seen, abs=0.08)


def test_a_panel_for_each_model() -> None:
    realised = ts.moduli(CUBES, ts.Springs("projected"))
    with figure_style():
        for count in (1, 4):
            figure = young_figure([Known(f"springs {n}", realised, "b", "-") for n in range(count)], "material")
            assert len(figure.areas) == count
            assert figure.width == pytest.approx(7.5 if count > 2 else 3.6)


# --- the verbs ---------------------------------------------------------------------------------------

BOX = """\
[mesh]
shape = "box"
size = ["20 mm", "10 mm", "10 mm"]
elements = [4, 2, 2]
element = "tetrahedron"

[material]
young = "10 kPa"
poisson = 0.25

[[region]]
on = { box = [["0 mm", "0 mm", "0 mm"], ["5 mm", "10 mm", "10 mm"]] }
young = "20 kPa"
poisson = 0.25

[[support]]
on = "left"

[[load]]
on = "right"
force = ["0 N", "-0.001 N", "0 N"]

[models.springs]
kind = "springs"
rule = "lloyd"

[models.coupled]
kind = "springs"
rule = "biquadratic"

[models.linear]
kind = "fem"
law = "linear"
"""


def test_moduli_of_a_plane_study(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["moduli", str(written(tmp_path)), "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert list(told) == ["springs"]
    springs = told["springs"]
    assert [springs["young"], springs["young_min"]] == pytest.approx([15 / 17 * 10e3] * 2)
    assert [springs["young_45"], springs["young_max"]] == pytest.approx([21 / 19 * 10e3] * 2)
    assert springs["poisson"] == pytest.approx(7 / 17) and springs["anisotropy"] == pytest.approx(7 / 5)
    assert springs["bending_factor"]["2"] == pytest.approx(15 / 17 * 3 / 4 + 6 * 5 / 16 / 4)
    assert springs["depth"] == 2 and springs["lattice"] and springs["patch_score"] == 0
    assert (springs["n_springs"], springs["n_negative"], springs["n_zero"]) == (74, 0, 0)
    assert not springs["fit"] and springs["better"] == {"rule": "gaussian", "element": None, "volume": False}
    assert springs["sentence"].startswith("Not fit for this material") and "regions" not in springs
    assert json.loads((out / "study" / "moduli.json").read_text("utf-8")) == told
    assert {path.name for path in (out / "study").iterdir()} == {"moduli.json", "figures", ".truespring.json"}
    assert {path.name for path in (out / "study" / "figures").iterdir()} == {"moduli.png", "moduli.svg"}


def test_moduli_of_a_body_of_two_materials_in_space(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = written(tmp_path, BOX, "cubes.toml"), tmp_path / "out"
    assert main(["moduli", str(file), str(written(tmp_path)), "--out", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert list(told) == ["cubes", "study"] and list(told["cubes"]) == ["springs", "coupled"]
    springs, coupled = told["cubes"].values()
    assert (
        springs["anisotropy"] == pytest.approx(springs["young_max"] / springs["young_min"])
        and "young_45" not in springs
    )
    assert springs["material"] == {"young": 10e3, "poisson": 0.25}
    (region,) = springs["regions"]
    assert region["material"] == {"young": 20e3, "poisson": 0.25}
    assert region["young_max"] == pytest.approx(2 * springs["young_max"])
    assert springs["bending_factor"] == {} and springs["depth"] is None
    assert not springs["fit"] and not coupled["fit"]
    assert springs["better"] == coupled["better"] == {"rule": "gaussian", "element": "quadratic", "volume": False}
    assert all("finite elements of linear tetrahedra" in reason for reason in coupled["reasons"])
    assert (out / "cubes" / "figures" / "moduli.png").read_bytes().startswith(b"\x89PNG")


def test_moduli_are_shown_and_the_picture_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["moduli", str(written(tmp_path, BOX)), "--out", str(out)]) == 0
    printed = capsys.readouterr().out
    shown = " ".join(printed.split())
    for text in ("along x + y + z", "where E is 20000 Pa", "patch test", "springs of negative stiffness", "Not fit"):
        assert text in shown
    assert "bending factor" not in shown and f"picture: {out / 'study' / 'figures' / 'moduli.png'}" in printed
    assert main(["moduli", str(written(tmp_path, BOX)), "--out", str(out), "--quiet"]) == 0
    assert capsys.readouterr().out.splitlines() == [str(out / "study" / "figures" / "moduli.png")]


def test_moduli_of_a_study_without_springs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = changed(('[models.springs]\nkind = "springs"\nrule = "lloyd"\n', ""))
    assert main(["moduli", str(written(tmp_path, text)), "--out", str(tmp_path / "out"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {}
    assert main(["moduli", str(tmp_path / "none.toml"), "--out", str(tmp_path / "out")]) == 2


@pytest.mark.verification
def test_check_says_it_too_and_knows_bodies_in_space(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path, BOX)
    assert main(["check", str(file), "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "in 24 elements 20000 Pa and 0.25" in shown and "'coupled' does not fit" in shown
    assert main(["check", str(file), "--json"]) == 0
    models = json.loads(capsys.readouterr().out)["models"]
    assert (models["springs"]["fit"], models["coupled"]["fit"]) == (False, False)
    assert models["springs"]["sentence"].startswith("Not fit")


def test_rules_are_listed_with_their_sources(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rules", "--json"]) == 0
    rules = json.loads(capsys.readouterr().out)
    assert list(rules) == list(ts.RULES)
    assert rules["lloyd"]["source"] == ts.RULES["lloyd"].source and not rules["lloyd"]["follows_poisson"]
    assert rules["biquadratic"]["coupled"] and "hexahedron" in rules["biquadratic"]["elements"]
    assert main(["rules"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for name in ts.RULES:
        assert name in shown
    assert "Van Gelder" in shown and "Delingette" in shown


def test_no_number_is_infinite_in_what_is_said_of_a_slender_strip() -> None:
    mesh = ts.rectangle((100.0, 1.0), (400, 4))
    shaken = mesh.nodes + 0.005 * np.random.default_rng(2).uniform(-1, 1, mesh.nodes.shape)
    problem = ts.Problem(
        ts.Mesh(shaken, mesh.elements),
        ts.Material(1.0, 1 / 3),
        ts.PlaneStress(1.0),
        [ts.Fixed([0, 401, 802])],
        [ts.Force([400], (0.0, 1e-9))],
    )
    found = ts.judge(problem, ts.Springs(stiffness=ts.UserStiffness(0.375, 0.375)))
    assert "inf" not in found.sentence
