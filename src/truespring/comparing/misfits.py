"""Bodies that do not lie where they should, told with the options that would make them."""

from truespring.comparing.options import FileOptions
from truespring.comparing.sources import Source
from truespring.equilibrium import Solution
from truespring.errors import ReferenceFileError
from truespring.mesh.selections import AXES
from truespring.misfit import Misfit, find_misfit

_UNITS = {1e-6: "um", 1e-3: "mm", 1e-2: "cm", 0.0254: "inch", 0.3048: "ft", 1.0: "m", 1e3: "km"}


def refuse_misfit(source: Source, model: Solution, first: Source, reference: Solution) -> None:
    """Raise ReferenceFileError where a body would lie where the other lies if it were told otherwise.

    A file is to be mended: what is ours is in metres. Of two files that of which something is told already, else that
    of the model.
    """
    pairs = [(source, model, first, reference), (first, reference, source, model)]
    told = [pair for pair in pairs if pair[0].options.placed]
    for mended, path, other, beside in told or pairs:
        if not mended.is_file:
            continue
        scale = mended.options.placing.scale
        found = find_misfit(path, beside, [size / scale for size in _UNITS])
        if found is not None and not _meant(mended.options, found):
            file = mended.file.name
            raise ReferenceFileError(
                f"{mended.text} {box_words(path)}, {other.text} {box_words(beside)}: the former would lie where the "
                f"latter lies with {_options(file, found, scale)}; say so, or, where it lies as it should, "
                f"--unit {file}=m --axes {file}=x,y,z --shift {file}=0,0,0"
            )


def _meant(options: FileOptions, found: Misfit) -> bool:
    """Whether all that would be changed was told."""
    changes = (found.factor != 1, found.axes != tuple(AXES), any(found.shift))
    said = (options.unit is not None, options.axes is not None, options.shift is not None)
    return all(given for change, given in zip(changes, said, strict=True) if change)


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
    """Return where a body lies, in words that follow its name."""
    only = path.surface or path.shell
    points = path.whole.points if path.states or only is None else only.points
    ends = (", ".join(f"{value:.4g}" for value in end) for end in (points.min(axis=0), points.max(axis=0)))
    return "lies between ({}) and ({}) m".format(*ends)
