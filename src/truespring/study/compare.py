"""Results against results, whoever computed them: the first is the reference."""

import json
import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path as FilePath

from truespring.comparison import TOLERANCE, Comparison, compare
from truespring.equilibrium import Path
from truespring.errors import ReferenceFileError, StudyError, TruespringError
from truespring.mesh.selections import AXES
from truespring.misfit import Misfit, displacement_misfit, find_misfit
from truespring.report.curves import write_curves
from truespring.report.result import Result
from truespring.report.series import write_difference
from truespring.report.summary import difference
from truespring.study.sources import Progress, Source, Told, open_source, read_place

Probe = str | tuple[float, ...] | None


def compare_sources(
    sources: Sequence[Source],
    probe: Probe = None,
    tolerance: float | None = None,
    progress: Progress | None = None,
) -> Iterator[Result]:
    """Read or solve all sources and yield each but the first compared with that, as a result to report.

    Probe and tolerance are those of a study among the two where they are not given. Raises TruespringError where a
    file cannot be read, or a body does not lie where that of the reference lies, with what would make it lie there.
    """
    (first, *others), (reference, *models) = names(sources), _opened(sources, progress)
    for source, name, model in zip(sources[1:], others, models, strict=True):
        _refuse_misfit(source, model, sources[0], reference)
        study = source.study or sources[0].study
        place = probe or source.probe or sources[0].probe
        accepted = tolerance or (TOLERANCE if study is None else study.tolerance)
        yield _compared(name, model, first, reference, place, accepted)


def names(sources: Sequence[Source]) -> list[str]:
    """Return a short name for each source: its file's, with the model of a study or folder; each once."""
    found: list[str] = []
    for source in sources:
        stem = source.file.stem if source.study is not None else source.file.resolve().name
        name = f"{stem}:{source.model}" if source.model else stem
        count = sum(one == name or one.startswith(f"{name} (") for one in found)
        found.append(f"{name} ({count + 1})" if count else name)
    return found


def _opened(sources: Sequence[Source], progress: Progress | None) -> list[Path]:
    """The paths of all sources; STL files last, which are read beside the first other body."""
    opened: dict[int, Path] = {}
    for number, source in sorted(enumerate(sources), key=lambda one: one[1].is_stl):
        beside = opened[min(opened)].problem if opened and source.is_stl else None
        opened[number] = open_source(source, beside, progress)
    return [opened[number] for number in range(len(sources))]


def _refuse_misfit(source: Source, model: Path, first: Source, reference: Path) -> None:
    """Raise ReferenceFileError where a body would lie where the reference lies if it were told otherwise."""
    pairs = [(source, model, first, reference), (first, reference, source, model)]
    told = [pair for pair in pairs if pair[0].told.placed]  # who tells of one does not need to hear of the other
    for mended, path, other, beside in told or pairs:
        found = find_misfit(path, beside) if mended.is_file else None  # what is ours is in metres
        if found is not None and not _meant(mended.told, found):
            file = mended.file.name
            raise ReferenceFileError(
                f"{mended.text} {_box(path)}, {other.text} {_box(beside)}: the former would lie where the latter lies "
                f"with {_options(mended, found)}; say so, or, where it lies as it should, --unit {file}=m "
                f"--axes {file}=x,y,z --shift {file}=0,0,0"
            )


def _meant(told: Told, found: Misfit) -> bool:
    """Whether all that would be changed was told."""
    changes = (found.factor != 1, found.axes != tuple(AXES), any(found.shift))
    said = (told.unit is not None, told.axes is not None, told.shift is not None)
    return all(given for change, given in zip(changes, said, strict=True) if change)


def _options(source: Source, found: Misfit) -> str:
    file = source.file.name
    options = []
    if found.factor != 1:
        options.append(f"--unit {file}={_unit(found.factor * source.told.placing.scale)}")
    if found.axes != tuple(AXES):
        options.append(f"--axes {file}={','.join(found.axes)}")
    if any(found.shift):
        options.append(f"--shift {file}={','.join(f'{part:g}' for part in found.shift)}")
    return " ".join(options)


