"""Settling: what a quantity comes to on finer and finer meshes."""

import math
from dataclasses import dataclass, replace

# Orders between these are believed: below nothing settles, above chance has a hand in it.
_LOWEST_ORDER, _HIGHEST_ORDER = 0.3, 6.0
# A quantity this much smaller than the largest of its kind is rounding.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Settling:
    """A quantity of one model over meshes, each of elements half as large as on the last.

    Attributes:
        model, quantity, unit: whose, what, in which unit of SI.
        n_nodes, values: of each mesh.
        order: p of the error ~ h^p by the three finest meshes, None where they tell none.
        extrapolated: the value at h = 0 by Richardson's extrapolation, None without an order.
        error: of the finest mesh, relative: the distance to the extrapolated value, else the last change.
        settled: whether that is within the tolerance.
    """

    model: str
    quantity: str
    unit: str
    n_nodes: tuple[int, ...]
    values: tuple[float, ...]
    order: float | None
    extrapolated: float | None
    error: float | None
    settled: bool


def settle(name: str, quantity: str, unit: str, n_nodes: list[int], values: list[float], tolerance: float) -> Settling:
    """Return what a list of values, from coarse to fine, tells."""
    order = extrapolated = error = None
    size = abs(values[-1])
    if len(values) > 1:
        error = abs(values[-1] - values[-2]) / size if size else 0.0
    if len(values) > 2:
        before, last = values[-3] - values[-2], values[-2] - values[-1]
        if last and before / last > 0:
            found = math.log2(before / last)
            if _LOWEST_ORDER <= found <= _HIGHEST_ORDER:
                order = found
                extrapolated = values[-1] - last / (2**found - 1)
                error = abs(values[-1] - extrapolated) / abs(extrapolated) if extrapolated else None
    settled = error is not None and error <= tolerance and len(values) > 2
    return Settling(name, quantity, unit, tuple(n_nodes), tuple(values), order, extrapolated, error, settled)


def beside(one: Settling, told: list[Settling]) -> Settling:
    """Return a quantity as settled where it is rounding beside another of the same model and unit."""
    largest = max(abs(other.values[-1]) for other in told if (other.model, other.unit) == (one.model, one.unit))
    if abs(one.values[-1]) <= _ROUNDING * largest:
        return replace(one, order=None, extrapolated=None, error=0.0, settled=len(one.values) > 2)
    return one
