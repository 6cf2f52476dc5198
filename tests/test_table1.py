"""The measured Table 1: its measures against closed forms and other programs' figures, its page against its figures."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import truespring as ts
from truespring.equilibrium import Solution
from truespring.table1 import measures, page
from truespring.table1.bodies import DEPTH, LENGTH, SMALL, Size, cantilever, end_displacement
from truespring.table1.entries import CRITERIA, ENTRIES, METHODS, PRINTED, Entry
from truespring.table1.figure import figure
from truespring.table1.measures import RATIOS, accuracy, material, reach, speed, to_one_percent
from truespring.table1.signs import IF, MEANING, contradictions, sign

DOCS = Path(__file__).parent.parent / "docs"


def entry(method: str, name: str) -> Entry:
    return next(one for one in ENTRIES if one.method == method and name in one.name)


def errors(one: Entry, dim: int) -> list[float]:
    return [known["error"] for known in material(one, dim)["moduli_errors"]]


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """References on coarser meshes, and shorter paths: the same code in less time."""
    known: dict[tuple[int, bool], Solution] = {}

    def reference(dim: int, large: bool) -> Solution:
        if (dim, large) not in known:
            law, load = ("neo-hookean", 0.02) if large else ("linear", SMALL)
            problem = cantilever(Size(dim, 8), "triangle", load)
            known[dim, large] = ts.solve(problem, ts.Fem(law, "quadratic"), ts.Newton(load_steps=5 if large else 1))
        return known[dim, large]

    monkeypatch.setattr(measures, "reference", reference)
    monkeypatch.setattr(measures, "LARGEST", 0.02)
    monkeypatch.setattr(measures, "followed", lambda: ts.Newton(load_steps=5, max_cutbacks=2))


def test_each_method_of_the_paper_has_one_entry_that_stands_for_it() -> None:
    for dim in (2, 3):
        assert [one.method for one in ENTRIES if one.chief and dim in one.dims] == list(METHODS)
    assert all(len(PRINTED[criterion]) == len(METHODS) for criterion in CRITERIA)
    assert set(MEANING) == set(CRITERIA)
    assert set(IF) == {(criterion, method) for criterion in CRITERIA for method in METHODS} - {
        ("material properties", "FEM")
    }


def test_the_end_moves_as_a_slender_beam_with_shear() -> None:
    """P L^3 / (3 E I) + 6/5 P L / (G A) with P = 1e-4 E A: Timoshenko's beam; a clamped end is a bit stiffer."""
    path = ts.solve(cantilever(Size(2, 8), "triangle", SMALL), ts.Fem("linear", "quadratic"), ts.Newton(load_steps=1))
    bending = SMALL * LENGTH**3 / (3 * DEPTH**3 / 12)
    shear = 1.2 * SMALL * LENGTH * 2 * (1 + 1 / 3)
    assert end_displacement(path, path.states[-1])[1] == pytest.approx(bending + shear, rel=0.01)


def test_moduli_errors_are_those_of_closed_forms() -> None:
    """C of the square lattice with a = b = 3/8 is that of nu = 1/3; Terzopoulos' has no product of two strains."""
    assert max(errors(entry("FEM", "linear"), 2)) < 1e-12
    assert max(errors(entry("HEML", "squares"), 3)) < 1e-12
    assert max(errors(entry("mass-tensor", "linear"), 3)) < 1e-12
    springs = errors(entry("MSM", "isotropic"), 2)
    for ratio, error in zip(RATIOS, springs, strict=True):
        lam, mu = ratio / (1 - ratio**2), 1 / (2 * (1 + ratio))
        wanted = 2 * mu * np.eye(3) + lam * np.array([[1, 1, 0], [1, 1, 0], [0, 0, 0]])
        lattice = np.array([[9 / 8, 3 / 8, 0], [3 / 8, 9 / 8, 0], [0, 0, 3 / 4]])
        assert error == pytest.approx(np.linalg.norm(lattice - wanted) / np.linalg.norm(wanted), abs=1e-12)
    assert errors(entry("Terzopoulos", "trapezoid"), 2)[0] < 1e-12
    nu = 0.45
    lam, mu = nu / (1 - nu**2), 1 / (2 * (1 + nu))
    full = np.array([[lam + 2 * mu, lam, 0], [lam, lam + 2 * mu, 0], [0, 0, 2 * mu]])
    his = np.diag([1.0, 1.0, 2 * mu])
    assert errors(entry("Terzopoulos", "trapezoid"), 2)[-1] == pytest.approx(
        np.linalg.norm(his - full) / np.linalg.norm(full)
    )


@pytest.mark.parametrize(
    ("method", "name", "published"),
    [
        ("FEM", "St. Venant", 0.036),
        ("Terzopoulos", "boundary of the paper", 0.499),
        ("Terzopoulos", "trapezoidal", 0.193),
        ("MSM", "Lloyd", 0.035),
        ("MSM", "isotropic", 0.077),
        ("HEML", "squares", 0.036),
        ("mass-tensor", "St. Venant", 0.130),
    ],
)
def test_small_load_errors_are_those_of_another_program(method: str, name: str, published: float, coarse: None) -> None:
    """On 16 x 4 elements; found by plain NumPy code against a reference of its own."""
    assert accuracy(entry(method, name), Size(2, 4), Size(2, 4))["small_error"] == pytest.approx(published, rel=0.04)


