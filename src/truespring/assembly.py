"""The assembly of element matrices and vectors into those of a body."""

import sys
from collections.abc import Callable

import numpy as np
from scipy import sparse

from truespring.arrays import Floats, Ints
from truespring.potential import SparseMatrix

# Element matrices are held in slices of so many bytes, which stay in the processor's cache.
_SLICE_BYTES = 4 * 2**20
# References to an array of which only its owner knows: the owner's, and that of the question.
_UNREFERENCED = 2
# Threads share the rows of a slice from so many on.
_SMALLEST_SLAB = 256


class Pattern:
    """The fixed sparsity of a sum of element matrices, built once and filled many times.

    Attributes:
        starts, columns: the nodes that share an element with each node, itself included, ascending.
        slots: the place of each element's blocks among them, shape (n_elements, k, k).
        at_starts, at: the elements at each node, as element * k + its place there.
        zero: as many zeros as there are directions, which tells compiled loops the dimension.
    """

    def __init__(self, elements: Ints, n_nodes: int, dim: int) -> None:
        """Take the node numbers of each element, shape (n_elements, k)."""
        from truespring.kernels import sparsity
        from truespring.kernels.threads import run

        self._room: Floats | None = None
        self.elements = np.ascontiguousarray(elements, dtype=np.int32)
        self.n_nodes, self.dim, self.zero = n_nodes, dim, (0.0,) * dim
        self.at_starts, self.at = sparsity.incidence(self.elements, n_nodes)
        counts = np.zeros(n_nodes, np.int32)
        around = (self.elements, self.at_starts, self.at)
        run(sparsity.count_neighbours, n_nodes, *around, counts)
        self.starts = np.concatenate([[0], np.cumsum(counts, dtype=np.int32)], dtype=np.int32)
        self.columns = np.empty(self.starts[-1], np.int32)
        run(sparsity.fill_neighbours, n_nodes, *around, self.starts, self.columns)
        self.slots = np.empty((*elements.shape, elements.shape[1]), np.int32)
        run(sparsity.fill_slots, len(elements), self.elements, self.starts, self.columns, self.slots)

    def values(self) -> Floats:
        """Return room for the values of a matrix, one block of shape (dim, dim) a pair of nodes; not filled."""
        # Room that nothing refers to any more is used again: the system takes long to give large arrays.
        if self._room is None or sys.getrefcount(self._room) > _UNREFERENCED:
            self._room = np.empty((len(self.columns), self.dim, self.dim))
        return self._room

    def matrix(self, values: Floats) -> SparseMatrix:
        """Return values of shape (n_blocks, dim, dim) as a sparse matrix, without a copy."""
        size = self.n_nodes * self.dim
        return sparse.bsr_array((values, self.columns, self.starts), shape=(size, size))

    def summed(self, blocks: Callable[[int, int], Floats]) -> SparseMatrix:
        """Sum element matrices, which `blocks(first, last)` gives for a slice of the elements, see `add`."""
        values = self.values()
        values[:] = 0.0
        self.add(blocks, values)
        return self.matrix(values)

    def add(self, blocks: Callable[[int, int], Floats], values: Floats) -> None:
        """Add element matrices to the values of a matrix of this pattern, shape (n_blocks, dim, dim).

        `blocks(first, last)` gives those of a slice of the elements, shape (last - first, k * dim, k * dim).
        A slice at a time is held; each thread adds to rows of its own, in the order of the elements.
        """
        from truespring.kernels import sparsity
        from truespring.kernels.threads import run

        n_elements, k = self.elements.shape
        step = max(1, _SLICE_BYTES // (8 * (k * self.dim) ** 2))
        for first in range(0, n_elements, step):
            last = min(first + step, n_elements)
            given = np.ascontiguousarray(blocks(first, last))
            low = int(self.elements[first:last].min())
            rows = int(self.elements[first:last].max()) + 1 - low

            def add(
                begin: int, end: int, first: int = first, last: int = last, given: Floats = given, low: int = low
            ) -> None:
                sparsity.add_blocks(
                    first, last, first, self.elements, self.slots, given, low + begin, low + end, values
                )

            run(add, rows, smallest=_SMALLEST_SLAB)

    def vector(self, values: Floats) -> Floats:
        """Sum vectors of the elements' nodes, shape (n_elements, k * dim), into one of shape (n_nodes, dim)."""
        from truespring.kernels import sparsity
        from truespring.kernels.threads import run

        result = np.zeros((self.n_nodes, self.dim))
        by_node = np.ascontiguousarray(values).reshape(-1, self.dim)
        run(sparsity.add_rows, self.n_nodes, self.elements.shape[1], self.at_starts, self.at, by_node, result)
        return result
