"""Running a study: solve its models and compare them."""

from collections.abc import Callable

from truespring.comparison import compare, most_moved
from truespring.equilibrium import Solution, solve, unsolved
from truespring.models import (
    Model,
    judge,
    springs_by_rule,
)
from truespring.report.result import Result
from truespring.solvers import Reporter
from truespring.study.read import Study
from truespring.study.standings import standings

#: Called with study, model and the load factor reached, for a progress bar.
Progress = Callable[[str, str, float], None]

#: Called with the name of a model and its path as soon as that is known.
Known = Callable[[str, Solution], None]


def run(
    study: Study,
    progress: Progress | None = None,
    comparing: bool = True,
    timeout: float | None = None,
    known: Known | None = None,
    refining: bool = True,
) -> Result:
    """Solve every model of a study and, if wanted, compare; a model that fails keeps what it reached.

    With a `timeout` [s] each model, and the refinement of each reference, ends after that long; another program ends
    after an hour where none is given. `known` is called with each path before the next model is solved. With
    `refining`, unless the study leaves it out, references are refined to estimate their own error.
    """
    paths: dict[str, Solution] = {}
    for name, entry in study.entries.items():

        def report(load_factor: float, iteration: int, residual: float, name: str = name) -> None:
            if progress:
                progress(study.stem, name, load_factor)

        paths[name] = follow(study, entry, report, timeout)
        if progress and entry.solves:
            progress(study.stem, name, 1.0)
        if known:
            known(name, paths[name])
    model = paths[study.model]
    probe = most_moved(model) if study.probe is None else study.probe
    names = study.references if comparing else ()
    return Result(
        title=study.title,
        file=study.file,
        problem=study.problem,
        paths=paths,
        probe=probe,
        model=study.model,
        comparisons={name: compare(model, paths[name], probe, study.tolerance) for name in names},
        tolerance=study.tolerance,
        source=study.source,
        fitness={
            name: judge(study.problem, entry, study.tolerance) for name, entry in springs_by_rule(study.entries).items()
        }
        if comparing
        else {},
        standings=standings(study, paths, names, timeout) if refining else {},
    )


def follow(study: Study, model: Model, report: Reporter | None = None, timeout: float | None = None) -> Solution:
    """Return the path of a model of a study: solved here, solved by another program, or as it was read.

    Whatever is raised on the way is this model's own: its path is at rest then, and tells why.
    """
    try:
        return solve(study.problem, model, study.solver, report, timeout)
    except Exception as error:
        return unsolved(study.problem, model, error)
