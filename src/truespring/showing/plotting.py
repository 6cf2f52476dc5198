"""Draw solutions into axes of matplotlib."""

from typing import TYPE_CHECKING

from truespring.errors import OutputError
from truespring.showing.frames import new_axes
from truespring.showing.levels import numbered
from truespring.showing.pairs import Pair, states_of_both
from truespring.showing.pictures import pictures_of, surface_picture
from truespring.solution import Solution

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_solution(
    solution: Solution,
    over: Solution | None,
    color: str | None,
    level: int,
    magnify: float | None,
    axes: "Axes | None",
) -> "Axes":
    """Draw a state of a solution into axes, see `Solution.plot`."""
    if hasattr(axes, "get_zlim"):
        raise OutputError(
            "ax has three axes: bodies in space are drawn as an image in plane ones: leave projection out"
        )
    pair = Pair(solution, over)
    if solution.states:
        state = numbered(states_of_both(pair), level, solution)
        (picture,) = pictures_of(pair, [state], color, magnify)
    elif over is None and color is None:
        picture = surface_picture(pair)
    else:
        raise OutputError(
            f"{solution.label} is a surface without displacements: draw it alone, or as the reference: plot(over=...)"
        )
    scene = picture.scene
    axes = new_axes(*scene.box, has_bar=scene.paint is not None) if axes is None else axes
    picture.draw(axes)
    return axes
