"""Models and solvers: a user's own in the place of ours, and what holds for every model of truespring."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from inspect import isclass, signature
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

import truespring as ts
import truespring.models
from tests.closed_forms import material_of
from tests.wording import in_order
from truespring.conditions import Loading
from truespring.equilibrium import check_solver
from truespring.models import Model, as_model
from truespring.models.spring_data import HasSprings
from truespring.potential import Potential
from truespring.refining import reference_error
from truespring.solvers import Equilibrium, as_solver
from truespring.study.schema.models import MODEL_KINDS

PROBLEM = ts.Problem(
    ts.rectangle((4.0, 1.0), (4, 1)),
    ts.Material(10e3, 1 / 3),
    ts.PlaneStress(0.1),
    [ts.Fixed("left")],
    [ts.Force("right", (0.0, -2.0))],
)
OURS = ts.solve(PROBLEM, ts.Springs("lloyd"))


class PlainNewton:
    """Newton's method in a few lines: whole steps, at each of two levels."""

    def follow(self, potential: Potential, loading: Loading, report: Any, geometry: Any) -> Iterator[Equilibrium]:
        positions, free = potential.nodes.copy(), ~loading.held.ravel()
        for factor in (0.0, 0.5, 1.0):
            for _ in range(30):
                applied = loading.force(positions, factor)
                force = (applied - potential.gradient(positions)).ravel()
                residual = np.linalg.norm(force[free]) / max(float(np.linalg.norm(applied)), 1e-30)
                if residual < 1e-12 or not factor:
                    break
                matrix = potential.hessian(positions).tocsc()[free][:, free]
                positions.ravel()[free] += spsolve(matrix, force[free])
            internal, energy = potential.gradient(positions), potential.energy(positions)
            yield Equilibrium(factor, positions.copy(), internal, applied, energy, 0, float(residual), True)


class Heavier:
    """A model with nothing but a potential: springs of twice the stiffness."""

    def potential(self, problem: ts.Problem) -> ts.SpringNetwork:
        springs = ts.Springs("lloyd").potential(problem)
        assert isinstance(springs, ts.SpringNetwork)
        return ts.SpringNetwork(springs.nodes, springs.springs, 2 * springs.stiffness)


def test_a_solver_of_ones_own_finds_the_same_equilibrium() -> None:
    path = ts.solve(PROBLEM, ts.Springs("lloyd"), PlainNewton())  # type: ignore[arg-type]
    assert path.complete and path.at(0.5) is not None
    assert path.states[-1].displacement == pytest.approx(OURS.states[-1].displacement, abs=1e-9)
    assert any("stability not proven" in text for text in path.warnings)  # it does not answer that


def test_what_a_solver_does_not_answer_has_a_default() -> None:
    solver = as_solver(PlainNewton())
    check_solver(PROBLEM, solver)
    assert solver.follows_load and solver.keeps_to_stable_states and solver.load_steps == 1
    assert solver.starting_at(lambda potential: potential.nodes, 5) is None


@pytest.mark.parametrize("solver", [ts.Newton(3), ts.ArcLength(4), ts.DisplacementControl("right", "y", 0.1, 5)])
def test_solvers_answer_for_themselves(solver: Any) -> None:
    assert as_solver(solver) is solver
    assert solver.load_steps == {"Newton": 3, "ArcLength": 4, "DisplacementControl": 5}[type(solver).__name__]
    assert solver.follows_load == solver.keeps_to_stable_states == isinstance(solver, ts.Newton)


@pytest.mark.parametrize("solver", [3, "newton", object()])
def test_what_is_no_solver_is_an_error(solver: Any) -> None:
    with pytest.raises(ts.TruespringError, match=r"solver.*follow\("):
        ts.solve(PROBLEM, ts.Springs("lloyd"), solver)


