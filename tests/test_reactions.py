"""Force and torque of moved supports: what they are, what counts, and that verdict, comparison and files count them."""

import csv
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import truespring as ts
from tests.test_report import words
from tests.wording import in_order
from truespring.calibration import make_unknowns
from truespring.calibration.calibration import _warnings
from truespring.calibration.fitted import CaseResult
from truespring.cli import main
from truespring.comparing import compare_sources, find_sources
from truespring.reactions import leading_support
from truespring.report.curves import write_curves
from truespring.report.result import Result
from truespring.report.style import figure_style
from truespring.report.summary import difference, summary
from truespring.report.support_curves import support_figures
from truespring.report.verdict import drive, force_sentence, verdict
from truespring.solvers import Newton
from truespring.validity.deviation import deviation_of
from truespring.validity.solving import Task, run_task

LENGTH, SIDE = 0.06, 0.02
TWIST = {"rotation": np.pi / 3, "axis": (1, 0, 0)}
SPRINGS, RUBBER = ts.Springs("isotropic"), ts.Fem("neo-hookean")


def block(*supports: ts.Fixed, loads: Any = (), elements: tuple[int, int, int] = (3, 1, 1)) -> ts.Problem:
    """A block of cubes, by default three in a row."""
    mesh = ts.box((LENGTH, SIDE, SIDE), elements)
    return ts.Problem(mesh, ts.Material(20e3, 0.3), None, supports, loads)


def result(model: ts.Solution, reference: ts.Solution) -> Result:
    probe = ts.nearest_node(model.problem.mesh, [LENGTH / 3, SIDE / 2, SIDE / 2][: model.problem.mesh.dim])
    compared = {"neo": ts.compare(model, reference, probe)}
    paths = {"springs": model, "neo": reference}
    return Result("A block", Path("block.toml"), model.problem, paths, probe, "springs", compared, 0.05, "")


def solved(problem: ts.Problem, steps: int = 2) -> Result:
    return result(*(ts.solve(problem, one, Newton(steps)) for one in (SPRINGS, RUBBER)))


@pytest.fixture(scope="module")
def twisted() -> Result:
    return solved(block(ts.Fixed("left"), ts.Fixed("right", **TWIST), elements=(6, 2, 2)))


# --- what a support takes -----------------------------------------------------------------------------------------


def test_the_force_of_a_turned_support_is_the_sum_of_its_reactions() -> None:
    """All of a face that is pulled and turned: along x, and nothing across, by symmetry."""
    pulled = ts.Fixed("right", displacement=(0.012, 0, 0), **TWIST)
    problem = block(ts.Fixed("left"), pulled, elements=(6, 2, 2))
    path = ts.solve(problem, RUBBER, Newton(4))
    state, face = path.states[-1], np.isclose(problem.mesh.nodes[:, 0], LENGTH)
    assert path.applied_force(state) == pytest.approx([1.434, 0, 0], abs=5e-4)
    assert path.applied_force(state) == pytest.approx(state.reaction[face].sum(axis=0), abs=1e-12)
    (one,) = path.support_forces(state)
    arms = state.positions[face] - [LENGTH + 0.012, SIDE / 2, SIDE / 2]
    assert one.torque == pytest.approx(np.cross(arms, state.reaction[face]).sum(axis=0), abs=1e-12)
    assert np.linalg.norm(one.torque[1:]) < 1e-9 * one.torque[0]


WORKING = {
    "pulled and turned about a point": (
        ts.Fixed("left"),
        ts.Fixed("right", displacement=(0.008, -0.004, 0), about=(0.07, 0.01, 0.0), **TWIST),
    ),
    "two with an edge in common": (
        ts.Fixed("left"),
        ts.Fixed("right", displacement=(0.004, 0.005, 0), fix=("x", "y")),
        ts.Fixed(ts.Box((0.059, 0.019, -1), (0.061, 0.021, 1)), displacement=(0.004, 0.005, 0), fix=("x", "y")),
    ),
    "both ends": (
        ts.Fixed("left", rotation=-0.5, axis=(1, 0, 0)),
        ts.Fixed("right", displacement=(0.005, 0, 0), **TWIST),
    ),
}


