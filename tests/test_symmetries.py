"""What no result may depend on: the place and the side of a body, its size, numbers of nodes, units, threads, the run.

Every model of the tables on every element, as tests/test_potentials.py has them, solved at a large displacement.
"""

import itertools
import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import truespring as ts
from tests.studies import changed, written
from tests.test_potentials import CASES, SOLVED, turn
from truespring.arrays import Floats, Ints
from truespring.cli import main
from truespring.conditions import Refined
from truespring.equilibrium import Solution, Status
from truespring.kernels.threads import set_threads
from truespring.mesh.merged import mirrored
from truespring.models import LAWS, RULES, Model

NEWTON = ts.Newton(load_steps=2, tolerance=1e-13)


@dataclass(frozen=True)
class Change:
    """A problem seen otherwise.

    Attributes:
        matrix: where each direction goes, shape (dim, dim): a turn, a mirror image, and a factor of all lengths.
        nodes, elements: the old number of each new node and element.
    """

    matrix: Floats
    nodes: Ints
    elements: Ints

    @property
    def scale(self) -> float:
        """The factor of all lengths."""
        return float(abs(np.linalg.det(self.matrix)) ** (1 / len(self.matrix)))

    def problem(self, problem: ts.Problem) -> ts.Problem:
        """The same body and loads: of stresses that stay, forces grow with the square of lengths."""
        mesh = problem.mesh
        new_number = np.argsort(self.nodes)
        elements = new_number[mesh.elements[self.elements]]
        if np.linalg.det(self.matrix) < 0:
            elements = mirrored(elements, mesh.element, np.ones(len(elements), dtype=bool))
        section = problem.section
        if isinstance(section, ts.PlaneStress | ts.PlaneStrain):
            section = replace(section, thickness=self.scale * section.thickness)
        return replace(
            problem,
            mesh=ts.Mesh(mesh.nodes[self.nodes] @ self.matrix.T, elements, mesh.element),
            section=section,
            supports=[replace(one, on=new_number[one.on]) for one in problem.supports],
            loads=[
                ts.Force(new_number[one.on], (self.scale * (self.matrix @ np.array(one.total))).tolist())
                for one in problem.loads
            ],
            regions=[replace(one, on=self.placed(one.on)) for one in problem.regions],
        )

    def placed(self, elements: object) -> list[int]:
        """The new numbers of elements."""
        return np.argsort(self.elements)[np.array(elements)].tolist()

    def model(self, model: Model) -> Model:
        """The same model: a block is named by the numbers of its elements."""
        return replace(model, block=self.placed(model.block)) if isinstance(model, ts.BemSprings) else model


def loaded(name: str) -> ts.Problem:
    """A problem of the table with a load that every one of its models bears, of some tens of per cent of strain."""
    problem = CASES[name].problem
    assert problem is not None
    return replace(problem, loads=[ts.Force(one.on, (0.5 * np.array(one.total)).tolist()) for one in problem.loads])


@cache
def solved(name: str) -> Solution:
    path = ts.solve(loaded(name), CASES[name].model, NEWTON)
    assert path.status is Status.CONVERGED, path.warnings
    return path


def mirror(dim: int) -> Floats:
    return np.diag([-1.0] + [1.0] * (dim - 1))


def quarter(dim: int) -> Floats:
    """A turn that leaves axes on axes."""
    return np.roll(np.eye(dim), 1, axis=0) @ (np.diag([1.0, -1.0]) if dim == 2 else np.eye(3))


LOOKS: dict[str, Callable[[int], Floats]] = {
    "mirrored": mirror,
    "turned by a right angle": quarter,
    "turned": lambda dim: turn(dim, 0.4),
    "a thousand times as large": lambda dim: 1e3 * np.eye(dim),
    "a thousandth as large": lambda dim: 1e-3 * np.eye(dim),
    "numbered otherwise": np.eye,
    "all at once": lambda dim: 0.037 * turn(dim, -1.1) @ mirror(dim),
}
# A shear has its place at the first corner of a face: a mirror image, or another turn, is another model.
ON_AXES = [name for name in SOLVED if name.startswith("terzopoulos")]