@pytest.mark.parametrize(
    ("follow", "named"),
    [
        (lambda self, potential, loading: iter(()), "too many positional arguments"),
        (lambda self, potential, loading, report, geometry, steps: iter(()), "'steps'"),
        (lambda self, potential, loading, *, report, geometry: iter(()), "positional"),
        (lambda self, loading, potential, report, geometry: iter(()), "'loading'"),
    ],
)
def test_follow_with_other_arguments_is_an_error_that_names_those_expected(follow: Any, named: str) -> None:
    solver = type("Mine", (), {"follow": follow})()
    with pytest.raises(ts.TruespringError) as raised:
        ts.solve(PROBLEM, ts.Springs("lloyd"), solver)
    parts = ("Mine", "follow(", named, "follow(self, potential, loading, report, geometry)")
    assert in_order(str(raised.value), *parts)
    for fitting in (lambda *arguments: iter(()), lambda p, q, r=None, s=None, more=1: iter(())):
        mine = SimpleNamespace(follow=fitting)
        assert as_solver(mine).follow is mine.follow


def test_a_class_in_the_place_of_a_solver_is_an_error() -> None:
    for kind in (PlainNewton, ts.Newton):
        with pytest.raises(ts.TruespringError, match=rf"{kind.__name__}\(\.\.\.\)"):
            as_solver(kind)


def test_a_model_of_ones_own_needs_a_potential_only() -> None:
    path = ts.solve(PROBLEM, Heavier())  # type: ignore[arg-type]
    assert (path.label, path.kind, path.moduli, path.element) == ("Heavier", "potential", None, None)
    assert path.finite and not path.has_springs
    twice = ts.Problem(
        PROBLEM.mesh, PROBLEM.material, PROBLEM.section, PROBLEM.supports, [ts.Force("right", (0, -4.0))]
    )
    assert ts.solve(twice, Heavier()).states[-1].displacement == pytest.approx(  # type: ignore[arg-type]
        OURS.states[-1].displacement, abs=1e-9
    )


def test_what_a_model_answers_is_asked_of_it() -> None:
    class Named(Heavier):
        kind, label, law = "heavier", "heavier springs", "hooke"

        def warnings(self, problem: ts.Problem) -> tuple[str, ...]:
            return (f"{problem.mesh.n_nodes} nodes",)

    path = ts.solve(PROBLEM, Named())  # type: ignore[arg-type]
    assert (path.kind, path.label, path.warnings[0]) == ("heavier", "heavier springs", "10 nodes")
    assert as_model(Named()).law == "hooke"


def test_a_model_of_ones_own_is_refined_as_ours_are() -> None:
    own = reference_error(PROBLEM, Heavier(), ts.Newton(2))  # type: ignore[arg-type]
    assert own.how == "refined" and own.value is not None and own.value > 0


def test_a_linear_theory_of_ones_own_has_loads_on_the_undeformed_body() -> None:
    class Linear:
        finite = False

        def potential(self, problem: ts.Problem) -> Any:
            return ts.Fem("linear").potential(problem)

    problem = replace(PROBLEM, supports=[ts.Fixed("left"), ts.Fixed("right")], loads=[ts.Pressure("top", 300.0)])
    path, ours = ts.solve(problem, Linear()), ts.solve(problem, ts.Fem("linear"))  # type: ignore[arg-type]
    assert np.array_equal(path.states[-1].positions, ours.states[-1].positions)
    halves = [path.states[k].displacement for k in (5, 10)]
    assert 2 * halves[0] == pytest.approx(halves[1], abs=1e-12)


@pytest.mark.parametrize(
    ("model", "finite", "law", "springs"),
    [
        (ts.Springs("lloyd"), True, None, True),
        (ts.Fem("linear"), False, "linear", False),
        (ts.Fem("hencky"), True, "hencky", False),
        (ts.MassTensor("linear"), False, "linear", False),
        (ts.Heml("saint-venant-kirchhoff"), True, "saint-venant-kirchhoff", False),
        (ts.Terzopoulos(), True, None, False),
    ],
)
def test_models_answer_for_themselves(model: Any, finite: bool, law: str | None, springs: bool) -> None:
    path = ts.solve(PROBLEM, model, ts.Newton(1))
    assert (model.finite, model.law, model.has_springs) == (finite, law, springs)
    assert (path.finite, path.has_springs, path.kind, path.label) == (finite, springs, model.kind, model.label)
    assert path.lines == ("links" if model.kind == "heml" else "springs")
    assert (path.element is not None) == (model.kind == "fem") and (path.moduli is not None) == springs


