"""What `truespring compare` is given: studies, folders that truespring wrote, and other programs' result files."""

import csv
import io
import json
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from truespring.arrays import Bools, Floats
from truespring.comparing.options import FileOptions, Given, options_of
from truespring.equilibrium import Solution, State, Status
from truespring.errors import ReferenceFileError, StudyError, TruespringError, nearest
from truespring.mesh import read_mesh
from truespring.mesh.files.vtu import read_grids
from truespring.opening import read_file
from truespring.outputs import UNFINISHED
from truespring.problem import Problem
from truespring.reactions import SupportForce, torque_axes
from truespring.reference import Placing, format_of, placed, read_record, read_shell, read_stl
from truespring.study.read import Study, read_study
from truespring.study.run import follow

#: Called with what is read or solved and the share that is done, for a progress bar.
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Source:
    """One of the things that are compared, before it is read or solved.

    Attributes:
        text: as it was given.
        file: the study, the folder or the file.
        model: which model of a study or folder, None for its compared one.
        options: what is told of a file.
        study: the study, checked, where it is one.
    """

    text: str
    file: Path
    model: str | None
    options: FileOptions
    study: Study | None = None

    @property
    def probe(self) -> tuple[float, ...] | None:
        """The place [m] that a study or a folder of one watches, None where none is told."""
        if self.study is not None and self.study.probe is not None:
            return tuple(self.study.problem.mesh.nodes[self.study.probe].tolist())
        if self.file.is_dir():
            with suppress(ReferenceFileError, KeyError, TypeError):
                return tuple(float(part) for part in _json(self.file / "summary.json")["probe"]["position"])
        return None

    @property
    def is_file(self) -> bool:
        """Whether another program may have written it: a study and a folder are in metres, along our axes."""
        return self.study is None and not self.file.is_dir()

    @property
    def is_stl(self) -> bool:
        """Whether it is an STL file, which is read beside the other body."""
        return format_of(self.file) == ".stl"


def find_sources(texts: Sequence[str], given: Given) -> list[Source]:
    """Return what several texts name, checked before anything is read whole or solved; see find_source and options_of.

    Raises StudyError with the faults of all of them.
    """
    if len(texts) < 2:
        raise StudyError(f"{', '.join(texts)}: two results or more are compared, the first is the reference")
    found, faults = [], []
    for text in texts:
        try:
            found.append(find_source(text, options_of(text, given, texts)))
        except TruespringError as error:
            faults += [line for line in str(error).splitlines() if line not in faults]
    if faults:
        raise StudyError("\n".join(faults))
    return found


def find_source(text: str, options: FileOptions) -> Source:
    """Return what FILE, FOLDER[:MODEL] or STUDY[:MODEL] names; raise StudyError for what is not there."""
    file, model = Path(text), None
    if not file.exists() and ":" in text:
        name, _, given = text.rpartition(":")
        if Path(name).exists():
            file, model = Path(name), given
    if not file.exists():
        raise StudyError(f"{text}: there is no such file or folder")
    study = read_study(file) if file.suffix.lower() == ".toml" else None
    if study is not None:
        model = _known(text, model or study.model, list(study.entries))
    elif file.is_dir():
        file = _folder(text, file)
        summary = _json(file / "summary.json")
        names = list(summary["models"])
        if not (model or summary.get("model") or len(names) == 1):
            raise StudyError(f"{text}: which model? Add one of {', '.join(f':{name}' for name in names)}")
        model = _known(text, model or summary.get("model") or names[0], names)
    elif model is not None:
        raise StudyError(f"{text}: a result file holds one model; leave out ':{model}'")
    return Source(text, file, model, options, study)


def open_source(
    source: Source, beside: Problem | None, progress: Progress | None, timeout: float | None = None
) -> Solution:
    """Read or solve a source; an STL file is read beside the body of `beside`, where there is one in the plane."""

    def report(share: float) -> None:
        if progress:
            progress(source.text, share)

    options = source.options
    if source.study is not None:
        entry = source.study.entries[str(source.model)]
        path = follow(source.study, entry, lambda factor, *_: report(factor), timeout)
    elif source.file.is_dir():
        path = _of_folder(source, report)
    elif source.is_stl and beside is not None and beside.mesh.dim == 2 and beside.mesh.element != "line":
        at = options.placing
        factor = 1.0 if at.load_factor is None else at.load_factor
        path = read_stl(beside, source.file, factor, options.undeformed, at.unit, at.axes, at.shift)
    elif source.is_stl and options.undeformed is None:
        path = read_shell(source.file, options.placing, beside)
    else:
        path = placed(_record(source.file, options, report), options.placing, source.file.name)
    report(1.0)
    return path


def _record(file: Path, options: FileOptions, report: Callable[[float], None]) -> Any:
    return read_record(file, field=options.field, undeformed=options.undeformed, mesh=options.mesh, reading=report)


def _known(text: str, model: str, names: Sequence[str]) -> str:
    if model not in names:
        raise StudyError(f"{text}: '{model}' is not among the models{nearest(model, names)}: {', '.join(names)}")
    return model