def _one_of_each() -> tuple[str, ...]:
    """A case of every rule, law and method, on one element or another."""
    groups: dict[str, list[str]] = {}
    for name in SOLVED:
        groups.setdefault(name.partition(",")[0], []).append(name)
    return tuple(names[place % len(names)] for place, names in enumerate(groups.values()))


QUICK = _one_of_each()


def looked_at(name: str, look: str, seed: int) -> None:
    """Solve a problem seen otherwise, and compare."""
    problem, path = loaded(name), solved(name)
    generator = np.random.default_rng(seed)
    dim, counts = problem.mesh.dim, (problem.mesh.n_nodes, len(problem.mesh.elements))
    shuffled = look in ("numbered otherwise", "all at once")
    order = [generator.permutation(count) if shuffled else np.arange(count) for count in counts]
    matrix = LOOKS[look](dim)
    if name in ON_AXES and shuffled:
        matrix = 0.037 * np.roll(np.eye(dim), 1, axis=0)  # x to y, y to x, or to z and z to x
    change = Change(matrix, *order)
    other = ts.solve(change.problem(problem), change.model(CASES[name].model), NEWTON)
    assert other.status is Status.CONVERGED, other.warnings
    assert path.load_factors.tolist() == other.load_factors.tolist()
    for one, two in zip(path.states[1:], other.states[1:], strict=True):  # at rest nothing acts
        size = float(np.abs(one.displacement).max())
        moved = two.displacement @ np.linalg.inv(change.matrix).T
        assert np.abs(moved - one.displacement[change.nodes]).max() <= 1e-9 * size
        assert two.energy == pytest.approx(one.energy * change.scale**3, rel=1e-9)
        reaction = two.reaction @ np.linalg.inv(change.matrix).T / change.scale
        assert np.abs(reaction - one.reaction[change.nodes]).max() <= 1e-9 * np.abs(one.reaction).max()


def test_quick_cases_have_every_rule_and_law() -> None:
    heads = {name.partition(",")[0] for name in QUICK}
    assert {*RULES, *LAWS} <= heads and len(heads) == len(QUICK) >= 18


@pytest.mark.parametrize("name", QUICK)
def test_results_do_not_depend_on_how_a_body_is_seen(name: str) -> None:
    looked_at(name, "all at once", 17)


@pytest.mark.verification
@pytest.mark.parametrize(
    ("name", "look"),
    [
        (name, look)
        for name, look in itertools.product(SOLVED, LOOKS)
        if not (name in ON_AXES and look in ("mirrored", "turned by a right angle", "turned"))
    ],
)
def test_results_do_not_depend_on_any_look(name: str, look: str) -> None:
    looked_at(name, look, 18)


def dead_load(path: Solution) -> Floats:
    """The forces on all nodes of what was solved [N]: mid-side nodes of quadratic elements have a share."""
    loading = path.potential.loading if isinstance(path.potential, Refined) else path.problem.loading
    assert loading.external_force.any() and not loading.following
    return loading.external_force.copy()


@pytest.mark.parametrize("name", QUICK)
def test_forces_and_moments_are_in_balance(name: str) -> None:
    """Reactions against loads; moments about the body as it is, of a linear one about the body at rest."""
    problem, path = loaded(name), solved(name)
    state, n_nodes = path.states[-1], problem.mesh.n_nodes
    force, arms = dead_load(path), state.all_positions
    if CASES[name].quadratic:
        arms = path.potential.nodes
    force[:n_nodes] += state.reaction
    moment = np.einsum("ni,nj->ij", arms, force)
    scale = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() <= 1e-9 * scale
    if not CASES[name].infinitesimal:  # of which one part turns about where it is, the other about where it was
        assert np.abs(moment - moment.T).max() <= 1e-9 * scale * problem.mesh.diameter


