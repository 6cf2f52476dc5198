"""Natural frequencies: against closed forms, beam theory and a dense solver; rigid-body motions; pairs; the verb."""

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy.linalg import eigh

import truespring as ts
from tests.calculix import needs_ccx
from tests.near import near
from tests.studies import changed
from tests.test_examples import EXAMPLES
from truespring.arrays import Floats
from truespring.cli import main
from truespring.errors import ModelError, ProblemError
from truespring.potential import Potential
from truespring.reference.ccx import run_ccx
from truespring.study import read_study
from truespring.vibration import Modes, assurance, like, pairs, study_modes

SOFT = ts.Material(young=1e6, poisson=0.3, density=1000.0)
SVK = ts.Fem(law="saint-venant-kirchhoff")
# First root of cos x cosh x = -1.
ALL = ts.Box((-1.0, -1.0), (2.0, 2.0))
CANTILEVER = 1.8751040687


def body(mesh: ts.Mesh, *supports: ts.Fixed, material: ts.Material = SOFT) -> ts.Problem:
    section = ts.PlaneStress(0.01) if mesh.dim == 2 else None
    return ts.Problem(mesh, material, section, supports, stated=False)


def dense(problem: ts.Problem, potential: Potential, mass: Floats, held: np.ndarray) -> Floats:
    """All eigenvalues of K u = omega^2 M u, ascending."""
    free = ~held.ravel()
    stiffness = potential.hessian(potential.nodes).toarray()[np.ix_(free, free)]
    return np.asarray(eigh(stiffness, np.diag(np.repeat(mass, held.shape[1])[free]), eigvals_only=True))


def bending(root: float, length: float, height: float) -> float:
    """The frequency of a beam by Euler and Bernoulli [Hz]."""
    return float(root**2 / length**2 * np.sqrt(1e6 / 1000 * height**2 / 12) / (2 * np.pi))


def test_a_row_of_elements_is_a_chain_of_masses() -> None:
    """Fixed at one end, with half a mass at the other: omega = 2 c / h sin((2 k - 1) pi / (4 n))."""
    n, h = 20, 0.05
    problem = body(
        ts.rectangle((n * h, h), (n, 1)),
        ts.Fixed(on="left"),
        ts.Fixed(on=ALL, fix=["y"]),
        material=ts.Material(young=1e6, poisson=0.0, density=1000.0),
    )
    found = ts.modes(problem, ts.Fem(law="linear"), 4)
    k = np.arange(1, 5)
    assert found.frequencies == near(np.sqrt(1e3) / (np.pi * h) * np.sin((2 * k - 1) * np.pi / (4 * n)), rel=1e-10)
    along = problem.mesh.nodes[:, 0] / (n * h)
    for number, shape in zip(k, found.shapes, strict=True):
        assert abs(shape[:, 0]) == near(abs(np.sin((2 * number - 1) * np.pi / 2 * along)), abs=1e-7)
    # The mean of sin^2 over the nodes, half of it at the end, is 1/2.
    assert found.modal_mass == near(np.full(4, 1000 * 0.01 * h * n * h / 2), rel=1e-6)


@pytest.mark.parametrize(
    "model", [SVK, ts.Springs(rule="gaussian"), ts.Springs(rule="lloyd")], ids=lambda one: one.label
)
def test_a_bar_swings_along_itself_at_a_quarter_wave(model: Any) -> None:
    """f = c / (4 L), c^2 = E / rho with the modulus that the model has along the bar; its width is free."""
    problem = body(ts.rectangle((1.0, 0.05), (40, 2)), ts.Fixed(on="left", fix=["x"]), ts.Fixed(on=[1], fix=["y"]))
    young = 1e6 if not model.has_springs else ts.moduli(problem, model).young(0.0)
    found = ts.modes(problem, model, 8)
    share = (found.shapes[:, :, 0] ** 2).sum(axis=1) / (found.shapes**2).sum(axis=(1, 2))
    (frequency,) = found.frequencies[share > 0.97][:1]
    assert frequency == pytest.approx(np.sqrt(young / 1000) / 4, rel=1e-3)


