"""Data of the interactive 3D view beyond those of the 2D view: surface, inner springs, distances as colours."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.equilibrium import Solution, State
from truespring.errors import MeshError
from truespring.mesh import Mesh, in_simplices
from truespring.mesh.facets import triangles_of
from truespring.report.bodies import path_lines
from truespring.report.nodal import FIELDS, node_fields
from truespring.report.packing import Packing
from truespring.report.quantity import ROUNDING, natural_scale, quantity
from truespring.report.result import Result
from truespring.report.style import error_colors
from truespring.report.surfaces import edges_of, facets_of, lines_on, outline
from truespring.report.undeformed import spring_lines

# With more springs than this, only those on the surface are drawn; with more nodes, a body that is cut is hollow.
_MOST_SPRINGS, _MOST_SOLID = 20_000, 3_000
# Steps of the range of a quantity, and with more values than the last number.
_FINE, _COARSE, _MANY = 65535, 255, 100_000


def scene_nodes(result: Result, shown: Sequence[str]) -> Ints:
    """Return the nodes that a view of the paths `shown` draws, ascending, shape (n,): surface, lines, probe."""
    kept = np.zeros(result.problem.mesh.n_nodes, dtype=bool)
    kept[facets_of(result.problem.mesh)] = True
    kept |= result.problem.mesh.n_nodes <= _MOST_SOLID
    kept[result.probe] = True
    for name in shown:
        for lines in _lines(result.solutions[name]):
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
    """Return the surface that all paths share, and tetrahedra of the body."""
    facets = facets_of(mesh)
    edges = outline(mesh.nodes, facets) if len(facets) else mesh.edges
    return {
        "outline": pack.pairs(edges),
        "triangles": pack.pairs(triangles_of(facets)),
        "edges": pack.pairs(edges_of(facets)),
        "tetrahedra": pack.cells(_tetrahedra(mesh)) if len(pack.nodes) == mesh.n_nodes else "",
    }


def surface_in_plane(mesh: Mesh, pack: Packing) -> dict[str, Any]:
    """Return the elements of a plane body as triangles; none of a network."""
    elements = mesh.elements if mesh.element_dim == 2 else np.zeros((0, 3), dtype=np.int64)
    return {"triangles": pack.pairs(triangles_of(elements))}


def colors_in_view() -> list[list[int]]:
    """Return the colours of a range of values from the smallest to the largest: red, green and blue, 0 ... 255."""
    colors: list[list[int]] = np.rint(255 * error_colors(np.linspace(0, 1, 33))).astype(int).tolist()
    return colors


def _tetrahedra(mesh: Mesh) -> Ints:
    """Return the elements of a solid body divided into tetrahedra, shape (n, 4); none if they cannot be divided."""
    none = np.zeros((0, 4), dtype=np.int64)
    if mesh.element_dim < 3:
        return none
    try:
        return in_simplices(mesh)[0].elements
    except MeshError:
        return none


def fields_in_scene(
    result: Result, shown: Sequence[str], levels: Sequence[float], pack: Packing
) -> tuple[list[dict[str, Any]], list[dict[str, list[str]]]]:
    """Return the quantities that colours may stand for, and the values of each path of `shown` at each level.

    A quantity has its name, words and unit, and the range of all paths and levels in that unit; the values of a path
    are steps in that range, by the name of the quantity.
    """
    known = [
        [node_fields(path, state) for level in levels if (state := path.at(level)) is not None]
        for path in map(result.solutions.__getitem__, shown)
    ]
    fields, values = [], [dict[str, list[str]]() for _ in shown]
    steps = _FINE if len(FIELDS) * len(shown) * len(levels) * len(pack.nodes) <= _MANY else _COARSE
    for name, field in FIELDS.items():
        those = [
            (place, [one[name] for one in several]) for place, several in enumerate(known) if _all_have(several, name)
        ]
        found = [value for _, several in those for one in several for value in one[pack.nodes]]
        low, high = min(found, default=field.at_rest), max(found, default=field.at_rest)
        low = field.at_rest if low > field.at_rest - ROUNDING * abs(high) else low
        if not high - low > ROUNDING * abs(high):
            continue
        scale = natural_scale(high, field.unit)
        ends = {"low": low / scale.size, "high": high / scale.size}
        fields.append({"name": name, "label": field.label, "unit": scale.unit, "steps": steps, **ends})
        for place, several in those:
            values[place][name] = [pack.shares(one, low, high, steps) for one in several]
    return fields, values


def _all_have(several: Sequence[Mapping[str, Floats]], name: str) -> bool:
    return bool(several) and all(name in one for one in several)


def path_in_scene(result: Result, name: str, states: Sequence[State], pack: Packing) -> dict[str, Any]:
    """Return a path's lines, and its distance from the model at each level as text."""
    surface, inside = _lines(result.solutions[name])
    values: dict[str, Any] = {"lines": pack.pairs(surface), "inside": pack.pairs(inside), "most": []}
    if name == result.model or result.model is None:
        return values
    model = result.solutions[result.model]
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
    return values
