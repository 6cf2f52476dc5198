"""Export the springs of a study to other simulators."""

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from truespring.comparison import most_moved
from truespring.equilibrium import Status
from truespring.errors import ExportError, nearest
from truespring.exports import (
    Exported,
    OptionValue,
    check_options,
    known_targets,
    solve_springs,
    target_files,
    unsupported,
    with_expectation,
    write_files,
)
from truespring.report.result import head_note
from truespring.study.read import Study
from truespring.study.run import Progress


@dataclass(frozen=True, eq=False)
class Exports:
    """Files written for one target.

    Attributes:
        target: a key of TARGETS.
        model: the name of the exported model in the study.
        exported: the model with its problem and equilibrium.
        files: paths of the files.
    """

    target: str
    model: str
    exported: Exported
    files: tuple[Path, ...]

    @property
    def converged(self) -> bool:
        """Whether the solve converged, so that the files state an equilibrium at full load."""
        return self.exported.path.status is Status.CONVERGED and self.exported.state is not None

    @property
    def values(self) -> dict[str, Any]:
        """The result as JSON values; the probe's displacement is None if full load was not reached."""
        exported, state = self.exported, self.exported.state
        return {
            "target": self.target,
            "files": [str(file) for file in self.files],
            "model": self.model,
            "status": str(exported.path.status),
            "load_factor": exported.path.load_factor,
            "probe": {
                "node": exported.probe,
                "position": exported.problem.mesh.nodes[exported.probe].tolist(),
                "displacement": None if state is None else state.displacement[exported.probe].tolist(),
            },
            "warnings": list(exported.path.warnings),
            "notes": list(exported.notes),
        }

    @property
    def sentences(self) -> tuple[str, ...]:
        """The expected results and notes from the heads of the files, as sentences."""
        return (*self.exported.expected, *self.exported.notes)

    @property
    def fault(self) -> str:
        """Message for a solve that did not converge."""
        path = self.exported.path
        return (
            f"model '{self.model}' is {path.status}; reached load factor {path.load_factor:.6g}; "
            "the files are written without an equilibrium to compare with"
        )


def springs_of(
    study: Study,
    targets: Collection[str],
    name: str | None = None,
    options: Mapping[str, OptionValue] | None = None,
) -> str:
    """Return the name of the springs model to export: `name`, or the compared model, or the first springs model.

    Solves nothing. Raises ExportError if a target or option is unknown, if no target can represent the model, if the
    study has no springs model, or if `name` is not one.
    """
    known = known_targets(targets)
    check_options(known, options)
    springs = {one: entry for one, entry in study.entries.items() if entry.has_springs}
    if not springs:
        raise ExportError(f"{study.file}: no springs model among {', '.join(study.entries)}: add one to [models]")
    if name is None:
        name = study.model if study.model in springs else next(iter(springs))
    if name not in springs:
        what = "is not a springs model" if name in study.entries else f"is not among the models{nearest(name, springs)}"
        raise ExportError(f"{study.file}: model '{name}' {what}; springs: {', '.join(springs)}")
    refused = refused_targets(study, known, name)
    if len(refused) == len(known):
        raise ExportError("\n".join(refused.values()))
    return name


def refused_targets(study: Study, targets: Collection[str], name: str) -> dict[str, str]:
    """Return the targets that cannot represent the springs model `name` or its loads, each with the reason."""
    with _named(study, name):
        found = unsupported(targets, study.problem, study.entries[name])
    return {target: f"{study.file}: model '{name}': {error}" for target, error in found.items()}


def export_study(
    study: Study,
    targets: Collection[str],
    out: Path,
    name: str | None = None,
    progress: Progress | None = None,
    options: Mapping[str, OptionValue] | None = None,
) -> list[Exports]:
    """Solve the springs of a study, write them for each target, and return the files of each target.

    The files of one target are written to out/STEM, those of several to out/STEM/TARGET. Targets that cannot represent
    the model or its loads are left out, see `refused_targets`; raises ExportError if that are all.
    """
    name = springs_of(study, targets, name, options)
    model, known = study.entries[name], known_targets(targets)
    refused = refused_targets(study, known, name)
    taking = [target for target in known if target not in refused]

    def report(load_factor: float, iteration: int, residual: float) -> None:
        if progress:
            progress(study.stem, name, load_factor)

    exported = solve_springs(study.problem, model, study.solver, study.title, study.probe, report)
    exported = replace(exported, note=head_note(study.source))
    if study.probe is None:
        exported = replace(exported, probe=most_moved(exported.path))
    with _named(study, name):
        found = target_files(exported, taking, options)
    written = []
    for target, files in found.items():
        folder = out / study.stem if len(known) == 1 else out / study.stem / target
        written.append(Exports(target, name, exported, write_files(with_expectation(exported, target, files), folder)))
    return written


@contextmanager
def _named(study: Study, name: str) -> Iterator[None]:
    """Put study and model before the message of an ExportError."""
    try:
        yield
    except ExportError as error:
        raise ExportError(f"{study.file}: model '{name}': {error}") from None