@pytest.mark.parametrize("name", WORKING)
@pytest.mark.parametrize("model", [SPRINGS, RUBBER], ids=["springs", "fem"])
def test_forces_and_torques_do_the_work_that_is_stored(name: str, model: ts.Springs | ts.Fem) -> None:
    """F . u + M . theta over all supports is the derivative of the stored energy by the share of the motion."""

    def scaled(share: float) -> ts.Solution:
        several = [
            replace(
                one,
                displacement=None if one.displacement is None else [share * part for part in one.displacement],
                rotation=share * one.rotation,
            )
            for one in WORKING[name]
        ]
        return ts.solve(block(*several), model, Newton(2))

    step = 2e-3
    less, path, more = (scaled(share) for share in (1 - step, 1.0, 1 + step))
    work = 0.0
    for one in path.support_forces(path.states[-1]):
        held = path.problem.held[one.support]
        work += float(one.force @ held.motion)
        work += 0.0 if held.turn is None else float(one.torque @ held.turn.axis) * held.turn.angle
    assert work > 1e-2 * 20e3 * SIDE**3
    assert work == pytest.approx((more.states[-1].energy - less.states[-1].energy) / (2 * step), rel=1e-4)


def test_a_support_acts_only_where_it_holds() -> None:
    """Of nodes on an edge the sliding plane below takes what is across: a grip that slides only pulls."""
    problem = block(
        ts.Fixed("left", fix=["x"]),
        ts.Fixed("bottom", fix=["y"]),
        ts.Fixed("back", fix=["z"]),
        ts.Fixed("right", fix=["x"], displacement=(0.006, 0, 0)),
    )
    found = solved(problem)
    for path in found.solutions.values():
        (one,) = path.support_forces(path.states[-1])
        assert one.name == "right" and one.has_force and not one.has_torque
        left = path.states[-1].reaction[problem.held[0].nodes, 0].sum()
        assert one.force == pytest.approx([-left, 0, 0], abs=1e-12)
    assert found.comparisons["neo"].supports[0].torque_error is None


@pytest.mark.parametrize("way", [1, -1])
def test_the_force_of_a_body_is_that_of_the_support_that_moves_most_of_equals_the_first(way: int) -> None:
    ends = [ts.Fixed("left", displacement=(-0.004, 0, 0)), ts.Fixed("right", displacement=(0.004, 0, 0))]
    problem = block(*ends[::way])
    assert leading_support(problem) == 0
    path = ts.solve(problem, SPRINGS, Newton(1))
    assert -way * path.applied_force(path.states[-1])[0] > 0.1
    found = result(path, path)
    assert drive(found).axis == 0 and drive(found).along(path.applied_force(path.states[-1])) > 0.1
    assert leading_support(block(ends[0], replace(ends[1], displacement=(0.005, 0, 0)))) == 1
    # The corners of a face that is turned by 60 degrees go farther, 14 mm, than one that is pulled by 12.
    assert leading_support(block(replace(ends[0], displacement=(-0.012, 0, 0)), ts.Fixed("right", **TWIST))) == 1
    # A full turn ends where it began, but is a motion.
    assert leading_support(block(ends[0], ts.Fixed("right", rotation=2 * np.pi, axis=(1, 0, 0)))) == 1


def test_what_vanishes_by_symmetry_has_no_error(twisted: Result) -> None:
    """A straight pull needs no torque, a twist no force but what a body swells by; both are no relative errors."""
    (torque,) = twisted.comparisons["neo"].supports
    assert torque.force_error is None and torque.torque_error is not None
    found = solved(block(ts.Fixed("left"), ts.Fixed("right", displacement=(0.006, 0, 0))))
    (pull,) = found.comparisons["neo"].supports
    assert pull.torque_error is None and 1e-3 < pull.force_error < 0.5
    assert found.comparisons["neo"].decided_by == "force"


# --- what it counts for -------------------------------------------------------------------------------------------


