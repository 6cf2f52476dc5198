"""What every load of LOADS answers, and one that is in no table: added as CONTRIBUTING says, it passes the same."""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Self

import numpy as np
import pytest

import truespring as ts
from tests.test_calculix_decks import among, model_and_steps
from tests.wording import in_order
from truespring.arrays import Bools, Floats
from truespring.errors import ExportError, ProblemError
from truespring.exports import TARGETS, Exported, check_targets, solve_springs
from truespring.exports.calculix import fem_deck
from truespring.exports.features import Feature
from truespring.loading import (
    LOADS,
    Body,
    DeadLoad,
    Load,
    LoadKind,
    Mark,
    Quantity,
    Spread,
    selection_words,
    vector_words,
)
from truespring.mesh import Selection, corner_measures, facets_within, loaded, refined, select
from truespring.models import Springs
from truespring.report.symbols import find_acting
from truespring.study.schema import load_form
from truespring.study.toml import toml_text
from truespring.units import SI_UNITS


@dataclass(frozen=True)
class Wind(DeadLoad):
    """A dead pressure [Pa] at an angle [rad] to a direction of any length [m], on facets of a plane body."""

    on: Selection
    wind: float
    along: tuple[float, ...]
    angle: float = 0.0

    @property
    def way(self) -> Floats:
        """The direction, a unit vector, shape (2,)."""
        cos, sin = np.cos(self.angle), np.sin(self.angle)
        return np.array([[cos, -sin], [sin, cos]]) @ self.along / np.linalg.norm(self.along)

    def spread(self, body: Body) -> Spread:
        facets = facets_within(body.mesh, self.on)
        density = np.tile(body.thickness * self.wind * self.way, (len(facets), 1))
        return Spread(*body.carrying(facets, corner_measures(body.mesh.nodes[facets])), density)

    def scaled(self, factor: float) -> Self:
        return replace(self, wind=factor * self.wind)

    def turned(self, rotation: Floats) -> Self:
        return replace(self, along=tuple(rotation @ self.along))

    def mark(self, body: Body, held: Bools) -> Mark:
        return Mark(loaded(body.mesh, self.on), self.way, "w", self.wind, "Pa")

    def words(self) -> str:
        about = f"{self.angle:g} rad from {vector_words(self.along)}"
        return f"wind {self.wind:g} Pa at {about} on {selection_words(self.on)}"


# The line that a new load needs.
WIND = LoadKind(
    Wind,
    Quantity("wind", "stress", "the pressure of the wind"),
    {
        "along": Quantity("along", "length", "the direction that the angle is measured from", vector=True),
        "angle": Quantity("angle", "angle", "from the direction, anticlockwise", default=0.25),
    },
    dims=(2,),
)
ALL = {**LOADS, "wind": WIND}
FORM = load_form(ALL)
CASES = [(key, dim) for key, kind in ALL.items() for dim in kind.dims]
DEAD = [(key, dim) for key, dim in CASES if not ALL[key].load.follows]
FOLLOWS = [(key, dim) for key, dim in CASES if ALL[key].load.follows]
cases = pytest.mark.parametrize(("key", "dim"), CASES)

SIZE = (3.0, 2.0, 4.0)
SUPPORTED = {2: ("left", "right"), 3: ("left", "right", "back", "front")}


def values(key: str, dim: int) -> dict[str, object]:
    """What a study file could give: small beside the body's stiffness."""
    vector = [3.0, -2.0, 1.0][:dim]
    return {name: vector if one.vector else 2.5 for name, one in ALL[key].quantities(key).items()}


def load_of(key: str, dim: int, on: str = "top") -> Load:
    kind = ALL[key]
    arguments = {kind.quantities(key)[name].argument: value for name, value in values(key, dim).items()}
    return kind.load(**({"on": on} if kind.on_selection else {}), **arguments)


#: Directions of two families of fibres, of another angle to each axis.
ALONG = {2: [(2.0, 1.0), (1.0, -3.0)], 3: [(2.0, 1.0, 0.5), (1.0, -3.0, 2.0)]}


