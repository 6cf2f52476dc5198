"""Bodies that CalculiX and Abaqus have instead of springs: CalculiX run on the decks, and the numbers in them."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from tests.calculix import displacements, needs_ccx
from tests.exports import exported
from truespring.arrays import Floats
from truespring.exports import Exported, solve_springs, target_files, with_expectation
from truespring.exports.calculix import spring_deck
from truespring.exports.mean_strain import hourglass_control, volume_slopes
from truespring.exports.split_law import SPLIT, split_neo_hookean, stress_difference
from truespring.models.invariants import condensed
from truespring.models.law import Constants
from truespring.reference.dat import read_dat

_BOX, _STRIP = ((0.16, 0.04, 0.04), (4, 1, 1)), ((0.16, 0.04), (4, 1))
_SLICE, _SHEET = ts.PlaneStrain(0.01), ts.PlaneStress(0.01)


def _skew() -> ts.Mesh:
    """Bricks that are no parallelepipeds."""
    mesh = ts.box(*_BOX)
    moved = mesh.nodes + 4e-3 * np.random.default_rng(1).random(mesh.nodes.shape) * (mesh.nodes[:, :1] > 0)
    return ts.Mesh(moved, mesh.elements, mesh.element, mesh.node_groups)


#: Mesh, section, springs, and the distance of CalculiX at 1 % of the load and at full load.
TWINS: dict[str, tuple[Any, Any, dict[str, Any], float, float]] = {
    "cubes": (lambda: ts.box(*_BOX), None, {"rule": "gaussian"}, 2e-4, 0.03),
    "stiff hourglass": (lambda: ts.box(*_BOX), None, {"rule": "gaussian", "hourglass": 1.2}, 2e-4, 0.03),
    "skew bricks": (_skew, None, {"rule": "gaussian"}, 2e-4, 0.03),
    "wedges": (lambda: ts.box(*_BOX, element="wedge"), None, {"rule": "gaussian"}, 2e-4, 0.02),
    "quadrilaterals": (lambda: ts.rectangle(*_STRIP), _SLICE, {"rule": "gaussian"}, 2e-4, 0.02),
    "tetrahedra": (lambda: ts.box(*_BOX, element="tetrahedron"), None, {"rule": "gaussian"}, 1e-4, 0.01),
    "triangles": (lambda: ts.rectangle(*_STRIP, element="triangle"), _SLICE, {"rule": "gaussian"}, 1e-4, 0.01),
    "biquadratic bricks": (lambda: ts.box(*_BOX), None, {"rule": "biquadratic"}, 1e-6, 1e-6),
    "biquadratic tetrahedra": (lambda: ts.box(*_BOX, element="tetrahedron"), None, {"rule": "biquadratic"}, 1e-6, 1e-6),
    "volume term": (lambda: ts.box(*_BOX), None, {"rule": "isotropic", "volume": True}, 1e-5, 3e-3),
    "area term": (lambda: ts.rectangle(*_STRIP), _SHEET, {"rule": "isotropic", "volume": True}, 1e-5, 3e-3),
}


def twin(name: str, share: float, steps: int) -> Exported:
    make, section, springs, _, _ = TWINS[name]
    mesh = make()
    total = share * np.array([0.02, -0.08, 0.0])[: mesh.dim] * (1.0 if mesh.dim == 3 else 0.2)
    problem = ts.Problem(
        mesh, ts.Material(1e4, 0.45), section, [ts.Fixed(on="left")], [ts.Force(on="right", total=tuple(total))]
    )
    return solve_springs(problem, ts.Springs(**springs), ts.Newton(load_steps=steps))


def first(one: Exported, target: str = "calculix") -> str:
    return str(next(iter(target_files(one, [target])[target].values())))


def told(one: Exported, target: str = "calculix") -> dict[str, Any]:
    files = with_expectation(one, target, target_files(one, [target])[target])
    values: dict[str, Any] = json.loads(files["exported.json"])
    return values


def distance(one: Exported, found: Floats) -> float:
    assert one.state is not None
    ours = one.state.displacement
    return float(np.linalg.norm(found[: len(ours), : ours.shape[1]] - ours) / np.linalg.norm(ours))


@needs_ccx
@pytest.mark.parametrize("name", TWINS)
def test_calculix_moves_as_the_springs_do(name: str, tmp_path: Path) -> None:
    """At 1 % of the load all twins do; at full load those of Gaussian springs differ by the law."""
    *_, small, full = TWINS[name]
    slight = twin(name, 0.01, 1)
    assert distance(slight, displacements(first(slight), tmp_path)[-1]) < small
    whole = twin(name, 1.0, 2)
    assert distance(whole, displacements(first(whole), tmp_path)[-1]) < full


@needs_ccx
def test_calculix_is_where_the_deck_says(tmp_path: Path) -> None:
    """The law of the program, solved here, and run there: on tetrahedra the elements are the same."""
    one = twin("tetrahedra", 1.0, 2)
    found, values = displacements(first(one), tmp_path)[-1], told(one)["twin"]
    assert one.state is not None
    ours = one.state.displacement
    largest = np.linalg.norm(ours, axis=1).max()
    assert found[one.probe] == pytest.approx(values["probe_displacement"], abs=1e-5 * largest)
    away = np.linalg.norm(found - ours, axis=1).max() / largest
    assert away == pytest.approx(values["largest_difference"], rel=1e-2) and away > 1e-3
    head = " ".join(line[3:].strip() for line in first(one).splitlines() if line.startswith("** "))
    assert f"{values['largest_difference']:.2%}" in head and "TWIN at small strain only" in head


@needs_ccx
@pytest.mark.parametrize("name", ["ten nodes", "plane stress"])
def test_elements_of_calculix_that_are_not_those_of_the_springs_are_told_of(name: str, tmp_path: Path) -> None:
    """Ten-node tetrahedra lock, and so do quadrilaterals in plane stress: the deck states by how much."""
    mesh = ts.box(*_BOX, element="tetrahedron") if name == "ten nodes" else ts.rectangle(*_STRIP)
    rule = {"element": "quadratic"} if name == "ten nodes" else {}
    problem = ts.Problem(
        mesh,
        ts.Material(1e4, 0.4),
        None if mesh.dim == 3 else _SHEET,
        [ts.Fixed(on="left")],
        [ts.Force(on="right", total=(0.0, -0.02, 0.0)[: mesh.dim])],
    )
    one = solve_springs(problem, ts.Springs("gaussian", **rule), ts.Newton(load_steps=2))
    assert one.state is not None
    ours, values = one.state.displacement, told(one)["twin"]
    found = displacements(first(one), tmp_path)[-1][: len(ours), : mesh.dim]
    away = np.linalg.norm(found - ours, axis=1).max() / np.linalg.norm(ours, axis=1).max()
    assert values["largest_difference"] == pytest.approx(away, rel=0.05) and away > 0.02


@needs_ccx
def test_prestressed_springs_are_tables_of_forces(tmp_path: Path) -> None:
    one = exported("prestressed")
    found = displacements(first(one), tmp_path)[-1]
    assert one.state is not None
    assert np.abs(found[:, :2] - one.state.displacement).max() < 1e-6 * np.abs(one.state.displacement).max()
    nodes = [[-1.0, 0.0], [0.0, 0.3], [1.0, 0.0], [0.2, -1.0]]  # nearly without rest length: a weighted mean of places
    network = ts.SpringNetwork(nodes, [[0, 1], [1, 2], [1, 3]], [3.0, 2.0, 1.0], [1e-9] * 3)
    problem = ts.Problem(network.mesh, supports=[ts.Fixed([0, 2, 3])], loads=[ts.Force([1], (0.6, 1.2))])
    pulled = displacements(spring_deck(problem, network, [1.0]), tmp_path)[-1][1]
    balance = (3 * np.array(nodes[0]) + 2 * np.array(nodes[2]) + np.array(nodes[3]) + [0.6, 1.2]) / 6
    assert pulled[:2] == pytest.approx(balance - nodes[1], abs=1e-6)


@needs_ccx
def test_the_law_of_calculix_is_the_one_that_is_solved_here(tmp_path: Path) -> None:
    """One element deformed evenly: the forces on its nodes times their places are the first Piola-Kirchhoff stress."""
    mesh = ts.box((1.0, 1.0, 1.0), (1, 1, 1))
    gradient = np.eye(3) + np.array([[0.3, 0.1, 0.05], [0.03, -0.1, 0.02], [0.07, 0.04, -0.15]])
    lines = ["*NODE, NSET=NALL", *(f"{n}, {x}, {y}, {z}" for n, (x, y, z) in enumerate(mesh.nodes.tolist(), 1))]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=BODY", ", ".join(map(str, [1, *(mesh.elements[0] + 1)]))]
    lam, mu = 9.0, 1.0
    lines += ["*MATERIAL, NAME=M", "*HYPERELASTIC, NEO HOOKE", f"{mu / 2}, {2 / (lam + 2 / 3 * mu):.12e}"]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=M", "*STEP, NLGEOM", "*STATIC", "1., 1.", "*BOUNDARY"]
    moved = mesh.nodes @ (gradient - np.eye(3)).T
    lines += [f"{n + 1}, {axis + 1}, {axis + 1}, {moved[n, axis]:.12e}" for n in range(8) for axis in range(3)]
    deck = "\n".join([*lines, "*NODE PRINT, NSET=NALL", "U, RF", "*END STEP", ""])
    displacements(deck, tmp_path)
    table = (tmp_path / "twin.dat").read_text().split("forces")[1].splitlines()
    force = np.array([[float(part) for part in line.split()[1:]] for line in table[2:10]])
    C, J = gradient.T @ gradient, np.linalg.det(gradient)
    at = condensed(
        split_neo_hookean, np.array(np.trace(C)), np.array(np.log(J)), 3, Constants(lam, mu, plane_stress=False)
    ).at
    stress = 2 * at.by_trace * gradient + at.by_y * np.linalg.inv(gradient).T
    assert force.T @ mesh.nodes == pytest.approx(stress, rel=1e-5, abs=1e-6)


def test_the_law_of_the_programs_by_its_formula() -> None:
    """-2.4 % of the stress at stretch 1.3 and Poisson's ratio 0.45; its derivatives are those of the density."""
    assert stress_difference(9.0, 1.0, 1.3) == pytest.approx(-0.024, abs=5e-4)
    assert abs(stress_difference(9.0, 1.0, 1.001)) < 1e-3
    stretch, constants, step = np.array([1.3, 0.9, 0.8]), Constants(9.0, 1.0, plane_stress=False), 1e-30
    I1, y = (stretch**2).sum(), np.log(stretch.prod())
    found = split_neo_hookean(np.array(I1), np.array(y), constants)
    for axis in range(3):
        slope = SPLIT.density(stretch + 1j * step * np.eye(3)[axis], constants).imag / step
        assert slope == pytest.approx(2 * found.by_trace * stretch[axis] + found.by_y / stretch[axis], rel=1e-12)


