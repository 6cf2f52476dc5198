"""Bodies in 3D as images: by PyVista in a child process, or by matplotlib if PyVista is not available.

Both take the same faces, coloured and lit beforehand, and the same lines, and remove hidden parts.
"""

import importlib.util
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats, Ints
from truespring.report.sheet import polygons

#: An image: red, green, blue and opacity in 0 ... 255, shape (height, width, 4), the upper row first.
Image = NDArray[np.uint8]

# Time limit of the child process [s], and more for each image; software rendering is slow.
_PATIENCE, _PATIENCE_EACH = 60.0, 20.0


@dataclass(frozen=True, eq=False, slots=True)
class Layer:
    """Faces, and lines that are hidden behind nearer faces; faces without colours are not drawn.

    All coordinates are those of `surfaces.seen`.

    Attributes:
        faces: their corners [m], shape (n_faces, 3 or 4, 3).
        colors: of every corner, 0 ... 1, shape (n_faces, 3 or 4, 3); None if faces only hide lines.
        lines: their ends [m], shape (n_lines, 2, 3).
        owners: the two faces that each line lies on, shape (n_lines, 2); empty if lines lie on no face.
        ink: the colour of the lines, #rrggbb.
        width: of the lines [points].
    """

    faces: Floats
    colors: Floats | None
    lines: Floats
    owners: Ints
    ink: str
    width: float


@dataclass(frozen=True, eq=False, slots=True)
class Shot:
    """The content of one image.

    Attributes:
        layers: drawn in order, each over those before it.
        lower, upper: the corners of the image, right and up [m], shape (2,).
        size: width and height [pixels].
        points: the size of a typographical point [pixels].
    """

    layers: tuple[Layer, ...]
    lower: Floats
    upper: Floats
    size: tuple[int, int]
    points: float


def render(shots: Sequence[Shot]) -> Callable[[], tuple[list[Image], str]]:
    """Start rendering in the background; return a function that waits for the image of each shot.

    Its second value is empty, or states why PyVista did not draw the images and how to change that.
    """
    pool = ThreadPoolExecutor(1)  # only waits for the child process: matplotlib is not thread-safe
    answer = pool.submit(_by_child, shots)
    pool.shutdown(wait=False)

    def images() -> tuple[list[Image], str]:
        found, why = answer.result()
        if found is not None:
            return found, ""
        return [draw(shot) for shot in shots], f"Pictures in 3D are drawn by matplotlib, less accurately: {why}."

    return images


def _command(job: Path, answer: Path) -> list[str]:
    """Return the command of the child process; -P keeps Python from importing files of the current folder."""
    return [sys.executable, "-P", "-m", "truespring.report.offscreen", str(job), str(answer)]


def _by_child(shots: Sequence[Shot]) -> tuple[list[Image] | None, str]:
    """Render in a child process, so that a graphics library that crashes or hangs does not end this one."""
    if importlib.util.find_spec("pyvista") is None:
        return None, "PyVista is not installed: pip install 'truespring[3d]'"
    patience = _PATIENCE + _PATIENCE_EACH * len(shots)
    with tempfile.TemporaryDirectory(prefix="truespring-") as folder:
        job, answer = Path(folder) / "job.npz", Path(folder) / "images.npz"
        write_job(shots, job)
        try:
            done = subprocess.run(
                _command(job, answer), stdin=subprocess.DEVNULL, capture_output=True, timeout=patience, check=False
            )
        except subprocess.TimeoutExpired:
            return None, f"PyVista's process took more than {patience:.0f} s"
        except OSError as error:
            return None, f"PyVista's process could not be started ({error})"
        if done.returncode or not answer.exists():
            return None, f"PyVista's process {_ending(done.returncode, done.stderr)}; {_NEEDS}"
        with np.load(answer) as file:
            images = [file[f"image_{number}"] for number in range(len(shots))]
        if not all(image[..., 3].any() for image in images):
            return None, f"PyVista drew nothing; {_NEEDS}"
        return images, ""


_NEEDS = "on Linux it needs a display, or libegl1 and libgl1-mesa-dri"


def _ending(code: int, output: bytes) -> str:
    """Return how a process ended, with the last line of its output."""
    lines = re.sub(r"\x1b\[[\d;]*m", "", output.decode(errors="replace")).strip().splitlines()
    last = lines[-1].split("| ")[-1].strip()[:160].rstrip(".") if lines else ""
    ended = f"was ended by signal {-code}" if code < 0 else f"failed (exit code {code})"
    return f"{ended}: {last}" if last else ended


