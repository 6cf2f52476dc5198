"""Elements of several kinds in one table: each as a quadrilateral or hexahedron, with repeated corners."""

import itertools
from collections.abc import Mapping

import numpy as np

from truespring.arrays import Bools, Ints
from truespring.errors import MeshError
from truespring.mesh.kinds import ELEMENT_KINDS, MIRRORED, MIXED, ElementKind

# The kind as which elements are stored, by dimension.
_WHOLE = {2: "quadrilateral", 3: "hexahedron"}


def width(dim: int) -> int:
    """Return the number of columns of the table; raise MeshError unless `dim` is 2 or 3."""
    if dim not in _WHOLE:
        raise MeshError(f"elements of several kinds fill 2 or 3 dimensions, the nodes have {dim}")
    return ELEMENT_KINDS[_WHOLE[dim]].n_nodes


def mixed_table(cells: Mapping[str, Ints]) -> Ints:
    """Return elements of several kinds in one table, shape (n_elements, 4 or 8), in the order of `cells`."""
    tables = []
    for kind, elements in cells.items():
        own = ELEMENT_KINDS.get(kind)
        if own is None or not own.merged:
            allowed = ", ".join(name for name, other in ELEMENT_KINDS.items() if other.merged)
            raise MeshError(f"'{kind}' elements cannot be mixed with others; allowed: {allowed}")
        given = np.asarray(elements)
        if given.ndim != 2 or given.shape[1] != own.n_nodes:
            raise MeshError(f"elements of kind {kind} have {own.n_nodes} nodes each, not shape {given.shape}")
        tables.append(given[:, own.merged])
    if len({table.shape[1] for table in tables}) != 1:
        raise MeshError(f"{', '.join(cells)}: the elements of a mesh are all plane or all solid")
    return np.concatenate(tables)


def unmerged(elements: Ints) -> dict[str, tuple[Ints, Ints]]:
    """Return for each kind in a table its elements, ascending, shape (n,), and their distinct nodes, shape (n, k).

    Raises MeshError if the repeated corners of an element match no kind.
    """
    found, known = {}, np.zeros(len(elements), dtype=bool)
    for name, kind in ELEMENT_KINDS.items():
        if len(kind.merged) == elements.shape[1]:
            is_own = _are(elements, kind) & ~known
            known |= is_own
            numbers = np.flatnonzero(is_own)
            if numbers.size:
                found[name] = (numbers, elements[numbers][:, [kind.merged.index(node) for node in range(kind.n_nodes)]])
    if not known.all():
        first = int(known.argmin())
        raise MeshError(
            f"{int((~known).sum())} of {len(known)} elements are degenerate: their coinciding corners match no kind of "
            f"element; the first is element {first}, of nodes {', '.join(map(str, elements[first].tolist()))}"
        )
    return found


def kinds_in(elements: Ints, kind: str) -> list[tuple[str, Ints, Ints]]:
    """Return name, elements, shape (n,), and their nodes, shape (n, k), of each kind in a table.

    `kind` is a kind or "mixed".
    """
    if kind != MIXED:
        return [(kind, np.arange(len(elements)), elements)]
    return [(name, numbers, own) for name, (numbers, own) in unmerged(elements).items()]


def mirrored(elements: Ints, kind: str, which: Bools) -> Ints:
    """Return the table, shape (n_elements, k), with elements `which` in mirrored node order; `kind` may be "mixed"."""
    found = elements.copy()
    for name, numbers, own in kinds_in(elements, kind):
        here = which[numbers]
        turned = own[here][:, MIRRORED[name]]
        found[numbers[here]] = turned if kind != MIXED else turned[:, ELEMENT_KINDS[name].merged]
    return found


def repeats(elements: Ints) -> Bools:
    """Return whether each element names a node twice, shape (n_elements,)."""
    ordered = np.sort(elements, axis=1)
    return np.asarray((ordered[:, 1:] == ordered[:, :-1]).any(axis=1))


def turned(elements: Ints) -> Ints:
    """Return the table, shape (n_elements, 4 or 8), with repeated corners rotated to those of `ElementKind.merged`.

    Programs write wedges and pyramids as bricks with repeated corners, in various places. Elements that match no kind
    are unchanged.
    """
    found = elements.copy()
    left = np.flatnonzero(repeats(elements))
    kinds = [kind for kind in ELEMENT_KINDS.values() if len(kind.merged) == elements.shape[1]]
    for turn in _turns(elements.shape[1]):
        rows = elements[left][:, turn]
        fits = np.any([_are(rows, kind) for kind in kinds], axis=0)
        found[left[fits]] = rows[fits]
        left = left[~fits]
    return found


def _turns(corners: int) -> list[list[int]]:
    """Return the rotations of a square or a cube as permutations of its corners."""
    dim = int(corners).bit_length() - 1
    places = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    places = 2 * places[:corners, :dim] - 1
    found = []
    for axes in itertools.permutations(range(dim)):
        for signs in itertools.product((1, -1), repeat=dim):
            matrix = np.eye(dim, dtype=np.int64)[list(axes)] * signs
            if round(float(np.linalg.det(matrix))) == 1:
                after = (places @ matrix.T).tolist()
                found.append([places.tolist().index(place) for place in after])
    return found


def _are(elements: Ints, kind: ElementKind) -> Bools:
    """Return whether each element repeats exactly the corners that the kind repeats, shape (n_elements,)."""
    own = np.ones(len(elements), dtype=bool)
    for one in range(elements.shape[1]):
        for other in range(one):
            same = elements[:, one] == elements[:, other]
            own &= same == (kind.merged[one] == kind.merged[other])
    return own
