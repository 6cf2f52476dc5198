"""Animations of solutions."""

import importlib.util
from pathlib import Path

from truespring.errors import OutputError, one_line
from truespring.report.animation import frames_of, whole_reel, write_gif, write_mp4
from truespring.showing.pairs import result_of
from truespring.solution import Solution

_SUFFIXES = (".gif", ".mp4")


def animate(solution: Solution, file: Path, over: Solution | None) -> Path:
    """Write an animation, see `Solution.animate`."""
    suffix = file.suffix.lower()
    if suffix not in _SUFFIXES:
        raise OutputError(f"{file}: the suffix of an animation is {' or '.join(_SUFFIXES)}, not '{suffix}'")
    if suffix == ".mp4" and importlib.util.find_spec("imageio_ffmpeg") is None:
        raise OutputError(f"{file}: MP4 needs imageio-ffmpeg: pip install 'truespring[video]', or write a .gif")
    reel = whole_reel(result_of(solution, over))
    if reel is None:
        raise OutputError(f"{file}: an animation needs two load levels or more, {solution.label} has fewer")
    frames = frames_of(reel)
    file.parent.mkdir(parents=True, exist_ok=True)
    if suffix == ".gif":
        write_gif(reel, frames, file)
        return file
    try:
        write_mp4(frames, file)
    except (OSError, RuntimeError) as error:  # its program ffmpeg is missing, or failed
        file.unlink(missing_ok=True)
        raise OutputError(f"{file}: ffmpeg failed: {one_line(str(error))}") from None
    return file
