"""Quantities that colours stand for: values of nodes, of lines or of elements."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.comparison import compare
from truespring.errors import OutputError, nearest, shown
from truespring.potential import Visible
from truespring.solution import Solution, State


@dataclass(frozen=True, eq=False)
class Paint:
    """Values that are drawn as colours.

    Attributes:
        label: name of the quantity.
        unit: its SI unit.
        on: what has the values.
        values: shape (n_nodes,), (n_lines,) or (n_elements,); NaN where the quantity is not known.
        lines: node numbers of the lines, shape (n_lines, 2); of values on lines only.
        middle: the value of the middle colour, if larger and smaller values are of different kinds.
        colors: name of a colour map of matplotlib, or "distance", the colours of reports.
    """

    label: str
    unit: str
    on: Literal["nodes", "lines", "elements"]
    values: Floats
    lines: Ints = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    middle: float | None = None
    colors: str = "viridis"


def paint_of(color: str, solution: Solution, state: State, over: Solution | None) -> Paint:
    """Return the values of a quantity, a key of COLORS.

    Raises OutputError if the name is unknown or the solution does not have the quantity.
    """
    if color not in COLORS:
        allowed = ", ".join(COLORS)
        raise OutputError(f"color = {shown(color)} is unknown{nearest(str(color), COLORS)}; allowed: {allowed}")
    return COLORS[color](solution, state, over)


def _displacement(solution: Solution, state: State, over: Solution | None) -> Paint:
    return Paint("displacement", "m", "nodes", np.linalg.norm(state.displacement, axis=1))


def _distance(solution: Solution, state: State, over: Solution | None) -> Paint:
    """Distance of the nodes from a reference."""
    if over is None:
        raise OutputError("color = 'distance' needs a reference: plot(over=reference, color='distance')")
    comparison = compare(solution, over)
    mine, theirs = comparison.model.at(state.level), comparison.reference.at(state.level)
    if mine is None or theirs is None or len(mine.displacement) != solution.problem.mesh.n_nodes:
        raise OutputError(f"the distance from {over.label} is not known at the nodes of {solution.label}")
    apart = np.linalg.norm(mine.displacement - theirs.displacement, axis=1)
    apart[comparison.outside] = np.nan
    return Paint("distance", "m", "nodes", apart, colors="distance")


def _stretch(solution: Solution, state: State, over: Solution | None) -> Paint:
    """Stretch of the springs; without springs that of the edges of elements."""
    lines, fields = _line_fields(solution, state)
    if "stretch" in fields:
        return Paint("stretch of springs", "-", "lines", fields["stretch"], lines, 1.0, "coolwarm")
    if solution.is_cloud:
        raise OutputError(f"color = 'stretch': {solution.label} has points only, no springs or elements")
    mesh = solution.problem.mesh
    rest, now = (np.linalg.norm(at[mesh.edges[:, 1]] - at[mesh.edges[:, 0]], axis=1) for at in _both(solution, state))
    return Paint("stretch of edges", "-", "lines", now / rest, mesh.edges, 1.0, "coolwarm")


def _both(solution: Solution, state: State) -> tuple[Floats, Floats]:
    return solution.problem.mesh.nodes, state.positions


def _tension(solution: Solution, state: State, over: Solution | None) -> Paint:
    """Tension of springs; of Gaussian springs its change."""
    lines, fields = _line_fields(solution, state)
    for name, label in (("tension", "tension of springs"), ("tension_change", "change of tension of springs")):
        if name in fields:
            return Paint(label, "N", "lines", fields[name], lines, 0.0, "coolwarm")
    raise OutputError(f"color = 'tension': {solution.label} has no springs; use stress, stretch or displacement")


def _stress(solution: Solution, state: State, over: Solution | None) -> Paint:
    """Von Mises stress of the elements: sqrt(3/2 s : s), s the deviator of the true stress."""
    fields = _element_fields(solution, state)
    if "stress" not in fields:
        has = "springs have a tension" if solution.has_springs else "results that were read have no stress"
        raise OutputError(f"color = 'stress': {solution.label} has no stress ({has}); use tension, stretch or distance")
    stress = fields["stress"].reshape(-1, 3, 3)
    deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    return Paint("von Mises stress", "Pa", "elements", np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2))))


def _line_fields(solution: Solution, state: State) -> tuple[Ints, dict[str, Floats]]:
    """Return the lines of a potential and their fields that are known."""
    potential = solution.potential
    none = np.zeros((0, 2), dtype=np.int64)
    if not isinstance(potential, Visible) or "line" not in potential.cells:
        return none, {}
    first, n_lines = 0, 0
    for kind, cells in potential.cells.items():
        if kind == "line":
            n_lines = len(cells)
            break
        first += len(cells)
    fields = {
        name: values[first : first + n_lines] for name, values in potential.cell_fields(state.all_positions).items()
    }
    known = {name: values for name, values in fields.items() if not np.isnan(values).all()}
    return potential.cells["line"], known


def _element_fields(solution: Solution, state: State) -> dict[str, Floats]:
    """Return the fields of the elements of a potential, in the order of the elements of the mesh."""
    potential, mesh = solution.potential, solution.problem.mesh
    if not isinstance(potential, Visible):
        return {}
    of_elements = np.concatenate([np.full(len(cells), kind != "line") for kind, cells in potential.cells.items()])
    if of_elements.sum() != len(mesh.elements):
        return {}
    order = np.concatenate([numbers for numbers, _ in mesh.blocks])
    found = {}
    for name, values in potential.cell_fields(state.all_positions).items():
        own = np.empty((len(mesh.elements), *values.shape[1:]))
        own[order] = values[of_elements]
        if not np.isnan(own).all():
            found[name] = own
    return found


#: Quantities that colours may stand for, by the value of `color`.
COLORS: dict[str, Callable[[Solution, State, Solution | None], Paint]] = {
    "distance": _distance,
    "displacement": _displacement,
    "stretch": _stretch,
    "stress": _stress,
    "tension": _tension,
}
