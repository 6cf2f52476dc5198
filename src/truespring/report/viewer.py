"""Data of the interactive views of a page: packed positions of every path at every load level."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.equilibrium import Solution, State
from truespring.mesh.facets import triangles_of
from truespring.report.axis import axis_of
from truespring.report.bodies import magnification, path_lines, picture_box
from truespring.report.packing import Packing
from truespring.report.quantity import ROUNDING, natural_scale, percent, quantity, times
from truespring.report.result import Result
from truespring.report.scene import (
    colors_in_view,
    fields_in_scene,
    path_in_scene,
    scene_nodes,
    surface_in_plane,
    surface_in_scene,
)
from truespring.report.style import full_name
from truespring.report.surfaces import outline
from truespring.report.touching import drawn_tools, near, skins_at
from truespring.report.verdict import drive


def viewer(result: Result, budget: int) -> dict[str, Any] | None:
    """Return the data of a study's interactive view as JSON values.

    None if nothing moves, or if more than `budget` numbers were needed.
    """
    mesh = result.problem.mesh
    shown = _shown(result)
    nodes = scene_nodes(result, shown) if mesh.dim == 3 else np.arange(mesh.n_nodes)
    if not shown:
        return None
    levels = _levels(result.solutions[shown[0]], budget // (mesh.dim * len(nodes) * len(shown)))
    if len(levels) < 2:
        return None
    factor = 1.0 if any(_only_surface(result.solutions[name]) for name in shown) else magnification(result)
    first, *others = (_cloud(result.solutions[name], factor) for name in shown)
    inside = np.concatenate([mesh.nodes, first])
    around = _around(result, levels, inside) if mesh.dim == 2 else []  # in space the camera holds them
    lower, upper, leaves = picture_box(np.concatenate([inside, *around]), others)
    extent = upper - lower
    pack = Packing(lower, float(extent.max()), nodes, mesh.n_nodes)
    scale = natural_scale(float(extent.max()), "m")
    axis = axis_of(result)
    closest = shown.index(result.closest) - 1 if result.closest in shown else 0
    values: dict[str, Any] = {
        "magnified": f"displacements {times(factor)}" if factor != 1 else "",
        "motion": result.problem.stated and not result.problem.loads,
        "unit": scale.unit,
        "axis": {"name": axis.name, "unit": axis.unit, "span": axis.span, "level": axis.level, "moves": axis.moves},
        "box": [float(value) for value in extent / scale.size],
        "n_nodes": len(nodes),
        "lower": [float(value) for value in lower / scale.size],
        "factor": factor,
        "numbers": pack.numbers(nodes) if len(nodes) < mesh.n_nodes else "",
        "probe": pack.number(result.probe),
        "chosen": closest,
        "start": _start(result.solutions[shown[0]], levels),
        "rest": pack.places(mesh.nodes),
        "outline": pack.pairs(mesh.boundary if mesh.boundary.shape[1] == 2 else mesh.edges),
        "paths": [
            _path(result, name, levels, pack, factor, beyond)
            for name, beyond in zip(shown, [False, *leaves], strict=True)
        ],
        "tools": _tools(result, levels, pack),
    }
    fields, of_paths = fields_in_scene(result, shown, levels, pack)
    for path, own in zip(values["paths"], of_paths, strict=True):
        path["fields"] = own
    surface = surface_in_scene if mesh.dim == 3 else surface_in_plane
    return {**values, **surface(mesh, pack), "fields": fields, "colors": colors_in_view()}


def _shown(result: Result) -> list[str]:
    """Return the names of the paths to draw: the model, then its references; none if the model does not move."""
    order = [result.model] if result.model is not None else []
    names = order + [name for name in result.solutions if name not in order]
    shown = [name for name in names if len(result.solutions[name].states) > 1 or name != names[0]]
    shown = [name for name in shown if result.solutions[name].states or _only_surface(result.solutions[name])]
    return shown if shown and shown[0] == names[0] else []


def _start(path: Solution, levels: Sequence[float]) -> int:
    """Return the index of the level to show first: the last, or that of the largest displacement if it returns."""
    if not path.problem.returns:
        return len(levels) - 1
    states = [path.at(level) for level in levels]
    moved = [0.0 if one is None else float(np.linalg.norm(one.displacement, axis=1).max()) for one in states]
    return int(np.argmax(moved))


def _around(result: Result, levels: Sequence[float], inside: Floats) -> list[Floats]:
    """Return the points of tools of a plane body at each level that are not far from points `inside` [m], (n, 2)."""
    box = inside.min(axis=0), inside.max(axis=0)
    return [near(drawn_tools(result.problem, level), *box) for level in levels]


def _tools(result: Result, levels: Sequence[float], pack: Packing) -> list[dict[str, Any]]:
    """Return the surface of each tool at the first level, its shift since then in packed steps, and where it acts."""
    touches = [[touch for touch, _ in skins_at(result.problem, level)] for level in levels]
    found = []
    for number, (first, skin) in enumerate(skins_at(result.problem, levels[0])):
        edges = outline(skin.points, skin.facets) if len(skin.facets) else skin.lines
        each = [at[number] for at in touches]
        shifts = [[round(pack.steps(float(value)), 1) for value in one.place - first.place] for one in each]
        found.append(
            {
                "points": pack.points(first.place + skin.points, beyond=True),
                "lines": pack.numbers(edges),
                "triangles": pack.numbers(triangles_of(skin.facets)),
                "shifts": shifts,
                "there": [one.acts for one in each],
            }
        )
    return found


def _only_surface(path: Solution) -> bool:
    """Return whether a path was read from a file with a surface but without displacements of nodes."""
    return path.surface is not None and not path.states


def _cloud(path: Solution, factor: float) -> Floats:
    """Return all points [m] that the view draws of a path, shape (n, dim)."""
    clouds = [path.problem.mesh.nodes + factor * state.displacement for state in path.states]
    return np.concatenate(clouds + ([path.surface.points] if path.surface is not None and factor == 1 else []))


def _levels(path: Solution, budget: int) -> list[float]:
    """Return the load levels to keep, at most `budget`: every n-th, with the first and the last."""
    levels = path.load_factors.tolist()
    step = max(1, -(-len(levels) // max(budget - 1, 1)))
    return [levels[0], *levels[:0:-step][::-1]] if budget > 1 else []


# A resultant of reactions below this share of their sum is a rounding error.
_ROUNDING = 1e-9


def _force(along: float, state: State) -> str:
    if not np.isfinite(along):
        return "not known"
    reactions = float(np.nansum(np.linalg.norm(state.reaction, axis=1)))
    return quantity(0.0 if abs(along) < _ROUNDING * reactions else along, "N")


def _path(
    result: Result, name: str, levels: Sequence[float], pack: Packing, factor: float, beyond: bool
) -> dict[str, Any]:
    """Return positions and text of a path by level; `beyond`: it leaves the picture; `factor`: magnification."""
    path = result.solutions[name]
    to = drive(result)
    rest = path.problem.mesh.nodes
    states = [state for level in levels if (state := path.at(level)) is not None]
    one = result.comparisons.get(name)
    known = dict(zip(one.load_factors.tolist(), one.rms_errors.tolist(), strict=True)) if one else {}
    errors = [next((error for at, error in known.items() if abs(at - s.load_factor) < 1e-9), None) for s in states]
    moved = [float(np.linalg.norm(state.displacement[result.probe])) for state in states]
    values: dict[str, Any] = {
        "name": name,
        "label": full_name(result, name),
        "kind": path.kind,
        "beyond": beyond,
        "levels": [state.load_factor for state in states],
        "positions": [pack.places(rest + factor * state.displacement, beyond) for state in states],
        "force": [_force(to.along(path.applied_force(state)), state) for state in states],
        "moved": [quantity(value if value > ROUNDING * max(moved) else 0.0, "m") for value in moved],
        "errors": [None if error is None or np.isnan(error) else percent(error) for error in errors],
        "surface": None,
    }
    if rest.shape[1] == 3:
        return {**values, **path_in_scene(result, name, states, pack)}
    values["lines"] = pack.pairs(path_lines(path))
    if path.surface is not None and factor == 1:
        surface = path.surface
        values["surface"] = {
            "level": surface.load_factor,
            "points": pack.points(surface.points, beyond),
            "lines": pack.numbers(surface.outline),
        }
    return values
