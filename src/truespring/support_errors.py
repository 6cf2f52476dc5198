"""Errors of the supports' forces and torques, and the error that decides a comparison."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.reactions import SupportForce
from truespring.solution import Solution, State

# Loads whose total is below this share of the sum of their sizes have no total.
_NO_TOTAL = 1e-9


@dataclass(frozen=True, eq=False)
class SupportError:
    """Difference in force and torque of a moved support between a model and the reference.

    Attributes:
        mine, theirs: force and torque of the model and of the reference.
        load: size of the total load [N]; None if motion alone drives the body, or if the loads have no total.
    """

    mine: SupportForce
    theirs: SupportForce
    load: float | None = None

    @property
    def force_difference(self) -> Floats | None:
        """Difference of the forces over the size of the reference's [-], shape (dim,); None if that vanishes."""
        return _relative(self.mine.force, self.theirs.force) if self.theirs.has_force else None

    @property
    def torque_difference(self) -> Floats | None:
        """Difference of the torques over the size of the reference's [-], shape (1 or 3,); None if that vanishes."""
        return _relative(self.mine.torque, self.theirs.torque) if self.theirs.has_torque else None

    @property
    def force_error(self) -> float | None:
        """Size of `force_difference`; None if the reference's force vanishes."""
        return _size(self.force_difference)

    @property
    def torque_error(self) -> float | None:
        """Size of `torque_difference`; None if the reference's torque vanishes."""
        return _size(self.torque_difference)

    @property
    def share_of_load(self) -> float | None:
        """Size of the reference's force over the total load; None without a total load."""
        return float(np.linalg.norm(self.theirs.force)) / self.load if self.load else None


class Decisive(NamedTuple):
    """The error that decides, and its quantity.

    Attributes:
        error: relative error, NaN if none is known.
        quantity: "displacement", "force" or "torque", empty if no error is known.
        support: name of the support that the force or torque belongs to.
    """

    error: float
    quantity: str
    support: str = ""


def decisive(displacement: float, supports: Sequence[SupportError]) -> Decisive:
    """Return the larger of the rms error of displacement and the largest error of a support's force or torque.

    Verdicts, maps, comparisons and calibrations all judge by this rule. Of equal errors, the first counts.
    """
    errors = [Decisive(displacement, "displacement")]
    for one in supports:
        errors.append(Decisive(_or_nan(one.force_error), "force", one.mine.name))
        errors.append(Decisive(_or_nan(one.torque_error), "torque", one.mine.name))
    return largest(errors)


def largest(errors: Sequence[Decisive]) -> Decisive:
    """Return the largest error that is not NaN, the first of equal ones."""
    known = [one for one in errors if not np.isnan(one.error)]
    # Errors that differ by rounding are equal.
    return max(known, key=lambda one: float(f"{one.error:.6g}")) if known else Decisive(float("nan"), "")


def support_errors(model: Solution, reference: Solution, mine: State, theirs: State) -> Iterator[SupportError]:
    """Yield the errors of the supports that are known in both solutions, in the order of their numbers.

    `mine` and `theirs` are the states of the two solutions at one level.
    """
    others = {found.support: found for found in reference.support_forces(theirs)}
    load = _total_load(model, mine)
    for found in model.support_forces(mine):
        if found.support in others and found.force.shape == others[found.support].force.shape:
            yield SupportError(found, others[found.support], load)


def _total_load(path: Solution, state: State) -> float | None:
    """Return the size of the total load at a state [N]; None if motion alone drives the body, or loads cancel out."""
    if not path.problem.stated or path.problem.loading.driven_by_motion:
        return None
    loads = path.problem.loading.force(state.positions, state.load_factor)
    total = float(np.linalg.norm(state.applied_force))
    return total if total > _NO_TOTAL * float(np.linalg.norm(loads, axis=1).sum()) else None


def _relative(mine: Floats, theirs: Floats) -> Floats:
    """Return the difference of two vectors over the size of the second."""
    return np.asarray((mine - theirs) / np.linalg.norm(theirs))


def _size(difference: Floats | None) -> float | None:
    """Return the Euclidean norm of a vector, None for None."""
    return None if difference is None else float(np.linalg.norm(difference))


def _or_nan(error: float | None) -> float:
    """Return an error, NaN for None."""
    return np.nan if error is None else error
