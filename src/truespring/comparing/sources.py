"""Sources of `truespring compare`: studies, result folders of truespring, and result files of other programs."""

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
from truespring.comparing.options import FileOptions, OptionValues, options_of
from truespring.equilibrium import Solution, State, Status
from truespring.errors import ReferenceFileError, StudyError, TruespringError, nearest
from truespring.mesh import read_mesh
from truespring.mesh.files.vtu import read_grids
from truespring.opening import read_file
from truespring.outputs import UNFINISHED
from truespring.problem import Problem
from truespring.reactions import SupportForce, torque_axes
from truespring.reference import Placing, format_of, placed, read_record, read_shell, read_stl
from truespring.report.series import SERIES
from truespring.study.read import Study, read_study
from truespring.study.run import follow
from truespring.study.schema.models import MODEL_KINDS

#: Called with the source that is read or solved, and the share of the work done.
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Source:
    """A source before it is read or solved.

    Attributes:
        text: as given on the command line.
        file: path of the study, folder or file.
        model: name of the model of a study or folder; None for a file.
        options: options of a file.
        study: the study, if it is one.
    """

    text: str
    file: Path
    model: str | None
    options: FileOptions
    study: Study | None = None

    @property
    def probe(self) -> tuple[float, ...] | None:
        """The probe [m] of a study or folder; None without one."""
        if self.study is not None and self.study.probe is not None:
            return tuple(self.study.problem.mesh.nodes[self.study.probe].tolist())
        if self.file.is_dir():
            with suppress(ReferenceFileError, KeyError, TypeError):
                return tuple(float(part) for part in _json(self.file / "summary.json")["probe"]["position"])
        return None

    @property
    def duration(self) -> float | None:
        """The duration of the motion of a study or folder [s]; None at rest, and of a file."""
        if self.study is not None:
            return self.study.problem.duration
        found = _json(self.file / "summary.json").get("duration") if self.file.is_dir() else None
        return None if found is None else float(found)

    @property
    def is_file(self) -> bool:
        """Whether it is a file of another program, whose unit and axes may differ."""
        return self.study is None and not self.file.is_dir()

    @property
    def is_stl(self) -> bool:
        """Whether it is an STL file, which needs another body."""
        return format_of(self.file) == ".stl"


def find_sources(texts: Sequence[str], options: OptionValues) -> list[Source]:
    """Return the sources that texts name, see find_source and options_of; nothing is solved.

    Raises StudyError with all errors.
    """
    if len(texts) < 2:
        raise StudyError(f"{', '.join(texts)}: give at least two results; the first one is the reference")
    found, faults = [], []
    for text in texts:
        try:
            found.append(find_source(text, options_of(text, options, texts)))
        except TruespringError as error:
            faults += [line for line in str(error).splitlines() if line not in faults]
    if faults:
        raise StudyError("\n".join(faults))
    return found


def find_source(text: str, options: FileOptions) -> Source:
    """Return the source that FILE, FOLDER[:MODEL] or STUDY[:MODEL] names; raise StudyError if it does not exist."""
    file, model = Path(text), None
    if not file.exists() and ":" in text:
        name, _, last = text.rpartition(":")
        if Path(name).exists():
            file, model = Path(name), last
    if not file.exists():
        raise StudyError(f"{text} does not exist: check the path")
    study = read_study(file) if file.suffix.lower() == ".toml" else None
    if study is not None:
        model = _known(text, model or study.model, list(study.entries))
    elif file.is_dir():
        file = _folder(text, file)
        summary = _json(file / "summary.json")
        names = list(summary["models"])
        if not (model or summary.get("model") or len(names) == 1):
            raise StudyError(f"{text} has several models: add one of {', '.join(f':{name}' for name in names)}")
        model = _known(text, model or summary.get("model") or names[0], names)
    elif model is not None:
        raise StudyError(f"{text}: a result file has one model: omit ':{model}'")
    return Source(text, file, model, options, study)


def open_source(
    source: Source,
    other: Problem | None,
    progress: Progress | None,
    timeout: float | None = None,
    duration: float | None = None,
) -> Solution:
    """Return the path of a source, read or solved.

    `other` is the problem of another source, for STL files; `duration` [s] that of its motion, for the times of files.
    """

    def advance(share: float) -> None:
        if progress:
            progress(source.text, share)

    options = source.options
    if source.study is not None:
        entry = source.study.entries[str(source.model)]
        path = follow(source.study, entry, lambda factor, *_: advance(factor), timeout)
    elif source.file.is_dir():
        path = _of_folder(source, advance)
    elif source.is_stl and other is not None and other.mesh.dim == 2 and other.mesh.element != "line":
        at = options.placing
        factor = 1.0 if at.load_factor is None else at.load_factor
        path = read_stl(other, source.file, factor, options.undeformed, at.unit, at.axes, at.shift)
    elif source.is_stl and options.undeformed is None:
        path = read_shell(source.file, options.placing, other)
    else:
        placing = replace(options.placing, duration=duration)
        path = placed(_record(source.file, options, advance), placing, source.file.name)
    advance(1.0)
    return path


def _record(file: Path, options: FileOptions, advance: Callable[[float], None]) -> Any:
    return read_record(file, field=options.field, undeformed=options.undeformed, mesh=options.mesh, reading=advance)


def _known(text: str, model: str, names: Sequence[str]) -> str:
    if model not in names:
        raise StudyError(f"{text}: model '{model}' is unknown{nearest(model, names)}; allowed: {', '.join(names)}")
    return model


