"""Figures of a refinement: watched quantities over their limits by mesh, and each over the size of the elements."""

import re
from collections.abc import Iterator, Sequence

import numpy as np

from truespring.converging.settling import Refinement, Settling
from truespring.report.plots import Curve, plot
from truespring.report.quantity import natural_scale
from truespring.report.sheet import Sheet
from truespring.report.style import EQUAL_STYLES

# Largest number of quantities with a figure of their own.
_MOST = 12


def settling_figures(found: Refinement) -> Iterator[tuple[str, Sheet]]:
    """Yield the figures with the stem of their file names; none with fewer than two meshes.

    "converge" has all quantities over their limits; then one figure for each quantity that is not zero.
    """
    several = [one for one in found.nonzero if len(one.values) > 1]
    if not several:
        return
    curves = []
    for place, one in enumerate(several):
        meshes = np.array([found.n_nodes.index(count) + 1.0 for count in one.n_nodes])
        shares = 100 * np.array(one.values) / _limit(one)
        style = EQUAL_STYLES[place % len(EQUAL_STYLES)]
        curves.append(Curve(meshes, shares, *style, label=f"{one.quantity}\n{one.model}", strong=False))
    yield "converge", plot("Watched quantities over their limits", "mesh", "share [%]", curves, far=True).sheet
    for quantity in list(dict.fromkeys(one.quantity for one in several))[:_MOST]:
        those = [one for one in several if one.quantity == quantity]
        yield f"converge_{re.sub(r'[^a-z0-9]+', '_', quantity.lower())}", _of_quantity(those, found.n_nodes)


def _of_quantity(several: Sequence[Settling], n_nodes: Sequence[int]) -> Sheet:
    """Return a quantity of each model over the size of the elements; at 0 the extrapolated value."""
    first = several[0]
    scale = natural_scale(max(abs(value) for one in several for value in one.values), first.unit)
    curves = []
    for place, one in enumerate(several):
        sizes = [0.5 ** n_nodes.index(count) for count in one.n_nodes][::-1]  # each mesh halves the elements
        values = list(one.values)[::-1]
        if one.extrapolated is not None:
            sizes, values = [0.0, *sizes], [one.extrapolated, *values]
        style = EQUAL_STYLES[place % len(EQUAL_STYLES)]
        y = np.array(values) / scale.size
        curves.append(Curve(np.array(sizes), y, *style, label=one.model, strong=False))
    title = f"{first.quantity[0].upper()}{first.quantity[1:]}; at 0 the extrapolated value"
    y_label = f"{first.quantity} [{scale.unit}]"
    return plot(title, "element size over that of the first mesh", y_label, curves, far=True).sheet


def _limit(one: Settling) -> float:
    """Return the extrapolated value of a quantity, else its last value."""
    return one.values[-1] if one.extrapolated is None else one.extrapolated