def test_volumes_of_bricks_and_the_control_of_their_hourglass_modes() -> None:
    """By the numerical derivative of a volume of six tetrahedra a corner; no control of an even strain."""
    rng = np.random.default_rng(2)
    corners = ts.box((1.0, 2.0, 1.5), (1, 1, 1)).nodes[ts.box((1.0, 2.0, 1.5), (1, 1, 1)).elements]
    corners = corners + 0.2 * rng.random(corners.shape)
    mesh = ts.Mesh(corners[0], [list(range(8))], "hexahedron")
    slopes, step = volume_slopes(corners)[0], 1e-6
    for node, axis in ((0, 0), (3, 1), (6, 2), (5, 0)):
        moved = [mesh.nodes.copy(), mesh.nodes.copy()]
        moved[0][node, axis] += step
        moved[1][node, axis] -= step
        change = np.subtract(*(ts.Mesh(one, mesh.elements, "hexahedron").measures[0] for one in moved))
        assert slopes[node, axis] == pytest.approx(change / (2 * step), rel=1e-6, abs=1e-8)
    oblique = ts.box((1.0, 2.0, 1.5), (1, 1, 1)).nodes[ts.box((1.0, 2.0, 1.5), (1, 1, 1)).elements] @ rng.random((3, 3))
    control = hourglass_control(oblique, np.array([3.0]))[0]
    even = oblique[0] @ rng.random((3, 3)) + rng.random(3)
    assert np.abs(control @ even).max() < 1e-12 * np.abs(control).max()
    assert np.linalg.matrix_rank(control, tol=1e-9) == 4
    cube = ts.box((2.0, 2.0, 2.0), (1, 1, 1))
    mode = np.array([1.0, 1, -1, -1, -1, -1, 1, 1])  # eta zeta, +-1 at the corners
    energy = mode @ hourglass_control(cube.nodes[cube.elements], np.array([1.0]))[0] @ mode
    assert energy == pytest.approx(5e-4 * 24 / 8 * 64, rel=1e-12)  # each derivative of the volume of 8 is 1