def test_a_cantilever_swings_as_a_beam() -> None:
    """Quadratic triangles: within 1 % of Euler and Bernoulli, below it by shear and rotation."""
    mesh = ts.rectangle((1.0, 0.05), (40, 2), "triangle")
    found = ts.modes(body(mesh, ts.Fixed(on="left")), replace(SVK, element="quadratic"), 1)
    assert found.frequencies[0] == pytest.approx(bending(CANTILEVER, 1.0, 0.05), rel=0.01)
    # Four-node elements lock: 5.7 % above on this mesh, a quarter of it with elements of half the size.
    off = [
        ts.modes(body(ts.rectangle((1.0, 0.05), (40 * n, 2 * n)), ts.Fixed(on="left")), SVK, 1).frequencies[0]
        / bending(CANTILEVER, 1.0, 0.05)
        - 1
        for n in (1, 2)
    ]
    assert off[0] == pytest.approx(0.057, abs=0.002) and off[1] == pytest.approx(off[0] / 4, abs=0.004)


@pytest.mark.parametrize("linear", ["direct", "multigrid"])
@pytest.mark.parametrize("held", [True, False])
def test_lobpcg_finds_what_a_dense_solver_finds(linear: str, held: bool) -> None:
    problem = body(ts.box((0.4, 0.1, 0.1), (9, 3, 3)), *([ts.Fixed(on="left")] if held else []))
    model = ts.Springs(rule="gaussian")
    found = ts.modes(problem, model, 7, linear)
    assert found.method == "LOBPCG" and found.converged
    n_rigid = 0 if held else 6
    assert found.n_rigid == n_rigid
    expected = dense(problem, model.potential(problem), problem.mass, problem.loading.held)
    assert abs(expected[:n_rigid]).max(initial=0.0) < 1e-9 * expected[-1]
    assert found.eigenvalues == near(expected[n_rigid : n_rigid + 7], rel=1e-8)
    # The first two are a pair: a square section bends in any direction.
    assert found.eigenvalues[1] == pytest.approx(found.eigenvalues[0], rel=1e-8)
    # A shape and its frequency fulfil K u = omega^2 M u.
    stiffness = model.potential(problem).hessian(problem.mesh.nodes)
    for value, shape in zip(found.eigenvalues, found.shapes, strict=True):
        force = (stiffness @ shape.ravel()).reshape(shape.shape) - value * problem.mass[:, None] * shape
        force[problem.loading.held] = 0.0
        assert abs(force).max() < 1e-5 * abs(value * problem.mass[:, None] * shape).max()


def test_second_order_nodes_have_mass() -> None:
    problem = body(ts.box((0.2, 0.1, 0.1), (3, 1, 1), "tetrahedron"))
    model = replace(SVK, element="quadratic")
    potential: Any = model.potential(problem)
    mass = potential.lumped_mass()
    assert mass.sum() == pytest.approx(2.0)
    expected = dense(problem, potential, mass, potential.loading.held)
    assert ts.modes(problem, model, 5).eigenvalues == near(expected[6:11], rel=1e-8)


@pytest.mark.parametrize(
    ("supports", "n_rigid"),
    [
        ((), 3),
        ((ts.Fixed(on="bottom", fix=["y"]),), 1),
        ((ts.Fixed(on=[0]),), 1),
        ((ts.Fixed(on="left"),), 0),
    ],
)
def test_motions_that_supports_leave_are_counted(supports: tuple[ts.Fixed, ...], n_rigid: int) -> None:
    mesh = ts.rectangle((1.0, 0.05), (40, 2))
    problem = body(mesh, *supports)
    found = ts.modes(problem, SVK, 3)
    assert found.n_rigid == n_rigid and found.stable and not found.warnings
    expected = dense(problem, SVK.potential(problem), problem.mass, problem.loading.held)
    assert found.eigenvalues == near(expected[n_rigid : n_rigid + 3], rel=1e-7)


def test_a_stiff_body_on_a_soft_layer_is_not_free() -> None:
    """It bounces on the layer, ten orders of magnitude softer, as a mass on a spring, and rocks on it."""
    soft = ts.Region(ts.Box((0.0, 0.0), (1.0, 0.1)), ts.Material(young=1e-2, poisson=0.0, density=1e-6))
    mesh = ts.rectangle((1.0, 1.0), (4, 10))
    stiff = ts.Material(young=1e8, poisson=0.0, density=1000.0)
    problem = replace(body(mesh, ts.Fixed(on="bottom"), material=stiff), regions=[soft])
    found = ts.modes(problem, ts.Fem(law="linear"), 3)
    assert found.n_rigid == 0 and found.converged
    assert found.eigenvalues[1] == pytest.approx(1e-2 / 0.1 / (1000 * 0.9), rel=1e-3)