def _of_folder(source: Source, report: Callable[[float], None]) -> Solution:
    """A path that truespring wrote: its VTU series with what summary and curves tell of it."""
    folder, name = source.file, str(source.model)
    told = _json(folder / "summary.json")["models"][name]
    series, elements = folder / f"{name}.pvd", folder / "mesh.vtu"
    if not series.is_file():
        raise ReferenceFileError(f"{series} does not exist: of '{name}' no level was written")
    record = _record(series, FileOptions(), report)
    if elements.is_file():  # a series of springs holds lines; the body has elements
        mesh = read_mesh(elements)
        record = replace(record, cells=mesh.cells) if mesh.n_nodes == len(record.points) else record
    path = placed(record, Placing(), f"{told['label']} of {folder.name}")
    energies = {float(level): float(energy) for level, energy in told.get("energies", [])}
    states = [
        replace(state, energy=energies.get(state.load_factor, state.energy))
        for state in _with_supports(_with_forces(path, folder / "curves.csv", name), folder / "reactions.csv", name)
    ]
    warnings = (*(str(text) for text in told["warnings"]), f"solved before: read from {folder}")
    held = _held(path, elements) if elements.is_file() else None
    return replace(
        path, kind=told["kind"], status=Status(told["status"]), states=tuple(states), warnings=warnings, held=held
    )


def _held(path: Solution, body: Path) -> Bools | None:
    """The directions of nodes that supports held, as mesh.vtu tells them; None where it does not, or of other nodes."""
    (grid,), nodes = read_grids(read_file(body, ReferenceFileError)), path.problem.mesh.nodes
    held = grid.point_arrays.get("held")
    if held is None or len(held) != len(nodes) or not np.allclose(grid.points[:, : nodes.shape[1]], nodes):
        return None
    return np.asarray(held[:, : nodes.shape[1]] > 0)


def _folder(text: str, file: Path) -> Path:
    """The folder of a study, or the only one in a folder of several."""
    if (file / "summary.json").is_file():
        return file
    inner = sorted(one.parent for one in file.glob("*/summary.json") if one.parent.name != UNFINISHED)
    if len(inner) != 1:
        several = f"; it holds those of {', '.join(str(one) for one in inner)}" if inner else ""
        if (file / UNFINISHED).is_dir():
            several += f"; a run was stopped there, what it left is in {file / UNFINISHED}: run it again"
        raise StudyError(f"{text}: truespring wrote no study into this folder (no summary.json){several}")
    return inner[0]


def _json(file: Path) -> dict[str, Any]:
    try:
        read = json.loads(read_file(file, ReferenceFileError))
        models = read["models"]
        if not isinstance(models, dict) or not models:
            raise ValueError("it names no models")
        for name, model in models.items():
            for key in ("label", "kind", "status", "warnings"):
                if key not in model:
                    raise ValueError(f"models.{name}.{key} is missing")
            Status(model["status"])
    except (ValueError, KeyError, TypeError) as error:
        raise ReferenceFileError(f"{file} is no summary of truespring, or damaged: {error}") from None
    return dict(read)


def _with_forces(path: Solution, curves: Path, name: str) -> tuple[State, ...]:
    """The states of a path with the forces that curves.csv tells at their levels."""
    axes = "xyz"[: path.problem.mesh.dim]
    try:
        forces = {level: _numbers(rows[0], [f"f{axis}" for axis in axes]) for level, rows in _rows(curves, name)}
    except _DAMAGED:
        return path.states  # displacements can be compared without
    return tuple(replace(one, applied_force=_near(forces, one, one.applied_force)) for one in path.states)


def _with_supports(states: Sequence[State], reactions: Path, name: str) -> tuple[State, ...]:
    """The states with force and torque of each moved support that reactions.csv tells at their levels."""
    if not states or not reactions.is_file():
        return tuple(states)
    dim = states[0].positions.shape[1]
    try:
        told = {level: tuple(_support(row, dim) for row in rows) for level, rows in _rows(reactions, name)}
    except _DAMAGED:
        return tuple(states)
    return tuple(replace(one, supports=_near(told, one, None)) for one in states)


def _support(row: Mapping[str, str], dim: int) -> SupportForce:
    compared = row["compared"].split()
    return SupportForce(
        support=int(row["support"]) - 1,
        name=row["on"],
        force=_numbers(row, [f"f{axis}" for axis in "xyz"[:dim]]),
        torque=_numbers(row, [f"m{axis}" for axis in torque_axes(dim)]),
        has_force="force" in compared,
        has_torque="torque" in compared,
    )


# What a table that someone cut or changed may raise.
_DAMAGED = (ReferenceFileError, ValueError, KeyError, TypeError, AttributeError)


def _rows(table: Path, name: str) -> list[tuple[float, list[dict[str, str]]]]:
    """The rows of a model in a table, by load factor."""
    text = read_file(table, ReferenceFileError).decode("utf-8")
    rows = [row for row in csv.DictReader(io.StringIO(text, newline="")) if row.get("model") == name]
    levels = dict.fromkeys(float(row["load_factor"]) for row in rows)
    return [(level, [row for row in rows if float(row["load_factor"]) == level]) for level in levels]


def _numbers(row: Mapping[str, str], columns: Sequence[str]) -> Floats:
    return np.array([float(row[column] or math.nan) for column in columns])


def _near(told: Mapping[float, Any], state: State, otherwise: Any) -> Any:
    """What is told at the level of a state."""
    return next((value for level, value in told.items() if abs(level - state.load_factor) < 1e-6), otherwise)
