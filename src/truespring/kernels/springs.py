"""Loops over springs of the straight force law, and over nodes for the rows of forces and matrix of any springs.

Shapes: x, step, forces (n_nodes, dim), springs (n_springs, 2); stiffness, rest, length, tension, pull, lengthwise,
sideways (n_springs,); at_starts (n_nodes + 1,) and at (2 n_springs,): the ends of springs at each node, as
2 spring + end.
"""

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
    """Write the length of each spring. Shapes: x (n_nodes, dim), springs (n_springs, 2), length (n_springs,)."""
    for s in range(unsigned(first), unsigned(last)):
        d = minus(row(x, springs[s, 1], zero), row(x, springs[s, 0], zero))
        length[s] = np.sqrt(dot(d, d))


@kernel
def energy(first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, zero: Any) -> float:
    """Return the sum of 1/2 k (l - L)^2.

    Shapes: x (n_nodes, dim), springs (n_springs, 2), stiffness k, rest L (n_springs,).
    """
    total = 0.0
    for s in range(unsigned(first), unsigned(last)):
        d = minus(row(x, springs[s, 1], zero), row(x, springs[s, 0], zero))
        total += 0.5 * stiffness[s] * (np.sqrt(dot(d, d)) - rest[s]) ** 2
    return total


@kernel
def tensions(first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, tension: Any, zero: Any) -> None:
    """Write the tension k (l - L).

    Shapes: x (n_nodes, dim), springs (n_springs, 2), stiffness k, rest L, tension (n_springs,).
    """
    for s in range(unsigned(first), unsigned(last)):
        d = minus(row(x, springs[s, 1], zero), row(x, springs[s, 0], zero))
        tension[s] = stiffness[s] * (np.sqrt(dot(d, d)) - rest[s])


def axial(first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, found: Any, zero: Any) -> None:
    """Write the axial stiffness, the derivative of the tension with respect to the length: k.

    Shapes: stiffness k, found (n_springs,).
    """
    found[first:last] = stiffness[first:last]


@kernel
def extrapolated(
    first: int, last: int, x: Any, step: Any, springs: Any, stiffness: Any, rest: Any, tension: Any, zero: Any
) -> None:
    """Write the tension extrapolated linearly along a step: k (l - L + n . change of d).

    Shapes: x, step (n_nodes, dim), springs (n_springs, 2), stiffness k, rest L, tension (n_springs,).
    """
    for s in range(unsigned(first), unsigned(last)):
        a, b = springs[s, 0], springs[s, 1]
        d = minus(row(x, b, zero), row(x, a, zero))
        change = minus(row(step, b, zero), row(step, a, zero))
        length = np.sqrt(dot(d, d))
        stretched = dot(d, change) / length if length > 0 else 0.0
        tension[s] = stiffness[s] * (length - rest[s] + stretched)


@kernel
def pulls(first: int, last: int, x: Any, springs: Any, stiffness: Any, rest: Any, pull: Any, zero: Any) -> None:
    """Write tension over length.

    Shapes: x (n_nodes, dim), springs (n_springs, 2), stiffness, rest, pull (n_springs,).
    """
    for s in range(unsigned(first), unsigned(last)):
        d = minus(row(x, springs[s, 1], zero), row(x, springs[s, 0], zero))
        length = np.sqrt(dot(d, d))
        pull[s] = stiffness[s] * (length - rest[s]) / length if length > 0 else 0.0


@kernel
def internal_forces(
    first: int, last: int, x: Any, springs: Any, at_starts: Any, at: Any, pull: Any, forces: Any, zero: Any
) -> None:
    """Write the derivative of the energy by the nodes first to last.

    Shapes: x, forces (n_nodes, dim), springs (n_springs, 2), at_starts (n_nodes + 1,), at (2 n_springs,), pull
    (n_springs,).
    """
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
    """Write u, v of each spring's Hessian block u d d^T + v I; zero for a collapsed spring.

    Shapes: x (n_nodes, dim), springs (n_springs, 2), stiffness, tension, lengthwise u, sideways v (n_springs,).
    """
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
    """Write the rows first to last of the Hessian; each block is changed by its row only.

    If each off-diagonal block belongs to one spring (`alone`), it is written, not added to.

    Shapes: x (n_nodes, dim), springs (n_springs, 2), at_starts, starts (n_nodes + 1,), at (2 n_springs,), lengthwise,
    sideways (n_springs,), slots (n_springs, 2, 2), data (n_blocks, dim, dim).
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