def test_speed_and_reach_are_measured(coarse: None) -> None:
    found = speed(entry("HEML", "squares"), Size(2, 4))
    assert found["load_steps"] == 1 and found["solve_ms"] > found["force_ms"] > 0
    finite = reach(entry("FEM", "neo-Hookean"), Size(2, 8))
    assert finite["ended_by"] == "the largest load" and finite["deflection_within_5_percent"] > 0.6
    linear = reach(entry("FEM", "linear"), Size(2, 8))
    assert linear["ended_by"] == "the error"
    # What a linear law misses is the shortening, 3/5 of the squared deflection over the length in a cubic beam.
    assert linear["deflection_within_5_percent"] == pytest.approx(0.05 * 5 / 3, rel=0.15)


def test_the_mesh_for_one_percent_is_one_from_which_on_all_are_enough(
    coarse: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(measures, "DEPTHS", (2, 4, 8, 12))
    assert to_one_percent(entry("FEM", "linear"))["depth_to_1_percent"] == 8  # 1 + 0.5 / n^2 in bending
    assert to_one_percent(entry("MSM", "Lloyd"))["depth_to_1_percent"] is None


# --- signs and page ---------------------------------------------------------------------------


def row(method: str, **values: Any) -> dict[str, Any]:
    plain = {
        "dim": 2,
        "method": method,
        "name": "x",
        "chief": True,
        "solve_ms": 100.0,
        "load_steps": 1,
        "setup_ms": 0.0,
        "force_ms": 1.0,
        "moduli_errors": [{"poisson": ratio, "error": 0.0} for ratio in RATIOS],
        "small_error": 0.036,
        "small_limit": 0.002,
        "deflection_within_5_percent": 0.6,
        "ended_by": "the error",
        "refused": [],
    }
    return plain | values


def test_signs_follow_from_figures() -> None:
    finite = row("FEM")
    some = [{"poisson": ratio, "error": 0.04 if ratio > 0.3 else 0.2} for ratio in RATIOS]
    cases: list[tuple[str, dict[str, Any], str]] = [
        ("computational speed", row("MSM", solve_ms=49.0), "+"),
        ("computational speed", row("MSM", solve_ms=60.0), "+/-"),
        ("computational speed", row("MSM", solve_ms=201.0), "-"),
        ("computational speed", row("MSM", solve_ms=None), "-"),
        ("material properties", row("MSM"), "+"),
        ("material properties", row("MSM", moduli_errors=some), "+/-"),
        ("material properties", row("MSM", moduli_errors=some[:3]), "-"),
        ("results accuracy", row("MSM", small_error=0.08), "+/-"),
        ("results accuracy", row("MSM", small_error=0.08, small_limit=None), "-"),
        ("large deflection", row("MSM", deflection_within_5_percent=0.3), "+/-"),
        ("large deflection", row("MSM", deflection_within_5_percent=0.0), "-"),
    ]
    for criterion, one, wanted in cases:
        assert sign(criterion, one, finite) == wanted
    rows = [finite, *(row(method) for method in METHODS[1:])]
    assert ("results accuracy", "HEML", "-", "+") in contradictions(rows, 2)
    assert not [one for one in contradictions(rows, 2) if one[1] == "FEM"]


def test_the_page_of_the_docs_is_what_its_figures_give() -> None:
    table = json.loads((DOCS / "table1.json").read_text(encoding="utf-8"))
    assert {one["dim"] for one in table["rows"]} == {2, 3} and table["seconds"] < 15 * 60
    written = (DOCS / "table1.md").read_text(encoding="utf-8")
    assert written == page(table, {2: "images/table1_2d.svg", 3: "images/table1_3d.svg"})
    for dim in (2, 3):
        for criterion, method, _, measured in contradictions(table["rows"], dim):
            assert f"* {method}, {criterion}:" in written and f"measured {measured}" in written


def test_figures_have_a_bar_for_each_entry_and_measure() -> None:
    table = {"rows": [row(method) for method in METHODS]}
    bars = [artist for artist in figure(table, 2).artists if artist.get_gid() == "bar"]
    assert len(bars) == 4 * len(METHODS)


def test_one_function_is_one_row_of_figures(coarse: None) -> None:
    """FEM, HEML and the mass-tensor method by one law on one kind of element cannot differ but in time."""
    pairs: list[tuple[Entry, Entry]] = [
        (entry("FEM", "squares, cubes; St"), entry("HEML", "squares")),
        (entry("HEML", "simplices; St"), entry("mass-tensor", "simplices; St")),
    ]
    same: list[Callable[[Entry], Any]] = [
        lambda one: accuracy(one, Size(2, 3), Size(2, 4)),
        lambda one: material(one, 2),
    ]
    for first, second in pairs:
        for measure in same:
            mine, theirs = json.dumps(measure(first)), json.dumps(measure(second))
            assert _numbers(mine) == pytest.approx(_numbers(theirs), rel=1e-7, abs=1e-11)


def _numbers(text: str) -> list[float]:
    found: list[float] = []
    json.loads(text, parse_float=lambda digits: found.append(float(digits)))
    return found
