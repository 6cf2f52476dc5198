"""Check the values of tools and grasps."""

import math

import numpy as np

from truespring.arrays import Floats
from truespring.errors import ToolError


def positive(name: str, key: str, value: object, unit: str, zero: bool = False) -> float:
    """Return a value as a float; raise ToolError unless it is a positive number, or zero if that is allowed."""
    number = value if isinstance(value, int | float | np.number) and not isinstance(value, bool) else math.nan
    if not math.isfinite(number) or number < 0 or (number == 0 and not zero):
        allowed = "a number that is not negative" if zero else "a positive number"
        raise ToolError(name, f"{value!r} [{unit}]: must be {allowed}", key)
    return float(number)


def vector(name: str, key: str, values: object, dim: int, unit: str) -> Floats:
    """Return values as an array of shape (dim,); raise ToolError unless they are `dim` finite numbers."""
    try:
        found = np.array(values, dtype=float)
    except (TypeError, ValueError):
        found = np.zeros(0)
    if found.shape != (dim,) or not np.isfinite(found).all():
        raise ToolError(name, f"{values!r}: give {dim} numbers [{unit}], one per direction", key)
    return found
