"""Draw bodies in space into axes of matplotlib: an image, with outlines, triad and colour bar over it."""

from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh import Mesh
from truespring.mesh.facets import find_facets
from truespring.report.bodies3d import BODY, REFERENCE, one_color, solid, wires
from truespring.report.quantity import quantity
from truespring.report.render import Image, Layer, Shot, draw, render
from truespring.report.style import BLUE, INK
from truespring.report.surfaces import VIEW, edges_of
from truespring.report.touching import with_tools
from truespring.showing.paints import Paint
from truespring.showing.plane import draw_colored_lines, draw_dots, draw_lines, draw_rest
from truespring.showing.scales import add_bar, colors_of, range_of
from truespring.showing.scenes import Scene
from truespring.showing.shapes import Shape

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Resolution [pixels/inch] and width of the image [inch].
_DPI, _WIDTH = 200, 6.0
# Faces beyond this number are drawn by PyVista, whose process takes seconds to start.
_MANY_FACES = 20_000
_TRIAD = "#3d4248"


def draw_space(axes: "Axes", scene: Scene) -> None:
    """Draw a scene in space; the data of the axes are in metres, to the right and up in the picture plane."""
    low, high = scene.box
    arm = _arm(float((high - low).max()))
    low = low - np.array([0.0, 1.6 * arm])
    draw_rest(axes, scene)
    layers = with_tools(_layers(scene), scene.tools)
    if layers:
        pixels = round(_WIDTH * _DPI), round(_WIDTH * _DPI * float((high - low)[1] / (high - low)[0]))
        image = _image(Shot(layers, low, high, pixels, _DPI / 72), has_tools=bool(scene.tools))
        axes.imshow(image, extent=(low[0], high[0], low[1], high[1]), zorder=2, gid="image")
    drawn = _draw_open(axes, scene)
    axes.set_aspect("equal")
    axes.set_xlim(float(low[0]), float(high[0]))
    axes.set_ylim(float(low[1]), float(high[1]))
    axes.set_axis_off()
    _draw_triad(axes, low, arm)
    if scene.paint is not None:
        add_bar(axes, drawn or _mappable(scene.paint), scene.paint)


def _image(shot: Shot, has_tools: bool) -> Image:
    """Return the image: by matplotlib, which sorts faces by depth, or by PyVista if they are many or differ in size."""
    if not has_tools and sum(len(layer.faces) for layer in shot.layers) <= _MANY_FACES:
        return draw(shot)
    images, _ = render([shot])()
    return images[0]


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
    """Return the values at the corners of the facets, shape (n_facets, corners); of lines the means at their ends."""
    if paint.on == "elements":
        owners = find_facets(mesh.elements, mesh.element, facets)[:, 0]
        return np.repeat(paint.values[owners][:, None], facets.shape[1], axis=1)
    if paint.on == "nodes":
        return np.asarray(paint.values[facets])
    ends, values = paint.lines.ravel(), np.repeat(paint.values, 2)
    count = np.bincount(ends, minlength=mesh.n_nodes)
    return np.asarray((np.bincount(ends, values, mesh.n_nodes) / np.maximum(count, 1))[facets])


def _arm(size: float) -> float:
    """Return a round length for the arms of the triad [m]."""
    power = 10.0 ** np.floor(np.log10(0.12 * size))
    return float(max(digit * power for digit in (1, 2, 5) if digit * power <= 0.12 * size * (1 + 1e-9)))


def _draw_triad(axes: "Axes", low: Floats, arm: float) -> None:
    """Draw arms along x, y and z at the lower left, with their length."""
    tips = arm * VIEW[:2].T
    origin = low + 0.35 * arm - np.minimum(tips.min(axis=0), 0.0)
    for tip, name in zip(origin + tips, "xyz", strict=True):
        axes.annotate("", tip, origin, arrowprops={"arrowstyle": "->", "color": _TRIAD, "lw": 0.9})
        axes.annotate(name, origin + 1.25 * (tip - origin), ha="center", va="center", fontsize="small", color=_TRIAD)
    words = f"each {quantity(arm, 'm', 1)}"
    axes.annotate(words, origin + np.array([1.5 * arm, 0.0]), va="center", fontsize="x-small", color=_TRIAD)
