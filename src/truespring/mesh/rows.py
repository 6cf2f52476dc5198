"""Distinct rows of integers, by sorting rows packed into single integers."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from truespring.arrays import Ints

_LARGEST = 2**63 - 1


@dataclass(frozen=True, eq=False)
class Distinct:
    """The distinct rows of a table, in lexicographic order.

    Attributes:
        order: numbers of the rows in lexicographic order (stable), shape (n_rows,).
        starts: index in `order` of the first of each group of equal rows, shape (n_distinct,).
    """

    order: Ints
    starts: Ints

    @property
    def first(self) -> Ints:
        """Number of the first row of each group, shape (n_distinct,)."""
        return np.asarray(self.order[self.starts])

    @property
    def count(self) -> Ints:
        """Number of rows in each group, shape (n_distinct,)."""
        return np.diff(self.starts, append=len(self.order))

    @property
    def of(self) -> Ints:
        """Number of the group of each row, shape (n_rows,)."""
        places = np.empty(len(self.order), dtype=np.int64)
        places[self.order] = np.repeat(np.arange(len(self.starts)), self.count)
        return places


def distinct_rows(columns: Ints | Sequence[Ints]) -> Distinct:
    """Return the distinct rows of a table, given by its columns, each of shape (n_rows,)."""
    keys = _packed(columns)
    # A stable sort is fast for long ascending runs, as numbers in meshes have.
    order = np.lexsort(keys[::-1]) if len(keys) > 1 else np.argsort(keys[0], kind="stable")
    new = np.zeros(len(order), dtype=bool)
    new[:1] = True
    for key in keys:
        ordered = key[order]
        new[1:] |= ordered[1:] != ordered[:-1]
    return Distinct(order, np.flatnonzero(new))


def ascending(columns: Ints | Sequence[Ints]) -> list[Ints]:
    """Return the columns of the table, shape (n_rows,) each, with each row sorted."""
    ordered = list(columns)
    for turn in range(len(ordered)):  # odd-even transposition sort
        for left in range(turn % 2, len(ordered) - 1, 2):
            one, other = ordered[left], ordered[left + 1]
            ordered[left], ordered[left + 1] = np.minimum(one, other), np.maximum(one, other)
    return ordered


def _packed(columns: Ints | Sequence[Ints]) -> list[Ints]:
    """Return integer keys with the lexicographic order of the rows; each packs as many columns as fit."""
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
