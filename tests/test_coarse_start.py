"""Starts from coarser meshes: the same states as without them, the fine mesh's branch, and no failure of their own."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.studies import changed, written
from tests.test_load_contract import CASES, problem_of
from truespring.models import LAWS, Model
from truespring.models.rules import RULES
from truespring.potential import Potential, Stressed
from truespring.problem import Problem
from truespring.solvers import coarse
from truespring.study import read_study

SHARP = {"load_steps": 1, "tolerance": 1e-12}
LEFT, PUSH = ts.Fixed(on="left"), ts.Force(on="right", total=(0.0, -0.3))


@pytest.fixture(autouse=True)
def any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small meshes start from coarser ones, too."""
    monkeypatch.setattr(coarse, "_WORTH", {2: 0, 3: 0})
    monkeypatch.setattr(coarse, "_COARSEST", {2: 30, 3: 100})
    monkeypatch.setattr(coarse, "_MUCH_COARSER", 2)


def both(problem: Problem, model: object, **options: object) -> tuple[ts.Solution, ts.Solution]:
    """The solutions with a coarse start and without, which must be the same."""
    options = SHARP | options
    started, plain = (ts.solve(problem, model, ts.Newton(coarse_start=one, **options)) for one in (True, False))
    assert started.status == plain.status and not plain.cost.coarse
    for mine, other in zip(started.states, plain.states, strict=True):
        assert mine.level == other.level and mine.branched == other.branched
        assert mine.negative_eigenvalues == other.negative_eigenvalues
        assert mine.positions == pytest.approx(other.positions, abs=1e-9 * problem.mesh.diameter)
    return started, plain


def plate(material: ts.Material, element: str = "quadrilateral", counts: tuple[int, int] = (14, 12)) -> Problem:
    mesh = ts.rectangle((0.1 * counts[0], 0.1 * counts[1]), counts, element)
    return Problem(mesh, material, ts.PlaneStress(1.0), [LEFT], [PUSH])


def block(material: ts.Material, element: str = "hexahedron") -> Problem:
    mesh = ts.box((0.6, 0.6, 0.6), (6, 6, 6), element)
    return Problem(mesh, material, None, [LEFT], [ts.Force(on="right", total=(0.0, -0.1, 0.05))])


@pytest.mark.parametrize("rule", RULES)
def test_springs_of_every_rule(rule: str) -> None:
    plane = [one for one in ("quadrilateral", "triangle") if one in RULES[rule].elements]
    poisson = {"quadrilateral": 1 / 3, "hexahedron": 1 / 4}
    material = ts.Material(30.0, poisson["quadrilateral" if plane else "hexahedron"])
    problem = plate(material, plane[0]) if plane else block(material, RULES[rule].elements[0])
    model = ts.Springs(rule, allow_negative=True)
    started, plain = both(problem, model)
    assert bool(started.cost.coarse) == isinstance(started.potential, Stressed)
    if started.cost.coarse:
        assert started.cost.notes == ("started from solutions on 56 nodes",)
        assert started.cost.newton_iterations < plain.cost.newton_iterations


@pytest.mark.parametrize("law", [name for name, entry in LAWS.items() if entry.finite])
def test_finite_elements_of_every_law(law: str) -> None:
    entry = LAWS[law]
    constants = {name: 10 * one.example if one.dimension else one.example for name, one in entry.constants.items()}
    material = ts.Material(30.0, 0.3, constants=constants)
    if entry.lame is not None:
        lam, mu = entry.lame(constants)
        material = ts.Material.from_moduli(mu, lam + 2 / 3 * mu, constants=constants)
    started, plain = both(plate(material), ts.Fem(law))
    assert started.cost.coarse
    assert started.cost.newton_iterations < plain.cost.newton_iterations


@pytest.mark.parametrize(("key", "dim"), CASES)
def test_every_load(key: str, dim: int) -> None:
    mesh = ts.rectangle((3.0, 2.0), (12, 10)) if dim == 2 else ts.box((3.0, 2.0, 4.0), (6, 5, 6))
    mesh = replace(mesh, element_groups={"top": np.flatnonzero(mesh.centres[:, 1] > 1.0)})
    problem = problem_of(key, dim, mesh, 100.0)
    started, _ = both(problem, ts.Springs("gaussian"))
    assert started.cost.coarse and "started" in started.cost.notes[0]


