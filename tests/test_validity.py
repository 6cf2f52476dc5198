"""Validity maps: held against closed forms of the lattice and of the laws, and against their own whole grid."""

import csv
import json
import math
import re
from collections.abc import Mapping
from dataclasses import replace
from html import escape
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import truespring as ts
from tests.closed_forms import bending_factor, lattice_tension, principal_state
from tests.studies import STUDY, changed, written
from tests.wording import in_order
from truespring.cli import main
from truespring.errors import StudyError, TruespringError
from truespring.study import read_study
from truespring.validity import Validity, map_validity, reference
from truespring.validity.axes import axis_of, read_range
from truespring.validity.bodies import Body, Spot
from truespring.validity.deviation import _left_out
from truespring.validity.lines import polylines, spans
from truespring.validity.loads import LOAD_TYPES, Bar
from truespring.validity.refine import LINES, Cells, Rows, crossings
from truespring.validity.rules import mapped_springs
from truespring.validity.sentences import _on_grid, _spot, headline, verdict
from truespring.validity.solving import SMALL, Solved, Task, run_task

LATTICES = {"lloyd": (5 / 16, 7 / 16), "isotropic": (3 / 8, 3 / 8)}
# One third, as a material has it whose springs need no term of volume.
THIRD = STUDY.replace("poisson = 0.3", "poisson = 0.33333333333")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("validity") / "small.toml"
    file.write_text(THIRD)
    return file


@pytest.fixture(scope="module")
def bent(study: Path) -> Validity:
    return map_validity(study, loads=["bend"], rules=list(LATTICES), ranges={"depth": (1, 8), "load": (0, 0.3)})


def _lattice(strain: float, rule: str) -> tuple[float, float]:
    """The nominal stress over E of a lattice pulled to a strain, and its stretch across."""
    edge, diagonal = LATTICES[rule]

    def pulled(force: float) -> tuple[float, float]:
        return lattice_tension(force, (1.0, 1.0), (edge, edge), diagonal)

    force = float(brentq(lambda force: pulled(force)[0] - 1 - strain, -0.2, 0.8, xtol=1e-14))
    return force, pulled(force)[1]


@pytest.mark.parametrize("law", ["neo-hookean", "linear", "saint-venant-kirchhoff"])
def test_tension_is_the_closed_form_of_lattice_and_law(study: Path, law: str) -> None:
    """Both moved between smooth plates: uniform stress; they differ in the force and in the stretch across."""
    found = map_validity(study, law=law, loads=["stretch"], rules=list(LATTICES), y=None)
    assert escape(found.verdicts[0]) in found._repr_html_() and "data:image/png;base64," in found._repr_html_()
    nodes = found.body.problem.mesh.nodes
    # Two corners are held along by the plates and across by the plane below: they tell nothing of a model.
    corners = np.isin(nodes[:, 0], [nodes[:, 0].min(), nodes[:, 0].max()]) & (nodes[:, 1] == nodes[:, 1].min())
    assert corners.sum() == 2
    along, across = (nodes[~corners] ** 2).mean(axis=0)
    for one in found.maps:
        (deviation,) = one.deviations.values()
        for strain in (0.1, 0.2, 0.3, 0.5):
            stretch, stress = principal_state(law, 1.0, 1 / 3, (1 + strain, None, None))
            force, narrow = _lattice(strain, one.rule.name)
            place = int(np.abs(one.x - strain).argmin())
            assert one.x[place] == pytest.approx(strain)
            assert deviation.stiffness_on_grid[place] == pytest.approx(force / stress[0] - 1, abs=1e-5)
            moved = strain**2 * along + (stretch[1] - 1) ** 2 * across
            rms = np.sqrt((narrow - stretch[1]) ** 2 * across / moved)
            assert one.errors[0, place] == pytest.approx(max(abs(force / stress[0] - 1), rms), abs=1e-5)