def test_parts_that_nothing_joins_move_each_for_itself() -> None:
    one = ts.rectangle((1.0, 0.1), (10, 1))
    both = ts.Mesh(
        np.concatenate([one.nodes, one.nodes + 2.0]), np.concatenate([one.elements, one.elements + one.n_nodes])
    )
    alone, twice = ts.modes(body(one), SVK, 2), ts.modes(body(both), SVK, 4)
    assert (alone.n_rigid, twice.n_rigid) == (3, 6)
    assert twice.frequencies == near(np.repeat(alone.frequencies, 2), rel=1e-8)


def test_fewer_modes_than_asked_for_where_there_are_no_more() -> None:
    found = ts.modes(body(ts.rectangle((1.0, 1.0), (1, 1))), SVK, 100)
    assert found.n_rigid == 3 and found.shapes.shape == (5, 4, 2)


class Turned:
    """The potential of a model with another sign, or with none at all for the motion along y."""

    def __init__(self, potential: Potential, along: tuple[float, float]) -> None:
        self.nodes, self._potential, self._along = potential.nodes, potential, np.array(along)

    def energy(self, positions: Floats) -> float:
        return 0.0

    def gradient(self, positions: Floats) -> Floats:
        return np.zeros(positions.shape)

    def hessian(self, positions: Floats) -> Any:
        matrix = self._potential.hessian(positions).copy()
        matrix.data = matrix.data * self._along[:, None] * abs(self._along)
        return matrix


def test_an_unstable_body_and_a_mechanism_are_named() -> None:
    problem = body(ts.rectangle((1.0, 0.5), (4, 2)), ts.Fixed(on="left"))
    potential = SVK.potential(problem)
    unstable = ts.modes(problem, Turned(potential, (-1.0, -1.0)), 3)
    assert not unstable.stable and np.isnan(unstable.frequencies).all() and "unstable" in unstable.warnings[0]
    loose = ts.modes(problem, Turned(potential, (1.0, 0.0)), 3)
    assert loose.n_rigid == 0 and (loose.frequencies == 0).all() and "mechanism" in loose.warnings[0]


def test_a_body_without_stiffness_does_not_vibrate() -> None:
    problem = body(ts.rectangle((1.0, 0.5), (2, 1)))
    with pytest.raises(ModelError, match="rigid"):
        ts.modes(problem, Turned(SVK.potential(problem), (0.0, 0.0)))


def test_almost_all_modes_of_a_large_body_are_not_computed() -> None:
    with pytest.raises(ProblemError, match=r"count = 5000.* 4,\d\d\d modes"):
        ts.modes(body(ts.rectangle((1.0, 1.0), (110, 110))), SVK, 5000)


def test_springs_under_tension_at_rest_are_named() -> None:
    problem = body(ts.rectangle((1.0, 0.5), (2, 1)), ts.Fixed(on="left"))
    springs = problem.mesh.edges
    network = ts.SpringNetwork(
        problem.mesh.nodes, springs, np.full(len(springs), 1e3), rest_length=np.full(len(springs), 0.4)
    )
    assert "not in equilibrium" in ts.modes(problem, network, 3).warnings[0]


def test_the_shipped_cantilever_swings_as_its_comment_says() -> None:
    """Euler and Bernoulli in bending, whose error by shear grows with the mode; a quarter wave along the axis."""
    found = study_modes(read_study(EXAMPLES / "cantilever_modes.toml"), 4)
    fem = found.found["fem"].frequencies[:4]
    speed, beam = np.sqrt(1e6 / 1100), np.array([CANTILEVER, 4.6940911330, 7.8547574382]) ** 2 / (2 * np.pi)
    assert fem[:2] == near(beam[:2] * 0.01 / 0.2**2 * speed / np.sqrt(12), rel=0.015)
    assert fem[2] == pytest.approx(beam[2] * 0.01 / 0.2**2 * speed / np.sqrt(12), rel=0.035)
    assert fem[3] == pytest.approx(speed / 0.8, rel=0.005)
    # The same springs and elements have the same small strains.
    assert found.found["springs"].frequencies[:4] == near(fem, rel=1e-5)