def test_a_twist_is_judged_by_its_torque(twisted: Result) -> None:
    one = twisted.comparisons["neo"]
    mine, theirs = (path.support_forces(path.states[-1])[0].torque for path in twisted.solutions.values())
    error = np.linalg.norm(mine - theirs) / np.linalg.norm(theirs)
    assert one.force_error == pytest.approx(error) and one.error == one.force_error > 0.2 > 10 * one.rms_error
    assert one.decided_by == "torque" and one.agrees_up_to_load_factor == 0.0
    assert verdict(twisted).startswith("At no load level do springs come within 5 % of neo-Hookean FEM. At full motion")
    assert "% in the torque, " in verdict(twisted) and "% in displacement" in verdict(twisted)
    assert in_order(str(force_sentence(twisted)), "torque", "at full motion", "axis", ": springs ")
    values = summary(twisted)["comparison"]["neo"]
    assert values["decided_by"] == "torque" and values["force_error"] == pytest.approx(error)
    (told,) = values["supports"]
    assert told["on"] == "right" and told["support"] == 2
    assert told["torque"] == {"model": mine.tolist(), "reference": theirs.tolist()}
    assert told["force_error"] is None and told["torque_error"] == pytest.approx(error)
    assert told["share_of_load"] is None
    json.dumps(values, allow_nan=False)


def test_a_turn_is_drawn_by_its_torque() -> None:
    plane = ts.rectangle((LENGTH, SIDE), (3, 1))
    for more, axis in (
        ({}, "torque of the support [mN m]"),
        ({"displacement": (0.006, 0)}, "force of the support [mN]"),
    ):
        supports = [ts.Fixed("left"), ts.Fixed("right", rotation=0.5, **more)]
        problem = ts.Problem(plane, ts.Material(20e3, 0.3), ts.PlaneStress(0.01), supports)
        path = ts.solve(problem, SPRINGS, Newton(1))
        found = result(path, path)
        with figure_style():
            assert axis in words(next(figure for _, figure in support_figures(found)))
    straight = block(ts.Fixed("left"), ts.Fixed("right", displacement=(0.006, 0, 0)))
    path = ts.solve(straight, SPRINGS, Newton(1))
    assert not list(support_figures(result(path, path)))  # the force is in the figure of curves


def test_an_almost_incompressible_cube_between_sliding_planes_is_judged_by_its_force() -> None:
    """Displacements agree, for they are prescribed: the true force is E / 3 (2 - 1 / 4), that of springs twice it."""
    mesh = ts.box((1.0, 1.0, 1.0), (2, 2, 2))
    supports = [
        ts.Fixed("left", fix=["x"]),
        ts.Fixed("bottom", fix=["y"]),
        ts.Fixed("back", fix=["z"]),
        ts.Fixed("right", fix=["x"], displacement=(1.0, 0.0, 0.0)),
    ]
    problem = ts.Problem(mesh, ts.Material(3e6, 0.4999), None, supports)
    paths = [ts.solve(problem, one, Newton(4)) for one in (ts.Springs("isotropic", volume=True), RUBBER)]
    found = result(*paths)
    one = found.comparisons["neo"]
    mine, theirs = (path.applied_force(path.states[-1])[0] for path in paths)
    assert theirs == pytest.approx(1e6 * 1.75, rel=1e-3)
    assert one.rms_error < 1e-3 and one.force_error == pytest.approx(mine / theirs - 1, rel=1e-6) and mine > 2 * theirs
    assert one.agrees_up_to_load_factor == 0.0 and one.decided_by == "force"
    assert verdict(found).startswith("At no load level do springs come within 5 % of neo-Hookean FEM.")


def test_an_indentation_is_judged_by_its_force() -> None:
    mesh = ts.rectangle((LENGTH, SIDE), (6, 2))
    dent = ts.Fixed(ts.Box((0.019, 0.019), (0.041, 0.021)), displacement=(0.0, -0.004))
    problem = ts.Problem(mesh, ts.Material(20e3, 0.3), ts.PlaneStress(0.01), [ts.Fixed("bottom"), dent])
    stiffer = replace(problem, material=ts.Material(26e3, 0.3))
    found = result(*(ts.solve(one, RUBBER, Newton(2)) for one in (stiffer, problem)))
    one = found.comparisons["neo"]
    assert one.rms_error < 1e-9 and one.force_error == pytest.approx(0.3) and one.decided_by == "force"
    assert verdict(found) == (
        "At no load level does neo-Hookean FEM (springs) come within 5 % of neo-Hookean FEM (neo). "
        "At full motion: neo-Hookean FEM (neo) 30 % in the force, less than 0.01 % in displacement."
    )
    assert summary(found)["comparison"]["neo"]["supports"][0]["on"] == "support 2"