def test_lloyd_is_soft_at_small_strain_and_meets_linear_fem_at_30_percent(
    study: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """15/17 of E along the mesh; its hardening crosses the straight line where P = 0.3 E."""
    monkeypatch.setattr("truespring.validity.mapping.Pool", None)  # one process needs none
    (one,) = map_validity(study, law="linear", loads=["stretch"], rules=["lloyd"], y=None).maps
    (deviation,) = one.deviations.values()
    assert deviation.stiffness_on_grid[0] == pytest.approx(-2 / 17, abs=1e-5)
    assert one.errors[0, 0] == pytest.approx(0.118, abs=5e-4)
    crossing = float(np.interp(0.0, deviation.stiffness_on_grid, one.x))
    exact = brentq(lambda strain: _lattice(strain, "lloyd")[0] - strain, 0.25, 0.35)
    assert crossing == pytest.approx(exact, abs=1e-4)
    assert crossing == pytest.approx(0.3, abs=3e-3)
    at = int(np.abs(one.x - 0.3).argmin())
    assert 1 + deviation.stiffness_on_grid[at] == pytest.approx(0.29976 / 0.3, abs=1e-4)


@pytest.mark.verification
def test_bending_is_best_at_three_elements_for_lloyd_and_falls_for_isotropic(bent: Validity) -> None:
    lloyd, isotropic = bent.maps
    assert lloyd.y[int(lloyd.errors[:, 0].argmin())] == 3
    small = {spot.depth: float(deviation.stiffness_on_grid[0]) for spot, deviation in lloyd.deviations.items()}
    for depth in (3, 4):  # in EI alone: clamp and shear are the same to both but for what meshes add
        factor = bending_factor(5 / 16, 7 / 16, depth) / bending_factor(5 / 16, 7 / 16, 2)
        assert (1 + small[depth]) / (1 + small[2]) == pytest.approx(factor, rel=0.02)
    assert (np.diff(isotropic.errors[:, 0]) < 0).all()
    assert isotropic.errors[0, 0] > 0.5 and isotropic.errors[-1, 0] < 0.03


def test_errors_are_those_of_a_comparison(bent: Validity, study: Path) -> None:
    """What a map tells of a level is what `compare` tells of the two paths there."""
    lloyd, found = bent.maps[0], bent.references[0]
    body = Body.of(read_study(study))
    problem = body.springs_problem(LOAD_TYPES["bend"], found.factor, Spot(depth=3))
    path = ts.solve(problem, ts.Springs("lloyd"), ts.Newton(load_steps=10))
    whole = ts.compare(path, found.solved.path, [0.04, 0.005])
    deviation = lloyd.deviations[Spot(depth=3)]
    assert deviation.rms_errors[1:] == pytest.approx(whole.rms_errors, rel=1e-9)
    assert deviation.probe_errors[1:] == pytest.approx(whole.probe_errors, rel=1e-9)
    between = np.interp(deviation.sizes, deviation.grid, lloyd.errors[2])
    assert deviation.rms_errors == pytest.approx(between, abs=2e-4)


@pytest.mark.parametrize("n", [6, 7])
def test_every_second_level_measures_the_error_of_interpolation(n: int) -> None:
    """Nothing of a cubic, of which a spline through four levels misses nothing; a sixteenth of a half step's error."""
    size = np.linspace(0.0, 1.0, n) ** 1.5
    assert _left_out(size, np.stack([size**3, 1 - size**2], axis=1)) == pytest.approx(0.0, abs=1e-12)
    assert _left_out(size[:4], size[:4, None] ** 4) == 0.0
    kept = [0, 2, 4, n - 1]
    cubic = np.poly1d(np.polyfit(size[kept], size[kept] ** 4, 3))
    off = np.abs(cubic(size) - size**4).max()
    assert _left_out(size, np.outer(size**4, [3.0, 4.0])) == pytest.approx(5 * off / 8)


def test_the_reference_is_converged_and_says_to_what(bent: Validity, study: Path) -> None:
    (found,) = bent.references
    assert found.converged and found.error < 0.002 and found.tolerance == 0.002
    apart = _two_refinements_finer(found, Body.of(read_study(study)))
    assert 0.2 * found.error < apart < found.error  # what it still was off is what it had told
    assert found.reached == pytest.approx(0.3, rel=0.02)
    assert found.elements == 2 ** len(found.n_nodes)  # through the depth, of two on the first mesh


def _two_refinements_finer(found: reference.Reference, body: Body) -> float:
    """How far a reference is from that of two refinements more: the largest relative distance of all levels."""
    level = len(found.n_nodes) + 1
    problem = body.reference_problem(found.load, found.factor, found.poisson, level)
    finer = run_task(Task(problem, body.reference_model(found.law), 2))
    return float(ts.compare(found.solved.path, finer.path).rms_errors.max())


def test_what_a_clamp_leaves_is_told_of_meshes_that_are_not_fine(study: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nearly incompressible at a clamp, where the order is lowest, on meshes too coarse for it to show."""
    monkeypatch.setattr(reference, "_MOST_UNKNOWNS", {2: 2500})
    text = THIRD.replace("poisson = 0.33333333333", "poisson = 0.45").replace("plane-stress", "plane-strain")
    file = study.with_name("clamped.toml")
    file.write_text(text)
    body = Body.of(read_study(file))
    found = reference.solve_reference(body, LOAD_TYPES["bend"], "linear", last=0.3, steps=1)
    assert len(found.n_nodes) == 3 and not found.converged
    apart = _two_refinements_finer(found, body)
    assert apart < found.error < 6 * apart


@pytest.mark.verification
def test_what_a_clamp_leaves_is_told_of_cubes() -> None:
    """The soft block of the examples, on a mesh of four cubes through the depth and on one of sixteen."""
    study = Path(__file__).parent.parent / "examples" / "soft_block.toml"
    body = Body.of(read_study(study))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(reference, "_MOST_UNKNOWNS", {3: 10_000})
        found = reference.solve_reference(body, LOAD_TYPES["bend"], "linear", last=0.3, steps=1)
    assert found.elements == 4
    apart = _two_refinements_finer(found, body)
    assert apart < found.error < 8 * apart  # of three meshes no order is believed: it is told with the first


@pytest.mark.parametrize("asked", [0.1, 40.0])
def test_a_reference_says_why_it_ends_only_where_it_ends_early(asked: float) -> None:
    for share, end in ((0.97, "why"), (0.99, ""), (1.0, "")):
        one = SimpleNamespace(solved=SimpleNamespace(end="why"), reached=share * asked, target=asked)
        assert reference.Reference.end.fget(one) == end


@pytest.mark.parametrize(
    ("spoilt", "finite", "kept"),
    [
        ({"area_ratio": -0.5}, True, 2),
        ({"area_ratio": -0.5}, False, 4),  # of a linear model only a warning
        ({"negative_eigenvalues": 1}, False, 2),
        ({"branched": True}, True, 2),
        ({}, True, 4),
    ],
)
def test_no_state_beyond_the_first_that_is_unsound_is_mapped(spoilt: dict[str, Any], finite: bool, kept: int) -> None:
    sound: dict[str, Any] = {"negative_eigenvalues": 0, "branched": False, "area_ratio": 0.9}
    states = [SimpleNamespace(**sound, level=k / 3, loaded=k > 0) for k in range(4)]
    states[2] = SimpleNamespace(**{**sound, **spoilt}, level=2 / 3, loaded=True)
    small: Any = SimpleNamespace(at=lambda level: states[3])
    path: Any = SimpleNamespace(states=states, finite=finite)
    found = Solved(path, small, 0.0)
    assert len(found.states) == kept
    assert found.levels == pytest.approx([SMALL, *(k / 3 for k in range(1, kept))])


def test_richardson_and_roache_to_the_letter() -> None:
    """Meshes whose error is h^p: what is left is the last change over 2^p - 1, and a quarter more for safety."""
    for order in (0.5, 1.0, 1.2, 2.0):
        errors = [2.0 ** (-order * mesh) for mesh in range(4)]
        changes = [before - one for before, one in pairwise(errors)]
        told, shown = reference._estimate(changes)
        assert shown == pytest.approx(order)
        assert told == pytest.approx(1.25 * errors[-1])
        # Three meshes do not tell whether they are fine enough: no order above the first is taken from them.
        told, shown = reference._estimate(changes[:2])
        assert shown is None and told == pytest.approx(1.25 * errors[2] * max(1.0, 2**order - 1))


def test_an_order_that_meshes_only_seem_to_have_is_not_believed() -> None:
    """A smooth part of second order that dies out, over what a corner makes of order 0.8: the sum seems better."""
    errors = [0.0625**mesh + 0.1 * 2.0 ** (-0.8 * mesh) for mesh in range(4)]
    changes = [before - one for before, one in pairwise(errors)]
    seeming = np.log2(changes[1] / changes[2])
    assert 1.25 * changes[-1] / (2**seeming - 1) < 0.35 * errors[-1]
    told, shown = reference._estimate(changes)
    assert shown is None and errors[-1] < told < 1.5 * errors[-1]


@pytest.mark.verification
def test_what_is_adaptive_has_the_lines_of_the_whole_grid(bent: Validity, study: Path) -> None:
    whole = map_validity(
        study,
        loads=["bend"],
        rules=list(LATTICES),
        ranges={"depth": (1, 8), "load": (0, 0.3)},
        adaptive=False,
    )
    assert bent.full == whole.full == whole.solves[0] == 16
    assert bent.solves[0] < whole.solves[0]
    for one, other in zip(bent.maps, whole.maps, strict=True):
        for mine, theirs in zip(one.errors, other.errors, strict=True):
            for line in LINES:
                assert crossings(mine, line) == pytest.approx(crossings(theirs, line), abs=0.02)


def test_rows_are_solved_where_a_line_bends() -> None:
    """A line that is straight needs its middle, one that turns its neighbourhood, one that stands nothing."""
    x = np.linspace(0, 1, 201)
    solved: dict[str, int] = {}
    fields = {
        "standing": lambda y: 0.2 * x,
        "straight": lambda y: 0.2 * x / (1 + y),
        "turning": lambda y: 0.3 * np.abs(x - 0.5) + 0.4 * (y - 0.3) ** 2,
        "far": lambda y: 0.5 + 0.1 * x,
        "ending": lambda y: np.where(x < 0.5 + 0.4 * y, 0.2 * x, np.nan),
    }
    for name, field in fields.items():
        grid = Rows(33, (0, 8, 16, 24, 32))
        while wanted := grid.pending():
            grid.add({row: field(row / 32) for row in wanted})
        solved[name] = len(grid.known)
        exact = np.array([field(row / 32) for row in range(33)])
        for row, errors in enumerate(grid.filled()):
            for line in LINES:
                assert len(crossings(errors, line)) == len(crossings(exact[row], line)), (name, row, line)
                assert crossings(errors, line) == pytest.approx(crossings(exact[row], line), abs=0.02)
    assert solved["standing"] == solved["far"] == 5
    assert 5 < solved["straight"] <= 13
    assert solved["turning"] < 33


def test_cells_are_divided_where_a_line_passes() -> None:
    def field(i: int, j: int) -> float:
        return 0.004 + 0.3 * (i / 32) ** 2 + 0.1 * j / 16

    grid = Cells((33, 17), (range(0, 33, 8), range(0, 17, 4)))
    while wanted := grid.pending():
        grid.add({at: field(*at) for at in wanted})
    exact = np.array([[field(i, j) for i in range(33)] for j in range(17)])
    assert len(grid.known) < 0.6 * exact.size
    filled = grid.filled()
    for line in LINES:  # where it was not solved, few points are on the wrong side of a line
        assert ((filled <= line) != (exact <= line)).mean() < 0.01


def _with_errors(found: Validity, rows: Mapping[int, tuple[float, float]]) -> Validity:
    """Errors that rise straight from one value to another over the load, by elements through the depth."""
    one = found.maps[0]
    errors = np.array([np.linspace(*rows[int(depth)], len(one.x)) for depth in one.y])
    return replace(found, maps=(replace(one, errors=errors),))


def test_sentences_follow_from_the_numbers(bent: Validity) -> None:
    near, far = (0.001, 0.002), (0.3, 0.4)
    some = _with_errors(bent, {depth: near if depth >= 5 else far for depth in range(1, 9)})
    said = verdict(some, some.maps[0])
    assert "springs by Lloyd's rule are within 5 % of neo-Hookean FEM up to 30 % of the length" in said
    assert "on meshes of 5 to 8 elements through the depth" in said
    every = _with_errors(bent, dict.fromkeys(range(1, 9), near))
    assert "on every mesh of 1 to 8 elements through the depth" in verdict(every, every.maps[0])
    none = _with_errors(bent, dict.fromkeys(range(1, 9), far))
    text = verdict(none, none.maps[0])
    assert in_order(text, "nowhere within 5 % of neo-Hookean FEM", "30 %", "under a small load")
    part = _with_errors(bent, dict.fromkeys(range(1, 9), (0.1, 0.0)))
    assert "within 5 % of neo-Hookean FEM from 15 to 30 % of the length on every mesh" in verdict(part, part.maps[0])
    assert headline(part, part.maps[0]).startswith("Within 5 % of neo-Hookean FEM from 15 to 30 %")
    # Errors that only grow are within from the start; of the same error at all loads the smallest load is named.
    begun = _with_errors(bent, dict.fromkeys(range(1, 9), (0.0, 0.1)))
    assert "within 5 % of neo-Hookean FEM up to 15 % of the length on every mesh" in verdict(begun, begun.maps[0])
    level = _with_errors(bent, dict.fromkeys(range(1, 9), (0.3, 0.3)))
    assert in_order(verdict(level, level.maps[0]), "nowhere", "30 %", "under a small load")
    fewer = _with_errors(bent, {depth: (0.0, 0.1) if depth >= 5 else far for depth in range(1, 9)})
    said_of_fewer = verdict(fewer, fewer.maps[0])
    assert "up to 15 % of the length on meshes of 5 to 8 elements through the depth, less on others" in said_of_fewer
    small = {spot.depth: deviation.stiffness_on_grid[0] for spot, deviation in bent.maps[0].deviations.items()}
    assert f"{100 * small[1]:.0f} % too high (1 element)" in said.replace("\N{NO-BREAK SPACE}", " ")


def test_stretches_and_lines_lie_where_errors_pass() -> None:
    x = np.linspace(0, 1, 11)
    errors = np.abs(x - 0.5)
    assert spans(x, errors, 0.22) == [pytest.approx((0.28, 0.72))]
    assert spans(x, np.where(x > 0.65, np.nan, errors), 0.22) == [pytest.approx((0.28, 0.6))]
    assert spans(x, errors, -1.0) == []
    assert spans(x, 0 * x, 0.1) == [(0.0, 1.0)]


def test_a_reference_that_is_not_converged_is_said(
    study: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(reference, "_MOST_UNKNOWNS", {2: 40, 3: 40})
    assert main(["map", str(study), "--range", "depth=1:2", "--out", str(tmp_path), "--json"]) == 1
    values = json.loads(capsys.readouterr().out)
    (told,) = values["references"]
    assert not told["converged"] and told["reference_error"] > told["tolerance"]
    assert "The reference is not converged" in values["maps"][0]["verdict"]
    page = (tmp_path / "small" / "report.html").read_text(encoding="utf-8")
    assert "not converged" in page and "did not converge everywhere" in page


@pytest.mark.verification
def test_a_reference_that_ends_limits_the_map(study: Path) -> None:
    """St. Venant-Kirchhoff's stress falls beyond a stretch of 1 / sqrt(3): no equilibrium is stable there."""
    found = map_validity(
        study, law="saint-venant-kirchhoff", loads=["compress"], rules=["lloyd"], y=None, ranges={"load": (0, 0.6)}
    )
    (one,), (end,) = found.maps, found.references
    assert end.end and end.reached < 0.5
    assert not any(state.branched or state.negative_eigenvalues for state in end.solved.states)
    assert np.isnan(one.errors[0, one.x > end.reached * 1.01]).all()
    assert np.isfinite(one.errors[0, one.x <= end.reached]).all()
    assert "St. Venant-Kirchhoff FEM itself ends at" in verdict(found, one)


@pytest.mark.verification
def test_other_axes(study: Path) -> None:
    """Elements of the right length suit Lloyd's squares alone; Poisson's ratio the rules that follow it."""
    found = map_validity(study, rules=["lloyd", "isotropic"], x="aspect", y=None, ranges={"aspect": (1, 2, 3)})
    lloyd, isotropic = found.maps
    assert np.isfinite(lloyd.errors[0]).tolist() == [True, False, False]
    assert "requires squares" in next(iter(lloyd.failures.values()))
    assert "negative stiffness" in next(iter(isotropic.failures.values()))  # beyond sqrt(3)
    assert set(found.table()["aspect"]) == {1.0, 1.5}
    ratios = map_validity(
        study,
        loads=["stretch"],
        rules=["isotropic", "isotropic+volume"],
        x="poisson",
        y="rule",
        ranges={"poisson": (0.1, 0.4, 2), "load": (0, 0.002)},
    )
    plain, corrected = ratios.maps
    assert plain.errors.max() > 0.02 > 0.005 > corrected.errors.max()
    assert len(ratios.figures()) == 1 and len(ratios.references) == 2


IN_SPACE = (
    ('shape = "rectangle"', 'shape = "box"'),
    ('["40 mm", "10 mm"]', '["40 mm", "10 mm", "20 mm"]'),
    ("elements = [8, 2]", "elements = [4, 2, 2]"),
    ('[section]\nkind = "plane-stress"\nthickness = "10 mm"\n', ""),
    ('["0 N", "-0.01 N"]', '["0 N", "-0.01 N", "0 N"]'),
    ('"lloyd"', '"projected"'),
)


@pytest.mark.parametrize(
    ("changes", "width"),
    [((("elements = [8, 2]", "elements = [4, 2]"), IN_SPACE[-1]), ()), (IN_SPACE, (2,))],
    ids=["plane", "space"],
)
def test_elements_of_a_body_are_counted_by_depth_and_aspect(
    tmp_path: Path, changes: tuple[tuple[str, str], ...], width: tuple[int, ...]
) -> None:
    """Of 40 mm by 10 mm, and 20 mm in space, where 2 by 2 elements through the depth are 10 mm by 5 mm."""
    body = Body.of(read_study(written(tmp_path, changed(*changes))))
    assert (body.depth, body.aspect) == (2, pytest.approx(2.0))
    assert body.probe == pytest.approx((0.04, 0.005, 0.01)[: body.dim])
    assert body.counts(3, 2.0) == ((6, 3, *(3 * side for side in width)), True)
    assert body.counts(1, 3.0) == ((1, 1, *width), False)
    assert len(body.mesh(Spot(depth=4)).elements) == 8 * 4 * math.prod(4 * side for side in width)
    assert len(body.mesh(Spot(aspect=1.0)).elements) == 8 * 2 * math.prod(2 * side for side in width)
    assert body.mesh(Spot()) is body.problem.mesh


def test_a_range_counts_values(study: Path) -> None:
    body = Body.of(read_study(study))
    axis = axis_of("poisson", body, dict([read_range("poisson=0:0.4:5")]))
    assert axis.values == pytest.approx([0, 0.1, 0.2, 0.3, 0.4]) and axis.start == (0, 1, 2, 3, 4)
    assert axis_of("poisson", body, {}).values == pytest.approx(np.linspace(0, 0.45, 17))
    depths = axis_of("depth", body, dict([read_range("depth=1:12")]))
    assert depths.values.tolist() == list(range(1, 13)) and depths.values[[*depths.start]].tolist() == [1, 2, 4, 8, 12]
    with pytest.raises(StudyError, match="at least 2"):
        read_range("poisson=0:0.4:1")


@pytest.mark.verification
def test_a_valley_between_two_rows_is_not_filled(study: Path) -> None:
    """Where springs cross the reference at another strain for each Poisson's ratio, they do so between two as well."""
    (one,) = map_validity(
        study, loads=["stretch"], rules=["projected"], y="poisson", ranges={"poisson": (0.25, 0.4, 3)}
    ).maps
    y, errors = one.smooth
    lowest = errors.min(axis=1)
    assert len(y) == 9 and y[::4] == pytest.approx(one.y)
    assert (errors.argmin(axis=1) > 0).all() and len(set(errors.argmin(axis=1).tolist())) > 3
    for first in (0, 4):
        assert lowest[first + 1 : first + 4].max() < lowest[[first, first + 4]].max() + 1e-3


@pytest.mark.parametrize("extent", [(4.0, 0.5), (0.5, 4.0), (2.0, 1.0, 0.3)])
def test_the_standard_force_bends_a_bar_by_its_length(extent: tuple[float, ...]) -> None:
    """By Timoshenko's beam, 5/6 E / (2 (1 + nu)) taken as 0.4 E."""
    bar = Bar(extent, 0.7, 30.0)
    length, height, width = (*extent, 0.7)[:3]
    area, inertia = width * height, width * height**3 / 12
    asked = LOAD_TYPES["bend"].standard(bar)
    (load,) = asked.loads
    total = np.array(load.vector)
    assert total.tolist() == [0.0, total[1], 0.0][: len(extent)] and total[1] < 0
    assert -total[1] * (length**3 / (3 * 30.0 * inertia) + length / (0.4 * 30.0 * area)) == pytest.approx(length)
    assert asked.probe == pytest.approx((length, height / 2, width / 2)[: len(extent)])


def test_loads_are_scaled_one_and_all() -> None:
    mesh = ts.rectangle((2.0, 1.0), (2, 1))
    problem = ts.Problem(
        mesh,
        ts.Material(1.0, 0.3, 1.0),
        ts.PlaneStress(1.0),
        supports=[ts.Fixed("left"), ts.Fixed("right-middle", ["x"], displacement=(0.1, 0.0))],
        loads=[ts.Force("top", (0.0, 1.0)), ts.Traction("top", (0.0, 2.0)), ts.Gravity((0.0, 3.0))],
    )
    half, whole = problem.scaled(0.5).loading, problem.loading
    assert half.external_force == pytest.approx(0.5 * whole.external_force)
    assert half.motion() == pytest.approx(0.5 * whole.motion())
    turned = ts.Problem(
        mesh,
        ts.Material(1.0, 0.3),
        ts.PlaneStress(1.0),
        supports=[ts.Fixed("left", rotation=0.2)],
        loads=[ts.Moment("right", 1.0), ts.Pressure("top", 1.0)][:1],
    )
    assert turned.scaled(0.5).supports[0].rotation == pytest.approx(0.1)
    assert turned.scaled(0.5).loads[0].moment == pytest.approx(0.5)  # type: ignore[union-attr]


def test_the_verb_leaves_a_table_pictures_and_a_page(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["--load", "stretch", "--rule", "lloyd", "--range", "depth=1:4", "--out", str(tmp_path)]
    assert main(["map", str(study), *asked]) == 0
    said = capsys.readouterr().out
    assert said.startswith("Stretched along x, springs by Lloyd's rule are within 5 % of neo-Hookean FEM from 6")
    folder = tmp_path / "small"
    values = json.loads((folder / "validity.json").read_text(encoding="utf-8"))
    (one,) = values["maps"]
    assert one["verdict"].split() == " ".join(said.splitlines()[:1]).split()
    assert np.shape(one["errors"]) == (len(one["y"]), len(one["x"])) == (4, 121)
    assert {len(line) for line in one["lines"]["0.05"]} and one["solved"] < one["whole_grid"] == 4
    with (folder / "validity.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == sum(len(point["size"]) for point in one["points"])
    assert float(rows[0]["stiffness"]) == pytest.approx(-2 / 17, abs=6e-3)
    for kind in ("png", "svg"):
        assert (folder / "figures" / f"validity_stretch_lloyd.{kind}").stat().st_size > 5000
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.index("12\N{NO-BREAK SPACE}% too low") < page.index("How to read a map")
    assert "src=" in page and not re.search(r'(src|href)="http', page)
    assert "from left to right" in page  # the load grows; else errors are those at full load


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        (["--load", "strech"], "did you mean 'stretch'"),
        (["--load", "twist"], "twist needs a body in 3D"),
        (["--rule", "loyd"], "did you mean 'lloyd'"),
        (["--rule", "lloyd+volumes"], "did you mean 'lloyd+volume'"),
        (["--rule", "van-gelder"], "not for quadrilateral elements"),
        (["--law", "mooney"], "'mooney' is unknown"),
        (["--x", "rule"], "allowed for x"),
        (["--y", "load"], "both axes are load"),
        (["--range", "depth=1"], "depth=first:last"),
        (["--range", "depth=0:4"], "integers, at least 1"),
        (["--range", "depht=1:4"], "did you mean 'depth'"),
        (["--range", "poisson=0:0.4"], "range of poisson"),
    ],
)
def test_what_is_wrong_is_said(
    study: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], asked: list[str], told: str
) -> None:
    assert main(["map", str(study), *asked, "--out", str(tmp_path)]) == 2
    assert told in capsys.readouterr().err


def test_a_mesh_from_a_file_is_mapped_as_it_is() -> None:
    tissue = Path(__file__).parent.parent / "examples" / "tissue.toml"
    with pytest.raises(TruespringError, match="--load own"):
        map_validity(tissue, loads=["stretch"])
    with pytest.raises(TruespringError, match="axis aspect"):
        map_validity(tissue, y="aspect")


def test_the_table_has_a_row_for_each_level(bent: Validity) -> None:
    table = bent.table()
    assert set(table["aspect"]) == {1.0} and set(table["depth"]) == {spot.depth for spot in bent.maps[0].deviations}
    assert (
        table.height
        == len(bent.rows)
        == sum(len(deviation.sizes) for one in bent.maps for deviation in one.deviations.values())
    )
    assert table["rms_error"].max() == max(deviation.rms_errors.max() for deviation in bent.maps[1].deviations.values())


@pytest.mark.verification
def test_workers_find_what_one_process_finds(bent: Validity, study: Path) -> None:
    asked = {"depth": (1, 8), "load": (0, 0.3)}
    several = map_validity(study, loads=["bend"], rules=list(LATTICES), ranges=asked, workers=2)
    for one, other in zip(bent.maps, several.maps, strict=True):
        assert one.deviations.keys() == other.deviations.keys()
        assert other.errors == pytest.approx(one.errors, rel=1e-9)


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ({"workers": 2}, (2, None)),
        ({"workers": None}, (None, None)),
        ({"scheduler": "tcp://there:1"}, (None, "tcp://there:1")),
    ],
)
def test_other_processes_solve_where_they_are_asked(
    study: Path, monkeypatch: pytest.MonkeyPatch, asked: dict[str, Any], expected: tuple[Any, ...]
) -> None:
    class StartedError(Exception):
        pass

    def started(*arguments: Any, **more: Any) -> None:
        raise StartedError(*arguments)

    monkeypatch.setattr("truespring.validity.mapping.Pool", started)
    with pytest.raises(StartedError) as caught:
        map_validity(study, loads=["bend"], rules=["lloyd"], **asked)
    assert caught.value.args == expected


