"""The decks for CalculiX and Abaqus: their numbers are the problem's, and CalculiX settles where we do."""

import itertools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.calculix import displacements, needs_ccx
from tests.exports import difference, exported
from truespring.arrays import Floats
from truespring.errors import ExportError
from truespring.exports import Exported, target_files
from truespring.exports.calculix import fem_deck, spring_deck
from truespring.loading.pressure import SurfacePressure
from truespring.mesh import read_mesh
from truespring.mesh.files.inp import read_inp
from truespring.reference.ccx import run_ccx
from truespring.reference.dat import read_dat

UNITS = {"calculix": 1e-6, "abaqus": 1.0}  # of forces [N]
targets = pytest.mark.parametrize("target", UNITS)
CASES = ("bending", "two springs", "block", "moved", "turned", "snapping")
cases = pytest.mark.parametrize("case", CASES)


def deck_of(case: str, target: str, name: str) -> str:
    text = target_files(exported(case), [target])[target][name]
    assert isinstance(text, str)
    return text


# --- a reader of its own -----------------------------------------------------------------------------------------


@dataclass
class Card:
    """A keyword, its parameters, and the lines of data below it."""

    keyword: str
    parameters: dict[str, str]
    rows: list[list[str]]


def cards(text: str) -> list[Card]:
    found: list[Card] = []
    for line in text.splitlines():
        if line.startswith("**"):
            continue
        if line.startswith("*"):
            keyword, *parameters = [part.strip() for part in line[1:].split(",")]
            pairs = [part.partition("=") for part in parameters]
            found.append(Card(keyword, {name: value for name, _, value in pairs}, []))
        else:
            found[-1].rows.append([part.strip() for part in line.split(",")])
    return found


def model_and_steps(text: str) -> tuple[list[Card], list[list[Card]]]:
    """The cards before the first step, and those of each step."""
    everything = cards(text)
    starts = [place for place, card in enumerate(everything) if card.keyword == "STEP"] + [len(everything)]
    steps = [everything[start:end] for start, end in itertools.pairwise(starts)]
    assert all(step[-1].keyword == "END STEP" for step in steps)
    return everything[: starts[0]], steps


def among(several: list[Card], keyword: str) -> list[Card]:
    return [card for card in several if card.keyword == keyword]


def numbers(card: Card) -> Floats:
    return np.array([[float(value) for value in row] for row in card.rows])


def springs_of(model: list[Card]) -> dict[tuple[int, int], float]:
    """Stiffness by pair of nodes, counted from 0."""
    stiffness = {card.parameters["ELSET"]: float(card.rows[1][0]) for card in among(model, "SPRING")}
    found: dict[tuple[int, int], float] = {}
    for card in among(model, "ELEMENT"):
        assert card.parameters["TYPE"] == "SPRINGA"
        for _, first, second in card.rows:
            pair = (int(first) - 1, int(second) - 1)
            assert pair not in found
            found[pair] = stiffness[card.parameters["ELSET"]]
    return found


def on_nodes(card: Card, shape: tuple[int, int], value: int) -> Floats:
    """Amounts by node and direction, not a number where none is given."""
    found = np.full(shape, np.nan)
    for row in card.rows:
        assert np.isnan(found[int(row[0]) - 1, int(row[1]) - 1])
        found[int(row[0]) - 1, int(row[1]) - 1] = float(row[value])
    return found


# --- numbers -----------------------------------------------------------------------------------------------------


def check_springs(text: str, one: Exported, unit: float) -> None:
    """All numbers of a deck of springs are those of the network and the problem."""
    model, steps = model_and_steps(text)
    network, loading = one.network, one.problem.loading
    (nodes,) = among(model, "NODE")
    assert numbers(nodes)[:, 1:] == pytest.approx(network.nodes, rel=1e-11, abs=1e-18)
    found = springs_of(model)
    assert len(found) == len(network.springs)
    for (first, second), stiffness in zip(network.springs.tolist(), network.stiffness, strict=True):
        assert unit * found[first, second] == pytest.approx(stiffness, rel=1e-11)
    assert unit * sum(found.values()) == pytest.approx(network.stiffness.sum(), rel=1e-11)
    assert [card.rows for card in among(model, "BOUNDARY")] == [[["NALL", "3", "3"]]] * (network.nodes.shape[1] == 2)
    for number, step in enumerate(steps[-one.load_steps :], 1):
        check_step(step, one, number / one.load_steps, loading.external_force, unit)


