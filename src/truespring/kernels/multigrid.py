"""Loops that build and use the levels of smoothed aggregation (Vanek, Mandel, Brezina, Computing 56, 1996).

Rows of a prolongation are nodes, columns are aggregates, blocks have shape (k, n_modes), with k unknowns per node. A
matrix has blocks of shape (k, k): starts (n + 1,), columns (n_blocks,), data (n_blocks, k, k), held (n, k).
"""

from typing import Any

import numpy as np

from truespring.kernels.small import add_line, line, minus, plus, put, row, times, times_transposed, unsigned
from truespring.kernels.threads import kernel


@kernel
def _size(data: Any, p: int, i: int, j: int, held: Any) -> float:
    """Return the sum of the squares of the entries of block p, in row i and column j, between free directions."""
    total = 0.0
    for c in range(data.shape[1]):
        for e in range(data.shape[1]):
            if not (held[i, c] or held[j, e]):
                total += data[p, c, e] ** 2
    return total


@kernel
def diagonal_sizes(first: int, last: int, starts: Any, columns: Any, data: Any, held: Any, sizes: Any) -> None:
    """Write the size of each diagonal block: the sum of the squares of its entries between free directions.

    Shapes: starts (n + 1,), columns (n_blocks,), data (n_blocks, k, k), held (n, k), sizes (n,).
    """
    for i in range(first, last):
        for p in range(starts[i], starts[i + 1]):
            if columns[p] == i:
                sizes[i] = _size(data, p, i, i, held)


@kernel
def strong(
    first: int, last: int, starts: Any, columns: Any, data: Any, held: Any, sizes: Any, share: float, keep: Any
) -> None:
    """Mark off-diagonal blocks of at least `share` of the geometric mean of the two diagonal blocks.

    Shapes: starts (n + 1,), columns (n_blocks,), data (n_blocks, k, k), held (n, k), sizes (n,), keep (n_blocks,).
    """
    for i in range(first, last):
        for p in range(starts[i], starts[i + 1]):
            j = columns[p]
            block = _size(data, p, i, j, held) if j != i else 0.0
            keep[p] = block * block >= share**4 * sizes[i] * sizes[j] and block > 0.0


@kernel
def tentative(
    first: int, last: int, member_starts: Any, members: Any, modes: Any, basis: Any, coarse_modes: Any
) -> None:
    """Write orthonormal modes of each aggregate, and the coefficients of modes = basis coarse_modes.

    Shapes: member_starts (n_aggregates + 1,), members (n_members,), modes, basis (n, k, n_modes), coarse_modes
    (n_aggregates, n_modes, n_modes).
    """
    size, n_modes = modes.shape[1], modes.shape[2]
    for aggregate in range(first, last):
        begin, end = member_starts[aggregate], member_starts[aggregate + 1]
        for k in range(n_modes):
            whole = 0.0
            for q in range(begin, end):
                for c in range(size):
                    value = modes[members[q], c, k]
                    basis[members[q], c, k] = value
                    whole += value * value
            for _ in range(2):  # Gram-Schmidt, twice for orthogonality to rounding
                for m in range(k):
                    s = 0.0
                    for q in range(begin, end):
                        for c in range(size):
                            s += basis[members[q], c, m] * basis[members[q], c, k]
                    coarse_modes[aggregate, m, k] += s
                    for q in range(begin, end):
                        for c in range(size):
                            basis[members[q], c, k] -= s * basis[members[q], c, m]
            left = 0.0
            for q in range(begin, end):
                for c in range(size):
                    left += basis[members[q], c, k] ** 2
            # A mode that depends linearly on the previous ones has no column: a single node has no rotation.
            scale = 1.0 / np.sqrt(left) if left > 1e-12 * whole else 0.0
            coarse_modes[aggregate, k, k] = np.sqrt(left) if scale > 0.0 else 0.0
            for q in range(begin, end):
                for c in range(size):
                    basis[members[q], c, k] *= scale


@kernel
def count_smoothed(
    first: int, last: int, starts: Any, columns: Any, aggregate: Any, n_aggregates: int, counts: Any
) -> None:
    """Count the aggregates of the neighbours of each node.

    Shapes: starts (n + 1,), columns (n_blocks,), aggregate (n,), counts (n,).
    """
    seen = np.full(n_aggregates, -1, np.int32)
    for i in range(first, last):
        count = 0
        for p in range(starts[i], starts[i + 1]):
            c = aggregate[columns[p]]
            if c >= 0 and seen[c] != i:
                seen[c] = i
                count += 1
        counts[i] = count


