"""Histories of loads and prescribed motion: tables of the share that acts, over the way at rest or over time."""

from collections.abc import Sequence

import numpy as np

from truespring.conditions import PROPORTIONAL, Amplitude
from truespring.errors import ProblemError
from truespring.loading.values import number

#: Rows of place and share: the place a share of the way at rest, 0 to 1, or a time [s] in motion; the share of the full
#: load or motion [-]. Linear between rows, constant before the first and after the last.
History = Sequence[Sequence[float]]


def amplitude_of(over: History | None, duration: float | None) -> Amplitude:
    """Return the amplitude of a history; without one, the load is proportional at rest and constant in motion.

    `duration` is that of the motion [s], None at rest. Raises ProblemError if a row is not a pair of numbers, places do
    not ascend, or the body would be loaded at once at rest.
    """
    span = 1.0 if duration is None else duration
    if over is None:
        return PROPORTIONAL if duration is None else Amplitude((0.0,), (1.0,), span)
    unit = "-" if duration is None else "s"
    rows = [_row(row, unit) for row in over]
    if not rows:
        raise ProblemError("over = []: give at least one row of place and share, such as [[0, 0], [1, 1]]")
    places, shares = zip(*rows, strict=True)
    if np.any(np.diff(places) <= 0):
        raise ProblemError(f"over: the first column must ascend, not {list(places)} [{unit}]")
    if duration is None and not 0 <= places[0] <= places[-1] <= 1:
        raise ProblemError(
            f"over: at rest the first column is a share of the way, from 0 to 1, not {list(places)}; times need the "
            "duration of a motion"
        )
    amplitude = Amplitude(places, shares, span)
    if duration is None and amplitude.at(0.0):
        raise ProblemError(
            f"over: the share at the begin is {amplitude.at(0.0):g}: at rest the body is unloaded there; begin with 0, "
            "such as [[0, 0], [0.1, 1], [1, 1]]"
        )
    return amplitude


def _row(row: Sequence[float], unit: str) -> tuple[float, float]:
    """Return a row as numbers; raise ProblemError if it is not a pair of them."""
    if isinstance(row, str) or not isinstance(row, Sequence | np.ndarray) or len(row) != 2:
        raise ProblemError(f"over: {row!r} is not a pair of place and share")
    return number(row[0], "over", unit), number(row[1], "over", "-")
