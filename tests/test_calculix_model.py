"""CalculiX as a model of a study: what its paths hold, beside our own, and what is said where it cannot be."""

import csv
import json
import math
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.calculix import needs_ccx
from tests.studies import changed, written
from tests.test_examples import EXAMPLES
from truespring.cli import main
from truespring.errors import ExportError, ModelError
from truespring.reference import CalculiX
from truespring.reference.ccx import run_ccx
from truespring.study import read_study, run

# A thickness of a quarter of the height, and what bends it by half its length.
THIN = (('thickness = "10 mm"', 'thickness = "2.5 mm"'), ('"-0.01 N"', '"-0.0027 N"'))
MODELS = """\
[models.nonlinear]
kind = "fem"
law = "saint-venant-kirchhoff"

[models.calculix]
kind = "calculix"

[models.calculix-linear]
kind = "calculix"
law = "linear"

[models.calculix-springs]
kind = "calculix"
springs = "springs"

[compare]
"""
#: Our model beside each of CalculiX, and how near they are: the root mean square at each level over that of ours.
TWINS = {
    "calculix": ("nonlinear", 7e-3),
    "calculix-linear": ("linear", 7e-3),
    "calculix-springs": ("springs", 1e-6),
}


def gap(theirs: ts.Solution, ours: ts.Solution) -> float:
    """The largest rms distance over rms displacement of all levels; both have them all."""
    assert theirs.load_factors == pytest.approx(ours.load_factors) and len(ours.states) > 1
    errors = [
        np.linalg.norm(one.displacement - other.displacement) / np.linalg.norm(other.displacement)
        for one, other in zip(theirs.states[1:], ours.states[1:], strict=True)
    ]
    return float(max(errors))


# --- through the command line ------------------------------------------------------------------------------------


