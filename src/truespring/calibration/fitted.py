"""Springs fitted to references, with the paths of every load case before and after."""

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
from truespring.models import PrescribedSprings, Springs
from truespring.support_errors import Decisive, largest


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


@dataclass(frozen=True, eq=False)
class Fitted:
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
    model: PrescribedSprings
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
        told = [
            f"{error_words(one.both[1])} on {one.case.name} ({error_words(one.both[0])} before)"
            for one in self.held_out
        ]
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


def _percent(share: float | None) -> str:
    return "no equilibrium" if share is None else f"{100 * share:.2g} %"


def error_words(error: Decisive | None) -> str:
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
