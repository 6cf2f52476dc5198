"""Open a study as a session with its loop."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from truespring.errors import LiveError
from truespring.live.coarsened import coarsened
from truespring.live.haptic import PERIOD, Haptic
from truespring.live.haptic_loop import HapticLoop
from truespring.live.loop import Loop
from truespring.live.measured import Measures
from truespring.live.record import write_session
from truespring.live.session import Live
from truespring.live.settings import FRAME
from truespring.live.twin import Twin
from truespring.models import Fem
from truespring.study import Study, read_text
from truespring.vibration.solving import can_vibrate


def opened(
    file: Path,
    *,
    model: str | None = None,
    reference: str | None = None,
    coarsen: float | str = "auto",
    twin: bool = True,
    folder: Path | None = None,
    haptic: int | None = None,
) -> tuple[Loop, str]:
    """Return the loop of a session of a study, which is not started yet, and the title of the study.

    Args:
        file: study file.
        model: name of the model that moves; None for that of the study.
        reference: name of the model of the twin; None for the last reference of the study by finite elements.
        coarsen: element size over that of the study, or "auto", see `coarsened`.
        twin: whether a reference is computed beside the model.
        folder: where the session is written to as a study; None for nowhere.
        haptic: UDP port of a haptic device, with which the body moves in step, 0 for a free one; None for none.

    Raises StudyError, LiveError and, as `Live`, ProblemError and ModelError.
    """
    found = coarsened(read_text(file), coarsen, model)
    study, name = found.study, found.study.model if model is None else model
    models = {key: one for key, one in study.entries.items() if can_vibrate(one)}
    live = Live(study.problem, study.entries[name], models=models, frame=FRAME if haptic is None else PERIOD)
    right = _reference(study, reference) if twin else None
    more: dict[str, Any] = {
        "model": name,
        "about": found.notes,
        "save": None if folder is None else _saving(study, folder),
    }
    if right is not None:
        beside = Twin(live, study.entries[right])
        about = (*found.notes, f"the reference is '{right}'")
        more |= {"twin": beside, "gauge": Measures(live, beside), "about": about}
    loop = Loop(live, **more) if haptic is None else HapticLoop(Haptic(live, haptic), **more)
    return loop, study.title


def _saving(study: Study, folder: Path) -> Callable[[Live], str]:
    """Return what writes a session of a study to a folder, and says which files it wrote."""
    return lambda live: f"written: {', '.join(str(file) for file in write_session(live, study, folder))}"


def _reference(study: Study, name: str | None) -> str | None:
    """Return the name of the model of the twin; None if the study has no finite elements to compare with."""
    if name is not None:
        if name not in study.entries or not can_vibrate(study.entries[name]):
            allowed = ", ".join(key for key, one in study.entries.items() if can_vibrate(one))
            raise LiveError(f"{study.file}: reference '{name}' is unknown, or cannot move; allowed: {allowed}")
        return name
    known = (*reversed(study.references), *study.entries)
    return next((key for key in known if study.entries[key].kind == Fem.kind), None)
