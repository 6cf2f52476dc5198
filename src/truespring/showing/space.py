"""Draw a body in space into axes of matplotlib: an image, with outline, triad and colour bar over it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh import Mesh
from truespring.mesh.facets import find_facets
from truespring.report.bodies3d import over_layers, solid, wires
from truespring.report.quantity import quantity
from truespring.report.render import Layer, Shot, render
from truespring.report.style import FAINT, INK
from truespring.report.surfaces import VIEW, edges_of, facets_of, outline, seen
from truespring.showing.paints import Paint
from truespring.showing.plane import lines
from truespring.showing.scales import add_bar, colors_of, range_of
from truespring.showing.scenes import Scene

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Resolution of the image [pixels/inch], width of an image [inch].
_DPI, _WIDTH = 200, 6.0
_TRIAD = "#3d4248"


def draw_space(axes: "Axes", scene: Scene) -> None:
    """Draw a scene in space; the data of the axes are in metres, to the right and up in the picture plane."""
    low, high = scene.box
    arm = 0.12 * float((high - low).max())
    low = low - np.array([0.0, 1.6 * arm])
    pixels = round(_WIDTH * _DPI), round(_WIDTH * _DPI * float((high - low)[1] / (high - low)[0]))
    images, _ = render([Shot(_layers(scene), low, high, pixels, _DPI / 72)])()
    axes.imshow(
        images[0], extent=(low[0], high[0], low[1], high[1]), zorder=2, gid="image", interpolation="antialiased"
    )
    mesh, rest = scene.solution.problem.mesh, seen(scene.rest)
    facets = facets_of(mesh)
    edges = outline(rest, facets, silhouette=True) if len(facets) else mesh.edges
    lines(axes, rest[:, :2], edges, FAINT, 0.9, 1, "undeformed", linestyle=(0, (3, 2)))
    axes.set_aspect("equal")
    axes.set_axis_off()
    _triad(axes, low, arm)
    if scene.paint is not None:
        from matplotlib.cm import ScalarMappable

        add_bar(axes, ScalarMappable(range_of(scene.paint), colors_of(scene.paint)), scene.paint)


def _layers(scene: Scene) -> tuple[Layer, ...]:
    mine = seen(scene.mine)
    theirs = None if scene.theirs is None else seen(scene.theirs)
    if scene.paint is None:
        return over_layers(scene.solution, mine, scene.over, theirs)
    body = _painted(scene.solution.problem.mesh, mine, scene.paint)
    if scene.over is None or theirs is None:
        return body
    facets = facets_of(scene.over.problem.mesh)
    black = outline(theirs, facets, silhouette=True) if len(facets) else scene.over.problem.mesh.edges
    return *body, wires(theirs, facets, black, 1.1, INK)


def _painted(mesh: Mesh, points: Floats, paint: Paint) -> tuple[Layer, ...]:
    """Return the surface in the colours of a paint; values of lines are averaged at their ends."""
    facets = facets_of(mesh)
    shade: Any = colors_of(paint)
    norm: Any = range_of(paint)
    values = _on_corners(mesh, facets, paint)
    colors = np.asarray(shade(norm(np.nan_to_num(values)))[..., :3])
    return (solid(points, facets, colors, edges_of(facets), INK, 0.35),)


def _on_corners(mesh: Mesh, facets: Ints, paint: Paint) -> Floats:
    """Return the values at the corners of the facets, shape (n_facets, corners)."""
    if paint.on == "elements":
        owners = find_facets(mesh.elements, mesh.element, facets)[:, 0]
        return np.repeat(paint.values[owners][:, None], facets.shape[1], axis=1)
    if paint.on == "nodes":
        return np.asarray(paint.values[facets])
    ends, values = paint.lines.ravel(), np.repeat(paint.values, 2)
    count = np.bincount(ends, minlength=mesh.n_nodes)
    return np.asarray((np.bincount(ends, values, mesh.n_nodes) / np.maximum(count, 1))[facets])


def _triad(axes: "Axes", low: Floats, arm: float) -> None:
    """Draw arms along x, y and z at the lower left, with their length."""
    length = 10.0 ** np.floor(np.log10(arm))
    length *= max(digit for digit in (1, 2, 5) if digit * length <= arm * (1 + 1e-9))
    tips = length * VIEW[:2].T
    origin = low + 0.5 * arm - np.minimum(tips.min(axis=0), 0.0)
    for tip, name in zip(origin + tips, "xyz", strict=True):
        axes.annotate("", tip, origin, arrowprops={"arrowstyle": "->", "color": _TRIAD, "lw": 0.9})
        axes.annotate(name, origin + 1.25 * (tip - origin), ha="center", va="center", fontsize="small", color=_TRIAD)
    words = f"each {quantity(float(length), 'm', 1)}"
    axes.annotate(words, origin + np.array([1.4 * arm, 0.0]), va="center", fontsize="x-small", color=_TRIAD)