@kernel
def smooth(
    first: int,
    last: int,
    starts: Any,
    columns: Any,
    data: Any,
    held: Any,
    inverse: Any,
    aggregate: Any,
    basis: Any,
    n_aggregates: int,
    omega: float,
    p_starts: Any,
    p_columns: Any,
    p_data: Any,
    zero: Any,
) -> None:
    """Write the rows of P = (I - omega D^-1 A) T, with T given by `basis`; rows of held directions are zero.

    Shapes: starts (n + 1,), columns (n_blocks,), data (n_blocks, k, k), held (n, k), inverse (n, k, k), aggregate (n,),
    basis (n, k, n_modes), p_starts (n + 1,), p_columns (n_p,), p_data (n_p, k, n_modes); `zero` has length n_modes.
    """
    size, n_modes = basis.shape[1], basis.shape[2]
    where = np.full(n_aggregates, -1, np.int32)
    total = np.empty((1, n_modes))
    widest = 0
    for i in range(first, last):
        widest = max(widest, p_starts[i + 1] - p_starts[i])
    image = np.empty((widest, size, n_modes))
    for i in range(first, last):
        begin = p_starts[i]
        end = begin
        for p in range(starts[i], starts[i + 1]):
            c = aggregate[columns[p]]
            if c >= 0 and (where[c] < begin or where[c] >= end or p_columns[where[c]] != c):
                place = end
                while place > begin and p_columns[place - 1] > c:
                    p_columns[place] = p_columns[place - 1]
                    where[p_columns[place]] = place
                    place -= 1
                p_columns[place] = c
                where[c] = place
                end += 1
        image[: end - begin] = 0.0
        for p in range(starts[i], starts[i + 1]):
            j = columns[p]
            if aggregate[j] >= 0:
                q = where[aggregate[j]] - begin
                for s in range(size):
                    modes = line(basis, j, s, zero)
                    for r in range(size):
                        if not held[i, r]:
                            add_line(image, q, r, data[p, r, s], modes)
        for q in range(begin, end):
            for r in range(size):
                total[:] = 0.0
                if not held[i, r]:
                    for s in range(size):
                        for k in range(n_modes):
                            total[0, k] -= omega * inverse[i, r, s] * image[q - begin, s, k]
                    if p_columns[q] == aggregate[i]:
                        for k in range(n_modes):
                            total[0, k] += basis[i, r, k]
                for k in range(n_modes):
                    p_data[q, r, k] = total[0, k]


@kernel
def transpose(p_starts: Any, p_columns: Any, p_data: Any, n_aggregates: int) -> Any:
    """Return the rows of P^T: starts (n_aggregates + 1,), nodes (n_p,), blocks (n_p, n_modes, k) in single precision.

    Shapes: p_starts (n + 1,), p_columns (n_p,), p_data (n_p, k, n_modes).
    """
    starts = np.zeros(n_aggregates + 1, np.int32)
    for q in range(len(p_columns)):
        starts[p_columns[q] + 1] += 1
    for c in range(n_aggregates):
        starts[c + 1] += starts[c]
    node = np.empty(len(p_columns), np.int32)
    data = np.empty((len(p_columns), p_data.shape[2], p_data.shape[1]), np.float32)
    filled = starts[:-1].copy()
    for i in range(len(p_starts) - 1):
        for q in range(p_starts[i], p_starts[i + 1]):
            at = filled[p_columns[q]]
            node[at] = i
            for r in range(p_data.shape[1]):
                for k in range(p_data.shape[2]):
                    data[at, k, r] = p_data[q, r, k]
            filled[p_columns[q]] += 1
    return starts, node, data


@kernel
def count_product(
    first: int, last: int, a_starts: Any, a_columns: Any, b_starts: Any, b_columns: Any, n: int, counts: Any
) -> None:
    """Count the blocks in each row of a product A B of sparse matrices; B has `n` columns.

    Shapes: a_starts (n_rows + 1,), a_columns (n_a,), b_starts (n_b_rows + 1,), b_columns (n_b,), counts (n_rows,).
    """
    seen = np.full(n, -1, np.int32)
    for i in range(first, last):
        count = 0
        for p in range(a_starts[i], a_starts[i + 1]):
            j = a_columns[p]
            for q in range(b_starts[j], b_starts[j + 1]):
                c = b_columns[q]
                if seen[c] != i:
                    seen[c] = i
                    count += 1
        counts[i] = count


