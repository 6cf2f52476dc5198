"""Assembly of element matrices and vectors into a sparse matrix and a vector of all nodes."""

import sys
from collections.abc import Callable, Iterable

import numpy as np
from scipy import sparse

from truespring.arrays import Floats, Ints
from truespring.potential import SparseMatrix

# Size of the slices in which element matrices are computed [bytes]: they stay in the processor's cache.
_SLICE_BYTES = 4 * 2**20
# sys.getrefcount of an array that only its owner refers to: the owner's reference and that of the call.
_UNREFERENCED = 2
# Smallest number of rows that is worth another thread.
_SMALLEST_SLAB = 256


class Pattern:
    """Fixed sparsity of a sum of element matrices, built once and filled many times.

    Attributes:
        starts, columns: for each node, the nodes that share an element with it, itself included, ascending; shape
            (n_nodes + 1,) and (n_blocks,).
        slots: index of the block of each pair of an element's nodes, shape (n_elements, k, k).
        at_starts, at: for each node, its elements as element * k + local node; shape (n_nodes + 1,) and
            (n_elements * k,).
        zero: tuple of dim zeros, from whose type compiled loops take the dimension.
    """

    def __init__(self, elements: Ints, n_nodes: int, dim: int) -> None:
        """Build the sparsity from the node numbers of each element, shape (n_elements, k)."""
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
        """Return an uninitialised array for the values of a matrix, in its unit, shape (n_blocks, dim, dim)."""
        # Reuse the last array if nothing refers to it: allocating large arrays is slow.
        if self._room is None or sys.getrefcount(self._room) > _UNREFERENCED:
            self._room = np.empty((len(self.columns), self.dim, self.dim))
        return self._room

    def matrix(self, values: Floats) -> SparseMatrix:
        """Return values of shape (n_blocks, dim, dim) as a sparse matrix, shape (n_dof, n_dof), without a copy."""
        size = self.n_nodes * self.dim
        return sparse.bsr_array((values, self.columns, self.starts), shape=(size, size))

    def summed(self, blocks: Callable[[int, int], Floats]) -> SparseMatrix:
        """Return the sum of element matrices, shape (n_dof, n_dof); `blocks` as in `add`."""
        values = self.values()
        values[:] = 0.0
        self.add(blocks, values)
        return self.matrix(values)

    def add(self, blocks: Callable[[int, int], Floats], values: Floats) -> None:
        """Add element matrices to the values of a matrix of this pattern, shape (n_blocks, dim, dim).

        `blocks(first, last)` returns the matrices of elements first to last, shape (last - first, k * dim, k * dim). It
        is called for one slice at a time; each thread adds to different rows, in the order of the elements.
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

    def summed_pairs(self, slices: Iterable[tuple[int, int]], pairs: Callable[[int, int], Floats]) -> SparseMatrix:
        """Return the sum of symmetric element matrices, shape (n_dof, n_dof).

        `pairs(first, last)` returns those of a slice of the elements as pairs of nodes, see `dense`; each thread adds
        to different rows, in the order of the elements.
        """
        from truespring.kernels import sparsity
        from truespring.kernels.threads import computed, run, writable

        values, known = self.values(), list(slices)
        values[:] = 0.0
        for (first, last), given in zip(known, computed(lambda ends: writable(pairs(*ends)), known), strict=True):
            low = int(self.elements[first:last].min())
            rows = int(self.elements[first:last].max()) + 1 - low

            def add(
                begin: int, end: int, first: int = first, last: int = last, given: Floats = given, low: int = low
            ) -> None:
                bounds = (low + begin, low + end)
                sparsity.add_pairs(first, last, self.elements, self.slots, given, *bounds, values, self.zero)

            run(add, rows, smallest=_SMALLEST_SLAB)
        return self.matrix(values)

    def vector(self, values: Floats) -> Floats:
        """Return element vectors, shape (n_elements, k * dim), summed by node, shape (n_nodes, dim); units stay."""
        from truespring.kernels import sparsity
        from truespring.kernels.threads import run

        result = np.zeros((self.n_nodes, self.dim))
        by_node = np.ascontiguousarray(values).reshape(-1, self.dim)
        run(sparsity.add_rows, self.n_nodes, self.at_starts, self.at, by_node, result)
        return result


def pairs_of_nodes(k: int) -> tuple[Ints, Ints]:
    """Return the pairs of nodes a <= b of an element, in the order of `dense`, shape (k (k + 1) / 2,) each."""
    b, a = np.tril_indices(k)
    return a, b


def dense(pairs: Floats, k: int, dim: int) -> Floats:
    """Return symmetric element matrices that are given by pairs of nodes; unit stays, shape (n, k * dim, k * dim).

    `pairs` has shape (n / lanes, k (k + 1) / 2 * dim^2, lanes): row (b (b + 1) / 2 + a) dim^2 + i * dim + j is the
    entry i, j of the block of the nodes a <= b.
    """
    a, b = np.divmod(np.arange(k * dim), dim)
    low, high = np.minimum(a[:, None], a), np.maximum(a[:, None], a)
    below = a[:, None] > a
    i, j = np.where(below, b, b[:, None]), np.where(below, b[:, None], b)
    rows = (high * (high + 1) // 2 + low) * dim * dim + i * dim + j
    return np.moveaxis(pairs[:, rows], -1, 1).reshape(-1, k * dim, k * dim)