def write_job(shots: Sequence[Shot], file: Path) -> None:
    """Write shots to an .npz file."""
    arrays: dict[str, Any] = {}
    words = []
    for number, shot in enumerate(shots):
        arrays[f"{number}_box"] = np.stack([shot.lower, shot.upper])
        layers = [{"ink": one.ink, "width": one.width, "filled": one.colors is not None} for one in shot.layers]
        words.append({"size": shot.size, "points": shot.points, "layers": layers})
        for place, layer in enumerate(shot.layers):
            for name in ("faces", "colors", "lines", "owners"):
                values = getattr(layer, name)
                arrays[f"{number}_{place}_{name}"] = np.zeros(0) if values is None else values
    np.savez(file, words=np.array(json.dumps(words)), **arrays)


def read_job(file: Path) -> list[Shot]:
    """Return the shots of a file from `write_job`."""
    with np.load(file) as job:
        return [
            Shot(
                layers=tuple(
                    Layer(
                        job[f"{number}_{place}_faces"],
                        job[f"{number}_{place}_colors"] if layer["filled"] else None,
                        job[f"{number}_{place}_lines"],
                        job[f"{number}_{place}_owners"],
                        layer["ink"],
                        layer["width"],
                    )
                    for place, layer in enumerate(shot["layers"])
                ),
                lower=job[f"{number}_box"][0],
                upper=job[f"{number}_box"][1],
                size=tuple(shot["size"]),
                points=shot["points"],
            )
            for number, shot in enumerate(json.loads(str(job["words"])))
        ]


def rgb(color: str) -> Floats:
    """Return red, green and blue [-], 0 to 1, of a colour #rrggbb, shape (3,)."""
    return np.array([int(color[start : start + 2], 16) for start in (1, 3, 5)]) / 255


def inked(coverage: Image, ink: str) -> Image:
    """Return an image of one colour with an opacity 0 ... 255 for each pixel."""
    image = np.empty((*coverage.shape, 4), dtype=np.uint8)
    image[..., :3] = np.rint(255 * rgb(ink))
    image[..., 3] = coverage
    return image


def stacked(images: Sequence[Image]) -> Image:
    """Return images composed into one, each over those before it."""
    whole = images[0].copy()
    for image in images[1:]:
        drawn = image[..., 3] > 0  # often a small part of the image
        above, below = image[drawn] / 255, whole[drawn] / 255
        share, rest = above[:, 3:], (1 - above[:, 3:]) * below[:, 3:]
        opacity = share + rest
        color = (share * above[:, :3] + rest * below[:, :3]) / opacity
        whole[drawn] = np.rint(255 * np.concatenate([color, opacity], axis=1))
    return whole


def draw(shot: Shot) -> Image:
    """Return a shot drawn by matplotlib, far faces first, each face in one colour."""
    return stacked([_draw_layer(layer, shot) for layer in shot.layers])


def _draw_layer(layer: Layer, shot: Shot) -> Image:
    filled = layer.colors is not None
    n_faces, k = layer.faces.shape[:2]
    depth = layer.faces[:, :, 2].mean(axis=1)
    # Draw a line after the faces it lies on; it is a degenerate polygon, so that both are sorted together.
    near = depth[layer.owners].max(axis=1) if len(layer.owners) else layer.lines[:, :, 2].mean(axis=1)
    strokes = layer.lines[:, [0] + [1] * (k - 1)]
    corners = np.concatenate([layer.faces, strokes])[:, :, :2]
    order = np.lexsort((np.arange(len(corners)) >= n_faces, np.concatenate([depth, near])))
    if layer.colors is not None:
        fill, line = layer.colors.mean(axis=1), rgb(layer.ink)
    else:
        fill, line = np.zeros((n_faces, 3)), np.ones(3)
    fills = np.concatenate([np.column_stack([fill, np.ones(n_faces)]), np.zeros((len(strokes), 4))])
    edges = np.concatenate([fill, np.broadcast_to(line, (len(strokes), 3))])
    edges = np.column_stack([edges, np.ones(len(edges))])
    widths = np.concatenate([np.full(n_faces, 0.4), np.full(len(strokes), layer.width)])
    corners = (corners - shot.lower) / (shot.upper - shot.lower) * shot.size
    drawn = (corners[order], fills[order], edges[order], widths[order])
    image = polygons(shot.size, 72 * shot.points, None if filled else "black", *drawn)
    return image if filled else inked(image[..., 0], layer.ink)
