"""Sparsity of a matrix of node blocks, and assembly of element matrices into it."""

from typing import Any

import numpy as np

from truespring.kernels.small import unsigned
from truespring.kernels.threads import kernel


@kernel
def incidence(elements: Any, n_nodes: int) -> Any:
    """Return the elements at each node: starts (n_nodes + 1,), and element * k + local node (n_elements * k,).

    Shapes: elements (n_elements, k).
    """
    n_elements, k = elements.shape
    starts = np.zeros(n_nodes + 1, np.int32)
    for e in range(n_elements):
        for a in range(k):
            starts[elements[e, a] + 1] += 1
    for i in range(n_nodes):
        starts[i + 1] += starts[i]
    at = np.empty(n_elements * k, np.int32)
    filled = starts[:-1].copy()
    for e in range(n_elements):
        for a in range(k):
            i = elements[e, a]
            at[filled[i]] = e * k + a
            filled[i] += 1
    return starts, at


@kernel
def count_neighbours(first: int, last: int, elements: Any, at_starts: Any, at: Any, counts: Any) -> None:
    """Count the nodes that share an element with each node, itself included.

    Shapes: elements (n_elements, k), at_starts (n_nodes + 1,), at (n_elements * k,), counts (n_nodes,).
    """
    k = elements.shape[1]
    seen = np.full(len(counts), -1, np.int32)
    for i in range(first, last):
        count = 1
        seen[i] = i
        for q in range(at_starts[i], at_starts[i + 1]):
            e = at[q] // k
            for b in range(k):
                j = elements[e, b]
                if seen[j] != i:
                    seen[j] = i
                    count += 1
        counts[i] = count


@kernel
def fill_neighbours(first: int, last: int, elements: Any, at_starts: Any, at: Any, starts: Any, columns: Any) -> None:
    """Write the nodes that share an element with each node, itself included, in ascending order.

    Shapes: elements (n_elements, k), at_starts, starts (n_nodes + 1,), at (n_elements * k,), columns (n_blocks,).
    """
    k = elements.shape[1]
    seen = np.full(len(starts) - 1, -1, np.int32)
    for i in range(first, last):
        begin = starts[i]
        end = begin + 1
        columns[begin] = i
        seen[i] = i
        for q in range(at_starts[i], at_starts[i + 1]):
            e = at[q] // k
            for b in range(k):
                j = elements[e, b]
                if seen[j] != i:
                    seen[j] = i
                    place = end
                    while place > begin and columns[place - 1] > j:
                        columns[place] = columns[place - 1]
                        place -= 1
                    columns[place] = j
                    end += 1


@kernel
def fill_slots(first: int, last: int, elements: Any, starts: Any, columns: Any, slots: Any) -> None:
    """Write the number of the block of each pair of an element's nodes.

    Shapes: elements (n_elements, k), starts (n_nodes + 1,), columns (n_blocks,), slots (n_elements, k, k).
    """
    k = elements.shape[1]
    for e in range(first, last):
        for a in range(k):
            i = elements[e, a]
            for b in range(k):
                j = elements[e, b]
                low, high = starts[i], starts[i + 1] - 1
                while low < high:
                    middle = (low + high) // 2
                    if columns[middle] < j:
                        low = middle + 1
                    else:
                        high = middle
                slots[e, a, b] = low


@kernel
def add_rows(first: int, last: int, at_starts: Any, at: Any, values: Any, result: Any) -> None:
    """Add values of the elements' nodes to the nodes first to last.

    Shapes: at_starts (n_nodes + 1,), at (n_elements * k,), values (n_elements * k, dim), result (n_nodes, dim).
    """
    for i in range(first, last):
        for q in range(at_starts[i], at_starts[i + 1]):
            for d in range(values.shape[1]):
                result[i, d] += values[at[q], d]


