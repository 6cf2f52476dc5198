"""Modes of every model of a study."""

from collections.abc import Callable

from truespring.errors import StudyError
from truespring.study import Study
from truespring.vibration.beside import StudyModes
from truespring.vibration.result import Modes
from truespring.vibration.solving import can_vibrate, modes

# Modes of each model beyond those asked for: one of them may have the shape of one of the others.
_FURTHER = 3


def study_modes(study: Study, count: int = 6, progress: Callable[[str, str, float], None] | None = None) -> StudyModes:
    """Return the `count` lowest modes of every model of a study that has a potential.

    They are compared with those of the first of `[compare] references`, else of the compared model. `progress` is
    called with the stem of the study, the name of a model, and 0 or 1.

    Raises StudyError without a density, or if no model has a potential.
    """
    names = [name for name, model in study.entries.items() if can_vibrate(model)]
    if not names:
        raise StudyError(
            f"{study.file}: models: modes need a model that truespring solves: add springs or finite elements"
        )
    found: dict[str, Modes] = {}
    for name in names:
        if progress:
            progress(study.stem, name, 0.0)
        with study.text.places.at(*(("material",) if study.problem.body.density is None else ("models", name))):
            found[name] = modes(study.problem, study.entries[name], count + _FURTHER, study.solver.linear)
        if progress:
            progress(study.stem, name, 1.0)
    return StudyModes(
        title=study.title,
        file=study.file,
        count=count,
        found=found,
        reference=next(name for name in (*study.references, study.model, *names) if name in found),
        left_out=tuple(name for name in study.entries if name not in found),
    )
