"""A problem's loads and motions turned: other loads on the same body, to hold out."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from truespring.arrays import Floats
from truespring.loading import Fixed, Force, Gravity, Traction
from truespring.problem import Load, Problem


def turned(problem: Problem, angle: float = np.pi / 4) -> Problem | None:
    """Return the problem with its dead loads and prescribed displacements turned by an angle [rad].

    All about one axis, in the plane of the body, or in space the coordinate axis along which they are smallest. Loads
    that follow the body, rotations, and motions of some directions only stay. None where nothing is turned.
    """
    vectors = [vector for load in problem.loads if (vector := _vector(load)) is not None]
    vectors += [one.displacement for one in problem.supports if _moves(one) and one.displacement is not None]
    if not vectors:
        return None
    dim = problem.mesh.dim
    sizes = np.array(vectors, dtype=float)
    axis = 2 if dim == 2 else int(np.abs(sizes / np.linalg.norm(sizes, axis=1, keepdims=True)).sum(axis=0).argmin())
    turn = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turn[first, first] = turn[second, second] = np.cos(angle)
    turn[second, first], turn[first, second] = np.sin(angle), -np.sin(angle)
    return replace(
        problem,
        supports=[_support(one, turn[:dim, :dim]) for one in problem.supports],
        loads=[_load(one, turn[:dim, :dim]) for one in problem.loads],
    )


def _vector(load: Load) -> Sequence[float] | None:
    match load:
        case Force(_, total):
            return total if np.any(total) else None
        case Traction(_, traction):
            return traction if np.any(traction) else None
        case Gravity(acceleration):
            return acceleration if np.any(acceleration) else None
    return None


def _moves(support: Fixed) -> bool:
    """Whether a support moves its nodes, and holds all their directions."""
    return support.displacement is not None and bool(np.any(support.displacement)) and support.fix is None


def _support(support: Fixed, turn: Floats) -> Fixed:
    if not _moves(support):
        return support
    return replace(support, displacement=tuple((turn @ np.asarray(support.displacement)).tolist()))


def _load(load: Load, turn: Floats) -> Load:
    vector = _vector(load)
    if vector is None:
        return load
    other = tuple((turn @ np.asarray(vector)).tolist())
    match load:
        case Force():
            return replace(load, total=other)
        case Traction():
            return replace(load, traction=other)
        case Gravity():
            return replace(load, acceleration=other)
    return load
