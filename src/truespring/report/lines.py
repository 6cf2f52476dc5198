"""Many lines as one path: fast to draw, and one element of an SVG however many they are."""

from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_lines(axes: "Axes", ends: Floats, color: str, width: float, zorder: float, name: str, **more: Any) -> None:
    """Draw lines between `ends`, shape (n, 2, 2), in units of the axes unless `more` has a transform; width [points].

    `name` is how the path is called in the SVG.
    """
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    codes = np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=np.uint8), len(ends))
    path = Path(ends.reshape(-1, 2), codes)
    # Not add_patch, which measures every line to find limits that are already set.
    axes.add_artist(PathPatch(path, fill=False, edgecolor=color, lw=width, zorder=zorder, gid=name, **more))
