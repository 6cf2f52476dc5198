"""Adaptive refinement of a map: points are solved where a line passes, and interpolated elsewhere."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from truespring.arrays import Floats, Ints

Values = NDArray[np.float64] | NDArray[np.complex128]

#: Errors of the lines of a map.
LINES = (0.01, 0.02, 0.05, 0.1)

#: Crossings of a line closer than this share of the range are equal.
TOLERANCE = 0.01


class Rows:
    """The rows of a map over the load: errors at all sizes for one value along y.

    Errors may be complex: their absolute value is the error, and rows are interpolated as complex numbers. With a real
    part that changes sign where springs cross the reference, the minimum there is found between rows too.

    Rows at `start` are solved first, of `rows` in all. Between two rows in which a line passes at different places, or
    which end at different sizes, the middle row is solved, unless the interpolation predicted the last middle row.
    """

    def __init__(self, rows: int, start: Sequence[int], tolerance: float = TOLERANCE) -> None:
        self.rows, self.tolerance = rows, tolerance
        self.known: dict[int, Values] = {}
        self._start = tuple(start)
        self._straight: set[tuple[int, int]] = set()

    def pending(self) -> list[int]:
        """Return the rows to solve next; empty if the map is done."""
        if missing := [row for row in self._start if row not in self.known]:
            return missing
        return [(a + b) // 2 for a, b in pairwise(sorted(self.known)) if b - a > 1 and not self._settled(a, b)]

    def add(self, found: Mapping[int, Values]) -> None:
        """Add the errors of rows, shape (n_sizes,) each, NaN where there are none."""
        known = sorted(self.known)
        for row, errors in found.items():
            around = [(a, b) for a, b in pairwise(known) if a < row < b]
            self.known[row] = errors
            for a, b in around:
                share = (row - a) / (b - a)
                predicted = (1 - share) * self.known[a] + share * self.known[b]
                if _alike(_passes(predicted), _passes(errors), self.tolerance):
                    self._straight |= {(a, row), (row, b)}

    def _settled(self, a: int, b: int) -> bool:
        first, last = self.known[a], self.known[b]
        places = [_passes(one) for one in (first, last)]
        if not any(len(one) for line in places for one in line.values()):
            return _band(first) == _band(last)
        return (a, b) in self._straight or _alike(places[0], places[1], self.tolerance)

    def filled(self, parts: int = 1) -> Floats:
        """Return the errors of all rows, shape (n, n_sizes), interpolated between solved ones.

        `parts` is the number of rows returned per row of the grid.
        """
        solved = np.array(sorted(self.known))
        values = np.array([self.known[row] for row in solved])
        return np.abs([_between(solved, values, row) for row in np.arange((self.rows - 1) * parts + 1) / parts])


def _between(solved: Ints, values: Values, row: float) -> Values:
    above = int(np.clip(np.searchsorted(solved, row), 1, max(len(solved) - 1, 1)))
    if len(solved) == 1 or row == solved[above - 1]:
        return np.asarray(values[above - 1])
    if row == solved[above]:
        return np.asarray(values[above])
    share = (row - solved[above - 1]) / (solved[above] - solved[above - 1])
    return np.asarray((1 - share) * values[above - 1] + share * values[above])


def crossings(errors: Floats, line: float) -> Floats:
    """Return where errors, shape (n,), cross a line: ascending fractions of their range [-], shape (n_crossings,)."""
    place = np.arange(len(errors)) / max(len(errors) - 1, 1)
    apart = errors - line
    left, right = apart[:-1], apart[1:]
    passed = np.isfinite(left) & np.isfinite(right) & ((left <= 0) != (right <= 0))
    share = left[passed] / (left[passed] - right[passed])
    return np.asarray(place[:-1][passed] + share * (place[1:] - place[:-1])[passed])


def _passes(values: Values) -> dict[float, Floats]:
    """Return the crossings of each line, and with key 0 the end of the errors."""
    errors = np.abs(values)
    found = {line: crossings(errors, line) for line in LINES}
    finite = np.flatnonzero(np.isfinite(errors))
    last = finite[-1] / max(len(errors) - 1, 1) if finite.size else 0.0
    return found | {0.0: np.array([last] if last < 1 else [])}


def _alike(one: dict[float, Floats], other: dict[float, Floats], hair: float) -> bool:
    """Return whether lines cross two rows at the same places."""
    return all(
        len(places) == len(other[line]) and (not len(places) or np.abs(places - other[line]).max() <= hair)
        for line, places in one.items()
    )


def _band(values: Values) -> int:
    errors = np.abs(values)
    finite = errors[np.isfinite(errors)]
    return int(np.searchsorted(LINES, finite[0])) if finite.size else -1


class Cells:
    """A map of points over two grids, the second of which may have a single value; errors may be complex, see Rows.

    Cells between the values of `start` are solved at their corners; a cell with corners on both sides of a line is
    divided, down to the grid.
    """

    def __init__(self, shape: tuple[int, int], start: tuple[Sequence[int], Sequence[int]]) -> None:
        self.shape = shape
        self.known: dict[tuple[int, int], complex] = {}
        x, y = (list(pairwise(one)) or [(0, 0)] for one in start)
        self._cells = [(*i, *j) for i in x for j in y]

    def pending(self) -> list[tuple[int, int]]:
        """Return the points to solve next; empty if the map is done."""
        while True:
            missing = {one for cell in self._cells for one in _corners(cell) if one not in self.known}
            if missing:
                return sorted(missing)
            divided = [part for cell in self._cells for part in self._divided(cell)]
            if len(divided) == len(self._cells):
                return []
            self._cells = divided

    def add(self, found: Mapping[tuple[int, int], complex]) -> None:
        """Add the errors of points."""
        self.known.update(found)

    def _divided(self, cell: tuple[int, int, int, int]) -> list[tuple[int, int, int, int]]:
        left, right, low, high = cell
        if (right - left < 2 and high - low < 2) or len({self._band(one) for one in _corners(cell)}) == 1:
            return [cell]
        x = [(left, (left + right) // 2), ((left + right) // 2, right)] if right - left > 1 else [(left, right)]
        y = [(low, (low + high) // 2), ((low + high) // 2, high)] if high - low > 1 else [(low, high)]
        return [(*one, *other) for one in x for other in y]

    def _band(self, at: tuple[int, int]) -> int:
        error = abs(self.known[at])
        return int(np.searchsorted(LINES, error)) if np.isfinite(error) else -1

    def filled(self) -> Floats:
        """Return the errors of all points [-], shape (n_y, n_x), interpolated from the corners of their cells."""
        errors = np.full(self.shape[::-1], np.nan + 0j)
        for left, right, low, high in self._cells:
            x = np.linspace(0, 1, right - left + 1)[None] if right > left else np.zeros((1, 1))
            y = np.linspace(0, 1, high - low + 1)[:, None] if high > low else np.zeros((1, 1))
            a, b, c, d = (self.known[one] for one in ((left, low), (right, low), (left, high), (right, high)))
            errors[low : high + 1, left : right + 1] = (1 - y) * ((1 - x) * a + x * b) + y * ((1 - x) * c + x * d)
        for (i, j), error in self.known.items():
            errors[j, i] = error
        return np.abs(errors)


def _corners(cell: tuple[int, int, int, int]) -> list[tuple[int, int]]:
    left, right, low, high = cell
    return list(dict.fromkeys([(left, low), (right, low), (left, high), (right, high)]))
