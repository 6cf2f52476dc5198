"""Numbers of loads and supports: checked, scaled and turned."""

import math
from collections.abc import Sequence

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ProblemError


def components(values: Sequence[float], dim: int, name: str, unit: str) -> Floats:
    """Return one finite value a direction, shape (dim,); raise ProblemError for another number of them."""
    try:
        found = np.array([float(value) for value in values])
    except (TypeError, ValueError):
        raise ProblemError(f"{name} = {values!r}: must be one number [{unit}] a direction") from None
    if len(found) != dim:
        raise ProblemError(f"{name} = {list(values)} [{unit}] has {len(found)} values, the body has {dim} directions")
    if not np.isfinite(found).all():
        raise ProblemError(f"{name} = {list(values)} [{unit}]: values must be finite")
    return found


def number(value: float, name: str, unit: str) -> float:
    """Return a finite number; raise ProblemError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not math.isfinite(value):
        raise ProblemError(f"{name} = {value!r}: must be a finite number [{unit}]")
    return float(value)


def times(values: Sequence[float], factor: float) -> tuple[float, ...]:
    """Return components times a factor."""
    return tuple(factor * one for one in values)


def rotated(values: Sequence[float], rotation: Floats) -> tuple[float, ...]:
    """Return components turned by a rotation matrix, shape (dim, dim)."""
    return tuple((rotation @ np.asarray(values)).tolist())
