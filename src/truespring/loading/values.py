"""Numbers that a user gives, checked."""

import math
from collections.abc import Sequence

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ProblemError


def components(values: Sequence[float], dim: int, name: str, unit: str) -> Floats:
    """Return a value a direction; raise ProblemError where they are not as many, or not finite."""
    try:
        found = np.array([float(value) for value in values])
    except (TypeError, ValueError):
        raise ProblemError(f"{name} = {values!r}: one number [{unit}] a direction is wanted") from None
    if len(found) != dim:
        raise ProblemError(f"{name} = {list(values)} [{unit}] has {len(found)} values, the body has {dim} directions")
    if not np.isfinite(found).all():
        raise ProblemError(f"{name} = {list(values)} [{unit}]: values must be finite")
    return found


def number(value: float, name: str, unit: str) -> float:
    """Return a finite number; raise ProblemError where it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number) or not math.isfinite(value):
        raise ProblemError(f"{name} = {value!r}: a finite number [{unit}] is wanted")
    return float(value)
