"""Marks on a picture of a body: the probe, arrows of loads and prescribed motions, pins and rollers of supports."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.loading import Along, Mark
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
        text, color: of the label; one of several arrows has no text.
        slim: whether it is one of several.
    """

    ends: tuple[Floats, Floats]
    side: int
    room: Floats
    nodes: Ints
    text: str
    color: str
    slim: bool = False


class Acting(NamedTuple):
    """A load or a prescribed motion: the nodes it acts on, its direction, text and colour, and where it is facets."""

    nodes: Ints
    vector: Floats
    text: str
    color: str
    along: Along | None = None


def find_acting(problem: Problem) -> Iterator[Acting]:
    """Yield the loads of a problem, then its prescribed motions."""
    for load in problem.loads:
        yield _acting(load.mark(problem.body, problem.loading.held), LOAD)
    for held in problem.held:
        for mark in held.marks():
            yield _acting(mark, MOTION)


def _acting(mark: Mark, color: str) -> Acting:
    text = f"{mark.symbol} = {input_quantity(float(f'{mark.size:.4g}'), mark.unit)}"
    return Acting(mark.nodes, mark.vector, text, color, mark.along)


def find_arrows(problem: Problem, size: float, view: View = plane_view, towards: Floats | None = None) -> list[Arrow]:
    """Return the arrows of all loads and motions of a body that is about `size` [m] large.

    A load that is spread has several, on facets that face the eye; `towards` is the direction to it, None in the plane.
    """
    middle = (problem.mesh.lower + problem.mesh.upper) / 2
    found = []
    for acting in find_acting(problem):
        chosen = None if acting.along is None else _chosen(acting.along, size, towards)
        if chosen is not None:
            found += _several(acting, chosen, size, view, middle)
        elif acting.vector.any():
            centre = problem.mesh.nodes[acting.nodes].mean(axis=0)
            found.append(_arrow(acting, centre, centre - middle, size, view, middle))
    return found


def _arrow(acting: Acting, centre: Floats, outward: Floats, size: float, view: View, middle: Floats) -> Arrow:
    """Return an arrow at a point of the body [m] whose side looks `outward`."""
    direction = acting.vector / np.linalg.norm(acting.vector)
    along = float(direction @ outward)
    length = (_LENGTH if acting.text else _SHORT) * size * direction
    gap = 0.025 * size * bool(acting.text)
    if abs(along) > 0.5 * float(np.linalg.norm(outward)) > 0:  # mainly normal to the face: outside of it
        tail = centre + gap * direction if along > 0 else centre - gap * direction - length
    else:  # mainly tangential: along the face
        beside = outward / max(float(np.linalg.norm(outward)), 1e-300)
        tail = centre + 2 * gap * beside - length / 2
    start, end, seen, seen_middle = view(np.stack([tail, tail + length, centre, middle]))
    side = 1 if seen[0] + 1e-9 * size >= seen_middle[0] else -1
    near = start if (side > 0) == (end[0] >= start[0]) else end
    return Arrow(
        (start, end), side, near + np.array([side * 0.24 * size, 0.0]), acting.nodes, acting.text, acting.color
    )


# Length of an arrow, and of one of several; smallest distance of several [sizes of the body], and their number.
_LENGTH, _SHORT, _APART, _MOST = 0.13, 0.08, 0.055, 16


def _chosen(facets: Along, size: float, towards: Floats | None) -> Ints | None:
    """Return the facets to draw arrows on, far from each other; None if none faces the eye."""
    facing = np.arange(len(facets.centres)) if towards is None else np.flatnonzero(facets.outward @ towards > 0.05)
    if not facing.size:
        return None
    centres = facets.centres[facing]
    chosen = [int(np.linalg.norm(centres - centres.mean(axis=0), axis=1).argmax())]
    away = np.linalg.norm(centres - centres[chosen[0]], axis=1)
    while len(chosen) < _MOST and away.max() > _APART * size:
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(centres - centres[chosen[-1]], axis=1))
    return np.asarray(facing[np.sort(chosen)])


def _several(acting: Acting, chosen: Ints, size: float, view: View, middle: Floats) -> list[Arrow]:
    """Return an arrow on each facet; that with the text is the outermost to the right or, without one, above."""
    assert acting.along is not None  # find_arrows
    centres, outward, forces = (one[chosen] for one in acting.along)
    seen = view(centres)
    last = int((seen[:, 0] + 0.5 * seen[:, 1]).argmax())
    found = []
    for number, (centre, normal, force) in enumerate(zip(centres, outward, forces, strict=True)):
        one = acting._replace(vector=force, text="", nodes=acting.nodes if number == last else acting.nodes[:0])
        arrow = _arrow(one, centre, normal, size, view, middle)
        more: dict[str, Any] = {"text": acting.text} if number == last else {"room": arrow.ends[0]}
        found.append(replace(arrow, slim=True, **more))
    return found


def draw_drive(area: Area, arrow: Arrow, scale: Scale) -> None:
    """Draw an arrow with its text."""
    tail, tip = area.place(np.stack(arrow.ends) / scale.size)
    (x, y), (to_x, to_y) = tail, tip
    draw_arrow(area.sheet, tail, tip, arrow.color, *((1.2, 3.4) if arrow.slim else (1.8, 4.2)))
    if not arrow.text:
        return
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