def _of_folder(source: Source, advance: Callable[[float], None]) -> Solution:
    """Return a path from a result folder: its VTU series, summary, curves and reactions."""
    folder, name = source.file, str(source.model)
    saved = _json(folder / "summary.json")["models"][name]
    files, elements = [folder / f"{name}{form.suffix}" for form in SERIES.values()], folder / "mesh.vtu"
    series = next((file for file in files if file.is_file()), None)
    if series is None:
        raise ReferenceFileError(f"{files[0]} does not exist: the folder has no levels of '{name}'")
    record = _record(series, FileOptions(), advance)
    if elements.is_file():  # a series of springs holds lines; the body has elements
        mesh = read_mesh(elements)
        record = replace(record, cells=mesh.cells) if mesh.n_nodes == len(record.points) else record
    path = placed(record, Placing(full_time=source.duration), f"{saved['label']} of {folder.name}")
    energies = {float(level): float(energy) for level, energy in saved.get("energies", [])}
    states = [
        replace(state, energy=energies.get(state.load_factor, state.energy))
        for state in _with_supports(_with_forces(path, folder / "curves.csv", name), folder / "reactions.csv", name)
    ]
    warnings = (*(str(text) for text in saved["warnings"]), f"read from {folder}")
    held = _held(path, elements) if elements.is_file() else None
    return replace(
        path,
        kind=saved["kind"],
        has_springs=bool(saved.get("has_springs", _of_springs(saved["kind"]))),
        lines=str(saved.get("lines", path.lines)),
        element=saved.get("element"),
        status=Status(saved["status"]),
        states=tuple(states),
        warnings=warnings,
        held=held,
    )


def _of_springs(kind: str) -> bool:
    """Return whether a kind of model consists of springs, for folders of 0.1, which do not state it."""
    return kind in MODEL_KINDS and MODEL_KINDS[kind].of_springs


def _held(path: Solution, body: Path) -> Bools | None:
    """Return which directions of nodes were held, (n_nodes, dim), from mesh.vtu; None if it differs or has none."""
    (grid,), nodes = read_grids(read_file(body, ReferenceFileError)), path.problem.mesh.nodes
    held = grid.point_arrays.get("held")
    if held is None or len(held) != len(nodes) or not np.allclose(grid.points[:, : nodes.shape[1]], nodes):
        return None
    return np.asarray(held[:, : nodes.shape[1]] > 0)


def _folder(text: str, file: Path) -> Path:
    """Return the folder of a study: the folder itself, or its only subfolder with results."""
    if (file / "summary.json").is_file():
        return file
    inner = sorted(one.parent for one in file.glob("*/summary.json") if one.parent.name != UNFINISHED)
    if len(inner) != 1:
        several = f"; give one of {', '.join(str(one) for one in inner)}" if inner else ""
        if (file / UNFINISHED).is_dir():
            several += f"; a run was interrupted, its files are in {file / UNFINISHED}: run it again"
        raise StudyError(f"{text}: this folder has no results of a study (no summary.json){several}")
    return inner[0]


def _json(file: Path) -> dict[str, Any]:
    try:
        read = json.loads(read_file(file, ReferenceFileError))
        models = read["models"]
        if not isinstance(models, dict) or not models:
            raise ValueError("models are missing")
        for name, model in models.items():
            for key in ("label", "kind", "status", "warnings"):
                if key not in model:
                    raise ValueError(f"models.{name}.{key} is missing")
            Status(model["status"])
    except (ValueError, KeyError, TypeError) as error:
        raise ReferenceFileError(f"{file} is not a summary of truespring, or damaged: {error}") from None
    return dict(read)


def _with_forces(path: Solution, curves: Path, name: str) -> tuple[State, ...]:
    """Return the states of a path with the forces of curves.csv at their levels."""
    axes = "xyz"[: path.problem.mesh.dim]
    try:
        forces = {level: _numbers(rows[0], [f"f{axis}" for axis in axes]) for level, rows in _rows(curves, name)}
    except _DAMAGED:
        return path.states  # displacements can be compared without forces
    return tuple(replace(one, applied_force=_near(forces, one, one.applied_force)) for one in path.states)


def _with_supports(states: Sequence[State], reactions: Path, name: str) -> tuple[State, ...]:
    """Return the states with force and torque of each moved support from reactions.csv at their levels."""
    if not states or not reactions.is_file():
        return tuple(states)
    dim = states[0].positions.shape[1]
    try:
        supports = {level: tuple(_support(row, dim) for row in rows) for level, rows in _rows(reactions, name)}
    except _DAMAGED:
        return tuple(states)
    return tuple(replace(one, supports=_near(supports, one, None)) for one in states)


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


# Exceptions of a damaged table.
_DAMAGED = (ReferenceFileError, ValueError, KeyError, TypeError, AttributeError)


def _rows(table: Path, name: str) -> list[tuple[float, list[dict[str, str]]]]:
    """Return the rows of a model in a table, by load factor; names of columns without their units."""
    text = read_file(table, ReferenceFileError).decode("utf-8")
    named = ({str(head).partition(" [")[0]: cell for head, cell in row.items()} for row in _table(text))
    rows = [row for row in named if row.get("model") == name]
    levels = dict.fromkeys(float(row["load_factor"]) for row in rows)
    return [(level, [row for row in rows if float(row["load_factor"]) == level]) for level in levels]


def _table(text: str) -> "csv.DictReader[str]":
    return csv.DictReader(io.StringIO(text, newline=""))


def _numbers(row: Mapping[str, str], columns: Sequence[str]) -> Floats:
    return np.array([float(row[column] or math.nan) for column in columns])


def _near(values: Mapping[float, Any], state: State, otherwise: Any) -> Any:
    """Return the value at the load factor of a state, else `otherwise`."""
    return next((value for level, value in values.items() if abs(level - state.load_factor) < 1e-6), otherwise)
