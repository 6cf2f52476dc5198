"""Write what was done in a session: a study that solves it again, and a table that repeats it bit for bit."""

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from truespring.columns import Columns
from truespring.errors import LiveError
from truespring.live.commands import COMMANDS, Command
from truespring.live.lives import Life, lives
from truespring.live.session import Live, replayed
from truespring.live.tables import session_tables
from truespring.mesh.selections import AXES
from truespring.study import PATH_COLUMNS, PATH_PLACE, Study, moved_document, read_text, toml_text

#: The files of a session: the study that solves it again, the table of commands and places, the study it began with.
SESSION, PULL, BEGUN = "session.toml", "pull.csv", "study.toml"
# Settings of a session, in the column `kind`, before its commands.
_SETTINGS = ("frame", "frames", "halvings", "iterations", "model", "scheme")
# Kind of the rows with the further points of the command before them.
_FURTHER = "further"
_HEAD = "# A live session as a study: what was seen is the motion of the compared model, in the steps of the session.\n"


class Recorded(NamedTuple):
    """A session that was read.

    Attributes:
        study: the study that it was begun with.
        model: name of its model.
        frame: time between frames [s].
        frames: number of frames.
        scheme, step, iterations: see `Settings`.
        before, commands: see `Log`.
    """

    study: Study
    model: str
    frame: float
    frames: int
    scheme: str
    step: float
    iterations: int
    before: tuple[Command, ...]
    commands: tuple[Command, ...]


def write_session(live: Live, study: Study, folder: str | Path) -> tuple[Path, ...]:
    """Write a session since its begin or its last restart, and return the files.

    session.toml is a study of the same motion, by the same model and in the same steps, beside the references of the
    study; study.toml is what the session began with. pull.csv has all commands, and the places of grasps and spheres at
    the ends of frames.

    A study has one model and one material: where they change, session.toml ends. A note of the session says so.

    Raises LiveError if no frame can be written, OSError if a file cannot be.
    """
    folder = Path(folder)
    frames = live.log.repeatable
    folder.mkdir(parents=True, exist_ok=True)
    acted = lives(live.log, frames, [one.name for one in live.begun.problem.touching])
    files = (folder / SESSION, folder / PULL, folder / BEGUN)
    files[2].write_text(toml_text(moved_document(study, folder)), encoding="utf-8")
    _write_table(files[1], live, study, acted)
    same = _same_mesh(live, study)
    notes = list(_notes(live, frames, same))
    live.notes += [one for one in notes if one not in live.notes]
    if not frames or not same:
        files[0].unlink(missing_ok=True)  # of another session
        return files[1:]
    head = _HEAD + "".join(f"# {one}\n" for one in notes)
    files[0].write_text(head + toml_text(session_tables(live, study, acted, frames, folder)), encoding="utf-8")
    return files


def _notes(live: Live, frames: int, same_mesh: bool) -> Iterator[str]:
    """Yield what session.toml does not have."""
    last, frame = live.log.frames, live.log.frame
    if not last:
        yield "nothing has moved yet: session.toml is not written"
    elif not same_mesh:
        yield "the mesh is no longer that of the study: session.toml is not written, pull.csv repeats the session"
    elif frames < last:
        kinds = dict.fromkeys(one.kind for one in live.log.commands if not COMMANDS[one.kind].repeats)
        kept = f"it ends at {frames * frame:.4g} s" if frames else "it is not written"
        yield (
            f"session.toml cannot repeat {', '.join(kinds)}: {kept}, pull.csv repeats all {last * frame:.4g} s. "
            "Restart after such a change, and a study begins with it"
        )
    if frames and live.halved:
        yield f"the step was halved in the session: session.toml has the last one, {live.step_length:.3g} s"


def _same_mesh(live: Live, study: Study) -> bool:
    """Return whether a session began with the mesh of a study."""
    mine, theirs = live.begun.problem.mesh, study.problem.mesh
    return np.array_equal(mine.nodes, theirs.nodes) and np.array_equal(mine.elements, theirs.elements)


# --- the table ------------------------------------------------------------------------------------------------------


def _write_table(file: Path, live: Live, study: Study, acted: Sequence[Life]) -> None:
    """Write settings, commands and places of a session; numbers have all digits."""
    axes = AXES[: live.dim]
    with file.open("w", newline="", encoding="utf-8") as stream:
        table = csv.DictWriter(stream, ["frame", "t", "kind", "name", *axes, "radius", "value"], restval="")
        heads = {"t": "t [s]", "radius": "radius [m]"} | {axis: f"{axis} [m]" for axis in axes}
        table.writerow({key: heads.get(key, key) for key in table.fieldnames})
        table.writerows(_settings(live, study))
        for one in (*live.log.before, *live.log.commands):
            table.writerows(_command_rows(one, live))
        for life in acted:
            table.writerows(_row(frame, live, PATH_PLACE, life.name, place) for frame, place in life.places)


