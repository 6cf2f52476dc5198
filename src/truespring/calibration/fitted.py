"""Springs fitted to references, with the paths of every load case before and after the fit."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from truespring.arrays import Floats
from truespring.calibration.cases import LoadCase
from truespring.calibration.identifiability import Identifiability
from truespring.calibration.objective import relative_errors
from truespring.calibration.unknowns import Unknowns
from truespring.comparison import compare
from truespring.equilibrium import Solution, Status
from truespring.models import Model, Springs
from truespring.support_errors import Decisive, largest


@dataclass(frozen=True, eq=False)
class CaseResult:
    """A load case with the springs of the rule and the calibrated ones.

    Attributes:
        case: the load case.
        held_out: whether it was not fitted.
        before, after: the paths of both; without states if they could not be solved.
    """

    case: LoadCase
    held_out: bool
    before: Solution
    after: Solution

    def errors(self, path: Solution, quantity: str = "displacement") -> dict[float, float]:
        """Return the relative errors of a path by load factor, as `relative_errors`."""
        return relative_errors(self.case, path, quantity)

    def error(self, path: Solution, quantity: str = "displacement") -> float | None:
        """Return the relative error at the last level with data; None if the path does not reach it."""
        known = [one.level for one in self.case.observations if one.quantity == quantity]
        return self.errors(path, quantity).get(max(known)) if known else None

    def deciding(self, path: Solution) -> dict[float, Decisive]:
        """Return the decisive error of a path by load factor, at levels with data that it reaches.

        As in a comparison, it is the larger of the rms error and the error of a moved support's force or torque.
        """
        levels = sorted({one.level for one in self.case.observations})
        if self.case.field is not None and self.case.reference is not None and path.states:
            found = compare(path, self.case.reference)
            at = {level: np.flatnonzero(np.isclose(found.load_factors, level, rtol=0, atol=1e-9)) for level in levels}
            return {level: found.decisive[int(place[0])] for level, place in at.items() if place.size}
        quantities = dict.fromkeys(one.quantity for one in self.case.observations)
        by_quantity = {quantity: self.errors(path, quantity) for quantity in quantities}
        errors = {
            level: [Decisive(found[level], quantity) for quantity, found in by_quantity.items() if level in found]
            for level in levels
        }
        return {level: largest(several) for level, several in errors.items() if several}

    def decisive(self, path: Solution) -> Decisive | None:
        """Return the decisive error of a path at the last level with data; None if the path does not reach it."""
        return self.deciding(path).get(max(one.level for one in self.case.observations))

    @cached_property
    def both(self) -> tuple[Decisive | None, Decisive | None]:
        """The decisive errors of the rule and of the calibrated springs."""
        return self.decisive(self.before), self.decisive(self.after)

    @property
    def quantity(self) -> str:
        """The quantity of the decisive error of the calibrated springs: displacement, force or torque."""
        return next((one.quantity for one in self.both[::-1] if one is not None), "displacement")

    @property
    def pair(self) -> tuple[float | None, float | None]:
        """The decisive errors of the rule and of the calibrated springs as numbers; None without an equilibrium."""
        before, after = (None if one is None or np.isnan(one.error) else one.error for one in self.both)
        return before, after


@dataclass(frozen=True, eq=False)
class Fitted:
    """Springs fitted to references.

    Attributes:
        rule: the springs of the start.
        unknowns, values: the unknowns and their calibrated values, 1 is the rule, shape (n,).
        model: the calibrated springs, which `solve` accepts for any problem on the same mesh.
        cases: the load cases, fitted ones first.
        identifiability: which unknowns the data determine.
        regularisation: weight of the term toward the rule.
        method: the method that found the values.
        objectives: value of the objective by step of the method: "rule", "full field", "refined".
        residuals: unbalanced force at the known displacements over the forces there, by step.
        solves: number of paths solved.
        warnings: limits of validity.
    """

    rule: Springs
    unknowns: Unknowns
    values: Floats
    model: Model
    cases: tuple[CaseResult, ...]
    identifiability: Identifiability
    regularisation: float
    method: str
    objectives: dict[str, float]
    residuals: dict[str, float]
    solves: int
    warnings: tuple[str, ...]

    @property
    def held_out(self) -> tuple[CaseResult, ...]:
        """The cases that were not fitted."""
        return tuple(one for one in self.cases if one.held_out)

    @property
    def error(self) -> float | None:
        """The largest error on loads held out; None if there are none, or one of them cannot be solved."""
        found = [one.pair[1] for one in self.held_out]
        return None if not found or None in found else max(error for error in found if error is not None)

    @property
    def converged(self) -> bool:
        """Whether the calibrated springs converge under every load, fitted or held out."""
        return all(one.after.status is Status.CONVERGED for one in self.cases)

    @property
    def headline(self) -> str:
        """The errors on loads held out in a sentence."""
        if not self.held_out:
            return (
                "No load was held out: the error of these springs under loads other than the fitted ones is not known."
            )
        errors = [
            f"{error_words(one.both[1])} on {one.case.name} ({error_words(one.both[0])} before)"
            for one in self.held_out
        ]
        cases = [one.case for one in self.held_out]
        known = [
            _with_own_error(name, [case for case in cases if case.against == name])
            for name in dict.fromkeys(case.against for case in cases)
        ]
        return f"On loads held out the calibrated springs are off by {_joined(errors)}, against {_joined(known)}."

    @property
    def rows(self) -> list[dict[str, Any]]:
        """The errors before and after, one row per case, quantity and level."""
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


def _percent(share: float | None) -> str:
    return "no equilibrium" if share is None else f"{100 * share:.2g} %"


def error_words(error: Decisive | None) -> str:
    """Return an error as text, with its quantity if that is not the displacement."""
    if error is None or np.isnan(error.error):
        return _percent(None)
    return _percent(error.error) + ("" if error.quantity == "displacement" else f" in the {error.quantity}")


def _with_own_error(name: str, cases: Sequence[LoadCase]) -> str:
    """Return the name of a reference with its largest own error."""
    known = [case.own_error for case in cases if case.own_error is not None]
    if not known or len(known) < len(cases):
        return name
    return f"{name}, itself {'at most' if len(known) > 1 else 'about'} {_percent(max(known))} off"


def _joined(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
