"""Draw plane bodies into axes of matplotlib: springs in blue over a reference in black, or colours."""

from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.mesh.facets import triangles_of
from truespring.report.style import BLUE, FAINT, INK, MOTION
from truespring.showing.frames import draw_dashes, draw_dots, draw_lines, frame_plane, thinner
from truespring.showing.paints import Paint
from truespring.showing.scales import add_bar, colors_of, range_of
from truespring.showing.scenes import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Width of lines [points].
_MODEL, _REFERENCE, _RIM = 0.9, 1.4, 1.0
# Most edges of elements that are drawn over colours.
_MOST_EDGES = 4000


def draw_plane(axes: "Axes", scene: Scene) -> None:
    """Draw a scene in the plane; the data of the axes are in metres."""
    draw_rest(axes, scene)
    if scene.theirs is not None:
        pairs, order = (scene.theirs.lines, 2) if scene.paint is None else (scene.theirs.rim, 4)
        draw_lines(axes, scene.theirs.points, pairs, INK, _REFERENCE, order, "reference")
        if scene.theirs.is_cloud:
            draw_dots(axes, scene.theirs.points, order, "reference", color=INK)
    if scene.paint is not None:
        add_bar(axes, _draw_colors(axes, scene, scene.paint), scene.paint)
    else:
        draw_lines(axes, scene.mine.points, scene.mine.lines, BLUE, _MODEL, 3, "solution")
        if scene.mine.is_cloud:
            draw_dots(axes, scene.mine.points, 3, "solution", color=BLUE)
    for tool in scene.tools:
        draw_lines(axes, tool.points, tool.lines, MOTION, 1.2, 5, "tool")
    frame_plane(axes, *scene.box)


def draw_rest(axes: "Axes", scene: Scene) -> None:
    """Draw the outline of the undeformed body, or its points."""
    rest = scene.rest
    if rest is not None and rest.is_cloud:
        draw_dots(axes, rest.points, 1, "undeformed", color=FAINT)
    elif rest is not None:
        draw_dashes(axes, rest.points, rest.outline, FAINT, _RIM, 1, "undeformed")


def draw_colored_lines(axes: "Axes", scene: Scene, paint: Paint) -> Any:
    """Draw springs, or the lines of a network, in colours of their values or of the means of their ends."""
    from matplotlib.collections import LineCollection

    pairs = paint.lines if paint.on == "lines" else scene.mine.lines
    values = paint.values if paint.on == "lines" else paint.values[pairs].mean(axis=1)
    points = scene.mine.points[pairs]
    order = np.argsort(points[..., 2].mean(axis=1)) if points.shape[2] > 2 else np.arange(len(pairs))
    drawn = LineCollection(
        list(points[order][..., :2]),
        array=values[order],
        cmap=colors_of(paint),
        norm=range_of(paint),
        linewidths=1.4 * max(0.6, thinner(len(pairs))),
        zorder=3,
        gid="colors",
    )
    axes.add_collection(drawn)
    return drawn


def _draw_colors(axes: "Axes", scene: Scene, paint: Paint) -> Any:
    """Draw the body in the colours of a paint; return what has the colours."""
    from matplotlib.collections import PolyCollection
    from matplotlib.tri import Triangulation

    points, mesh = scene.mine.points, scene.mesh
    style: dict[str, Any] = {"cmap": colors_of(paint), "norm": range_of(paint), "gid": "colors"}
    if scene.mine.is_cloud:
        return draw_dots(axes, points, 3, c=paint.values, name=style.pop("gid"), **style)
    if paint.on == "lines" or mesh.element == "line":
        return draw_colored_lines(axes, scene, paint)
    drawn: Any
    if paint.on == "elements":
        drawn = PolyCollection(
            list(points[mesh.elements]), array=paint.values, linewidths=0, antialiaseds=False, zorder=2, **style
        )
        axes.add_collection(drawn)
    else:
        body = Triangulation(points[:, 0], points[:, 1], triangles_of(mesh.elements))
        drawn = axes.tripcolor(body, np.nan_to_num(paint.values), shading="gouraud", zorder=2, **style)
    edges = mesh.edges if len(mesh.edges) <= _MOST_EDGES else mesh.boundary
    draw_lines(axes, points, edges, "#00000055", 0.5, 3, "elements")
    return drawn
