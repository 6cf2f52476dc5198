"""Lines of equal error in a map, and the intervals between them."""

import numpy as np

from truespring.arrays import Floats
from truespring.validity.maps import Map
from truespring.validity.refine import LINES, crossings


def polylines(one: Map) -> dict[float, list[Floats]]:
    """Return the lines of a map by error, each a list of polylines, shape (n, 2); of a single row, a list of points."""
    if len(one.y) < 2:
        span = one.x[-1] - one.x[0]
        row = np.nan if not len(one.y) else float(one.y[0])
        places = {line: one.x[0] + span * crossings(one.errors[0], line) for line in LINES}
        return {line: [np.array([[x, row]]) for x in found] for line, found in places.items()}
    return contours(one.x, *one.smooth)


def contours(x: Floats, y: Floats, errors: Floats) -> dict[float, list[Floats]]:
    """Return the lines of errors [-], shape (n_y, n_x), by error: polylines in axis units, shape (n, 2)."""
    from contourpy import contour_generator

    made = contour_generator(x, y, np.ma.masked_invalid(errors))
    return {line: [np.asarray(part) for part in made.lines(line) if len(part) > 1] for line in LINES}


def spans(x: Floats, errors: Floats, line: float) -> list[tuple[float, float]]:
    """Return the intervals along x in which errors are within a line."""
    within = np.isfinite(errors) & (np.nan_to_num(errors, nan=np.inf) <= line)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], within.astype(int), [0]])))
    found = []
    for begin, end in zip(edges[::2], edges[1::2] - 1, strict=True):
        first, last = float(x[begin]), float(x[end])
        if begin and np.isfinite(errors[begin - 1]):
            first = _place(x, errors, line, begin - 1)
        if end + 1 < len(x) and np.isfinite(errors[end + 1]):
            last = _place(x, errors, line, end)
        found.append((first, last))
    return found


def _place(x: Floats, errors: Floats, line: float, left: int) -> float:
    """Return where errors cross the line between two neighbouring values."""
    share = (line - errors[left]) / (errors[left + 1] - errors[left])
    return float(x[left] + share * (x[left + 1] - x[left]))
