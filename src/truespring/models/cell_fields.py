"""Fields of potentials that have both springs and elements as cells."""

from collections.abc import Mapping

import numpy as np

from truespring.arrays import Floats, Ints

#: A sentence on the fields of springs of zero rest length, without a full stop.
CHANGE_OF_TENSION = (
    "the springs have zero rest length and pull in the undeformed body, where the pressure of the elements balances "
    "them: fields show the change of tension, and stretch is length over undeformed length"
)


def stretch(lines: Ints, nodes: Floats, positions: Floats) -> Floats:
    """Return length over undeformed length of lines [-], shape (n,).

    `lines` are node numbers, shape (n, 2); `nodes` and `positions` [m] have shape (n_nodes, dim).
    """
    return lengths(lines, positions) / lengths(lines, nodes)


def lengths(lines: Ints, positions: Floats) -> Floats:
    """Return the lengths of lines [m], shape (n,); `lines` are node numbers, shape (n, 2)."""
    squares = np.zeros(len(lines))
    for column in positions.T.copy():  # one after the other: several times as fast as by rows
        apart = column[lines[:, 1]] - column[lines[:, 0]]
        squares += apart * apart
    return np.sqrt(squares)


def beside(lines: Mapping[str, Floats], elements: Mapping[str, Floats]) -> dict[str, Floats]:
    """Return fields of lines, then of elements, shape (n_lines + n_elements, ...); NaN where a field is not defined."""
    n_lines, n_elements = (len(next(iter(fields.values()))) for fields in (lines, elements))
    found = {name: np.concatenate([values, _missing(n_elements, values)]) for name, values in lines.items()}
    return found | {name: np.concatenate([_missing(n_lines, values), values]) for name, values in elements.items()}


def _missing(n: int, values: Floats) -> Floats:
    """Return NaN for `n` cells, of the shape of the values of other cells."""
    return np.full((n, *values.shape[1:]), np.nan)