@kernel
def fill_product(
    first: int,
    last: int,
    a_starts: Any,
    a_columns: Any,
    b_starts: Any,
    b_columns: Any,
    n: int,
    starts: Any,
    columns: Any,
) -> None:
    """Write the ascending columns of the rows of a product A B of sparse matrices; B has `n` columns.

    Shapes: a_starts (n_rows + 1,), a_columns (n_a,), b_starts (n_b_rows + 1,), b_columns (n_b,), starts (n_rows + 1,),
    columns (n_blocks,).
    """
    seen = np.full(n, -1, np.int32)
    for i in range(first, last):
        begin = starts[i]
        end = begin
        for p in range(a_starts[i], a_starts[i + 1]):
            j = a_columns[p]
            for q in range(b_starts[j], b_starts[j + 1]):
                c = b_columns[q]
                if seen[c] != i:
                    seen[c] = i
                    place = end
                    while place > begin and columns[place - 1] > c:
                        columns[place] = columns[place - 1]
                        place -= 1
                    columns[place] = c
                    end += 1


@kernel
def multiply(
    first: int,
    last: int,
    begin: int,
    starts: Any,
    columns: Any,
    data: Any,
    p_starts: Any,
    p_columns: Any,
    p_data: Any,
    n: int,
    ap_starts: Any,
    ap_columns: Any,
    ap_data: Any,
    zero: Any,
) -> None:
    """Write rows begin + first to begin + last of A P; `ap_data` begins at row `begin`.

    Shapes: starts (n + 1,), columns (n_blocks,), data (n_blocks, k, k), p_starts (n + 1,), p_columns (n_p,), p_data
    (n_p, k, n_modes), ap_starts (n + 1,), ap_columns (n_ap,), ap_data (blocks of the slice, k, n_modes); `n` is the
    number of aggregates, `zero` has length n_modes.
    """
    size = p_data.shape[1]
    where = np.empty(n, np.int32)
    for i in range(begin + first, begin + last):
        for q in range(ap_starts[i] - ap_starts[begin], ap_starts[i + 1] - ap_starts[begin]):
            where[ap_columns[q + ap_starts[begin]]] = q
            ap_data[q] = 0.0
        for p in range(starts[i], starts[i + 1]):
            j = columns[p]
            for t in range(p_starts[j], p_starts[j + 1]):
                q = where[p_columns[t]]
                for s in range(size):
                    modes = line(p_data, t, s, zero)
                    for r in range(size):
                        add_line(ap_data, q, r, data[p, r, s], modes)


@kernel
def add_transposed(
    first: int,
    last: int,
    low: int,
    begin: int,
    end: int,
    p_starts: Any,
    p_columns: Any,
    p_data: Any,
    ap_starts: Any,
    ap_columns: Any,
    ap_data: Any,
    starts: Any,
    columns: Any,
    data: Any,
    zero: Any,
) -> None:
    """Add the contributions of rows `begin` to `end` of A P to rows low + first to low + last of P^T (A P).

    Shapes: p_starts (n + 1,), p_columns (n_p,), p_data (n_p, k, n_modes), ap_starts (n + 1,), ap_columns (n_ap,),
    ap_data (blocks of the slice, k, n_modes), starts (n_aggregates + 1,), columns (n_blocks,), data (n_blocks, n_modes,
    n_modes); `zero` has length n_modes.
    """
    size, n_modes = p_data.shape[1], p_data.shape[2]
    for i in range(begin, end):
        for t in range(p_starts[i], p_starts[i + 1]):
            c = p_columns[t]
            if low + first <= c < low + last:
                q = starts[c]
                for u in range(ap_starts[i], ap_starts[i + 1]):
                    while columns[q] < ap_columns[u]:
                        q += 1
                    for r in range(size):
                        modes = line(ap_data, u - ap_starts[begin], r, zero)
                        for k in range(n_modes):
                            add_line(data, q, k, np.float64(p_data[t, r, k]), modes)


@kernel
def restrict(
    first: int, last: int, r_starts: Any, r_node: Any, r_data: Any, fine: Any, coarse: Any, zero: Any, none: Any
) -> None:
    """Write coarse = P^T fine.

    Shapes: r_starts (n_aggregates + 1,), r_node (n_p,), r_data (n_p, n_modes, k), fine (n, k), coarse (n_aggregates,
    n_modes); `zero` has length n_modes, `none` length k.
    """
    for c in range(first, last):
        s = zero
        for p in range(r_starts[c], r_starts[c + 1]):
            s = plus(s, times(r_data, p, row(fine, r_node[unsigned(p)], none), zero))
        put(coarse, c, s)