SUPPORTS = {
    "moved": [LEFT, ts.Fixed(on="right", displacement=(0.3, 0.1))],
    "turned": [LEFT, ts.Fixed(on="right", rotation=0.3)],
    "sliding": [ts.Fixed(on="left", fix=["x"]), ts.Fixed(on="bottom", fix=["y"])],
    "a point": [ts.Fixed(on=np.array([6 * 15, 7 * 15, 8 * 15])), ts.Fixed(on="top", fix=["x"])],
}


@pytest.mark.parametrize("supports", SUPPORTS)
@pytest.mark.parametrize("counts", [(14, 12), (13, 11)])
def test_supports(supports: str, counts: tuple[int, int]) -> None:
    load = ts.Traction(on="right", traction=(2.0, 0.1))
    problem = replace(plate(ts.Material(30.0, 0.3), counts=counts), supports=SUPPORTS[supports], loads=[load])
    started, _ = both(problem, ts.Springs("gaussian"))
    assert started.cost.coarse


def test_regions_and_steps() -> None:
    whole = ts.box((0.8, 0.7, 0.6), (8, 7, 6))
    cells = whole.elements[~((whole.centres[:, 0] > 0.45) & (whole.centres[:, 1] > 0.55))]
    used, elements = np.unique(cells, return_inverse=True)
    mesh = ts.Mesh(whole.nodes[used], elements.reshape(cells.shape), "hexahedron")
    stiff = ts.Region(on=ts.Box((0.0, 0.0, 0.0), (0.25, 0.8, 0.8)), material=ts.Material(90.0, 0.3))
    problem = Problem(mesh, ts.Material(30.0, 0.3), None, [LEFT], [ts.Force("right", (0.0, -0.3, 0.0))], [stiff])
    assert both(problem, ts.Springs("gaussian"))[0].cost.coarse


@pytest.mark.parametrize("deep", [6, 7])
@pytest.mark.parametrize("share", [0.8, 1.5])
def test_a_column_buckles_as_without_coarse_meshes(deep: int, share: float) -> None:
    """Coarse meshes of an odd number of cells are not symmetric: they would bend below the critical load."""
    mesh = ts.rectangle((4.0, 0.1 * deep), (40, deep))
    critical = np.pi**2 / 4 * 30.0 * (0.1 * deep) ** 3 / 12 / 16
    problem = Problem(
        mesh, ts.Material(30.0, 0.3), ts.PlaneStress(1.0), [LEFT], [ts.Force("right", (-share * critical, 0.0))]
    )
    started, plain = both(problem, ts.Fem("neo-hookean"))
    assert plain.states[-1].branched == (share > 1)
    assert share < 1 or started.cost.notes[0].startswith("not started")


def test_a_path_that_turns_sharply_is_not_simple() -> None:
    """A column pushed aside a little bends suddenly near the critical load, by one branch on every mesh."""
    mesh = ts.rectangle((4.0, 0.8), (40, 8))
    critical = np.pi**2 / 4 * 30.0 * 0.8**3 / 12 / 16
    push = ts.Force("right", (-1.2 * critical, 0.1 * critical))
    problem = Problem(mesh, ts.Material(30.0, 0.3), ts.PlaneStress(1.0), [LEFT], [push])
    started, _ = both(problem, ts.Fem("neo-hookean"))
    assert started.cost.notes[0].endswith("the path on a coarser mesh is not simple")


@dataclass(frozen=True)
class Softer(Model):
    """Gaussian springs, on other meshes than the body's of a share of its stiffness."""

    mesh: ts.Mesh
    share: float

    def potential(self, problem: Problem) -> Potential:
        assert problem.material is not None
        soft = replace(problem.material, young=self.share * problem.material.young)
        return ts.Springs("gaussian").potential(
            problem if problem.mesh is self.mesh else replace(problem, material=soft, regions=())
        )


@pytest.mark.parametrize("share", [0.9, 0.5])
def test_a_state_far_from_its_start_is_not_taken(share: float) -> None:
    problem = plate(ts.Material(30.0, 0.3))
    started, _ = both(problem, Softer(problem.mesh, share))
    (note,) = started.cost.notes
    assert note.startswith("started") if share > 0.8 else note.endswith("led to a distant state")


