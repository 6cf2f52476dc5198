"""Tools and grasps in pictures: outlines in the plane, surfaces in space."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.conditions import Touch
from truespring.problem import Problem
from truespring.report.legend import Entry
from truespring.report.lines import draw_lines
from truespring.report.quantity import Scale
from truespring.report.render import Layer, rgb
from truespring.report.sheet import Area
from truespring.report.style import MOTION
from truespring.report.surfaces import normals, outline, seen
from truespring.tools import Skin

# Colour of surfaces, width of lines [points], and how far around the body tools are shown, over its size.
_SURFACE, _WIDTH, _AROUND = "#8fc7b4", 1.1, 0.35
_LIGHT = np.array([-0.3, 0.6, 0.74]) / np.linalg.norm([-0.3, 0.6, 0.74])


@dataclass(frozen=True, eq=False, slots=True)
class Drawn:
    """A tool or grasp at one level, in the coordinates of `view`.

    Attributes:
        points: [m], shape (n, dim).
        lines: pairs of points, shape (m, 2): of facets their sharp edges and silhouette.
        facets: shape (k, 4), anticlockwise from outside; empty in the plane.
    """

    points: Floats
    lines: Ints
    facets: Ints


def skins_at(problem: Problem, level: float) -> Iterator[tuple[Touch, Skin]]:
    """Yield place and surface of the tools and grasps at a level that have one to draw, also where they do not act."""
    mesh = problem.mesh
    centre, size = (mesh.lower + mesh.upper) / 2, float(np.linalg.norm(mesh.upper - mesh.lower))
    touches = problem.loading.touches(mesh.nodes, level) if problem.stated and problem.touching else ()
    for one, touch in zip(problem.touching, touches, strict=False):  # none of results that were read
        skin = one.skin(centre - touch.place, size)
        if skin is not None:
            yield touch, skin


def drawn_tools(problem: Problem, level: float | None) -> list[Drawn]:
    """Return the tools and grasps that act at a level and have a surface to draw; all at their begin for None."""
    found = []
    for touch, skin in skins_at(problem, level or 0.0):
        if not (touch.acts or level is None):
            continue
        points = view(touch.place + skin.points)
        edges = outline(points, skin.facets, silhouette=True) if len(skin.facets) else skin.lines
        found.append(Drawn(points, edges, skin.facets))
    return found


def view(points: Floats) -> Floats:
    """Return points as they are in the plane, in space in coordinates of `seen`, shape (n, dim)."""
    return points if points.shape[1] == 2 else seen(points)


def near(tools: Sequence[Drawn], lower: Floats, upper: Floats) -> Floats:
    """Return the points of tools that are not far from a box of the picture plane [m], shape (n, 2)."""
    margin = _AROUND * float((upper - lower).max())
    points = np.concatenate([np.zeros((0, 2)), *(one.points[:, :2] for one in tools)])
    inside = ((points >= lower - margin) & (points <= upper + margin)).all(axis=1)
    return np.asarray(points[inside])


def entries(problem: Problem) -> tuple[Entry, ...]:
    """Return the entry of a legend; none without tools and grasps."""
    counts = {"tool": len(problem.tools), "grasp": len(problem.grasps)}
    names = [f"{name}{'s' * (count > 1)}" for name, count in counts.items() if count]
    return (Entry(" and ".join(names), MOTION),) if problem.stated and names else ()


def draw_tools(area: Area, tools: Sequence[Drawn], scale: Scale) -> None:
    """Draw the outlines of tools in the plane."""
    for one in tools:
        draw_lines(area, one.points[one.lines] / scale.size, MOTION, _WIDTH, 5, "tool")


def with_tools(layers: Sequence[Layer], tools: Sequence[Drawn]) -> tuple[Layer, ...]:
    """Return layers in which the surfaces of tools are drawn and hide what is behind them, then a layer of lines."""
    if not tools:
        return tuple(layers)
    faces = np.concatenate([one.points[one.facets] for one in tools])
    colors = np.concatenate([_lit(one) for one in tools])
    lines = np.concatenate([one.points[one.lines] for one in tools])
    none = np.zeros((0, 2), dtype=np.int64)
    if not any(layer.colors is not None for layer in layers):
        layers = (Layer(faces[:0], colors[:0], faces[:0, :2], none, MOTION, _WIDTH), *layers)
    found = [
        replace(
            layer,
            faces=np.concatenate([_four(layer.faces), faces]),
            colors=None if layer.colors is None else np.concatenate([_four(layer.colors), colors]),
        )
        for layer in layers
    ]
    return (*found, Layer(found[-1].faces, None, lines, none, MOTION, _WIDTH))


def _four(corners: Floats) -> Floats:
    """Return triangles as quadrilaterals with the last corner twice, shape (n, 4, 3)."""
    return corners if corners.shape[1] == 4 else np.concatenate([corners, corners[:, -1:]], axis=1)


def _lit(one: Drawn) -> Floats:
    """Return the colours of the corners of facets, darker the less light falls on them, shape (n, 4, 3)."""
    facing = normals(one.points, one.facets) @ _LIGHT
    shade = 0.72 + 0.28 * facing.clip(-1, 1)
    return np.broadcast_to(shade[:, None, None] * rgb(_SURFACE), (*one.facets.shape, 3))