@kernel
def add_blocks(
    first: int, last: int, offset: int, elements: Any, slots: Any, blocks: Any, low: int, high: int, data: Any
) -> None:
    """Add the matrices of elements first to last to the rows low to high of a matrix; `blocks` begins at `offset`.

    Shapes: elements (n_elements, k), slots (n_elements, k, k), blocks (slice, k * dim, k * dim), data (n_blocks, dim,
    dim).
    """
    k = elements.shape[1]
    dim = data.shape[1]
    for e in range(first, last):
        for a in range(k):
            i = elements[e, a]
            if low <= i < high:
                for b in range(k):
                    p = slots[e, a, b]
                    for c in range(dim):
                        for d in range(dim):
                            data[p, c, d] += blocks[e - offset, a * dim + c, b * dim + d]


@kernel
def unique_pairs(pairs: Any, n_nodes: int) -> Any:
    """Return the distinct pairs of nodes, sorted, shape (n_found, 2), and the number of each given pair, shape (n,).

    Shapes: pairs (n, 2).
    """
    starts = np.zeros(n_nodes + 1, np.int64)
    for s in range(len(pairs)):
        starts[min(pairs[s, 0], pairs[s, 1]) + 1] += 1
    for i in range(n_nodes):
        starts[i + 1] += starts[i]
    order = np.empty(len(pairs), np.int32)
    filled = starts[:-1].copy()
    for s in range(len(pairs)):
        i = min(pairs[s, 0], pairs[s, 1])
        order[filled[i]] = s
        filled[i] += 1
    place = np.empty(len(pairs), np.int32)
    second = np.empty(len(pairs), np.int32)  # second nodes of the pairs found, ascending for each first node
    begins = np.empty(n_nodes + 1, np.int64)
    n_found = 0
    for i in range(n_nodes):
        begin = n_found
        begins[i] = begin
        for q in range(starts[i], starts[i + 1]):
            j = max(pairs[order[q], 0], pairs[order[q], 1])
            at = n_found
            while at > begin and second[at - 1] > j:
                at -= 1
            if at == begin or second[at - 1] != j:
                for later in range(n_found, at, -1):
                    second[later] = second[later - 1]
                second[at] = j
                n_found += 1
        for q in range(starts[i], starts[i + 1]):
            j = max(pairs[order[q], 0], pairs[order[q], 1])
            low, high = begin, n_found - 1
            while low < high:
                middle = (low + high) // 2
                if second[middle] < j:
                    low = middle + 1
                else:
                    high = middle
            place[order[q]] = low
    begins[n_nodes] = n_found
    found = np.empty((n_found, 2), np.int64)
    for i in range(n_nodes):
        for at in range(begins[i], begins[i + 1]):
            found[at, 0] = i
            found[at, 1] = second[at]
    return found, place


@kernel
def add_pairs(
    first: int, last: int, elements: Any, slots: Any, blocks: Any, low: int, high: int, data: Any, zero: Any
) -> None:
    """Add symmetric matrices of elements first to last to the rows low to high of a matrix.

    Row (b (b + 1) / 2 + a) dim^2 + i * dim + j of `blocks` is the entry i, j of the pair of nodes a <= b, for each
    element from `first` on.

    Shapes: elements (n_elements, k), slots (n_elements, k, k), blocks (at least (last - first) / lanes, k (k + 1) / 2 *
    dim^2, lanes), data (n_blocks, dim, dim).
    """
    k, dim = elements.shape[1], len(zero)
    for e in range(first, last):
        pairs, lane = blocks[(e - first) // blocks.shape[2]], unsigned((e - first) % blocks.shape[2])
        for b in range(k):
            j = elements[e, b]
            for a in range(b + 1):
                i = elements[e, a]
                row = (b * (b + 1) // 2 + a) * dim * dim
                if low <= i < high:
                    p = unsigned(slots[e, a, b])
                    for c in range(dim):
                        for d in range(dim):
                            data[p, c, d] += pairs[unsigned(row + c * dim + d), lane]
                if a != b and low <= j < high:
                    p = unsigned(slots[e, b, a])
                    for c in range(dim):
                        for d in range(dim):
                            data[p, d, c] += pairs[unsigned(row + c * dim + d), lane]
