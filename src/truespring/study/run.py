"""Solve the models of a study and compare them."""

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
from truespring.study.case import Case
from truespring.study.splits import motion_errors
from truespring.study.standings import standings

#: Callback with study, model and the load factor reached, for a progress bar.
Progress = Callable[[str, str, float], None]

#: Callback with the name of a model and its solution, called when the model is solved.
Known = Callable[[str, Solution], None]


def run(
    case: Case,
    progress: Progress | None = None,
    comparing: bool = True,
    timeout: float | None = None,
    known: Known | None = None,
    refining: bool = True,
) -> Result:
    """Solve every model of a case and compare the first springs, or the model of `[compare]`, with the references.

    A model that fails keeps the load levels that it reached.

    Args:
        case: problem, solver and models: a study, or those of `case_of`.
        progress: callback for a progress bar.
        comparing: whether to compare the models and judge the springs.
        timeout: time limit [s] of each model and of the refinement of each reference; default: none, an hour for other
            programs.
        known: callback for each solution, called before the next model is solved.
        refining: whether to refine references to estimate their discretisation error, if the study allows it.
    """
    paths: dict[str, Solution] = {}
    for name, entry in case.entries.items():

        def report(load_factor: float, iteration: int, residual: float, name: str = name) -> None:
            if progress:
                progress(case.stem, name, load_factor)

        paths[name] = follow(case, entry, report, timeout)
        if progress and entry.solves:
            progress(case.stem, name, 1.0)
        if known:
            known(name, paths[name])
    model = paths[case.model]
    probe = most_moved(model) if case.probe is None else case.probe
    names = case.references if comparing else ()
    return Result(
        title=case.title,
        file=case.file,
        problem=case.problem,
        solutions=paths,
        probe=probe,
        model=case.model,
        comparisons={name: compare(model, paths[name], probe, case.tolerance) for name in names},
        tolerance=case.tolerance,
        source=case.source,
        fitness={
            name: judge(case.problem, entry, case.tolerance) for name, entry in springs_by_rule(case.entries).items()
        }
        if comparing
        else {},
        standings=standings(case, paths, names, timeout) if refining else {},
        splits=motion_errors(case, model, probe, timeout) if comparing and refining else None,
        form=case.form,
    )


def follow(case: Case, model: Model, report: Reporter | None = None, timeout: float | None = None) -> Solution:
    """Return the solution of one model of a case: solved here, solved by another program, or read from a file.

    If the model raises an exception, return a solution without load levels that has the reason as a warning.
    """
    try:
        return solve(case.problem, model, case.solver, report, timeout)
    except Exception as error:
        return unsolved(case.problem, model, error)
