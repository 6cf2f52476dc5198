"""Data of the interactive 3D view beyond those of the 2D view: surface, inner springs, distances as colours."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from truespring.arrays import Ints
from truespring.equilibrium import Solution, State
from truespring.mesh import Mesh
from truespring.mesh.facets import triangles_of
from truespring.report.bodies import path_lines
from truespring.report.packing import Packing
from truespring.report.quantity import ROUNDING, quantity
from truespring.report.result import Result
from truespring.report.style import error_colors
from truespring.report.surfaces import edges_of, facets_of, lines_on, outline
from truespring.report.undeformed import spring_lines

# With more springs than this, only those on the surface are drawn.
_MOST_SPRINGS = 20_000


def scene_nodes(result: Result, shown: Sequence[str]) -> Ints:
    """Return the nodes that a view of the paths `shown` draws, ascending, shape (n,): surface, lines, probe."""
    kept = np.zeros(result.problem.mesh.n_nodes, dtype=bool)
    kept[facets_of(result.problem.mesh)] = True
    kept[result.probe] = True
    for name in shown:
        for lines in _lines(result.paths[name]):
            kept[lines] = True
    return np.flatnonzero(kept)


def _lines(path: Solution) -> tuple[Ints, Ints]:
    """Return the lines of a path on its surface and inside, shape (n, 2); of a body without surface, all and none."""
    facets, lines = facets_of(path.problem.mesh), path_lines(path)
    none = np.zeros((0, 2), dtype=np.int64)
    if not len(facets):
        return lines, none
    if spring_lines(path.potential) is None:
        return edges_of(facets), none
    on, _ = lines_on(facets, lines)
    return lines[on], lines[~on] if len(lines) < _MOST_SPRINGS else none


def surface_in_scene(mesh: Mesh, pack: Packing) -> dict[str, Any]:
    """Return the surface that all paths share, and the colours of distances from 0 to the largest."""
    facets = facets_of(mesh)
    edges = outline(mesh.nodes, facets) if len(facets) else mesh.edges
    colors = np.rint(255 * error_colors(np.linspace(0, 1, 33))).astype(int)
    return {
        "outline": pack.pairs(edges),
        "triangles": pack.pairs(triangles_of(facets)),
        "edges": pack.pairs(edges_of(facets)),
        "colors": colors.tolist(),
    }


def path_in_scene(result: Result, name: str, states: Sequence[State], pack: Packing, factor: float) -> dict[str, Any]:
    """Return a path's lines and its distance from the model: at each level as text, and the largest in packed steps."""
    surface, inside = _lines(result.paths[name])
    values: dict[str, Any] = {"lines": pack.pairs(surface), "inside": pack.pairs(inside), "most": [], "farthest": None}
    if name == result.model or result.model is None:
        return values
    model = result.paths[result.model]
    pairs = [(model.at(state.level), state) for state in states]
    distances = [
        None if mine is None else float(np.linalg.norm(mine.displacement - state.displacement, axis=1).max())
        for mine, state in pairs
    ]
    farthest = max((distance for distance in distances if distance is not None), default=0.0)
    largest = max((float(np.linalg.norm(state.displacement, axis=1).max()) for state in states), default=0.0)
    if farthest <= ROUNDING * largest:
        return values
    values["most"] = [None if distance is None else quantity(distance, "m", 2) for distance in distances]
    if farthest < np.inf:
        values["farthest"] = {"steps": pack.steps(factor * farthest), "words": quantity(farthest, "m", 2)}
    return values
