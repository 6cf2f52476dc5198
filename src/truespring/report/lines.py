"""Lines on a sheet, all in one path, which is fast and one element of an SVG; and arrows."""

from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.report.sheet import Area, Sheet
from truespring.report.style import POINT


def draw_lines(on: Sheet | Area, ends: Floats, color: str, width: float, zorder: float, name: str, **more: Any) -> None:
    """Draw lines between `ends`, shape (n, 2, 2), of a width [points]; `name` is their id in an SVG."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    codes = np.tile(np.array([Path.MOVETO, Path.LINETO], dtype=np.uint8), len(ends))
    path = Path(ends.reshape(-1, 2), codes)
    on.add(PathPatch(path, fill=False, edgecolor=color, lw=width, zorder=zorder, gid=name, **more))


def draw_arrow(sheet: Sheet, tail: Floats, tip: Floats, color: str, width: float, head: float) -> None:
    """Draw an arrow between two points [inch], with line width and length of the head [points]."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    along = (tip - tail) / np.linalg.norm(tip - tail) * head * POINT
    across = 0.56 * np.array([-along[1], along[0]])
    places = [tail, tip - along, tip, tip - along + across, tip - along - across, tip]
    codes = [Path.MOVETO, Path.LINETO, Path.MOVETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    style: dict[str, Any] = {"joinstyle": "miter", "zorder": 9, "gid": "arrow"}
    sheet.add(PathPatch(Path(np.array(places), codes), fc=color, ec=color, lw=width, **style))
