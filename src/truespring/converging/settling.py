"""Convergence of quantities on finer meshes, by Richardson's extrapolation."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from truespring.richardson import observed_order, remaining_error

# Range of plausible orders: lower ones do not converge, higher ones are accidental.
_LOWEST_ORDER, _HIGHEST_ORDER = 0.3, 6.0
# A quantity below this share of the largest with the same unit is a rounding error.
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Settling:
    """A quantity of one model on a sequence of meshes, each with elements of half the size.

    Attributes:
        model, quantity, unit: name of the model, name of the quantity, its SI unit.
        n_nodes, values: of each mesh.
        order: p of the error ~ h^p from the three finest meshes; None if they show no plausible order.
        extrapolated: the value at h = 0 by Richardson's extrapolation; None without an order.
        error: relative error of the finest mesh: the distance to the extrapolated value, else the last change.
        settled: whether the error is within the tolerance and the three finest meshes converged.
        zero: whether it is zero up to rounding, as by symmetry; such a quantity is not used.
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
    """The status of a model on a mesh.

    Attributes:
        model, n_nodes: name of the model, number of nodes of the mesh.
        status: of the path; quantities settle on "converged" paths only.
        load_factor: the last level reached.
        advice: explanation of the status.
        complete: whether full load was reached.
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
    """The watched quantities of a study on a sequence of meshes, each with elements of half the size.

    Attributes:
        quantities: watched quantities of each model.
        attempts: status of each model on each mesh.
        tolerance: relative error up to which a quantity has settled.
    """

    quantities: tuple[Settling, ...]
    attempts: tuple[Attempt, ...]
    tolerance: float

    @property
    def n_nodes(self) -> tuple[int, ...]:
        """Number of nodes of each mesh."""
        return tuple(dict.fromkeys(one.n_nodes for one in self.attempts))

    @property
    def last(self) -> tuple[Attempt, ...]:
        """Status of each model on the finest mesh."""
        return tuple(one for one in self.attempts if one.n_nodes == self.n_nodes[-1])

    @property
    def nonzero(self) -> tuple[Settling, ...]:
        """The quantities that are not zero."""
        return tuple(one for one in self.quantities if not one.zero)

    @property
    def settled(self) -> bool:
        """Whether all nonzero quantities have settled, and every model has one."""
        models = {one.model for one in self.nonzero}
        return all(one.settled for one in self.nonzero) and models == {one.model for one in self.attempts}

    @property
    def ended(self) -> bool:
        """Whether to stop: all has settled, or a model did not reach full load."""
        return self.settled or not all(one.complete for one in self.last)

    @property
    def sentence(self) -> str:
        """The result in a sentence."""
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
            return f"Not known yet on {count}: at least {_MESHES} meshes are needed."
        if not self.nonzero:
            return f"Nothing settles on {count}: all watched quantities are zero."
        all_zero = [one.model for one in self.attempts if one.model not in {known.model for known in self.nonzero}]
        if all_zero:
            return f"The study does not settle on {count}: all watched quantities of {all_zero[0]} are zero."
        unsettled = [one for one in self.nonzero if not one.settled]
        worst = max(unsettled, key=lambda one: math.inf if one.error is None else one.error)
        off = "off by an unknown error" if worst.error is None else f"{_percent(worst.error)} off"
        tolerance = _percent(self.tolerance)
        return f"The study does not settle to {tolerance} on {count}: {worst.quantity} of {worst.model} is {off}."


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


# Number of meshes that are needed for a quantity, the finest ones.
_MESHES = 3


def refinement(
    attempts: list[Attempt], values: Mapping[tuple[str, str, str], list[tuple[int, float]]], tolerance: float
) -> Refinement:
    """Return the refinement of attempts on finer meshes.

    `values` has (number of nodes, value) of each mesh, by model, name and unit of the quantity. Quantities that are not
    finite on every mesh are left out, such as energies that another program does not output.
    """
    found = []
    for (model, quantity, unit), several in values.items():
        if not all(math.isfinite(value) for _, value in several):
            continue
        counts, numbers = [count for count, _ in several], [value for _, value in several]
        one = settle(model, quantity, unit, counts, numbers, tolerance)
        finest = [attempt for attempt in attempts if attempt.model == model][-_MESHES:]
        found.append(replace(one, settled=one.settled and all(attempt.sound for attempt in finest)))
    return Refinement(tuple(_marked_zero(one, found) for one in found), tuple(attempts), tolerance)


def settle(name: str, quantity: str, unit: str, n_nodes: list[int], values: list[float], tolerance: float) -> Settling:
    """Return order, extrapolated value and error of a quantity from its values on coarse to fine meshes."""
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


def _marked_zero(one: Settling, others: list[Settling]) -> Settling:
    """Return a quantity, marked as zero if it is a rounding error of the largest one of the same model and unit."""
    largest = max(abs(other.values[-1]) for other in others if (other.model, other.unit) == (one.model, one.unit))
    if abs(one.values[-1]) <= _ROUNDING * largest:
        return replace(one, order=None, extrapolated=None, error=None, settled=False, zero=True)
    return one
