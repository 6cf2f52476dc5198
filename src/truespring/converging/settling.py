"""Settling: what a quantity comes to on finer and finer meshes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from truespring.richardson import observed_order, remaining_error

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
        settled: whether that is within the tolerance, and the meshes that tell it may be trusted.
        zero: whether it is zero, as by symmetry: rounding beside another of the same model and unit. Such a quantity
            tells nothing, and settles nothing.
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
    zero: bool = False


@dataclass(frozen=True)
class Attempt:
    """How a model ended on a mesh.

    Attributes:
        model, n_nodes: which model on which mesh.
        status: of its path; only where it is "converged" the mesh can settle anything.
        load_factor: the last level reached.
        advice: what the status means.
        complete: whether the full load was reached.
    """

    model: str
    n_nodes: int
    status: str
    load_factor: float
    advice: str
    complete: bool

    @property
    def sound(self) -> bool:
        """Whether the path ended at full load through stable equilibria without inverted elements."""
        return self.status == "converged"


@dataclass(frozen=True)
class Refinement:
    """A study on meshes up to here, each of elements half as large as on the last.

    Attributes:
        quantities: what is watched, of each model: the one list that is shown and that ends the loop.
        attempts: how each model ended on each mesh.
        tolerance: the relative error that was asked for.
    """

    quantities: tuple[Settling, ...]
    attempts: tuple[Attempt, ...]
    tolerance: float

    @property
    def n_nodes(self) -> tuple[int, ...]:
        """Of each mesh."""
        return tuple(dict.fromkeys(one.n_nodes for one in self.attempts))

    @property
    def last(self) -> tuple[Attempt, ...]:
        """How the models ended on the finest mesh."""
        return tuple(one for one in self.attempts if one.n_nodes == self.n_nodes[-1])

    @property
    def told(self) -> tuple[Settling, ...]:
        """The quantities that tell something: all but those that are zero."""
        return tuple(one for one in self.quantities if not one.zero)

    @property
    def settled(self) -> bool:
        """Whether all that tells something has settled, of every model."""
        models = {one.model for one in self.told}
        return all(one.settled for one in self.told) and models == {one.model for one in self.attempts}

    @property
    def ended(self) -> bool:
        """Whether finer meshes would tell no more: all has settled, or a model did not reach full load."""
        return self.settled or not all(one.complete for one in self.last)

    @property
    def sentence(self) -> str:
        """How it ended."""
        count = (
            f"{len(self.n_nodes)} mesh{'es' if len(self.n_nodes) > 1 else ''}, the finest of {self.n_nodes[-1]:,} nodes"
        )
        if self.settled:
            return f"All watched quantities have settled to {_percent(self.tolerance)} on {count}."
        troubled = [one for one in self.last if not one.sound]
        if troubled:
            one = troubled[0]
            where = "" if one.complete else f" beyond load factor {one.load_factor:.4g}"
            return (
                f"The study does not settle: {one.model} is {one.status}{where} on {one.n_nodes:,} nodes: {one.advice}."
            )
        coarse = [one for one in self.attempts if not one.sound and one.n_nodes in self.n_nodes[-_MESHES:]]
        if coarse:
            one = coarse[-1]
            return f"The study does not settle on {count}: {one.model} is {one.status} on {one.n_nodes:,} nodes."
        if len(self.n_nodes) < _MESHES:
            return f"Too early to tell on {count}: at least {_MESHES} are needed."
        if not self.told:
            return f"Nothing settles on {count}: all watched quantities are zero."
        untold = [one.model for one in self.attempts if one.model not in {told.model for told in self.told}]
        if untold:
            return f"The study does not settle on {count}: all watched quantities of {untold[0]} are zero."
        unsettled = [one for one in self.told if not one.settled]
        worst = max(unsettled, key=lambda one: math.inf if one.error is None else one.error)
        off = "off by an unknown error" if worst.error is None else f"{_percent(worst.error)} off"
        wanted = _percent(self.tolerance)
        return f"The study does not settle to {wanted} on {count}: {worst.quantity} of {worst.model} is {off}."


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


# A quantity is told from so many meshes, the finest ones.
_MESHES = 3


def refinement(
    attempts: list[Attempt], values: Mapping[tuple[str, str, str], list[tuple[int, float]]], tolerance: float
) -> Refinement:
    """Return what attempts on finer and finer meshes tell.

    `values` are those of each quantity, by model, name and unit, with the number of nodes of their mesh. One that is
    not known on each mesh is left out, such as an energy that another program does not tell.
    """
    found = []
    for (model, quantity, unit), several in values.items():
        if not all(math.isfinite(value) for _, value in several):
            continue
        counts, numbers = [count for count, _ in several], [value for _, value in several]
        one = settle(model, quantity, unit, counts, numbers, tolerance)
        finest = [attempt for attempt in attempts if attempt.model == model][-_MESHES:]
        found.append(replace(one, settled=one.settled and all(attempt.sound for attempt in finest)))
    return Refinement(tuple(_beside(one, found) for one in found), tuple(attempts), tolerance)


def settle(name: str, quantity: str, unit: str, n_nodes: list[int], values: list[float], tolerance: float) -> Settling:
    """Return what a list of values, from coarse to fine, tells."""
    order = extrapolated = error = None
    size = abs(values[-1])
    if len(values) > 1:
        error = abs(values[-1] - values[-2]) / size if size else 0.0
    if len(values) > 2:
        last = values[-2] - values[-1]
        found = observed_order(values[-3] - values[-2], last)
        if found is not None and _LOWEST_ORDER <= found <= _HIGHEST_ORDER:
            order = found
            extrapolated = values[-1] - remaining_error(last, order)
            error = abs(values[-1] - extrapolated) / abs(extrapolated) if extrapolated else None
    settled = error is not None and error <= tolerance and len(values) >= _MESHES
    return Settling(name, quantity, unit, tuple(n_nodes), tuple(values), order, extrapolated, error, settled)


def _beside(one: Settling, others: list[Settling]) -> Settling:
    """Return a quantity as zero where it is rounding beside another of the same model and unit, or nothing at all."""
    largest = max(abs(other.values[-1]) for other in others if (other.model, other.unit) == (one.model, one.unit))
    if abs(one.values[-1]) <= _ROUNDING * largest:
        return replace(one, order=None, extrapolated=None, error=None, settled=False, zero=True)
    return one