# --- What holds for every model of truespring ------------------------------------------------------------------------

LINKS: Any = ts.Springs("isotropic").potential(PROBLEM)
# Models that cannot be made without arguments, or from a law alone.
EXAMPLES: dict[str, list[Any]] = {
    "Springs": [
        *(ts.Springs("lloyd"), ts.Springs("biquadratic"), ts.Springs("isotropic", volume=True)),
        *(ts.Springs("gaussian"), ts.Springs("gaussian", element="quadratic")),
    ],
    "PrescribedSprings": [ts.PrescribedSprings(LINKS.springs, np.linspace(1e3, 2e3, len(LINKS.springs)))],
    "SpringNetwork": [LINKS],
    "BemSprings": [ts.BemSprings(ts.Box((0.0, 0.0), (2.0, 1.0)))],
}
BODIES = [PROBLEM, replace(PROBLEM, mesh=ts.rectangle((4.0, 1.0), (4, 1), "triangle"))]


def made(kind: type[Model]) -> list[Model]:
    """The examples of a class of models: by itself, or with each law that it takes."""
    if kind.__name__ in EXAMPLES:
        return EXAMPLES[kind.__name__]
    if "law" not in signature(kind).parameters:
        return [kind()]
    found = []
    for law in ts.LAWS:
        with suppress(ts.TruespringError):
            found.append(kind(law))  # type: ignore[call-arg]
    return found


KINDS = [kind for kind in vars(truespring.models).values() if isclass(kind) and issubclass(kind, Model)]
ALL = [one for kind in KINDS if kind is not Model for one in made(kind)]


def test_every_kind_of_study_has_examples() -> None:
    own = {one.kind for one in ALL} | {"network", "calculix", "stl"}  # a plain network is springs; the others are read
    assert own >= set(MODEL_KINDS) and len(ALL) > 15


@pytest.mark.parametrize("model", ALL, ids=lambda model: model.label)
def test_a_model_keeps_the_contract(model: Model) -> None:
    material = material_of(model.law if model.law in ts.LAWS else "linear", 1e4, 0.3)
    for body in BODIES:  # the first that the model takes
        problem = replace(body, material=material)
        with suppress(ts.TruespringError):
            model.check(problem)
            break
    else:
        pytest.fail("no body for this model: add one to BODIES")
    assert model.label and model.label_on(problem) and model.kind
    assert all(isinstance(text, str) for text in model.warnings(problem))
    assert model.law not in ts.LAWS or ts.LAWS[model.law].finite == model.finite  # a network has a law of springs
    assert (model.chosen_element(problem) is None) == (model.kind != "fem")
    potential = model.potential(problem)
    assert isinstance(potential, Potential)
    nodes = potential.nodes
    assert np.array_equal(nodes[: problem.mesh.n_nodes], problem.mesh.nodes)
    random = np.random.default_rng(0)
    here, along = nodes + 0.02 * random.normal(size=nodes.shape), random.normal(size=nodes.shape)
    step, size = 1e-5, float(np.abs(potential.gradient(here)).max())
    assert size > 0
    ahead, behind = here + step * along, here - step * along
    slope = (potential.energy(ahead) - potential.energy(behind)) / (2 * step)
    assert (potential.gradient(here) * along).sum() == pytest.approx(slope, abs=1e-6 * size)
    change = (potential.gradient(ahead) - potential.gradient(behind)).ravel() / (2 * step)
    hessian = potential.hessian(here)
    assert hessian @ along.ravel() == pytest.approx(change, abs=1e-6 * float(np.abs(change).max()))
    assert abs(hessian - hessian.T).max() <= 1e-9 * abs(hessian).max()
    moved = potential.energy(here + np.array([0.3, -0.2]))
    assert moved == pytest.approx(potential.energy(here), rel=1e-9)
    assert not model.has_springs or isinstance(potential, HasSprings)