@cache
def mesh_of(dim: int, element: str = "") -> ts.Mesh:
    """A body with a group of elements named as a side: loads on elements take the one, others the other."""
    if dim == 2:
        mesh = ts.rectangle(SIZE[:2], (4, 3), element or "quadrilateral")
    else:
        mesh = ts.box(SIZE, (3, 2, 3), element or "hexahedron")
    return replace(mesh, element_groups={"top": np.flatnonzero(mesh.centres[:, 1] > 0.5 * SIZE[1])})


def problem_of(key: str, dim: int, mesh: ts.Mesh | None = None, material: float = 1e3) -> ts.Problem:
    """A body held at its sides, so that every surface load on its top has a potential."""
    mesh = mesh or mesh_of(dim)
    section = ts.PlaneStress(0.5) if dim == 2 else None
    supports = [ts.Fixed(side) for side in SUPPORTED[dim]]
    along = ts.Fibres(ALONG[dim])
    return ts.Problem(mesh, ts.Material(material, 0.25, 1.5, fibres=along), section, supports, load_of(key, dim))


def forces(problem: ts.Problem, positions: Floats) -> Floats:
    return problem.loading.force(positions)


def somewhere(problem: ts.Problem) -> Floats:
    """Positions far from rest, held nodes at rest."""
    noise = np.random.default_rng(5).uniform(-0.1, 0.1, problem.mesh.nodes.shape)
    return problem.mesh.nodes + np.where(problem.loading.held, 0.0, noise)


# --- how they act -------------------------------------------------------------------------------------


RESULTANTS: dict[str, Callable[[Floats, float, float], Floats]] = {
    "force": lambda vector, area, volume: vector,
    "traction": lambda vector, area, volume: area * vector,
    "gravity": lambda vector, area, volume: 1.5 * volume * vector,
    "wind": lambda vector, area, volume: (
        area * 2.5 * np.array([[np.cos(2.5), -np.sin(2.5)], [np.sin(2.5), np.cos(2.5)]]) @ vector / np.hypot(*vector)
    ),
}


@pytest.mark.parametrize(("key", "dim"), DEAD)
@pytest.mark.parametrize("form", ["squares", "simplices", "halved", "second order"])
def test_a_dead_load_has_its_resultant_and_its_moment_on_every_mesh(key: str, dim: int, form: str) -> None:
    """Resultant by a closed form; first moments of a uniform load are those of its centroid."""
    mesh = mesh_of(dim)
    if form == "halved":
        mesh = refined(mesh)
    elif form != "squares":
        mesh = mesh_of(dim, "triangle" if dim == 2 else "tetrahedron")
    problem = problem_of(key, dim, mesh)
    nodes, force = mesh.nodes, problem.loading.external_force
    if form == "second order":
        finer = ts.Fem("linear", "quadratic").potential(problem)
        nodes, force = finer.nodes, finer.loading.external_force  # type: ignore[attr-defined]
    size = np.array(SIZE[:dim])
    thickness = 0.5 if dim == 2 else 1.0
    vector = np.array([3.0, -2.0, 1.0])[:dim]
    total = RESULTANTS[key](vector, float(size[0] * np.prod(size[2:])) * thickness, float(size.prod()) * thickness)
    centroid = size / 2
    if ALL[key].on_selection:
        centroid[1] = size[1]
    assert force.sum(axis=0) == pytest.approx(total, rel=1e-12)
    assert nodes.T @ force == pytest.approx(np.outer(centroid, total), rel=1e-12)


@pytest.mark.parametrize(("key", "dim"), FOLLOWS)
def test_a_load_that_follows_is_the_gradient_of_its_work(key: str, dim: int) -> None:
    problem = problem_of(key, dim)
    (load,) = problem.loading.following
    free = ~problem.loading.held
    x, way = somewhere(problem), np.where(free, np.random.default_rng(6).normal(size=free.shape), 0.0)
    slope = float((load.gradient(x) * way).sum())
    image = (load.hessian(x) @ way.ravel()).reshape(x.shape)[free]
    assert abs(slope) > 1e-3 and np.linalg.norm(image) > 1e-3
    off_energy, off_gradient = [], []
    for step in (2e-2, 1e-2, 5e-3):
        ahead, behind = x + step * way, x - step * way
        off_energy.append(abs((load.energy(ahead) - load.energy(behind)) / (2 * step) - slope) / abs(slope))
        change = (load.gradient(ahead) - load.gradient(behind))[free] / (2 * step)
        off_gradient.append(float(np.linalg.norm(change - image) / np.linalg.norm(image)))
    for off in (off_energy, off_gradient):  # central differences: second order, or exact for a polynomial
        assert off[-1] < 1e-9 or np.log2(off[0] / off[1]) == pytest.approx(2, abs=0.1), off
        assert off[-1] < 1e-3
    tangent = load.hessian(x).toarray()
    assert np.abs(tangent - tangent.T).max() < 1e-12 * np.abs(tangent).max()


