"""Compare modes of two models shape by shape, by the modal assurance criterion."""

from typing import NamedTuple

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.vibration.result import Modes

#: Smallest modal assurance criterion of two modes that are compared.
ALIKE = 0.5
# Modes whose frequencies differ by less than this share have no shapes of their own: any combination is one as well.
_EQUAL = 1e-3
# A combination of shapes below this size is none.
_NOTHING = 1e-3
# Of shapes that are as similar, those of nearer numbers are compared: the criterion that a number is worth.
_APART = 1e-6


class Pair(NamedTuple):
    """Two modes of the same shape.

    Attributes:
        reference, mode: number of the mode of the reference and of the model, from 0.
        mac: modal assurance criterion, 1 for the same shape [-].
        difference: frequency of the model over that of the reference, minus 1 [-].
    """

    reference: int
    mode: int
    mac: float
    difference: float


def assurance(reference: Modes, model: Modes) -> Floats:
    """Return the modal assurance criterion of each two shapes, shape (n_reference, n_model).

    (u . M v)^2 / ((u . M u) (v . M v)), weighted by the mass of the nodes of the mesh (Allemang and Brown 1982). Of
    modes with equal frequencies, as of a square section in bending, the sum over these is taken: it is 1 if a shape
    lies in their span.
    """
    root = np.sqrt(reference.problem.mass)[:, None]
    u, v = ((one.shapes * root).reshape(len(one.shapes), -1) for one in (reference, model))
    u, v = (one / np.linalg.norm(one, axis=1, keepdims=True) for one in (u, v))
    alike = (u @ v.T) ** 2
    by_model = _summed(alike.T, groups(model.eigenvalues)).T
    by_reference = _summed(alike, groups(reference.eigenvalues))
    return np.asarray(np.minimum(np.maximum(by_model, by_reference), 1.0))


def groups(eigenvalues: Floats) -> Ints:
    """Return the number of the group of each mode, from 0, shape (n,): neighbours of equal frequency share one."""
    apart = np.abs(np.diff(eigenvalues)) > 2 * _EQUAL * np.abs(eigenvalues[1:])
    return np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(apart)])


def _summed(values: Floats, group: Ints) -> Floats:
    """Return for each row the sum of the rows of its group, of the same shape."""
    total = np.zeros((int(group.max(initial=0)) + 1, values.shape[1]))
    np.add.at(total, group, values)
    return np.asarray(total[group])


def pairs(reference: Modes, model: Modes) -> tuple[Pair, ...]:
    """Return pairs of modes of the most similar shapes, each mode at most once, ascending by mode of the reference."""
    from scipy.optimize import linear_sum_assignment

    alike = assurance(reference, model)
    number, other = np.indices(alike.shape)
    rows, columns = linear_sum_assignment(alike - _APART * np.abs(number - other), maximize=True)
    mine, theirs = model.frequencies, reference.frequencies
    with np.errstate(divide="ignore", invalid="ignore"):
        return tuple(
            Pair(int(row), int(column), float(alike[row, column]), float(mine[column] / theirs[row] - 1))
            for row, column in zip(rows, columns, strict=True)
            if alike[row, column] >= ALIKE
        )


def like(modes: Modes, mode: int, shape: Floats) -> Floats:
    """Return the shape of a mode with the sign of `shape`, both (n_nodes, dim), largest component 1 or -1 [-].

    Of modes with equal frequencies it is the combination that is nearest to `shape`.
    """
    group = groups(modes.eigenvalues)
    same = modes.shapes[group == group[mode]]
    mass = modes.problem.mass[:, None]
    parts = np.einsum("kni,ni->k", same, mass * shape) / np.einsum("kni,kni->k", same, mass * same)
    found = np.einsum("k,kni->ni", parts, same)
    largest = float(np.abs(found).max())
    return np.asarray(found / largest) if largest > _NOTHING * float(np.abs(shape).max()) else modes.shapes[mode]
