"""The cards of problems, meshes, solutions, comparisons, moduli and results: `_repr_html_` in notebooks.

Values of rooms above this one make theirs themselves, by `Card`.
"""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from truespring.comparison import Comparison
from truespring.mesh import Mesh
from truespring.models import Moduli
from truespring.problem import Problem
from truespring.report.axis import axis_of
from truespring.report.facts import problem_facts, size_words
from truespring.report.page import moduli_rows
from truespring.report.quantity import percent, quantity
from truespring.report.result import Result
from truespring.report.style import BLUE, figure_style
from truespring.report.verdict import verdict
from truespring.report.young import Known, young_figure
from truespring.showing.cards import Card, png_of_axes, png_of_sheet
from truespring.showing.meshes import plot_mesh
from truespring.showing.pairs import Pair
from truespring.showing.plotting import plot_solution
from truespring.showing.problems import undeformed_sheet
from truespring.solution import FINE, Solution

# Largest number of elements of a body that a card draws: larger ones take seconds.
_MOST_ELEMENTS = {2: 40_000, 3: 6_000}

Picture = Callable[[], bytes]


def html_of(value: Any) -> str:
    """Return a value as HTML for a notebook."""
    return card_of(value).html()


def card_of(value: Any) -> Card:
    """Return the card of a value."""
    return _CARDS[type(value)](value)


def _mesh(mesh: Mesh) -> Card:
    groups = {"elements": mesh.element_groups, "facets": mesh.facet_groups, "nodes": mesh.node_groups}
    rows = [
        ("nodes", f"{mesh.n_nodes:,}"),
        ("elements", f"{len(mesh.elements):,} ({mesh.kinds})"),
        ("size", size_words(mesh)),
        *((f"groups of {what}", ", ".join(several)) for what, several in groups.items() if several),
        *(("note", note) for note in mesh.notes),
    ]
    return Card("Mesh", rows, picture=_drawn(mesh, lambda: png_of_axes(lambda: plot_mesh(mesh, None, None))))


def _problem(problem: Problem) -> Card:
    def picture() -> bytes:
        with figure_style():
            return png_of_sheet(undeformed_sheet(problem, None))

    return Card("Problem", problem_facts(problem), picture=_drawn(problem.mesh, picture))


def _solution(solution: Solution) -> Card:
    rows = list(_solution_rows(solution))
    rows += [("warning", text) for text in solution.warnings]
    return Card(f"Solution: {solution.label}", rows, picture=_pair(solution, None))


def _solution_rows(solution: Solution) -> Iterator[tuple[str, str]]:
    fine = solution.status in FINE
    yield "status", str(solution.status) if fine else f"{solution.status}: {solution.status.advice}"
    if not solution.states:
        return
    axis = axis_of(Pair(solution).result)
    yield "reached", f"{axis.exact(solution.load_factor)}, {len(solution.states)} levels"
    last = solution.states[-1]
    yield "largest displacement", quantity(float(np.linalg.norm(last.displacement, axis=1).max()), "m")
    if last.stretch is not None:
        yield "stretch of springs", "{:.3f} to {:.3f}".format(*last.stretch)
    if solution.solved:
        cost = f"{solution.newton_iterations} Newton iterations, {solution.seconds:.2f} s"
        yield "cost", f"{solution.n_unknowns:,} unknowns, {cost}"


def _comparison(comparison: Comparison) -> Card:
    errors = (comparison.rms_error, comparison.probe_error, comparison.max_error, comparison.force_error)
    names = ("root mean square", "at the probe", "largest", "force or torque of a moved support")
    rows = [(name, percent(error)) for name, error in zip(names, errors, strict=True) if error is not None]
    up_to = comparison.agrees_up_to_load_factor
    rows += [] if up_to is None else [(f"within {percent(comparison.tolerance)} up to", f"load factor {up_to:g}")]
    rows += [("nodes outside of the other body", str(comparison.n_outside))] if comparison.n_outside else []
    title = f"Comparison: {comparison.model.label} against {comparison.reference.label}"
    return Card(title, rows, picture=_pair(*comparison.known_on))


def _moduli(moduli: Moduli) -> Card:
    def picture() -> bytes:
        with figure_style():
            return png_of_sheet(young_figure([Known("springs", moduli, BLUE, "-")], "the material"))

    columns = ("", "springs", "material")
    return Card("Effective moduli", columns=columns, table=moduli_rows(moduli), picture=picture)


def _result(result: Result) -> Card:
    found = (_result_row(result, name, path) for name, path in result.solutions.items())
    columns = ("model", "", "status", "Newton iterations", "seconds", "error")
    nearest = result.comparison
    path = next(iter(result.solutions.values()))
    picture = _pair(path, None) if nearest is None else _pair(nearest.model, nearest.reference)
    return Card(f"Result: {result.title}", (), verdict(result), columns, list(found), picture)


def _result_row(result: Result, name: str, path: Solution) -> tuple[str, ...]:
    cost = (str(path.newton_iterations), f"{path.seconds:.2f}") if path.solved else ("–", "–")
    comparison = result.comparisons.get(name)
    error = "" if comparison is None else "–" if comparison.error is None else percent(comparison.error)
    return name, path.label, str(path.status), *cost, error


def _pair(model: Solution, reference: Solution | None) -> Picture | None:
    """Return what draws a solution over a reference; None for a large body."""
    mesh = model.problem.mesh
    return _drawn(mesh, lambda: png_of_axes(lambda: plot_solution(model, reference, None, -1, None, None)))


def _drawn(mesh: Mesh, picture: Picture) -> Picture | None:
    return picture if len(mesh.elements) <= _MOST_ELEMENTS[mesh.dim] else None


#: The card of a value, by its type.
_CARDS: dict[type, Callable[[Any], Card]] = {
    Mesh: _mesh,
    Problem: _problem,
    Solution: _solution,
    Comparison: _comparison,
    Moduli: _moduli,
    Result: _result,
}
