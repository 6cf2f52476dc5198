"""Separate the errors of a motion: of the time step, and of the solver."""

from dataclasses import replace

from truespring.comparison import compare
from truespring.equilibrium import Solution, error_words, solve
from truespring.models import Model
from truespring.problem import Problem
from truespring.report.result import MotionErrors
from truespring.study.case import Case


def motion_errors(case: Case, path: Solution, probe: int, timeout: float | None = None) -> MotionErrors | None:
    """Return the errors of step and solver in the motion of the compared model; None at rest.

    The motion is computed again with steps half as long, and if the number of iterations is fixed, with solved steps.
    `timeout` limits the time of each [s].
    """
    dynamics = case.problem.dynamics
    model = case.entries[case.model]
    if dynamics is None or not model.solves or not path.complete:
        return None
    solved = path
    solver: float | None = 0.0
    if dynamics.iterations:
        again = _again(case, model, replace(case.problem, dynamics=replace(dynamics, iterations=0)), timeout)
        if isinstance(again, str):
            return MotionErrors(None, None, (f"the steps could not be solved: {again}",))
        solved, solver = again, compare(path, again, probe).rms_error
    halved = replace(dynamics, iterations=0, substeps=2 * dynamics.substeps)
    finer = _again(case, model, replace(case.problem, dynamics=halved), timeout)
    if isinstance(finer, str):
        return MotionErrors(None, solver, (f"steps half as long were not computed: {finer}",))
    return MotionErrors(compare(solved, finer, probe).rms_error, solver)


def _again(case: Case, model: Model, problem: Problem, timeout: float | None) -> Solution | str:
    """Return the solution of the compared model of another problem, or why there is none."""
    try:
        path = solve(problem, model, case.solver, None, timeout)
    except Exception as error:  # keep the results of the study
        return error_words(error)
    return path if path.complete else next(iter(path.warnings), str(path.status))