def test_prescribed_nodes_are_left_out() -> None:
    """What supports hold or move in all directions tells nothing of a model."""
    problem = block(ts.Fixed("left"), ts.Fixed("right", displacement=(0.006, 0.003, 0)))
    paths = [ts.solve(problem, one, Newton(2)) for one in (SPRINGS, RUBBER)]
    one = ts.compare(*paths)
    inner = (problem.mesh.nodes[:, 0] > 0.001) & (problem.mesh.nodes[:, 0] < LENGTH - 0.001)
    assert (one.compared == inner).all()
    mine, theirs = (path.states[-1].displacement[inner] for path in paths)
    assert one.rms_error == pytest.approx(np.sqrt(((mine - theirs) ** 2).sum() / (theirs**2).sum()), rel=1e-12)
    ends = [ts.Fixed("left"), ts.Fixed("right", displacement=(0.006, 0, 0))]
    whole = ts.Problem(ts.box((SIDE,) * 3, (1, 1, 1)), problem.material, None, ends)
    told = ts.compare(ts.solve(whole, SPRINGS, Newton(2)), ts.solve(whole, RUBBER, Newton(2)))
    assert told.rms_error is None and told.max_error is None and not told.compared.any()
    assert told.error == told.force_error > 0.01 and told.decided_by == "force"


def with_forces(path: ts.Solution, factors: Mapping[float, float]) -> ts.Solution:
    """The path with other reactions at some levels."""
    states = [replace(one, reaction=one.reaction * factors.get(round(one.level, 3), 1.0)) for one in path.states]
    return replace(path, states=tuple(states))


def test_agreement_ends_with_the_last_level_before_the_first_that_is_off() -> None:
    path = ts.solve(block(ts.Fixed("left"), ts.Fixed("right", displacement=(0.006, 0, 0))), SPRINGS, Newton(4))
    for off, up_to in (({1.0: 1.06}, 0.75), ({0.75: 1.06}, 0.5), ({0.25: 0.94}, 0.0), ({0.5: 1.04}, 1.0)):
        one = ts.compare(with_forces(path, off), path)
        assert one.agrees_up_to_load_factor == up_to and one.rms_error == 0.0
        ((level, factor),) = off.items()
        errors = dict(zip(one.load_factors, one.force_errors, strict=True))
        assert errors[level] == pytest.approx(abs(factor - 1)) and sum(errors.values()) == pytest.approx(errors[level])


def test_beside_loads_the_force_of_a_support_has_a_share_of_them() -> None:
    supports = [ts.Fixed("left"), ts.Fixed("right", displacement=(0.006, 0, 0))]
    problem = block(*supports, loads=[ts.Force("top", (0.0, -0.1, 0.0))])
    (one,) = solved(problem).comparisons["neo"].supports
    assert one.share_of_load == pytest.approx(np.linalg.norm(one.theirs.force) / 0.1)
    assert one.force_error is not None


@pytest.mark.parametrize("large", ["y", "z"])
def test_loads_that_balance_drive_along_the_largest_of_them(large: str) -> None:
    """Not along what rounding leaves of their total."""
    axis = "xyz".index(large)
    pair = np.array([0.01, 0.0, 0.0])
    pair[axis] = -0.02
    loads = [ts.Force("top", pair + np.array([1e-13, 0, 0])), ts.Force("bottom", -pair)]
    path = ts.solve(block(ts.Fixed("left"), loads=loads), SPRINGS, Newton(1))
    found = drive(result(path, path))
    assert found.axis == axis and found.name in (large, f"−{large}")


@pytest.mark.parametrize(("total", "name"), [((0.001, 0.0, 0.0), "x"), ((0.0, 0.0, -0.001), "−z")])
def test_what_is_left_of_the_loads_drives_however_small_it_is(total: tuple[float, ...], name: str) -> None:
    loads = [ts.Force("top", (0.0, 0.02, 0.0)), ts.Force("bottom", (0.0, -0.02, 0.0)), ts.Force("right", total)]
    path = ts.solve(block(ts.Fixed("left"), loads=loads), SPRINGS, Newton(1))
    assert drive(result(path, path)).name == name