@kernel
def prolong(
    first: int, last: int, p_starts: Any, p_columns: Any, p_data: Any, coarse: Any, fine: Any, zero: Any, none: Any
) -> None:
    """Add P coarse to fine.

    Shapes: p_starts (n + 1,), p_columns (n_p,), p_data (n_p, k, n_modes), coarse (n_aggregates, n_modes), fine (n, k);
    `zero` has length n_modes, `none` length k.
    """
    for i in range(first, last):
        s = row(fine, i, none)
        for p in range(p_starts[i], p_starts[i + 1]):
            s = plus(s, times(p_data, p, row(coarse, p_columns[unsigned(p)], zero), none))
        put(fine, i, s)


@kernel
def prolong_turned(
    first: int,
    last: int,
    p_starts: Any,
    p_columns: Any,
    p_data: Any,
    turns: Any,
    coarse: Any,
    fine: Any,
    zero: Any,
    none: Any,
) -> None:
    """Add Q P coarse to fine, with the rotations Q of the nodes.

    Shapes: p_starts (n + 1,), p_columns (n_p,), p_data (n_p, k, n_modes), turns (n, k, k), coarse (n_aggregates,
    n_modes), fine (n, k); `zero` has length n_modes, `none` length k.
    """
    for i in range(first, last):
        s = none
        for p in range(p_starts[i], p_starts[i + 1]):
            s = plus(s, times(p_data, p, row(coarse, p_columns[unsigned(p)], zero), none))
        put(fine, i, plus(row(fine, i, none), times(turns, i, s, none)))


@kernel
def turn_back(first: int, last: int, turns: Any, x: Any, zero: Any) -> None:
    """Replace x by Q^T x at each node. Shapes: turns Q (n, k, k), x (n, k)."""
    for i in range(first, last):
        put(x, i, times_transposed(turns, i, row(x, i, zero), zero))


@kernel
def smoothed(first: int, last: int, inverse: Any, x: Any, result: Any, zero: Any) -> None:
    """Write D^-1 x. Shapes: inverse D^-1 (n, k, k), x, result (n, k)."""
    for i in range(first, last):
        put(result, i, times(inverse, i, row(x, i, zero), zero))


@kernel
def rotations(
    first: int, last: int, starts: Any, columns: Any, rest: Any, x: Any, held: Any, turns: Any, zero: Any
) -> None:
    """Write the rotation Q of each node: the orthogonal polar factor of the sum of d D^T over its neighbours.

    D is the undeformed vector to the neighbour, d the deformed one. In space by Newton's iteration (Higham 1986). Rows
    of held directions are zero, so that coarse corrections do not move them.

    Shapes: starts (n + 1,), columns (n_blocks,), rest, x, held (n, dim), turns (n, dim, dim).
    """
    dim = len(zero)  # known when compiled
    F = np.empty((dim, dim))
    G = np.empty((dim, dim))
    for i in range(first, last):
        F[:] = 0.0
        for p in range(starts[i], starts[i + 1]):
            j = columns[unsigned(p)]
            d, D = minus(row(x, j, zero), row(x, i, zero)), minus(row(rest, j, zero), row(rest, i, zero))
            for c in range(dim):
                for e in range(dim):
                    F[c, e] += d[c] * D[e]
        if dim == 2:
            cosine, sine = F[0, 0] + F[1, 1], F[1, 0] - F[0, 1]
            size = np.sqrt(cosine * cosine + sine * sine)
            if size > 0.0:
                cosine, sine = cosine / size, sine / size
            else:
                cosine, sine = 1.0, 0.0
            F[0, 0], F[0, 1], F[1, 0], F[1, 1] = cosine, -sine, sine, cosine
        else:
            for _ in range(20):
                for c in range(3):
                    for e in range(3):
                        a, b = (c + 1) % 3, (c + 2) % 3
                        u, v = (e + 1) % 3, (e + 2) % 3
                        G[c, e] = F[a, u] * F[b, v] - F[a, v] * F[b, u]
                det = F[0, 0] * G[0, 0] + F[0, 1] * G[0, 1] + F[0, 2] * G[0, 2]
                size, other = 0.0, 0.0
                for c in range(3):
                    for e in range(3):
                        size += F[c, e] ** 2
                        other += G[c, e] ** 2
                if not det > 1e-9 * size**1.5:  # flat or inverted: use the identity
                    for c in range(3):
                        for e in range(3):
                            F[c, e] = 1.0 if c == e else 0.0
                    break
                scale = np.sqrt(np.sqrt(other / size) / det)
                change = 0.0
                for c in range(3):
                    for e in range(3):
                        value = 0.5 * (scale * F[c, e] + G[c, e] / (scale * det))
                        change += (value - F[c, e]) ** 2
                        F[c, e] = value
                if change < 1e-8:
                    break
        for c in range(dim):
            for e in range(dim):
                turns[i, c, e] = 0.0 if held[i, c] else F[c, e]
