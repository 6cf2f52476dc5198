"""Sheets to draw on: matplotlib's artists and renderers without its figures and axes.

Importing and creating those takes longer than drawing the figures of this package.
"""

import io
import re
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.transforms import Affine2D

#: Resolution of PNG files [pixels/inch].
DPI = 130


class Sheet:
    """A sheet with width and height [inch] and a title, which is its alternative text.

    Artists are drawn in the order of their zorder; `inches` transforms places [inch] from the lower left corner.
    """

    def __init__(self, width: float, height: float, title: str) -> None:
        from matplotlib.transforms import Affine2D

        self.width, self.height, self.title = width, height, title
        self.artists: list[Artist] = []
        self.areas: list[Area] = []
        self.inches = Affine2D()  # to pixels; set while drawing

    def add(self, artist: "Artist", to_inches: "Affine2D | None" = None) -> None:
        """Add an artist in inches, or in units that `to_inches` transforms."""
        artist.set_transform(self.inches if to_inches is None else to_inches + self.inches)
        self.artists.append(artist)

    def add_image(
        self, image: Any, left: float, bottom: float, width: float, height: float, zorder: float, name: str
    ) -> None:
        """Add an image, shape (rows, columns, 3 or 4), upper row first, that fills a rectangle [inch]."""
        from matplotlib.image import BboxImage
        from matplotlib.transforms import Bbox, TransformedBbox

        place = TransformedBbox(Bbox.from_bounds(left, bottom, width, height), self.inches)
        drawn = BboxImage(place, data=image, origin="upper", resample=True, zorder=zorder, gid=name)
        self.artists.append(drawn)

    def pixels(self, dpi: float) -> NDArray[np.uint8]:
        """Return an image on a white background, shape (height, width, 4), upper row first."""
        renderer = _renderer((round(self.width * dpi), round(self.height * dpi)), dpi, "white")
        self._draw(renderer, dpi)
        return np.array(renderer.buffer_rgba())

    def png(self) -> bytes:
        """Return the bytes of a PNG file."""
        from PIL import Image

        file = io.BytesIO()
        Image.fromarray(self.pixels(DPI)[..., :3]).save(file, format="png", compress_level=1, dpi=(DPI, DPI))
        return file.getvalue()

    def svg(self) -> bytes:
        """Return the bytes of an SVG file: coordinates to 0.01 points, without comments and indents."""
        from matplotlib.backends.backend_svg import RendererSVG

        file = io.StringIO()
        size = 72 * self.width, 72 * self.height
        renderer: Any = RendererSVG(*size, file, image_dpi=DPI, metadata={"Date": None})  # type: ignore[no-untyped-call]
        self._draw(renderer, 72)
        renderer.finalize()
        text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", file.getvalue(), flags=re.DOTALL)
        text = re.sub(r"(?<=\.\d\d)\d+", "", text)
        return re.sub(r"\s*\n\s*", "\n", text).encode()

    def _draw(self, renderer: Any, dpi: float) -> None:
        self.inches.clear().scale(dpi)
        for artist in sorted(self.artists, key=lambda artist: artist.get_zorder()):
            artist.draw(renderer)


@dataclass(frozen=True, eq=False)
class Area:
    """A rectangle of a sheet with its own coordinates.

    Attributes:
        sheet: the sheet.
        left, bottom, width, height: the rectangle [inch].
        x, y: coordinates of the left and right, and of the bottom and top side.
    """

    sheet: Sheet
    left: float
    bottom: float
    width: float
    height: float
    x: tuple[float, float]
    y: tuple[float, float]

    def __post_init__(self) -> None:
        self.sheet.areas.append(self)

    @cached_property
    def _scale(self) -> Floats:
        """Inches per unit along x and y, shape (2,)."""
        return np.array([self.width / (self.x[1] - self.x[0]), self.height / (self.y[1] - self.y[0])])

    @property
    def inch(self) -> float:
        """One inch along x in units of the area."""
        return (self.x[1] - self.x[0]) / self.width

    def place(self, points: Floats) -> Floats:
        """Return the places on the sheet [inch] of points in units of the area, shape (..., 2)."""
        return np.asarray((points - (self.x[0], self.y[0])) * self._scale + (self.left, self.bottom))

    def add(self, artist: "Artist") -> None:
        """Add an artist in units of the area, clipped at its sides unless the artist's clipping is off."""
        from matplotlib.transforms import Affine2D, Bbox, TransformedBbox

        box = Bbox.from_bounds(self.left, self.bottom, self.width, self.height)
        artist.set_clip_box(TransformedBbox(box, self.sheet.inches))
        to_inches = Affine2D().translate(-self.x[0], -self.y[0]).scale(*self._scale).translate(self.left, self.bottom)
        self.sheet.add(artist, to_inches)


def polygons(
    size: tuple[int, int], dpi: float, paper: str | None, corners: Floats, fills: Floats, edges: Floats, widths: Floats
) -> NDArray[np.uint8]:
    """Return an image of polygons, each over those before it, shape (height, width, 4), upper row first.

    Args:
        size: width and height [pixels].
        dpi: pixels per inch.
        paper: colour of the background; None is transparent.
        corners: from the lower left corner [pixels], shape (n, k, 2).
        fills, edges: red, green, blue and opacity, shape (n, 4).
        widths: of the edges [points], shape (n,).
    """
    from matplotlib.path import Path
    from matplotlib.transforms import IdentityTransform

    renderer = _renderer(size, dpi, paper)
    closed = np.concatenate([corners, corners[:, :1]], axis=1)
    codes = np.array([Path.MOVETO] + [Path.LINETO] * (corners.shape[1] - 1) + [Path.CLOSEPOLY], dtype=np.uint8)
    here = IdentityTransform()
    pen = renderer.new_gc()
    pen.set_joinstyle("round")
    paths = [Path(places, codes) for places in closed]
    placing = (np.empty((0, 3, 3)), np.zeros((1, 2)), here)  # no other transformations and offsets
    solid = ([(0, None)], [True], [None], "screen")
    renderer.draw_path_collection(pen, here, paths, *placing, fills, edges, widths, *solid)
    return np.array(renderer.buffer_rgba())


def _renderer(size: tuple[int, int], dpi: float, paper: str | None) -> Any:
    from matplotlib.backends.backend_agg import RendererAgg
    from matplotlib.patches import Rectangle

    renderer: Any = RendererAgg(*size, dpi)  # type: ignore[no-untyped-call]
    if paper is not None:
        Rectangle((0, 0), *size, fc=paper, lw=0).draw(renderer)
    return renderer