def test_a_map_judges_as_a_comparison_does() -> None:
    """By the force and the torque of what is moved, each level as `compare` has it, and no better between them."""
    mesh, ends = ts.rectangle((LENGTH, SIDE), (3, 1)), [ts.Fixed("left"), ts.Fixed("right", rotation=0.4)]
    problem = ts.Problem(mesh, ts.Material(20e3, 0.3), ts.PlaneStress(0.01), ends)
    mine, theirs = (run_task(Task(problem, model, 4)) for model in (SPRINGS, RUBBER))
    reference: Any = SimpleNamespace(solved=theirs, sizes=np.concatenate([[0.01], np.arange(1, 5) / 4]))
    found = deviation_of(mine, reference, np.linspace(0, 1, 41), None)
    told = ts.compare(mine.path, theirs.path)
    assert found.rms_errors[1:] == pytest.approx(told.rms_errors, rel=1e-9)
    assert found.force_errors[1:] == pytest.approx(told.force_errors, rel=1e-9) and told.force_errors[0] > 0.05
    assert found.errors[10::10] == pytest.approx(told.errors, rel=1e-9)


# --- files --------------------------------------------------------------------------------------------------------

STUDY = """
[mesh]
shape = "rectangle"
size = ["60 mm", "20 mm"]
elements = [6, 2]
[material]
young = "20 kPa"
poisson = 0.3
[section]
kind = "plane-stress"
thickness = "10 mm"
[[support]]
on = "left"
[[support]]
on = "right"
displacement = ["6 mm", "1 mm"]
rotation = "20 deg"
[solver]
load_steps = 2
[models.springs]
kind = "springs"
rule = "isotropic"
[models.neo]
kind = "fem"
law = "neo-hookean"
"""


def rows_of(file: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(file.read_text(encoding="utf-8").splitlines()))


def test_a_folder_tells_the_forces_of_its_study(tmp_path: Path) -> None:
    """Two folders compare as the study itself does, by force and displacement, and tell the same forces."""
    study = tmp_path / "pull.toml"
    study.write_text(STUDY)
    assert main(["solve", str(study), "--out", str(tmp_path / "out"), "--quiet"]) == 0
    own, neo = (str(tmp_path / "out" / "pull") + f":{name}" for name in ("springs", "neo"))
    found, forces = {}, {}
    for name, pair in (("folders", (neo, own)), ("study", (f"{study}:neo", f"{study}:springs"))):
        (told,) = compare_sources(find_sources(pair, []))
        found[name] = difference(told)
        write_curves(told, tmp_path / "curves.csv")
        forces[name] = [float(row[axis]) for row in rows_of(tmp_path / "curves.csv") for axis in ("fx", "fy")]
    for key in ("rms_error", "max_error", "force_error", "agrees_up_to_load_factor", "n_nodes"):
        assert found["folders"][key] == pytest.approx(found["study"][key], rel=1e-9), key
    assert forces["folders"] == pytest.approx(forces["study"], rel=1e-9) and max(map(abs, forces["study"])) > 0.1
    assert found["folders"]["decided_by"] == found["study"]["decided_by"] is not None
    assert found["folders"]["supports"][0]["force_error"] > 0.01
    rows = rows_of(tmp_path / "out" / "pull" / "reactions.csv")
    assert len(rows) == 2 * 3 and {(row["support"], row["on"]) for row in rows} == {("2", "right")}
    curves = rows_of(tmp_path / "out" / "pull" / "curves.csv")
    assert [(row["fx [N]"], row["fy [N]"]) for row in rows] == [(row["fx"], row["fy"]) for row in curves]


# --- calibration --------------------------------------------------------------------------------------------------


def test_springs_are_fitted_to_the_torque_of_a_twist() -> None:
    problem = block(ts.Fixed("left"), ts.Fixed("right", rotation=0.5, axis=(1, 0, 0)), elements=(6, 2, 2))
    case = ts.LoadCase("twist", problem, ts.solve(problem, RUBBER, Newton(2)), solver=Newton(2))
    assert {one.quantity for one in case.observations} == {"displacement", "torque"}
    found = ts.calibrate(case, SPRINGS)
    before, after = found.cases[0].both
    assert before.quantity == "torque" and before.error > 0.2 and after.error < before.error / 3
    told = CaseResult(case, True, found.cases[0].before, found.cases[0].after)
    assert told.pair == found.cases[0].pair and told.pair[1] == pytest.approx(
        ts.compare(told.after, case.reference).error, rel=1e-12
    )
    headline = replace(found, cases=(told,)).headline
    assert "in the torque" in headline