@needs_ccx
def test_calculix_finds_the_same_frequencies(tmp_path: Path) -> None:
    """Its mass is consistent, ours is lumped: 1 % apart in bending, 3 % in torsion of three elements, 0.1 % along."""
    problem = body(ts.box((0.4, 0.1, 0.1), (12, 3, 3), "tetrahedron"), ts.Fixed(on="left"))
    model = ts.Fem(law="linear", element="quadratic")
    potential: Any = model.potential(problem)
    nodes = [f"{number}, {x:.12g}, {y:.12g}, {z:.12g}" for number, (x, y, z) in enumerate(potential.nodes, 1)]
    elements = [", ".join(map(str, (number, *one))) for number, one in enumerate(potential.elements + 1, 1)]
    held = [f"{node + 1}, 1, 3" for node in np.flatnonzero(potential.loading.held.all(axis=1))]
    material = ["*MATERIAL, NAME=M", "*ELASTIC", "1e6, 0.3", "*DENSITY", "1000"]
    step = ["*SOLID SECTION, ELSET=ALL, MATERIAL=M", "*STEP", "*FREQUENCY", "6", "*END STEP", ""]
    deck = ["*NODE", *nodes, "*ELEMENT, TYPE=C3D10, ELSET=ALL", *elements, "*BOUNDARY", *held, *material, *step]
    (tmp_path / "twin.inp").write_text("\n".join(deck), encoding="utf-8")
    assert run_ccx(tmp_path / "twin.inp", threads=1).code == 0
    rows = [line.split() for line in (tmp_path / "twin.dat").read_text(encoding="utf-8").splitlines()]
    theirs = np.array([float(row[3]) for row in rows if len(row) == 5 and row[0].isdigit()])[:6]
    mine = ts.modes(problem, model).frequencies
    assert abs(mine / theirs - 1) == near(np.zeros(6), abs=0.03)
    assert abs(mine / theirs - 1)[[0, 1, 3, 4]] == near(np.zeros(4), abs=0.01)
    assert mine[5] == pytest.approx(theirs[5], rel=1e-3)


# --- bad input --------------------------------------------------------------------------------------------


def test_wrong_input_is_named() -> None:
    mesh = ts.rectangle((1.0, 0.5), (2, 1))
    with pytest.raises(ProblemError, match="density"):
        ts.modes(body(mesh, material=ts.Material(young=1e6, poisson=0.3)), SVK)
    for count in (0, -1, 2.5, True):
        with pytest.raises(ProblemError, match="count"):
            ts.modes(body(mesh), SVK, count)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="linear"):
        ts.modes(body(mesh), SVK, linear="gauss")
    with pytest.raises(ProblemError, match="held"):
        ts.modes(body(mesh, ts.Fixed(on=ALL)), SVK)
    with pytest.raises(ModelError, match="another program"):
        ts.modes(body(mesh), ts.CalculiX())


# --- pairs ------------------------------------------------------------------------------------------------


def mixed(modes: Modes, matrix: Floats) -> Modes:
    """Modes with shapes that are combinations."""
    return replace(modes, shapes=np.einsum("kl,lni->kni", matrix, modes.shapes))


def test_shapes_are_paired_not_numbers() -> None:
    found = ts.modes(body(ts.rectangle((1.0, 0.1), (20, 2)), ts.Fixed(on="left")), SVK, 4)
    assert assurance(found, found) == near(np.eye(4), abs=1e-9)
    order = np.array([1, 0, 3, 2])
    other = replace(found, shapes=-found.shapes[order], eigenvalues=4 * found.eigenvalues[order])
    assert [(one.reference, one.mode) for one in pairs(found, other)] == [(0, 1), (1, 0), (2, 3), (3, 2)]
    assert [one.difference for one in pairs(found, other)] == near(np.ones(4), rel=1e-12)
    assert [one.mac for one in pairs(found, other)] == near(np.ones(4), rel=1e-9)


def test_a_pair_of_equal_frequencies_is_compared_by_its_span() -> None:
    found = ts.modes(body(ts.box((0.4, 0.1, 0.1), (6, 2, 2)), ts.Fixed(on="left")), SVK, 3)
    turn = np.eye(3)
    turn[:2, :2] = [[np.cos(0.8), np.sin(0.8)], [-np.sin(0.8), np.cos(0.8)]]
    assert (found.shapes[0] * found.shapes[1]).sum() == pytest.approx(0.0, abs=1e-6)
    unit = replace(found, shapes=found.shapes / np.sqrt(found.modal_mass)[:, None, None])
    assert [(one.reference, one.mode) for one in pairs(unit, mixed(unit, turn))] == [(0, 0), (1, 1), (2, 2)]
    assert [one.mac for one in pairs(unit, mixed(unit, turn))] == near(np.ones(3), abs=1e-9)
    # Figures show the combination that looks like the mode of the reference.
    for number in range(3):
        drawn = like(mixed(unit, turn), number, -found.shapes[number])
        assert drawn == near(-found.shapes[number], abs=1e-9)


