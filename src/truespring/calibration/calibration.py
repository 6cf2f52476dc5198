"""Fit the stiffness of springs to references, and test them on loads held out."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from truespring.arrays import Floats
from truespring.calibration.cases import LoadCase, require_one_body
from truespring.calibration.fitted import CaseResult, error_words
from truespring.calibration.full_field import Equations, equations, fit_full_field
from truespring.calibration.identifiability import Identifiability, identifiability
from truespring.calibration.kinds import make_unknowns
from truespring.calibration.objective import Objective
from truespring.calibration.partial import GAUSS_NEWTON, fit_equilibria
from truespring.calibration.result import Calibration
from truespring.calibration.unknowns import Unknowns
from truespring.deprecation import renamed_argument
from truespring.equilibrium import Solution, Status, solve
from truespring.errors import ProblemError
from truespring.models import Springs
from truespring.showing.progress import chosen, steps

#: Default weight of the regularisation: an error of 1 % weighs as much as a change of all unknowns by 1.
REGULARISATION = 0.01

#: Called with the current step and the share of the work done.
Progress = Callable[[str, float], None]


@renamed_argument("report", "progress")
def calibrate(
    cases: LoadCase | Sequence[LoadCase],
    springs: Springs,
    unknowns: str | None = None,
    held_out: LoadCase | Sequence[LoadCase] = (),
    regularisation: float = REGULARISATION,
    evaluations: int = 20,
    progress: bool | Progress | None = True,
) -> Calibration:
    """Fit the stiffness of springs to references of load cases, and test them on cases held out.

    Full displacement fields give a start by equilibrium, which is linear in the stiffness; then the errors of the
    equilibria are minimised. Springs that are inverted or unstable under a fitted load are rejected, unless those of
    the rule are too.

    Args:
        cases: load cases to fit.
        springs: springs of a rule to start from.
        unknowns: a key of UNKNOWNS, by default the first that suits the springs; unknowns stay non-negative.
        held_out: load cases to test on.
        regularisation: weight of the term toward the rule, see `Objective`.
        evaluations: largest number of evaluations of the objective, each of which solves all cases.
        progress: whether to show a progress bar in a notebook or terminal; or a callback with the
            current step and the share of the work done.

    Raises ModelError or ProblemError if springs, unknowns or cases do not fit together.

    Example:
        >>> import truespring as ts
        >>> problem = ts.Problem(
        ...     ts.rectangle((0.04, 0.01), (4, 1)),
        ...     ts.Material(young=10e3, poisson=0.3),
        ...     ts.PlaneStress(thickness=0.01),
        ...     supports=[ts.Fixed("left")],
        ...     loads=[ts.Force("right", (0.1, 0.0))],
        ... )
        >>> reference = ts.solve(problem, ts.Fem("neo-hookean"))
        >>> case = ts.LoadCase("pulled", problem, reference)
        >>> found = ts.calibrate(case, ts.Springs("isotropic"), regularisation=0.0, evaluations=3)
        >>> fitted = found.cases[0]
        >>> bool(fitted.error(fitted.after, "displacement") < fitted.error(fitted.before, "displacement"))
        True
    """
    fitted, tested = _several(cases), _several(held_out)
    if not fitted:
        raise ProblemError("there is no load case to calibrate to")
    if regularisation < 0 or not np.isfinite(regularisation):
        raise ProblemError(f"regularisation = {regularisation}: it must be finite and at least 0")
    if evaluations < 1:
        raise ProblemError(f"evaluations = {evaluations}: it must be at least 1")
    body = fitted[0].problem
    require_one_body([(case.name, case.problem) for case in (*fitted, *tested)], body)
    found = make_unknowns(body, springs, unknowns)
    with chosen(progress, lambda: steps("calibration")) as advance:
        return _calibrated(found, springs, (fitted, tested), regularisation, evaluations, advance or _unseen)


def _unseen(step: str, share: float) -> None:
    """Show no progress."""


def _calibrated(
    found: Unknowns,
    springs: Springs,
    cases: tuple[Sequence[LoadCase], Sequence[LoadCase]],
    regularisation: float,
    evaluations: int,
    progress: Progress,
) -> Calibration:
    """Return the fitted springs; see `calibrate`. `cases` are those to fit and those held out."""
    fitted, tested = cases
    progress("equilibrium of full fields", 0.0)
    system = equations(found, fitted)
    starts = {"rule": found.start}
    if system is not None:
        starts["full field"] = fit_full_field(system, regularisation)
    rule = [solve(case.problem, found.potential(found.start), case.solver) for case in fitted]
    excused = {case.name for case, path in zip(fitted, rule, strict=True) if path.status is not Status.CONVERGED}
    objective = Objective(found, fitted, regularisation, excused)
    objectives = {name: objective.value(values) for name, values in starts.items()}
    if not np.isfinite(objectives["rule"]) and not np.isfinite(min(objectives.values())):
        raise ProblemError("the springs do not reach full load in the cases to fit: use less load or more load_steps")
    first = min(objectives, key=lambda name: objectives[name])
    progress("equilibria", 0.2)
    fit = fit_equilibria(objective, starts[first], evaluations)
    values, method = starts[first], "non-negative least squares"
    if fit.objective < objectives[first]:
        values, method = fit.values, f"{fit.method} from {'the rule' if first == 'rule' else 'the full field fit'}"
        objectives["refined"] = fit.objective
        starts["refined"] = values
    elif first == "rule":
        method = "none: no improvement over the rule was found"
    progress("loads held out", 0.8)
    model = found.model(values)
    results = tuple(_results(fitted, tested, found, values))
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
        solves=objective.solves + len(fitted) + 2 * len(tested),
        warnings=tuple(_warnings(found, values, results)),
    )


def _several(cases: LoadCase | Sequence[LoadCase]) -> list[LoadCase]:
    return [cases] if isinstance(cases, LoadCase) else list(cases)


def _results(
    fitted: Sequence[LoadCase], tested: Sequence[LoadCase], unknowns: Unknowns, values: Floats
) -> Iterator[CaseResult]:
    for held_out, cases in ((False, fitted), (True, tested)):
        for case in cases:
            before, after = (
                _labelled(solve(case.problem, unknowns.potential(one), case.solver), label)
                for one, label in ((unknowns.start, "springs (rule)"), (values, "springs (calibrated)"))
            )
            yield CaseResult(case, held_out, before, after)


def _labelled(path: Solution, label: str) -> Solution:
    return replace(path, label=label, kind="springs")


def _identified(objective: Objective, values: Floats, system: Equations | None) -> Identifiability:
    """Return what the data determine: by the objective's Jacobian; of many unknowns, by equilibrium of full fields."""
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
                f"{one.case.name}: calibration increased the error from {error_words(one.both[0])} to "
                f"{error_words(one.both[1])}: the springs do not fit this load better"
            )
    yield from unknowns.warnings(values)
    gone = [name for name, value in zip(unknowns.names, values, strict=True) if value < 1e-3]
    if gone:
        more = f" and {len(gone) - 3} more" if len(gone) > 3 else ""
        yield f"the fit set the stiffness of {', '.join(gone[:3])}{more} to zero"
