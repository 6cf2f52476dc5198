"""Errors for bodies at different places, with the options that align them."""

from truespring.comparing.options import FileOptions
from truespring.comparing.sources import Source
from truespring.equilibrium import Solution
from truespring.errors import ReferenceFileError
from truespring.mesh.selections import AXES
from truespring.misfit import Misfit, find_misfit

_UNITS = {1e-6: "um", 1e-3: "mm", 1e-2: "cm", 0.0254: "inch", 0.3048: "ft", 1.0: "m", 1e3: "km"}


def require_alignment(source: Source, model: Solution, first: Source, reference: Solution) -> None:
    """Raise ReferenceFileError if other options of a file would align the two bodies.

    The options are for a file of another program, since other sources are in metres; of two files for the one that has
    such options already, else for that of the model.
    """
    pairs = [(source, model, first, reference), (first, reference, source, model)]
    with_options = [pair for pair in pairs if pair[0].options.placed]
    for moved, path, fixed, target in with_options or pairs:
        if not moved.is_file:
            continue
        scale = moved.options.placing.scale
        found = find_misfit(path, target, [size / scale for size in _UNITS])
        if found is not None and not _is_set(moved.options, found):
            file = moved.file.name
            raise ReferenceFileError(
                f"{moved.text} {box_words(path)}, {fixed.text} {box_words(target)}: {_options(file, found, scale)} "
                "would align them; add that, or, if the place of the former is right, "
                f"--unit {file}=m --axes {file}=x,y,z --shift {file}=0,0,0"
            )


def _is_set(options: FileOptions, found: Misfit) -> bool:
    """Return whether the user has set all options that the misfit would change."""
    changes = (found.factor != 1, found.axes != tuple(AXES), any(found.shift))
    are_set = (options.unit is not None, options.axes is not None, options.shift is not None)
    return all(is_set for change, is_set in zip(changes, are_set, strict=True) if change)


def _options(file: str, found: Misfit, scale: float) -> str:
    options = []
    if found.factor != 1:
        unit = next(name for size, name in _UNITS.items() if abs(size - found.factor * scale) < 1e-9 * size)
        options.append(f"--unit {file}={unit}")
    if found.axes != tuple(AXES):
        options.append(f"--axes {file}={','.join(found.axes)}")
    if any(found.shift):
        options.append(f"--shift {file}={','.join(f'{part:g}' for part in found.shift)}")
    return " ".join(options)


def box_words(path: Solution) -> str:
    """Return the bounding box of a body, as words that follow its name."""
    only = path.surface or path.shell
    points = path.whole.points if path.states or only is None else only.points
    ends = (", ".join(f"{value:.4g}" for value in end) for end in (points.min(axis=0), points.max(axis=0)))
    return "lies between ({}) and ({}) m".format(*ends)