@pytest.mark.parametrize("target", ["calculix", "abaqus"])
@pytest.mark.parametrize("name", ["cubes", "tetrahedra", "biquadratic bricks", "volume term"])
def test_the_constants_of_a_twin_are_those_of_the_material(name: str, target: str) -> None:
    one = twin(name, 0.01, 1)
    text = first(one, target)
    lame = one.problem.materials[0].lame
    head = " ".join(line[3:].strip() for line in text.splitlines() if line.startswith("** "))
    (unit,) = re.findall(r"and (\S+) N for forces", head) or ["1e-6" if "micronewtons" in head else "1"]
    cards = re.findall(r"\*HYPERELASTIC, NEO HOOKE\n(\S+), (\S+)\n", text)
    found = [(2 * float(c10) * float(unit), 2 / float(d1) * float(unit)) for c10, d1 in cards]  # shear and bulk modulus
    total = np.sum(found, axis=0) if found else None
    if name == "biquadratic bricks":
        (young, poisson) = re.findall(r"\*ELASTIC\n(\S+), (\S+)\n", text)[0]
        assert not found and float(young) * float(unit) == pytest.approx(1e4) and float(poisson) == 0.45
    elif name == "volume term":
        shear, kappa = found[0]
        assert kappa == pytest.approx(float(one.springs.arrays["kappa"][0]), rel=1e-9) and shear <= 2e-6 * kappa
        assert one.springs.arrays["springs"].shape[0] == len(re.findall(r"^\d+, \d+, \d+$", text, re.M)) - spring2(text)
    else:
        assert total == pytest.approx([lame.mu, lame.lam + 2 / 3 * lame.mu], rel=1e-9)
    assert abs(min((float(d1) for _, d1 in cards), key=abs, default=1.0)) > 1e-10  # ccx replaces what is below


