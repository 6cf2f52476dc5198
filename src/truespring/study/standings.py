"""How far the references of a study are themselves off, by refinement that costs little beside the study."""

from collections.abc import Mapping, Sequence

from truespring.equilibrium import Solution, error_words
from truespring.refining import COST, Standing, own_error, standing, work_of
from truespring.study.read import Study


def standings(
    study: Study, paths: Mapping[str, Solution], names: Sequence[str], timeout: float | None = None
) -> dict[str, Standing]:
    """Return how each reference stands to its own limit; empty where the study leaves refinement out.

    All of it takes at most COST times the work of the study's own paths, and each reference `timeout` [s] at most.
    """
    if not study.refine:
        return {}
    left = COST * sum(work_of(path) for path in paths.values() if path.solved)
    found = {}
    # What has a law tells most by its limit: springs as references come last.
    for name in sorted(names, key=lambda name: study.entries[name].law is None):
        try:
            own = own_error(paths[name], study.entries[name], study.solver, left, timeout)
            left -= own.work
            found[name] = standing(paths[study.model], own)
        except Exception as error:  # what was solved before is not lost for that
            found[name] = Standing(None, error_words(error))
    return {name: found[name] for name in names}
