"""The figures of a study: springs over FEM, curves, errors and moduli, as PNG and SVG.

Matplotlib's objects are used directly, without pyplot: no window, no global state.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from weakref import WeakKeyDictionary

from truespring.report.bodies import distance_figure, over_figure, undeformed_figure
from truespring.report.bodies3d import distance_picture, over_picture, undeformed_picture
from truespring.report.drawing import Drawing, drawing_of, save_drawings
from truespring.report.frame3d import figure_of, shot
from truespring.report.plots import curves_figure, error_figure, moduli_figure
from truespring.report.reel import INSTANTS, Reel, reel_of, sheet_of, shots, shown_reference
from truespring.report.render import Image, render
from truespring.report.result import Result
from truespring.report.sheet import Sheet
from truespring.report.style import figure_style
from truespring.report.support_curves import support_figures
from truespring.report.timelines import energies_figure, has_touches, moving, tools_figure
from truespring.report.undeformed import Undeformed, undeformed_of

# Figures of a result, drawn once for its files and its page.
_DRAWN: "WeakKeyDictionary[Result, dict[str, Drawing]]" = WeakKeyDictionary()


def draw_figures(result: Result) -> dict[str, Sheet]:
    """Return the figures of a study by the stem of their file names."""
    with figure_style():
        return {name: sheet for name, sheet, _ in _draw(result)}


def render_figures(result: Result) -> dict[str, Drawing]:
    """Return the figures of a study as PNG and SVG, by the stem of their file names."""
    if result not in _DRAWN:
        with figure_style():
            _DRAWN[result] = {name: drawing_of(sheet, note) for name, sheet, note in _draw(result)}
    return _DRAWN[result]


def save_figures(result: Result, folder: Path) -> dict[str, Drawing]:
    """Write every figure as PNG and SVG into `folder`, created if it does not exist; return the figures."""
    drawings = render_figures(result)
    save_drawings(drawings, folder)
    return drawings


def save_undeformed(body: Undeformed, file: Path) -> None:
    """Write the picture of an undeformed body as a PNG file."""
    with figure_style():
        if body.problem.mesh.dim == 2:
            sheet = undeformed_figure(body)
        else:
            picture = undeformed_picture(body)
            images, _ = render([shot(picture)])()
            sheet = figure_of(picture, images[0])
        file.write_bytes(sheet.png())


def over_name(result: Result, reference: str) -> str:
    """Return the file stem of the figure of the model over a reference; safe in paths for any names of models."""
    return _safe(f"{result.model}_over_{reference}")


def distance_name(result: Result, reference: str) -> str:
    """Return the file stem of the figure of the model coloured by its distance from a reference."""
    return _safe(f"{result.model}_error_{reference}")


def film_name(result: Result, reference: str) -> str:
    """Return the file stem of the film strip of the model over a reference."""
    return _safe(f"film_{reference}")


def energies_name(name: str) -> str:
    """Return the file stem of the figure of the energies of a path."""
    return _safe(f"energies_{name}")


def _safe(name: str) -> str:
    return re.sub(r"[^\w.-]+", "-", name)


# The stem of file names, the figure, and a remark on how it was drawn.
_Named = tuple[str, Sheet, str]


def _draw(result: Result) -> Iterator[_Named]:
    """Yield every figure; plots first, while a child process renders bodies in 3D."""
    bodies = _bodies_in_space(result) if result.problem.mesh.dim == 3 else lambda: _plane_bodies(result)
    if any(len(path.states) > 1 for path in result.solutions.values()):
        yield "curves", curves_figure(result), ""
        for name, sheet in support_figures(result):
            yield name, sheet, ""
    yield from _histories(result)
    if any(one.load_factors.size for one in result.comparisons.values()):
        yield "error", error_figure(result), ""
    if any(path.moduli is not None for path in result.solutions.values()):
        yield "moduli", moduli_figure(result), ""
    yield from bodies()


def _histories(result: Result) -> Iterator[_Named]:
    """Yield forces on tools, and energies of a motion."""
    if has_touches(result):
        yield "tools", tools_figure(result), ""
    for name in moving(result):
        yield energies_name(name), energies_figure(result, name), ""


def _reels(result: Result) -> dict[str, Reel]:
    """Return film strips by name: of the model over each reference, without one of the model; none at rest.

    At rest only where displacements may return to zero, so that the last level does not show what happened.
    """
    if not (result.problem.stated and result.problem.returns):
        return {}
    names: list[str | None] = [*result.comparisons] or [shown_reference(result)]
    found = {film_name(result, name or ""): reel_of(result, name, INSTANTS, from_rest=False) for name in names}
    return {name: reel for name, reel in found.items() if reel is not None}


def _film(reel: Reel, images: Sequence[Image] = ()) -> Sheet:
    model = reel.result.solutions[reel.model].label
    over = "" if reel.reference is None else f" over {reel.result.solutions[reel.reference].label}"
    return sheet_of(reel, reel.levels, images, f"{model}{over}")


def _plane_bodies(result: Result) -> Iterator[_Named]:
    yield "undeformed", undeformed_figure(undeformed_of(result)), ""
    reels = _reels(result)
    yield from ((name, _film(reel), "") for name, reel in reels.items())
    for name, comparison in result.comparisons.items():
        if film_name(result, name) in reels:
            continue
        pictures = {over_name: over_figure} | ({distance_name: distance_figure} if result.in_detail else {})
        for called, draw in pictures.items():
            drawn = draw(result, name, comparison)
            if drawn is not None:
                yield called(result, name), drawn, ""


def _bodies_in_space(result: Result) -> Callable[[], Iterator[_Named]]:
    pictures = {"undeformed": undeformed_picture(undeformed_of(result))}
    reels = _reels(result)
    for name, comparison in result.comparisons.items():
        if film_name(result, name) in reels:
            continue
        for called, draw in ((over_name, over_picture), (distance_name, distance_picture)):
            picture = draw(result, name, comparison)
            if picture is not None:
                pictures[called(result, name)] = picture
    strips = [one for reel in reels.values() for one in shots(reel, len(reel.levels), reel.levels)]
    rendered = render([*(shot(picture) for picture in pictures.values()), *strips])

    def figures() -> Iterator[_Named]:
        images, note = rendered()
        drawn = iter(images)
        for name, picture in pictures.items():
            yield name, figure_of(picture, next(drawn)), note
        for name, reel in reels.items():
            yield name, _film(reel, [next(drawn) for _ in reel.levels]), note

    return figures