def test_lines_of_one_row_are_points(bent: Validity) -> None:
    one = bent.maps[0]
    row = replace(one, y=one.y[:1], errors=np.abs(one.x[None] - 0.1))
    assert [float(part[0, 0]) for part in polylines(row)[0.05]] == pytest.approx([0.05, 0.15])


# Cubes, on which isotropic springs are isotropic.
CUBES = (*IN_SPACE[:2], ("elements = [8, 2]", "elements = [8, 2, 4]"), *IN_SPACE[3:])


@pytest.mark.parametrize(("changes", "cauchy"), [((), 1 / 3), (CUBES, 1 / 4)], ids=["plane", "space"])
def test_all_rules_have_a_volume_term_where_poisson_asks_for_one(
    tmp_path: Path, changes: tuple[tuple[str, str], ...], cauchy: float
) -> None:
    for poisson, varies, terms in ((cauchy, False, False), (cauchy, True, True), (0.4, False, True)):
        text = changed(*changes, ("poisson = 0.3", f"poisson = {poisson}"))
        found = mapped_springs(read_study(written(tmp_path, text)), ["all"], varies)
        assert "isotropic" in {name for one in found for name in (one.name, *one.same)}
        assert any(one.springs.volume for one in found) == terms
        assert all(one.springs.volume == one.name.endswith("+volume") for one in found)