def spring2(text: str) -> int:
    """The number of SPRING2 elements of a deck."""
    parts = re.split(r"\*ELEMENT, ", text)
    return sum(len(re.findall(r"^\d+, \d+, \d+$", part, re.M)) for part in parts if part.startswith("TYPE=SPRING2"))


@pytest.mark.parametrize("target", ["calculix", "abaqus"])
def test_exported_json_states_how_a_twin_expresses_the_springs(target: str) -> None:
    cubes, coupled, volume = (
        told(twin(name, 0.01, 1), target) for name in ("cubes", "biquadratic bricks", "volume term")
    )
    assert "TWIN at small strain only" in cubes["expressed"] and cubes["files"][0] == "twin.inp"
    assert cubes["twin"]["stress_difference"]["of_materials"] == [pytest.approx(-0.024, abs=5e-4)]
    assert cubes["twin"]["largest_difference"] < 1e-3 and cubes["expected"] is not None
    assert ("at all loads" in coupled["expressed"]) == (target == "calculix")
    assert ("small strain only" in coupled["expressed"]) == (target == "abaqus")
    assert "D1 = 2 / kappa" in volume["expressed"] and volume["files"][0] == "springs.inp"
    plain = told(exported("block"), target)
    assert "twin" not in plain and plain["expressed"].startswith("springs.inp has the springs as SPRINGA")


@needs_ccx
@pytest.mark.verification
@pytest.mark.parametrize("study", ["soft_block", "tissue"])
def test_shipped_bodies_in_calculix(study: str, tmp_path: Path) -> None:
    from tests.test_examples import EXAMPLES
    from truespring.study import export_study, read_study

    (written,) = export_study(read_study(EXAMPLES / f"{study}.toml"), ["calculix"], tmp_path)
    deck = next(file for file in written.files if file.name == "twin.inp")
    found, state = displacements(deck.read_text(), tmp_path)[-1], written.exported.state
    assert state is not None
    values = json.loads((deck.parent / "exported.json").read_text())["twin"]
    ours = state.displacement
    away = np.linalg.norm(found[: len(ours)] - ours, axis=1).max() / np.linalg.norm(ours, axis=1).max()
    assert away < values["largest_difference"] + 0.01
    assert read_dat(tmp_path / "twin.dat").levels


@needs_ccx
@pytest.mark.verification
@pytest.mark.parametrize(("share", "rms", "probe"), [(0.01, 1e-3, 1e-4), (1.0, 0.015, 5e-3)])
def test_the_organ_in_calculix(share: float, rms: float, probe: float, tmp_path: Path) -> None:
    """At full load the law differs, and the mean strain of its elements; the header states where its probe is."""
    from tests.test_examples import EXAMPLES
    from truespring.study import export_study, read_study

    changes = {
        "solver.load_steps": 1,
        "support.2.displacement": [0.003 * share, -0.006 * share, 0.0],
        "load.1.gravity": [0.0, -9.81 * share, 0.0],
    }
    (written,) = export_study(read_study(EXAMPLES / "organ.toml", **changes), ["calculix"], tmp_path)
    deck = next(file for file in written.files if file.name == "twin.inp")
    found = displacements(deck.read_text(), tmp_path)[-1]
    assert distance(written.exported, found) < rms
    values = json.loads((deck.parent / "exported.json").read_text())["twin"]
    away = np.linalg.norm(found[written.exported.probe] - values["probe_displacement"])
    assert away < probe * np.linalg.norm(found, axis=1).max()
