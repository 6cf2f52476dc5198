"""Loops over springs and over the nodes that own the rows of their matrix."""

from typing import Any

import numpy as np

from truespring.kernels.small import (
    along_and_across,
    dot,
    minus,
    nothing,
    plus,
    put,
    row,
    scaled,
    take_symmetric,
    unsigned,
    write_symmetric,
)
from truespring.kernels.threads import kernel

ONE = unsigned(1)


@kernel
def lengths(first: int, last: int, x: Any, springs: Any, length: Any, zero: Any) -> None:
    """The length of each spring."""
    for s in range(unsigned(first), unsigned(last)):
        d = minus(row(x, springs[s, 1], zero), row(x, springs[s, 0], zero))
        length[s] = np.sqrt(dot(d, d))


@kernel
def energy(first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, zero: Any) -> float:
    """The sum of 1/2 k (l - L)^2."""
    total = 0.0
    for s in range(unsigned(first), unsigned(last)):
        d = minus(row(x, springs[s, 1], zero), row(x, springs[s, 0], zero))
        total += 0.5 * stiffness[s] * (np.sqrt(dot(d, d)) - rest[s]) ** 2
    return total


@kernel
def tensions(first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, tension: Any, zero: Any) -> None:
    """k (l - L)."""
    for s in range(unsigned(first), unsigned(last)):
        d = minus(row(x, springs[s, 1], zero), row(x, springs[s, 0], zero))
        tension[s] = stiffness[s] * (np.sqrt(dot(d, d)) - rest[s])


@kernel
def extrapolated(
    first: int, last: int, x: Any, step: Any, springs: Any, stiffness: Any, rest: Any, tension: Any, zero: Any
) -> None:
    """k (l - L + n . change of d along the step): the tension carried on linearly."""
    for s in range(unsigned(first), unsigned(last)):
        a, b = springs[s, 0], springs[s, 1]
        d = minus(row(x, b, zero), row(x, a, zero))
        change = minus(row(step, b, zero), row(step, a, zero))
        length = np.sqrt(dot(d, d))
        stretched = dot(d, change) / length if length > 0 else 0.0
        tension[s] = stiffness[s] * (length - rest[s] + stretched)


@kernel
def pulls(first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, pull: Any, zero: Any) -> None:
    """Tension over length."""
    for s in range(unsigned(first), unsigned(last)):
        d = minus(row(x, springs[s, 1], zero), row(x, springs[s, 0], zero))
        length = np.sqrt(dot(d, d))
        pull[s] = stiffness[s] * (length - rest[s]) / length if length > 0 else 0.0


@kernel
def internal_forces(
    first: int, last: int, x: Any, springs: Any, at_starts: Any, at: Any, pull: Any, forces: Any, zero: Any
) -> None:
    """The derivative of the energy by the nodes first to last."""
    for i in range(first, last):
        here, force = row(x, i, zero), zero
        for q in range(at_starts[i], at_starts[i + 1]):
            end = unsigned(at[unsigned(q)])
            s = end >> ONE
            other = springs[s, ONE - (end & ONE)]
            force = plus(force, scaled(pull[s], minus(here, row(x, other, zero))))
        put(forces, i, force)


@kernel
def stiffen(
    first: int, last: int, x: Any, springs: Any, stiffness: Any, tension: Any, lengthwise: Any, sideways: Any, zero: Any
) -> None:
    """The numbers u, v of each spring's Hessian block u d d^T + v I; a collapsed spring has none."""
    for s in range(unsigned(first), unsigned(last)):
        d = minus(row(x, springs[s, 1], zero), row(x, springs[s, 0], zero))
        squared = dot(d, d)
        if squared > 0:
            side = tension[s] / np.sqrt(squared)
            lengthwise[s] = (stiffness[s] - side) / squared
            sideways[s] = side
        else:
            lengthwise[s] = 0.0
            sideways[s] = 0.0


@kernel
def hessian(
    first: int,
    last: int,
    x: Any,
    springs: Any,
    at_starts: Any,
    at: Any,
    lengthwise: Any,
    sideways: Any,
    starts: Any,
    slots: Any,
    alone: bool,
    data: Any,
    zero: Any,
) -> None:
    """Write the rows first to last: every block is added to by its own row only.

    Where each block beside the diagonal is that of one spring `alone`, it is written at once.
    """
    for i in range(first, last):
        if not alone:
            for p in range(starts[i], starts[i + 1]):
                data[p] = 0.0
        here, whole, own = row(x, i, zero), nothing(zero), starts[i]
        for q in range(at_starts[i], at_starts[i + 1]):
            end = unsigned(at[unsigned(q)])
            s, a = end >> ONE, end & ONE
            block = along_and_across(lengthwise[s], sideways[s], minus(row(x, springs[s, ONE - a], zero), here))
            if alone:
                write_symmetric(data, slots[s, a, ONE - a], block, zero)
            else:
                take_symmetric(data, slots[s, a, ONE - a], block, zero)
            whole = minus(whole, block)
            own = slots[s, a, a]
        write_symmetric(data, own, whole, zero)