def test_a_load_is_dead_or_follows() -> None:
    for key, dim in CASES:
        problem = problem_of(key, dim)
        dead, follows = problem.loading.external_force.any(), bool(problem.loading.following)
        assert (dead, follows) == (not ALL[key].load.follows, ALL[key].load.follows), key


# --- how they scale and turn --------------------------------------------------------------------------


@cases
def test_a_scaled_load_has_scaled_forces(key: str, dim: int) -> None:
    problem = problem_of(key, dim)
    x = somewhere(problem)
    assert np.abs(forces(problem, x)).max() > 0
    assert forces(problem.scaled(-0.3), x) == pytest.approx(-0.3 * forces(problem, x), rel=1e-12, abs=1e-15)


def rotation_of(dim: int) -> Floats:
    first = np.eye(dim)
    first[:2, :2] = [[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]]
    if dim == 2:
        return first
    second = np.eye(3)
    second[1:, 1:] = [[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]]
    return second @ first


@cases
def test_a_turned_problem_has_a_turned_solution(key: str, dim: int) -> None:
    """Body, supports and load turned as one: forces at any state and the equilibrium turn with them."""
    problem, turn = problem_of(key, dim), rotation_of(dim)
    groups = {side: select(problem.mesh, side) for side in ("top", *SUPPORTED[dim])}
    mesh = replace(problem.mesh, node_groups=groups)
    problem = replace(problem, mesh=mesh)
    assert problem.material and problem.material.fibres
    other = replace(
        problem,
        material=replace(problem.material, fibres=problem.material.fibres.turned(turn)),
        mesh=replace(mesh, nodes=mesh.nodes @ turn.T),
        loads=[load.turned(turn) for load in problem.loads],
        supports=[support.turned(turn) for support in problem.supports],
    )
    x = somewhere(problem)
    assert forces(other, x @ turn.T) == pytest.approx(forces(problem, x) @ turn.T, rel=1e-11, abs=1e-12)
    model, newton = ts.Fem("saint-venant-kirchhoff", "linear"), ts.Newton(load_steps=1)
    one, two = (ts.solve(asked, model, newton) for asked in (problem, other))
    assert one.status is two.status is ts.Status.CONVERGED
    moved = one.states[-1].displacement
    assert np.abs(moved).max() > 1e-4
    assert two.states[-1].displacement == pytest.approx(moved @ turn.T, abs=1e-8 * np.abs(moved).max())


# --- how they are shown -------------------------------------------------------------------------------


@cases
def test_a_load_is_drawn_where_it_acts(key: str, dim: int) -> None:
    problem = problem_of(key, dim)
    (arrow,) = find_acting(problem)
    assert arrow.vector.shape == (dim,) and np.isfinite(arrow.vector).all() and arrow.vector.any()
    acting = np.flatnonzero(forces(problem, problem.mesh.nodes).any(axis=1))
    assert len(acting) and set(acting) <= set(arrow.nodes.tolist())
    if ALL[key].on_selection:
        assert set(arrow.nodes.tolist()) == set(problem.loads[0].nodes(problem.mesh).tolist())
        elements = problem.mesh.elements[problem.mesh.element_groups["top"]]
        there = elements if ALL[key].load.on_elements else select(problem.mesh, "top")
        assert set(arrow.nodes.tolist()) == set(np.unique(there).tolist())
    assert " = " in arrow.text


@cases
def test_a_load_is_worded(key: str, dim: int) -> None:
    words = load_of(key, dim).words()
    assert "\n" not in words and not words.endswith(".")
    assert ("'top'" in words) == ALL[key].on_selection
    assert all(f"{value:g}" in words for one in values(key, dim).values() for value in np.ravel(one))


# --- how they are read and exported -------------------------------------------------------------------


