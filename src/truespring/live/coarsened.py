"""A study on a coarser mesh, so that its motion can be computed in real time on this machine."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from truespring.errors import LiveError, TruespringError
from truespring.live.completed import completed
from truespring.live.resting import resting
from truespring.live.session import Live
from truespring.models import Model
from truespring.problem import Problem
from truespring.report.quantity import quantity
from truespring.study import Study, StudyText

#: Largest share of the time that steps may take, so that server, page and twin have the rest.
SHARE = 0.6
# Factors of the element size that "auto" tries.
_FACTORS = (1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
# At most so many frames are timed, for at most about so long [s].
_FRAMES, _PATIENCE = 10, 0.5
# Costs of leapfrog fall with this power of the size of elements: fewer nodes and steps, and better use of caches.
_POWER = {2: 4, 3: 5}


@dataclass(frozen=True, eq=False)
class Coarsened:
    """A study as it is opened.

    Attributes:
        study: the study, with its mesh made coarser.
        factor: element size over that of the file.
        notes: what was done, in sentences.
    """

    study: Study
    factor: float
    notes: tuple[str, ...]


def coarsened(text: StudyText, factor: float | str, model: str | None = None) -> Coarsened:
    """Return a study with elements `factor` times as large, or "auto" for the smallest factor that is fast enough.

    `model` is the name of the model that will move, None for that of the study. "auto" opens a study of which no
    coarser mesh can be made as it is.

    Raises StudyError as `StudyText.study`, LiveError if the study states no size of elements.
    """
    finest = text.study()
    if not isinstance(factor, str):
        return Coarsened(finest, 1.0, ()) if factor == 1 else _by(text, finest, factor)
    name = _model(finest, model)
    share = cost(finest.problem, finest.entries[name])
    best = Coarsened(finest, 1.0, ())
    while share > SHARE:
        wanted = best.factor * (share / SHARE) ** (1 / _POWER[finest.problem.mesh.dim])
        larger = [one for one in _FACTORS if one > best.factor]
        if not larger:
            break
        following = next((one for one in larger if one >= 0.95 * wanted), larger[-1])
        try:
            best = _by(text, finest, following)
            share = cost(best.study.problem, best.study.entries[name])
        except TruespringError as error:
            return replace(best, notes=(*best.notes, f"no coarser mesh: {error}", _slow(share)))
    return best if share <= SHARE else replace(best, notes=(*best.notes, _slow(share)))


def cost(problem: Problem, model: Model) -> float:
    """Return the time that a frame takes on this machine over the time between frames [-], without loads."""
    live = Live(resting(completed(problem)[0]), model)
    live.step()  # compiles
    taken: list[float] = []
    while len(taken) < _FRAMES and sum(taken) < _PATIENCE:  # the smallest: other programs may have the machine
        begin = time.perf_counter()
        live.step()
        taken.append(time.perf_counter() - begin)
    return min(taken) / live.settings.frame


def _slow(share: float) -> str:
    return f"too slow for this machine: a second of motion takes about {share:.2g} s"


def _by(text: StudyText, finest: Study, factor: float) -> Coarsened:
    """Return a study with elements `factor` times as large."""
    changes = _changes(text.document.get("mesh", {}), finest, factor)
    if changes is None:
        raise LiveError(f"{text.file}: mesh: its file states no size of elements: give a coarser mesh, or --coarsen 1")
    study = text.study(changes)
    (key, value), before, after = *changes.items(), finest.problem.mesh, study.problem.mesh
    size = f"{quantity(_edge(finest), 'm')} made {quantity(_edge(study), 'm')}"
    note = f"coarser than the study, for real time: elements of {size}, {before.n_nodes} nodes made {after.n_nodes}"
    return Coarsened(study, factor, (f"{note} ({key} = {value})",))


def _changes(table: Mapping[str, Any], finest: Study, factor: float) -> dict[str, Any] | None:
    """Return the change of a study that makes its elements larger; None if its mesh comes from a file."""
    if "elements" in table:
        return {"mesh.elements": [max(1, round(count / factor)) for count in table["elements"]]}
    if "voxels" in table:
        return {"mesh.edge": f"{factor * _edge(finest):.6g} m"}
    return None


def _edge(study: Study) -> float:
    """Return a typical edge of an element [m]."""
    mesh = study.problem.mesh
    return float(np.median(np.abs(mesh.measures)) ** (1 / mesh.dim))


def _model(study: Study, name: str | None) -> str:
    """Return the name of the model that moves; raise LiveError if it is unknown."""
    chosen = study.model if name is None else name
    if chosen not in study.entries:
        raise LiveError(f"{study.file}: model '{chosen}' is unknown; allowed: {', '.join(study.entries)}")
    return chosen