def test_variants_of_gaussian_springs_are_mapped(tmp_path: Path) -> None:
    """By name and in sentences; those of second order on triangles alone."""
    springs = ('rule = "lloyd"\n', 'rule = "gaussian"\nhourglass = 1.2\nlaw = "gent"\n')
    for name, changes in (
        ("squares", ()),
        ("triangles", (("elements = [8, 2]\n", 'elements = [8, 2]\nelement = "triangle"\n'),)),
    ):
        study = read_study(written(tmp_path, changed(*changes)))
        found = {one.name: one for one in mapped_springs(study, ["all"], False)}
        assert ("gaussian+quadratic" in found) == (name == "triangles")
        assert found["gaussian"].words == "Gaussian springs"
        assert not {"isotropic+quadratic", "gaussian+volume"} & set(found)
    assert found["gaussian+quadratic"].words == "Gaussian springs of second order"
    text = changed(springs, ("poisson = 0.3\n", "poisson = 0.3\njm = 30\n"))
    (own,) = mapped_springs(read_study(written(tmp_path, text)), None, False)
    assert own.name == "springs" and own.words == "Gaussian springs with law gent, hourglass 1.2"
    assert mapped_springs(study, ["gaussian+quadratic"], False)[0].springs.element == "quadratic"


def test_what_is_mapped_is_named_by_what_is_its_own() -> None:
    assert _spot(Spot(poisson=0.25)) == " (Poisson's ratio 0.25)" and _spot(Spot()) == ""
    depths = np.array([1.0, 2.0, 3.0, 4.0])
    assert _on_grid(depths, "depth", (1.5, 4.0)) == (2.0, 4.0) and _on_grid(depths, "depth", (1.0, 3.2)) == (1.0, 3.0)
    assert _on_grid(depths, "aspect", (1.5, 3.2)) == (1.5, 3.2)


def test_without_a_probe_the_size_of_a_load_is_read_where_the_body_moves_most() -> None:
    displacement = np.array([[0.0, 0.0], [3.0, -1.0], [-2.0, -3.0]])
    load: Any = SimpleNamespace(sizes=lambda course: course.probe)
    body: Any = SimpleNamespace(probe_in=lambda problem, load: None, extent=(1.0, 1.0))
    states = [SimpleNamespace(displacement=displacement)]
    solved: Any = SimpleNamespace(path=SimpleNamespace(problem=None, states=states), states=states, levels=np.ones(1))
    assert reference._Search(body, load, "linear", None, 1).sizes(solved) == 2
