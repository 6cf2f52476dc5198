"""The corners of elements slice by slice, coordinate by coordinate, and the determinants that they span."""

from collections.abc import Iterator, Sequence

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.memory import slices
from truespring.mesh.kinds import Groups

#: Coordinates of some elements [m]: of each node of the element, in each direction, an array of shape (n,).
Corners = Sequence[Sequence[Floats]]


def corners_in_slices(positions: Floats, elements: Ints) -> Iterator[tuple[slice, Corners]]:
    """Yield slices of the elements and the coordinates of their nodes at `positions` [m], shape (n_nodes, dim)."""
    columns = np.ascontiguousarray(positions.T)
    for part in slices(len(elements), 8 * len(columns) * elements.shape[1]):
        yield part, [[column[nodes] for column in columns] for nodes in elements[part].T]


def squared_distance(at: Corners, one: int, other: int) -> Floats:
    """Return the square of the distance of two nodes of each element [m^2], shape (n,)."""
    return np.asarray(sum((b - a) ** 2 for a, b in zip(at[one], at[other], strict=True)))


def determinants(at: Corners, simplices: Groups) -> Iterator[Floats]:
    """Yield the determinants spanned at the first of each simplex' nodes by the others [m^dim], each of shape (n,)."""
    for first, *others in simplices:
        spans = [[b - a for a, b in zip(at[first], at[other], strict=True)] for other in others]
        if len(spans) == 2:
            (a, b), (c, d) = spans
            yield a * d - b * c
        else:
            (a, b, c), (d, e, f), (g, h, i) = spans
            yield a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)