def check_step(step: list[Card], one: Exported, level: float, external: Floats, unit: float) -> None:
    loading = one.problem.loading
    (boundary,) = among(step, "BOUNDARY")
    rows = [row for row in boundary.rows if row[0] != "NALL"]
    held = on_nodes(Card("BOUNDARY", {}, rows), external.shape, 3)
    assert (~np.isnan(held) == loading.held).all()
    assert held[loading.held] == pytest.approx(loading.motion(level)[loading.held], rel=1e-11, abs=1e-18)
    force = np.zeros(external.shape)
    for card in among(step, "CLOAD"):
        force = np.nan_to_num(on_nodes(card, external.shape, 2))
    assert unit * force == pytest.approx(level * external, rel=1e-11, abs=1e-18)
    (static,) = among(step, "STATIC")
    first, period, least, largest = (float(value) for value in static.rows[0])
    assert period == pytest.approx(1 / one.load_steps) and least < 1e-4 * period
    assert first == largest == pytest.approx(min(period, 0.25))


@targets
@cases
def test_springs_hold_our_numbers(case: str, target: str) -> None:
    check_springs(deck_of(case, target, "springs.inp"), exported(case), UNITS[target])


@targets
@pytest.mark.parametrize("keyword", ["NODE", "SPRING", "BOUNDARY", "CLOAD"])
def test_a_number_that_drifts_by_a_millionth_is_seen(keyword: str, target: str) -> None:
    lines = deck_of("moved", target, "springs.inp").splitlines()
    start = max(place for place, line in enumerate(lines) if line.split(",")[0] == f"*{keyword}")
    given = (place for place in range(start + 1, len(lines)) if re.search(r"[1-9].*e[+-]\d\d$", lines[place]))
    place = next(place for place in given if float(lines[place].rpartition(" ")[2]))
    head, _, value = lines[place].rpartition(" ")
    lines[place] = f"{head} {float(value) * (1 + 1e-6):.12e}"
    with pytest.raises(AssertionError):
        check_springs("\n".join(lines), exported("moved"), UNITS[target])


@targets
@pytest.mark.parametrize("case", ["bending", "block", "moved", "turned"])
def test_elements_hold_our_numbers(case: str, target: str) -> None:
    one, unit = exported(case), UNITS[target]
    problem, mesh = one.problem, one.problem.mesh
    model, steps = model_and_steps(deck_of(case, target, "fem.inp"))
    assert numbers(among(model, "NODE")[0])[:, 1:] == pytest.approx(mesh.nodes, rel=1e-11, abs=1e-18)
    (elements,) = among(model, "ELEMENT")
    assert elements.parameters == {"TYPE": {2: "CPS4", 3: "C3D8"}[mesh.dim], "ELSET": "BODY"}
    assert (numbers(elements)[:, 1:] == mesh.elements + 1).all()
    sets = {card.parameters["ELSET"]: [int(n) for row in card.rows for n in row] for card in among(model, "ELSET")}
    sets["BODY"] = list(range(1, len(mesh.elements) + 1))
    sections, materials = among(model, "SOLID SECTION"), among(model, "MATERIAL")
    elastic, density = among(model, "ELASTIC"), among(model, "DENSITY")
    assert len(sections) == len(materials) == len(elastic) == len(problem.materials)
    for place, material in enumerate(problem.materials):
        assert sections[place].parameters["MATERIAL"] == materials[place].parameters["NAME"]
        own = np.flatnonzero(problem.material_numbers == place) + 1
        assert sets[sections[place].parameters["ELSET"]] == own.tolist()
        young, poisson = numbers(elastic[place])[0]
        assert (unit * young, poisson) == pytest.approx((material.young, material.poisson), rel=1e-11)
        if material.density:
            assert unit * float(density[place].rows[0][0]) == pytest.approx(material.density, rel=1e-11)
        if mesh.dim == 2:
            assert float(sections[place].rows[0][0]) == problem.section.thickness  # type: ignore[union-attr]
    dead = without_weight(problem)
    for number, step in enumerate(steps, 1):
        check_step(step, one, number / one.load_steps, dead, unit)
        weights = [row for card in among(step, "DLOAD") for row in card.rows]
        wanted = [load for load in problem.loads if isinstance(load, ts.Gravity)]
        assert len(weights) == len(wanted)
        for row, load in zip(weights, wanted, strict=True):
            assert row[:2] == ["BODY", "GRAV"]
            size, *direction = (float(value) for value in row[2:])
            assert size * np.array(direction) == pytest.approx(number / 5 * np.array(load.acceleration), rel=1e-11)


