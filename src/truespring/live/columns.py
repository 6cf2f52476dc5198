"""A body of springs of constant stiffness as arrays for compiled loops, see `kernels.leapfrog`."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from truespring.arrays import Bools, Floats, Ints
from truespring.mesh.rows import distinct_rows
from truespring.potential import ConstantCells

# The signs of the corners of a hexahedron along its three axes, in VTK's order, shape (8, 3).
_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]]
)
# The modes a_1, a_2, a_3, h_1, h_2, h_3, g, shape (7, 8), and their order if the second axis is taken for the first.
_MODES = np.stack(
    [*_CORNERS.T, *(np.delete(_CORNERS, i, axis=1).prod(axis=1) for i in range(3)), _CORNERS.prod(axis=1)]
)
_TURNED = np.array([1, 2, 0, 4, 5, 3, 6])
# The nodes of the left column, around the first axis, and those of the right one.
_LEFT, _RIGHT = np.array([0, 3, 7, 4]), np.array([1, 2, 6, 5])
# How much more rows of nodes with consecutive numbers count, and rounding below which constants of bricks are equal.
_IN_ORDER, _EQUAL = 0.25, 1e-13
# Largest product of two modes in a matrix that counts as one of modes, over the largest entry: rounding.
_ROUNDING = 1e-11


class Arrays(NamedTuple):
    """A body for the loops of `kernels.leapfrog`, which has shapes and units."""

    columns: Any
    straight: Bools
    which: Ints
    constants: Floats
    springs: tuple[Any, Any, Floats]
    cells: tuple[Any, ...]


def arrays(several: Sequence[ConstantCells], n_nodes: int) -> Arrays:
    """Return a body of elements of several kinds: bricks in rows, others one by one."""
    bricks = [(one, stiffness) for one in several if (stiffness := _modal(one)) is not None]
    others = [one for one in several if _modal(one) is None]
    found = _batches(*bricks[0]) if bricks else _no_batches()
    return Arrays(*found, _springs(others, n_nodes), _volumes(others, several[0].simplices.shape[1]))


def _volumes(several: Sequence[ConstantCells], corners: int) -> tuple[Any, ...]:
    """Return the volumes of elements of several kinds as the kernels take them; `corners` is that of a simplex."""
    none = np.zeros(0, dtype=np.int64)
    counts = np.array([len(one.simplices) for one in several], dtype=np.int64)
    simplices = np.zeros((len(several), counts.max(initial=0), corners), dtype=np.int64)
    for kind, one in enumerate(several):
        simplices[kind, : counts[kind]] = one.simplices
    sizes = np.concatenate([none, *(np.full(*one.elements.shape) for one in several)])
    numbers = np.concatenate([none, *(one.elements.ravel() for one in several)]).astype(np.int32)
    kinds = np.concatenate([none, *(np.full(len(one.elements), kind) for kind, one in enumerate(several))])
    law = [[one.undeformed, one.across, one.offset, one.slope] for one in several]
    values = [np.concatenate([np.zeros(0), *(one[q] for one in law)]) for q in range(4)]
    weights = np.array([float(one.weight) for one in several])
    return numbers, np.concatenate([none, [0], np.cumsum(sizes)]), kinds, counts, simplices, weights, *values


def _springs(several: Sequence[ConstantCells], n_nodes: int) -> tuple[Any, Any, Floats]:
    """Return starts, columns and weights of the springs of elements, each pair of nodes once in each row."""
    total = sparse.csr_array((n_nodes, n_nodes))
    for one in several:
        k = one.elements.shape[1]
        values = -one.shear[:, None, None] * one.matrices[one.of]
        rows, columns = np.repeat(one.elements, k, axis=1).ravel(), np.tile(one.elements, (1, k)).ravel()
        apart = rows != columns
        total = total + sparse.csr_array((values.ravel()[apart], (rows[apart], columns[apart])), shape=total.shape)
    total.sort_indices()
    return total.indptr.astype(np.int32), total.indices.astype(np.int32), total.data.astype(np.float64)


def _modal(cells: ConstantCells) -> Floats | None:
    """Return the stiffness of the modes of elements [N/m], shape (n_elements, 7); None unless they are bricks."""
    if cells.elements.shape[1] != len(_CORNERS) or not len(cells.elements):
        return None
    products = _MODES @ cells.matrices @ _MODES.T / len(_CORNERS) ** 2
    own = np.einsum("nqq->nq", products)
    rest = np.abs(products - own[:, :, None] * np.eye(len(_MODES)))
    if rest.max() > _ROUNDING * np.abs(products).max():
        return None
    return np.asarray(cells.shear[:, None] * own[cells.of])


def _batches(cells: ConstantCells, stiffness: Floats) -> tuple[Any, Bools, Ints, Floats]:
    """Return columns of bricks, whether they are straight, which constants they have, and these, see `kernels.columns`.

    `stiffness` [N/m] has shape (n_elements, 7).
    """
    from truespring.kernels.columns import CONSTANTS, GROUP, WIDTH

    turn, after = _rows(cells.elements)
    elements, order = cells.elements[:, _turned(turn)], np.arange(len(_MODES))
    for _ in range(turn):
        order = order[_TURNED]
    law = (1 / cells.undeformed, np.ones(len(elements)), cells.offset, cells.slope)
    known = np.column_stack([stiffness[:, order], *law])
    ends, starts = elements[:, _RIGHT], elements[:, _LEFT]
    columns: list[Ints] = []
    chosen: list[int] = []  # the element after each column, -1 for none
    for row in _chains(after):
        columns.append(starts[row[0]])
        for e in row:
            if len(columns) % WIDTH == 0:  # an element is not divided between two batches
                chosen.append(-1)
                columns.append(starts[e])
            chosen.append(e)
            columns.append(ends[e])
        chosen.append(-1)
    missing = -len(columns) % WIDTH
    nodes = np.array([*columns, *[columns[-1]] * missing], np.int32).reshape(-1, WIDTH, 4)
    of = np.array([*chosen, *[-1] * missing], np.int64)
    constants = np.where((of < 0)[:, None], 0.0, known[of]).reshape(-1, WIDTH, CONSTANTS)
    around = np.ascontiguousarray(nodes.transpose(0, 2, 1))
    groups = around.reshape(len(nodes), 4, WIDTH // GROUP, GROUP)
    straight = (np.diff(groups, axis=3) == 1).all(axis=3)
    return around, straight, *_distinct(np.ascontiguousarray(constants.transpose(0, 2, 1)))


def _distinct(constants: Floats) -> tuple[Ints, Floats]:
    """Return which of the distinct constants each batch has, shape (n_batches,), and these: few stay in the cache."""
    scale = np.abs(constants).max(axis=(0, 2))[:, None]
    keys = np.round(constants / (_EQUAL * np.where(scale > 0, scale, 1.0))).reshape(len(constants), -1)
    _, first, of = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return np.asarray(of).ravel(), np.ascontiguousarray(constants[first])


def _no_batches() -> tuple[Any, Bools, Ints, Floats]:
    """Return the columns and constants of no bricks."""
    from truespring.kernels.columns import CONSTANTS, GROUP, WIDTH

    nodes, straight = np.zeros((0, 4, WIDTH), dtype=np.int32), np.zeros((0, 4, WIDTH // GROUP), dtype=bool)
    return nodes, straight, np.zeros(0, dtype=np.int64), np.zeros((0, CONSTANTS, WIDTH))


def _turned(turn: int) -> Ints:
    """Return the order of an element's nodes if an axis, 0, 1 or 2, is taken for the first, the next for the second."""
    turned = np.roll(_CORNERS, turn, axis=1)  # the signs along the element's own axes
    return np.array([int((one == _CORNERS).all(axis=1).argmax()) for one in turned])