@pytest.mark.verification
@pytest.mark.parametrize("name", SOLVED)
def test_stored_energy_is_the_work_of_the_load(name: str) -> None:
    """Exactly half of load times displacement of a quadratic energy; else Simpson's rule over the load levels."""
    problem = loaded(name)

    def error(steps: int) -> float:
        path = ts.solve(problem, CASES[name].model, replace(NEWTON, load_steps=steps))
        moved = [state.all_positions - path.potential.nodes for state in path.states]
        ends = np.array([float((dead_load(path) * one).sum()) for one in moved])
        assert path.status is Status.CONVERGED and len(ends) == steps + 1
        weights = np.array([1, *[4, 2] * (steps // 2 - 1), 4, 1]) / (3 * steps)
        # The work of a load that grows: integral of s f . du = f . u - integral of f . u ds.
        return abs(ends[-1] - float(weights @ ends) - path.states[-1].energy) / path.states[-1].energy

    if CASES[name].quadratic:
        assert error(2) < 1e-10
        return
    first, second = error(2), error(4)
    assert second < 1e-3
    assert second < first / 6 or second < 1e-6  # of fourth order; less shows on coarse steps


def test_units_do_not_matter(tmp_path: Path) -> None:
    """A study in millimetres and kilopascals is that in metres and pascals."""
    inch = 0.0254
    plain = changed(
        ('size = ["40 mm", "10 mm"]', f"size = [{4 * inch}, {inch}]"),
        ('young = "10 kPa"', f"young = {10e3!r}"),
        ('thickness = "10 mm"', f"thickness = {inch!r}"),
        ('"-0.01 N"', "-0.01"),
        ('law = "linear"', 'law = "hencky"'),
    )
    units = changed(
        ('size = ["40 mm", "10 mm"]', 'size = ["4 in", "2.54 cm"]'),
        ('young = "10 kPa"', 'young = "0.01 N/mm^2"'),
        ('thickness = "10 mm"', 'thickness = "25.4 mm"'),
        ('"-0.01 N"', '"-1000 dyn"'),
        ('law = "linear"', 'law = "hencky"'),
    )
    found = []
    for name, text in (("plain", plain), ("units", units)):
        assert main(["solve", str(written(tmp_path, text, f"{name}.toml")), "--out", str(tmp_path), "--quiet"]) == 0
        rows = (tmp_path / name / "curves.csv").read_text().splitlines()[1:]
        found.append(np.array([[float(part) for part in row.split(",")[1:]] for row in rows]))
    assert found[0].shape == (6, 5)
    assert np.abs(found[0] - found[1]).max() <= 1e-10 * np.abs(found[0]).max()


def results(folder: Path) -> dict[str, bytes | dict[str, object]]:
    """All files that a run has written, the summary without what the clock tells."""
    files: dict[str, bytes | dict[str, object]] = {
        file.relative_to(folder).as_posix(): file.read_bytes() for file in sorted(folder.rglob("*")) if file.is_file()
    }
    summary = json.loads((folder / "summary.json").read_text())
    for model in summary["models"].values():
        assert model.pop("seconds") > 0
    return files | {"summary.json": summary}


def test_two_runs_write_the_same_bytes(tmp_path: Path) -> None:
    study = str(written(tmp_path, changed(('law = "linear"', 'law = "neo-hookean"'))))
    for out in ("one", "two"):
        assert main(["solve", study, "--out", str(tmp_path / out), "--quiet"]) == 0
    first, second = (results(tmp_path / out / "study") for out in ("one", "two"))
    assert {"curves.csv", "summary.json", "springs.pvd", "linear/linear_0002.vtu", "deformed_linear.stl"} <= set(first)
    assert first == second


def test_one_thread_and_two_agree_to_rounding() -> None:
    """Of a body whose loops are shared: elements and nodes enough for two threads."""
    problem = ts.Problem(
        mesh=ts.rectangle((0.16, 0.04), (80, 20)),
        material=ts.Material(10e3, 0.3),
        section=ts.PlaneStress(0.01),
        supports=[ts.Fixed("left")],
        loads=[ts.Force("right", (0.0, -0.02))],
    )
    found = []
    for model in (ts.Springs("isotropic"), ts.Fem("neo-hookean")):
        for count in (1, 2):
            set_threads(count)
            try:
                found.append(ts.solve(problem, model, ts.Newton(load_steps=1, tolerance=1e-12)).states[-1].displacement)
            finally:
                set_threads(None)
    for one, two in ((found[0], found[1]), (found[2], found[3])):
        assert np.abs(one - two).max() <= 1e-10 * np.abs(one).max()
