"""Draw a plane body into axes of matplotlib: springs in blue over a reference in black, or colours."""

from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh import Mesh
from truespring.mesh.facets import triangles_of
from truespring.report.bodies import path_lines
from truespring.report.quantity import natural_scale
from truespring.report.style import BLUE, FAINT, INK
from truespring.showing.paints import Paint
from truespring.showing.scales import add_bar, colors_of, formatter, range_of
from truespring.showing.scenes import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Most edges of elements that are drawn over colours.
_MOST_EDGES = 4000


def draw_plane(axes: "Axes", scene: Scene) -> None:
    """Draw a scene in the plane; the data of the axes are in metres."""
    mesh = scene.solution.problem.mesh
    lines(axes, scene.rest, outline_of(mesh), FAINT, 0.9, 1, "undeformed", linestyle=(0, (3, 2)))
    if scene.over is not None and scene.theirs is not None:
        theirs = scene.over.problem.mesh
        black = path_lines(scene.over) if scene.paint is None else outline_of(theirs)
        lines(axes, scene.theirs, black, INK, 1.4, 4 if scene.paint else 2, "reference")
    if scene.paint is None:
        lines(axes, scene.mine, path_lines(scene.solution), BLUE, 0.9, 3, "solution")
    else:
        add_bar(axes, _colored(axes, scene, scene.paint), scene.paint)
    _frame(axes, scene)


def outline_of(mesh: Mesh) -> Ints:
    """Return the boundary edges of a plane body, all lines of a network, shape (n, 2)."""
    return mesh.boundary if mesh.element != "line" else mesh.edges


def lines(
    axes: "Axes", points: Floats, pairs: Ints, color: str, width: float, zorder: float, name: str, **more: Any
) -> None:
    """Draw lines between points, thinner the more there are."""
    from matplotlib.collections import LineCollection

    width *= min(1.0, max(0.3, (800 / max(len(pairs), 1)) ** 0.5))
    axes.add_collection(
        LineCollection(list(points[pairs]), colors=color, linewidths=width, zorder=zorder, gid=name, **more)
    )


def _colored(axes: "Axes", scene: Scene, paint: Paint) -> Any:
    """Draw the body in the colours of a paint; return what has the colours."""
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.tri import Triangulation

    mesh = scene.solution.problem.mesh
    style: dict[str, Any] = {"cmap": colors_of(paint), "norm": range_of(paint), "zorder": 2, "gid": "colors"}
    drawn: Any
    if paint.on == "lines" or mesh.element == "line":
        pairs = paint.lines if paint.on == "lines" else mesh.edges
        values = paint.values if paint.on == "lines" else paint.values[pairs].mean(axis=1)
        drawn = LineCollection(list(scene.mine[pairs]), array=values, linewidths=1.2, **style)
        axes.add_collection(drawn)
        return drawn
    if paint.on == "elements":
        drawn = PolyCollection(list(scene.mine[mesh.elements]), array=paint.values, linewidths=0, **style)
        axes.add_collection(drawn)
    else:
        body = Triangulation(scene.mine[:, 0], scene.mine[:, 1], triangles_of(mesh.elements))
        drawn = axes.tripcolor(body, np.nan_to_num(paint.values), shading="gouraud", **style)
    edges = mesh.edges if len(mesh.edges) <= _MOST_EDGES else mesh.boundary
    lines(axes, scene.mine, edges, "#00000055", 0.5, 3, "elements")
    return drawn


def _frame(axes: "Axes", scene: Scene) -> None:
    """Set equal scales, limits and labels with a unit that fits; data stay in metres."""
    low, high = scene.box
    scale = natural_scale(float(np.abs([low, high]).max()), "m")
    axes.set_aspect("equal")
    axes.set_xlim(float(low[0]), float(high[0]))
    axes.set_ylim(float(low[1]), float(high[1]))
    for axis, name in ((axes.xaxis, "x"), (axes.yaxis, "y")):
        axis.set_major_formatter(formatter(scale.size))
        axis.set_label_text(f"{name} [{scale.unit}]")
    axes.spines[["top", "right"]].set_visible(False)