@needs_ccx
def test_a_study_runs_calculix_at_every_level(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path, changed(*THIN, ("[compare]\n", MODELS), ("load_steps = 2", "load_steps = 4")))
    assert main(["verify", str(file), "--out", str(tmp_path), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    with (tmp_path / "study" / "curves.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    for name, (ours, near) in TWINS.items():
        found = told["models"][name]
        assert found["kind"] == "calculix" and found["status"] == "converged" and found["seconds"] > 0
        assert any("stability not proven" in warning for warning in found["warnings"])
        mine, theirs = ([row for row in rows if row["model"] == one] for one in (ours, name))
        assert [float(row["load_factor"]) for row in theirs] == [0, 0.25, 0.5, 0.75, 1]
        for one, other in zip(theirs[1:], mine[1:], strict=True):
            moved = np.array([[float(row[key]) for key in ("ux", "uy")] for row in (one, other)])
            assert np.linalg.norm(moved[0] - moved[1]) < near * np.linalg.norm(moved[1])
            assert float(one["fy"]) == pytest.approx(float(other["fy"]))
        assert len(list((tmp_path / "study" / name).glob("*.vtu"))) == 5
    labels = [told["models"][name]["label"] for name in TWINS]
    assert labels == ["CalculiX CPS4 NLGEOM", "CalculiX CPS4 linear", "CalculiX SPRINGA NLGEOM"]
    page = (tmp_path / "report.html").read_text("utf-8")
    assert page.count("not checked</td>") == 3 and "read from a file" not in page


@needs_ccx
def test_check_tells_of_it_and_converge_runs_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    one = '[models.calculix]\nkind = "calculix"\nlaw = "linear"\n\n[compare]\n'
    file = written(tmp_path, changed(*THIN, ("[compare]\n", one)))
    assert main(["check", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["models"]["calculix"]["label"] == "CalculiX CPS4 linear"
    main(["converge", str(file), "--meshes", "2", "--json", "--out", str(tmp_path)])
    told = json.loads(capsys.readouterr().out)
    energies = {found["model"]: found["values"] for found in told if found["quantity"] == "energy"}
    assert len(energies["calculix"]) == 2
    assert energies["calculix"] == pytest.approx(energies["linear"], rel=2e-2)


# --- agreement ---------------------------------------------------------------------------------------------------


@needs_ccx
@pytest.mark.parametrize(
    ("law", "name", "load_steps"),
    [
        *(("linear", name, 2) for name in ("bending", "stretching", "soft_block", "tissue")),
        ("saint-venant-kirchhoff", "bending", 10),
        pytest.param("saint-venant-kirchhoff", "stretching", 10, marks=pytest.mark.verification),
        pytest.param("saint-venant-kirchhoff", "tissue", 5, marks=pytest.mark.verification),
        pytest.param("saint-venant-kirchhoff", "soft_block", 5, marks=pytest.mark.verification),
    ],
)
def test_shipped_studies_agree(law: str, name: str, load_steps: int) -> None:
    """Plane stress is a layer of bricks there; in space both are the same elements, to the digits printed."""
    problem, newton = read_study(EXAMPLES / f"{name}.toml").problem, ts.Newton(load_steps=load_steps)
    theirs = CalculiX(law, element="linear").run(problem, newton)
    ours = ts.solve(problem, ts.Fem(law, "linear"), newton)  # type: ignore[arg-type]
    assert theirs.status is ts.Status.CONVERGED
    near = {"bending": 7e-3, "stretching": 5e-4}.get(name, 1e-6)
    assert gap(theirs, ours) < near
    energies = [[state.energy for state in path.states[1:]] for path in (theirs, ours)]
    assert energies[0] == pytest.approx(energies[1], rel=near)


@needs_ccx
@pytest.mark.verification
def test_the_organ_agrees() -> None:
    """Nearly ten thousand voxels as shipped, where St. Venant-Kirchhoff's law collapses: see test_calculix for it."""
    study = read_study(EXAMPLES / "organ.toml")
    theirs = CalculiX("linear").run(study.problem, study.solver)
    ours = ts.solve(study.problem, ts.Fem("linear", "linear"), study.solver)
    assert gap(theirs, ours) < 1e-3


def moved(**motion: object) -> ts.Problem:
    """A box whose right end is moved."""
    return ts.Problem(
        ts.box((0.08, 0.02, 0.02), (8, 2, 2)),
        ts.Material(10e3, 0.3),
        supports=[ts.Fixed("left"), ts.Fixed("right", **motion)],  # type: ignore[arg-type]
    )


@needs_ccx
@pytest.mark.parametrize("law", ["linear", "saint-venant-kirchhoff"])
def test_turned_supports_stand_exactly_at_every_level_and_tell_their_force(law: str) -> None:
    problem = moved(displacement=(0.01, 0.005, 0.0), rotation=2.0, axis=(1.0, 0.0, 0.0))
    newton = ts.Newton(load_steps=4)
    theirs, ours = CalculiX(law).run(problem, newton), ts.solve(problem, ts.Fem(law, "linear"), newton)
    for one, other in zip(theirs.states[1:], ours.states[1:], strict=True):
        motion = problem.loading.motion(one.load_factor)
        held = problem.loading.held
        assert one.displacement[held] == pytest.approx(motion[held], rel=1e-6, abs=1e-12)
        size = float(np.abs(other.reaction).max())
        assert np.abs(one.reaction - other.reaction).max() < 1e-5 * size
        assert theirs.applied_force(one) == pytest.approx(ours.applied_force(other), rel=1e-5, abs=1e-6 * size)
    assert np.linalg.norm(theirs.applied_force(theirs.states[-1])) > 1e-2
    compared = ts.compare(ours, theirs)
    assert compared.force_error is not None and compared.force_error < 1e-5


@needs_ccx
def test_loads_of_every_sort_are_taken_off_the_reactions() -> None:
    """What ccx prints of a held node has the loads on it too: reactions must balance all of them."""
    around = [ts.Fixed(side) for side in ("left", "right", "back", "front")]
    loads = [ts.Pressure("top", 600.0), ts.Gravity((0.3, -0.4, 0.1)), ts.Traction("bottom", (0.0, -2.0, 1.0))]
    slab = ts.Problem(
        ts.box((0.16, 0.03, 0.08), (8, 2, 4)), ts.Material(10e3, 0.3, density=1000.0), None, around, loads
    )
    for law in ("linear", "saint-venant-kirchhoff"):
        theirs = CalculiX(law).run(slab, ts.Newton(load_steps=2))
        ours = ts.solve(slab, ts.Fem(law, "linear"), ts.Newton(load_steps=2))
        for one, other in zip(theirs.states[1:], ours.states[1:], strict=True):
            assert one.applied_force == pytest.approx(other.applied_force, rel=1e-5)
            assert one.reaction.sum(axis=0) == pytest.approx(-one.applied_force, rel=1e-5)
            assert np.abs(one.reaction - other.reaction).max() < 1e-4 * np.abs(other.reaction).max()
        assert gap(theirs, ours) < 1e-4


@needs_ccx
def test_regions_have_their_materials() -> None:
    mesh = ts.rectangle((0.16, 0.04), (16, 4))
    inside = ts.Region(ts.Box((0.04, 0.0), (0.08, 0.04)), ts.Material(40e3, 0.2))
    outside = ts.Region(ts.Box((0.12, 0.0), (0.16, 0.02)), ts.Material(2e3, 0.4))
    problem = ts.Problem(
        mesh,
        ts.Material(10e3, 0.3),
        ts.PlaneStrain(0.01),
        [ts.Fixed("left")],
        [ts.Force("right", (0.0, -0.04))],
        [inside, outside],
    )
    newton = ts.Newton(load_steps=2)
    theirs = CalculiX().run(problem, newton)
    ours = ts.solve(problem, ts.Fem("saint-venant-kirchhoff"), newton)
    assert gap(theirs, ours) < 1e-6
    alike = ts.solve(replace(problem, regions=()), ts.Fem("saint-venant-kirchhoff"), newton)
    assert gap(theirs, alike) > 0.1


@needs_ccx
def test_triangles() -> None:
    """Of plane strain the same elements; CPS3 is a wedge with free faces, stiffer on a coarse mesh."""

    def problem(section: ts.PlaneStrain | ts.PlaneStress, rows: int) -> ts.Problem:
        mesh, force = ts.rectangle((0.16, 0.04), (4 * rows, rows), "triangle"), ts.Force("right", (0.0, -0.01))
        return ts.Problem(mesh, ts.Material(10e3, 0.3), section, [ts.Fixed("left")], [force])

    def apart(asked: ts.Problem) -> tuple[str, float]:
        theirs = CalculiX(element="linear").run(asked, ts.Newton(load_steps=4))
        ours = ts.solve(asked, ts.Fem("saint-venant-kirchhoff", "linear"), ts.Newton(load_steps=4))
        return theirs.label, gap(theirs, ours)

    label, strain = apart(problem(ts.PlaneStrain(0.002), 4))
    assert label == "CalculiX CPE3 NLGEOM" and strain < 1e-6
    coarse, fine = (apart(problem(ts.PlaneStress(0.002), rows)) for rows in (4, 8))
    assert fine[0] == "CalculiX CPS3 NLGEOM" and fine[1] < 7e-3 and fine[1] < 0.4 * coarse[1]


@needs_ccx
@pytest.mark.parametrize("kind", ["triangle", "tetrahedron"])
def test_elements_of_second_order_are_the_default_on_simplices(kind: str) -> None:
    """CPE6 and C3D10: what CalculiX tells between the corners is kept, and reactions balance the loads."""
    space = kind == "tetrahedron"
    mesh = ts.box((0.08, 0.02, 0.02), (4, 1, 1), kind) if space else ts.rectangle((0.08, 0.02), (4, 1), kind)
    section = None if space else ts.PlaneStrain(0.02)
    load = ts.Traction("right", (0.0, -20.0, 8.0)[: mesh.dim])
    problem = ts.Problem(mesh, ts.Material(10e3, 0.3), section, [ts.Fixed("left")], [load])
    newton = ts.Newton(load_steps=4)
    theirs = CalculiX().run(problem, newton)
    ours = ts.solve(problem, ts.Fem("saint-venant-kirchhoff"), newton)
    assert theirs.label == f"CalculiX {'C3D10' if space else 'CPE6'} NLGEOM"
    one, other = theirs.states[-1], ours.states[-1]
    size = np.abs(other.displacement).max()
    assert size > 0.1 * 0.08
    assert np.abs(theirs.whole.points - ours.whole.points).max() < 1e-15
    assert np.abs(one.all_positions - other.all_positions).max() < 1e-6 * size
    assert np.abs(one.reaction - other.reaction).max() < 1e-5 * np.abs(other.reaction).max()
    assert one.energy == pytest.approx(other.energy, rel=1e-5) and theirs.n_unknowns == ours.n_unknowns


@needs_ccx
def test_a_pressure_on_a_sheet_whose_thickness_changes_is_told() -> None:
    """Pushed in by a quarter of its height: CalculiX presses on the thickness as it has become."""
    problem = ts.Problem(
        ts.rectangle((0.16, 0.04), (16, 4)),
        ts.Material(10e3, 0.3),
        ts.PlaneStress(0.002),
        [ts.Fixed("left"), ts.Fixed("right")],
        [ts.Pressure("top", 200.0)],
    )
    told = CalculiX().run(problem, ts.Newton(load_steps=4))
    assert any("thickness" in warning for warning in told.warnings)
    assert 7e-3 < gap(told, ts.solve(problem, ts.Fem("saint-venant-kirchhoff"), ts.Newton(load_steps=4))) < 2e-2
    linear = CalculiX("linear").run(problem, ts.Newton(load_steps=4))
    assert not any("thickness" in warning for warning in linear.warnings)
    assert gap(linear, ts.solve(problem, ts.Fem("linear"), ts.Newton(load_steps=4))) < 3e-3


@needs_ccx
def test_a_moment_is_forces_on_nodes_in_a_linear_theory() -> None:
    problem = ts.Problem(
        ts.rectangle((0.16, 0.04), (16, 4)),
        ts.Material(10e3, 0.3),
        ts.PlaneStrain(0.01),
        [ts.Fixed("left")],
        [ts.Moment("right", 1e-3)],
    )
    newton = ts.Newton(load_steps=1)
    assert gap(CalculiX("linear").run(problem, newton), ts.solve(problem, ts.Fem("linear"), newton)) < 1e-6
    with pytest.raises(ExportError, match="rotation of a support"):
        CalculiX().run(problem, newton)


@needs_ccx
def test_energy_is_told_where_it_is_known() -> None:
    """Of several increments in a step ccx prints the energy of the last; few levels take several."""
    problem = moved(displacement=(0.02, 0.0, 0.0))
    few, ours = CalculiX().run(problem, ts.Newton(load_steps=2)), ts.solve(problem, ts.Fem("saint-venant-kirchhoff"))
    assert math.isnan(few.states[1].energy) and math.isnan(few.states[2].energy)
    assert any("energy is not known at load factor 0.5" in warning for warning in few.warnings)
    assert few.states[2].displacement == pytest.approx(ours.states[-1].displacement, abs=1e-7)
    known = CalculiX().run(problem, ts.Newton(load_steps=4)).states[-1].energy
    assert known == pytest.approx(ours.states[-1].energy, rel=1e-6)


# --- springs -----------------------------------------------------------------------------------------------------


@needs_ccx
def test_springs_in_space_agree_and_tell_energy_and_stretch() -> None:
    problem, newton = moved(displacement=(0.02, 0.01, 0.0)), ts.Newton(load_steps=3)
    springs = ts.Springs("isotropic")
    theirs, ours = CalculiX(springs=springs).run(problem, newton), ts.solve(problem, springs, newton)
    assert gap(theirs, ours) < 1e-6
    for one, other in zip(theirs.states[1:], ours.states[1:], strict=True):
        assert one.energy == pytest.approx(other.energy, rel=1e-5)
        assert one.stretch == pytest.approx(other.stretch, rel=1e-5)
        assert np.abs(one.reaction - other.reaction).max() < 1e-5 * np.abs(other.reaction).max()


NETWORK = """\
title = "Two springs"

[mesh]
nodes = "nodes.csv"
springs = "springs.csv"

[[support]]
on = { x = "0 m" }
fix = ["z"]

[[support]]
on = { y = "10 m" }
fix = ["x", "y"]

[[support]]
on = { y = "-10 m" }
fix = ["x", "y"]

[[load]]
on = { y = "0 m" }
force = ["5 N", "5 N", "0 N"]

[models.ours]
kind = "network"

[models.theirs]
kind = "calculix"
springs = "ours"
"""


@needs_ccx
def test_ansys_vm9_settles_in_calculix(tmp_path: Path) -> None:
    """Springs of 8 and 1 N/m: the verification manual of Ansys prints 8.631 and 4.533 m, ideal springs are these."""
    (tmp_path / "nodes.csv").write_text("node,x,y,z\na,0,10,0\nb,0,0,0\nc,0,-10,0\n")
    (tmp_path / "springs.csv").write_text("a,b,stiffness\na,b,8\nb,c,1\n")
    file = written(tmp_path, NETWORK)
    assert main(["solve", str(file), "--out", str(tmp_path), "--quiet"]) == 0
    paths = run(read_study(file)).solutions
    assert gap(paths["theirs"], paths["ours"]) < 1e-6
    assert paths["theirs"].states[-1].displacement[1] == pytest.approx([8.6321, 4.5319, 0.0], rel=1e-3)
    assert paths["theirs"].states[-1].energy == pytest.approx(24.0116, rel=1e-5)


# --- what goes wrong ---------------------------------------------------------------------------------------------


@pytest.mark.verification
@needs_ccx
def test_levels_reached_are_kept_where_it_does_not_converge(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Crushed to a hundredth of its length: St. Venant-Kirchhoff's law has nothing that resists it."""
    support = '[[support]]\non = "right"\ndisplacement = ["-39.5 mm", "0 mm"]\n\n[models.springs]'
    calculix = '[models.calculix]\nkind = "calculix"\n\n[compare]'
    springs = ('kind = "springs"\nrule = "lloyd"', 'kind = "fem"\nlaw = "linear"')  # crushed springs take long
    text = changed(
        ("[models.springs]", support), springs, ("[compare]", calculix), ("load_steps = 2", "load_steps = 5")
    )
    file = written(tmp_path, text)
    assert main(["solve", str(file), "--out", str(tmp_path), "--json"]) == 1
    printed = capsys.readouterr()
    found = json.loads(printed.out)["models"]["calculix"]
    assert found["status"] == "not-converged" and 0 < found["load_factor"] < 1
    warning = found["warnings"][0]
    assert f"last good load factor: {found['load_factor']:g}" in warning
    assert "increment size smaller than minimum" in warning and "load_steps" in warning
    assert "model 'calculix' is not-converged" in printed.err
    with (tmp_path / "study" / "curves.csv").open() as stream:
        levels = [float(row["load_factor"]) for row in csv.DictReader(stream) if row["model"] == "calculix"]
    assert levels == pytest.approx(np.arange(len(levels)) / 5) and levels[-1] == found["load_factor"]


@needs_ccx
def test_elements_turned_inside_out_are_told() -> None:
    """ccx goes on past St. Venant-Kirchhoff's largest compression, as if nothing had happened."""
    problem = ts.Problem(
        ts.rectangle((0.04, 0.04), (4, 4)),
        ts.Material(10e3, 0.3),
        ts.PlaneStrain(0.01),
        [ts.Fixed("left")],
        [ts.Force("right", (-200.0, 0.0))],
    )
    path = CalculiX().run(problem, ts.Newton(load_steps=4))
    assert path.status is ts.Status.INVERTED and path.states[-1].area_ratio < 0
    assert path.warnings[0].startswith("inverted from load factor")
    assert CalculiX("linear").run(problem, ts.Newton(load_steps=4)).status is ts.Status.CONVERGED


def test_without_ccx_the_install_lines_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    file = written(tmp_path, changed(("[compare]", '[models.calculix]\nkind = "calculix"\n\n[compare]')))
    assert main(["verify", str(file), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert "models.calculix" in told and "ccx is on the path" in told
    for line in ("apt-get install calculix-ccx", "conda install -c conda-forge calculix", "brew install"):
        assert line in told
    assert not (tmp_path / "out").exists()


CCX = '[models.calculix]\nkind = "calculix"\n'
VOLUME = 'kind = "springs"\nrule = "isotropic"\nvolume = true'
PRESSED = '[[support]]\non = "right"\n\n[[load]]\non = "top"\npressure = "1 Pa"\n\n[solver]'
BALL = """[[tool]]
name = "ball"
shape = "sphere"
radius = "2 mm"
path = [[0, "20 mm", "13 mm"], [1, "20 mm", "11 mm"]]
on = "top"
"""
REFUSED: dict[str, tuple[str, tuple[tuple[str, str], ...], tuple[str, ...]]] = {
    "unknown key": (CCX + 'lwa = "linear"', (), ("models.calculix.lwa", "did you mean 'law'", "springs")),
    "unknown law": (CCX + 'law = "hencky"', (), ("models.calculix.law", "'linear' or 'saint-venant-kirchhoff'")),
    "both": (CCX + 'law = "linear"\nsprings = "springs"', (), ("models.calculix", "law and springs")),
    "no model": (CCX + 'springs = "sprigns"', (), ("models.calculix.springs", "did you mean 'springs'")),
    "no springs": (
        CCX + 'springs = "linear"',
        (),
        ("models.calculix.springs", "'linear'", "springs model", "there are springs"),
    ),
    "unknown kind": ('[models.calculix]\nkind = "calculx"', (), ("did you mean 'calculix'",)),
    "volume term": (
        CCX + 'springs = "springs"',
        (('kind = "springs"\nrule = "lloyd"', VOLUME),),
        ("models.calculix", "volume term"),
    ),
    "pressure on springs": (CCX + 'springs = "springs"', (("[solver]", PRESSED),), ("models.calculix", "pressure")),
    "moment that turns": (
        CCX,
        (('force = ["0 N", "-0.01 N"]', 'moment = "1 N mm"'),),
        ("models.calculix", "rotation of a support"),
    ),
    "motion": (
        CCX,
        (("[solver]", '[dynamics]\nduration = "1 s"\n\n[solver]'), ("poisson = 0.3", "poisson = 0.3\ndensity = 1e3")),
        ("models.calculix", "a motion", "leave [dynamics] out"),
    ),
    "history": (
        CCX,
        (("[solver]", "over = [[0, 0], [0.5, 1], [1, 0]]\n\n[solver]"),),
        ("models.calculix", "the history of force (0, -0.01) N", "leave over out"),
    ),
    "history on springs": (
        CCX + 'springs = "springs"',
        (("[solver]", "over = [[0, 0], [0.5, 1], [1, 0]]\n\n[solver]"),),
        ("models.calculix", "the history of force (0, -0.01) N", "leave over out"),
    ),
    "tool": (CCX, (("[solver]", f"{BALL}\n\n[solver]"),), ("models.calculix", "tools and grasps, such as 'ball'")),
    "control": (
        CCX,
        (("load_steps = 2", 'load_steps = 2\ncontrol = "displacement"\non = "right"\ndirection = "y"\nto = "-1 mm"'),),
        ("models.calculix", 'control = "load"'),
    ),
}


@needs_ccx
@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_refused_before_anything_is_solved(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, changes, words = REFUSED[name]
    file = written(tmp_path, changed(*changes, ("[compare]", f"{model}\n\n[compare]")))
    assert main(["verify", str(file), "--out", str(tmp_path / "out")]) == 2
    told = capsys.readouterr().err
    assert all(word in told for word in words), told
    assert not (tmp_path / "out").exists()


@needs_ccx
def test_another_law_is_refused() -> None:
    with pytest.raises(ModelError, match="saint-venant-kirchhoff"):
        CalculiX("hencky")


posix = pytest.mark.skipif(sys.platform == "win32", reason="a program of the test's own is a shell script")


def program(folder: Path, monkeypatch: pytest.MonkeyPatch, *lines: str) -> None:
    """Put a program called ccx on the path."""
    file = folder / "bin" / "ccx"
    file.parent.mkdir()
    file.write_text("\n".join([f"#!{shutil.which('sh')}", *lines, ""]))
    file.chmod(0o755)
    monkeypatch.setenv("PATH", f"{file.parent}:/usr/bin:/bin")


@posix
@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (("echo ' *ERROR reading *ELASTIC'", "echo ' of line 7'", "touch model.dat", "exit 201"), "of line 7"),
        (("kill -9 $$",), "exit code -9"),
    ],
)
def test_a_run_without_a_step_is_a_path_that_says_why(
    lines: tuple[str, ...], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program(tmp_path, monkeypatch, *lines)
    path = CalculiX().run(moved(displacement=(0.01, 0.0, 0.0)), ts.Newton(load_steps=2))
    assert path.status is ts.Status.NOT_CONVERGED and path.load_factor == 0 and len(path.states) == 1
    assert re.search(f"load factor 0.5 was not reached.*message of CalculiX.*{words}", path.warnings[0])


def test_a_failing_program_does_not_take_the_rest_of_a_study_along(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    program(tmp_path, monkeypatch, "exit 3")
    study = written(tmp_path, changed(("[compare]", '[models.other]\nkind = "calculix"\n\n[compare]')))
    assert main(["verify", str(study), "--out", str(tmp_path / "out"), "--quiet"]) == 1
    assert "model 'other' is not-converged" in capsys.readouterr().err
    summary = json.loads((tmp_path / "out" / "study" / "summary.json").read_text())
    assert summary["models"]["springs"]["status"] == summary["models"]["linear"]["status"] == "converged"
    assert summary["models"]["other"]["load_factor"] == 0 and summary["comparison"]["linear"]["rms_error"] > 0


STA = """\
SUMMARY OF JOB INFORMATION
  STEP      INC     ATT  ITRS     TOT TIME     STEP TIME      INC TIME
     1          1     1U    7  0.000000E+00  0.000000E+00  0.100000E+01
     1          1     2     4  0.250000E+00  0.250000E+00  0.250000E+00"""


@posix
def test_progress_is_told_and_whoever_is_interrupted_leaves_nothing_running(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program(tmp_path, monkeypatch, f"echo $$ > pid\ncat > deck.sta <<END\n{STA}\nEND", "exec sleep 600")
    deck = tmp_path / "deck.inp"
    deck.write_text("")
    told = []

    def reached(step: int, share: float) -> None:
        told.append((step, share))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_ccx(deck, reached=reached)
    assert told == [(1, 0.25)]
    assert not Path("/proc/1").exists() or not Path(f"/proc/{(tmp_path / 'pid').read_text().strip()}").exists()


@posix
def test_efforts_and_threads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program(tmp_path, monkeypatch, f"cat > deck.sta <<END\n{STA}\nEND", "echo $OMP_NUM_THREADS", "exit 201")
    deck = tmp_path / "deck.inp"
    deck.write_text("")
    finished = run_ccx(deck, threads=3)
    assert finished.code == 201 and finished.efforts == {1: (1, 11)}
    assert deck.with_suffix(".txt").read_text() == "3\n"