def test_a_mode_beyond_those_asked_for_is_listed_where_it_has_their_shape(tmp_path: Path) -> None:
    found = study_modes(read_study(study(tmp_path)), 2)
    springs = found.found["springs"]
    order = np.array([0, 2, 1, 3, 4])
    moved = replace(springs, shapes=springs.shapes[order], eigenvalues=springs.eigenvalues[:5])
    found = replace(found, found={**found.found, "springs": moved})
    assert [(one.reference, one.mode) for one in found.pairs["springs"]] == [(0, 0), (1, 2), (2, 1)]
    assert found.shown("linear") == found.shown("springs") == [0, 1, 2]
    assert [row["reference_mode"] for row in found.rows] == [1, 3, 2, None, None, None]
    assert found.values["models"]["linear"]["modes"][2]["mode"] == 3


# --- the verb ---------------------------------------------------------------------------------------------


def study(folder: Path, *more: tuple[str, str]) -> str:
    file = folder / "study.toml"
    file.write_text(changed(("poisson = 0.3\n", 'poisson = 0.3\ndensity = "1000 kg/m^3"\n'), *more), encoding="utf-8")
    return str(file)


def test_the_verb_writes_and_prints(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert main(["modes", study(tmp_path), "--count", "2", "--animate", "--out", str(out)]) == 0
    table = capsys.readouterr().out
    with (out / "study" / "modes.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["model"], row["mode"]) for row in rows] == [
        (model, mode) for model in ("springs", "linear") for mode in ("1", "2")
    ]
    springs, linear = (float(rows[place]["frequency [Hz]"]) for place in (0, 2))
    assert float(rows[0]["difference"]) == pytest.approx(springs / linear - 1) and float(rows[0]["mac"]) > 0.99
    assert f"{springs:.6g}" in table and f"{linear:.6g}" in table and f"{100 * (springs / linear - 1):+.2f} %" in table
    for name in ("springs", "linear"):
        collection = (out / "study" / f"{name}_modes.pvd").read_text(encoding="utf-8")
        assert collection.count("<DataSet") == 2
        assert (out / "study" / f"{name}_modes" / f"{name}_modes_0002.vtu").exists()
    assert (out / "study/figures/modes.svg").read_bytes().startswith(b"<?xml")
    with Image.open(out / "study/mode_2.gif") as film:
        assert film.n_frames == 24
    assert not (out / "study/mode_3.gif").exists()


def test_json_and_quiet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "out")
    assert main(["modes", study(tmp_path), "--count", "1", "--json", "--out", out]) == 0
    shown = capsys.readouterr().out
    values = json.loads(shown)
    assert values == json.loads((tmp_path / "out/study/modes.json").read_text(encoding="utf-8"))
    assert values["reference"] == "linear" and values["models"]["springs"]["n_rigid"] == 0
    assert main(["modes", study(tmp_path), "--count", "1", "--quiet", "--out", out]) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert Path(line).is_file()


def test_a_study_without_supports_and_loads_has_modes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lone = (('[[support]]\non = "left"\n', ""), ('[[load]]\non = "right"\nforce = ["0 N", "-0.01 N"]\n', ""))
    file = study(tmp_path, *lone)
    assert main(["modes", file, "--json", "--count", "1", "--out", str(tmp_path / "out")]) == 0
    values = json.loads(capsys.readouterr().out)
    assert [one["n_rigid"] for one in values["models"].values()] == [3, 3]
    assert main(["solve", file, "--out", str(tmp_path / "out")]) == 2


def test_without_density_the_verb_says_where_it_belongs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "study.toml"
    file.write_text(changed(), encoding="utf-8")
    assert main(["modes", str(file), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert f"{file}:8: material" in told and "density" in told


def test_a_study_in_python(tmp_path: Path) -> None:
    found = study_modes(read_study(study(tmp_path)), 3)
    assert found.table().height == len(found.rows) and set(found.figures()) == {"modes"}
