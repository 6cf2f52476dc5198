"""calibrate(cases, springs) -> Calibration: springs fitted to references, and their errors on loads held out."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from truespring.arrays import Floats
from truespring.calibration.cases import LoadCase, require_one_body
from truespring.calibration.fitted import CaseResult, error_words
from truespring.calibration.full_field import Equations, equations, fit_full_field
from truespring.calibration.identifiability import Identifiability, identifiability
from truespring.calibration.objective import Objective
from truespring.calibration.partial import GAUSS_NEWTON, fit_equilibria
from truespring.calibration.result import Calibration
from truespring.calibration.unknowns import Unknowns, make_unknowns
from truespring.deprecation import renamed_argument
from truespring.equilibrium import Solution, Status, solve
from truespring.errors import ProblemError
from truespring.models import Springs

#: Weight of the pull toward the rule: errors of 1 % weigh as much as unknowns that are all off by as much as they are.
REGULARISATION = 0.01

#: Called with what is being done and the share that is done.
Progress = Callable[[str, float], None]


@renamed_argument("report", "progress")
def calibrate(
    cases: LoadCase | Sequence[LoadCase],
    springs: Springs,
    unknowns: str = "class",
    held_out: LoadCase | Sequence[LoadCase] = (),
    regularisation: float = REGULARISATION,
    evaluations: int = 20,
    progress: Progress | None = None,
) -> Calibration:
    """Fit the stiffness of springs to what is known of load cases, and test them on cases held out.

    Full displacement fields give a start by equilibrium, which is linear in the stiffness; then the errors of the
    equilibria themselves are minimised. Springs that turn elements inside out or lose their stability under a load to
    fit, where those of the rule do not, are not taken. `unknowns` is a key of UNKNOWNS; none of them becomes negative;
    `regularisation` weighs the pull toward the rule, see `Objective`; `evaluations` bounds how often all cases are
    solved. Raises ModelError and ProblemError where springs, unknowns or cases do not fit.
    """
    fitted, apart = _several(cases), _several(held_out)
    if not fitted:
        raise ProblemError("there is no load case to calibrate to")
    if regularisation < 0 or not np.isfinite(regularisation):
        raise ProblemError(f"regularisation = {regularisation}: a number from 0 on is wanted")
    if evaluations < 1:
        raise ProblemError(f"evaluations = {evaluations}: at least 1 is wanted")
    body = fitted[0].problem
    require_one_body([(case.name, case.problem) for case in (*fitted, *apart)], body)
    found = make_unknowns(body, springs, unknowns)
    say = progress or (lambda text, share: None)
    say("equilibrium of full fields", 0.0)
    system = equations(found, fitted)
    starts = {"rule": found.start}
    if system is not None:
        starts["full field"] = fit_full_field(system, regularisation)
    rule = [solve(case.problem, found.potential(found.start), case.solver) for case in fitted]
    excused = {case.name for case, path in zip(fitted, rule, strict=True) if path.status is not Status.CONVERGED}
    objective = Objective(found, fitted, regularisation, excused)
    objectives = {name: objective.value(values) for name, values in starts.items()}
    if not np.isfinite(objectives["rule"]) and not np.isfinite(min(objectives.values())):
        raise ProblemError("the springs do not reach full load in the cases to fit: load less, or take more load_steps")
    first = min(objectives, key=lambda name: objectives[name])
    say("equilibria", 0.2)
    fit = fit_equilibria(objective, starts[first], evaluations)
    values, method = starts[first], "non-negative least squares"
    if fit.objective < objectives[first]:
        values, method = fit.values, f"{fit.method} from {'the rule' if first == 'rule' else 'the full field fit'}"
        objectives["refined"] = fit.objective
        starts["refined"] = values
    elif first == "rule":
        method = "none: nothing was found that is better than the rule"
    say("loads held out", 0.8)
    model = found.model(values)
    results = tuple(_results(fitted, apart, found, values))
    return Calibration(
        rule=springs,
        unknowns=found,
        values=values,
        model=model,
        cases=results,
        identifiability=_identified(objective, values, system),
        regularisation=regularisation,
        method=method,
        objectives=objectives,
        residuals={} if system is None else {name: system.residual(one) for name, one in starts.items()},
        solves=objective.solves + len(fitted) + 2 * len(apart),
        warnings=tuple(_warnings(found, values, results)),
    )


def _several(cases: LoadCase | Sequence[LoadCase]) -> list[LoadCase]:
    return [cases] if isinstance(cases, LoadCase) else list(cases)


def _results(
    fitted: Sequence[LoadCase], apart: Sequence[LoadCase], unknowns: Unknowns, values: Floats
) -> Iterator[CaseResult]:
    for held_out, cases in ((False, fitted), (True, apart)):
        for case in cases:
            before, after = (
                _labelled(solve(case.problem, unknowns.potential(one), case.solver), label)
                for one, label in ((unknowns.start, "springs (rule)"), (values, "springs (calibrated)"))
            )
            yield CaseResult(case, held_out, before, after)


def _labelled(path: Solution, label: str) -> Solution:
    return replace(path, label=label, kind="springs")


def _identified(objective: Objective, values: Floats, system: Equations | None) -> Identifiability:
    """What the data determine: of what was minimised, of very many unknowns the equilibrium of full fields."""
    names, regularisation = objective.unknowns.names, objective.regularisation
    if len(names) <= GAUSS_NEWTON:
        derivative = objective.jacobian(values)[: -len(names)]
        return identifiability(
            derivative, names, regularisation, "displacements and forces, by the springs' equilibria"
        )
    if system is None:
        return identifiability(np.zeros((0, len(names))), names, regularisation, "")
    few = len(names) <= 3000
    matrix = system.matrix.toarray() / system.size if few else np.zeros((0, len(names)))
    return identifiability(matrix, names, regularisation, "equilibrium at the known displacements")


def _warnings(unknowns: Unknowns, values: Floats, results: Sequence[CaseResult]) -> Iterator[str]:
    for one in results:
        reference = one.case.reference
        if reference is not None and reference.status is not Status.CONVERGED:
            yield f"{one.case.name}: the reference is {reference.status}: {reference.status.advice}"
        for path, what in ((one.before, "the rule's springs"), (one.after, "the calibrated springs")):
            if path.status is not Status.CONVERGED:
                yield f"{one.case.name}: {what} are {path.status} at load factor {path.load_factor:.6g}"
        before, after = one.pair
        if one.held_out and before is not None and (after is None or after > before):
            yield (
                f"{one.case.name}: calibration made it worse, from {error_words(one.both[0])} to "
                f"{error_words(one.both[1])}: springs fitted to some loads are not better under all"
            )
    gone = [name for name, value in zip(unknowns.names, values, strict=True) if value < 1e-3]
    if gone:
        more = f" and {len(gone) - 3} more" if len(gone) > 3 else ""
        yield f"the data left nothing of {', '.join(gone[:3])}{more}: these springs have no stiffness any more"