_UNITS = {1e-6: "um", 1e-3: "mm", 1e-2: "cm", 0.0254: "inch", 0.3048: "ft", 1.0: "m", 1e3: "km"}


def _unit(size: float) -> str:
    """The name of a unit of length of a size [m]."""
    return next((name for one, name in _UNITS.items() if abs(one - size) < 1e-9 * size), f"'{size:g} m'")


def _box(path: Path) -> str:
    only = path.surface or path.shell
    points = path.whole.points if path.states or only is None else only.points
    ends = (", ".join(f"{value:.4g}" for value in end) for end in (points.min(axis=0), points.max(axis=0)))
    return "lies between ({}) and ({}) m".format(*ends)


def _compared(name: str, model: Path, first: str, reference: Path, place: Probe, tolerance: float) -> Result:
    # A surface alone has no levels to draw: the body is drawn over it, whichever of both is the reference.
    turned = not model.states and bool(reference.states)
    found = compare(reference, model, place, tolerance) if turned else compare(model, reference, place, tolerance)
    drawn, other = (first, name) if turned else (name, first)
    paths = {drawn: found.model, other: found.reference}
    paths[name] = replace(paths[name], warnings=(*paths[name].warnings, *_notes(first, found)))
    return Result(
        title=f"{name} against {first}",
        file=FilePath(re.sub(r"[^\w.-]+", "-", name)),
        problem=found.model.problem,
        paths={name: paths[name], first: paths[first]},
        probe=found.probe,
        model=drawn,
        comparisons={other: replace(found, model=paths[drawn], reference=paths[other])},
        tolerance=found.tolerance,
        source="",
        in_detail=True,
    )


def _notes(first: str, found: Comparison) -> Iterator[str]:
    """What a reader must know of how two bodies were laid over each other."""
    n_nodes = len(found.outside)
    if found.n_outside:
        yield (
            f"{found.n_outside} of {n_nodes} nodes lie outside of the other body and are left out of all errors; "
            "figures mark them by crosses"
        )
    if found.model.states and found.reference.states and not found.load_factors.size:
        mine, theirs = (", ".join(f"{level:g}" for level in path.load_factors[:12]) for path in found.known_on)
        yield f"it has the load levels {mine}, {first} has {theirs}: none in common"
    better = displacement_misfit(found)
    if better is not None and better.factor != 1:
        yield (
            f"its displacement would be near that of {first} if it were {better.factor:g} times as large, where its "
            "nodes lie right: are both in one unit?"
        )
    elif better is not None:
        axes = ",".join(better.axes)
        yield f"its displacement would be near that of {first} with --axes {axes}: are its axes others?"


def read_probe(text: str | None) -> Probe:
    """Return a named point, or a place of lengths with commas between [m]."""
    if text is None or "," not in text:
        return text
    try:
        return read_place(text)
    except TruespringError as error:
        raise StudyError(f"--probe {text}: {error}") from None


def write_comparisons(
    results: Sequence[Result], out: FilePath, texts: Sequence[str], options: Sequence[tuple[str, Sequence[str]]]
) -> FilePath:
    """Write what each result leaves behind into out, or where there are several into folders of it; return the report.

    `texts` and `options` are what was compared and what was told of it; they make the command that the report names.
    """
    told = [part for name, values in options for value in values for part in (f"--{name.replace('_', '-')}", value)]
    command = shlex.join(["truespring", "compare", *texts, *told, "--out", str(out)])
    for result in results:
        write_comparison(result, out if len(results) == 1 else out / result.file, command)
    report = out / "report.html"
    if len(results) > 1:
        from truespring.report.page import write_page

        write_page(results, report, command)
    return report


def write_comparison(result: Result, folder: FilePath, command: str) -> None:
    """Write comparison.json, curves.csv, difference.vtu, figures and the report of two results into a folder."""
    from truespring.report.figures import save_figures
    from truespring.report.page import write_page

    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(difference(result), indent=2, allow_nan=False)
    (folder / "comparison.json").write_text(text + "\n", encoding="utf-8")
    write_curves(result, folder / "curves.csv")
    write_difference(next(iter(result.comparisons.values())), folder / "difference.vtu")
    save_figures(result, folder / "figures")
    write_page([result], folder / "report.html", command)
