"""animation.gif and animation.mp4: the model over a reference, frame by frame."""

import importlib.util
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats
from truespring.errors import one_line
from truespring.report.frame import EDGE
from truespring.report.reel import Reel, reel_of, sheet_of, shots, shown_reference
from truespring.report.render import Shot, render, rgb
from truespring.report.result import Result
from truespring.report.style import BLUE, FAINT, INK, LOAD, MOTION, RED, figure_style

if TYPE_CHECKING:
    from PIL import Image

# Opacities of lines in a GIF, whose edges fade, and number of its further colours, in the plane and in space.
_SHADES, _COLORS = (1.0, 0.65, 0.3), {2: 8, 3: 32}
# Frames, resolution [pixels/inch], duration of all frames [s], shortest and longest of a frame [ms].
FRAMES, _DPI, _LASTS, _SHORTEST, _LONGEST = 60, 80, 4.0, 40, 400

# Colours beyond this in red, green and blue are white.
_ALMOST_WHITE = 0.97

# Largest size of the bodies in space that are rendered at once [bytes].
_MOST = 200_000_000

#: What is missing for animation.mp4.
NO_VIDEO = "no animation.mp4: it needs imageio-ffmpeg: pip install 'truespring[video]'"


def write_animation(result: Result, folder: Path) -> str:
    """Write animation.gif, and animation.mp4 if imageio-ffmpeg is installed; return a note on what is missing.

    Frames show the recorded states, at most FRAMES of them.
    """
    reel = whole_reel(result)
    if reel is None:
        return "no animation: fewer than two levels are known"
    frames = frames_of(reel)
    write_gif(frames, folder / "animation.gif", common_colors(reel, frames))
    if importlib.util.find_spec("imageio_ffmpeg") is None:
        return NO_VIDEO
    film = folder / "animation.mp4"
    try:
        write_mp4(frames, film)
    except (OSError, RuntimeError) as error:  # its program ffmpeg is missing, or failed
        film.unlink(missing_ok=True)
        return f"no animation.mp4: ffmpeg failed: {one_line(str(error))}"
    return ""


def whole_reel(result: Result) -> Reel | None:
    """Return the instants of an animation from rest; None if fewer than two levels are known."""
    return reel_of(result, shown_reference(result), FRAMES, from_rest=True)


def frames_of(reel: Reel) -> list[NDArray[np.uint8]]:
    """Return the frames, shape (height, width, 3) each, all of one size with even numbers of pixels."""
    each = _size(shots(reel, 1, reel.levels[:1], _DPI))
    many = max(1, _MOST // each) if each else len(reel.levels)
    with figure_style():
        return [
            frame
            for start in range(0, len(reel.levels), many)
            for frame in _drawn(reel, reel.levels[start : start + many])
        ]


def _size(several: Sequence[Shot]) -> int:
    """Return the size of jobs [bytes]."""
    return sum(layer.faces.nbytes + layer.lines.nbytes for shot in several for layer in shot.layers)


def _drawn(reel: Reel, levels: Sequence[float]) -> Iterator[NDArray[np.uint8]]:
    jobs = shots(reel, 1, levels, _DPI)
    images = render(jobs)()[0] if jobs else []
    for number, level in enumerate(levels):
        pixels = sheet_of(reel, [level], images[number : number + 1], "").pixels(_DPI)[..., :3]
        height, width = (length - length % 2 for length in pixels.shape[:2])
        yield np.ascontiguousarray(pixels[:height, :width])


def _pause(n_frames: int) -> int:
    """Return how long a frame is shown [ms]."""
    return int(np.clip(1000 * _LASTS / n_frames, _SHORTEST, _LONGEST)) // 10 * 10  # a GIF counts 10 ms


def common_colors(reel: Reel, frames: list[NDArray[np.uint8]]) -> Floats:
    """Return the commonest colours of a reel [-], 0 to 1, shape (n, 3), beside those of lines."""
    from PIL import Image

    n_colors = _COLORS[reel.mesh.dim]
    middle = Image.fromarray(frames[len(frames) // 2])
    listed = middle.quantize(n_colors, dither=Image.Dither.NONE).getpalette() or []
    found = np.array(listed[: 3 * n_colors]).reshape(-1, 3) / 255
    return np.asarray(found[found.min(axis=1) < _ALMOST_WHITE])  # Pillow would take them for the white of the paper


def write_gif(frames: list[NDArray[np.uint8]], file: Path, colors: Floats) -> None:
    """Write frames as GIF; the last one stays longer. `colors`, shape (n, 3), are kept, and those of lines."""
    from PIL import Image

    pause = _pause(len(frames))
    palette = _palette(colors)
    first, *others = [Image.fromarray(one).quantize(palette=palette, dither=Image.Dither.NONE) for one in frames]
    pauses = [pause] * (len(frames) - 1) + [max(pause, 800)]
    first.save(file, save_all=True, append_images=others, duration=pauses, loop=0, optimize=True)


def _palette(colors: Floats) -> "Image.Image":
    """Return one palette for all frames: colours of lines, fading to white, and others [-], shape (n, 3)."""
    from PIL import Image

    lines = np.array([255 * rgb(color) for color in (INK, BLUE, RED, LOAD, MOTION, FAINT, EDGE)])
    faded = [255 - share * (255 - lines) for share in _SHADES]
    palette = Image.new("P", (1, 1))
    listed = np.concatenate([np.full(3, 255), np.ravel(faded), 255 * colors.ravel()])
    palette.putpalette(np.rint(listed).astype(int).tolist())
    return palette


def write_mp4(frames: list[NDArray[np.uint8]], file: Path) -> None:
    """Write frames as MP4; imageio-ffmpeg must be installed, its errors are OSError and RuntimeError."""
    import imageio_ffmpeg

    height, width = frames[0].shape[:2]
    writer = imageio_ffmpeg.write_frames(
        str(file), (width, height), fps=1000 / _pause(len(frames)), codec="libx264", quality=7, macro_block_size=2
    )
    writer.send(None)
    for one in frames:
        writer.send(one.tobytes())
    writer.close()