def _settings(live: Live, study: Study) -> Iterator[dict[str, str]]:
    """Yield the rows of settings."""
    log, begun = live.log, live.begun
    model = next((name for name, one in study.entries.items() if one is begun.model), study.model)
    yield {"kind": "frame", "value": repr(log.frame)}
    yield {"kind": "frames", "value": repr(log.frames)}
    yield {"kind": "halvings", "value": repr(study.halvings)}
    yield {"kind": "model", "name": model}
    yield {"kind": "scheme", "name": begun.scheme, "value": repr(begun.longest)}
    yield {"kind": "iterations", "value": repr(live.settings.iterations)}


def _command_rows(command: Command, live: Live) -> Iterator[dict[str, str]]:
    """Yield the row of a command, and a row for each further point of its place."""
    points = [command.place[k : k + live.dim] for k in range(0, len(command.place), live.dim)] or [()]
    values = {"radius": command.radius, "value": command.value}
    stated = {key: repr(float(value)) for key, value in values.items() if value is not None}
    if command.elements is not None:
        stated["value"] = " ".join(map(str, command.elements))
    yield _row(command.frame, live, command.kind, command.name, points[0]) | stated
    yield from (_row(command.frame, live, _FURTHER, "", point) for point in points[1:])


def _row(frame: int, live: Live, kind: str, name: str, place: Sequence[float]) -> dict[str, str]:
    """Return the row of a command or a place."""
    time = "" if frame < 0 else repr(frame * live.log.frame)
    coordinates = {axis: repr(float(one)) for axis, one in zip(AXES, place, strict=False)}
    return {"frame": str(frame), "t": time, "kind": kind, "name": name, **coordinates}


# --- and back -------------------------------------------------------------------------------------------------------


def read_session(folder: str | Path) -> Recorded:
    """Return the session in a folder; raise LiveError or StudyError with file and line if a file is wrong."""
    folder = Path(folder)
    file = folder / PULL
    table = Columns(file, PATH_COLUMNS, ("frame", "t", "kind", "name", "x", "y", "value"), LiveError)
    texts = {name: table.texts(name) for name in table.columns}
    kinds, names, values, frames = (texts[name] for name in ("kind", "name", "value", "frame"))
    settings = {kinds[row]: (names[row], values[row]) for row in range(table.n_rows) if not frames[row]}
    missing = [key for key in _SETTINGS if key not in settings]
    if missing:
        raise LiveError(f"{file}: no row has kind = '{missing[0]}': the file is not one of a session")
    rows = [row for row in range(table.n_rows) if frames[row] and kinds[row] != PATH_PLACE]
    commands: list[Command] = []
    for row in rows:
        one = _command(table, file, row, {name: several[row] for name, several in texts.items()})
        if one.kind == _FURTHER and commands:
            begun = commands.pop()
            one = replace(begun, place=(*begun.place, *one.place))
        commands.append(one)
    try:
        n_frames, halvings, iterations = (int(settings[key][1]) for key in ("frames", "halvings", "iterations"))
        frame, step = (float(settings[key][1]) for key in ("frame", "scheme"))
    except ValueError as error:
        raise LiveError(f"{file}: value of a setting: {error}") from None
    study = read_text(folder / BEGUN).study(halvings=halvings, balanced=False)
    model = settings["model"][0]
    if model not in study.entries:
        raise LiveError(f"{file}: model '{model}' is not in {BEGUN}; there are: {', '.join(study.entries)}")
    before = tuple(one for one in commands if one.frame < 0 and one.kind != "model")
    later = tuple(one for one in commands if one.frame >= 0)
    scheme = settings["scheme"][0]
    return Recorded(study, model, frame, n_frames, scheme, step, iterations, before, later)


def _command(table: Columns, file: Path, row: int, texts: Mapping[str, str]) -> Command:
    """Return the command in a row, counted from 0, from its texts by column."""
    try:
        place = tuple(float(texts[axis]) for axis in AXES if texts.get(axis))
        known = int(texts["frame"]), texts["kind"], texts["name"], place
        if texts["kind"] in COMMANDS and COMMANDS[texts["kind"]].blade:
            return Command(*known, elements=tuple(int(one) for one in texts["value"].split()))
        radius, value = (float(texts[key]) if texts.get(key) else None for key in ("radius", "value"))
        return Command(*known, radius, value)
    except ValueError as error:
        raise LiveError(f"{file}:{table.line(row)}: {error}") from None


def replay(folder: str | Path) -> Live:
    """Return a session that has repeated the one in a folder: bit for bit on one thread.

    Raises LiveError or StudyError with file and line if a file is wrong.
    """
    found = read_session(folder)
    study = found.study
    try:
        live = Live(
            study.problem,
            study.entries[found.model],
            models=study.entries,
            frame=found.frame,
            scheme=found.scheme,
            step=found.step,
            iterations=found.iterations,
        )
        for one in found.before:
            live.repeat(one)
        if found.before:
            live.restart()
        return replayed(live, found.commands, found.frames)
    except LiveError as error:
        raise LiveError(f"{Path(folder) / PULL}: {error}") from None
