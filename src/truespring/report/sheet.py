"""Paper to draw on: matplotlib's artists and renderers without its figures and axes.

Those take longer to import and to make than all that is drawn with them here.
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

#: PNG files are this fine [pixels an inch].
DPI = 130


class Sheet:
    """Paper of a width and a height [inch]; its title tells what it shows to those who cannot see it.

    Artists are drawn by their zorder; `inches` are their transform, of places from the lower left corner on.
    """

    def __init__(self, width: float, height: float, title: str) -> None:
        from matplotlib.transforms import Affine2D

        self.width, self.height, self.title = width, height, title
        self.artists: list[Artist] = []
        self.areas: list[Area] = []
        self.inches = Affine2D()  # to the pixels of what is being drawn

    def add(self, artist: "Artist", to_inches: "Affine2D | None" = None) -> None:
        """Add an artist whose units are inches, or become inches by a transform."""
        artist.set_transform(self.inches if to_inches is None else to_inches + self.inches)
        self.artists.append(artist)

    def add_image(
        self, image: Any, left: float, bottom: float, width: float, height: float, zorder: float, name: str
    ) -> None:
        """Add an image, shape (rows, columns, 3 or 4), the upper row first, that fills a rectangle [inch]."""
        from matplotlib.image import BboxImage
        from matplotlib.transforms import Bbox, TransformedBbox

        place = TransformedBbox(Bbox.from_bounds(left, bottom, width, height), self.inches)
        drawn = BboxImage(place, data=image, origin="upper", resample=True, zorder=zorder, gid=name)
        self.artists.append(drawn)

    def pixels(self, dpi: float) -> NDArray[np.uint8]:
        """Return an image on white paper, shape (height, width, 4), the upper row first."""
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
        """Return the bytes of an SVG file: coordinates to a hundredth of a point, no comments, no indents."""
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
    """A part of a sheet with units of its own.

    Attributes:
        sheet: what it is a part of.
        left, bottom, width, height: its place on the sheet [inch].
        x, y: what its sides stand for, left and right, bottom and top.
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
        """Inches for each unit, along x and y."""
        return np.array([self.width / (self.x[1] - self.x[0]), self.height / (self.y[1] - self.y[0])])

    @property
    def inch(self) -> float:
        """An inch along x, in the area's units."""
        return (self.x[1] - self.x[0]) / self.width

    def place(self, points: Floats) -> Floats:
        """Return where points of the area, shape (..., 2), are on the sheet [inch]."""
        return np.asarray((points - (self.x[0], self.y[0])) * self._scale + (self.left, self.bottom))

    def add(self, artist: "Artist") -> None:
        """Add an artist in the area's units; of what lies outside nothing is seen, unless its clipping is off."""
        from matplotlib.transforms import Affine2D, Bbox, TransformedBbox

        box = Bbox.from_bounds(self.left, self.bottom, self.width, self.height)
        artist.set_clip_box(TransformedBbox(box, self.sheet.inches))
        to_inches = Affine2D().translate(-self.x[0], -self.y[0]).scale(*self._scale).translate(self.left, self.bottom)
        self.sheet.add(artist, to_inches)


def polygons(
    size: tuple[int, int], dpi: float, paper: str | None, corners: Floats, fills: Floats, edges: Floats, widths: Floats
) -> NDArray[np.uint8]:
    """Return an image of polygons, each over those before it, as `Sheet.pixels` does; on no paper it is transparent.

    Args:
        size: width and height [pixels].
        dpi: pixels an inch.
        paper: its colour, or none.
        corners: from the lower left corner on [pixels], shape (n, k, 2).
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
    for places, fill, edge, width in zip(closed, fills.tolist(), edges.tolist(), widths.tolist(), strict=True):
        pen.set_foreground(edge, isRGBA=True)
        pen.set_linewidth(width)
        renderer.draw_path(pen, Path(places, codes), here, fill if fill[3] else None)
    return np.array(renderer.buffer_rgba())


def _renderer(size: tuple[int, int], dpi: float, paper: str | None) -> Any:
    from matplotlib.backends.backend_agg import RendererAgg
    from matplotlib.patches import Rectangle

    renderer: Any = RendererAgg(*size, dpi)  # type: ignore[no-untyped-call]
    if paper is not None:
        Rectangle((0, 0), *size, fc=paper, lw=0).draw(renderer)
    return renderer