@dataclass(frozen=True)
class SofterBelow(Model):
    """Gaussian springs, of half the stiffness on meshes with few nodes."""

    n_nodes: int

    def potential(self, problem: Problem) -> Potential:
        assert problem.material is not None
        soft = replace(problem.material, young=0.5 * problem.material.young)
        few = problem.mesh.n_nodes < self.n_nodes
        return ts.Springs("gaussian").potential(replace(problem, material=soft, regions=()) if few else problem)


def test_a_mesh_that_is_too_coarse_is_replaced_by_the_next_one() -> None:
    """States on 49 nodes are far from those on 16: the path is followed on 49 nodes in small steps."""
    problem = plate(ts.Material(30.0, 0.3), counts=(24, 24))
    started, _ = both(problem, SofterBelow(40))
    assert [one.notes for one in started.cost.coarse] == [
        (),
        ("not started from a coarser mesh from load factor 1 on: a start from a coarser mesh led to a distant state",),
        ("started from solutions on 49 nodes",),
    ]
    assert started.cost.notes == ("started from solutions on 169 nodes",)
    # not on meshes that are nearly as large as the finest one
    assert both(problem, SofterBelow(500))[0].cost.notes[0].endswith("led to a distant state")
    assert both(problem, SofterBelow(100))[0].cost.notes[0].startswith("started")


class OnItsOwnMesh(Model):
    """Gaussian springs that fail on other meshes."""

    def __init__(self, mesh: ts.Mesh, failure: BaseException | None) -> None:
        self.mesh, self.failure = mesh, failure

    def potential(self, problem: Problem) -> Potential:
        if problem.mesh is not self.mesh and self.failure is not None:
            raise self.failure
        return ts.Springs("gaussian").potential(problem)


@pytest.mark.parametrize("failure", [None, KeyError("no such mesh"), MemoryError(), ts.TruespringError("no")])
def test_a_failure_on_a_coarse_mesh_is_none_of_the_fine_one(failure: BaseException | None) -> None:
    problem = plate(ts.Material(30.0, 0.3))
    started, _ = both(problem, OnItsOwnMesh(problem.mesh, failure))
    assert bool(started.cost.coarse) == (failure is None)
    (note,) = started.cost.notes
    assert note.startswith("started" if failure is None else f"a coarser mesh failed: {type(failure).__name__}")


def test_a_reporter_sees_the_fine_mesh_alone() -> None:
    """Its exceptions are not to be taken for failures of a coarse mesh."""
    levels: set[float] = set()
    problem = plate(ts.Material(30.0, 0.3), counts=(24, 24))
    path = ts.solve(
        problem,
        ts.Springs("gaussian"),
        ts.Newton(load_steps=1),
        progress=lambda load_factor, iteration, residual: levels.add(load_factor),
    )
    assert path.cost is not None and path.cost.coarse
    assert levels <= {0.0, 1.0}


def test_where_it_is_not_used() -> None:
    problem = plate(ts.Material(30.0, 0.3))
    for model, options in (
        (ts.Fem("linear"), {}),
        (ts.Springs("gaussian").potential(problem), {}),
        (ts.Springs("gaussian"), {"method": "line-search"}),
        (ts.Springs("gaussian"), {"load_steps": 10}),
    ):
        assert not both(problem, model, **options)[0].cost.coarse
    bent = replace(problem.mesh, nodes=problem.mesh.nodes + 1e-2 * problem.mesh.nodes**2)
    assert not both(replace(problem, mesh=bent), ts.Springs("gaussian"))[0].cost.coarse


@pytest.mark.parametrize("text", ["true", "false"])
def test_the_key_of_a_study_file(text: str, tmp_path: Path) -> None:
    study = read_study(written(tmp_path, changed(("load_steps = 2", f"load_steps = 2\ncoarse_start = {text}"))))
    assert study.solver == ts.Newton(load_steps=2, coarse_start=text == "true")


def test_costs_of_coarse_meshes_are_stated() -> None:
    path = ts.solve(plate(ts.Material(30.0, 0.3), counts=(24, 24)), ts.Springs("gaussian"), ts.Newton(load_steps=1))
    assert [one.notes for one in (*path.cost.coarse, path.cost)] == [
        (),
        ("started from solutions on 16 nodes",),
        ("started from solutions on 49 nodes",),
        ("started from solutions on 169 nodes",),
    ]
    assert all(one.newton_iterations > 0 for one in path.cost.coarse)
