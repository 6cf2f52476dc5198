"""Pictures of problems: the undeformed body with supports, loads and tools, as in reports."""

from typing import TYPE_CHECKING

from truespring.models import Model, as_model
from truespring.potential import Potential
from truespring.problem import Problem
from truespring.report.bodies import undeformed_figure
from truespring.report.bodies3d import undeformed_picture
from truespring.report.frame3d import figure_of, shot
from truespring.report.sheet import Sheet
from truespring.report.style import figure_style
from truespring.report.undeformed import Undeformed, spring_lines
from truespring.showing.frames import image_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Resolution [pixels/inch].
_DPI = 200


def plot_problem(problem: Problem, model: "Model | Potential | None", axes: "Axes | None") -> "Axes":
    """Draw a problem into axes, see `Problem.plot`."""
    from matplotlib import pyplot

    with figure_style():
        sheet = undeformed_sheet(problem, model)
        image = sheet.pixels(_DPI)
    if axes is None:
        _, axes = pyplot.subplots(figsize=(sheet.width, sheet.height), layout="constrained")
    axes.imshow(image, gid="image", interpolation="antialiased")
    axes.set_axis_off()
    return axes


def undeformed_sheet(problem: Problem, model: "Model | Potential | None") -> Sheet:
    """Return the picture of a problem, with the springs of a model."""
    springs = None if model is None else spring_lines(as_model(model).potential(problem))
    body = Undeformed(problem, None, springs)
    if problem.mesh.dim == 2:
        return undeformed_figure(body)
    picture = undeformed_picture(body)
    return figure_of(picture, image_of(shot(picture), accurate=bool(problem.tools)))
