"""Errors of the forces and torques of supports, tools and grasps, and the error that decides a comparison."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats
from truespring.reactions import SupportForce
from truespring.solution import Solution, State

# Loads whose total is below this share of the sum of their sizes have no total.
_NO_TOTAL = 1e-9


@dataclass(frozen=True, eq=False)
class SupportError:
    """Difference in force and torque of a moved support, a tool or a grasp between a model and the reference.

    Attributes:
        mine, theirs: force and torque of the model and of the reference.
        force_size: what the difference of forces is relative to: the size of the reference's force, or its root mean
            square over the levels [N]; zero if that vanishes.
        torque_size: the same of torques [N m].
        load: size of the total load [N]; None if motion alone drives the body, or if the loads have no total.
        levels: errors of the same support at all levels, of which `force_error` and `torque_error` then are the root
            mean square; empty for the errors at one level.
    """

    mine: SupportForce
    theirs: SupportForce
    force_size: float
    torque_size: float
    load: float | None = None
    levels: "tuple[SupportError, ...]" = ()

    @property
    def force_difference(self) -> Floats | None:
        """Difference of the forces over `force_size` [-], shape (dim,); None if that vanishes."""
        return np.asarray((self.mine.force - self.theirs.force) / self.force_size) if self.force_size else None

    @property
    def torque_difference(self) -> Floats | None:
        """Difference of the torques over `torque_size` [-], shape (1 or 3,); None if that vanishes."""
        return np.asarray((self.mine.torque - self.theirs.torque) / self.torque_size) if self.torque_size else None

    @property
    def force_error(self) -> float | None:
        """Size of `force_difference`, or its root mean square over the levels; None if the force vanishes."""
        return _rms_size([one.force_difference for one in self.levels or (self,)])

    @property
    def torque_error(self) -> float | None:
        """Size of `torque_difference`, or its root mean square over the levels; None if the torque vanishes."""
        return _rms_size([one.torque_difference for one in self.levels or (self,)])

    @property
    def share_of_load(self) -> float | None:
        """Size of the reference's force over the total load; None without a total load."""
        return float(np.linalg.norm(self.theirs.force)) / self.load if self.load else None


class Decisive(NamedTuple):
    """The error that decides, and its quantity.

    Attributes:
        error: relative error, NaN if none is known.
        quantity: "displacement", "force" or "torque", empty if no error is known.
        support: name of the support, tool or grasp that the force or torque belongs to.
    """

    error: float
    quantity: str
    support: str = ""


def decisive(displacement: float, supports: Sequence[SupportError]) -> Decisive:
    """Return the larger of the rms error of displacement and the largest error of a force or torque.

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
            yield _at_one_level(found, others[found.support], load)


def touch_errors(names: Sequence[Sequence[str]], mine: State, theirs: State) -> Iterator[SupportError]:
    """Yield the errors of the forces on tools and grasps that both solutions know, by name.

    Args:
        names: names of the tools and grasps of the model, and of the reference, in the order of `State.touches`.
        mine, theirs: states of the two solutions at one level.
    """
    known, others = (
        {name: _on_tool(name, touch.force) for name, touch in zip(called, state.touches, strict=False)}
        for called, state in zip(names, (mine, theirs), strict=True)
    )
    for name, found in known.items():
        if name in others and found.force.shape == others[name].force.shape:
            yield _at_one_level(found, others[name], None)


def over_the_way(levels: Sequence[tuple[SupportError, ...]]) -> list[tuple[SupportError, ...]]:
    """Return the errors of all levels relative to the root mean square, over the levels, of the reference's force.

    A force of the reference vanishes if it does so (see SupportForce) at levels with most of its mean square.
    """
    sizes = {}
    for key, several in _by_support(levels).items():
        theirs = [one.theirs for one in several]
        sizes[key] = (
            _size_over([one.force for one in theirs], [one.has_force for one in theirs]),
            _size_over([one.torque for one in theirs], [one.has_torque for one in theirs]),
        )
    return [
        tuple(replace(one, force_size=sizes[one.mine.key][0], torque_size=sizes[one.mine.key][1]) for one in several)
        for several in levels
    ]


def of_the_way(levels: Sequence[tuple[SupportError, ...]]) -> tuple[SupportError, ...]:
    """Return the error of each support over all levels, with the forces where that of the reference is largest."""
    return tuple(
        replace(max(several, key=lambda one: float(np.linalg.norm(one.theirs.force))), levels=tuple(several))
        for several in _by_support(levels).values()
    )


def _by_support(levels: Sequence[tuple[SupportError, ...]]) -> dict[tuple[int, str], list[SupportError]]:
    """Return the errors at all levels by support, tool or grasp."""
    found: dict[tuple[int, str], list[SupportError]] = {}
    for one in (one for several in levels for one in several):
        found.setdefault(one.mine.key, []).append(one)
    return found


def _at_one_level(mine: SupportForce, theirs: SupportForce, load: float | None) -> SupportError:
    """Return the error at one level, relative to the reference's force and torque there."""
    force_size = float(np.linalg.norm(theirs.force)) if theirs.has_force else 0.0
    torque_size = float(np.linalg.norm(theirs.torque)) if theirs.has_torque else 0.0
    return SupportError(mine, theirs, force_size, torque_size, load)


def _on_tool(name: str, force: Floats) -> SupportForce:
    """Return the force on a tool or grasp [N], shape (dim,)."""
    return SupportForce(-1, name, force, np.zeros(0), has_force=bool(force.any()), has_torque=False)


def _total_load(path: Solution, state: State) -> float | None:
    """Return the size of the total load at a state [N]; None if motion alone drives the body, or loads cancel out."""
    if not path.problem.stated or path.problem.loading.driven_by_motion:
        return None
    loads = path.problem.loading.force(state.positions, state.load_factor)
    total = float(np.linalg.norm(state.applied_force))
    return total if total > _NO_TOTAL * float(np.linalg.norm(loads, axis=1).sum()) else None


def _size_over(vectors: Sequence[Floats], present: Sequence[bool]) -> float:
    """Return the root mean square of the sizes of vectors; zero if those present have less than half of the squares."""
    squares = np.array([float(vector @ vector) for vector in vectors])
    return float(np.sqrt(squares.mean())) if squares[np.array(present)].sum() > squares.sum() / 2 else 0.0


def _rms_size(differences: Sequence[Floats | None]) -> float | None:
    """Return the root mean square of the Euclidean norms of vectors, None without any."""
    squares = [float(one @ one) for one in differences if one is not None]
    return float(np.sqrt(np.mean(squares))) if squares else None


def _or_nan(error: float | None) -> float:
    """Return an error, NaN for None."""
    return np.nan if error is None else error
