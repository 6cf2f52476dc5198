"""Rows of integers that are equal, found by sorting numbers that they are packed into."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Ints

_LARGEST = 2**63 - 1


@dataclass(frozen=True, eq=False)
class Distinct:
    """Each of some rows once, in lexicographic order.

    Attributes:
        order: of all rows, those that are equal in the order given, shape (n_rows,).
        starts: where in that order each distinct one begins, shape (n_distinct,).
    """

    order: Ints
    starts: Ints

    @property
    def first(self) -> Ints:
        """The first row of each, shape (n_distinct,)."""
        return np.asarray(self.order[self.starts])

    @property
    def count(self) -> Ints:
        """How many rows are equal to each, shape (n_distinct,)."""
        return np.diff(self.starts, append=len(self.order))

    @property
    def of(self) -> Ints:
        """The place of every row among the distinct ones, shape (n_rows,)."""
        places = np.empty(len(self.order), dtype=np.int64)
        places[self.order] = np.repeat(np.arange(len(self.starts)), self.count)
        return places


def distinct_rows(columns: Ints | Sequence[Ints]) -> Distinct:
    """Find the distinct ones among rows, given as their columns, each of shape (n_rows,)."""
    keys = _packed(columns)
    # Of one key the stable order, which is quick for numbers that ascend over long stretches, as those of meshes do.
    order = np.lexsort(keys[::-1]) if len(keys) > 1 else np.argsort(keys[0], kind="stable")
    new = np.zeros(len(order), dtype=bool)
    new[:1] = True
    for key in keys:
        ordered = key[order]
        new[1:] |= ordered[1:] != ordered[:-1]
    return Distinct(order, np.flatnonzero(new))


def ascending(columns: Ints | Sequence[Ints]) -> list[Ints]:
    """Return the columns of the same rows, each row sorted."""
    ordered = list(columns)
    for turn in range(len(ordered)):  # neighbours change places until none need to
        for left in range(turn % 2, len(ordered) - 1, 2):
            one, other = ordered[left], ordered[left + 1]
            ordered[left], ordered[left + 1] = np.minimum(one, other), np.maximum(one, other)
    return ordered


def _packed(columns: Ints | Sequence[Ints]) -> list[Ints]:
    """Keys in whose lexicographic order the rows are in theirs: as many columns in each as an integer holds."""
    keys, room = [np.zeros(len(columns[0]), dtype=np.int64)], 1
    for column in columns if len(columns[0]) else ():
        lowest = int(column.min())
        span = int(column.max()) - lowest + 1
        if room * span > _LARGEST:
            keys.append(np.zeros(len(column), dtype=np.int64))
            room = 1
        if span > 1:
            keys[-1] *= span
            keys[-1] += column
            keys[-1] -= lowest
        room *= span
    return keys
