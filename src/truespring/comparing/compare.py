"""Compare results with the first one, the reference."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from truespring.comparing.misfits import box_words, require_alignment
from truespring.comparing.options import read_place
from truespring.comparing.result import Comparisons
from truespring.comparing.sources import Progress, Source, open_source
from truespring.comparison import TOLERANCE, Comparison, compare
from truespring.equilibrium import Solution
from truespring.errors import StudyError, TruespringError
from truespring.misfit import displacement_misfit, same_place
from truespring.report.result import Result

Probe = str | tuple[float, ...] | None


def compare_sources(
    sources: Sequence[Source],
    probe: Probe = None,
    tolerance: float | None = None,
    progress: Progress | None = None,
    timeout: float | None = None,
) -> Comparisons:
    """Read or solve all sources and compare each with the first, the reference.

    Args:
        sources: from `find_sources`, at least two.
        probe: name or coordinates [m] of the watched point; by default that of a study among the two sources.
        tolerance: relative error up to which two results agree; by default that of a study among the two sources.
        progress: called with the source that is read or solved, and the share of the work done.
        timeout: time limit of each model [s].

    Raises TruespringError if a file cannot be read, or if a body has another place than that of the reference, with the
    options that would align them.
    """
    (first, *others), (reference, *models) = names(sources), _opened(sources, progress, timeout)
    results = []
    for source, name, model in zip(sources[1:], others, models, strict=True):
        require_alignment(source, model, sources[0], reference)
        study = source.study or sources[0].study
        accepted = tolerance or (TOLERANCE if study is None else study.tolerance)
        found = _compared(model, reference, probe, accepted)
        watched = source.probe or sources[0].probe
        if probe is None and watched is not None:  # the probe of the study, if it is on the other body too
            there = _compared(model, reference, watched, accepted)
            found = there if _off(watched, there) <= _FAR else found
        elif isinstance(probe, tuple):
            _require_near(probe, found)
        results.append(_result(name, model, first, found, source.is_file or sources[0].is_file))
    return Comparisons(tuple(results))


def _compared(model: Solution, reference: Solution, place: Probe, tolerance: float) -> Comparison:
    """Return the comparison of two paths; if only the reference has states, it takes the place of the model."""
    swapped = not model.states and bool(reference.states)
    return compare(reference, model, place, tolerance) if swapped else compare(model, reference, place, tolerance)


def names(sources: Sequence[Source]) -> list[str]:
    """Return a short unique name for each source: its file name, with as many folders as needed."""
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
    """Return the paths of all sources; STL files are read last, because they need another body."""
    opened: dict[int, Solution] = {}
    duration = next((one.duration for one in sources if one.duration is not None), None)
    for number, source in sorted(enumerate(sources), key=lambda one: one[1].is_stl):
        other = opened[min(opened)].problem if opened and source.is_stl else None
        opened[number] = open_source(source, other, progress, timeout, duration)
    return [opened[number] for number in range(len(sources))]


def _result(name: str, model: Solution, first: str, found: Comparison, from_file: bool) -> Result:
    drawn, other = (name, first) if found.known_on[0] is model else (first, name)
    paths = {drawn: found.model, other: found.reference}
    paths[name] = replace(paths[name], warnings=(*paths[name].warnings, *_notes(first, found, from_file)))
    return Result(
        title=f"{name} against {first}",
        file=Path(re.sub(r"[^\w.-]+", "-", name)),
        problem=found.model.problem,
        solutions={name: paths[name], first: paths[first]},
        probe=found.probe,
        model=drawn,
        comparisons={other: replace(found, model=paths[drawn], reference=paths[other])},
        tolerance=found.tolerance,
        source="",
        in_detail=True,
    )


def _off(place: tuple[float, ...], found: Comparison) -> float:
    """Return the distance of a place [m] from its nearest node, as a share of the body's diameter."""
    mesh = found.model.problem.mesh
    return float(np.linalg.norm(mesh.nodes[found.probe] - place[: mesh.dim])) / mesh.diameter


def _require_near(place: tuple[float, ...], found: Comparison) -> None:
    if (off := _off(place, found)) > _FAR:
        at = ", ".join(f"{part:.4g}" for part in place)
        away = f"{off * found.model.problem.mesh.diameter:.4g} m from the nearest node"
        raise StudyError(f"--probe ({at}) m is {away}: the body {box_words(found.model)}")


# Largest distance of a probe from the body, as a share of the body's diameter.
_FAR = 0.1


def _notes(first: str, found: Comparison, from_file: bool) -> Iterator[str]:
    """Yield warnings on differences of place, levels, units and axes of the two bodies."""
    model, reference = found.known_on
    if not same_place(model, reference):
        yield f"it {box_words(model)}, {first} {box_words(reference)}: the bodies differ"
    if found.n_outside:
        yield (
            f"{found.n_outside} of {len(found.outside)} nodes are outside of the other body: they are excluded from "
            "all errors and marked by crosses in figures"
        )
    if found.n_reference_outside:
        yield f"{found.n_reference_outside} nodes of {first} are outside of it and not compared"
    if found.model.states and found.reference.states and not found.load_factors.size:
        mine, theirs = (", ".join(f"{level:g}" for level in path.load_factors[:12]) for path in found.known_on)
        yield f"it has the load levels {mine}, {first} has {theirs}: none in common"
    better = displacement_misfit(found) if from_file else None
    if better is not None and better.factor != 1:
        yield (
            f"its displacement is near that of {first} if multiplied by {better.factor:g}, while its nodes agree: "
            "check the unit of the displacement"
        )
    elif better is not None:
        axes = ",".join(better.axes)
        yield f"its displacement is near that of {first} with --axes {axes}: check its axes"


def read_probe(text: str | None) -> Probe:
    """Return the name of a point, or its coordinates [m] if the text has commas."""
    if text is None or "," not in text:
        return text
    try:
        return read_place(text)
    except TruespringError as error:
        raise StudyError(f"--probe {text}: {error}") from None
