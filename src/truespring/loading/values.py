"""Check, scale and rotate the values of loads and supports."""

import math
from collections.abc import Sequence

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ProblemError


def components(values: Sequence[float], dim: int, name: str, unit: str) -> Floats:
    """Return the values as an array of shape (dim,); raise ProblemError unless they are `dim` finite numbers."""
    try:
        found = np.array([float(value) for value in values])
    except (TypeError, ValueError):
        raise ProblemError(f"{name} = {values!r}: must be one number [{unit}] per direction") from None
    if len(found) != dim:
        raise ProblemError(f"{name} = {list(values)} [{unit}] has {len(found)} values, the body has {dim} directions")
    if not np.isfinite(found).all():
        raise ProblemError(f"{name} = {list(values)} [{unit}]: values must be finite")
    return found


def number(value: float, name: str, unit: str) -> float:
    """Return the value as a float; raise ProblemError unless it is a finite number."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not math.isfinite(value):
        raise ProblemError(f"{name} = {value!r}: must be a finite number [{unit}]")
    return float(value)


def times(values: Sequence[float], factor: float) -> tuple[float, ...]:
    """Return the components multiplied by a factor."""
    return tuple(factor * one for one in values)


def rotated(values: Sequence[float], rotation: Floats) -> tuple[float, ...]:
    """Return the components of a vector rotated by a matrix of shape (dim, dim)."""
    return tuple((rotation @ np.asarray(values)).tolist())
