"""Shapes coloured by distance, in a fixed number of shades: one path per shade."""

import numpy as np

from truespring.arrays import Floats
from truespring.report.sheet import Area
from truespring.report.style import error_colors

# More shades than can be distinguished along a bar.
_SHADES = 48

# Radius of a dot [inch].
_DOT = 0.035


def draw_shaded(area: Area, shapes: Floats, shares: Floats) -> None:
    """Fill polygons, shape (n, corners, 2) in units of the area, in the colours of shares 0 to 1, shape (n,)."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    closed = np.concatenate([shapes, shapes[:, :1]], axis=1)
    codes = np.full(closed.shape[1], Path.LINETO, dtype=np.uint8)
    codes[0], codes[-1] = Path.MOVETO, Path.CLOSEPOLY
    shade = np.rint((_SHADES - 1) * shares).astype(np.int64)
    for one in np.unique(shade):
        (color,) = error_colors(np.array([one / (_SHADES - 1)]))
        alike = closed[shade == one]
        outline = Path(alike.reshape(-1, 2), np.tile(codes, len(alike)))
        area.add(PathPatch(outline, fc=color, ec=color, lw=0.3, zorder=3, gid="distance"))


def draw_shaded_dots(area: Area, places: Floats, shares: Floats) -> None:
    """Draw dots with a dark rim at `places`, shape (n, 2) in units of the area, in the colours of `shares`."""
    around = np.linspace(0, 2 * np.pi, 17)[:-1]
    ring = area.inch * np.stack([np.cos(around), np.sin(around)], axis=1)
    draw_shaded(area, places[:, None] + 1.35 * _DOT * ring, np.ones(len(places)))
    draw_shaded(area, places[:, None] + _DOT * ring, shares)