@cases
def test_a_load_is_read_from_toml(key: str, dim: int) -> None:
    """In numbers, and in texts with a unit."""
    kind, given = ALL[key], values(key, dim)
    form, units = FORM, {name: SI_UNITS[one.dimension][0] for name, one in kind.quantities(key).items()}
    on = {"on": "top"} if kind.on_selection else {}

    def with_unit(name: str) -> object:
        value = given[name]
        return [f"{one} {units[name]}" for one in value] if isinstance(value, list) else f"{value} {units[name]}"

    for tables in ({**on, **given}, {**on, **{name: with_unit(name) for name in given}}):
        read = form.model_validate(tomllib.loads(toml_text({"load": [tables]}))["load"][0])
        assert read.load() == load_of(key, dim)
        without = {name: one for name, one in tables.items() if name != "on"}
        if kind.needs_selection:
            with pytest.raises(ValueError, match="on is required"):
                form.model_validate(without)
        elif kind.on_selection:
            assert form.model_validate(without).load() == replace(load_of(key, dim), on=None)
    for name, quantity in kind.further.items():
        left = {one: value for one, value in {**on, **given}.items() if one != name}
        if quantity.default is None:
            with pytest.raises(ValueError, match=f"{name} is required"):
                form.model_validate(left).load()
        else:
            assert getattr(form.model_validate(left).load(), quantity.argument) == quantity.default
        with pytest.raises(ValueError, match=f"{name} .* force"):
            form.model_validate({"on": "top", "force": [1.0, 2.0], name: given[name]})


def test_a_load_of_the_whole_body_takes_no_selection() -> None:
    for key in (key for key, kind in ALL.items() if not kind.on_selection):
        with pytest.raises(ValueError, match="leave out on"):
            FORM.model_validate({"on": "top", **values(key, 2)})


@pytest.mark.parametrize(("key", "dim"), [(key, dim) for key in ALL for dim in (2, 3) if dim not in ALL[key].dims])
def test_a_load_of_other_dimensions_is_an_error(key: str, dim: int) -> None:
    if key in LOADS:
        with pytest.raises(ProblemError):
            problem_of(key, dim)


@cache
def solved(key: str) -> Exported:
    return solve_springs(problem_of(key, ALL[key].dims[0]), Springs("isotropic"), ts.Newton(load_steps=1))


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("key", ALL)
def test_a_target_exports_a_load_or_states_why_not(key: str, target: str) -> None:
    found = solved(key)
    (load,), springs = found.problem.loads, found.path.potential
    if load.follows and Feature.FOLLOWING not in TARGETS[target].takes:
        with pytest.raises(ExportError) as raised:
            check_targets([target], found.problem, springs)  # type: ignore[arg-type]
        assert load.instead and in_order(str(raised.value), load.words(), load.instead)
        return
    check_targets([target], found.problem, springs)  # type: ignore[arg-type]
    files = TARGETS[target].files(found)
    texts = [content for content in files.values() if isinstance(content, str)]
    listed = [" ".join(text.split()).replace("** ", "") for text in texts if "Load 1" in text]
    assert files and all(load.words() in text for text in listed)


@pytest.mark.parametrize("law", ["linear", "saint-venant-kirchhoff"])
@cases
def test_a_deck_of_finite_elements_has_the_load_or_states_why_not(key: str, dim: int, law: str) -> None:
    """As *DLOAD if the load has a keyword, else as nodal forces: a moment only under the linear law."""
    problem, level = problem_of(key, dim), 0.5
    (load,) = problem.loads
    by_keyword = load.cards(problem.mesh)
    if load.follows and not by_keyword and law != "linear":
        with pytest.raises(ExportError) as raised:
            fem_deck(problem, [level], law)
        assert load.instead and in_order(str(raised.value), load.words(), load.instead)
        return
    _, (step,) = model_and_steps(fem_deck(problem, [level], law))
    assert bool(among(step, "DLOAD")) == bool(by_keyword) and bool(among(step, "CLOAD")) == (not by_keyword)
    if not by_keyword:
        found = np.zeros(problem.mesh.nodes.shape)
        for node, axis, force in among(step, "CLOAD")[0].rows:
            found[int(node) - 1, int(axis) - 1] = 1e-6 * float(force)  # in uN
        expected = level * forces(problem, problem.mesh.nodes)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-12 * np.abs(expected).max())
