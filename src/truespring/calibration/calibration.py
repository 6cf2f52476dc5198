"""calibrate(cases, springs) -> Calibration: springs fitted to references, and their errors on loads held out."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from truespring.arrays import Floats
from truespring.calibration.cases import LoadCase, require_one_body
from truespring.calibration.full_field import Equations, equations, fit_full_field
from truespring.calibration.identifiability import Identifiability, identifiability
from truespring.calibration.objective import Objective, relative_errors
from truespring.calibration.partial import GAUSS_NEWTON, fit_equilibria
from truespring.calibration.unknowns import Unknowns, make_unknowns
from truespring.comparison import Decisive, compare, largest
from truespring.deprecation import renamed_argument
from truespring.equilibrium import Solution, Status, solve
from truespring.errors import ModelError, ProblemError
from truespring.models import GivenSprings, Springs

if TYPE_CHECKING:
    import polars

#: Weight of the pull toward the rule: errors of 1 % weigh as much as unknowns that are all off by as much as they are.
REGULARISATION = 0.01

#: Called with what is being done and the share that is done.
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class CaseResult:
    """A load case under the rule and under the calibrated springs.

    Attributes:
        case: the load case.
        held_out: whether it took no part in the calibration.
        before, after: the springs' paths; without a state where they could not be solved.
    """

    case: LoadCase
    held_out: bool
    before: Solution
    after: Solution

    def errors(self, path: Solution, quantity: str = "displacement") -> dict[float, float]:
        """Return the relative errors of a path by load factor: the rms distance over the rms displacement known."""
        return relative_errors(self.case, path, quantity)

    def error(self, path: Solution, quantity: str = "displacement") -> float | None:
        """Return the relative error at the last level that is known; None where the path does not reach it."""
        known = [one.level for one in self.case.observations if one.quantity == quantity]
        return self.errors(path, quantity).get(max(known)) if known else None

    def deciding(self, path: Solution) -> dict[float, Decisive]:
        """Return the error of a path that decides, by load factor, at levels that are known and that it reaches.

        As of a comparison: the larger of the rms error and that of a moved support's force or torque.
        """
        levels = sorted({one.level for one in self.case.observations})
        if self.case.field is not None and self.case.reference is not None and path.states:
            found = compare(path, self.case.reference)
            at = {level: np.flatnonzero(np.isclose(found.load_factors, level, rtol=0, atol=1e-9)) for level in levels}
            return {level: found.decisive[int(place[0])] for level, place in at.items() if place.size}
        quantities = dict.fromkeys(one.quantity for one in self.case.observations)
        told = {quantity: self.errors(path, quantity) for quantity in quantities}
        errors = {
            level: [Decisive(found[level], quantity) for quantity, found in told.items() if level in found]
            for level in levels
        }
        return {level: largest(several) for level, several in errors.items() if several}

    def decisive(self, path: Solution) -> Decisive | None:
        """Return the error of a path that decides at the last level that is known; None where it does not get there."""
        return self.deciding(path).get(max(one.level for one in self.case.observations))

    @cached_property
    def both(self) -> tuple[Decisive | None, Decisive | None]:
        """What decides under the rule and under the calibrated springs."""
        return self.decisive(self.before), self.decisive(self.after)

    @property
    def quantity(self) -> str:
        """What the error of the calibrated springs is of: displacement, force or torque."""
        return next((one.quantity for one in self.both[::-1] if one is not None), "displacement")

    @property
    def pair(self) -> tuple[float | None, float | None]:
        """The error that decides under the rule and under the calibrated springs."""
        before, after = (None if one is None or np.isnan(one.error) else one.error for one in self.both)
        return before, after


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """Springs fitted to references.

    Attributes:
        rule: the springs one started from.
        unknowns, values: what was changed, and what each unknown is now: 1 is the rule, shape (n,).
        model: the calibrated springs, which `solve` takes on any problem of the same mesh.
        cases: the load cases, those that were fitted first.
        identifiability: what the data determine.
        regularisation: the weight of the pull toward the rule.
        method: how the unknowns were found.
        objectives: by step of the method ("rule", "full field", "refined") half the mean squared error and the pull.
        residuals: likewise the unbalanced force at the known displacements over the forces themselves.
        solves: how many paths were solved.
        warnings: what should be known before it is trusted.
    """

    rule: Springs
    unknowns: Unknowns
    values: Floats
    model: GivenSprings
    cases: tuple[CaseResult, ...]
    identifiability: Identifiability
    regularisation: float
    method: str
    objectives: dict[str, float]
    residuals: dict[str, float]
    solves: int
    warnings: tuple[str, ...]

    def __repr__(self) -> str:
        return f"Calibration({self.headline})"

    @property
    def held_out(self) -> tuple[CaseResult, ...]:
        """The cases that took no part."""
        return tuple(one for one in self.cases if one.held_out)

    @property
    def error(self) -> float | None:
        """The largest error on loads that took no part; None where there are none, or one cannot be solved."""
        found = [one.pair[1] for one in self.held_out]
        return None if not found or None in found else max(error for error in found if error is not None)

    @property
    def converged(self) -> bool:
        """Whether the calibrated springs converge under every load, those held out too."""
        return all(one.after.status is Status.CONVERGED for one in self.cases)

    @property
    def headline(self) -> str:
        """What calibration gave on loads that it has not seen, in a sentence."""
        if not self.held_out:
            return (
                "No load was held out: nothing is known of these springs under other loads than those they were "
                "fitted to."
            )
        told = [f"{_off(one.both[1])} on {one.case.name} ({_off(one.both[0])} before)" for one in self.held_out]
        cases = [one.case for one in self.held_out]
        known = [
            _with_own_error(name, [case for case in cases if case.against == name])
            for name in dict.fromkeys(case.against for case in cases)
        ]
        return (
            f"On loads that took no part the calibrated springs are off by {_joined(told)}, against {_joined(known)}."
        )

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The errors as a table: a row a case, quantity, level, before and after."""
        return [
            {
                "case": one.case.name,
                "held_out": one.held_out,
                "quantity": quantity,
                "load_factor": level,
                "error_before": one.errors(one.before, quantity).get(level),
                "error_after": one.errors(one.after, quantity).get(level),
            }
            for one in self.cases
            for quantity, level in dict.fromkeys((seen.quantity, seen.level) for seen in one.case.observations)
        ]

    @property
    def table(self) -> "polars.DataFrame":
        """The same as a table of polars; raises ModelError where that is not installed."""
        try:
            import polars
        except ImportError:
            raise ModelError("a table needs polars: pip install polars, or take `rows`") from None
        return polars.DataFrame(self.rows)


def _percent(share: float | None) -> str:
    return "no equilibrium" if share is None else f"{100 * share:.2g} %"


def _off(error: Decisive | None) -> str:
    """An error, and of what it is where that is not the displacement."""
    if error is None or np.isnan(error.error):
        return _percent(None)
    return _percent(error.error) + ("" if error.quantity == "displacement" else f" in the {error.quantity}")


def _with_own_error(name: str, cases: Sequence[LoadCase]) -> str:
    """What a reference is called, and how far it is itself off, at most."""
    known = [case.own_error for case in cases if case.own_error is not None]
    if not known or len(known) < len(cases):
        return name
    return f"{name}, itself {'at most' if len(known) > 1 else 'about'} {_percent(max(known))} off"


def _joined(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


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
                f"{one.case.name}: calibration made it worse, from {_off(one.both[0])} to {_off(one.both[1])}: springs "
                "fitted to some loads are not better under all"
            )
    gone = [name for name, value in zip(unknowns.names, values, strict=True) if value < 1e-3]
    if gone:
        more = f" and {len(gone) - 3} more" if len(gone) > 3 else ""
        yield f"the data left nothing of {', '.join(gone[:3])}{more}: these springs have no stiffness any more"