def test_nothing_was_made_worse_where_the_force_improved() -> None:
    """A displacement that is a little farther off is no harm beside a force that is twice as near."""
    problem = block(ts.Fixed("left"), ts.Fixed("right", displacement=(0.006, 0, 0)))
    reference = ts.solve(problem, RUBBER, Newton(2))
    case = ts.LoadCase("pull", problem, reference, solver=Newton(2))

    def off(force: float, displacement: float) -> ts.Solution:
        states = []
        for state in reference.states:
            moved = state.displacement * (1 + displacement * ~problem.loading.held)
            positions = problem.mesh.nodes + moved
            states.append(
                replace(state, displacement=moved, positions=positions, reaction=state.reaction * (1 + force))
            )
        return replace(reference, states=tuple(states), kind="springs")

    unknowns = make_unknowns(problem, SPRINGS)
    for before, after, worse in (((0.3, 0.01), (0.15, 0.02), False), ((0.15, 0.02), (0.3, 0.01), True)):
        told = CaseResult(case, True, off(*before), off(*after))
        assert told.pair == pytest.approx((before[0], after[0])) and told.quantity == "force"
        said = [text for text in _warnings(unknowns, np.ones(len(unknowns)), [told]) if "increased the error" in text]
        assert bool(said) == worse
    for gone, more in ((1, ""), (3, ""), (5, "and 2 more")):
        values = np.where(np.arange(8) < gone, 0.0, 1.0)
        names: Any = SimpleNamespace(names=[f"s{k}" for k in range(8)], warnings=lambda values: ())
        (said,) = _warnings(names, values, [])
        assert said.count("s0") == 1 and (more in said if more else "more:" not in said and "and" not in said)
    mixed = CaseResult(case, True, off(0.3, 0.01), off(0.01, 0.1))
    assert mixed.quantity == "displacement" and mixed.pair == pytest.approx((0.3, 0.1))


# --- over the way -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("over", [None, [[0, 0], [1, 1]], [[0, 0], [0.5, 1], [1, 0]]], ids=["none", "up", "back"])
def test_a_body_that_is_stiffer_by_a_share_is_off_by_it_in_force(over: Any) -> None:
    """Motion alone gives both the same displacement; all forces are in the ratio of Young's moduli."""
    pulled = block(ts.Fixed("left"), ts.Fixed("right", displacement=(1e-3, 0, 0), over=over))
    stiffer = replace(pulled, material=ts.Material(26e3, 0.3))
    found = result(*(ts.solve(one, RUBBER, Newton(4)) for one in (stiffer, pulled)))
    compared = found.comparisons["neo"]
    assert compared.rms_error is not None and compared.rms_error < 1e-6
    assert compared.force_error == pytest.approx(0.3, rel=1e-6) == compared.error
    assert compared.decided_by == "force" and not compared.agrees_up_to_load_factor
    values = summary(found)["comparison"]["neo"]
    assert (values["force_error"], values["decided_by"]) == (compared.error, "force")
    assert difference(found)["force_error"] == compared.error
    assert "30 % in the force" in verdict(found)


def test_the_force_of_a_tool_is_compared_over_its_way() -> None:
    """An indentation that retracts: the root mean square of the difference over that of the reference's force."""
    press = ts.HalfSpace("plate", (0, -1), [[0, 0.0, 0.021], [0.5, 0.0, 0.019], [1, 0.0, 0.021]])
    mesh, section = ts.rectangle((0.04, 0.02), (4, 2)), ts.PlaneStress(0.01)
    pressed = ts.Problem(mesh, ts.Material(20e3, 0.3), section, ts.Fixed("bottom"), tools=press)
    one, other = (ts.solve(pressed, model, Newton(8)) for model in (ts.Springs("isotropic"), RUBBER))
    found = result(one, other)
    mine, theirs = (np.array([state.touches[0].force for state in path.states[1:]]) for path in (one, other))
    expected = np.sqrt(((mine - theirs) ** 2).sum() / (theirs**2).sum())
    compared = found.comparisons["neo"]
    assert compared.over_the_way and compared.force_error == pytest.approx(expected) and expected > 1e-3
    (values,) = summary(found)["comparison"]["neo"]["supports"]
    assert (values["support"], values["on"], values["force_error"]) == (None, "plate", compared.force_error)
    most = np.abs(theirs[:, 1]).argmax()
    assert values["force"]["reference"] == theirs[most].tolist()
    assert compared.rms_error is not None and compared.rms_error < 0.5  # the end is at rest
