"""The child process that draws bodies in 3D by PyVista: offscreen JOB.npz IMAGES.npz."""

import os
import sys
from pathlib import Path
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.report.render import Image, Layer, Shot, inked, read_job, stacked

# Images are drawn larger by this factor and averaged, which smooths lines on every graphics library.
_FINER = 2

# Lines are drawn nearer to the viewer than the faces they lie on, by this share of the picture's size.
_LIFT = 1.5e-3


def main(job: str, answer: str) -> None:
    """Draw every shot of a job into an .npz file of images."""
    if sys.platform == "linux":  # else VTK warns that there is no display before it uses EGL
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    images = [stacked([_draw_layer(layer, shot) for layer in shot.layers]) for shot in read_job(Path(job))]
    named: dict[str, Any] = {f"image_{number}": image for number, image in enumerate(images)}
    np.savez(answer, **named)


def _draw_layer(layer: Layer, shot: Shot) -> Image:
    """Return the image of a layer; faces without colours are black and lines white, as a mask of the lines."""
    import pyvista

    filled = layer.colors is not None
    plotter: Any = pyvista.Plotter(
        off_screen=True, window_size=[_FINER * pixels for pixels in shot.size], lighting="none"
    )
    plotter.disable_anti_aliasing()
    plotter.set_background("white" if filled else "black")
    if len(layer.faces):
        faces = _polygons(layer.faces)
        if layer.colors is not None:
            faces.point_data["rgb"] = np.rint(255 * layer.colors.reshape(-1, 3)).astype(np.uint8)
            plotter.add_mesh(faces, scalars="rgb", rgb=True, lighting=False)
        else:
            plotter.add_mesh(faces, color="black", lighting=False)
    if len(layer.lines):
        lift = _LIFT * float((shot.upper - shot.lower).max()) * np.array([0.0, 0.0, 1.0])
        ink = layer.ink if filled else "white"
        width = _FINER * shot.points * layer.width
        plotter.add_mesh(_strokes(layer.lines + lift), color=ink, line_width=width, lighting=False)
    _look(plotter, layer, shot)
    picture = np.asarray(plotter.screenshot(return_img=True, transparent_background=filled))
    plotter.close()
    return _coarser(picture) if filled else inked(_coarser(picture[..., 0]), layer.ink)


def _polygons(corners: Floats) -> Any:
    import pyvista

    n_faces, k = corners.shape[:2]
    numbers = np.column_stack([np.full(n_faces, k), np.arange(n_faces * k).reshape(n_faces, k)])
    return pyvista.PolyData(corners.reshape(-1, 3), faces=numbers.ravel())


def _strokes(ends: Floats) -> Any:
    import pyvista

    numbers = np.column_stack([np.full(len(ends), 2), np.arange(2 * len(ends)).reshape(-1, 2)])
    return pyvista.PolyData(ends.reshape(-1, 3), lines=numbers.ravel())


def _look(plotter: Any, layer: Layer, shot: Shot) -> None:
    """Set a parallel camera that looks along the third axis at the box of the shot."""
    width, height = shot.upper - shot.lower
    room = 3 * max(width, height)  # in front of and behind what is in the box; parts far away are clipped
    points = np.concatenate([layer.faces.reshape(-1, 3), layer.lines.reshape(-1, 3)])
    shown = ((points[:, :2] >= shot.lower) & (points[:, :2] <= shot.upper)).all(axis=1)
    depths = points[shown, 2] if shown.any() else np.zeros(1)
    front, back = float(depths.max()), float(depths.min())
    middle = [*(shot.lower + shot.upper) / 2]
    plotter.enable_parallel_projection()
    plotter.camera.focal_point = (*middle, back)
    plotter.camera.position = (*middle, front + 2 * room)
    plotter.camera.up = (0.0, 1.0, 0.0)
    plotter.camera.parallel_scale = float(height) / 2
    plotter.camera.clipping_range = (room, front - back + 3 * room)


def _coarser(picture: Any) -> Image:
    """Return an image averaged over blocks of pixels."""
    total = np.zeros_like(picture[::_FINER, ::_FINER], dtype=np.uint16)
    for row, column in np.ndindex(_FINER, _FINER):
        total += picture[row::_FINER, column::_FINER]
    return (total // _FINER**2).astype(np.uint8)


if __name__ == "__main__":
    main(*sys.argv[1:])
