"""Quantities that colours stand for: values of nodes, of lines or of elements."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.errors import OutputError, nearest, shown
from truespring.potential import Visible
from truespring.report.nodal import in_order, node_fields, von_mises
from truespring.showing.pairs import Pair
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
        span: values of the first and the last colour; by default as `limits`.
    """

    label: str
    unit: str
    on: Literal["nodes", "lines", "elements"]
    values: Floats
    lines: Ints = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    middle: float | None = None
    colors: str = "viridis"
    span: tuple[float, float] | None = None

    def at_nodes(self, n_nodes: int) -> "Paint":
        """Return values of lines as means at the nodes that they join; other values unchanged."""
        if self.on != "lines":
            return self
        ends, values = self.lines.ravel(), np.repeat(self.values, 2)
        count = np.bincount(ends, minlength=n_nodes)
        with np.errstate(invalid="ignore"):  # NaN where no line ends
            means = np.bincount(ends, values, n_nodes) / count
        return replace(self, label=f"{self.label}, mean at nodes", on="nodes", values=means, lines=self.lines[:0])

    @property
    def limits(self) -> tuple[float, float]:
        """The values of the first and the last colour: from zero, or as far to both sides of the middle."""
        if self.span is not None:
            return self.span
        known = self.values[np.isfinite(self.values)]
        if self.middle is None:
            return 0.0, float(known.max(initial=0.0)) or 1.0
        far = float(np.abs(known - self.middle).max(initial=0.0)) or 1.0
        return self.middle - far, self.middle + far


def paint_of(color: str, pair: Pair, state: State) -> Paint:
    """Return the values of a quantity, a key of COLORS, at a state.

    Raises OutputError if the name is unknown or the solution does not have the quantity.
    """
    if not isinstance(color, str) or color not in COLORS:
        allowed = ", ".join(COLORS)
        raise OutputError(f"color = {shown(color)} is unknown{nearest(str(color), COLORS)}; allowed: {allowed}")
    paint = COLORS[color](pair, state)
    if paint is None:
        others = [name for name in COLORS if (pair.over or name != "distance") and COLORS[name](pair, state)]
        raise OutputError(f"color = '{color}': {pair.solution.label} has no {color}; it has {', '.join(others)}")
    return paint


def _displacement(pair: Pair, state: State) -> Paint:
    return Paint("displacement", "m", "nodes", np.linalg.norm(state.displacement, axis=1))


def _distance(pair: Pair, state: State) -> Paint:
    """Distance of the nodes from a reference."""
    solution, over, comparison = pair.solution, pair.over, pair.comparison
    if over is None or comparison is None:
        raise OutputError("color = 'distance' needs a reference: plot(over=reference, color='distance')")
    mine, theirs = comparison.model.at(state.level), comparison.reference.at(state.level)
    if mine is None or theirs is None or len(mine.displacement) != solution.problem.mesh.n_nodes:
        raise OutputError(f"the distance from {over.label} is not known at the nodes of {solution.label}")
    apart = np.linalg.norm(mine.displacement - theirs.displacement, axis=1)
    apart[comparison.outside] = np.nan
    return Paint("distance", "m", "nodes", apart, colors="distance")


def _stretch(pair: Pair, state: State) -> Paint | None:
    """Stretch of the springs; without springs that of the edges of elements."""
    solution = pair.solution
    lines, fields = _line_fields(solution, state)
    if "stretch" in fields:
        return Paint("stretch of springs", "-", "lines", fields["stretch"], lines, 1.0, "coolwarm")
    if solution.is_cloud:
        return None
    mesh = solution.problem.mesh
    rest, now = (np.linalg.norm(at[mesh.edges[:, 1]] - at[mesh.edges[:, 0]], axis=1) for at in _both(solution, state))
    return Paint("stretch of edges", "-", "lines", now / rest, mesh.edges, 1.0, "coolwarm")


def _both(solution: Solution, state: State) -> tuple[Floats, Floats]:
    return solution.problem.mesh.nodes, state.positions


def _tension(pair: Pair, state: State) -> Paint | None:
    """Tension of springs; of Gaussian springs its change."""
    solution = pair.solution
    lines, fields = _line_fields(solution, state)
    for name, label in (("tension", "tension of springs"), ("tension_change", "change of tension of springs")):
        if name in fields:
            return Paint(label, "N", "lines", fields[name], lines, 0.0, "coolwarm")
    return None


def _stress(pair: Pair, state: State) -> Paint | None:
    """Von Mises stress of the elements, of their true stress; where springs alone carry it, of their virial stress."""
    solution = pair.solution
    fields = _element_fields(solution, state)
    if "stress" in fields:
        return Paint("von Mises stress", "Pa", "elements", von_mises(fields["stress"].reshape(-1, 3, 3)))
    at_nodes = node_fields(solution, state)
    if "stress" not in at_nodes:
        return None
    return Paint("von Mises stress of springs, mean at nodes", "Pa", "nodes", at_nodes["stress"])


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
    found = {}
    for name, values in potential.cell_fields(state.all_positions).items():
        own = in_order(mesh, values[of_elements])
        if not np.isnan(own).all():
            found[name] = own
    return found


#: Quantities that colours may stand for, by the value of `color`.
COLORS: dict[str, Callable[[Pair, State], Paint | None]] = {
    "distance": _distance,
    "displacement": _displacement,
    "stretch": _stretch,
    "stress": _stress,
    "tension": _tension,
}
