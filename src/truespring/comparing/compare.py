"""Results against results, whoever computed them: the first is the reference."""

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from truespring.comparing.misfits import box_words, refuse_misfit
from truespring.comparing.options import read_place
from truespring.comparing.sources import Progress, Source, open_source
from truespring.comparison import TOLERANCE, Comparison, compare
from truespring.equilibrium import Solution
from truespring.errors import StudyError, TruespringError
from truespring.misfit import displacement_misfit, same_place
from truespring.outputs import Output, write_whole
from truespring.report.curves import write_curves
from truespring.report.result import Result
from truespring.report.series import write_difference
from truespring.report.summary import difference

Probe = str | tuple[float, ...] | None


def compare_sources(
    sources: Sequence[Source],
    probe: Probe = None,
    tolerance: float | None = None,
    progress: Progress | None = None,
    timeout: float | None = None,
) -> Iterator[Result]:
    """Read or solve all sources and yield each but the first compared with that, as a result to report.

    Probe and tolerance are those of a study among the two where they are not given; each model that is solved is given
    up after `timeout` seconds. Raises TruespringError where a
    file cannot be read, or a body does not lie where that of the reference lies, with what would make it lie there.
    """
    (first, *others), (reference, *models) = names(sources), _opened(sources, progress, timeout)
    for source, name, model in zip(sources[1:], others, models, strict=True):
        refuse_misfit(source, model, sources[0], reference)
        study = source.study or sources[0].study
        accepted = tolerance or (TOLERANCE if study is None else study.tolerance)
        found = _laid_over(model, reference, probe, accepted)
        watched = source.probe or sources[0].probe
        if probe is None and watched is not None:  # where the study looks, if the other body is there
            there = _laid_over(model, reference, watched, accepted)
            found = there if _off(watched, there) <= _FAR else found
        elif isinstance(probe, tuple):
            _refuse_far(probe, found)
        yield _result(name, model, first, found, source.is_file or sources[0].is_file)


def _laid_over(model: Solution, reference: Solution, place: Probe, tolerance: float) -> Comparison:
    """Compare two paths; a surface alone has no levels to draw, so the body is drawn over it, whichever is which."""
    turned = not model.states and bool(reference.states)
    return compare(reference, model, place, tolerance) if turned else compare(model, reference, place, tolerance)


def names(sources: Sequence[Source]) -> list[str]:
    """Return a short name for each source: its file's, with as many folders as tell it from others; each once."""
    named = [_named(source, 0) for source in sources]
    for folders in range(1, 4):
        if len(set(named)) == len(named):
            return named
        named = [
            _named(one, folders) if named.count(name) > 1 else name for one, name in zip(sources, named, strict=True)
        ]
    return [
        f"{name} ({named[:place].count(name) + 1})" if name in named[:place] else name
        for place, name in enumerate(named)
    ]


def _named(source: Source, folders: int) -> str:
    place = source.file.resolve()
    last = place.stem if source.study is not None else place.name
    path = "/".join([*place.parts[max(len(place.parts) - 1 - folders, 1) : -1], last])
    return f"{path}:{source.model}" if source.model else path


def _opened(sources: Sequence[Source], progress: Progress | None, timeout: float | None) -> list[Solution]:
    """The paths of all sources; STL files last, which are read beside the first other body."""
    opened: dict[int, Solution] = {}
    for number, source in sorted(enumerate(sources), key=lambda one: one[1].is_stl):
        beside = opened[min(opened)].problem if opened and source.is_stl else None
        opened[number] = open_source(source, beside, progress, timeout)
    return [opened[number] for number in range(len(sources))]


def _result(name: str, model: Solution, first: str, found: Comparison, from_file: bool) -> Result:
    drawn, other = (name, first) if found.known_on[0] is model else (first, name)
    paths = {drawn: found.model, other: found.reference}
    paths[name] = replace(paths[name], warnings=(*paths[name].warnings, *_notes(first, found, from_file)))
    return Result(
        title=f"{name} against {first}",
        file=Path(re.sub(r"[^\w.-]+", "-", name)),
        problem=found.model.problem,
        paths={name: paths[name], first: paths[first]},
        probe=found.probe,
        model=drawn,
        comparisons={other: replace(found, model=paths[drawn], reference=paths[other])},
        tolerance=found.tolerance,
        source="",
        in_detail=True,
    )


def _off(place: tuple[float, ...], found: Comparison) -> float:
    """How far a place [m] is from the node that is watched for it, as a share of the diameter."""
    mesh = found.model.problem.mesh
    return float(np.linalg.norm(mesh.nodes[found.probe] - place[: mesh.dim])) / mesh.diameter


def _refuse_far(place: tuple[float, ...], found: Comparison) -> None:
    if (off := _off(place, found)) > _FAR:
        at = ", ".join(f"{part:.4g}" for part in place)
        away = f"{off * found.model.problem.mesh.diameter:.4g} m away from the nearest node"
        raise StudyError(f"--probe ({at}) m is {away}: the body {box_words(found.model)}")


# A probe farther off the body, as a share of its diameter, was not meant.
_FAR = 0.1


def _notes(first: str, found: Comparison, from_file: bool) -> Iterator[str]:
    """What a reader must know of how two bodies were laid over each other."""
    model, reference = found.known_on
    if not same_place(model, reference):
        yield f"it {box_words(model)}, {first} {box_words(reference)}: they are not one body"
    if found.n_outside:
        yield (
            f"{found.n_outside} of {len(found.outside)} nodes lie outside of the other body and are left out of all "
            "errors; figures mark them by crosses"
        )
    if found.n_reference_outside:
        yield f"{found.n_reference_outside} nodes of {first} lie outside of it, where nothing is compared"
    if found.model.states and found.reference.states and not found.load_factors.size:
        mine, theirs = (", ".join(f"{level:g}" for level in path.load_factors[:12]) for path in found.known_on)
        yield f"it has the load levels {mine}, {first} has {theirs}: none in common"
    better = displacement_misfit(found) if from_file else None
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


def write_comparisons(results: Sequence[Result], out: Path, command: str) -> Path:
    """Write the files of each result into out, or where there are several into folders of it; return the report.

    `command` is the command line that repeats the comparison, named in the report.
    """
    for result in results:
        write_comparison(result, out if len(results) == 1 else out / result.file, command)
    report = out / "report.html"
    if len(results) > 1:
        from truespring.report.page import render_page

        write_whole(report, render_page(results, command).encode())
    return report


def write_comparison(result: Result, folder: Path, command: str) -> None:
    """Write comparison.json, curves.csv, difference.vtu, figures and the report of two results into a folder."""
    from truespring.report.figures import save_figures
    from truespring.report.page import write_page

    with Output(folder, "comparison.json") as output:
        text = json.dumps(difference(result), indent=2, allow_nan=False)
        (output.staging / "comparison.json").write_text(text + "\n", encoding="utf-8")
        write_curves(result, output.staging / "curves.csv")
        write_difference(next(iter(result.comparisons.values())), output.staging / "difference.vtu")
        save_figures(result, output.staging / "figures")
        write_page([result], output.staging / "report.html", command)
        output.publish()