def _rows(elements: Any) -> tuple[int, Ints]:
    """Return the axis along which most elements follow each other, and the element after each one, -1 for none.

    An axis along which nodes have consecutive numbers, which are read at once, counts more.
    """
    found = []
    for turn in range(3):
        turned = elements[:, _turned(turn)]
        after = _after(turned[:, _LEFT], turned[:, _RIGHT])
        in_order = float((turned[:, _RIGHT] - turned[:, _LEFT] == 1).mean())
        found.append((float((after >= 0).sum()) * (1 + _IN_ORDER * in_order), -turn, after))
    _, turn, after = max(found, key=lambda one: one[:2])
    return -turn, after


def _after(left: Ints, right: Ints) -> Ints:
    """Return the number of the row of `left` that equals each row of `right`, -1 for none; shape (n, 4) each."""
    n = len(left)
    if not n:
        return np.zeros(0, dtype=np.int64)
    of = distinct_rows(tuple(np.concatenate([left, right]).T)).of
    owner = np.full(2 * n, -1)
    owner[of[:n]] = np.arange(n)
    return owner[of[n:]]


def _chains(after: Ints) -> list[list[int]]:
    """Return the rows of elements, each element once, in the order of their first elements; rings last."""
    n = len(after)
    first = np.ones(n, dtype=bool)
    first[after[after >= 0]] = False
    following, seen = after.tolist(), [False] * n
    rows = []
    for begin in [*np.flatnonzero(first).tolist(), *range(n)]:
        row, e = [], begin
        while e >= 0 and not seen[e]:
            seen[e] = True
            row.append(e)
            e = following[e]
        if row:
            rows.append(row)
    return rows
