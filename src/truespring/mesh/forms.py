"""Forms: elements are of one form if a translation maps them onto each other, node by node."""

from dataclasses import dataclass

import numpy as np

from truespring.arrays import Floats, Ints
from truespring.mesh.corners import corners_in_slices
from truespring.mesh.rows import distinct_rows

# Positions in elements that differ by less than this fraction of the mean element size are equal.
_SAME_PLACE = 1e-5

# Equal coordinates computed by one formula differ by at most about this many rounding errors of the largest one.
_ROUNDINGS = 32


@dataclass(frozen=True, eq=False)
class Forms:
    """The forms of a mesh's elements.

    Attributes:
        of: the form of each element, shape (n_elements,).
        first: the first element of each form, shape (n_forms,).
        size: the extent of an element along the axis where it is longest, the mean of all [m].
        largest: the extent of the longest element along each axis [m], shape (dim,).
        exact: whether elements of one form differ by no more than the rounding of their coordinates.
    """

    of: Ints
    first: Ints
    size: float
    largest: Floats
    exact: bool

    @property
    def single(self) -> bool:
        """Whether all elements are of one form exactly."""
        return self.exact and len(self.first) == 1

    @property
    def few(self) -> bool:
        """Whether computing one element of each form and copying it to the others is exact and saves work."""
        return self.exact and 4 * len(self.first) <= len(self.of)


def find_forms(nodes: Floats, elements: Ints) -> Forms:
    """Find the forms of elements; nodes [m] of shape (n_nodes, dim)."""
    n_local, dim = elements.shape[1], nodes.shape[1]
    total, largest = 0.0, np.zeros(dim)
    for _, at in corners_in_slices(nodes, elements):
        extents = [np.maximum.reduce(along) - np.minimum.reduce(along) for along in zip(*at, strict=True)]
        total += float(np.maximum.reduce(extents).sum())
        largest = np.maximum(largest, [extent.max() for extent in extents])
    size = total / len(elements)
    columns = np.empty(((n_local - 1) * dim, len(elements)), dtype=np.int64)
    for part, at in corners_in_slices(nodes, elements):
        for number in range(len(columns)):
            node, axis = divmod(number, dim)
            columns[number, part] = rounded(at[node + 1][axis] - at[0][axis], size)
    found = distinct_rows(columns)
    of, first = found.of, found.first
    del columns, found
    models = nodes[elements[first]]
    models = np.ascontiguousarray((models - models[:, :1]).T)  # axes (direction, node, form)
    apart = 0.0
    for part, at in corners_in_slices(nodes, elements):
        for node in range(1, n_local):
            for axis in range(dim):
                off = at[node][axis] - at[0][axis]
                off -= models[axis, node, of[part]]
                apart = max(apart, -float(off.min()), float(off.max()))
    return Forms(of, first, size, largest, apart <= _ROUNDINGS * float(np.finfo(float).eps * np.abs(nodes).max()))


def rounded(places: Floats, size: float) -> Ints:
    """Return positions [m] in elements of a size [m] as integers of the same shape, equal for equal positions.

    The offset rounds halves and quarters, which lie between two integers, to the same side.
    """
    return np.asarray(np.rint(places / (size * _SAME_PLACE) + 0.3137).astype(np.int64))
