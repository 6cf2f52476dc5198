"""Marks on a picture of a body: the probe, arrows of loads and prescribed motions, pins and rollers of supports."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.loading import Mark
from truespring.problem import Problem
from truespring.report.lines import draw_arrow
from truespring.report.quantity import Scale, input_quantity
from truespring.report.sheet import Area
from truespring.report.style import LOAD, MOTION, POINT, RED
from truespring.report.words import draw_words

#: A projection from positions [m], shape (n, dim), to the picture plane [m], shape (n, 2).
View = Callable[[Floats], Floats]


def plane_view(points: Floats) -> Floats:
    """Return the points of a plane body [m], shape (n, 2), unchanged."""
    return points


def draw_dot(area: Area, point: Floats) -> None:
    """Draw the red dot of the probe."""
    _draw_marks(area, point, "probe", marker="o", color=RED, ms=5.5, mec="white", mew=0.6, zorder=10, clip_on=False)


def draw_outside(area: Area, points: Floats) -> None:
    """Draw crosses at nodes outside of the other body, shape (n, 2) in units of the area."""
    _draw_marks(area, points, "outside", marker="x", color=LOAD, ms=4.5, mew=1.2, zorder=9, clip_on=False)


def _draw_marks(area: Area, points: Floats, name: str, **style: Any) -> None:
    from matplotlib.lines import Line2D

    area.add(Line2D(*np.atleast_2d(points).T, ls="", gid=name, **style))


@dataclass(frozen=True, slots=True)
class Arrow:
    """The arrow of a load or a prescribed motion in the picture plane.

    Attributes:
        ends: tail and head [m], shape (2,) each.
        side: 1 if the text is on the right, -1 if on the left.
        room: the far end of the text [m], shape (2,).
        nodes: the nodes it acts on.
        text, color: of the label.
    """

    ends: tuple[Floats, Floats]
    side: int
    room: Floats
    nodes: Ints
    text: str
    color: str


class Acting(NamedTuple):
    """A load or a prescribed motion: the nodes it acts on, its direction, its text and its colour."""

    nodes: Ints
    vector: Floats
    text: str
    color: str


def find_acting(problem: Problem) -> Iterator[Acting]:
    """Yield the loads of a problem, then its prescribed motions."""
    for load in problem.loads:
        yield _acting(load.mark(problem.body, problem.loading.held), LOAD)
    for held in problem.held:
        for mark in held.marks():
            yield _acting(mark, MOTION)


def _acting(mark: Mark, color: str) -> Acting:
    text = f"{mark.symbol} = {input_quantity(float(f'{mark.size:.4g}'), mark.unit)}"
    return Acting(mark.nodes, mark.vector, text, color)


def find_arrows(problem: Problem, size: float, view: View = plane_view) -> list[Arrow]:
    """Return the arrows of all loads and motions of a body that is about `size` [m] large."""
    mesh = problem.mesh
    middle = (mesh.lower + mesh.upper) / 2
    found = []
    for nodes, vector, text, color in find_acting(problem):
        if not vector.any():
            continue
        direction = vector / np.linalg.norm(vector)
        centre = mesh.nodes[nodes].mean(axis=0)
        outward = centre - middle
        along = float(direction @ outward)
        length = 0.13 * size * direction
        gap = 0.025 * size
        if abs(along) > 0.5 * float(np.linalg.norm(outward)) > 0:  # mainly normal to the face: outside of it
            tail = centre + gap * direction if along > 0 else centre - gap * direction - length
        else:  # mainly tangential: along the face
            beside = outward / max(float(np.linalg.norm(outward)), 1e-300)
            tail = centre + 2 * gap * beside - length / 2
        start, end, seen, seen_middle = view(np.stack([tail, tail + length, centre, middle]))
        side = 1 if seen[0] + 1e-9 * size >= seen_middle[0] else -1
        near = start if (side > 0) == (end[0] >= start[0]) else end
        found.append(Arrow((start, end), side, near + np.array([side * 0.24 * size, 0.0]), nodes, text, color))
    return found


def draw_drive(area: Area, arrow: Arrow, scale: Scale) -> None:
    """Draw an arrow with its text."""
    tail, tip = area.place(np.stack(arrow.ends) / scale.size)
    (x, y), (to_x, to_y) = tail, tip
    draw_arrow(area.sheet, tail, tip, arrow.color, 1.8, 4.2)
    upright = abs(to_y - y) > abs(to_x - x)
    beside, align = (min(x, to_x), 0.0) if arrow.side > 0 else (max(x, to_x), 1.0)
    beside, above = beside + 7 * POINT * arrow.side, (y + to_y) / 2 + (0 if upright else 11 * POINT)
    draw_words(area.sheet, beside, above, arrow.text, 8.5, arrow.color, align=align, halo=True)


def draw_loaded(area: Area, points: Floats, color: str) -> None:
    """Draw dots at the nodes of a load or a motion, shape (n, 2) in units of the area."""
    _draw_marks(area, points, "loaded", marker="o", color=color, ms=3, zorder=8)


# Twice the unit length of a pin [points]; the line under a roller is its widest part.
_SYMBOL = 11.0
#: The width of a roller [inch].
ROLLER = 1.4 * _SYMBOL / 2 * POINT


def draw_pin(
    area: Area,
    point: Floats,
    away: Floats,
    beside: Floats | None = None,
    roller: bool = True,
    zorder: float = 6,
) -> None:
    """Draw a triangle with its tip at the node, for a roller with a line below; its size is fixed, as that of text.

    `beside`, shape (2,), shifts it off the node on an arm, so that it does not cover the edge it slides along.
    """
    from matplotlib.path import Path as Outline

    across = np.array([-away[1], away[0]])
    corners = [np.zeros(2), away + 0.55 * across, away - 0.55 * across, np.zeros(2)]
    codes = [Outline.MOVETO, Outline.LINETO, Outline.LINETO, Outline.CLOSEPOLY]
    if roller:
        corners += [1.35 * away + 0.7 * across, 1.35 * away - 0.7 * across]
        codes += [Outline.MOVETO, Outline.LINETO]
    if beside is not None and beside.any():
        corners = [np.zeros(2)] + [corner + beside for corner in corners]
        codes = [Outline.MOVETO, Outline.LINETO, *codes[1:]]
    symbol = Outline(np.array(corners), codes)
    size = _SYMBOL * float(np.abs(corners).max())  # undo matplotlib's scaling of markers to unit extent
    _draw_marks(area, point, "support", marker=symbol, ms=size, color="white", mec="#3d4248", mew=0.9, zorder=zorder)
