"""Animations of solutions."""

import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats
from truespring.errors import OutputError, one_line
from truespring.outputs import writing_file
from truespring.report.animation import FRAMES, common_colors, frames_of, whole_reel, write_gif, write_mp4
from truespring.showing.frames import figure_size
from truespring.showing.paints import Paint
from truespring.showing.pairs import Pair, states_of_both
from truespring.showing.pictures import Picture, pictures_of
from truespring.showing.scales import colors_of
from truespring.solution import Solution

_SUFFIXES = (".gif", ".mp4")
# Resolution [pixels/inch]; number of colours of a GIF beside those of lines.
_DPI, _COLORS = 80, 200

_Frames = list[NDArray[np.uint8]]


def animate(solution: Solution, file: Path, over: Solution | None, color: str | None) -> Path:
    """Write an animation, see `Solution.animate`."""
    suffix = file.suffix.lower()
    if suffix not in _SUFFIXES:
        raise OutputError(f"{file}: the suffix of an animation is {' or '.join(_SUFFIXES)}, not '{suffix}'")
    if suffix == ".mp4" and importlib.util.find_spec("imageio_ffmpeg") is None:
        raise OutputError(f"{file}: MP4 needs imageio-ffmpeg: pip install 'truespring[video]', or write a .gif")
    pair = Pair(solution, over)
    states_of_both(pair)  # an error if they cannot be drawn together
    frames, colors = _frames(pair) if color is None else _colored_frames(pair, color)
    if len(frames) < 2:
        who = f"{solution.label} has" if over is None else f"{solution.label} and {over.label} both have"
        raise OutputError(f"{file}: an animation needs two load levels or more that {who}")
    with writing_file(file):
        file.parent.mkdir(parents=True, exist_ok=True)
        if suffix == ".gif":
            write_gif(frames, file, colors)
            return file
    try:
        write_mp4(frames, file)
    except (OSError, RuntimeError) as error:  # its program ffmpeg is missing, or failed
        file.unlink(missing_ok=True)
        raise OutputError(f"{file}: ffmpeg failed: {one_line(str(error))}") from None
    return file


def _frames(pair: Pair) -> tuple[_Frames, Floats]:
    """Return the frames of a report, springs in blue over a reference in black, and the colours of their palette."""
    reel = whole_reel(pair.result)
    if reel is None:
        return [], np.zeros((0, 3))
    frames = frames_of(reel)
    return frames, common_colors(reel, frames)


def _colored_frames(pair: Pair, color: str) -> tuple[_Frames, Floats]:
    """Return frames in colours, the same for the same values, at most FRAMES of them; and the colours."""
    states = [state for state in states_of_both(pair) if state.level is not None]
    if not states:
        return [], np.zeros((0, 3))
    chosen = np.unique(np.rint(np.linspace(0, len(states) - 1, min(FRAMES, len(states)))).astype(int))
    pictures = pictures_of(pair, [states[number] for number in chosen], color, None)
    return _drawn(pictures), np.concatenate([_palette(one.scene.paint) for one in pictures[:1] if one.scene.paint])


def _palette(paint: Paint) -> Floats:
    """Return the colours of a paint in the light and in the shade [-], shape (n, 3)."""
    shade: Any = colors_of(paint)
    bright = np.asarray(shade(np.linspace(0, 1, _COLORS // 2)))[:, :3]
    return np.concatenate([bright, 0.88 * bright])


def _drawn(pictures: Sequence[Picture]) -> _Frames:
    """Return the images of pictures, shape (height, width, 3), with even numbers of pixels."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    scene = pictures[0].scene
    figure = Figure(figsize=figure_size(*scene.box, scene.paint is not None), dpi=_DPI, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    frames = []
    for picture in pictures:
        figure.clear()
        picture.draw(figure.subplots())
        canvas.draw()
        pixels = np.asarray(canvas.buffer_rgba())[..., :3]
        height, width = (length - length % 2 for length in pixels.shape[:2])
        frames.append(np.ascontiguousarray(pixels[:height, :width]))
    return frames
