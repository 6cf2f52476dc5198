"""The tables of a study that solves a session again."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from truespring.live.lives import Life, gravity
from truespring.live.session import Live
from truespring.live.settings import steps_in
from truespring.material import Material
from truespring.study import Study, moved_document
from truespring.tools import Grasp, Tool

# About so many states are recorded.
_RECORDS = 100
# Keys of the solver that are for equilibria.
_AT_REST = ("control", "on", "direction", "to", "max_steps")


def session_tables(live: Live, study: Study, acted: Sequence[Life], frames: int, folder: Path) -> dict[str, Any]:
    """Return the tables of the study of the first frames of a session, for a file in a folder.

    Args:
        live: the session.
        study: the study that it was begun with.
        acted: its grasps and spheres.
        frames: number of frames.
        folder: where the study is to be written, beside pull.csv.
    """
    document = moved_document(study, folder)
    duration = frames * live.log.frame
    document["title"] = f"{study.title}, as it was pulled"
    if study.halvings:
        document["mesh"] = {key: getattr(study.keys.mesh, key) for key in document["mesh"]}
    _set_materials(document, live, study)
    _set_histories(document, live, study)
    _set_touching(document, live, duration)
    _set_gravity(document, live, study, frames)
    for life in acted:
        table = "grasp" if life.command.kind == "grasp" else "tool"
        document.setdefault(table, []).append(_touching(life, live.log.frame))
    document["dynamics"] = _dynamics(document.get("dynamics", {}), live, frames)
    if "solver" in document:
        document["solver"] = {key: one for key, one in document["solver"].items() if key not in _AT_REST}
    _set_compared(document, live, study)
    return {key: document[key] for key in _ordered(document)}


def _ordered(document: Mapping[str, Any]) -> list[str]:
    """Return the tables in the order of a study file: what moves before the models."""
    last = ("tool", "grasp", "dynamics", "solver", "models", "compare")
    return [key for key in document if key not in last] + [key for key in last if key in document]


def _set_materials(document: dict[str, Any], live: Live, study: Study) -> None:
    """Write materials that are not those of the study: a density that was assumed, changed moduli."""
    begun, stated = live.begun.problem, study.problem
    several = [(document.get("material"), begun.material, stated.material)]
    regions = zip(document.get("region", []), begun.regions, stated.regions, strict=True)
    several += [(table, mine.material, theirs.material) for table, mine, theirs in regions]
    for table, mine, theirs in several:
        if table is not None and mine is not None and mine != theirs:
            _set_material(table, mine)


def _set_material(table: dict[str, Any], material: Material) -> None:
    for key in ("mu", "bulk"):
        table.pop(key, None)
    table |= {"young": material.young, "poisson": material.poisson}
    if material.density is not None:
        table["density"] = material.density


def _set_histories(document: dict[str, Any], live: Live, study: Study) -> None:
    """Write the histories of supports and loads that are not those of the study."""
    begun, stated = live.begun.problem, study.problem
    several = {
        "support": [(one.over, other.over) for one, other in zip(begun.supports, stated.supports, strict=True)],
        "load": [(one.over, other.over) for one, other in zip(begun.loads, stated.loads, strict=True)],
    }
    for key, histories in several.items():
        for table, (mine, theirs) in zip(document.get(key, []), histories, strict=True):
            if mine is not None and mine != theirs:
                table["over"] = [[float(value) for value in row] for row in mine]


def _set_touching(document: dict[str, Any], live: Live, duration: float) -> None:
    """Let the tools and grasps of the study act up to the end of the session: they rest at the end of their path."""
    begun = live.begun.problem
    touching: dict[str, Sequence[Tool | Grasp]] = {"tool": begun.tools, "grasp": begun.grasps}
    for key, several in touching.items():
        kept = []
        for table, one in zip(document.get(key, []), several, strict=True):
            rows = np.asarray(one.path, dtype=float)
            if one.during is not None and one.during[0] >= duration:
                continue
            if one.during is not None:
                table["during"] = [float(one.during[0]), min(float(one.during[1]), duration)]
            elif rows.ndim == 2 and rows[-1, 0] < duration:
                table["path"] = [*rows.tolist(), [duration, *rows[-1, 1:].tolist()]]
            kept.append(table)
        if kept:
            document[key] = kept
        else:
            document.pop(key, None)


def _set_gravity(document: dict[str, Any], live: Live, study: Study, frames: int) -> None:
    """Write gravity as it was switched: the history of the study's own, or a load of its own."""
    own = [number for number, load in enumerate(study.problem.loads) if load.acceleration_of_body is not None]
    rows = [[frame * live.log.frame, share] for frame, share in gravity(live.log, frames, live.begun.gravity)]
    usual = 1.0 if own else 0.0
    if all(share == usual for _, share in rows):
        return
    if len(own) == 1 and study.problem.loads[own[0]].over is None:
        document["load"][own[0]]["over"] = rows
        return
    more = [[time, share - usual] for time, share in rows]
    document.setdefault("load", []).append({"gravity": live.full_gravity.tolist(), "over": more})


def _touching(life: Life, frame: float) -> dict[str, Any]:
    """Return the table of a grasp or sphere."""
    command = life.command
    place = [float(one) for one in command.place]
    own = {"at": place, "origin": place} if command.kind == "grasp" else {"shape": "sphere"}
    during = [life.begin * frame, life.end * frame]
    values = {"radius": command.radius, "stiffness": command.value, "path": "pull.csv", "during": during}
    return {"name": life.name, **own, **values}


def _dynamics(stated: Mapping[str, Any], live: Live, frames: int) -> dict[str, Any]:
    """Return the table of a motion by the scheme of the session, in its steps."""
    dynamics, settings = live.begun.problem.dynamics, live.settings
    assert dynamics is not None  # a session completes it
    scheme, step = live.begun.scheme, live.step_length
    if frames < live.log.frames:  # the present step may be that of another material
        step = live.log.frame / steps_in(live.log.frame, live.begun.longest)
    duration = frames * live.log.frame
    damping = {"stiffness": dynamics.damping.stiffness, "mass": dynamics.damping.mass}
    steps = round(duration / step)
    found = {
        "duration": duration,
        "step": step,
        "scheme": scheme,
        "record": duration / _records(steps),
        "start": live.begun.start,
    }
    found |= {"damping": damping} if any(damping.values()) else {}
    found |= {"iterations": settings.iterations} if settings.iterations and scheme != "leapfrog" else {}
    return found | {key: stated[key] for key in ("velocity", "creep") if key in stated}


def _records(steps: int) -> int:
    """Return a number of recorded states that divides a number of steps, which then keep their length: about 100."""
    divisors = [one for one in range(1, steps + 1) if steps % one == 0]
    return min(divisors, key=lambda one: abs(np.log(one / _RECORDS)))


def _set_compared(document: dict[str, Any], live: Live, study: Study) -> None:
    """Compare the model of the session with the references of the study; leave out models that are only read."""
    name = next((name for name, one in study.entries.items() if one is live.begun.model), study.model)
    read = [name for name, one in study.entries.items() if not one.solves]
    document["models"] = {key: one for key, one in document["models"].items() if key not in read}
    references = [study.model, *study.references]
    compared = {"refine": False} | document.get("compare", {})
    compared["model"] = name
    compared["references"] = [one for one in dict.fromkeys(references) if one != name and one not in read]
    document["compare"] = compared
