"""Draw bodies in space into axes of matplotlib: an image, with outlines, triad and colour bar over it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh import Mesh
from truespring.mesh.facets import find_facets
from truespring.report.bodies3d import BODY, REFERENCE, one_color, solid, wires
from truespring.report.render import Layer
from truespring.report.style import BLUE, INK
from truespring.report.surfaces import edges_of
from truespring.report.touching import with_tools
from truespring.showing.frames import draw_dots, draw_image, draw_lines, frame_space
from truespring.showing.paints import Paint
from truespring.showing.plane import draw_colored_lines, draw_rest
from truespring.showing.scales import add_bar, colors_of, range_of
from truespring.showing.scenes import Scene
from truespring.showing.shapes import Shape

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_space(axes: "Axes", scene: Scene) -> None:
    """Draw a scene in space; the data of the axes are in metres, to the right and up in the picture plane."""
    low, high = scene.box
    low = frame_space(axes, low, high)
    draw_rest(axes, scene)
    layers = with_tools(_layers(scene), scene.tools)
    if layers:
        draw_image(axes, layers, low, high, accurate=bool(scene.tools))
    drawn = _draw_open(axes, scene)
    if scene.paint is not None:
        add_bar(axes, drawn or _mappable(scene.paint), scene.paint)


def _layers(scene: Scene) -> tuple[Layer, ...]:
    """Return the bodies that have a surface: colours under a black outline, or lines over the reference."""
    mine, theirs = scene.mine, scene.theirs
    layers = []
    if theirs is not None and len(theirs.facets) and scene.paint is None:
        layers.append(_solid(theirs, REFERENCE, INK, 1.2))
    if len(mine.facets):
        if scene.paint is not None:
            layers.append(_painted(scene.mesh, mine, scene.paint))
        elif not layers:
            layers += [_solid(mine, BODY, BLUE, 0.8), wires(mine.points, mine.facets, mine.outline, 0.8)]
        else:
            both = np.concatenate([mine.lines, mine.outline])
            layers.append(wires(mine.points, mine.facets, both, 0.8))
    if theirs is not None and len(theirs.facets) and scene.paint is not None:
        layers.append(wires(theirs.points, theirs.facets, theirs.outline, 1.1, INK))
    return tuple(layers)


def _solid(shape: Shape, color: str, ink: str, width: float) -> Layer:
    return solid(shape.points, shape.facets, one_color(shape.facets, color), shape.lines, ink, width)


def _draw_open(axes: "Axes", scene: Scene) -> Any:
    """Draw networks and points, which have no surface; return what has the colours, None without any."""
    theirs, mine, paint = scene.theirs, scene.mine, scene.paint
    if theirs is not None and not len(theirs.facets):
        draw_lines(axes, theirs.points, theirs.lines, INK, 1.3, 3, "reference")
        if theirs.is_cloud:
            draw_dots(axes, theirs.points, 3, "reference", color=INK)
    if len(mine.facets):
        return None
    if mine.is_cloud:
        colors = {"color": BLUE} if paint is None else {"c": paint.values, **_style(paint)}
        return draw_dots(axes, mine.points, 4, "colors" if paint else "solution", **colors)
    if paint is not None:
        return draw_colored_lines(axes, scene, paint)
    draw_lines(axes, mine.points, mine.lines, BLUE, 1.0, 4, "solution")
    return None


def _style(paint: Paint) -> dict[str, Any]:
    return {"cmap": colors_of(paint), "norm": range_of(paint)}


def _mappable(paint: Paint) -> Any:
    from matplotlib.cm import ScalarMappable

    mappable = ScalarMappable(range_of(paint), colors_of(paint))
    mappable.set_array(paint.values)
    return mappable


def _painted(mesh: Mesh, shape: Shape, paint: Paint) -> Layer:
    """Return the surface in the colours of a paint."""
    shade: Any = colors_of(paint)
    norm: Any = range_of(paint)
    values = np.ma.masked_invalid(_on_corners(mesh, shape.facets, paint))
    colors = np.asarray(shade(norm(values))[..., :3])
    return solid(shape.points, shape.facets, colors, edges_of(shape.facets), INK, 0.35)


def _on_corners(mesh: Mesh, facets: Ints, paint: Paint) -> Floats:
    """Return the values at the corners of the facets, shape (n_facets, corners)."""
    if paint.on == "elements":
        owners = find_facets(mesh.elements, mesh.element, facets)[:, 0]
        return np.repeat(paint.values[owners][:, None], facets.shape[1], axis=1)
    return np.asarray(paint.values[facets])
