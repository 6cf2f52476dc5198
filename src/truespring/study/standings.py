"""Estimate the discretisation error of the references of a study by refinement."""

from collections.abc import Mapping, Sequence

from truespring.equilibrium import Solution, error_words
from truespring.refining import COST, Standing, own_error, standing, work_of
from truespring.study.case import Case


def standings(
    case: Case, paths: Mapping[str, Solution], names: Sequence[str], timeout: float | None = None
) -> dict[str, Standing]:
    """Return the discretisation error of each reference in `names`; empty if the study has `refine = false`.

    The total work is limited to COST times that of the solutions in `paths`, the time of each reference to `timeout`
    [s].
    """
    if not case.refine:
        return {}
    left = COST * sum(work_of(path) for path in paths.values() if path.solved)
    found = {}
    # References with a law are refined first: their error matters most if the work does not suffice for all.
    for name in sorted(names, key=lambda name: case.entries[name].law is None):
        try:
            own = own_error(paths[name], case.entries[name], case.solver, left, timeout)
            left -= own.work
            found[name] = standing(paths[case.model], own)
        except Exception as error:  # keep the results of the study
            found[name] = Standing(None, error_words(error))
    return {name: found[name] for name in names}
