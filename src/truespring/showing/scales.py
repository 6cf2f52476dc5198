"""Numbers and colours of axes: data stay in SI units, numbers are written in a unit that fits."""

from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.report.quantity import natural_scale
from truespring.report.style import error_colors
from truespring.showing.paints import Paint

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap, Normalize
    from matplotlib.ticker import FuncFormatter


def formatter(size: float) -> "FuncFormatter":
    """Return a formatter of values in SI as numbers of a unit of a size."""
    from matplotlib.ticker import FuncFormatter

    def written(value: float, place: int | None = None) -> str:
        return f"{value / size + 0.0:.6g}".replace("-", "\N{MINUS SIGN}")

    return FuncFormatter(written)


def colors_of(paint: Paint) -> "Colormap":
    """Return the colours of a paint; NaN is drawn in grey."""
    import matplotlib
    from matplotlib.colors import ListedColormap

    distance = ListedColormap(error_colors(np.linspace(0, 1, 256)), name="distance")
    colors = distance if paint.colors == "distance" else matplotlib.colormaps[paint.colors]
    return colors.with_extremes(bad="#d5d9dd")


def range_of(paint: Paint) -> "Normalize":
    """Return the range of the colours."""
    from matplotlib.colors import Normalize

    return Normalize(*paint.limits)


def add_bar(axes: "Axes", drawn: Any, paint: Paint) -> None:
    """Add a colour bar as high as the axes, with the name of the quantity and its unit."""
    scale = natural_scale(float(np.abs(paint.limits).max()), paint.unit)
    figure: Any = axes.figure
    bar = figure.colorbar(drawn, cax=axes.inset_axes((1.03, 0.0, 0.03, 1.0)), format=formatter(scale.size))
    bar.set_label(paint.label if scale.unit == "-" else f"{paint.label} [{scale.unit}]")
    bar.outline.set_linewidth(0.5)