def without_weight(problem: ts.Problem) -> Floats:
    """The dead loads without gravity, which decks of elements leave to the program."""
    others = [load for load in problem.loads if not isinstance(load, ts.Gravity)]
    if not others:
        return np.zeros(problem.mesh.nodes.shape)
    return ts.Problem(
        problem.mesh, problem.material, problem.section, problem.supports, others, problem.regions
    ).loading.external_force


SHAPES = {
    "quadrilateral": lambda: ts.rectangle((0.08, 0.04), (4, 2)),
    "triangle": lambda: ts.rectangle((0.08, 0.04), (4, 2), "triangle"),
    "hexahedron": lambda: ts.box((0.08, 0.04, 0.02), (3, 2, 1)),
    "tetrahedron": lambda: ts.box((0.08, 0.04, 0.02), (3, 2, 1), "tetrahedron"),
    "bcc-tetrahedron": lambda: ts.box((0.08, 0.04, 0.02), (3, 2, 1), "bcc-tetrahedron"),
}
# Nodes of each face by the name that both manuals give it, for elements of so many nodes.
FACES = {
    "CPE3": ("12", "23", "31"),
    "CPE4": ("12", "23", "34", "41"),
    "C3D4": ("123", "142", "243", "341"),
    "C3D8": ("1234", "5876", "1562", "2673", "3784", "4851"),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_pressure_is_on_the_faces_that_it_presses(shape: str) -> None:
    """The faces named add up to the pressed surface: at rest, its area and its normal."""
    mesh = SHAPES[shape]()
    sides = ("left", "right") if mesh.dim == 2 else ("left", "right", "back", "front")
    problem = ts.Problem(
        mesh,
        ts.Material(10e3, 0.3),
        ts.PlaneStrain(0.5) if mesh.dim == 2 else None,
        [ts.Fixed(side) for side in sides],
        [ts.Pressure("top", 200.0)],
    )
    model, steps = model_and_steps(fem_deck(problem, [0.5, 1.0], "saint-venant-kirchhoff"))
    kind = among(model, "ELEMENT")[0].parameters["TYPE"]
    (load,) = problem.loading.following
    assert isinstance(load, SurfacePressure)
    wanted = -load.gradient(mesh.nodes).sum(axis=0)
    for level, step in zip((0.5, 1.0), steps, strict=True):
        total = np.zeros(3)
        for number, face, pressure in among(step, "DLOAD")[0].rows:
            places = [int(corner) - 1 for corner in FACES[kind][int(face.removeprefix("P")) - 1]]
            corners = np.zeros((len(places), 3))
            corners[:, : mesh.dim] = mesh.nodes[mesh.elements[int(number) - 1, places]]
            total += float(pressure) * 1e-6 * inward(corners, 0.5)
        assert total[: mesh.dim] == pytest.approx(level * wanted, rel=1e-9, abs=1e-9)


def inward(corners: Floats, thickness: float) -> Floats:
    """Area times inward normal of a face whose nodes are named as from within, or of an edge, anticlockwise [m^2]."""
    if len(corners) == 2:
        x, y, _ = corners[1] - corners[0]
        return thickness * np.array([-y, x, 0.0])
    fan = [np.cross(b - corners[0], c - corners[0]) / 2 for b, c in itertools.pairwise(corners[1:])]
    return np.asarray(np.sum(fan, axis=0))


# --- the form ----------------------------------------------------------------------------------------------------


def every_deck() -> Iterator[tuple[str, str]]:
    for case, target in itertools.product(CASES, UNITS):
        for name, text in target_files(exported(case), [target])[target].items():
            assert isinstance(text, str)
            yield f"{case} {target} {name}", text


def test_no_number_is_longer_than_calculix_reads_and_no_line_than_abaqus() -> None:
    seen = 0
    for what, text in every_deck():
        for line in text.splitlines():
            assert len(line) <= 256, what
            if not line.startswith("*"):
                values = [value.strip() for value in line.split(",")]
                seen += len(values)
                assert len(values) <= 16 and all(len(value) <= 19 or not value[-1:].isdigit() for value in values), what
    assert seen > 10_000


@targets
def test_headers_tell_units_supports_loads_how_to_run_and_what_is_not_there(target: str) -> None:
    springs, fem = (deck_of("block", target, name) for name in ("springs.inp", "fem.inp"))
    for name, text in (("springs", springs), ("fem", fem)):
        head = " ".join(line[2:].strip() for line in text.splitlines() if line.startswith("**"))
        run = {"calculix": f"ccx {name}", "abaqus": f"abaqus job={name} interactive"}[target]
        for words in (
            'Case: block -- <&> "quoted"',
            "written by truespring",
            "Support 1: 'left' held along x, y, z",
            "Load 1: gravity (0, -9.81, 0) m/s^2",
            "Young's modulus 20000 Pa",
            {"calculix": "micronewtons (uN)", "abaqus": "Units are SI"}[target],
            "is node i + 1",
            run,
        ):
            assert words in head, (name, words)
        assert ("Units are SI" in head) == (target == "abaqus")
        assert ("was not run" in head) == (target == "abaqus")
        assert ("Expected at full load" in head) == (name == "springs")
    assert "as nodal forces" in springs and "as nodal forces" not in fem


@targets
def test_other_readers_see_the_same_mesh(target: str, tmp_path: Path) -> None:
    import meshio

    for case in ("bending", "block"):
        mesh, problem = exported(case).problem.mesh, exported(case).problem
        for name in ("springs.inp", "fem.inp"):
            (tmp_path / name).write_text(deck_of(case, target, name))
        read = read_mesh(tmp_path / "fem.inp")
        assert read.nodes == pytest.approx(mesh.nodes, rel=1e-11, abs=1e-18)
        assert (read.elements == mesh.elements).all()
        assert len(read.node_groups["NALL"]) == mesh.n_nodes and len(read.element_groups["BODY"]) == len(mesh.elements)
        assert read.node_groups["HELD"].tolist() == np.flatnonzero(problem.loading.held.any(axis=1)).tolist()
        if problem.regions:
            assert read.element_groups["PART2"].tolist() == np.flatnonzero(problem.material_numbers == 1).tolist()
        other = meshio.read(tmp_path / "fem.inp")
        assert other.points == pytest.approx(mesh.nodes, rel=1e-11, abs=1e-18)
        assert (other.cells[0].data == mesh.elements).all() and "HELD" in other.point_sets
        lines = read_inp((tmp_path / "springs.inp").read_bytes()).cells
        order = np.argsort(np.concatenate([one.numbers for one in lines]))
        assert {one.kind for one in lines} == {"line"}
        ends = np.concatenate([one.nodes for one in lines])[order]
        assert (ends == exported(case).network.springs + 1).all()


# --- settling ----------------------------------------------------------------------------------------------------


settling = pytest.mark.parametrize("case", [case for case in CASES if case != "snapping"])


@needs_ccx
@settling
def test_calculix_settles_on_our_equilibrium(case: str, tmp_path: Path) -> None:
    """Every level is printed, the last is ours."""
    found = displacements(deck_of(case, "calculix", "springs.inp"), tmp_path)
    assert len(found) == exported(case).load_steps
    assert difference(found[-1], case) < 1e-6


@needs_ccx
def test_ansys_vm9_settles_in_the_exported_deck(tmp_path: Path) -> None:
    """No spring holds the node across at rest: it is led aside first."""
    last = displacements(deck_of("two springs", "calculix", "springs.inp"), tmp_path)[-1]
    assert last[1] == pytest.approx([8.6321, 4.5319, 0.0], rel=1e-3)
    assert last[1, :2] == pytest.approx([8.63207, 4.53191], abs=1e-5)


@needs_ccx
def test_calculix_stops_below_a_limit_load(tmp_path: Path) -> None:
    """The truss snaps through under more than it bears: there static increments end."""
    deck, one = tmp_path / "springs.inp", exported("snapping")
    deck.write_text(deck_of("snapping", "calculix", "springs.inp"))
    assert run_ccx(deck, threads=1).errors
    reached = read_dat(deck.with_suffix(".dat")).levels
    assert 0 < len(reached) < one.load_steps
    for level in reached:
        ours = one.path.at(level.time)
        assert ours is not None
        assert level.displacement[:, :2] == pytest.approx(ours.displacement, rel=1e-5, abs=1e-12)


@needs_ccx
@settling
def test_calculix_reads_the_decks_for_abaqus(case: str, tmp_path: Path) -> None:
    """The same keywords but for requests of output and names of steps; in newtons ccx stops a little early."""
    found = displacements(deck_of(case, "abaqus", "springs.inp"), tmp_path)
    assert difference(found[-1], case) < 1e-4


@needs_ccx
@pytest.mark.parametrize("case", ["bending", "block", "moved", "turned"])
@targets
def test_calculix_runs_the_finite_elements(case: str, target: str, tmp_path: Path) -> None:
    one = exported(case)
    newton = ts.Newton(load_steps=one.load_steps)
    ours = ts.solve(one.problem, ts.Fem("saint-venant-kirchhoff", "linear"), newton)
    found = displacements(deck_of(case, target, "fem.inp"), tmp_path)
    assert len(found) == one.load_steps
    moved = ours.states[-1].displacement
    apart = np.linalg.norm(found[-1][:, : moved.shape[1]] - moved) / np.linalg.norm(moved)
    assert apart < {3: 1e-4, 2: 7e-3}[one.problem.mesh.dim]


# --- what cannot be said -----------------------------------------------------------------------------------------


@targets
def test_without_a_continuum_there_are_springs_alone(target: str) -> None:
    files = target_files(exported("two springs"), [target])[target]
    assert list(files) == ["springs.inp"]
    assert "fem.inp was not written" in str(files["springs.inp"])


def test_levels_laws_and_elements_that_are_none_are_refused() -> None:
    problem = exported("bending").problem
    for levels in ([], [0.0, 1.0], [0.5, 0.5], [1.0, 0.5], [0.5, 1.1]):
        with pytest.raises(ExportError, match="ascending"):
            fem_deck(problem, levels, "linear")
        with pytest.raises(ExportError, match="ascending"):
            spring_deck(problem, exported("bending").network, levels)
    with pytest.raises(ExportError, match="neo-hookean"):
        fem_deck(problem, [1.0], "neo-hookean")
    with pytest.raises(ExportError, match="tetrahedra"):
        fem_deck(problem, [1.0], "linear", "quadratic")


def vars_of(problem: ts.Problem) -> dict[str, object]:
    return {name: getattr(problem, name) for name in ("mesh", "material", "section", "supports", "loads")}
